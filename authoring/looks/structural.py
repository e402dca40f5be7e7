"""Surfaces of bridges: each new, after some decades, and after many.

A surface `x` has the rows `x_clean`, `x` and `x_aged`, but for the few that no weather changes.
"""

from collections.abc import Callable
from functools import partial

from authoring.looks import coated, mineral, organic, walls
from authoring.looks.noise import Tile
from authoring.looks.recipe import FAINT, FULL, GRAIN, NEW_GRAIN, SIDE, Recipe
from authoring.looks.sheet import Color, Sheet

CLEAN, AGED = "_clean", "_aged"

_METAL = (0.22, 0.24, 0.28)  # grain of coated metal after decades: its sheets are the plainest
_STONY = (0.30, 0.24, 0.18)  # grain of asphalt, whose stones its sheet shows already
_WORN = 0.8  # contrast of sheets that age, dirt or loose stones have made uneven as they are drawn
_ROAD = 10.24  # [m]; a camera that crosses a road by 3 to 4 m from image to image must not meet the same asphalt


def _ages(
    name: str,
    draw: Callable[..., Sheet],
    new: dict[str, Color] | None = None,
    old: dict[str, Color] | None = None,
    *,
    details: tuple[tuple[float, float, float], ...] = (NEW_GRAIN, GRAIN, GRAIN),
    years: tuple[float, float, float] = (0.1, 0.8, 1.2),
    meters: float = SIDE,
    relief: bool = False,
    contrasts: tuple[float, float, float] = (1.0, 1.0, _WORN),
) -> dict[str, Recipe]:
    rows = zip((CLEAN, "", AGED), years, (new, None, old), details, contrasts, strict=True)
    return {
        f"{name}{suffix}": Recipe(
            partial(draw, age=age, **(own or {})),
            meters,
            detail,
            relief=relief,
            pixels=FULL,
            contrast=contrast,
            picture="grain",
        )
        for suffix, age, own, detail, contrast in rows
    }


def _stones(color: Color, bed: Color) -> Recipe:
    return Recipe(
        partial(mineral.stones, pitch=0.07, color=color, bed=bed),
        SIDE,
        GRAIN,
        relief=True,
        pixels=FULL,
        contrast=_WORN,
        picture="grain",
    )


def _marking(tile: Tile, age: float, color: Color = (0.60, 0.595, 0.57)) -> Sheet:
    road = _new_asphalt(tile) if age < 0.3 else mineral.asphalt(tile, age)
    return coated.marking(tile, age, road.albedo, color)


# New work: cement before soot and moss have browned it, stones that bitumen still coats, zinc before it has dulled.
_NEW_CEMENT: Color = (0.520, 0.525, 0.515)
_OLD_CEMENT: Color = (0.315, 0.298, 0.266)
_BITUMEN: dict[str, Color] = {"bitumen": (0.026, 0.027, 0.029), "stone": (0.052, 0.054, 0.058)}
_OLD_BITUMEN: dict[str, Color] = {"bitumen": (0.094, 0.092, 0.088), "stone": (0.190, 0.184, 0.172)}
_new_asphalt = partial(mineral.asphalt, age=0.1, **_BITUMEN)

# Topcoats that bridge owners use, linear.
PAINTS: dict[str, Color] = {
    "green": (0.095, 0.155, 0.145),
    "blue": (0.155, 0.330, 0.460),
    "grey": (0.330, 0.350, 0.360),
    "dark": (0.085, 0.092, 0.100),
    "oxide": (0.215, 0.060, 0.042),
    "cream": (0.560, 0.500, 0.370),
    "teal": (0.055, 0.185, 0.190),
    "orange": (0.400, 0.100, 0.040),
    "white": (0.600, 0.610, 0.600),
}


def _paints() -> dict[str, Recipe]:
    rows: dict[str, Recipe] = {}
    for name, color in PAINTS.items():
        paint: dict[str, Color] = {"color": color}
        draw = partial(coated.painted_steel, **paint)
        rows |= _ages(f"paint_{name}", draw, details=(FAINT, _METAL, _METAL), years=(0.0, 0.7, 1.25))
    return rows


