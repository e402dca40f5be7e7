"""The command line: bad input costs one line and exit code 2, never a traceback, and loses nothing."""

import json
import re
import subprocess
import sys
import tomllib
import types
from contextlib import nullcontext
from importlib.metadata import version
from pathlib import Path

import pytest

from falsework.cli import main
from falsework.doctor import CORE, LEARN, VIEW, Check, examine, learn_packages, package_names, view_packages
from groundwork.errors import RejectedSceneError
from tests.falsework.fresh_interpreter import FreshInterpreter
from tests.falsework.served_here import served_here

THREE = ("illinois=@", "korea=@.2", "synthetic=@.3")  # what a comparison of three sets is given
EMPTY_STAGE = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Z"\n)\ndef Xform "World"\n{\n}\n'


def _fails(arguments: list[str | Path], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must fail as bad input; give its one line."""
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in arguments])
    error = capsys.readouterr().err
    lines = [line for line in error.splitlines() if line.startswith("falsework: ")]
    assert caught.value.code == 2, error
    assert len(lines) == 1
    assert "Traceback" not in error
    return lines[0]


def test_missing_scenario(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scenario that is not there is named, and no output is begun."""
    line = _fails(["run", tmp_path / "no.toml", "-o", tmp_path / "out"], capsys)
    assert "no.toml" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("stop", "code"), [(KeyboardInterrupt(), 130), (SystemExit(143), 143)])
