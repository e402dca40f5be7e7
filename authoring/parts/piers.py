"""Piers at the inner supports, from the settings to cap, shafts and footing."""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from authoring.axis.alignment import Alignment
from authoring.parts.bearings import Bearings
from authoring.parts.drawing import Draws, chosen, chosen_by, draw, draw_option, drawn
from authoring.parts.footings import Ground as Ground
from authoring.parts.footings import footing_heights, footing_surface
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.pier_caps import CapShape, cap_surface
from authoring.parts.pier_choice import (
    BESIDE_UPSTAND,
    CAPS,
    END_SHARE,
    KINDS,
    LEAST_DIAMETER,
    PAPER_KINDS,
    USES,
    CapKind,
    PierKind,
    check_columns,
    choose_kind,
    column_count,
)
from authoring.parts.shafts import EMBEDDED, Shafts, limit_slenderness, shaft_base, shaft_surfaces
from authoring.parts.spans import Levels, Spans, level_at
from authoring.shapes.component import F64
from groundwork.settings import Settings

_LEG_SHARE = 0.29  # of a pi-frame's beam, from the axis to a leg
_ARM_SHARE = 0.33  # of the cap's length, from the axis to the head of a Y's arm
_FLUSH = 0.015  # [m] distance of a frame's legs behind its beam's faces
_LEAST_ASKEW = 0.10  # [m] least width of an inverted T's stem on a skewed bridge


class PierSettings(Settings):
    """Caps, columns and footings; omitted values are drawn at random."""

    uses: ClassVar = USES
    kind: PierKind | None = chosen_by(KINDS, "Kind of pier")
    cap: CapKind | None = chosen_by(
        CAPS, "Kind of cap; no inverted_t where two rows of bearings leave no room for its stem"
    )
    columns: int | None = Field(
        default=None,
        ge=1,
        le=5,
        description="Number of columns of a pier [1]; drawn from a range that depends on the deck's width",
    )
    column_shape: Literal["round", "octagonal", "rectangular"] | None = chosen(
        {"round": 0.50, "octagonal": 0.15, "rectangular": 0.35},
        "Cross section of columns; shape of the ends of wall piers and hammerhead stems",
        paper={"round": 0.5, "rectangular": 0.5},
    )
    diameter: float | None = drawn(
        0.9, 1.3, "Diameter of a column, where a pier has several [m]", ge=LEAST_DIAMETER, le=2.4, paper=(1.5, 1.5)
    )
    hammerhead_diameter: float | None = drawn(
        1.3,
        1.8,
        "Diameter of a single column; thickness of Y, V and hammerhead piers [m]",
        ge=0.9,
        le=4.0,
        paper=(1.5, 4.0),
    )
    cap_margin: float | None = drawn(0.15, 0.35, "Length of the cap beyond the outer plinth [m]", ge=0.05, le=1.0)
    cap_depth: float | None = drawn(0.9, 1.3, "Depth of the cap over the columns [m]", ge=0.6, le=2.5, paper=(1.0, 1.0))
    taper: float | None = drawn(
        0.30, 0.50, "Decrease of a cap's depth towards its ends, as a share of the depth [1]", ge=0.0, le=0.6
    )
    chamfer: float | None = drawn(0.020, 0.030, "Leg length of the chamfers [m]", ge=0.0, le=0.05, paper=(0.0, 0.0))
    footing_margin: float | None = drawn(0.5, 0.9, "Length of the footing beyond the columns [m]", ge=0.2, le=2.0)
    footing_top: float | None = drawn(
        -0.60,
        -0.30,
        "Height of the footing's top: above 0, over the highest ground beside it; below 0, under the lowest [m]",
        ge=-2.0,
        le=1.0,
        paper=(0.15, 0.45),
    )
    footing_depth: float | None = drawn(
        0.5,
        1.0,
        "Depth of the footing's base below the lowest ground beside it and below its own top, at least [m]",
        ge=0.3,
        le=3.0,
    )
    wall_thickness: float | None = drawn(0.8, 1.2, "Thickness of a wall pier, along the bridge [m]", ge=0.6, le=2.5)
    wall_share: float | None = drawn(0.70, 0.96, "Width of a wall pier over the cap's length [1]", ge=0.5, le=0.97)
    battered: bool | None = chosen(
        {True: 0.35, False: 0.65}, "Battered shafts, wider towards the base", paper={False: 1}
    )
    batter: float | None = drawn(
        0.010, 0.030, "Batter of each side of a battered shaft, horizontal over vertical [1]", ge=0.0, le=0.08
    )
    slenderness: float | None = drawn(
        10.0,
        14.0,
        "Largest slenderness of a shaft, height over smallest side; higher shafts get larger sections [1]",
        ge=6.0,
        le=30.0,
    )


