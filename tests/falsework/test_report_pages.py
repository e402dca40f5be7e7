"""The pages of scenes, runs, data sets, trainings and comparisons: what stands in them, and what cannot."""

import base64
import hashlib
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsework.commands.report_verb import kind_of
from falsework.execution import chain
from falsework.execution.run_facts import run_facts
from falsework.pipeline import run_scenario
from falsework.report.comparison_page import write_comparison_page
from falsework.report.dataset_page import write_dataset_page
from falsework.report.page import file_link, settings_rows, way_to
from falsework.report.report import write_report
from falsework.report.residuals import image_rows, model_fit, overlap_map, reprojection_residuals
from falsework.report.run_page import Event, FailureRow, RunFacts, SceneRow, write_run_page
from falsework.report.survey_page import write_survey_page
from falsework.report.training_page import write_training_page
from falsework.stages import STAGES
from falsework.view.saved import save_view
from falsework.view.subject import Subject
from groundwork.errors import FalseworkError
from groundwork.progress import SILENT
from learn.datasets.build import Source, build_dataset
from learn.datasets.settings import dataset_settings
from learn.scoring.record import tally_cloud, whole_record
from learn.scoring.votes import ScoredCloud
from recon.cloud import write_cloud
from tests.falsework.browser import needs_browser
from tests.falsework.flight_rows import judged_flight
from tests.falsework.live_browser import open_tab
from tests.falsework.test_cloud_view import VIEWS, small_cloud
from tests.falsework.test_sample_verbs import run as call
from tests.falsework.tiny_chain import tiny_scenario, tiny_stages
from tests.learn.toy_bridge import write_toy
from tests.recon.conftest import poses_on_arc, write_capture

SCRIPT = "\"></td></script><script>alert(1)</script><img src=x onerror=alert(2)>`' {{ 7*7 }}"
MOST = 10e6  # [bytes]
KINDS = ("run", "comparison", "training", "dataset", "view", "flights")


