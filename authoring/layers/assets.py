"""One asset on disk: geometry, labels, and the materials of its pieces."""

from dataclasses import replace
from pathlib import Path

from authoring.layers.geometry import Asset, geometry_layer, roles_of
from authoring.layers.layer import export
from authoring.layers.semantics import semantics_layer
from authoring.looks.bake import bake_surface, open_ground, write_texture
from authoring.looks.encode import encode_raw, jpeg
from authoring.looks.ground_photo import ground_photo
from authoring.looks.library import SHEETS, SheetName, bake_sheets
from authoring.looks.material import MaterialRecipe
from authoring.looks.noise import Bank
from authoring.looks.scenery import worn_in
from authoring.looks.seasons import SUMMER, Season
from authoring.looks.shallows import shallows
from authoring.looks.wakes import with_wakes
from authoring.shapes.component import Component, Scatter
from authoring.site.photo import surface_of
from authoring.site.site import Site
from authoring.streams import stream
from groundwork.files import write_bytes

Pieces = tuple[Component | Scatter, ...]

_SHALLOWS = 1024  # largest number of texels along a side of the image of a river's bed


def write_asset(asset: Asset, pieces: Pieces, folder: Path) -> None:
    """Write the geometry and the labels of an asset.

    Args:
        asset: Paths of its parts.
        pieces: Components and scatters.
        folder: Folder of the asset.
    """
    export(geometry_layer(asset, pieces), folder / "geometry.usdc")
    export(semantics_layer(asset, pieces), folder / "semantics.usda")


def bake_surfaces(
    pieces: Pieces, folder: Path, texels: int, seed: int, season: Season = SUMMER, more: tuple[str, ...] = ()
) -> dict[str, MaterialRecipe]:
    """Bake the materials of a background, or of a site without the images of its ground.

    Args:
        pieces: Its components and scatters.
        folder: Folder of the asset; receives `textures/`.
        texels: Texels along a side of a sheet [px].
        seed: Seed of the scene.
        season: Season of the plants.
        more: Further surfaces.

    Returns:
        One recipe for each material of the pieces, and for each further surface.
    """
    # One sheet per surface, the same for site and background: their grass is continuous over the border.
    names = sorted({surface_of(role)[0] for role in roles_of(pieces)} | set(more))
    numbers = {name: int(stream(seed, f"surface/{name}").integers(SHEETS)) for name in names}
    sheets = {name: SheetName(name, number, texels, worn_in(name, season)) for name, number in numbers.items()}
    bake_sheets(sheets.values())
    prefix, patches = f"{folder.name}_", patches_of(seed)
    return {name: bake_surface(sheet, folder, prefix=prefix, patches=patches) for name, sheet in sheets.items()}


def bake_site(
    site: Site, folder: Path, texels: int, seed: int, season: Season = SUMMER, bridge: Pieces = ()
) -> dict[str, MaterialRecipe]:
    """Bake the materials of a site, with the images of the ground near the bridge.

    Args:
        site: The site.
        folder: Its folder; receives `textures/`.
        texels: Texels along a side of a sheet and of a picture [px].
        seed: Seed of the scene.
        season: Season of the plants.
        bridge: Parts of the bridge; those that stand in the river have wakes.
    """
    recipes = bake_surfaces(site.pieces, folder, texels, seed, season)
    patches = open_ground(texels, patches_of(seed))
    bank, drawn = Bank(), int(stream(seed, "surface/photo").integers(2**31))
    photos = {}
    for square in site.squares:
        factors = ground_photo(site, square, patches, texels, drawn, bank)
        file = f"./textures/{folder.name}_photo{square.number}.jpg"
        write_bytes(folder / file, jpeg(encode_raw(factors / 2)))
        photos[square.number] = file
    if site.land.crossing.kind == "river":
        factors = shallows(site, min(texels, _SHALLOWS), stream(seed, "surface/shallows"))
        factors = with_wakes(factors, site, bridge, stream(seed, "surface/wakes"))
        file = write_texture(folder, f"{folder.name}_shallows", encode_raw(factors / 2))
        recipes["water"] = replace(recipes["water"], macro_file=file)
    for role in roles_of(site.pieces):
        surface, number = surface_of(role)
        if number is not None:
            recipes[role] = replace(recipes[surface], macro_file=photos[number])
    return recipes


def patches_of(seed: int) -> int:
    """Draw the number of the patches on the open ground of a scene.

    Args:
        seed: Seed of the scene.
    """
    return int(stream(seed, "surface/patches").integers(2**31))
