"""Background layer: the surroundings outside the site, as a component asset that any scene can reference."""

from pxr import Kind, Sdf

from authoring.layers.geometry import BACKGROUND
from authoring.layers.identity import name_asset
from authoring.layers.layer import add_sublayers
from authoring.layers.looks import surface_layer
from authoring.looks.material import MaterialRecipe


def background_layer(name: str, recipes: dict[str, MaterialRecipe]) -> Sdf.Layer:
    """Author the root layer of a background.

    Args:
        name: Name of the background, e.g. `countryside`.
        recipes: One recipe for each material that it uses.

    Returns:
        A layer in memory, to be written as `background/<name>/<name>.usda`.
    """
    layer = surface_layer(BACKGROUND, recipes)
    prim = layer.GetPrimAtPath("/Background")
    prim.SetInfo("kind", Kind.Tokens.component)
    name_asset(layer, "/Background", name, f"{name}.usda")
    add_sublayers(layer, ["./semantics.usda", "./geometry.usdc"])
    return layer
