"""Verbs that write for the user harm nothing: scripts, run folders, scenes."""

from pathlib import Path

import pytest

from falsework.cli import main
from falsework.commands.verbs import export_folder, report_scene
from groundwork.errors import InputError
from groundwork.files import write_bytes
from groundwork.output.folder import claim_run, fresh_output
from groundwork.progress import SILENT


def test_a_report_replaces_no_script(tmp_path: Path) -> None:
    """A file of the user's, and the page in the store, are refused before anything is drawn."""
    claim_run(tmp_path / "run")
    scene, script = tmp_path / "run" / "scenes" / "0000", tmp_path / "my_script.py"
    (scene / "capture" / "local").mkdir(parents=True)
    script.write_text("mine")
    for page, words in (
        (script, "did not write"),
        (scene / "report.html", "lies in"),
        (scene.parent / "page.html", "scenes/ of a run"),
    ):
        with pytest.raises(InputError, match=words):
            report_scene(scene, page)
    assert script.read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_an_export_does_not_replace_what_it_is_made_from(tmp_path: Path) -> None:
    """The cloud's folder, what lies in it and the photographs' folder are refused."""
    cloud, photographs = tmp_path / "cloud", tmp_path / "photographs"
    fresh_output(cloud, "cloud", lambda folder: write_bytes(folder / "cloud.json", b"{}"))
    photographs.mkdir()
    for out in (cloud, cloud / "laz", photographs / "laz", tmp_path):
        with pytest.raises(InputError, match="an input of this command"):
            export_folder(cloud, "colmap", out, SILENT, photographs)
    assert sorted(path.name for path in cloud.iterdir()) == [".falsework", "cloud.json"]


@pytest.mark.parametrize("words", ["render", "sample mesh", "scene flatten", "scene package"])
def test_nothing_is_written_into_a_scene_that_is_named(
    words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whoever names the folder of a scene names all that lies in it: a capture there would change its hash."""
    scene = tmp_path / "scene"
    scene.mkdir()
    (scene / "scene.usda").write_text("#usda 1.0\n")
    for out in (scene / "out", scene / "out.usdz", scene / "out.usdc"):
        with pytest.raises(SystemExit) as left:
            main([*words.split(), str(scene), "-o", str(out)])
        assert left.value.code == 2
        assert "lies inside an input of this command" in capsys.readouterr().err
    assert [path.name for path in scene.iterdir()] == ["scene.usda"]