class Elements(HTMLParser):
    """Collects elements, attributes that run code, addresses, executable scripts and text."""

    def __init__(self) -> None:
        """Begin with nothing."""
        super().__init__()
        self.names: list[str] = []
        self.handlers: list[str] = []
        self.addresses: list[str] = []
        self.scripts: list[str] = []
        self.text: list[str] = []
        self.policy = ""
        self._runs = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take a start tag down."""
        told = dict(attrs)
        self.names.append(tag)
        self.handlers += [name for name in told if name.startswith("on")]
        self.addresses += [str(told[name]) for name in ("src", "href") if told.get(name)]
        self._runs = tag == "script" and told.get("type") in (None, "text/plain")  # the latter is run by the others
        if told.get("http-equiv") == "Content-Security-Policy":
            self.policy = str(told["content"])

    def handle_data(self, data: str) -> None:
        """Take a script or text down."""
        (self.scripts if self._runs else self.text).append(data)

    def handle_endtag(self, tag: str) -> None:
        """A script ends."""
        self._runs = False


def elements_of(page: Path) -> Elements:
    """Parse a page as a browser would."""
    elements = Elements()
    elements.feed(page.read_text(encoding="utf-8"))
    return elements


def evaluation(word: str) -> dict[str, Any]:
    """Score a cloud of three classes, of which one bears a name, on a bridge of that name."""
    rng, count = np.random.default_rng(0), 500
    truth = rng.integers(0, 3, count)
    likely = rng.dirichlet(np.ones(3), count).astype(np.float32)
    likely[np.arange(count), truth] += 1.0
    likely /= likely.sum(axis=1, keepdims=True)
    cloud = ScoredCloud(
        bridge=word,
        coord=rng.uniform(0, 9, (count, 3)),
        truth=truth.astype(np.int64),
        probabilities=likely,
        votes=np.ones(count, np.int64),
        uncertainty=rng.exponential(0.1, count).astype(np.float32),
        instance=truth.astype(np.int64) + 1,
    )
    return whole_record({word: tally_cloud(cloud, 3, (0,), 0.5, 3)}, ("background", word, "deck"), 0.5)


def comparison(word: str) -> dict[str, Any]:
    """Give the record of a comparison of two arms, all of whose names are a word."""
    matrix = [[8, 2], [1, 9]]
    row = {"group": [word, "b"], "model": word, "test": word, "seeds": [0, 1], "bridges": 2, "sure_mean_iou": 0.5}
    score = {**row, "mean_iou": 0.6, "mean_accuracy": 0.7, "overall_accuracy": 0.8, "mean_iou_sd": 0.1}
    score |= {"iou": {word: 0.5, "deck": 0.75}, "confusion": matrix, "mean_accuracy_sd": None}
    difference = {**row, "first": word, "second": "b", "seeds": 2, "difference": 0.1, "wins": 2}
    difference |= {
        "interval": [-0.1, 0.3],
        "over_seeds": [0.05, 0.15],
        "classes": {word: {"difference": 0.1, "p": 0.5}},
    }
    loss = {"group": [word, "b"], "part": word, "bridges": 2, "candidates": 9, "valid": 8, "common": 6}
    return {
        "format": "falsework.comparison",
        "format_version": 1,
        "title": word,
        "classes": [word, "deck"],
        "groups": [[word, "b"]],
        "level": 0.95,
        "draws": 100,
        "settings": {word: word},
        "facts": [word],
        "losses": [loss],
        "scores": [{**score, "arm": word}, {**score, "arm": "b"}],
        "differences": [difference],
        "command": word,
    }


def write_model(folder: Path, word: str) -> Path:
    """Write what a model says of itself, and the log of its training."""
    folder.mkdir()
    training = {"settings": {word: word}, "picked_epoch": 1, "validation": {"miou": 0.5}, "training_points": [5, 6]}
    facts = {"format": "falsework.model", "network": word, "classes": [word, "deck"], "training": training}
    (folder / "model.json").write_text(json.dumps(facts))
    (folder / "log.csv").write_text("epoch,loss,miou,accuracy,mean_accuracy\n0,1.5,0.2,0.4,0.3\n1,0.9,0.5,0.6,\n")
    return folder


def a_run(word: str) -> RunFacts:
    """Give a run of two scenes, one of them rejected, all of whose names are a word."""
    scenes = [
        SceneRow(
            word, {"stage": 1, "cloud": 2}, {word: {word: 70, "deck": 30}}, {word: (8, 9)}, "../scenes/x/report.html"
        ),
        SceneRow("!1", {"stage": 1}, {}, {}),
    ]
    failures = [FailureRow("!1", "cloud", "rejected", "no_model", word, (word,))]
    events = [Event(word, "stage", 100.0, 20.0, 5_000_000), Event("!1", "stage", 130.0, 25.0)]
    return RunFacts(word, ("stage", "capture", "cloud"), 3, scenes, failures, events, {word: word})


def pages_of(folder: Path, word: str) -> Iterator[Path]:
    """Write each kind of page with a word wherever a file could bring one."""
    folder.mkdir()
    name = word.replace("/", "")
    write_run_page(folder / "run.html", [a_run(word), a_run(word)])
    (folder / "comparison.json").write_text(json.dumps(comparison(word)))
    write_comparison_page(folder / "comparison.html", folder)
    model = write_model(folder / "model", word)
    (folder / "scores.json").write_text(json.dumps(evaluation(word)))
    scores = {word: folder / "scores.json", f"{word} again": folder / "scores.json"}
    write_training_page(folder / "training.html", {word: model, f"{word} 2": model}, scores)
    clouds = [write_toy(folder / f"{name}{i}", i, 1500, f"{word} {i}") for i in range(3)]
    (folder / "set").mkdir()
    values = {"points": 128, "fewest": 64, "tile": {"voxel": 0.4}}
    build_dataset([Source(path) for path in clouds], folder / "set", dataset_settings("local", values, "test"))
    stored = json.loads((folder / "set/dataset.json").read_text())
    stored["classes"][1] = word
    (folder / "set/dataset.json").write_text(json.dumps(stored))
    write_dataset_page(folder / "dataset.html", folder / "set", name)
    cloud = small_cloud(200)
    named = [{**row, "name": word} for row in cloud.cameras]
    (folder / name).mkdir()
    write_cloud(folder / name, replace(cloud, cameras=tuple(named)))
    save_view(folder / "view.html", Subject(word, None, {}, {word: folder / name}), word, "", SILENT)
    write_survey_page(folder / "flights.html", [judged_flight(word), judged_flight(f"{word} 2")], name)
    yield from (folder / f"{kind}.html" for kind in KINDS)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Path, Path]]:
    """Give each kind of page with plain names, and with names like scripts."""
    folder = tmp_path_factory.mktemp("pages")
    return list(zip(pages_of(folder / "plain", "plain"), pages_of(folder / "attacked", SCRIPT), strict=True))


@pytest.mark.parametrize("number", range(len(KINDS)), ids=KINDS)
def test_no_name_becomes_script(both: list[tuple[Path, Path]], number: int) -> None:
    """A page with names like scripts has the elements of an innocent one; what may run are scripts of ours, by hash."""
    innocent, attacked = (elements_of(page) for page in both[number])
    assert attacked.names == innocent.names
    assert attacked.handlers == innocent.handlers == []
    assert any(
        "onerror=alert(2)" in text or "onerror=alert(2)" in text.replace("\\u003c", "<") for text in attacked.text
    )
    hashes = {base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in attacked.scripts}
    assert set(re.findall(r"'sha256-([^']+)'", attacked.policy)) == hashes
    assert "unsafe-inline" not in attacked.policy.partition("script-src")[2]
    assert attacked.policy.startswith("default-src 'none';")


@pytest.mark.parametrize("number", range(len(KINDS)), ids=KINDS)
def test_a_page_fetches_nothing_and_is_small(both: list[tuple[Path, Path]], number: int) -> None:
    """Every address is a picture in the page, a place in it, or a file beside it; all of it is below 10 MB."""
    page = both[number][0]
    assert page.stat().st_size < MOST
    for address in elements_of(page).addresses:
        assert address.startswith("data:image/") or not re.match(r"[a-z]+:|/", address), address


@needs_browser
def test_a_browser_has_nothing_to_say_of_the_pages(both: list[tuple[Path, Path]], tmp_path: Path) -> None:
    """With names like scripts nothing runs but what should: figures are drawn and the console stays empty."""
    capture = write_capture(tmp_path / "capture", poses_on_arc(3))
    cloud = small_cloud(300)
    cameras = tuple({"name": f"{k:06d}", "status": "ok", "center_error": 0.1} for k in range(VIEWS))
    (tmp_path / "cloud").mkdir()
    write_cloud(tmp_path / "cloud", replace(cloud, cameras=cameras))
    scene = tmp_path / "scene.html"
    write_report(scene, "Scene", tmp_path, {"local": (capture, {"": tmp_path / "cloud"})})
    with open_tab("about:blank", tmp_path / "profile") as tab:
        for page in (scene, *(page for _, page in (*both[:3], both[-1]))):
            figures = len(re.findall(r'class="figure"', page.read_text(encoding="utf-8")))
            tab.open(page)
            tab.wait_for(f"document.querySelectorAll('.main-svg').length >= {figures}")
            assert [line for line in tab.said if "GPU stall" not in line] == []


def test_the_page_of_a_run_says_what_is_there_and_why_not(both: list[tuple[Path, Path]]) -> None:
    """Each scene and stage, the reason of the rejection, points of each class with their sum, and times."""
    text = " ".join(" ".join(elements_of(both[0][0]).text).split())
    for words in ("rejected: no_model", "2 of 3", "8 of 9", "✓ 2", "100", "70", "30", "45 s", "5 MB"):
        assert words in text, words


def test_residuals_are_those_of_the_camera(tmp_path: Path) -> None:
    """Keypoints that were projected with the lens, then moved by a known way: the residual is its length."""
    cloud, rng = small_cloud(300), np.random.default_rng(3)
    focal, center, bend = 300.0, np.array([200.0, 150.0]), -0.03
    middle = cloud.columns["coord"].mean(axis=0)
    poses = [np.eye(4) for _ in range(VIEWS)]
    for k, pose in enumerate(poses):
        pose[:3, :3] = np.diag([1.0, -1.0, -1.0])
        pose[:3, 3] = middle + np.array([10.0 * k - 10.0, 0.0, 60.0])
    moved = rng.uniform(0.0, 2.0, (300, VIEWS))
    uv = np.zeros((300, VIEWS, 2))
    for k, pose in enumerate(poses):
        local = (np.linalg.inv(pose) @ np.c_[cloud.columns["coord"], np.ones(300)].T).T[:, :3]
        plane = local[:, :2] / local[:, 2:]
        uv[:, k] = focal * plane * (1.0 + bend * (plane**2).sum(axis=1, keepdims=True)) + center
    turn = rng.uniform(0.0, 2.0 * np.pi, (300, VIEWS))
    seen = {
        **cloud.observations,
        "uv": (uv + moved[..., None] * np.stack([np.cos(turn), np.sin(turn)], -1)).reshape(-1, 2),
    }
    cloud = replace(cloud, observations=seen)
    told = {"model": "SIMPLE_RADIAL", "params": [focal, *center, bend], "size": [400, 300]}
    rows = [{"name": f"image {k}", "camera_to_world": pose.tolist()} for k, pose in enumerate(poses[:2])]
    (tmp_path / "cameras_sfm.json").write_text(json.dumps({"camera": told, "poses": rows}))
    found = reprojection_residuals(cloud, tmp_path).reshape(300, VIEWS)
    np.testing.assert_allclose(found[:, :2], moved[:, :2], atol=1e-9)
    assert np.isnan(found[:, 2]).all()  # its camera is not known
    each = image_rows(cloud, tmp_path)
    assert [row.points for row in each] == [300] * VIEWS
    assert each[1].residual == pytest.approx(np.median(moved[:, 1]))


def test_residuals_of_a_dense_cloud_are_those_of_its_model(tmp_path: Path) -> None:
    """It holds no keypoints of its own: each image's are those of the tie points, as pycolmap projects them."""
    import pycolmap

    pycolmap.set_random_seed(3)
    options = pycolmap.SyntheticDatasetOptions(
        num_points3D=400, num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=VIEWS
    )
    model = pycolmap.synthesize_dataset(options)
    pycolmap.synthesize_noise(pycolmap.SyntheticNoiseOptions(point2D_stddev=0.4), model)
    (tmp_path / "sparse").mkdir()
    model.write_binary(tmp_path / "sparse")
    right: list[float] = []
    images = sorted(model.images.values(), key=lambda image: image.name)
    for image in images:
        keys = [point for point in image.points2D if point.has_point3D()]
        put = [image.project_point(model.points3D[key.point3D_id].xyz) for key in keys]
        right.append(float(np.median([np.linalg.norm(key.xy - seen) for key, seen in zip(keys, put, strict=True)])))
    cloud = small_cloud(40)
    cameras = [{"name": Path(image.name).stem, "status": "ok"} for image in images]
    cloud = replace(cloud, cameras=cameras, source="sfm-dense")
    fit = model_fit(tmp_path)
    assert fit is not None
    rows = image_rows(cloud, tmp_path, fit)
    assert [row.residual for row in rows] == pytest.approx(right, abs=1e-6)
    assert min(right) > 0.2
    shutil.rmtree(tmp_path / "sparse")
    assert model_fit(tmp_path) is None
    rows = image_rows(cloud, tmp_path)
    assert np.isnan([row.residual for row in rows]).all()


