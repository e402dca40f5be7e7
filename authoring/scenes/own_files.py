"""The files that belong to a scene: those that its layers use, in any variant, and those that its manifest lists."""

from pathlib import Path

from pxr import UsdUtils

from authoring.scenes.inventory import scene_files
from authoring.scenes.manifest import NAME
from groundwork.errors import InputError
from groundwork.files import read_json
from groundwork.foreign_file import is_regular
from usd_schemas.guard.layer_walk import Bounds, walk_layers

VARIANTS = "variant_*.usda"  # root layers with other selections
_BESIDE = frozenset(
    {
        ".usda",
        ".usdc",
        ".usd",
        ".usdz",
        ".json",
        ".png",
        ".jpg",
        ".jpeg",
        ".exr",
        ".hdr",
        ".tif",
        ".tiff",
        ".md",
        ".txt",
    }
)


def own_files(root: Path) -> tuple[str, ...]:
    """List the files of a scene: those that its layers refer to, variants beside the root layer, and the manifest's.

    Other files in the folder do not belong to the scene, and links must not lead out of it.

    Args:
        root: Root layer.

    Returns:
        Paths from its folder, sorted.

    Raises:
        InputError: A layer refers to a file that is remote or outside the folder, also through a link.
    """
    home = root.resolve().parent
    found: set[str] = set()
    for layer in (root, *sorted(root.parent.glob(VARIANTS))):
        found.update(used_files(layer))
    if (home / NAME).is_file():
        record = read_json(home / NAME)
        listed = record.get("files") if isinstance(record, dict) else None
        found.update(name for name in listed or () if _is_beside(home, name))
        found.add(NAME)
    for name in found:
        _check_inside(home, name, root)
    return tuple(sorted(found))


def used_files(root: Path) -> tuple[str, ...]:
    """List every layer and texture that a stage uses, in any variant; none may be outside its folder.

    Args:
        root: Root layer.

    Returns:
        Paths from its folder, sorted.

    Raises:
        InputError: One is remote or outside the folder, also through a link.
    """
    home = root.resolve().parent
    quiet = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        walk_layers(root.resolve(), Bounds(home, (home,)), lambda line: None)
        names = tuple(scene_files(root))
    finally:
        del quiet
    for name in names:
        _check_inside(home, name, root)
    return names


def _is_beside(home: Path, name: str) -> bool:
    path = home / name
    return Path(name).suffix.lower() in _BESIDE and is_regular(path) and path.resolve().is_relative_to(home)


def _check_inside(home: Path, name: str, root: Path) -> None:
    path = home / name
    if not is_regular(path) or not path.resolve().is_relative_to(home):
        raise InputError("uses a file outside its folder", where=root, value=name, hint="Flatten the scene instead")
