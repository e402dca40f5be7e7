"""Site layer: the ground that bridge, surveys and backgrounds rely on; always loaded, never a variant."""

from pxr import Kind, Sdf

from authoring.layers.geometry import SITE
from authoring.layers.identity import name_asset
from authoring.layers.layer import add_sublayers
from authoring.layers.looks import surface_layer
from authoring.looks.material import MaterialRecipe


def site_layer(recipes: dict[str, MaterialRecipe]) -> Sdf.Layer:
    """Author the root layer of the site.

    Args:
        recipes: One recipe for each material that the site uses.

    Returns:
        A layer in memory, to be written as `site/site.usda`.
    """
    layer = surface_layer(SITE, recipes)
    layer.GetPrimAtPath("/Site").SetInfo("kind", Kind.Tokens.component)
    name_asset(layer, "/Site", "site", "site.usda")
    add_sublayers(layer, ["./semantics.usda", "./geometry.usdc"])
    return layer
