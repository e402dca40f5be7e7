"""One layer file: opened in memory, written as a whole, so that the same content is always the same bytes."""

from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

from usd_schemas import tokens


def new_layer(default_prim: str) -> Sdf.Layer:
    """Open an empty layer in memory with the metadata of every layer of a scene.

    USD converts no units across arcs, so each layer states its own. A text layer in memory exports to canonical
    bytes of either format, which a binary layer saved in place does not.

    Args:
        default_prim: Name of the root prim that references to this layer use.
    """
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.defaultPrim = default_prim
    world = layer.pseudoRoot
    world.SetInfo(UsdGeom.Tokens.metersPerUnit, 1.0)
    world.SetInfo(UsdGeom.Tokens.upAxis, UsdGeom.Tokens.z)
    layer.timeCodesPerSecond = tokens.TIME_CODES_PER_SECOND
    layer.framesPerSecond = tokens.TIME_CODES_PER_SECOND
    return layer


def new_stage(default_prim: str) -> Usd.Stage:
    """Open a stage on a new layer, for writers that use schemas.

    Args:
        default_prim: Name of the root prim that references to this layer use.
    """
    return Usd.Stage.Open(new_layer(default_prim), Usd.Stage.LoadAll)


def add_sublayers(layer: Sdf.Layer, paths: list[str]) -> None:
    """Add sublayers, strongest first; the files need not exist yet.

    Args:
        layer: A layer that no open stage uses, since a stage would look for the files at once.
        paths: Paths relative to where the layer will be written, each starting with `./`.
    """
    layer.subLayerPaths = paths


def export(layer: Sdf.Layer, path: Path) -> None:
    """Write a layer to a new file.

    Args:
        layer: Layer in memory.
        path: Where to write; the suffix chooses text (`.usda`) or binary (`.usdc`).

    Raises:
        OSError: USD could not write the file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if not layer.Export(str(path)):  # inside an atomic folder
        raise OSError(f"{path}: not written")
