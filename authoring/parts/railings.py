"""Steel railings: posts on base plates, a top rail, and rails or upright bars below it."""

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.drawing import Draws, chosen, draw, draw_option, draw_whole, drawn
from authoring.parts.idle_settings import Use
from authoring.parts.part import FURNITURE, Part
from authoring.shapes.component import F64
from authoring.shapes.sections import circle, rectangle
from authoring.solids.copies import LOCAL, copied_together, frames_along
from authoring.solids.extrusion import Prism, extruded
from authoring.solids.sweep import Surface, joined
from groundwork.settings import Settings

_PLATE = (0.16, 0.18, 0.015)  # [m] base plate along, across, up
_POST = 0.060  # [m] post along
_POST_WIDER = 0.026  # [m] post wider than its top rail, which on a curve deviates by a chord's sag
_HELD = 0.003  # [m] embedment of the plate in concrete, and of the post in plate and top rail
_INTO_POST = 0.010  # [m] embedment of rails in posts: more than a chord's sag
_END = 0.25  # [m] first and last post from the ends of a run
_BAR, _BAR_PITCH = 0.020, 0.12  # [m] bars and the distance between them: too narrow for a child's head


class RailingSettings(Settings):
    """Steel railings; omitted values are drawn at random."""

    uses: ClassVar[tuple[Use, ...]] = (Use("infill", ("rails",), ("rails",)),)
    infill: Literal["rails", "bars"] | None = chosen(
        {"rails": 50, "bars": 50}, "Infill below the top rail: horizontal rails, or vertical bars every 0.12 m"
    )
    rails: int | None = drawn(1, 3, "Number of rails below the top rail [1]", le=5)
    post_pitch: float | None = drawn(1.5, 2.5, "Largest distance between posts [m]", ge=1.0, le=4.0)
    rail_diameter: float | None = drawn(0.06, 0.10, "Height and width of the top rail [m]", ge=0.04, le=0.15)
    round_rails: bool | None = chosen({True: 50, False: 50}, "Round tubes; otherwise rectangular hollow sections")


@dataclass(frozen=True)
class Railings:
    """One kind of railing for the whole bridge.

    Attributes:
        infill: `rails` or `bars`.
        rails: Rails below the top rail.
        post_pitch: Largest distance between posts [m].
        rail_diameter: Height and width of the top rail [m].
        round_rails: Tubes rather than square hollow sections.
    """

    infill: str
    rails: int
    post_pitch: float
    rail_diameter: float
    round_rails: bool


def draw_railings(settings: RailingSettings, draws: Draws) -> Railings:
    """Draw the railings.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
    """
    infill, tubes = draw_option(settings, "infill", draws), draw_option(settings, "round_rails", draws)
    return Railings(
        infill=infill,
        rails=draw_whole(settings, "rails", draws),
        post_pitch=draw(settings, "post_pitch", draws),
        rail_diameter=draw(settings, "rail_diameter", draws),
        round_rails=tubes,
    )


def post_stations(railings: Railings, low: float, high: float) -> F64:
    """Distribute the posts of one run evenly.

    Args:
        railings: Dimensions.
        low: Station where the run begins [m].
        high: Station where it ends [m].

    Returns:
        Stations of the posts [m], shape (N,), float64.
    """
    fields = max(int(np.ceil((high - low - 2.0 * _END) / railings.post_pitch)), 1)
    return np.linspace(low + _END, high - _END, fields + 1)


@dataclass(frozen=True)
class RailingRun:
    """Position of one railing.

    Attributes:
        left: Center of the posts [m]; the rails below the top are fixed on the side towards the axis.
        bottom: Top of the concrete under them [m].
        top: Top of the top rail [m].
        low: Station where it begins [m].
        high: Station where it ends [m].
    """

    left: float
    bottom: float
    top: float
    low: float
    high: float


