"""One asset on disk: geometry, labels, and the materials that its pieces name."""

from pathlib import Path

from authoring.component import Component, Scatter
from authoring.layers.geometry import Asset, geometry_layer, roles_of
from authoring.layers.layer import export
from authoring.layers.semantics import semantics_layer
from authoring.looks.bake import bake_surface
from authoring.looks.library import SHEETS, SheetName, bake_sheets
from authoring.looks.material import MaterialRecipe
from authoring.streams import stream

Pieces = tuple[Component | Scatter, ...]


def write_asset(asset: Asset, pieces: Pieces, folder: Path) -> None:
    """Write the geometry and the labels of an asset.

    Args:
        asset: Where its parts stand.
        pieces: Components and scatters.
        folder: Folder of the asset.
    """
    export(geometry_layer(asset, pieces), folder / "geometry.usdc")
    export(semantics_layer(asset, pieces), folder / "semantics.usdc")


def bake_surfaces(pieces: Pieces, folder: Path, texels: int, seed: int) -> dict[str, MaterialRecipe]:
    """Bake the materials of a site or background.

    Args:
        pieces: Its components and scatters.
        folder: Folder of the asset; receives `textures/`.
        texels: Texels along a side of a sheet [px].
        seed: Seed of the scene.

    Returns:
        One recipe for each material that the pieces name.
    """
    # One number a surface, the same for site and background: their grass is one grass, and goes on over the border.
    numbers = {name: int(stream(seed, f"surface/{name}").integers(SHEETS)) for name in roles_of(pieces)}
    bake_sheets(SheetName(name, number, texels) for name, number in numbers.items())
    return {name: bake_surface(name, folder, texels, f"{folder.name}_", number) for name, number in numbers.items()}
