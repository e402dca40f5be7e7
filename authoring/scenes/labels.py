"""Label layers of a scene folder: the active table of classes, and whether older software can read them."""

from pathlib import Path

from pxr import Sdf, Usd

from authoring.layers.change import change_layer, check_editable
from authoring.layers.layer import export
from authoring.layers.replicator import replicator_layer
from authoring.layers.taxonomy import taxonomy_layer
from authoring.scenes.manifest import refresh_manifest
from authoring.settings import LabelSettings
from usd_schemas.taxonomies import BASE, taxonomy

ROOT = "scene.usda"
TAXONOMY_FOLDER = "./taxonomies/"
REPLICATOR_FILE = "./compat_replicator.usda"
_EDITS = "./edits/"


def write_labels(settings: LabelSettings, folder: Path) -> None:
    """Switch the label layers of a new scene according to its settings.

    Args:
        settings: Which of them.
        folder: Scene folder with its other layers already written.
    """
    if settings.taxonomy != BASE:
        write_taxonomy_layer(folder, settings.taxonomy)
    if settings.replicator:
        write_replicator_layer(folder)


def write_taxonomy_layer(folder: Path, name: str) -> None:
    """Activate a table in a scene; the layer of another one is deactivated, but its file is kept.

    A compatibility layer of the scene is rewritten, because it contains the classes of the active table.

    Args:
        folder: Scene folder.
        name: One of `TAXONOMIES`; the base table needs no layer, because it is in the render layer.

    Raises:
        InputError: There is no such table, or the scene is a stored result.
    """
    table = taxonomy(name)
    check_editable(folder)
    path = "" if name == BASE else f"{TAXONOMY_FOLDER}{name}.usdc"
    if path:
        export(taxonomy_layer(table), folder / path)
    _exchange_sublayer(folder, path, former=TAXONOMY_FOLDER)
    if (folder / REPLICATOR_FILE).is_file():
        write_replicator_layer(folder)
    refresh_manifest(folder)


def write_replicator_layer(folder: Path) -> None:
    """Write `compat_replicator.usda` from the labels of a scene and activate it; rewrite it after changes of the scene.

    Args:
        folder: Scene folder.

    Raises:
        InputError: The scene is a stored result.
    """
    check_editable(folder)
    _exchange_sublayer(folder, "", former=REPLICATOR_FILE)
    export(replicator_layer(Usd.Stage.Open(str(folder / ROOT))), folder / REPLICATOR_FILE)
    _exchange_sublayer(folder, REPLICATOR_FILE, former=REPLICATOR_FILE)
    refresh_manifest(folder)


def _exchange_sublayer(folder: Path, path: str, former: str) -> None:
    """Insert a sublayer below the user's edits, if a path is given; sublayers that start with `former` are removed."""

    def exchange(layer: Sdf.Layer) -> None:
        others = [name for name in layer.subLayerPaths if not name.startswith(former)]
        place = sum(name.startswith(_EDITS) for name in others)
        layer.subLayerPaths = [*others[:place], *([path] if path else []), *others[place:]]

    change_layer(folder / ROOT, exchange)
