"""Lighting layers: sun and sky in a file for each light, and the choice among them under /World/Environment."""

from pxr import Sdf, UsdGeom

from authoring.layers.layer import new_layer, new_stage
from authoring.light.daylight import Lighting, author_lighting
from usd_schemas import tokens


def light_layer(lighting: Lighting) -> Sdf.Layer:
    """Author one light.

    Args:
        lighting: Sun and baked sky.

    Returns:
        A layer in memory, to be written as `lights/<name>/light.usda` beside its textures.
    """
    stage = new_stage("Environment")
    UsdGeom.Scope.Define(stage, "/Environment")
    author_lighting(stage, lighting, "/Environment")
    return stage.GetRootLayer()


def lighting_layer(lights: dict[str, str]) -> Sdf.Layer:
    """Author the variant set `light` of a scene.

    Args:
        lights: File of each light, relative to this layer; the first is selected.

    Returns:
        A layer in memory, to be written as `lighting.usda`.
    """
    layer = new_layer("World")
    spec = Sdf.CreatePrimInLayer(layer, tokens.ENVIRONMENT)
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Scope"
    spec.variantSetNameList.prependedItems = ["light"]
    spec.variantSelections["light"] = next(iter(lights))
    variants = Sdf.VariantSetSpec(spec, "light")
    for name, file in sorted(lights.items()):
        Sdf.VariantSpec(variants, name).primSpec.referenceList.prependedItems = [Sdf.Reference(file)]
    return layer
