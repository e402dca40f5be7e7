"""Scene variant: a small layer over `scene.usda` that selects a look, a background and a light."""

from pxr import Sdf

from authoring.layers.selection import select_in


def variant_layer(scene: Sdf.Layer, name: str, selections: dict[str, str]) -> Sdf.Layer:
    """Author a scene variant.

    Args:
        scene: Root layer of the scene; its metadata are repeated, because those of a sublayer are not used.
        name: File name of that layer.
        selections: Axis (`look`, `background`, `light`) to name.

    Returns:
        A layer in memory, to be written beside the scene.
    """
    layer = Sdf.Layer.CreateAnonymous(".usda")
    for key in scene.pseudoRoot.ListInfoKeys():
        if key not in ("subLayers", "subLayerOffsets", "documentation", "comment"):
            layer.pseudoRoot.SetInfo(key, scene.pseudoRoot.GetInfo(key))
    layer.subLayerPaths = [f"./{name}"]
    select_in(layer, selections)
    return layer