def test_a_stop_during_an_import_is_a_stop(
    stop: BaseException, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Open3D makes it an `ImportError`: the exit code is the signal's, without a traceback."""

    def verb() -> int:
        raise ImportError("initialization failed") from stop

    monkeypatch.setattr("falsework.cli._call", lambda words: verb)
    with pytest.raises(SystemExit) as caught:
        main(["author"])
    assert caught.value.code == code
    assert capsys.readouterr().err == "falsework: interrupted; repeat the command: it continues\n"


def test_unknown_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The line names the file, the key and its nearest neighbor."""
    scenario = tmp_path / "s.toml"
    scenario.write_text("[sitte]\ncrossing = 'river'\n")
    line = _fails(["run", scenario, "-o", tmp_path / "out"], capsys)
    assert all(part in line for part in ("s.toml", "sitte", "Did you mean 'site'"))


def test_every_typo_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two wrong keys and a wrong value are one line that names all three, each with its mend."""
    scenario = tmp_path / "s.toml"
    scenario.write_text("sceens = 2\n[sitte]\ncrossing = 'river'\n[look]\nname = 3\n")
    line = _fails(["run", scenario, "-o", tmp_path / "out"], capsys)
    assert "3 errors: (1) " in line
    assert all(
        part in line for part in ("sceens", "Did you mean 'scenes'", "sitte", "Did you mean 'site'", "look.name")
    )
    assert line.count("s.toml") == 1


@pytest.mark.parametrize(
    ("words", "near"), [(["rum", "x"], "run"), (["scene", "chekout"], "checkout"), (["survey", "scores"], "score")]
)
def test_an_unknown_verb_names_the_nearest(words: list[str], near: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A mistyped verb, of a group too, is one line with what there is and the nearest one."""
    line = _fails([*words], capsys)
    assert "no such verb" in line
    assert f"Did you mean {near!r}?" in line


@pytest.mark.parametrize(
    "words",
    [
        ["run", "@", "-o", "out"],
        ["render", "@", "-o", "out"],
        ["reconstruct", "@", "-o", "out"],
        ["scene", "info", "@"],
        ["survey", "score", "@"],
        ["sample", "mesh", "@", "-o", "out"],
        ["background", "import", "@", "-o", "out"],
        ["export", "@", "--to", "ply", "-o", "out"],
        ["report", "@", "-o", "page.html"],
        ["verify", "@"],
    ],
)
def test_a_missing_file_is_said_before_any_room_is_loaded(
    words: list[str], fresh: FreshInterpreter, tmp_path: Path
) -> None:
    """One line, exit code 2, and neither the renderer, nor the networks, nor NumPy has been imported by then."""
    given = [str(tmp_path / "nowhere") if word == "@" else word for word in words]
    done = fresh.run(given, tmp_path)
    assert done.code == 2, done.error
    assert "nowhere: no such file or folder" in done.error
    assert not {"numpy", "render.capture", "authoring.settings", "recon.settings", "cv2"} & done.loaded
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["reconstruct", "@", "-o", "out"], "Name a capture, or a folder of photographs"),
        (["reconstruct", "/", "--model", "@", "-o", "out"], "--model: is a file"),
        (["export", "@", "--to", "laz", "-o", "out"], "Name a cloud or a capture"),
        (["export", "/", "--to", "colmap", "--photographs", "@", "-o", "out"], "--photographs: is a file"),
        (["verify", "@"], "Name the output folder of a run"),
        (["clean", "@"], "Name the output folder of a run"),
        (["train", "@", "-o", "out"], "Name a folder that falsework dataset has written"),
        (["train", "/", "--init", "@", "-o", "out"], "--init: is a file"),
        (["evaluate", "@", "/"], "Name a folder that falsework train has written"),
        (["evaluate", "/", "@"], "Name a folder that falsework dataset has written"),
        (["dataset", "export", "@", "--to", "s3dis", "-o", "out"], "Name a folder that falsework dataset has written"),
        (["compare", *THREE, "-o", "out", "--preset", "task-local-1"], "Name a run, or a folder with"),
        (["predict", "@", "--model", "@", "-o", "out.laz"], "--model: is a file"),
    ],
)
def test_a_file_where_a_folder_is_wanted(
    words: list[str], wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line says that it is a file, and what is wanted; never that nothing is there; nothing is written."""
    file, folder = tmp_path / "notes.txt", tmp_path / "folder"
    file.write_text("a file")
    folder.mkdir()
    for mark in ("dataset.json", "model.json"):  # by which the folders beside it are known
        (folder / mark).write_text("{}")
    places: dict[str, str | Path] = {"@": file, "/": folder, "out": tmp_path / "out", "out.laz": tmp_path / "out.laz"}
    places |= {word: word.replace("@", str(file)) for word in THREE}
    line = _fails([places.get(word, word) for word in words], capsys)
    assert "is a file, not a folder" in line
    assert "notes.txt" in line
    assert wanted in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "notes.txt"]


def test_a_file_that_is_no_world(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`background info` of anything else says what it is not, not that a child failed."""
    (tmp_path / "notes.txt").write_text("a file")
    with served_here():
        line = _fails(["background", "info", tmp_path / "notes.txt"], capsys)
    assert "notes.txt: is not an imported world. Make one" in line


def test_without_the_extra_learning_says_what_to_install(tmp_path: Path) -> None:
    """Where the extra `learn` is not installed, training is refused in one line that names it."""
    script = "import sys; sys.modules['torch'] = None; import falsework.cli; falsework.cli.main(sys.argv[1:])"
    words = ["train", str(tmp_path), "-o", str(tmp_path / "model")]
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, timeout=100)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("falsework: this command needs the package torch")
    assert "falsework[learn]" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_cannot_be_drawn_names_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A value that is found wrong while the bridge is drawn: file, key, rule and nearest valid value in one line."""
    scenario = tmp_path / "far.toml"
    scenario.write_text('[bridge]\nfamily = "slab"\n[bridge.slab]\nspans = [300.0]\n')
    for verb in ("author", "run"):
        line = _fails([verb, scenario, "-o", tmp_path / verb], capsys)
        assert line.startswith(f"falsework: {scenario}: bridge.slab.spans: ")
        assert "(found 300.0); allowed: 5 to 18 m. The nearest valid value is 18 m" in line


def test_foreign_output_folder_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder with somebody's files is never written into."""
    scenario = tmp_path / "s.toml"
    scenario.write_text("")
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("years of work")
    for verb in ("run", "author"):
        line = _fails([verb, scenario, "-o", tmp_path / "thesis"], capsys)
        assert "thesis" in line
        assert "another folder" in line
    assert [path.name for path in (tmp_path / "thesis").iterdir()] == ["chapter.tex"]


def test_output_below_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An output folder that cannot be made is refused before any work."""
    scenario = tmp_path / "s.toml"
    scenario.write_text("")
    assert "s.toml: is a file" in _fails(["run", scenario, "-o", scenario / "out"], capsys)


def test_a_folder_that_is_gone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever's folder was removed under them is told so, whatever they ask for."""
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert "does not exist any more" in _fails(["doctor"], capsys)


def test_stage_without_geometry(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A stage that shows nothing is said to, and leaves no capture."""
    stage = tmp_path / "empty.usda"
    stage.write_text(EMPTY_STAGE)
    with served_here():
        assert "empty.usda" in _fails(["render", stage, "-o", tmp_path / "out"], capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("content", [b"", b"not a stage", b"#usda 1.0\ndef Mesh {", b"PXR-USDC\x00\x00"])
def test_not_a_stage(content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file that is no stage is named: from a child, too."""
    stage = tmp_path / "bad.usda"
    stage.write_bytes(content)
    with served_here() if content else nullcontext():
        assert "bad.usda" in _fails(["render", stage, "-o", tmp_path / "out"], capsys)


def test_missing_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A capture that is not there, or is none, is named."""
    assert "nowhere" in _fails(["reconstruct", tmp_path / "nowhere", "-o", tmp_path / "out"], capsys)
    (tmp_path / "none").mkdir()
    assert "cameras.json" in _fails(["reconstruct", tmp_path / "none", "-o", tmp_path / "out"], capsys)


def test_rejected_reconstruction_has_a_code_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No cloud comes of it: exit code 3, the reason in one line, and no output folder."""

    def reject(*unused: object) -> None:
        raise RejectedSceneError("too_few_cameras", "5 of 40 cameras registered")

    monkeypatch.setattr("recon.reconstruct.reconstruct", reject)
    (tmp_path / "photographs").mkdir()
    with pytest.raises(SystemExit) as caught:
        main(["reconstruct", str(tmp_path / "photographs"), "-o", str(tmp_path / "out")])
    assert caught.value.code == 3
    assert "falsework: too_few_cameras: 5 of 40 cameras registered\n" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_doctor_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    """The doctor answers with one versioned object, and finds this machine fit."""
    with pytest.raises(SystemExit) as caught:
        main(["doctor", "--json"])
    answer = json.loads(capsys.readouterr().out)
    verdicts = {check["name"]: check["verdict"] for check in answer["checks"]}
    assert answer["version"] == 1
    assert verdicts["frame"] == "OK"
    assert caught.value.code == 0


def test_the_doctor_names_what_takes_the_place_of_a_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file `learn.py` of the user's own, found before ours, is named with its path."""
    foreign = types.ModuleType("learn")
    foreign.__file__ = "elsewhere/learn.py"
    assert [check.verdict for check in package_names()] == ["OK"]
    monkeypatch.setitem(sys.modules, "learn", foreign)
    (check,) = package_names()
    assert check.verdict == "FAIL"
    assert "elsewhere/learn.py" in check.found


def test_the_doctor_blames_no_driver_for_a_foreign_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With somebody else's `render` in the place of ours no frame is drawn: the row says why, and names no apt-get."""
    (tmp_path / "render").mkdir()
    (tmp_path / "render/__init__.py").write_text("raise SystemExit('somebody else')\n")
    for name in [name for name in sys.modules if name.partition(".")[0] == "render"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("falsework.doctor.run_child", lambda *_, **__: pytest.fail("a frame was tried"))
    checks = {check.name: check for check in examine()}
    assert "frame" not in checks
    assert (checks["gl"].verdict, checks["package names"].verdict) == ("WARN", "FAIL")
    assert checks["gl"].found == "not tried: the Python package render is not that of Falsework"
    assert "apt-get" not in checks["gl"].hint
    assert str(tmp_path / "render/__init__.py") in checks["package names"].found


def test_a_foreign_name_that_no_frame_needs_leaves_the_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """A foreign `learn` is named, and the drivers are tried all the same."""
    foreign = types.ModuleType("learn")
    foreign.__file__ = "elsewhere/learn.py"
    monkeypatch.setitem(sys.modules, "learn", foreign)
    answer = {"renderer": "r", "version": "v", "backend": "egl", "wrong_pixels": 0}
    monkeypatch.setattr("falsework.doctor.run_child", lambda *_, **__: answer)
    verdicts = {check.name: check.verdict for check in examine()}
    assert (verdicts["gl"], verdicts["frame"], verdicts["package names"]) == ("OK", "OK", "FAIL")


def test_the_doctor_looks_for_the_extra_learn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A package of it that is missing, or has no metadata, is a warning with the command that mends it."""
    monkeypatch.setattr("falsework.doctor.version", lambda name: "1.5")
    monkeypatch.setattr("falsework.doctor.find_spec", lambda module: module)
    found = "torch 1.5, lightning 1.5, safetensors 1.5, scikit-learn 1.5"
    assert learn_packages() == Check("learn", "OK", found)
    monkeypatch.setattr("falsework.doctor.find_spec", lambda module: None if module == "sklearn" else module)
    check = learn_packages()
    assert (check.verdict, check.hint) == ("WARN", "pip install 'falsework[learn]'")
    assert check.found.startswith("no scikit-learn: ")
    monkeypatch.undo()
    monkeypatch.setitem(LEARN, "falsework-nowhere", "json")
    assert learn_packages().verdict == "WARN"
    assert {"learn", "view"} <= {check.name for check in examine()}


def test_the_doctor_tries_every_package_that_the_core_needs() -> None:
    """A dependency that is added to pyproject.toml is tried, too; open3d, with its libusb, has its own row."""
    project = tomllib.loads((Path(__file__).resolve().parents[2] / "pyproject.toml").read_text())["project"]
    needed = {re.split(r"[<>=; ]", line)[0] for line in project["dependencies"]}
    assert needed - {"open3d", "open3d-cpu", "libusb-package"} == set(CORE)
    brought = project["optional-dependencies"]
    assert {re.split(r"[<>=; ]", line)[0] for line in brought["learn"]} == set(LEARN)
    assert {re.split(r"[<>=; ]", line)[0] for line in brought["view"]} == set(VIEW)


def test_the_doctor_looks_for_the_extra_view(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where viser is missing, the row says which verb needs it, and what to install."""
    monkeypatch.setattr("falsework.doctor.find_spec", lambda module: None)
    check = view_packages()
    assert (check.verdict, check.hint) == ("WARN", "pip install 'falsework[view]'")
    assert check.found == "no viser: view without --save needs it"


def test_the_version(capsys: pytest.CaptureFixture[str]) -> None:
    """`--version` prints that of the installation and nothing else, and the help names it."""
    for words in (["--version"], ["--help"]):
        with pytest.raises(SystemExit) as caught:
            main(words)
        assert not caught.value.code
        said = capsys.readouterr().out
        assert said == f"{version('falsework')}\n" if words == ["--version"] else "--version" in said


def test_help_of_predict_says_what_it_needs(capsys: pytest.CaptureFixture[str]) -> None:
    """The extra, the file that a cloud's folder must hold, and the table where none is named."""
    with pytest.raises(SystemExit):
        main(["predict", "--help"])
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    parts = ("Needs the extra learn", "cloud.laz", "falsework for a model of components")
    assert [part for part in parts if part not in said] == []


def test_an_edited_scene_is_not_authored_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scene folder in which a file was changed by hand is left as it is."""
    folder = tmp_path / "scene"
    (folder / "edits").mkdir(parents=True)
    (folder / "edits/user.usda").write_text("#usda 1.0\n")
    (folder / "manifest.json").write_text(json.dumps({"files": {"edits/user.usda": "another hash"}}))
    (folder / ".falsework").write_text("scene\n")
    scenario = tmp_path / "s.toml"
    scenario.write_text("seed = 3\n")
    line = _fails(["author", scenario, "-o", folder], capsys)
    assert "edits/user.usda: changed" in line
    assert (folder / "edits/user.usda").read_text() == "#usda 1.0\n"
