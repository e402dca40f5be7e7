"""Surfaces of sites and backgrounds, each with the name that their pieces ask for."""

from collections.abc import Callable
from functools import partial

import numpy as np

from authoring.looks import coated, mineral, organic, seasons, urban
from authoring.looks.leaves import leaves
from authoring.looks.noise import Tile
from authoring.looks.recipe import FAINT, FULL, ROUGH, SMOOTH, Recipe
from authoring.looks.seasons import SUMMER, Season
from authoring.looks.sheet import Sheet

# Earth, stones and what grows are matt: their measured albedos hold all light that they reflect. With the shine of a
# dielectric on top grass is a third brighter, and half as blue again as it is.
SCENERY: dict[str, Recipe] = {
    "concrete": Recipe(partial(mineral.panel_concrete, age=0.5), 5.0, ROUGH),
    "brick": Recipe(mineral.brick, 4.0, ROUGH, relief=True),
    "plaster": Recipe(partial(mineral.plaster, color=(0.52, 0.46, 0.36)), 5.0, ROUGH),
    "plaster_white": Recipe(partial(mineral.plaster, color=(0.64, 0.62, 0.57)), 5.0, ROUGH),
    "plaster_rose": Recipe(partial(mineral.plaster, color=(0.57, 0.42, 0.335)), 5.0, ROUGH),
    "plaster_ochre": Recipe(partial(mineral.plaster, color=(0.56, 0.44, 0.255)), 5.0, ROUGH),
    "roof_tile": Recipe(mineral.roof_tile, 4.0, ROUGH, relief=True),
    "roof_grey": Recipe(partial(mineral.roof_tile, color=(0.110, 0.118, 0.130)), 4.0, ROUGH, relief=True),
    "rock": Recipe(mineral.rock, 5.0, ROUGH, relief=True, matt=True),
    "cliff": Recipe(mineral.cliff, 150.0, ROUGH, matt=True),
    "gravel": Recipe(
        partial(mineral.stones, pitch=0.05, color=(0.23, 0.215, 0.19), bed=(0.12, 0.105, 0.085)),
        4.0,
        ROUGH,
        patchy=True,
        relief=True,
        matt=True,
    ),
    "grass": Recipe(partial(organic.grass, dry=0.2), 4.5, ROUGH, patchy=True, matt=True),
    "meadow": Recipe(organic.meadow, 4.5, ROUGH, patchy=True, matt=True),
    "soil": Recipe(organic.soil, 4.5, ROUGH, patchy=True, matt=True),
    "hay": Recipe(organic.hay, 4.5, ROUGH, patchy=True, matt=True),
    "furrows": Recipe(organic.furrows, 4.5, ROUGH, patchy=True, relief=True, matt=True),
    "crop": Recipe(partial(organic.crop, ripe=False), 4.5, ROUGH, patchy=True, matt=True),
    "ripe_crop": Recipe(partial(organic.crop, ripe=True), 4.5, ROUGH, patchy=True, matt=True),
    "water": Recipe(organic.water, 6.0, FAINT),
    "open_water": Recipe(organic.open_water, 90.0, FAINT),
    "woodland": Recipe(organic.woodland, 320.0, ROUGH, matt=True),
    "bark": Recipe(organic.bark, 2.0, ROUGH, relief=True, matt=True),
    "foliage": Recipe(organic.foliage, 3.0, ROUGH, matt=True),
    "leaves": Recipe(leaves, 4.0, FAINT, pixels=FULL, cut_out=True),
    "white_paint": Recipe(partial(coated.painted_steel, color=(0.60, 0.61, 0.60), age=0.1), 3.0, FAINT),
    "painted_metal": Recipe(partial(coated.painted_steel, color=(0.235, 0.240, 0.235), age=0.45), 3.0, SMOOTH),
    "window": Recipe(coated.glass, 3.0, FAINT),
    "brick_buff": Recipe(urban.buff_brick, 4.0, ROUGH, relief=True),
    "limestone": Recipe(
        partial(mineral.masonry, age=0.3, color=(0.47, 0.43, 0.35), other=(0.43, 0.40, 0.34)), 6.4, ROUGH, relief=True
    ),
    "metal_panel": Recipe(partial(urban.cladding, color=(0.060, 0.058, 0.055)), 6.0, SMOOTH),
    "metal_silver": Recipe(partial(urban.cladding, color=(0.26, 0.265, 0.265)), 6.0, SMOOTH),
    "glass_facade": Recipe(partial(urban.facade_glass, color=(0.040, 0.075, 0.092)), 9.0, FAINT),
    "glass_spandrel": Recipe(partial(urban.cladding, color=(0.055, 0.090, 0.100)), 6.0, FAINT),
    "pavement": Recipe(urban.pavement, 6.0, ROUGH),
    "roofing": Recipe(urban.roofing, 8.0, ROUGH),
    "paint_colours": Recipe(urban.paint_colors, 8.0, (0.0, 0.0, 0.0)),
    "facade_brick": Recipe(
        partial(urban.far_facade, wall=(0.205, 0.105, 0.072), pane=(2.9, 3.2), opening=(0.46, 0.50)), 11.6, SMOOTH
    ),
    "facade_stone": Recipe(
        partial(urban.far_facade, wall=(0.40, 0.365, 0.30), pane=(3.4, 3.5), opening=(0.62, 0.56)), 13.6, SMOOTH
    ),
    "facade_ribbon": Recipe(
        partial(urban.far_facade, wall=(0.35, 0.34, 0.32), pane=(4.4, 3.5), opening=(0.92, 0.52)), 17.6, SMOOTH
    ),
    "facade_glass": Recipe(
        partial(urban.far_facade, wall=(0.060, 0.085, 0.095), pane=(3.0, 3.7), opening=(0.90, 0.74)), 15.0, SMOOTH
    ),
}


def _woodland(tile: Tile, season: Season) -> Sheet:
    return organic.woodland(tile, seasons.WOODS[season], seasons.TURF[season])


def _shaded(surface: str, shades: seasons.Shades) -> Callable[[Tile, Season], Sheet]:
    """Draw a surface as in summer, and multiply its color."""

    def draw(tile: Tile, season: Season) -> Sheet:
        summer = SCENERY[surface].draw(tile)
        return Sheet(summer.albedo * np.asarray(shades[season], np.float32), summer.roughness, summer.height)

    return draw


# How what grows is drawn in another season than summer, as which `SCENERY` has it.
SEASONAL: dict[str, Callable[[Tile, Season], Sheet]] = {
    "leaves": leaves,
    "woodland": _woodland,
    "foliage": _shaded("foliage", seasons.HEARTS),
    "grass": _shaded("grass", seasons.TURF),
    "meadow": _shaded("meadow", seasons.TURF),
    "hay": _shaded("hay", seasons.TALL_GRASS),
    "crop": _shaded("crop", seasons.CEREALS),
    "ripe_crop": _shaded("ripe_crop", seasons.RIPE),
}


def worn_in(surface: str, season: Season) -> Season:
    """Tell which season's sheet a surface wears: what does not grow is as in summer all year.

    Args:
        surface: Name of a surface.
        season: The season.
    """
    return season if surface in SEASONAL else SUMMER
