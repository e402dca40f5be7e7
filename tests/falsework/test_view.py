"""`falsework view`: which point a click means and what is told of it, what is shown, and what a browser makes of it."""

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from falsework.view.points import PAINTS, as_code, picked_row, point_colors, point_facts, shown_rows
from falsework.view.saved import SOURCES, lead_words, title_words
from falsework.view.subject import Subject, find_subject
from falsework.view.viewer import LOOPBACK, Viewer, rotation_quaternion, sighting_crops
from groundwork.errors import FalseworkError
from groundwork.progress import SILENT
from recon.cloud import SFM_DENSE, Cloud, write_cloud
from recon.cloud import SOURCES as CLOUD_SOURCES
from render.capture import read_capture
from tests.falsework.browser import needs_browser
from tests.falsework.live_browser import open_tab
from tests.falsework.test_cloud_view import VIEWS, small_cloud
from tests.falsework.test_sample_verbs import run as call
from tests.patience import left
from tests.recon.conftest import poses_on_arc, write_capture


def carpet() -> Cloud:
    """Make a cloud so dense that every ray at its middle means one of its points."""
    cloud = small_cloud(3600)
    x, y = np.meshgrid(np.linspace(-6, 6, 60), np.linspace(-6, 6, 60))
    coord = np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3) + np.array([4e5, 5e6, 30.0])
    return replace(cloud, columns={**cloud.columns, "coord": coord})


@pytest.fixture
def subject(tmp_path: Path) -> Subject:
    """Give a cloud to look at."""
    folder = tmp_path / "carpet"
    folder.mkdir()
    write_cloud(folder, carpet())
    return find_subject(folder)


def test_a_click_means_the_point_in_front() -> None:
    """Rays at points beside which no other is seen mean them; of those in line the nearest; none behind the eye."""
    rng, alone = np.random.default_rng(0), 0
    for _ in range(200):
        places = rng.uniform(-10.0, 10.0, (400, 3))
        origin = rng.uniform(-40.0, 40.0, 3)
        wanted = int(rng.integers(400))
        ray = (places[wanted] - origin) / np.linalg.norm(places[wanted] - origin)
        seen = (places - origin) / np.linalg.norm(places - origin, axis=1, keepdims=True)
        beside = np.arccos(np.clip(seen @ ray, -1.0, 1.0))  # as seen from the eye
        others = np.delete(beside, wanted).min()
        if others > 0.0085:
            alone += 1
            assert picked_row(places, origin, ray) == wanted
        hidden = np.vstack([origin + 0.5 * (places[wanted] - origin), places])
        assert picked_row(hidden, origin, ray) == 0 or others <= 0.0085
    assert alone > 20
    assert picked_row(np.array([[0.0, 0.0, -5.0]]), np.zeros(3), np.array([0.0, 0.0, 1.0])) == -1
    assert picked_row(np.array([[0.1, 0.0, 5.0]]), np.zeros(3), np.array([0.0, 0.0, 1.0])) == -1
    assert picked_row(np.zeros((0, 3)), np.zeros(3), np.array([0.0, 0.0, 1.0])) == -1


def test_what_is_told_of_a_point_is_what_the_cloud_says() -> None:
    """Class, component, uncertainty, and each image with its pixel; names are shown sign by sign."""
    cloud = small_cloud()
    for row in (0, 7, 599):
        facts = point_facts(cloud, row)
        assert facts.instance == cloud.columns["instance"][row]
        assert facts.component == cloud.components[cloud.columns["component"][row]]
        assert np.isnan(facts.uncertainty) == np.isnan(cloud.columns["uncertainty"][row])
        assert [one.image for one in facts.sightings] == [f"image {k}" for k in range(VIEWS)]
        assert [one.pixel for one in facts.sightings] == [
            tuple(pixel) for pixel in cloud.observations["uv"][row * VIEWS : (row + 1) * VIEWS].tolist()
        ]
        assert facts.as_markdown().count("\n- ") == VIEWS
    assert as_code("a`<img>\n[x](javascript:0)") == "`a'<img> [x](javascript:0)`"


