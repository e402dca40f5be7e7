"""An editable copy of a scene: stored scenes are read-only."""

import shutil
from pathlib import Path

from authoring.scenes.inventory import scene_files
from groundwork.errors import InputError, MissingError
from groundwork.files import MANIFEST
from groundwork.marks import MARK, NEXT, TEMPORARY
from groundwork.output_folder import fresh_output
from groundwork.output_reading import reading

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
    with reading(source):
        root = find_root_layer(source)
        home = root.parent.resolve()

        def write(folder: Path) -> None:
            for name in scene_files(root):
                if not (home / name).is_file():
                    raise InputError(
                        "takes a file from outside its folder", where=root, value=name, mend="Flatten it instead"
                    )
            unwanted = shutil.ignore_patterns(MANIFEST, MARK, NEXT, f"{TEMPORARY}*")
            # inside an atomic folder
            shutil.copytree(home, folder, copy_function=shutil.copyfile, ignore=unwanted, dirs_exist_ok=True)

        fresh_output(out, "copy of a scene", write, inputs=[home], asked=str(home), is_marked=False)
    return out / root.name


def find_root_layer(source: Path) -> Path:
    """Find the root layer of a scene.

    Args:
        source: Scene folder, a folder of a run such as `OUT/scenes/0000`, or a root layer.

    Raises:
        MissingError: There is none.
    """
    with reading(source):
        for candidate in (source, source / ROOT, source / "stage" / ROOT):
            if candidate.is_file():
                return candidate
    raise MissingError(f"holds no {ROOT}", where=source, mend="Name a scene folder, or OUT/scenes/0000 of a run")
