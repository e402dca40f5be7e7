"""Lighting layer: sun and sky under /World/Environment."""

from pxr import Sdf, UsdGeom

from authoring.layers.layer import new_stage
from authoring.lighting import Lighting, author_lighting
from usd_schemas import tokens


def lighting_layer(lighting: Lighting) -> Sdf.Layer:
    """Author the lights of a scene.

    Args:
        lighting: Sun and baked sky.

    Returns:
        A layer in memory, to be written as `lighting.usda`.
    """
    stage = new_stage("World")
    stage.OverridePrim(tokens.WORLD)
    UsdGeom.Scope.Define(stage, tokens.ENVIRONMENT)
    author_lighting(stage, lighting)
    return stage.GetRootLayer()