def test_slider_and_switches_choose_points() -> None:
    """Exactly those of the classes whose uncertainty is known and small enough; without a limit the unknown, too."""
    cloud = small_cloud()
    sure, segment = cloud.columns["uncertainty"], cloud.columns["segment"]
    classes = np.unique(segment)[:2].tolist()
    for limit in (0.001, 0.1, 5.0, np.inf):
        wanted = [
            row
            for row in range(len(cloud))
            if segment[row] in classes and (sure[row] <= limit or (np.isinf(limit) and np.isnan(sure[row])))
        ]
        assert shown_rows(cloud, limit, classes).tolist() == wanted
    assert {paint: point_colors(cloud, paint).shape for paint in PAINTS} == dict.fromkeys(PAINTS, (600, 3))
    assert len(np.unique(point_colors(cloud, "uncertainty"), axis=0)) > 100
    assert len(np.unique(point_colors(cloud, "instance"), axis=0)) == len(np.unique(cloud.columns["instance"]))


def test_the_viewer_answers_clicks_and_controls(subject: Subject) -> None:
    """A ray at a point tells of it, also far from the world's origin; slider and switches count; the door is local."""
    viewer = Viewer(subject, 8500, SILENT)
    try:
        assert viewer.server.get_host() == LOOPBACK == "127.0.0.1"
        assert viewer.address.startswith(f"http://{LOOPBACK}:")
        cloud = carpet()
        place = cloud.columns["coord"][1234] - viewer.origin
        assert np.abs(viewer.origin - cloud.columns["coord"].mean(axis=0)).max() < 10.0
        facts = viewer.click((float(place[0]), float(place[1]), float(place[2]) + 9.0), (0.0, 0.0, -2.0))
        assert facts is not None
        assert facts.row == 1234
        assert "seen by 3 images" in viewer.told.content
        assert viewer.click((0.0, 0.0, 9.0), (0.0, 0.0, 1.0)) is None
        viewer.slider.value = -1.0
        viewer.refresh()
        assert f"{int((cloud.columns['uncertainty'] <= 0.1).sum()):,} of 3,600" in viewer.count.content
        for box in viewer.classes.values():
            box.value = False
        viewer.refresh()
        assert ": 0 of 3,600" in viewer.count.content
    finally:
        viewer.stop()


@needs_browser
def test_a_browser_shows_the_viewer(subject: Subject, tmp_path: Path) -> None:
    """Points are drawn, a click with the mouse tells of one, nothing goes wrong on the console."""
    viewer = Viewer(subject, 8600, SILENT)
    try:
        with open_tab(viewer.address, tmp_path / "profile") as tab:
            tab.wait_for("document.body.innerText.includes('3,600 of 3,600 points')")
            tab.wait_for("document.querySelector('canvas') !== null")

            def colors() -> int:
                pixels = cv2.imdecode(np.frombuffer(tab.screenshot(), np.uint8), cv2.IMREAD_COLOR)
                assert pixels is not None
                return len(np.unique(pixels[200:360, 430:570].reshape(-1, 3), axis=0))

            end = time.monotonic() + left()
            while colors() <= 20:
                assert time.monotonic() < end, "the points are not drawn"
            while not tab.ask("document.body.innerText.includes('seen by 3 images')"):
                assert time.monotonic() < end, "no click tells of a point"
                tab.click(500, 278)  # the middle, which the view begins with
            viewer.slider.value = -1.0
            viewer.refresh()
            tab.wait_for("document.body.innerText.includes('uncertainty at most 100 mm')")
            assert tab.console == []
    finally:
        viewer.stop()


def test_crops_show_what_is_around_the_pixel(tmp_path: Path) -> None:
    """The cross stands on the pixel, which is enlarged twice; images that are not there are left out."""
    capture = read_capture(write_capture(tmp_path / "capture", poses_on_arc(2)))
    names = [image.name for image in capture.images]
    cloud = small_cloud()
    cloud = replace(cloud, cameras=tuple({"name": name, "status": "ok"} for name in (names[0], names[1], "gone")))
    crops = sighting_crops(capture, point_facts(cloud, 0))
    assert len(crops) == 2
    assert {crop.shape for crop in crops} == {(120, 120, 3)}
    assert {tuple(crop[60, 60].tolist()) for crop in crops} == {(255, 90, 60)}
    w, x, y, z = rotation_quaternion(np.diag([1.0, -1.0, -1.0]))
    assert (abs(w), abs(x), abs(y), abs(z)) == pytest.approx((0, 1, 0, 0), abs=1e-12)


