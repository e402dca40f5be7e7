"""An editable copy of a scene: stored scenes are read-only."""

import shutil
from pathlib import Path

from authoring.scenes.own_files import own_files
from groundwork.errors import InputError, MissingError
from groundwork.files import commit_folder, sole_writer, space_errors
from groundwork.slug import inside

ROOT = "scene.usda"


def checkout_scene(source: Path, out: Path) -> Path:
    """Copy the files that are a scene's own, free to be edited; what else lies beside them stays there.

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
    names = own_files(root)
    partial = out.with_name(f".{out.name}.partial")
    with space_errors(out), sole_writer(out):
        shutil.rmtree(partial, ignore_errors=True)
        for name in names:
            target = inside(partial, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(home / name, target)  # inside an atomic folder: it gets its name with one rename below
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
