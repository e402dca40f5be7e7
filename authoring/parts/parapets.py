"""Parapets at a deck's edges: concrete parapets, New Jersey barriers, steel railings, low walls with a rail on top."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.drawing import Draws, chosen_by, draw, draw_option, drawn
from authoring.parts.idle_settings import POSITIVE, Use
from authoring.parts.part import FURNITURE, Part
from authoring.parts.railings import RailingRun, Railings, RailingSettings, draw_railings, railing_parts
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, rectangle
from authoring.solids.extrusion import Prism
from groundwork.errors import InputError

LEDGE = 0.03  # [m] width of slab outside a parapet
EMBEDDED = 0.010  # [m] embedment of the parapet in the slab, and of the coping in the parapet
_ROAD_WEIGHTS = {"wall": 0.40, "barrier": 0.15, "railing": 0.30, "wall_rail": 0.15}
_RAIL_WEIGHTS = {"wall": 0.20, "barrier": 0.0, "railing": 0.65, "wall_rail": 0.15}
_SAFETY_SHAPE = ((0.0, 0.075), (0.178, 0.330), (0.228, 0.810))  # [m] of a New Jersey barrier: behind the toe, above it

Shape = Literal["wall", "barrier", "railing", "wall_rail"]


class ParapetSettings(RailingSettings):
    """Parapets and railings along both edges; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("shape", ("wall",), ("height", "batter", "coping_height", "coping_overhang")),
        Use("shape", ("railing",), ("plinth",)),
        Use("shape", ("wall_rail",), ("low_wall",)),
        Use("shape", ("railing", "wall_rail"), ("railing_height", *RailingSettings.model_fields)),
        Use("coping_height", POSITIVE, ("batter", "coping_overhang")),
        *RailingSettings.uses,
    )
    shape: Shape | None = chosen_by(
        {"on roads": _ROAD_WEIGHTS, "on railways": _RAIL_WEIGHTS},
        "wall: solid wall with a coping; barrier: New Jersey barrier; railing: steel railing on a plinth; wall_rail: "
        "low wall with a rail on top",
        paper={"wall": 1},
    )
    thickness: float | None = drawn(
        0.25, 0.40, "Thickness of a wall at its base [m]", ge=0.20, le=0.60, paper=(0.2, 0.2)
    )
    height: float | None = drawn(
        0.85,
        1.10,
        "Height of a wall with its coping above the adjacent road, footway or walkway [m]",
        ge=0.60,
        le=1.50,
        paper=(1.0, 1.0),
    )
    batter: float | None = drawn(
        0.0, 0.08, "Decrease of a wall's thickness from its base to its coping [m]", ge=0.0, le=0.15, paper=(0.0, 0.0)
    )
    coping_height: float | None = drawn(
        0.10, 0.16, "Height of the coping; 0: none [m]", ge=0.0, le=0.30, paper=(0.0, 0.0)
    )
    coping_overhang: float | None = drawn(
        0.03, 0.06, "Overhang of the coping beyond the wall's faces [m]", ge=0.02, le=0.10
    )
    joint_pitch: float | None = drawn(3.0, 6.0, "Distance between dummy joints [m]", ge=1.0, le=30.0)
    chamfer: float | None = drawn(0.015, 0.030, "Leg length of the chamfers [m]", ge=0.0, le=0.05, paper=(0.0, 0.0))
    railing_height: float | None = drawn(
        1.00, 1.20, "Height of a railing above the adjacent road, footway or walkway [m]", ge=0.80, le=1.60
    )
    plinth: float | None = drawn(
        0.08, 0.20, "Height of a railing's plinth above the adjacent road, footway or walkway [m]", ge=0.03, le=0.40
    )
    low_wall: float | None = drawn(
        0.50,
        0.65,
        "Height of the low wall below a rail above the adjacent road, footway or walkway [m]",
        ge=0.30,
        le=0.80,
    )


@dataclass(frozen=True)
class Parapets:
    """Section of both parapets.

    Attributes:
        shape: `wall`, `barrier`, `railing` or `wall_rail`.
        thickness: At the foot [m].
        height: Top of the whole above the way beside it [m].
        batter: Difference of a wall's thickness between its foot and its coping [m].
        coping_height: Height of the coping [m]; 0 for none.
        coping_overhang: Coping over the parapet's faces [m].
        joint_pitch: Largest distance between dummy joints [m].
        chamfer: Leg of chamfers [m].
        concrete: Top of the concrete above the way beside it [m].
        railings: Railing on the concrete, if `shape` is `railing` or `wall_rail`.
        terminals: Whether they end in blocks on the approaches.
    """

    shape: str
    thickness: float
    height: float
    batter: float
    coping_height: float
    coping_overhang: float
    joint_pitch: float
    chamfer: float
    concrete: float
    railings: Railings
    terminals: bool = False


