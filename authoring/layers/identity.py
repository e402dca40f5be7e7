"""Name of an asset: `assetInfo` on its root prim, which asset managers and outliners read."""

from pxr import Sdf

from authoring.layers.provenance import software_version


def name_asset(layer: Sdf.Layer, prim: str, name: str, file: str, version: str = "") -> Sdf.Layer:
    """Record on the root prim of an asset its name, its file and its version.

    Args:
        layer: Root layer of the asset, in memory.
        prim: Path of its root prim.
        name: Its name, e.g. `countryside`.
        file: Name of the file that the layer will be written as.
        version: Its version; that of the software that makes it when empty.

    Returns:
        The same layer.
    """
    info = {"identifier": Sdf.AssetPath(f"./{file}"), "name": name, "version": version or software_version()}
    layer.GetPrimAtPath(prim).SetInfo("assetInfo", info)
    return layer
