"""Look layer: the materials that fill the roles of any bridge; and the own materials of sites and backgrounds."""

from pxr import Sdf, UsdGeom

from authoring.layers.geometry import Asset
from authoring.layers.layer import new_stage
from authoring.looks.material import MaterialRecipe, author_material, author_sheets


def look_layer(recipes: dict[str, MaterialRecipe]) -> Sdf.Layer:
    """Author one look; referenced onto the looks of a bridge, it fills the role materials there.

    Args:
        recipes: One recipe for each role.

    Returns:
        A layer in memory, to be written as `look.usda` beside its textures.
    """
    stage = new_stage("Look")
    UsdGeom.Scope.Define(stage, "/Look")
    for role, recipe in sorted(recipes.items()):
        author_material(stage, f"/Look/{role}", recipe)
        author_sheets(stage, f"/Look/{role}", recipe)
    return stage.GetRootLayer()


def surface_layer(asset: Asset, recipes: dict[str, MaterialRecipe]) -> Sdf.Layer:
    """Author the root layer of an asset that has its own materials, as a stronger layer than geometry and semantics.

    Args:
        asset: Site or background.
        recipes: One recipe for each name that its pieces use.

    Returns:
        A layer in memory, to be written beside `semantics.usda`, `geometry.usdc` and its textures.
    """
    stage = new_stage(asset.root)
    stage.OverridePrim(asset.looks)
    for name, recipe in sorted(recipes.items()):
        author_material(stage, asset.material(name), recipe)
    return stage.GetRootLayer()