BETWEEN_TOWERS = tuple(f"pier.{key}" for key in PierSettings.model_fields if key != "footing_top")  # towers have this


@dataclass(frozen=True)
class Piers:
    """All piers of a bridge are of one kind.

    Attributes:
        kind: `wall`, `single`, `multi`, `hammerhead`, `pi_frame`, `y` or `v`.
        cap: `drop`, `tapered`, `inverted_t`, `cantilevered` or `integral`.
        columns: Shafts of a pier.
        column_shape: `round`, `octagonal` or `rectangular`.
        column_width: Diameter, or side across the bridge, at the top [m].
        column_length: Diameter, or side along the bridge, at the top [m].
        cap_length: Across the bridge [m].
        cap_width: Along the bridge [m].
        cap_depth: Over the columns [m].
        cap_end_depth: At both ends [m].
        upstand: Width of an inverted T's stem between the rows of plinths [m]; 0 for none.
        column_lines: Distance of every column to the left of the axis [m].
        chamfer: Leg of chamfers [m].
        footing_margin: Footing beyond the columns [m].
        footing_top: Above the highest ground at it; below zero under the lowest [m].
        footing_depth: Below the lowest ground at it, and below its own top [m].
        batter: Growth of each side of a shaft towards its base [1].
        slenderness: Largest height of a shaft over its least side [1].
    """

    kind: str
    cap: str
    columns: int
    column_shape: str
    column_width: float
    column_length: float
    cap_length: float
    cap_width: float
    cap_depth: float
    cap_end_depth: float
    upstand: float
    column_lines: tuple[float, ...]
    chamfer: float
    footing_margin: float
    footing_top: float
    footing_depth: float
    batter: float
    slenderness: float

    @property
    def shafts(self) -> Shafts:
        """The shafts under the cap."""
        arm = _ARM_SHARE * self.cap_length if self.kind in ("y", "v") else 0.0
        size = self.column_width, self.column_length
        return Shafts(self.kind, self.column_shape, *size, self.column_lines, self.batter, arm, self.chamfer)

    @property
    def cap_shape(self) -> CapShape:
        """The dimensions of the cap."""
        flat = max(self.column_lines) + 0.5 * self.column_width + 0.10
        face = max(self.column_lines) - 0.5 * self.column_width if self.kind == "pi_frame" else 0.0
        size = self.cap_length, self.cap_width, self.cap_depth, self.cap_end_depth
        return CapShape(self.cap, *size, flat, face, self.upstand, self.chamfer)


@dataclass(frozen=True)
class PierNeeds:
    """Requirements of a bridge for its piers.

    Attributes:
        width: Deck width [m].
        outer_line: From the axis to the outermost line of bearings [m].
        bearings: Bearings on the caps.
        spans: Stations of the bearings' rows.
    """

    width: float
    outer_line: float
    bearings: Bearings
    spans: Spans


def draw_piers(
    settings: PierSettings, needs: PierNeeds, draws: Draws, *, paper_kinds: tuple[PierKind, ...] = PAPER_KINDS
) -> Piers:
    """Draw the piers under a deck.

    Args:
        settings: Values set by the user.
        needs: Requirements of the bridge.
        draws: Random stream and profile of the bridge.
        paper_kinds: Kinds of profile `paper` for this family, equally likely.
    """
    bearings, spans = needs.bearings, needs.spans
    paper = draws.profile == "paper"
    share, shape = draws.random(), draw_option(settings, "column_shape", draws)
    single, several = draw(settings, "hammerhead_diameter", draws), draw(settings, "diameter", draws)
    depth, taper = draw(settings, "cap_depth", draws), draw(settings, "taper", draws)
    cap_length = round(2.0 * (needs.outer_line + 0.5 * bearings.plinth_width + draw(settings, "cap_margin", draws)), 3)
    chamfer, margin = draw(settings, "chamfer", draws), draw(settings, "footing_margin", draws)
    footing_top, footing_depth = draw(settings, "footing_top", draws), draw(settings, "footing_depth", draws)
    thickness, wall_share = draw(settings, "wall_thickness", draws), draw(settings, "wall_share", draws)
    battered, batter = draw_option(settings, "battered", draws), draw(settings, "batter", draws)
    rows = spans.pier_setback - 0.5 * bearings.plinth_length  # half the room between the rows of plinths
    upstand = round(max(2.0 * rows - BESIDE_UPSTAND, 0.0), 3)
    kind, cap = choose_kind(
        (settings.kind, settings.cap, settings.columns), cap_length, upstand, draws, paper_kinds if paper else ()
    )
    number = settings.columns or column_count(kind, needs.width, cap_length, several, share)
    piers = Piers(
        kind,
        cap,
        number,
        shape,
        several,
        several,
        cap_length,
        cap_width=round(2.0 * (spans.pier_setback + 0.5 * bearings.plinth_length + 0.10), 3),
        cap_depth=depth,
        cap_end_depth=depth,
        upstand=upstand if cap == "inverted_t" else 0.0,
        column_lines=(0.0,),
        chamfer=chamfer,
        footing_margin=margin,
        footing_top=footing_top,
        footing_depth=footing_depth,
        batter=batter if battered else 0.0,
        slenderness=draw(settings, "slenderness", draws),
    )
    piers = _with_shafts(piers, single, several, thickness, wall_share, paper)
    if kind == "multi":
        pitch = piers.column_lines[1] - piers.column_lines[0]
        check_columns(settings.columns, settings.diameter, pitch, piers.column_width / several)
    return _with_cap(piers, taper)


