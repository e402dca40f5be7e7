"""Common settings of all families of bridges: the road, its edges and its supports."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.clearance import refuse_hill
from authoring.families.alignments import LEAST_RADIUS, STEEPEST, AlignmentSettings, Carried, draw_alignment
from authoring.parts.abutments import AbutmentSettings
from authoring.parts.bearings import BearingSettings
from authoring.parts.deck_top import DeckTop, DeckTopSettings, SuitedTop, draw_deck_top, road_section
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.idle_settings import Use
from authoring.parts.piers import Ground, PierSettings

_BY_ABUTMENTS = 3.0  # [m] length at the abutments where embankments may be as high as the road


class SharedSettings(DeckTopSettings):
    """Parts of a bridge that do not depend on its family; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("service", ("road",), ("roadway", "fittings", "alignment.superelevation")),
        Use("service", ("rail_single", "rail_double"), ("track", "alignment.cant")),
        Use("service", ("road", "rail_double"), ("track.spacing",)),
    )
    clearance: float | None = drawn(5.0, 7.0, "Lowest height of the deck's soffit above z = 0 [m]", ge=3.0, le=30.0)
    grade: float | None = drawn(
        -0.025,
        0.025,
        "Mean longitudinal slope of the bridge, at most 0.025 for railways [1]",
        ge=-0.05,
        le=0.05,
        paper=(0.0, 0.0),
    )
    heading: float = Field(
        default=0.0,
        ge=-180.0,
        le=180.0,
        description="Direction of the axis, or of its chord, counter-clockwise from +x [deg]",
    )
    alignment: AlignmentSettings = AlignmentSettings()
    bearing: BearingSettings = BearingSettings()
    pier: PierSettings = PierSettings()
    abutment: AbutmentSettings = AbutmentSettings()


@dataclass(frozen=True)
class AxisNeeds:
    """Requirements of a bridge for its axis.

    Attributes:
        supports: Stations of the bearing lines, abutments first and last [m].
        lowest_soffit: Lowest underside of the superstructure above the finished deck surface, negative [m].
        seat: Top of the abutments' seats above the finished deck surface, negative [m].
        walls: Length of the wing walls behind the abutments' back faces [m].
        straight: The family needs a straight axis, square supports and no crest.
        least_clearance: Height over z = 0 of the superstructure in any case [m].
        river_piers: Some of its piers may stand in a river, except in profile `paper`.
    """

    supports: tuple[float, ...]
    lowest_soffit: float
    seat: float
    walls: float
    straight: bool = False
    least_clearance: float = 0.0
    river_piers: bool = False


ON_ROADS = SuitedTop(services=("road",))


def draw_top(shared: SharedSettings, draws: Draws, suited: SuitedTop | None = None) -> DeckTop:
    """Draw the cross-section on a deck; a grade or a radius that no railway has is that of a road.

    Args:
        shared: Values set by the user.
        draws: Random stream and profile of the bridge.
        suited: What suits the values that the user set for the family.
    """
    steep = abs(shared.grade or 0.0) > STEEPEST["rail"]
    tight = (shared.alignment.radius or LEAST_RADIUS["rail"]) < LEAST_RADIUS["rail"]
    return draw_deck_top(shared, draws, suited or (ON_ROADS if steep or tight else SuitedTop()))


def draw_layout_of(shared: SharedSettings, top: DeckTop, needs: AxisNeeds, draws: Draws) -> Layout:
    """Draw the axis of a bridge and collect the data for the site.

    Args:
        shared: Values set by the user.
        top: Surfacing, parapets and fittings of the deck.
        needs: Requirements of the family for the axis.
        draws: Random stream and profile of the bridge.
    """
    supports = needs.supports
    clearance, grade = draw(shared, "clearance", draws), draw(shared, "grade", draws)
    clearance = max(clearance, needs.least_clearance)
    carried = Carried(supports, 0.5 * top.width, top.service, needs.straight)
    axis = draw_alignment(shared.alignment, carried, (grade, shared.grade is None), draws)
    if shared.alignment.skew is None and not top.takes_skew:
        axis = replace(axis, skew=0.0)
    level = round(clearance - needs.lowest_soffit - _lowest(axis, supports, 0.5 * top.width), 3)
    alignment = replace(axis, level=level, heading=float(np.radians(shared.heading)))
    return Layout(
        alignment,
        supports,
        top.width,
        -needs.seat,
        top.service,
        carriageway=top.carriageway,
        edge_line=top.edge_line,
        underlay=top.underlay,
        track=None if top.tracks is None else top.tracks.section,
        road=road_section(top, needs.walls) if draws.profile == "default" else None,
        river_piers=needs.river_piers and draws.profile == "default",
        wings=needs.walls,
        soffit=-float(needs.lowest_soffit),
    )


def check_ground(layout: Layout, ground: Ground) -> None:
    """Refuse ground above the road between the abutments.

    Args:
        layout: Axis and supports.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Raises:
        InputError: The ground reaches the road.
    """
    first, last = layout.supports[0], layout.supports[-1]
    margin = min(_BY_ABUTMENTS, 0.25 * (last - first))
    stations = np.linspace(first + margin, last - margin, 101)
    road = layout.alignment.point(stations, np.zeros(101), np.zeros(101))
    refuse_hill(layout, stations, np.zeros(1), ground(road[:, :2])[:, None])


def _lowest(axis: Alignment, supports: tuple[float, ...], half_width: float) -> float:
    """Find the lowest point of the road's surface over the bridge [m]."""
    stations = np.array(supports)
    if axis.crest is not None or axis.falls:
        stations = np.unique([*supports, *np.linspace(supports[0], supports[-1], 201)])
    return float(np.min(axis.height(stations) - half_width * np.abs(axis.crossfall(stations))))