def railing_parts(railings: Railings, run: RailingRun, name: str, place: Alignment) -> list[Part]:
    """Build the railing of one side over one run: its posts are one component, its rails and bars another.

    In labeled scans, a stretch of railing is one object, not a single bar.

    Args:
        railings: Dimensions.
        run: Its position.
        name: Ending of the names, e.g. `000_L`.
        place: Axis of the bridge.
    """
    left, bottom, top, low, high = run.left, run.bottom, run.top, run.low, run.high
    stations, rail = post_stations(railings, low, high), railings.rail_diameter
    height = top - rail + _HELD - bottom
    frames = frames_along(place, stations, left, bottom, upright=True)
    size: dict[str, object] = {"height": top - bottom, "length": high - low}
    posts = copied_together(_post_solid(rail + _POST_WIDER, height), frames)
    facts: dict[str, object] = {"height": top - bottom, "posts": len(stations)}
    return [
        Part(f"Post_{name}", "railing_post", "Role_RailingSteel", FURNITURE, posts, facts),
        Part(
            f"Railing_{name}",
            "railing",
            "Role_RailingSteel",
            FURNITURE,
            joined(_rail_solids(railings, run, place)),
            {**size, "infill": railings.infill},
        ),
    ]


@lru_cache(maxsize=64)
def _post_solid(across: float, height: float) -> Surface:
    half, up = 0.5 * np.array(_PLATE[:2]), _PLATE[2]
    plate = Prism(rectangle((-half[0], -half[1]), (half[0], half[1])), -_HELD, up, "above", LOCAL)
    outline = rectangle((-0.5 * _POST, -0.5 * across), (0.5 * _POST, 0.5 * across))
    return joined(extruded([plate, Prism(outline, up - _HELD, height, "above", LOCAL)]))


@lru_cache(maxsize=64)
def _bar_solid(height: float) -> Surface:
    outline = rectangle((-0.5 * _BAR, -0.4 * _BAR), (0.5 * _BAR, 0.4 * _BAR))
    return Prism(outline, 0.04 - _HELD, height, "above", LOCAL).surface


def _rail_solids(railings: Railings, run: RailingRun, place: Alignment) -> list[Surface]:
    """Build the rails, and the infill between them, on the side of the posts towards the axis."""
    left, bottom, top, low, high = run.left, run.bottom, run.top, run.low, run.high
    rail = railings.rail_diameter
    section = circle(rail / np.cos(np.pi / 12), 12) if railings.round_rails else _square(rail)
    rails = [Prism(np.add(section, (left, top - 0.5 * rail)), low, high, "station", place)]
    inward = -float(np.sign(left))
    face = left + inward * (0.5 * (rail + _POST_WIDER) - _INTO_POST)  # of the rails on the posts
    if railings.infill != "bars":
        size = 0.6 * rail
        for number in range(railings.rails):
            level = bottom + (top - rail - bottom) * (number + 1.0) / (railings.rails + 1.0)
            rails.append(Prism(np.add(_square(size), (face + inward * 0.5 * size, level)), low, high, "station", place))
        return extruded(rails)
    middle, sill, head = face + inward * 0.5 * _BAR, bottom + 0.10, top - 0.6 * rail
    for level in (sill, head - 0.04):
        outline = rectangle((middle - 0.5 * _BAR, level), (middle + 0.5 * _BAR, level + 0.04))
        rails.append(Prism(outline, low, high, "station", place))
    stations = np.arange(low + 0.04, high - 0.03, _BAR_PITCH)
    lean = np.tan(place.skew) * (middle - left)  # offset along the road between skewed stations and the posts
    apart = np.abs(stations[:, None] + lean - post_stations(railings, low, high)).min(axis=1)
    stations = stations[apart > 0.5 * _POST + _BAR]  # none in front of a post
    bars = frames_along(place, stations, middle, sill, upright=True)
    return [*extruded(rails), copied_together(_bar_solid(head - 0.04 + _HELD - sill), bars)]


def _square(side: float) -> F64:
    return rectangle((-0.5 * side, -0.5 * side), (0.5 * side, 0.5 * side))
