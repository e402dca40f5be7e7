"""`falsework background`: files become worlds, `info` says what is in them, bad ones end in one line."""

import re
import zipfile
from pathlib import Path

import pytest
import trimesh

from falsework.cli import main
from tests.authoring.mesh_files import gltf, town
from tests.falsework.served_here import served_here

PAGE = Path(__file__).resolve().parents[2] / "docs/backgrounds.md"


def run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    """Run a verb in this process; its work runs in a child where a test does not say otherwise."""
    with pytest.raises(SystemExit) as caught:
        main(["background", *(str(word) for word in words)])
    printed = capsys.readouterr()
    return int(caught.value.code or 0), printed.out, printed.err


def facts(text: str) -> dict[str, str]:
    """Parse what a verb prints: a name and its value on each line."""
    return dict(line.split(maxsplit=1) for line in text.splitlines())


def test_the_example_of_the_documentation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The tile that the page shows gives what the page says."""
    found = re.search(r"```json\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert found
    (tmp_path / "block.json").write_text(found[1])
    with served_here():
        code, _, _ = run(capsys, "import", tmp_path / "block.json", "-o", tmp_path / "block", "--license", "CC-BY-4.0")
        assert code == 0
        told = facts(run(capsys, "info", tmp_path / "block")[1])
    assert (told["buildings"], told["triangles"], told["extent"]) == ("1", "10", "10 x 8 m")
    assert (told["license"], told["title"]) == ("CC-BY-4.0", "A block")


def test_a_textured_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Import and info agree; the image lies in the world."""
    out = tmp_path / "tile"
    code, text, _ = run(capsys, "import", gltf(tmp_path), "-o", out)
    assert code == 0
    imported, told = facts(text), facts(run(capsys, "info", out)[1])
    assert imported.pop("world") == str(out / "tile.usda")
    assert told == imported
    assert (told["buildings"], told["author"]) == ("1", "City of Nowhere")
    assert told["images"].startswith("1,")
    assert len(list((out / "textures").glob("skin_*.png"))) == 1


def test_axes_and_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A mesh in millimeters, and options that a format has no use for."""
    meshes, _, count = town()
    whole = trimesh.util.concatenate(meshes)
    whole.apply_scale(1000.0)
    whole.export(tmp_path / "town.ply")
    with served_here():
        code, text, _ = run(capsys, "import", tmp_path / "town.ply", "-o", tmp_path / "town", "--scale", "0.001")
        assert code == 0
        assert facts(text)["extent"] == "300 x 300 m"
        assert facts(text)["buildings"] == str(count)
        code, _, error = run(capsys, "import", tmp_path / "town.ply", "-o", tmp_path / "b", "--up", "x")
        assert (code, error.count("\n")) == (2, 1)
        (tmp_path / "block.json").write_text("{}")
        assert run(capsys, "import", tmp_path / "block.json", "-o", tmp_path / "c", "--up", "z")[0] == 2


def test_a_bomb_ends_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, one line, and no half-written world."""
    with zipfile.ZipFile(tmp_path / "tile.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("tile.obj", b"0" * 20_000_000)
    code, _, error = run(capsys, "import", tmp_path / "tile.zip", "-o", tmp_path / "tile")
    assert code == 2
    assert "times its size" in error
    assert "Traceback" not in error
    assert not (tmp_path / "tile").exists()