def test_what_there_is_to_look_at(subject: Subject, tmp_path: Path) -> None:
    """A cloud, a capture, a scene of a run; anything else is refused with what is allowed."""
    assert subject.clouds.keys() == {"carpet"}
    capture = write_capture(tmp_path / "scene/capture/local", poses_on_arc(2))
    assert find_subject(capture).captures == {"local": capture}
    (tmp_path / "scene/cloud/local+dense").mkdir(parents=True)
    (tmp_path / "scene/cloud/local+dense/cloud.json").touch()
    scene = find_subject(tmp_path / "scene")
    assert (list(scene.captures), list(scene.clouds), scene.stage) == (["local"], ["local+dense"], None)
    assert scene.capture_of("local+dense") == capture
    (tmp_path / "empty").mkdir()
    with pytest.raises(FalseworkError, match="nothing that can be shown"):
        find_subject(tmp_path / "empty")


def test_the_title_is_words(tmp_path: Path) -> None:
    """Of a scene: kind of bridge and where it stands; without a manifest, or with a damaged one, its name."""

    def title(text: str) -> str:
        (tmp_path / "manifest.json").write_text(text)
        return title_words(Subject("0000", tmp_path / "scene.usda", {}, {}))

    for family, world, words in (
        ("beam", "countryside", "Beam bridge in the countryside"),
        ("cable_stayed", "none", "Cable-stayed bridge"),
        ("arch", "../worlds/zurich", "Arch bridge in the world zurich"),
        ({"slab": 1.0, "beam": 1.0}, "city", "Bridge in a city"),
    ):
        settings = {"bridge": {"family": family}, "background": {"name": world}}
        assert title(json.dumps({"settings": settings})) == words
    for damaged in ("{}", "[1]", '{"settings": {"bridge": 3}}', "{"):
        assert title(damaged) == "Bridge 0000"
    assert title_words(Subject("carpet", None, {}, {"carpet": tmp_path})) == "Point cloud carpet"
    assert title_words(Subject("local", None, {"local": tmp_path}, {})) == "Flight local"


def test_the_lead_lists_what_is_shown(tmp_path: Path) -> None:
    """Model, flight and cloud, each in words; every source of a cloud has some."""
    assert set(SOURCES) == set(CLOUD_SOURCES)
    scene = Subject("0000", tmp_path / "scene.usda", {"global": tmp_path}, {"global+dense": tmp_path})
    assert lead_words(scene, "global+dense", replace(carpet(), source=SFM_DENSE), "global") == (
        "Model, cameras of the flight global, 3,600 points reconstructed from its photographs (cloud global+dense); "
        "scene 0000"
    )
    assert lead_words(replace(scene, captures={}), "", None, "") == "Model, no cloud"


def test_mistakes_are_one_line(
    subject: Subject, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without viser the line names the extra, and the page needs none; no such cloud, port or folder: exit code 2."""
    place = subject.clouds["carpet"]
    monkeypatch.setitem(sys.modules, "viser", None)
    monkeypatch.delitem(sys.modules, "falsework.view.viewer", raising=False)
    code, _, said = call(capsys, "view", place)
    assert (code, said.count("\n")) == (2, 1)
    assert "falsework[view]" in said
    page = tmp_path / "page.html"
    assert call(capsys, "view", place, "--save", page)[:2] == (0, f"page    {page}\n")
    assert page.stat().st_size < 10e6
    for words in (("--cloud", "other"), ("--port", "1")):
        code, _, said = call(capsys, "view", place, *words)
        assert (code, said.count("\n")) == (2, 1)
    assert call(capsys, "view", tmp_path / "nowhere")[0] == 2