STRUCTURAL: dict[str, Recipe] = {
    **_ages("board_concrete", mineral.board_concrete, {"color": _NEW_CEMENT}, {"color": _OLD_CEMENT}, relief=True),
    **_ages("panel_concrete", mineral.panel_concrete, {"color": _NEW_CEMENT}, {"color": _OLD_CEMENT}),
    **_ages(
        "soffit_concrete",
        partial(mineral.panel_concrete, ties=False),
        {"color": (0.530, 0.535, 0.525)},
        {"color": (0.30, 0.285, 0.255)},
    ),
    **_ages("smooth_concrete", mineral.smooth_concrete, {"color": (0.555, 0.56, 0.55)}, {"color": (0.33, 0.32, 0.29)}),
    **_ages("deck_concrete", mineral.deck_concrete, {"color": (0.480, 0.485, 0.478)}, {"color": (0.29, 0.275, 0.245)}),
    **_ages("washed_concrete", walls.washed_concrete, relief=True),
    **_ages("coated_concrete", walls.coated_concrete, details=(FAINT, GRAIN, GRAIN)),
    **_ages(
        "asphalt",
        mineral.asphalt,
        _BITUMEN,
        _OLD_BITUMEN,
        details=(_STONY, _STONY, _STONY),
        years=(0.1, 0.7, 1.2),
        meters=_ROAD,
        contrasts=(1.0, _WORN, 0.75),
    ),
    **_ages(
        "road_marking", _marking, {"color": (0.67, 0.67, 0.65)}, details=(FAINT, GRAIN, GRAIN), years=(0.1, 0.6, 1.0)
    ),
    **_ages(
        "yellow_marking",
        partial(_marking, color=(0.56, 0.37, 0.125)),
        details=(FAINT, GRAIN, GRAIN),
        years=(0.1, 0.6, 1.0),
    ),
    **_ages("masonry", mineral.masonry, {"color": (0.50, 0.47, 0.40), "other": (0.46, 0.45, 0.42)}, relief=True),
    **_ages("granite", partial(mineral.masonry, color=(0.345, 0.340, 0.335), other=(0.29, 0.285, 0.285)), relief=True),
    **_ages(
        "sandstone", partial(mineral.masonry, color=(0.345, 0.225, 0.155), other=(0.31, 0.245, 0.185)), relief=True
    ),
    **_ages("rubble", walls.rubble, relief=True),
    **_ages("brickwork", walls.brickwork, relief=True),
    **_paints(),
    **_ages(
        "painted_steel",
        partial(coated.painted_steel, color=PAINTS["green"]),
        {"color": PAINTS["blue"]},
        details=(FAINT, _METAL, _METAL),
        years=(0.0, 0.7, 1.25),
    ),
    **_ages("weathering_steel", coated.weathering_steel, details=(NEW_GRAIN, GRAIN, GRAIN)),
    **_ages("galvanised_steel", coated.galvanised, {"color": (0.555, 0.565, 0.575)}, details=(FAINT, _METAL, _METAL)),
    **_ages("rail_steel", coated.rail_steel, details=(FAINT, _METAL, _METAL), years=(0.2, 0.8, 1.2)),
    **_ages("rubber", coated.rubber, details=(FAINT, GRAIN, GRAIN)),
    **_ages("timber", organic.timber, {"color": (0.215, 0.165, 0.110)}, {"color": (0.165, 0.150, 0.130)}),
    **_ages("tarred_timber", partial(organic.timber, color=(0.070, 0.056, 0.044))),
    "ballast": _stones((0.160, 0.150, 0.140), (0.100, 0.092, 0.084)),
    "ballast_basalt": _stones((0.088, 0.090, 0.093), (0.055, 0.055, 0.055)),
    "ballast_limestone": _stones((0.290, 0.275, 0.246), (0.182, 0.168, 0.144)),
    "ballast_rusty": _stones((0.146, 0.095, 0.064), (0.090, 0.061, 0.043)),
}
