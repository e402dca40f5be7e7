"""The composition arcs of a scene's choices: one variant each, in the layer of the variant set."""

from pathlib import Path

from pxr import Sdf

from authoring.layers.change import change_layer
from authoring.layers.worlds import WorldFiles, offer_background
from usd_schemas import tokens


def add_look(bridge: Path, name: str, file: str, fallbacks: dict[str, str] | None = None) -> None:
    """Add a look as a choice.

    Args:
        bridge: Interface layer of the bridge.
        name: Name of the look.
        file: Its layer, relative to that of the bridge.
        fallbacks: Role that the look does not fill, to the layer of another look that does.
    """

    def change(layer: Sdf.Layer) -> None:
        filled = Sdf.PrimSpec(_variant(layer, "/Bridge", "look", name).primSpec, "BridgeLooks", Sdf.SpecifierOver)
        filled.referenceList.prependedItems = [Sdf.Reference(file)]
        for role, other in sorted((fallbacks or {}).items()):
            spec = Sdf.PrimSpec(filled, role, Sdf.SpecifierOver)
            spec.referenceList.prependedItems = [Sdf.Reference(other, f"/Look/{role}")]

    change_layer(bridge, change)


def add_background(scene: Path, name: str, files: WorldFiles) -> None:
    """Add a background as a choice.

    Args:
        scene: Root layer of the scene.
        name: Name of the background.
        files: Its files, relative to the root layer.
    """
    change_layer(scene, lambda layer: offer_background(layer, name, files))


def add_light(lighting: Path, name: str, file: str) -> None:
    """Add a light as a choice.

    Args:
        lighting: Lighting layer of the scene.
        name: Name of the light.
        file: Its layer, relative to the lighting layer.
    """

    def change(layer: Sdf.Layer) -> None:
        spec = _variant(layer, tokens.ENVIRONMENT, "light", name).primSpec
        spec.referenceList.prependedItems = [Sdf.Reference(file)]

    change_layer(lighting, change)


def _variant(layer: Sdf.Layer, prim: str, axis: str, name: str) -> Sdf.VariantSpec:
    variants = layer.GetPrimAtPath(prim).variantSets[axis]
    if name in variants.variants:
        variants.RemoveVariant(variants.variants[name])
    return Sdf.VariantSpec(variants, name)
