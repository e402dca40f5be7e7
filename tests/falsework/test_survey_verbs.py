"""`falsework survey`: flights are added to a scene and judged there; bad input is one line."""

import json
import shutil
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from falsework.cli import main
from falsework.commands.survey_verbs import coverage_lines
from groundwork.files import write_text
from tests.conftest import RecordProof
from tests.falsework.served_here import served_here
from usd_schemas.reading.stage_reader import read_stage


@pytest.fixture(scope="module")
def scene(authored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy a small scene; give its root layer."""
    return Path(shutil.copytree(authored.parent, tmp_path_factory.mktemp("flights") / "scene")) / authored.name


@pytest.fixture
def served() -> Iterator[None]:
    """Save the children of a test of many commands; the other tests of this file have theirs."""
    with served_here():
        yield


def _run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main(["survey", *(str(word) for word in words)])
    printed = capsys.readouterr()
    return int(caught.value.code or 0), printed.out, printed.err


@pytest.mark.usefixtures("served")
def test_plan_adds_a_flight_that_score_judges(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A grid and a local flight join the authored one; the same words give the same cameras; a page is written."""
    scene = Path(shutil.copytree(scene.parent, tmp_path / "flown")) / "scene.usda"  # the others want one flight
    words = (
        "plan",
        scene,
        "--kind",
        "local",
        "--set",
        "pitch=free",
        "--set",
        "spacing=0.4",
        "--set",
        "images=[20, 120]",
    )
    assert _run(capsys, *words)[0] == 0
    first = (scene.parent / "surveys/local.usdc").read_bytes()
    assert _run(capsys, *words)[0] == 0
    assert (scene.parent / "surveys/local.usdc").read_bytes() == first
    code, out, _ = _run(capsys, "plan", scene, "--kind", "grid", "--name", "rows", "--set", "sampling=0.02")
    assert code == 0
    assert out.startswith("survey      rows: ")
    flat = read_stage(scene)
    assert {product.name for product in flat.products} == {"global", "local", "rows"}
    (row,) = {product.camera for product in flat.products if product.name == "local"}
    flown = flat.cameras[row].poses
    assert 0.3 < np.linalg.norm(np.diff(flown[:, :3, 3], axis=0), axis=1).max() <= 0.4001  # every --set counts
    page = tmp_path / "flight.html"
    code, out, _ = _run(capsys, "score", scene, "--survey", "local", "-o", page, "--json")
    (row,) = json.loads(out)["surveys"]
    assert row["survey"] == "local"
    assert row["clearance"] >= 1.0
    assert set(row["by_class"]) >= {"deck", "girder", "abutment"}
    assert "Planned flights" in page.read_text()


@pytest.mark.usefixtures("served")
def test_what_no_flight_sees_is_named_and_can_be_flown(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Score names members and the legs for them; `--for unseen` flies these, and then only hidden members are left."""
    copy = Path(shutil.copytree(scene.parent, tmp_path / "unseen")) / "scene.usda"
    code, out, _ = _run(capsys, "score", copy, "--json")
    assert code == 0
    row = json.loads(out)["surveys"][-1]
    few = {number for found in row["hardly_seen"].values() for number in found["members"]}
    assert few == {int(number) for number, count in row["member_views"].items() if count < 3}
    assert "bearing" in row["hardly_seen"]
    proposal = row["proposal"]
    assert set(proposal["shown"]) | set(proposal["hidden"]) == few
    assert len(proposal["shown"]) > 0.8 * len(few)
    code, out, _ = _run(capsys, "plan", copy, "--kind", "inspection", "--for", "unseen")
    assert code == 0
    assert out.startswith("survey      inspection: ")
    code, out, _ = _run(capsys, "score", copy, "--no-propose", "--json")
    after = json.loads(out)["surveys"][-1]
    left = {number for found in after["hardly_seen"].values() for number in found["members"]}
    assert left <= set(proposal["hidden"])
    assert "proposal" not in after
    code, out, _ = _run(capsys, "plan", copy, "--kind", "inspection", "--for", "bearing", "--name", "bearings")
    assert code == 0
    assert len(read_stage(copy, survey="bearings").cameras[0].poses) > 3


@pytest.mark.usefixtures("served")
def test_a_mix_is_one_capture(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two kinds fly as one survey with one camera; a leg's wrong key is named with its place."""
    copy = Path(shutil.copytree(scene.parent, tmp_path / "mix")) / "scene.usda"
    legs = 'legs=[{"kind": "global", "images": 20}, {"kind": "grid", "sampling": 0.02}]'
    assert _run(capsys, "plan", copy, "--kind", "mix", "--set", legs, "--set", "width=320")[0] == 0
    flat = read_stage(copy, survey="mix")
    assert len(flat.products) == 1
    assert (flat.products[0].width, flat.products[0].height) == (320, 240)
    assert len(flat.cameras[0].poses) > 40
    code, _, errors = _run(capsys, "plan", copy, "--kind", "mix", "--set", 'legs=[{"kind": "grid", "samplin": 1}]')
    assert code == 2
    assert "Did you mean 'sampling'" in errors


AWAY = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Cube "Slab" {
    custom string userProperties:class = "deck"
}
def Camera "Away" {
    double3 xformOp:translate = (0, 0, 9)
    float3 xformOp:rotateXYZ = (180, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
"""


@pytest.mark.usefixtures("served")
def test_flight_that_sees_nothing_is_scored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It has no sampling distance, on no page and in no answer; that is no fault of the stage."""
    (tmp_path / "s.usda").write_text(AWAY)
    page = tmp_path / "flight.html"
    code, out, errors = _run(capsys, "score", tmp_path / "s.usda", "--no-propose", "-o", page)
    assert code == 0, errors
    assert "sampling    no image sees the bridge" in out
    assert "– at the 95th percentile" in page.read_text()
    code, out, _ = _run(capsys, "score", tmp_path / "s.usda", "--no-propose", "--json")
    assert json.loads(out)["surveys"][0]["sampling"] == [None, None]


CAMERA = """#usda 1.0
over "World" {{
    def Xform "Rig" {{
        double3 xformOp:translate.timeSamples = {{ 10: (0, -20, 8), 20: (12, -20, 8) }}
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Camera "{name}" {{
            float focalLength = 0.24
            float horizontalAperture = 0.36
            float verticalAperture = 0.27
            float3 xformOp:rotateXYZ = (90, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
            {more}
        }}
    }}
}}
"""


def _with_camera(scene: Path, folder: Path, name: str, more: str = "") -> Path:
    """Copy the scene, and animate a camera in its layer of edits, as a DCC would."""
    copy = Path(shutil.copytree(scene.parent, folder)) / "scene.usda"
    write_text(copy.parent / "edits/user.usda", CAMERA.format(name=name, more=more))
    return copy


@pytest.mark.usefixtures("served")
def test_a_camera_of_a_dcc_is_flown_as_it_is(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two keys on a parent become eleven images with the same poses and lens, names, times and a noisy GPS."""
    copy = _with_camera(scene, tmp_path / "dcc", "Drone")
    before = {track.name: track for track in read_stage(copy).cameras}["Drone"]
    words = ("plan", copy, "--kind", "stage", "--name", "orbit", "--set", "width=320")
    code, out, errors = _run(capsys, *words)
    assert code == 0, errors
    assert out.startswith("survey      orbit: 11 images, 12 m")
    after = read_stage(copy, survey="orbit")
    track, product = after.cameras[0], after.products[0]
    np.testing.assert_allclose(track.poses, before.poses, atol=1e-8)
    assert (product.width, product.height) == (320, 240)
    assert track.calibration is not None
    assert track.calibration.fx == pytest.approx(320 * 24 / 36)
    assert track.image_names == tuple(f"{row:06d}" for row in range(11))
    assert track.gps is not None
    assert 0.05 < np.abs(track.gps - track.poses[:, :3, 3]).mean() < 3.0
    times = track.facts["capture_times"]
    assert isinstance(times, list)
    np.testing.assert_allclose(np.diff(times), 1.2 / 3.0, atol=2e-3)
    code, out, _ = _run(capsys, "score", copy, "--survey", "orbit", "--json")
    assert code == 0
    assert json.loads(out)["surveys"][0]["images"] == 11


@pytest.mark.usefixtures("served")
def test_a_camera_that_cannot_be_flown(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Unknown, ambiguous and orthographic cameras are one line that names the others."""
    copy = _with_camera(scene, tmp_path / "flat", "Plan", 'token projection = "orthographic"')
    for prim, parts in (
        ("Nobody", ["survey.prim", "no such camera", "/World/Surveys/global/global_Camera"]),
        ("Plan", ["survey.prim", "/World/Rig/Plan", "only perspective cameras"]),
    ):
        code, _, errors = _run(capsys, "plan", copy, "--kind", "stage", "--set", f"prim={prim}")
        assert code == 2
        assert all(part in errors for part in parts), errors
    other = '}\ndef Camera "Other" {\nfloat focalLength = 0.2'
    second = _with_camera(scene, tmp_path / "two", "Drone", other)
    code, _, errors = _run(capsys, "plan", second, "--kind", "stage")
    assert code == 2
    assert "it is not clear which camera is meant" in errors
    assert "/World/Rig/Drone" in errors


@pytest.mark.proof_only
@pytest.mark.slow
def test_predicted_share_ranks_flights_as_reconstructions_do(tmp_path: Path, record_proof: RecordProof) -> None:
    """Over good and deliberately bad flights, those that are predicted to hang together are those that do."""
    from benchmarks.recon.registration import measure, rank_correlation

    rows = measure(tmp_path)
    assert len(rows) >= 20
    assert sum(row["bad"] for row in rows) >= 10
    figures = {"registered_rank": rank_correlation(rows, "registered"), "right_rank": rank_correlation(rows, "right")}
    record_proof("surveys/predicted against registered share", len(rows), 21, figures)
    assert min(figures.values()) >= 0.6, figures


APART = {"safety=99", "never"}  # words of one plan and one score that are left to their child


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["plan", "{scene}", "--set", "lenght=30"], ["survey", "lenght", "Did you mean 'length'"]),
        (["plan", "{scene}", "--set", "safety=99"], ["survey", "safety", "99"]),
        (["plan", "{scene}", "--set", "safety"], ["key=value"]),
        (["plan", "{scene}", "--set", "station=900"], ["survey.station", "contains no part of the bridge"]),
        (["plan", "{scene}", "--for", "57"], ["--for", "--kind inspection"]),
        (["plan", "{scene}", "--kind", "inspection", "--for", "cabel"], ["--for", "cabel", "bearing"]),
        (
            ["plan", "{scene}", "--kind", "mix", "--set", 'legs=[{{"kind": "stage"}}]'],
            ["legs", "kind", "allowed: global, local, grid, inspection"],
        ),
        (["score", "{scene}.no"], ["no such file"]),
        (["score", "{scene}", "--survey", "never"], ["never", "allowed"]),
    ],
)
def test_bad_words_are_one_line(
    scene: Path, words: list[str], parts: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, and one line that names what is wrong: from a child, too."""
    with nullcontext() if APART & set(words) else served_here():
        code, _, errors = _run(capsys, *(word.format(scene=scene) for word in words))
    assert code == 2
    (line,) = [line for line in errors.splitlines() if line.startswith("falsework: ")]
    for part in parts:
        assert part in line


def test_coverage_is_judged_in_words() -> None:
    """Each class stands in one line with its share, best first; a line without a class is left out; 8 % is poor."""
    shares = {"girder": 0.08, "deck": 0.5, "column": 0.66, "parapet": 0.25, "bearing": 0.12, "arch": 0.4999}
    assert coverage_lines(shares)[1:] == [
        "            well (from 50 %): column 66 %, deck 50 %",
        "            partly (from 25 %): arch 50 %, parapet 25 %",
        "            poorly: expect holes: bearing 12 %, girder 8 %",
    ]
    assert [line.split(":")[0].strip() for line in coverage_lines({"deck": 0.9})[1:]] == ["well (from 50 %)"]
