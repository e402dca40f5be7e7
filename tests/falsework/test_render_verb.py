"""What `falsework render` takes: words are checked before the stage is read, and do what they say."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from falsework.cli import main
from falsework.commands.verbs import stage_file
from falsework.stages import STAGES
from groundwork.slug import slug
from tests.conftest import RecordProof
from tests.falsework.served_here import served_here
from tests.render.prepared_here import rendered_here
from tests.usd_schemas.stages import SQUARE, write_stage

DARK = f"""def Camera "Empty" {{}}
def Camera "Above" {{
    double3 xformOp:translate.timeSamples = {{1: (0, 0, 4), 2: (0, 0, 5)}}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    float focalLength = 0.24
    float horizontalAperture = 0.36
    float verticalAperture = 0.27
}}
def Mesh "Coal" {{
{SQUARE.replace("1, ", "9, ").replace(", 9, 2", ", 1, 2").replace("-1", "-9").replace("9, 0)", "9, -1)")}
    color3f[] primvars:displayColor = [(0.01, 0.01, 0.01)] (interpolation = "constant")
}}
"""


def photograph(path: Path) -> NDArray[np.uint8]:
    """Read a picture, shape (H, W, 3)."""
    image = cv2.imread(str(path))
    assert image is not None
    return image.astype(np.uint8)


def run(words: list[str]) -> int:
    """Run a command and return its exit code."""
    with pytest.raises(SystemExit) as stopped:
        main(words)
    return int(stopped.value.code or 0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--width", "-3"], "--width"),
        (["--height", "99999"], "--height"),
        (["--frame", "first"], "--frame"),
        (["--exposure", "bright"], "--exposure"),
        (["--purpose", "all"], "--purpose"),
        (["--variant", "roof=flat"], "--variant"),
        (["--subdivision", "9"], "--subdivision"),
        (["--workers", "-1"], "--workers"),
    ],
)
def test_wrong_words_are_said_before_the_stage_is_read(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], record_proof: RecordProof
) -> None:
    """Beside a file that is no stage, what is named is the word."""
    stage = tmp_path / "broken.usda"
    stage.write_text("no stage")
    assert run(["render", str(stage), "-o", str(tmp_path / "out"), *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "broken" not in error
    record_proof(f"render verb: a wrong {words[0]} is said first", 1, 0, {"lines": len(error.splitlines())})


def test_words_do_what_they_say(tmp_path: Path, capsys: pytest.CaptureFixture[str], record_proof: RecordProof) -> None:
    """A meter stage with an empty camera is drawn; size, camera and frames are those asked for; coal stays black."""
    stage = write_stage(tmp_path, DARK)
    fast = ["--quality", "fast", "--no-noise", "--width", "48"]
    assert run(["render", str(stage), "-o", str(tmp_path / "all"), *fast, "--height", "36"]) == 0
    assert capsys.readouterr().err.count("the stage has no light") == 1  # of two cameras
    for name, count in (("Empty", 1), ("Above", 2)):
        images = sorted((tmp_path / "all" / name / "images").iterdir())
        assert [photograph(image).shape for image in images] == [(36, 48, 3)] * count
    means = []
    for exposure in ("light", "surfaces", "2"):
        out = tmp_path / exposure
        words = [*fast, "--camera", "/Above", "--frame", "2", "--exposure", exposure]
        with served_here(), rendered_here():  # the first command had its children
            assert run(["render", str(stage), "-o", str(out), *words]) == 0
        assert [folder.name for folder in out.iterdir() if folder.is_dir()] == ["Above"]
        (image,) = (out / "Above" / "images").iterdir()
        means.append(float(photograph(image).mean()))
    assert means[0] < 40.0 < 80.0 < means[1]
    assert means[2] != pytest.approx(means[0], abs=2.0)
    record_proof("render verb: exposure of coal", 3, 0, {"mean_grey_light": means[0], "mean_grey_surfaces": means[1]})


@pytest.mark.parametrize("verb", [["render"], ["sample", "mesh"]])
def test_a_folder_stands_for_its_scene(verb: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scene's folder is its root layer, that of a run's scene, too; any other says what it lacks."""
    folder = tmp_path / "stage"
    folder.mkdir()
    assert run([*verb, str(folder), "-o", str(tmp_path / "out")]) == 2
    assert "stage: holds no scene.usda. Name a scene folder" in capsys.readouterr().err
    write_stage(folder, DARK).rename(folder / "scene.usda")
    for named in (folder, tmp_path):
        assert stage_file(named) == folder / "scene.usda"
    assert not (tmp_path / "out").exists()


def test_no_stage_writes_outside_the_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A survey named after a folder of the user leaves it alone; a name that the reader let through is refused."""
    mine = tmp_path / "mine"
    mine.mkdir()
    survey = f'def Camera "Above" {{\n uniform token falsework:survey:id = "{mine}"'
    stage = write_stage(tmp_path, DARK.replace('def Camera "Above" {', survey))
    folders: list[Path] = []

    class Capture:
        @staticmethod
        def run(request: object, inputs: object, folder: Path, progress: object) -> None:
            """Note the folder that a capture would be rendered into."""
            folders.append(folder)

    monkeypatch.setitem(STAGES, "capture", Capture)
    with served_here():
        assert run(["render", str(stage), "-o", str(tmp_path / "out")]) == 0
    assert [folder.name for folder in folders] == ["Empty", slug(str(mine))]
    assert folders[0].parent == folders[1].parent
    for name in (str(mine), "../../../mine"):
        monkeypatch.setattr("falsework.commands.verbs.surveys_of", lambda *words, name=name: [name])
        assert run(["render", str(stage), "-o", str(tmp_path / "again")]) == 2
    assert len(folders) == 2
