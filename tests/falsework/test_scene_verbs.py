"""`falsework scene`: what each verb prints, its exit codes, and one line for bad input."""

import json
import shutil
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest

from falsework.cli import main
from falsework.commands import scene_verbs
from tests.falsework.served_here import served_here


@pytest.fixture(scope="module")
def stored(authored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy a small scene, read-only as in a store; give its root layer."""
    scene = Path(shutil.copytree(authored.parent, tmp_path_factory.mktemp("stored") / "scene")) / authored.name
    for path in scene.parent.rglob("*"):
        if path.is_file():
            path.chmod(0o444)
    return scene


@pytest.fixture
def served() -> Iterator[None]:
    """Save the children of a test of many commands: its verbs have theirs below, in the tutorial, in JSON answers."""
    with served_here():
        yield


def _run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main(["scene", *(str(word) for word in words)])
    printed = capsys.readouterr()
    return int(caught.value.code or 0), printed.out, printed.err


@pytest.mark.usefixtures("served")
def test_from_the_store_to_a_package(stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check out, choose, compare, validate, package: each answers what was done."""
    mine = tmp_path / "mine/scene.usda"
    assert _run(capsys, "checkout", stored.parent, "-o", mine.parent)[0] == 0
    code, out, _ = _run(capsys, "set", mine, "look=clean", "--json")
    assert (code, json.loads(out)) == (0, {"version": 1, "look": "clean"})
    assert _run(capsys, "set", mine, "taxonomy=ifc43") == (0, "taxonomy    ifc43\n", "")
    assert "IfcBearing" in _run(capsys, "info", mine)[1]
    assert _run(capsys, "set", mine, "taxonomy=falsework")[0] == 0
    answer = json.loads(_run(capsys, "diff", stored, mine, "--json")[1])
    assert answer["selections"] == {"look": ["weathered", "clean"]}
    assert answer["look"]
    assert answer["layers"] == {"scene.usda": "changed"}
    answer = json.loads(_run(capsys, "info", mine, "--json")[1])
    assert answer["selected"]["look"] == "clean"
    assert answer["changed"] == []
    assert _run(capsys, "validate", mine)[:2] == (0, "valid in every variant\n")
    assert _run(capsys, "package", mine, "-o", tmp_path / "a.usdz")[0] == 0
    assert (tmp_path / "a.usdz").is_file()
    assert _run(capsys, "flatten", mine, "-o", tmp_path / "flat/scene.usdc")[0] == 0
    assert (tmp_path / "flat/scene.usdc").is_file()


def test_diff_names_many_of_one_parent_in_one_line(
    stored: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A world comes and goes in a line for each group of it, and not in hundreds; JSON has every path."""
    added = [*(f"/World/Trees/Tree_{k}" for k in range(40)), "/World/Ways/Rail", "/World/Ways/Road", "/World/Shore"]
    found: dict[str, object] = {"selections": {}, "same": False, "moved": {}, "look": {}, "relabelled": {}}
    found |= {"layers": {}, "added": added} | {word: [] for word in ("reshaped", "light", "removed")}
    monkeypatch.setattr(scene_verbs, "_work", lambda *_: found)
    lines = _run(capsys, "diff", stored, stored)[1].splitlines()
    assert lines[:-1] == [
        "added       /World/Trees: Tree_0, Tree_1, Tree_2 and 37 more",
        "added       /World/Ways/Rail",
        "added       /World/Ways/Road",
        "added       /World/Shore",
    ]
    assert json.loads(_run(capsys, "diff", stored, stored, "--json")[1])["added"] == added


@pytest.mark.parametrize("differs", ["moved", "reshaped", "relabelled"])
def test_diff_says_that_all_stayed_where_it_did(
    differs: str, stored: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a swap a line says that nothing else differs; not where anything moved, or was reshaped or relabelled."""
    found: dict[str, object] = {"selections": {"look": ["weathered", "clean"]}, "same": False}
    found |= {"moved": {}, "look": {}, "relabelled": {}, "layers": {"scene.usda": "changed"}}
    found |= {word: [] for word in ("reshaped", "light", "added", "removed")}
    monkeypatch.setattr(scene_verbs, "_work", lambda *_: found)
    assert "unchanged  " in _run(capsys, "diff", stored, stored)[1]
    found[differs] = {"moved": {"/A": 1.0}, "reshaped": ["/A"], "relabelled": {"/A": [["a", "1"], ["b", "1"]]}}[differs]
    assert "unchanged  " not in _run(capsys, "diff", stored, stored)[1]


def test_info_for_people(stored: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The choice in force stands in brackets, and counts are there."""
    code, out, _ = _run(capsys, "info", stored.parent, "--files")
    assert code == 0
    assert "look: clean [weathered]" in out
    assert "bearing " in out
    assert "bridge/geometry.usdc" in out


APART = {"look=shiny"}  # words of a command that is left to its child


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["set", "{own}", "look=shiny"], ["'shiny'", "clean, ", "weathered"]),
        (["set", "{own}", "look"], ["not a choice", "taxonomy=…"]),
        (["set", "{own}", "taxonomy=kim"], ["unknown taxonomy", "kim2023"]),
        (["set", "{stored}", "look=clean"], ["read-only", "scene checkout"]),
        (["set", "{own}", "look=clean", "--variant", "../../evil"], ["not a name of a variant", "letters, digits"]),
        (["info", "{own}.no"], ["no such file"]),
        (["diff", "{own}", "{folder}/bridge"], ["holds no scene.usda"]),
        (
            ["set", "{own}", "background=none", "--re-origin", "1", "2", "3"],
            ["--re-origin", "only a background from a USD file"],
        ),
        (["package", "{own}", "-o", "{own}.fbx"], [".usdz, .glb"]),
        (["checkout", "{own}", "-o", "{folder}"], ["is an input of this command"]),
    ],
)
def test_bad_input_is_one_line(
    stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], parts: list[str]
) -> None:
    """Exit code 2, one line, no traceback: from a child, too."""
    shutil.copytree(stored.parent, tmp_path / "own", copy_function=shutil.copyfile)
    places = {"own": tmp_path / "own/scene.usda", "stored": stored, "folder": tmp_path / "own"}
    with nullcontext() if APART & set(words) else served_here():
        code, _, error = _run(capsys, *(word.format(**places) for word in words))
    lines = [line for line in error.splitlines() if line.startswith("falsework: ")]
    assert code == 2, error
    assert len(lines) == 1
    assert [part for part in parts if part not in lines[0]] == []
    assert "Traceback" not in error


def test_findings_are_a_result(stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scene with a fault is told with exit code 1, as JSON where asked for."""
    shutil.copytree(stored.parent, tmp_path / "own", copy_function=shutil.copyfile)
    scene = tmp_path / "own/scene.usda"
    (tmp_path / "own/bridge/looks/clean/textures/detail.png").unlink()
    code, out, _ = _run(capsys, "validate", scene, "--json")
    assert code == 1
    assert any("detail.png" in line for line in json.loads(out)["findings"])


def test_schemas_point_at_the_plugin(capsys: pytest.CaptureFixture[str]) -> None:
    """The printed folder holds the plugin."""
    code, out, _ = _run(capsys, "schemas", "--path")
    assert code == 0
    assert (Path(out.strip()) / "plugInfo.json").is_file()