def draw_parapets(settings: ParapetSettings, service: str, draws: Draws) -> Parapets:
    """Draw the section of the parapets.

    Args:
        settings: Values set by the user.
        service: `road` or `rail`.
        draws: Random stream and profile of the bridge.

    Raises:
        InputError: A plinth or low wall leaves no room for the rail above it.
    """
    shape = draw_option(settings, "shape", draws, _ROAD_WEIGHTS if service == "road" else _RAIL_WEIGHTS)
    own = [key for key in ParapetSettings.model_fields if key not in ("shape", *RailingSettings.model_fields)]
    value = {key: draw(settings, key, draws) for key in own}
    railings = draw_railings(settings, draws)
    height = {"wall": value["height"], "barrier": _SAFETY_SHAPE[-1][1]}.get(shape, value["railing_height"])
    concrete = {"railing": value["plinth"], "wall_rail": value["low_wall"]}.get(shape, height)
    low = {"railing": value["plinth"], "wall_rail": value["low_wall"]}.get(shape)
    if low is not None and value["railing_height"] - low < railings.rail_diameter + 0.10:
        key = "plinth" if shape == "railing" else "low_wall"
        raise InputError(
            "leaves no room for the rail above it",
            field=f"bridge.parapet.{key}",
            value=low,
            allowed=f"at most {value['railing_height'] - railings.rail_diameter - 0.10:.2f} m",
            hint="Choose a lower one, or a larger railing_height",
        )
    foot = value["thickness"]
    if shape == "barrier":
        foot = round(max(foot, _SAFETY_SHAPE[-1][0] + 0.15), 3)
    return Parapets(
        shape=shape,
        thickness=foot,
        height=height,
        batter=value["batter"],
        coping_height=value["coping_height"],
        coping_overhang=value["coping_overhang"],
        joint_pitch=value["joint_pitch"],
        chamfer=value["chamfer"],
        concrete=concrete,
        railings=railings,
        terminals=draws.profile == "default",
    )


@dataclass(frozen=True)
class DeckEdge:
    """The deck under the parapets of both sides.

    Attributes:
        foot: From the axis to the inner foot of the parapet [m].
        slab_top: Height of the slab's top [m].
        way: Height of the road or walkway beside the parapets, from which their heights count [m].
    """

    foot: float
    slab_top: float
    way: float = 0.0


def parapet_parts(
    parapets: Parapets, edge: DeckEdge, name: str, low: float, high: float, place: Alignment
) -> list[Part]:
    """Build the parapets of both sides over one run.

    Args:
        parapets: Section.
        edge: The deck under them.
        name: Ending of the names, e.g. `000`.
        low: Station where they begin [m].
        high: Station where they end [m].
        place: Axis of the bridge.
    """
    p = parapets
    fields = int(np.ceil((high - low) / p.joint_pitch))
    joints = tuple(float(joint) for joint in np.linspace(low, high, fields + 1)[1:-1])
    plain = p.chamfer == 0.0 and p.coping_height == 0.0
    parts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for label, kind, outline in concrete_outlines(p, edge):
            sided = outline if sign > 0.0 else (outline * (-1.0, 1.0))[::-1]
            surface = Prism(sided, low, high, "station", place, p.chamfer, () if plain else joints)
            size: dict[str, object] = {"length": high - low, "height": p.height, "thickness": p.thickness}
            parts.append(Part(f"{label}_{name}_{side}", kind, "Role_ParapetConcrete", FURNITURE, surface, size))
        if p.shape in ("railing", "wall_rail"):
            left = sign * (edge.foot + 0.5 * p.thickness)
            run = RailingRun(left, edge.way + p.concrete, edge.way + p.height, low, high)
            parts += railing_parts(p.railings, run, f"{name}_{side}", place)
    return parts


def concrete_outlines(parapets: Parapets, edge: DeckEdge) -> list[tuple[str, str, F64]]:
    """Draw the concrete of the parapet on the left: wall and coping, barrier, plinth or low wall.

    Args:
        parapets: Section.
        edge: The deck under it.

    Returns:
        Name, component kind and outline (left, above) [m], shape (P, 2), float64, of each.
    """
    p, foot, slab_top, way = parapets, edge.foot, edge.slab_top, edge.way
    bottom, outer = slab_top - EMBEDDED, foot + p.thickness
    if p.shape == "barrier":
        toe = max(p.thickness - _SAFETY_SHAPE[-1][0] - 0.15, 0.0)  # a wider foot widens the top, not the slopes
        face = [(foot + x, way + z) for x, z in _SAFETY_SHAPE[::-1]]
        crown = cut_corners(
            np.array([(foot, bottom), (outer, bottom), (outer - 0.3 * toe, way + p.concrete), *face]),
            np.array([0.0, 0.0, p.chamfer, p.chamfer, 0.0, 0.0]),
        )
        return [("Parapet", "parapet", crown)]
    if p.shape in ("railing", "wall_rail") or p.coping_height == 0.0:
        block = cut_corners(
            rectangle((foot, bottom), (outer, way + p.concrete)), np.array([0.0, 0.0, 1.0, 1.0]) * p.chamfer
        )
        return [("Parapet", "parapet", block)]
    top = way + p.height
    under = top - p.coping_height
    wall = np.array([(foot, bottom), (outer, bottom), (outer, under + EMBEDDED), (foot + p.batter, under + EMBEDDED)])
    inner = foot + p.batter - p.coping_overhang
    crown = np.array(
        [(inner, under), (outer + p.coping_overhang, under), (outer + p.coping_overhang, top - 0.02), (inner, top)]
    )
    return [("Parapet", "parapet", wall), ("Coping", "parapet_coping", cut_corners(crown, p.chamfer))]