def _with_shafts(
    piers: Piers, single: float, several: float, thickness: float, wall_share: float, paper: bool
) -> Piers:
    """Choose the size of the shafts by their kind, and place them under the cap."""
    flat, length = piers.column_shape == "rectangular", piers.cap_length
    pitch = length / (piers.columns - END_SHARE)
    if paper and piers.kind == "multi" and piers.columns == 2:
        pitch = min(5.0, pitch)
    lines = tuple(round(pitch * (k - 0.5 * (piers.columns - 1)), 3) for k in range(piers.columns))
    match piers.kind:
        case "wall":
            size = wall_share * length, thickness
        case "hammerhead":
            size = max(0.28 * length, 1.3 * single), single
        case "single":
            size = (1.6 * single, 0.8 * single) if flat else (single, single)
        case "y":
            size = 1.15 * single, 0.8 * single
        case "v":
            size = 0.9 * single, 0.8 * single
        case "pi_frame":
            size = several, max(piers.cap_width, 0.8 * several) - 2.0 * _FLUSH
            lines = (-round(_LEG_SHARE * length, 3), round(_LEG_SHARE * length, 3))
        case _:
            size = (1.1 * several, 0.8 * several) if flat else (several, several)
    width, along = (round(value, 3) for value in size)
    return replace(piers, column_width=width, column_length=along, column_lines=lines)


def _with_cap(piers: Piers, taper: float) -> Piers:
    """Choose the size of the cap by its kind and its span."""
    depth, arm = piers.cap_depth, 0.5 * (piers.cap_length - piers.column_width)
    if piers.kind == "wall":
        depth = max(0.55 * depth, 0.5)
    elif piers.kind in ("single", "hammerhead"):  # cantilevers need depth
        depth = max(depth, 0.28 * arm)
    elif piers.kind in ("y", "v"):
        depth = max(0.75 * depth, 0.6)
    loss = {"tapered": taper, "cantilevered": max(taper + 0.10, 0.35)}.get(piers.cap, 0.0)
    width = max(piers.cap_width, piers.column_length + (2.0 * _FLUSH if piers.kind == "pi_frame" else 0.12))
    depth = round(depth, 3)
    return replace(piers, cap_depth=depth, cap_end_depth=round(depth * (1.0 - loss), 3), cap_width=round(width, 3))


def pier_parts(
    piers: Piers, spans: Spans, levels: Levels, place: Alignment, ground: Ground, besides: tuple[float, ...] = ()
) -> list[Part]:
    """Build cap, shafts and footing at every inner support.

    Args:
        piers: Their dimensions.
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
        besides: Stations of inner supports with another member, such as a pylon [m].
    """
    inner = [support for support in range(1, spans.count) if spans.supports[support] not in besides]
    if not inner:
        return []
    stations = np.array([spans.supports[support] for support in inner])
    piers = _askew(_as_stout_as_tall(piers, stations, levels, place, ground), spans, place.skew)
    parts = []
    for support in inner:
        station = spans.supports[support]
        cap_bottom = levels.seat - piers.cap_depth
        fall = float(np.abs(place.crossfall(np.array([station]))[0]))
        low, high = footing_heights(
            _footing_half(piers, 0.0, place.skew),
            station,
            cap_bottom - 0.5 * fall * piers.cap_length,
            place.frame_at(station, turn=-place.skew),
            ground,
            (piers.footing_top, piers.footing_depth),
        )
        half = _footing_half(piers, cap_bottom - high, place.skew)
        parts += [
            _cap_part(piers, support, station, levels, level_at(place, station)),
            *_shaft_parts(piers, support, station, high - EMBEDDED, cap_bottom + EMBEDDED, place),
            _footing_part(piers, support, station, (low, high), half, place),
        ]
    return parts


