"""What the scene tools write replaces what they wrote before, and neither the scene nor anybody's file."""

import shutil
from pathlib import Path

import pytest

from authoring.exchange.export import export_scene
from authoring.exchange.flatten import flatten_scene
from authoring.scenes.checkout import checkout_scene
from groundwork.canonical import folder_digest
from groundwork.errors import InputError
from groundwork.files import MANIFEST


@pytest.mark.parametrize("name", ["flat.usda", "flat.usdc", "scene.usdz", "scene.glb"])
def test_only_a_former_one_is_replaced(name: str, own_scene: Path, tmp_path: Path) -> None:
    """Twice the same command, the same bytes; a file that was not made so stays, whatever is in it."""
    out = tmp_path / "new" / name

    def write(path: Path) -> None:
        if name.startswith("flat"):
            flatten_scene(own_scene, path)
        else:
            export_scene(own_scene, path, False, 64, print)

    write(out)
    first = out.read_bytes()
    write(out)
    assert out.read_bytes() == first
    assert [path.name for path in out.parent.iterdir() if path.name.startswith(".")] == []
    mine = tmp_path / f"mine{out.suffix}"
    for content in (b"mine", (own_scene.parent / "edits/user.usda").read_bytes(), b"PXR-USDC" + bytes(90)):
        mine.write_bytes(content)
        with pytest.raises(InputError, match="is a file that Falsework did not write"):
            write(mine)
        assert mine.read_bytes() == content


def test_a_scene_is_never_written_over(own_scene: Path, tmp_path: Path) -> None:
    """Its root layer, another layer, a folder in it or around it: refused, and not a byte of it changes."""
    home, before = own_scene.parent, folder_digest(own_scene.parent)
    link = tmp_path / "link.usda"
    link.symlink_to(own_scene)
    for out in (own_scene, home / "render.usda", home / "edits" / "user.usda", link):
        with pytest.raises(InputError, match="is an input of this command"):
            flatten_scene(own_scene, out)
    for out in (home, home / "inner", home / "deep" / "inner", home.parent):
        with pytest.raises(InputError, match="an input of this command"):
            checkout_scene(own_scene, out)
    assert folder_digest(home) == before
    flatten_scene(own_scene, home / "part.usda")  # made here, and so replaceable: but not where the scene reads it
    own_scene.write_text(own_scene.read_text().replace("@./render.usda@", "@./render.usda@, @./part.usda@"))
    with pytest.raises(InputError, match="is an input of this command"):
        flatten_scene(own_scene, home / "part.usda")


def test_nothing_is_written_into_a_store(own_scene: Path, tmp_path: Path) -> None:
    """A stored scene is read; its folder takes no file and no copy, by whatever name one comes to it."""
    stored = tmp_path / "stage"
    shutil.copytree(own_scene.parent, stored)
    (stored / MANIFEST).write_text("{}")
    (tmp_path / "link").symlink_to(stored)
    before = folder_digest(stored)
    for home in (stored, tmp_path / "link"):
        with pytest.raises(InputError, match="lies in a stored result"):
            flatten_scene(own_scene, home / "flat.usda")
        with pytest.raises(InputError, match="lies in a stored result"):
            export_scene(own_scene, home / "scene.usdz", False, 64, print)
        with pytest.raises(InputError, match="lies in a stored result"):
            checkout_scene(own_scene, home / "mine")
    assert folder_digest(stored) == before
    assert (checkout_scene(stored, tmp_path / "mine").parent / "render.usda").is_file()
