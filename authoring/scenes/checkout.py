"""An editable copy of a scene: stored scenes are read-only."""

import shutil
from pathlib import Path

from groundwork.errors import MissingError
from groundwork.output.folder import fresh_output
from groundwork.output.reading import reading
from groundwork.slug import inside

ROOT = "scene.usda"


def checkout_scene(source: Path, out: Path) -> Path:
    """Copy a scene's own files so that they can be edited; other files beside them are not copied.

    Args:
        source: Scene folder, a folder of a run such as `OUT/scenes/0000`, or a root layer.
        out: Folder to make; an existing one is never replaced, since it may hold edits.

    Returns:
        Root layer of the copy.

    Raises:
        InputError: No such scene, files outside its folder, or the output folder is not empty.
    """
    with reading(source):
        root = find_root_layer(source)
        from authoring.scenes.own_files import own_files  # USD: loaded once there is a scene

        home = root.parent.resolve()
        names = own_files(root)

        def write(folder: Path) -> None:
            for name in names:
                target = inside(folder, name)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(home / name, target)  # inside an atomic folder

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
    raise MissingError(f"holds no {ROOT}", where=source, hint="Name a scene folder, or OUT/scenes/0000 of a run")