def test_overlap_counts_different_images() -> None:
    """Against a loop over all points: as many images as have any point in a cell, however many points."""
    cloud, rng = small_cloud(500), np.random.default_rng(4)
    seen = {**cloud.observations, "image": rng.integers(0, VIEWS, 500 * VIEWS).astype(np.uint32)}
    cloud = replace(cloud, observations=seen)
    counts, x, y = overlap_map(cloud)
    cell = x[1] - x[0]
    sets: dict[tuple[int, int], set[int]] = {}
    for point, place in enumerate(cloud.columns["coord"]):
        at = (round((place[0] - x[0]) / cell), round((place[1] - y[0]) / cell))
        if 0 <= at[0] < len(x) and 0 <= at[1] < len(y):
            mine = sets.setdefault((at[1], at[0]), set())
            mine |= set(seen["image"][point * VIEWS : (point + 1) * VIEWS].tolist())
    expected = np.zeros_like(counts)
    for place, images in sets.items():
        expected[place] = len(images)
    assert np.mean(counts == expected) > 0.99  # rounding may move a point on an edge
    assert counts.sum() == pytest.approx(expected.sum(), rel=0.02)


def test_settings_and_links_are_spelt() -> None:
    """Nested settings are indented rows; links quote what a path may hold."""
    rows = settings_rows({"b": {"c": [1, 2], "d": None}, "a": True})
    assert [(row["depth"], row["name"], row["value"]) for row in rows] == [
        (0, "a", "True"),
        (0, "b", ""),
        (1, "c", "1, 2"),
        (1, "d", "–"),
    ]
    assert file_link("", 'a"b', "c d.jpg") == "./a%22b/c%20d.jpg"
    assert way_to(Path("/x/scenes/a b"), Path("/x/pages/p.html")) == "../scenes/a b"