def _as_stout_as_tall(piers: Piers, inner: F64, levels: Levels, place: Alignment, ground: Ground) -> Piers:
    """Widen the shafts of the piers at some stations until the tallest meets the slenderness limit."""
    axis = place.point(inner, np.zeros(len(inner)), np.full(len(inner), levels.seat - piers.cap_depth))
    tallest = float(np.max(axis[:, 2] - ground(axis[:, :2])))
    shafts = limit_slenderness(piers.shafts, tallest, piers.slenderness)
    along = max(piers.cap_width, round(shafts.length + (2.0 * _FLUSH if piers.kind == "pi_frame" else 0.12), 3))
    return replace(piers, column_width=shafts.width, column_length=shafts.length, cap_width=along)


def _askew(piers: Piers, spans: Spans, skew: float) -> Piers:
    """Measure the cap's width perpendicular to a skewed support line, where the rows of plinths are closer."""
    if skew == 0.0:
        return piers
    cosine = float(np.cos(skew))
    room = piers.upstand - 2.0 * spans.pier_setback * (1.0 - cosine)
    upstand = room / cosine if piers.upstand and room >= _LEAST_ASKEW else 0.0
    return replace(
        piers,
        cap_width=piers.cap_width / cosine,
        upstand=upstand,
        cap="drop" if piers.upstand and not upstand else piers.cap,
    )


def _cap_part(piers: Piers, support: int, station: float, levels: Levels, level: Alignment) -> Part:
    # An upstand ends below the girders above it.
    rise = 0.6 * (levels.girder_soffit - levels.seat)
    surface = cap_surface(piers.cap_shape, station, levels.seat, rise, level)
    size: dict[str, object] = {
        "shape": piers.cap,
        "length": piers.cap_length,
        "width": piers.cap_width,
        "depth": piers.cap_depth,
        "end_depth": piers.cap_end_depth,
        "support": support,
    }
    return Part(f"Pier_{support:03d}_Cap", "pier_cap", "Role_CapConcrete", SUBSTRUCTURE, surface, size)


def _shaft_parts(piers: Piers, support: int, station: float, low: float, high: float, place: Alignment) -> list[Part]:
    kind = "wall_pier" if piers.kind == "wall" else "column"
    word = "Wall" if piers.kind == "wall" else "Column"
    heading = float(place.heading_at(np.array([station]))[0]) - place.skew
    across, parts = np.array([-np.sin(heading), np.cos(heading)]), []
    for number, surface in enumerate(shaft_surfaces(piers.shafts, station, low, high, place)):
        size: dict[str, object] = {
            "pier": piers.kind,
            "shape": piers.column_shape,
            "width": piers.column_width,
            "length": piers.column_length,
            "batter": piers.batter,
            "height": float(np.ptp(surface.points[:, 2])) - 2.0 * EMBEDDED,
            "support": support,
        }
        if piers.kind in ("y", "v"):
            size["arms"] = float(np.ptp(surface.points[:, :2] @ across))
        name = f"Pier_{support:03d}_{word}_{number:02d}"
        parts.append(Part(name, kind, "Role_PierConcrete", SUBSTRUCTURE, surface, size))
    return parts


def _footing_half(piers: Piers, height: float, skew: float) -> F64:
    return shaft_base(piers.shafts, height, skew) + piers.footing_margin


def _footing_part(
    piers: Piers, support: int, station: float, heights: tuple[float, float], half: F64, place: Alignment
) -> Part:
    low, high = heights
    surface = footing_surface(half, station, low, high, place.frame_at(station, turn=-place.skew), piers.chamfer)
    length, width = 2.0 * half[1], 2.0 * half[0]
    size: dict[str, object] = {"length": length, "width": width, "height": high - low, "support": support}
    return Part(f"Pier_{support:03d}_Footing", "pier_footing", "Role_PierConcrete", SUBSTRUCTURE, surface, size)
