"""An editable copy of a scene: stored scenes are read-only."""

import shutil
from pathlib import Path

from authoring.scenes.inventory import scene_files
from groundwork.errors import InputError, MissingError
from groundwork.files import MANIFEST, MARK, commit_folder, sole_writer, space_errors

ROOT = "scene.usda"


def checkout_scene(source: Path, out: Path) -> Path:
    """Copy a scene folder, free to be edited.

    Args:
        source: Scene folder, a folder of a run such as `OUT/scenes/0000`, or a root layer.
        out: Folder to make; nothing that is there is ever replaced, since it may hold somebody's edits.

    Returns:
        Root layer of the copy.

    Raises:
        InputError: No such scene, files outside its folder, or the output folder is not empty.
    """
    root = find_root_layer(source)
    _refuse_filled(out)
    home = root.parent.resolve()
    for name in scene_files(root):
        if not (home / name).is_file():
            raise InputError("takes a file from outside its folder", where=root, value=name, mend="Flatten it instead")
    partial = out.with_name(f".{out.name}.partial")
    with space_errors(out), sole_writer(out):
        shutil.rmtree(partial, ignore_errors=True)
        unwanted = shutil.ignore_patterns(MANIFEST, MARK)
        # inside an atomic folder: it gets its name with one rename below
        shutil.copytree(home, partial, copy_function=shutil.copyfile, ignore=unwanted)
        _refuse_filled(out)  # it may have been filled meanwhile
        if out.exists():
            out.rmdir()
        commit_folder(partial, out)
    return out / root.name


def _refuse_filled(out: Path) -> None:
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError("is not empty", where=out, mend="Name a new folder with -o")


def find_root_layer(source: Path) -> Path:
    """Find the root layer of a scene.

    Args:
        source: Scene folder, a folder of a run such as `OUT/scenes/0000`, or a root layer.

    Raises:
        MissingError: There is none.
    """
    for candidate in (source, source / ROOT, source / "stage" / ROOT):
        if candidate.is_file():
            return candidate
    raise MissingError(f"holds no {ROOT}", where=source, mend="Name a scene folder, or OUT/scenes/0000 of a run")
