"""What a browser shows of the pages: flights in space, and every page on a phone."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from falsework.report.report import write_report
from falsework.report.survey_page import write_survey_page
from recon.cloud import write_cloud
from tests.falsework.browser import needs_browser, open_page
from tests.falsework.flight_rows import judged_flight
from tests.falsework.live_browser import Tab, open_tab
from tests.falsework.test_cloud_view import VIEWS, small_cloud
from tests.falsework.test_report_pages import KINDS, elements_of, pages_of
from tests.recon.conftest import poses_on_arc, write_capture

FLIGHTS = """
dispatchEvent(new Event("beforeprint"));  // draws what is out of sight, too
const card = document.querySelector(".card.space"), { space } = card, { gl } = space.pen;
card.querySelector("input[name=cameras]").checked = false;
space.draw();
const bytes = new Uint8Array(4 * space.canvas.width * space.canvas.height);
gl.readPixels(0, 0, space.canvas.width, space.canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
let painted = 0;
for (let i = 3; i < bytes.length; i += 4) painted += bytes[i] > 0;
const colors = new Set(Array.from({ length: space.told.count }, (_, i) => space.colors.slice(3 * i, 3 * i + 3).join()));
const widths = [...document.querySelectorAll("td.track i")].slice(0, 2).map((bar) => bar.style.width);
return { painted, colors: colors.size, cameras: space.told.flight.cameras.length, widths };
"""


PHONE = """
dispatchEvent(new Event("beforeprint"));  // draws what is out of sight, too
document.body.style.width = "390px";
dispatchEvent(new Event("resize"));
const drawn = () => [...document.querySelectorAll(".main-svg")].map((one) => one.getBoundingClientRect().width).join();
for (let same = 0, before = ""; same < 3; before = drawn()) {  // until no figure changes any more
  same = drawn() === before ? same + 1 : 0;
  await new Promise((go) => setTimeout(go, 100));
}
const out = (one, place) => {
  const a = one.getBoundingClientRect(), b = place.getBoundingClientRect();
  return a.width > 0 && (a.left < b.left - 1 || a.right > b.right + 1);
};
const named = (all) => [...all].map((one) => `${one.tagName} ${one.textContent.slice(0, 60)}`);
const words = ".xtitle, .ytitle, .xtick text, .ytick text, .legendtext";
const texts = [...document.querySelectorAll(".figure")].flatMap((place) =>
  [...place.querySelectorAll(words)].filter((one) => out(one, place)));
const scrolls = (one) => getComputedStyle(one.closest(".card")).overflowX === "auto";
const tables = [...document.querySelectorAll("table")].filter((one) => out(one, one.parentElement) && !scrolls(one));
const places = [...document.querySelectorAll(".card, .tile, header, h2")].filter((one) => out(one, document.body));
const first = [...document.querySelectorAll(".wide")].filter((one) => {
  one.scrollLeft = 60;  // the first column and the heading stay
  return [...one.querySelectorAll("tr > :first-child, h3")].some((cell) => out(cell, one));
});
const found = { texts: named(texts), tables: named(tables), places: named(places), first: named(first) };
return { narrow: innerWidth <= 560, ...found };
"""


LATER = """
const cards = [...document.querySelectorAll(".card.space")], figures = [...document.querySelectorAll(".figure")];
const drawn = () => figures.filter((one) => one.drawn).length;
const state = () => [cards.map((card) => Boolean(card.space)), drawn(), Boolean(window.Plotly)];
const told = { first: state() };
document.documentElement.style.scrollBehavior = "auto";
cards[2].scrollIntoView();
while (!cards[2].space) await new Promise((go) => setTimeout(go, 20));
told.scrolled = cards.map((card) => Boolean(card.space))[2];
dispatchEvent(new Event("beforeprint"));
told.printed = state();
told.svg = figures.every((one) => one.querySelector(".main-svg"));
return told;
"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Give a page of each kind, with plain names."""
    return dict(zip(KINDS, pages_of(tmp_path_factory.mktemp("pages") / "plain", "plain"), strict=True))


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """Open one browser for all pages."""
    with open_tab("about:blank", tmp_path_factory.mktemp("browser") / "profile") as tab:
        yield tab


@needs_browser
def test_the_page_of_flights_shows_bridge_and_cameras(pages: dict[str, Path], tab: Tab) -> None:
    """In space the surface wears the colors of its classes; figures are judged as on the command line."""
    page = pages["flights"]
    tab.open(page)
    told = tab.run(FLIGHTS)
    assert told["cameras"] == 12
    assert told["colors"] == 2  # of a class that is ours, and of one that is not
    assert told["painted"] > 1000
    assert told["widths"] == ["60%", "20%"]  # best class first
    text = " ".join(" ".join(elements_of(page).text).split())
    for words in ("enough (from 70 %)", "too little (from 90 %)", "2.0 mm", "– at the 95th", "poorly", "well"):
        assert words in text, words
    assert "30 images more would show 1 of these 2: falsework survey plan plain --kind inspection" in text


@needs_browser
def test_what_is_out_of_sight_is_drawn_later(tmp_path: Path) -> None:
    """At first nothing below the window, and no Plotly; a view when it is scrolled to; all before printing."""
    page = tmp_path / "page.html"
    write_survey_page(page, [judged_flight(word) for word in ("global", "local", "grid")], "scene.usda")
    told = open_page(page, LATER).told  # in virtual time: nothing rests before it is asked
    assert told["first"][0][1:] == [False, False]
    assert told["first"][1:] == [0, False]
    assert told["scrolled"]
    assert told["printed"] == [[True, True, True], 6, True]
    assert told["svg"]


@needs_browser
@pytest.mark.parametrize("kind", ["dataset", "training", "comparison", "flights", "run"])
def test_nothing_is_clipped_on_a_phone(pages: dict[str, Path], kind: str, tab: Tab) -> None:
    """390 pixels wide: texts of figures stay inside, tables that are wider scroll, their first column stays."""
    tab.open(pages[kind], 390, 2400)
    nothing: list[str] = []
    told = tab.run(PHONE)
    assert told == {"narrow": True, "texts": nothing, "tables": nothing, "places": nothing, "first": nothing}


@needs_browser
def test_the_page_of_a_scene_fits_a_phone(tab: Tab, tmp_path: Path) -> None:
    """Nothing is clipped, and the chart of classes writes every name level, which a phone had tilted or left out."""
    capture = write_capture(tmp_path / "capture", poses_on_arc(3))
    cloud = small_cloud(300)
    cameras = tuple({"name": f"{k:06d}", "status": "ok", "center_error": 0.1} for k in range(VIEWS))
    (tmp_path / "cloud").mkdir()
    write_cloud(tmp_path / "cloud", replace(cloud, cameras=cameras))
    page = tmp_path / "scene.html"
    write_report(page, "Scene", tmp_path, {"local": (capture, {"": tmp_path / "cloud"})})
    names = 'const names = [...document.querySelectorAll(".ytick text")].map((one) => one.textContent);'
    script = PHONE.replace("return { narrow", f"{names}\nreturn {{ names, narrow")
    tab.open(page, 390, 2400)
    told = tab.run(script)
    classes = {row.name for row in cloud.classes if (cloud.columns["segment"] == row.id).any()}
    assert classes <= set(told.pop("names"))
    nothing: list[str] = []
    assert told == {"narrow": True, "texts": nothing, "tables": nothing, "places": nothing, "first": nothing}
