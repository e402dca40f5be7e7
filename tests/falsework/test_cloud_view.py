"""The cloud of the report: what the page is given, and what a browser makes of it."""

import base64
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsework.report.cloud_view import (
    SHOWN_POINTS,
    cloud_view,
    instance_color,
    script_json,
    uncertainty_levels,
    uncertainty_scale,
)
from falsework.report.report import write_report
from recon.cloud import Cloud, read_cloud, write_cloud
from tests.learn.toy_bridge import toy_cloud

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FOUND = "found in the page"
WATCH = "<script>window.mistakes = []; window.onerror = (text) => { window.mistakes.push(String(text)); };</script>"
ASK = f"<script>{Path(__file__).with_name('cloud_view.js').read_text(encoding='utf-8')}</script>"


def small_cloud() -> Cloud:
    """Make a cloud with every uncertainty, some of them unknown, and a few components."""
    count, rng = 600, np.random.default_rng(5)
    uncertainty = np.geomspace(1e-4, 20.0, count).astype(np.float32)
    uncertainty[::50] = np.nan
    return toy_cloud(
        2,
        count,
        uncertainty=uncertainty,
        color=rng.integers(0, 256, (count, 3)).astype(np.uint8),
        instance=rng.integers(0, 4, count).astype(np.uint32),
    )


def unpacked(text: str, kind: str) -> np.ndarray:
    """Read an array of the page."""
    return np.frombuffer(base64.b64decode(text), kind)


def test_every_uncertainty_has_a_level() -> None:
    """Each tenfold is a quarter of the scale, whose colours go from blue to red; the unknown has a level apart."""
    given = np.array([0.0, 0.001, 0.01, 0.1, 1.0, 10.0, np.inf, np.nan], np.float32)
    assert uncertainty_levels(given).tolist() == pytest.approx([0, 0, 63.5, 127, 190.5, 254, 254, 255], abs=0.5)
    scale = uncertainty_scale().astype(int)
    assert len(scale) == 255
    assert len({tuple(color) for color in scale.tolist()}) > 200
    assert scale[0, 2] > scale[0, 0]
    assert scale[254, 0] > scale[254, 2]


def test_components_are_told_apart() -> None:
    """A hundred of them have a hundred colours; what belongs to none is grey."""
    assert len({instance_color(number) for number in range(1, 101)}) == 100
    red, green, blue = instance_color(0)
    assert max(red, green, blue) - min(red, green, blue) < 20


def test_the_page_is_given_the_points() -> None:
    """Every third point of many, to a hundredth of the span over 655; class, colour and number as in the cloud."""
    rng, count = np.random.default_rng(1), 2 * SHOWN_POINTS + 1
    columns = {
        "coord": rng.uniform(-50, 50, (count, 3)),
        "color": rng.integers(0, 255, (count, 3), np.uint8),
        "segment": rng.integers(1, 4, count).astype(np.uint8),
        "instance": rng.integers(0, 9, count).astype(np.uint32),
        "uncertainty": rng.uniform(0, 1, count).astype(np.float32),
    }
    cloud = small_cloud()
    view = cloud_view(columns, cloud.classes, np.eye(3))
    data = json.loads(view["data"])
    assert (data["every"], data["count"]) == (3, len(columns["coord"][::3]))
    place = np.array(data["low"]) + np.array(data["step"]) * unpacked(data["place"], "<u2").reshape(-1, 3)
    apart = place - columns["coord"][::3]  # the page begins at an origin of its own, in whole metres
    assert np.abs(apart - np.round(apart[0])).max() <= 100 / 65535
    np.testing.assert_array_equal(unpacked(data["color"], "u1").reshape(-1, 3), columns["color"][::3])
    np.testing.assert_array_equal(unpacked(data["segment"], "u1"), columns["segment"][::3])
    painted = np.array(data["instances"])[unpacked(data["instance"], "<u2")]
    assert painted.tolist() == [list(instance_color(int(number))) for number in columns["instance"][::3]]
    assert {row["id"]: row["points"] for row in view["classes"]} == dict(
        zip(*map(np.ndarray.tolist, np.unique(columns["segment"], return_counts=True)), strict=True)
    )


def test_names_cannot_end_the_script() -> None:
    """What a file calls a class stays data."""
    text = script_json({"name": "</script><script>alert(1)//&"})
    assert "<" not in text
    assert json.loads(text) == {"name": "</script><script>alert(1)//&"}


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_a_browser_paints_and_filters(tmp_path: Path) -> None:
    """Each button gives each point its color, the slider and the switches leave the points that they should."""
    cloud = small_cloud()
    (tmp_path / "cloud").mkdir()
    write_cloud(tmp_path / "cloud", cloud)
    write_report(tmp_path / "page.html", "Page", tmp_path / "scene.usda", {}, {"mesh": tmp_path / "cloud"})
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    page = page.replace("<head>", "<head>" + WATCH, 1).replace("</body>", ASK + "</body>")
    (tmp_path / "page.html").write_text(page, encoding="utf-8")
    told = browse(tmp_path / "page.html")
    columns = read_cloud(tmp_path / "cloud").columns
    levels = uncertainty_levels(columns["uncertainty"])
    colors = {row.id: row.color for row in cloud.classes}
    assert told["mistakes"] == []
    assert told["photo"] == [css(color) for color in columns["color"].tolist()]
    assert told["class"] == [css(colors[number]) for number in columns["segment"].tolist()]
    assert told["instance"] == [css(instance_color(number)) for number in columns["instance"].tolist()]
    known = levels < 255
    painted = np.array(told["uncertainty"])
    assert painted[known].tolist() == [css(color) for color in uncertainty_scale()[levels[known]].tolist()]
    assert len(set(painted[known].tolist())) > 20
    assert told["scale"]
    along = columns["coord"][:, 0]
    np.testing.assert_allclose(np.subtract(told["x"], told["x"][0]), along - along[0], atol=np.ptp(along) / 60000)
    assert told["slid"] == [len(levels), *(int((levels <= limit).sum()) for limit in (254, 200, 100, 0))]
    assert told["none"] == 0
    assert told["classes"] == [[row, int((columns["segment"] == row).sum())] for row in np.unique(columns["segment"])]
    assert told["all"] == len(levels)
    assert told["drawn"] > 20


def css(color: Any) -> str:
    """Spell a color as the page does."""
    return f"rgb({','.join(str(part) for part in color)})"


def browse(page: Path) -> dict[str, Any]:
    """Open a page without a window, and read what it says of itself."""
    assert CHROMIUM is not None
    words = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        f"--user-data-dir={page.parent / 'profile'}",
        "--virtual-time-budget=60000",
        "--dump-dom",
    ]
    answer = subprocess.run([CHROMIUM, *words, page.as_uri()], capture_output=True, text=True, check=True, timeout=300)
    return json.loads(answer.stdout.split(FOUND)[1].replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">"))
