"""The table of surfaces: how each is drawn, how large its sheet is, and how strong its fine detail."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from authoring.looks import coated, mineral, organic, urban
from authoring.looks.noise import Tile
from authoring.looks.sheet import Sheet

DETAIL_PERIODS = (5.3, 1.37, 0.41)  # [m] incommensurate with each other and with the sheets, so that nothing repeats


@dataclass(frozen=True)
class Recipe:
    """How one surface is made.

    Attributes:
        draw: Draws the sheet.
        metres: Length of the sheet's sides [m].
        detail: Contrast of the fine detail at each of `DETAIL_PERIODS` [1].
        patchy: On the site's ground: carries the patchy macro texture on `st1`.
        relief: Write a normal map.
        finer: Texels along a side, as a multiple of what the settings ask for.
    """

    draw: Callable[[Tile], Sheet]
    metres: float
    detail: tuple[float, float, float]
    patchy: bool = False
    relief: bool = False
    finer: int = 1


_ROUGH = (0.34, 0.26, 0.24)  # strong enough that a patch differs from itself one sheet on
_SMOOTH = (0.12, 0.12, 0.14)
_FAINT = (0.06, 0.06, 0.08)


def _marking(tile: Tile, age: float) -> Sheet:
    return coated.marking(tile, age, mineral.asphalt(tile, age).albedo)


# New work: cement before soot and moss have browned it, stones that bitumen still coats, zinc before it has dulled.
_NEW_CEMENT = (0.520, 0.525, 0.515)
_new_asphalt = partial(mineral.asphalt, age=0.1, bitumen=(0.026, 0.027, 0.029), stone=(0.052, 0.054, 0.058))


def _new_marking(tile: Tile) -> Sheet:
    return coated.marking(tile, 0.1, _new_asphalt(tile).albedo, color=(0.67, 0.67, 0.65))


RECIPES: dict[str, Recipe] = {
    "board_concrete": Recipe(partial(mineral.board_concrete, age=0.8), 5.0, _ROUGH, relief=True),
    "panel_concrete": Recipe(partial(mineral.panel_concrete, age=0.8), 5.0, _ROUGH),
    "smooth_concrete": Recipe(partial(mineral.smooth_concrete, age=0.7), 5.0, _ROUGH),
    "deck_concrete": Recipe(partial(mineral.deck_concrete, age=0.8), 5.0, _ROUGH),
    "board_concrete_clean": Recipe(
        partial(mineral.board_concrete, age=0.1, color=_NEW_CEMENT), 5.0, _SMOOTH, relief=True
    ),
    "panel_concrete_clean": Recipe(partial(mineral.panel_concrete, age=0.1, color=_NEW_CEMENT), 5.0, _SMOOTH),
    "smooth_concrete_clean": Recipe(
        partial(mineral.smooth_concrete, age=0.1, color=(0.555, 0.560, 0.550)), 5.0, _SMOOTH
    ),
    "deck_concrete_clean": Recipe(partial(mineral.deck_concrete, age=0.1, color=(0.480, 0.485, 0.478)), 5.0, _SMOOTH),
    "concrete": Recipe(partial(mineral.panel_concrete, age=0.5), 5.0, _ROUGH),
    # A sheet as wide as the road: when it was 4 m, a camera that crossed the road by 3.3 m from image to image matched
    # the asphalt one sheet on, and half of the flight was put together 18 m off.
    "asphalt": Recipe(partial(mineral.asphalt, age=0.7), 12.7, _ROUGH, finer=2),
    "asphalt_clean": Recipe(_new_asphalt, 12.7, _ROUGH, finer=2),
    "road_marking": Recipe(partial(_marking, age=0.6), 4.0, _SMOOTH),
    "road_marking_clean": Recipe(_new_marking, 4.0, _FAINT),
    "masonry": Recipe(partial(mineral.masonry, age=0.8), 4.0, _ROUGH, relief=True),
    "masonry_clean": Recipe(
        partial(mineral.masonry, age=0.1, color=(0.50, 0.47, 0.40), other=(0.46, 0.45, 0.42)), 4.0, _SMOOTH, relief=True
    ),
    "brick": Recipe(mineral.brick, 4.0, _ROUGH, relief=True),
    "plaster": Recipe(partial(mineral.plaster, color=(0.52, 0.46, 0.36)), 5.0, _ROUGH),
    "plaster_white": Recipe(partial(mineral.plaster, color=(0.64, 0.62, 0.57)), 5.0, _ROUGH),
    "plaster_rose": Recipe(partial(mineral.plaster, color=(0.56, 0.33, 0.24)), 5.0, _ROUGH),
    "roof_tile": Recipe(mineral.roof_tile, 4.0, _ROUGH, relief=True),
    "roof_grey": Recipe(partial(mineral.roof_tile, color=(0.110, 0.118, 0.130)), 4.0, _ROUGH, relief=True),
    "rock": Recipe(mineral.rock, 5.0, _ROUGH, relief=True),
    "gravel": Recipe(
        partial(mineral.stones, pitch=0.05, color=(0.23, 0.215, 0.19), bed=(0.12, 0.105, 0.085)),
        4.0,
        _ROUGH,
        relief=True,
    ),
    "ballast": Recipe(
        partial(mineral.stones, pitch=0.07, color=(0.165, 0.155, 0.145), bed=(0.06, 0.055, 0.05)),
        4.0,
        _ROUGH,
        relief=True,
    ),
    "grass": Recipe(partial(organic.grass, dry=0.2), 4.5, _ROUGH, patchy=True),
    "meadow": Recipe(organic.meadow, 4.5, _ROUGH, patchy=True),
    "soil": Recipe(organic.soil, 4.5, _ROUGH, patchy=True),
    "water": Recipe(organic.water, 6.0, _FAINT),
    "open_water": Recipe(organic.open_water, 90.0, _FAINT),
    "woodland": Recipe(organic.woodland, 60.0, _ROUGH),
    "timber": Recipe(organic.timber, 2.6, _ROUGH),
    "bark": Recipe(organic.bark, 2.0, _ROUGH, relief=True),
    "foliage": Recipe(organic.foliage, 3.0, _ROUGH),
    "painted_steel": Recipe(partial(coated.painted_steel, color=(0.095, 0.155, 0.145), age=0.7), 5.0, _SMOOTH),
    "painted_steel_clean": Recipe(partial(coated.painted_steel, color=(0.155, 0.330, 0.460), age=0.0), 5.0, _FAINT),
    "white_paint": Recipe(partial(coated.painted_steel, color=(0.60, 0.61, 0.60), age=0.1), 3.0, _FAINT),
    "painted_metal": Recipe(partial(coated.painted_steel, color=(0.235, 0.240, 0.235), age=0.45), 3.0, _SMOOTH),
    "galvanised_steel": Recipe(partial(coated.galvanised, age=0.8), 3.0, _SMOOTH),
    "galvanised_steel_clean": Recipe(partial(coated.galvanised, age=0.1, color=(0.555, 0.565, 0.575)), 3.0, _FAINT),
    "rail_steel": Recipe(partial(coated.rail_steel, age=0.8), 3.0, _SMOOTH),
    "rail_steel_clean": Recipe(partial(coated.rail_steel, age=0.2), 3.0, _FAINT),
    "rubber": Recipe(partial(coated.rubber, age=0.8), 2.0, _SMOOTH),
    "rubber_clean": Recipe(partial(coated.rubber, age=0.1), 2.0, _FAINT),
    "window": Recipe(coated.glass, 3.0, _FAINT),
    "brick_buff": Recipe(urban.buff_brick, 4.0, _ROUGH, relief=True),
    "limestone": Recipe(
        partial(mineral.masonry, age=0.3, color=(0.47, 0.43, 0.35), other=(0.43, 0.40, 0.34)), 6.4, _ROUGH, relief=True
    ),
    "metal_panel": Recipe(partial(urban.cladding, color=(0.060, 0.058, 0.055)), 6.0, _SMOOTH),
    "metal_silver": Recipe(partial(urban.cladding, color=(0.26, 0.265, 0.265)), 6.0, _SMOOTH),
    "glass_facade": Recipe(partial(urban.facade_glass, color=(0.040, 0.075, 0.092)), 9.0, _FAINT),
    "glass_spandrel": Recipe(partial(urban.cladding, color=(0.055, 0.090, 0.100)), 6.0, _FAINT),
    "pavement": Recipe(urban.pavement, 6.0, _ROUGH),
    "roofing": Recipe(urban.roofing, 8.0, _ROUGH),
    "paint_colours": Recipe(urban.paint_colours, 8.0, (0.0, 0.0, 0.0)),
    "facade_brick": Recipe(
        partial(urban.far_facade, wall=(0.205, 0.105, 0.072), pane=(2.9, 3.2), opening=(0.46, 0.50)), 11.6, _SMOOTH
    ),
    "facade_stone": Recipe(
        partial(urban.far_facade, wall=(0.40, 0.365, 0.30), pane=(3.4, 3.5), opening=(0.62, 0.56)), 13.6, _SMOOTH
    ),
    "facade_ribbon": Recipe(
        partial(urban.far_facade, wall=(0.35, 0.34, 0.32), pane=(4.4, 3.5), opening=(0.92, 0.52)), 17.6, _SMOOTH
    ),
    "facade_glass": Recipe(
        partial(urban.far_facade, wall=(0.060, 0.085, 0.095), pane=(3.0, 3.7), opening=(0.90, 0.74)), 15.0, _SMOOTH
    ),
}

SURFACES = (
    "grass", "meadow", "soil", "gravel", "rock", "asphalt", "road_marking", "water",
    "brick", "plaster", "concrete", "roof_tile", "window", "bark", "foliage", "painted_metal",
)  # fmt: skip