def test_the_verb_knows_what_it_is_given(
    both: list[tuple[Path, Path]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each kind by its mark; what goes into one page, and what does not, is one line."""
    folder = both[0][0].parent
    assert [kind_of(folder / name) for name in ("set", "model", "scores.json")] == ["dataset", "model", "scores"]
    assert kind_of(folder) == "comparison"
    with pytest.raises(FalseworkError, match="not a folder that a report can show"):
        kind_of(tmp_path)
    page = tmp_path / "page.html"
    code, out, _ = call(capsys, "report", folder / "model", folder / "scores.json", "-o", page)
    assert (code, page.is_file()) == (0, True)
    assert out == f"report  {page}\n"
    text = " ".join(elements_of(page).text)
    assert ("Model model" in text, "Scores scores" in text) == (False, False)
    long = [shutil.copytree(folder / "model", tmp_path / (60 * sign)) for sign in "ab"]
    assert call(capsys, "report", *long, "-o", page)[0] == 0
    assert "bbbbbbbbbbbb\\u2026bbbbbbbbbbbb: loss" in page.read_text(encoding="utf-8")  # the legend keeps the word
    assert call(capsys, "report", folder / "model", folder / "set", "-o", page)[0] == 2
    assert call(capsys, "report", tmp_path / "nowhere", "-o", page)[0] == 2
    assert call(capsys, "report", folder / "model" / "log.csv", "-o", page)[0] == 2


@pytest.mark.parametrize("keep", [None, ("stage", "cloud", "report")], ids=["all", "some"])
def test_a_run_tells_which_scene_was_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keep: tuple[str, ...] | None
) -> None:
    """Rejected in its capture or in its cloud, each record finds its scene, also if its photographs were let go."""
    for stage in STAGES:
        monkeypatch.setitem(STAGES, stage, tiny_stages()[stage])
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": "none"})
    monkeypatch.setattr(chain, "recon_platform", lambda: {"cpu": "none"})
    monkeypatch.setenv("TINY_FAULTS", json.dumps({"capture:1": "reject", "cloud:2": "reject", "stage:3": "internal"}))
    out = tmp_path / "out"
    outcome = run_scenario(tiny_scenario(4, **({} if keep is None else {"keep": keep})), out, SILENT)
    assert (sorted(outcome.rejected), sorted(outcome.failed)) == (["0001", "0002"], ["0003"])
    facts = run_facts(out, "..")
    assert [(row.scene, row.stage, row.kind, row.reason) for row in facts.failures] == [
        ("0001", "capture", "rejected", "no_texture"),
        ("0002", "cloud", "rejected", "no_texture"),
        ("0003", "stage", "failed", "internal"),
    ]
    whole = next(scene for scene in facts.scenes if scene.name == "0000")
    kept = keep or ("stage", "capture", "model", "cloud", "report")
    assert {stage for stage, count in whole.results.items() if count} == set(kept)
    assert whole.page == "../scenes/0000/report.html"
    assert {event.stage for event in facts.events if event.scene == "0000"} == set(whole.results)
    text = " ".join(elements_of(out / "run/report.html").text)
    assert "no_texture" in text
    assert "nothing to match" in text
    assert ("Removed: made, used and then removed" in text) == (keep is not None)
    run_scenario(tiny_scenario(2, **({} if keep is None else {"keep": keep})), out, SILENT)
    fewer = run_facts(out, "..")  # results and failures of scenes that the scenario no longer has are not counted
    assert [scene.name for scene in fewer.scenes] == [scene.name for scene in facts.scenes if scene.name < "0002"]
    assert fewer.failures == facts.failures[:1]
