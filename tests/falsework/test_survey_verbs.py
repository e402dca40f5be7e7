"""`falsework survey`: flights are added to a scene and judged there; bad input is one line."""

import json
from pathlib import Path

import pytest

from falsework.cli import main
from tests.authoring.small_scene import write_small_scene
from usd_schemas.stage_reader import read_stage


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Author a small scene; give its root layer."""
    return write_small_scene(tmp_path_factory.mktemp("flights"))


def _run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main(["survey", *(str(word) for word in words)])
    printed = capsys.readouterr()
    return int(caught.value.code or 0), printed.out, printed.err


def test_plan_adds_a_flight_that_score_judges(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A grid and a local flight join the authored one; the same words give the same cameras; a page is written."""
    before = {product.name for product in read_stage(scene).products}
    words = ("plan", scene, "--kind", "local", "--set", "pitch=free", "--set", "images=[20, 120]")
    assert _run(capsys, *words)[0] == 0
    first = (scene.parent / "surveys/local.usdc").read_bytes()
    assert _run(capsys, *words)[0] == 0
    assert (scene.parent / "surveys/local.usdc").read_bytes() == first
    code, out, _ = _run(capsys, "plan", scene, "--kind", "grid", "--name", "rows", "--set", "sampling=0.01")
    assert code == 0
    assert out.startswith("survey      rows: ")
    assert {product.name for product in read_stage(scene).products} == before | {"local", "rows"}
    page = tmp_path / "flight.html"
    code, out, _ = _run(capsys, "score", scene, "--survey", "local", "-o", page, "--json")
    (row,) = json.loads(out)["surveys"]
    assert row["survey"] == "local"
    assert row["clearance"] >= 1.0
    assert set(row["by_class"]) >= {"deck", "girder", "abutment"}
    assert "Flights, before they are flown" in page.read_text()


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["plan", "{scene}", "--set", "lenght=30"], ["survey", "lenght", "Did you mean 'length'"]),
        (["plan", "{scene}", "--set", "safety=99"], ["survey", "safety", "99"]),
        (["plan", "{scene}", "--set", "safety"], ["key=value"]),
        (["plan", "{scene}", "--set", "station=900"], ["survey.station", "holds no bridge"]),
        (["score", "{scene}.no"], ["no such file"]),
        (["score", "{scene}", "--survey", "never"], ["never", "allowed"]),
    ],
)
def test_bad_words_are_one_line(
    scene: Path, words: list[str], parts: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, and one line that names what is wrong."""
    code, _, errors = _run(capsys, *(word.format(scene=scene) for word in words))
    assert code == 2
    (line,) = [line for line in errors.splitlines() if line.startswith("falsework: ")]
    for part in parts:
        assert part in line
