"""The surface of each material role of a bridge in each look, and the sheet of each component."""

from dataclasses import dataclass

import numpy as np

from authoring.looks.library import SHEETS
from authoring.looks.structural import AGED, CLEAN, PAINTS
from authoring.shapes.component import Component, Scatter
from usd_schemas.tokens import ROLES

RANDOM = "random"

_GOLDEN = 0.6180339887498949  # its multiples put neighbors in different thirds of the unit interval

_USUAL: dict[str, str] = {
    "Role_AbutmentConcrete": "board_concrete",
    "Role_PierConcrete": "panel_concrete",
    "Role_CapConcrete": "panel_concrete",
    "Role_GirderConcrete": "smooth_concrete",
    "Role_DeckConcrete": "soffit_concrete",
    "Role_ParapetConcrete": "board_concrete",
    "Role_KerbConcrete": "deck_concrete",
    "Role_DeckAsphalt": "asphalt",
    "Role_RoadMarking": "road_marking",
    "Role_BearingRubber": "rubber",
    "Role_GirderSteel": "painted_steel",
    "Role_RailingSteel": "galvanised_steel",
    "Role_CableSteel": "galvanised_steel",
    "Role_RailSteel": "rail_steel",
    "Role_SleeperTimber": "timber",
    "Role_Ballast": "ballast",
    "Role_Masonry": "masonry",
}

_FORMED = ("board_concrete", "panel_concrete", "smooth_concrete")
_WALLS = (*_FORMED, "washed_concrete", "coated_concrete")
_STONE = ("masonry", "granite", "sandstone", "rubble", "brickwork")
_PAINTED = tuple(f"paint_{name}" for name in PAINTS)
_BALLAST = ("ballast", "ballast_basalt", "ballast_limestone", "ballast_rusty")

# Surfaces that a bridge owner could have chosen for the role. Source: Random Bridge Generator draws from such families
# too.
SUITS: dict[str, tuple[str, ...]] = {
    "Role_AbutmentConcrete": (*_WALLS, *_STONE),
    "Role_PierConcrete": (*_FORMED, "coated_concrete", "granite", "brickwork"),  # shafts 8 m high are never washed
    "Role_CapConcrete": (*_FORMED, "coated_concrete"),
    "Role_GirderConcrete": (*_FORMED, "coated_concrete"),
    "Role_DeckConcrete": (*_FORMED, "soffit_concrete", "deck_concrete"),
    "Role_ParapetConcrete": (*_WALLS, "granite"),
    "Role_KerbConcrete": ("deck_concrete", "smooth_concrete", "granite"),
    "Role_DeckAsphalt": ("asphalt", "asphalt", "asphalt", "deck_concrete"),
    "Role_RoadMarking": ("road_marking", "road_marking", "yellow_marking"),
    "Role_BearingRubber": ("rubber", "paint_dark", "galvanised_steel"),
    "Role_GirderSteel": (*_PAINTED, "weathering_steel", "weathering_steel"),
    "Role_RailingSteel": ("galvanised_steel", "galvanised_steel", *_PAINTED),
    "Role_CableSteel": ("galvanised_steel", "paint_white", "paint_grey", "paint_dark", "paint_orange"),
    "Role_RailSteel": ("rail_steel",),
    "Role_SleeperTimber": ("timber", "tarred_timber", "smooth_concrete"),
    "Role_Ballast": _BALLAST,
    "Role_Masonry": _STONE,
}

_AGES = {CLEAN: 0.2, "": 0.5, AGED: 0.3}  # share of the roles of a random bridge


@dataclass(frozen=True)
class Look:
    """Contents of a named look.

    Attributes:
        suffix: Age of its surfaces; None draws surface and age of each role.
        years: Weathering of the whole bridge: 0 for new, 1 for decades, more for many [1].
    """

    suffix: str | None
    years: float


LOOKS: dict[str, Look] = {
    "weathered": Look("", 1.0),
    "clean": Look(CLEAN, 0.15),
    "aged": Look(AGED, 1.6),
    RANDOM: Look(None, 1.0),
}


def fill_roles(name: str, rng: np.random.Generator) -> tuple[dict[str, str], float]:
    """Choose the surface of every role.

    Args:
        name: A row of `LOOKS`.
        rng: Random stream of the look; only `random` draws from it.

    Returns:
        Surface of each role, in the order of `usd_schemas.tokens.ROLES`, and the look's years of weather [1].
    """
    look = LOOKS[name]
    if look.suffix is not None:
        return {role: _aged(_USUAL[role], look.suffix) for role in ROLES}, look.years
    ages = rng.choice(list(_AGES), len(ROLES), p=list(_AGES.values()))
    drawn = {
        role: _aged(SUITS[role][int(rng.integers(len(SUITS[role])))], str(age))
        for role, age in zip(ROLES, ages, strict=True)
    }
    return drawn, round(float(rng.uniform(0.3, 1.7)), 3)


def _aged(surface: str, suffix: str) -> str:
    return surface if surface in _BALLAST else f"{surface}{suffix}"


def sheet_numbers(pieces: tuple[Component | Scatter, ...]) -> dict[int, int]:
    """Choose the sheet of every component: by its id, so that neighbors differ.

    Args:
        pieces: Components of a bridge.

    Returns:
        Number of the sheet by instance id; the first component of each role uses sheet 0.
    """
    first: dict[str, int] = {}
    numbers: dict[int, int] = {}
    for piece in pieces:
        if isinstance(piece, Component):
            start = first.setdefault(piece.role, piece.instance_id)
            numbers[piece.instance_id] = int(SHEETS * (abs(piece.instance_id - start) * _GOLDEN % 1.0))
    return numbers


def sheet_material(role: str, number: int) -> str:
    """Name the material of one sheet of a role; it is the role's own material with other texture files.

    Args:
        role: Material role.
        number: Number of the sheet.
    """
    return f"{role}_Sheet{number + 1}" if number else role


def sheet_role(material: str) -> str:
    """Find the role that a material is a sheet of; for the first sheet, the material itself.

    Args:
        material: Name of a material of a look.
    """
    role, mark, number = material.rpartition("_Sheet")
    return role if mark and number.isdecimal() else material
