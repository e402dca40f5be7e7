"""The choice of a steel superstructure: arrangement, sections and lines of its girders, and their settings."""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from authoring.parts.drawing import Draws, UnsuitedDeck, chosen, draw, draw_option, drawn
from authoring.parts.idle_settings import LEFT_OUT, Use
from authoring.parts.plate_girders import PlateGirders
from authoring.parts.spans import Spans
from groundwork.errors import InputError
from groundwork.settings import Settings

LEAST_SPACING, MOST_SPACING = 2.2, 3.6  # [m] of the lines of a multi-girder deck
_ARRANGEMENTS = {"multi": 60.0, "ladder": 22.0, "box": 18.0}
_WIDTHS = {"multi": (0.0, 40.0), "ladder": (7.0, 18.0), "box": (6.5, 27.0)}  # [m] of deck
_BOX_SPAN = 30.0  # [m] shortest span for which boxes are economical (Khan, table 1.2)
_ONE_BOX = 13.5  # [m] widest deck on a single box
_HAUNCHED_SLIMMER = 1.25  # [1] factor by which a haunched girder is more slender at mid-span
_LEAST_DEPTH = 0.70  # [m]


class PlateGirderSettings(Settings):
    """Steel girders; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("arrangement", ("multi",), ("count", "spacing")),
        Use("arrangement", ("multi", "ladder"), ("top_share", "web")),
        Use("count", LEFT_OUT, ("spacing",)),
        Use("haunch", ("parabolic", "straight"), ("haunch_ratio", "haunch_reach")),
        Use("splices", (True,), ("splice_share",)),
    )
    arrangement: Literal["multi", "ladder", "box"] | None = chosen(
        _ARRANGEMENTS,
        "multi: several plate girders; ladder: two plate girders with floor beams between them; box: one or two boxes",
        among=" of the arrangements that suit the bridge: ladder for decks 7 to 18 m wide, box 6.5 to 27 m and spans "
        "of 30 m or more",
        paper={"multi": 1},
    )
    slenderness: float | None = drawn(
        20.0,
        28.0,
        "Longest span over the depth of the steel; for a haunched girder 1.25 times this at midspan [1]",
        ge=8.0,
        le=40.0,
        paper=(8.333, 8.333),
    )
    count: int | None = Field(
        default=None,
        ge=2,
        le=12,
        description="Number of girder lines of a multi-girder deck [1]; drawn so that they lie 2.2 to 3.6 m apart; in "
        "profile paper 4",
    )
    spacing: float | None = drawn(2.4, 3.4, "Target distance between girder lines [m]", ge=2.2, le=3.6)
    flange_share: float | None = drawn(
        0.22, 0.33, "Width of the bottom flange over the girder depth [1]", ge=0.15, le=0.9, paper=(0.833, 0.833)
    )
    top_share: float | None = drawn(
        0.70, 0.90, "Width of the top flange over width of the bottom flange [1]", ge=0.5, le=1.0, paper=(1.0, 1.0)
    )
    flange: float | None = drawn(0.025, 0.060, "Thickness of the flanges [m]", ge=0.012, le=0.12, paper=(0.1, 0.1))
    web: float | None = drawn(0.012, 0.020, "Thickness of the webs [m]", ge=0.008, le=0.12, paper=(0.1, 0.1))
    haunch: Literal["none", "parabolic", "straight"] | None = chosen(
        {"none": 55.0, "parabolic": 28.0, "straight": 17.0},
        "Haunches: how the girder depth grows towards the piers",
        among=" where they are continuous over piers, else none",
        paper={"none": 1},
    )
    haunch_ratio: float | None = drawn(1.5, 2.0, "Girder depth at a pier over depth at midspan [1]", ge=1.05, le=2.5)
    haunch_reach: float | None = drawn(
        0.22, 0.38, "Length of the haunch on each side of a pier, over the span [1]", ge=0.1, le=0.5
    )
    fillet: float | None = drawn(
        0.040, 0.090, "Depth of the concrete haunch between top flange and slab [m]", ge=0.0, le=0.20, paper=(0.0, 0.0)
    )
    splices: bool | None = chosen({True: 1}, "Bolted field splices in continuous girders", paper={False: 1})
    splice_share: float | None = drawn(
        0.20, 0.25, "Distance from a pier to a field splice, over the span [1]", ge=0.1, le=0.4
    )


def draw_plate_girders(settings: PlateGirderSettings, width: float, spans: Spans, draws: Draws) -> PlateGirders:
    """Draw the girders for a deck.

    Args:
        settings: Values set by the user.
        width: Deck width [m].
        spans: Stations.
        draws: Random stream and profile of the bridge.

    Raises:
        InputError: The given values do not fit this deck.
    """
    paper = draws.profile == "paper"
    longest = float(np.max(np.diff(spans.supports)))
    arrangement = _arrangement(settings, width, longest, draws)
    haunch = _haunch(settings, spans, draws)
    slenderness = draw(settings, "slenderness", draws) * (1.0 if haunch == "none" else _HAUNCHED_SLIMMER)
    ratio, reach = draw(settings, "haunch_ratio", draws), draw(settings, "haunch_reach", draws)
    depth = max(round(longest / slenderness, 2), _LEAST_DEPTH)
    pier_depth = depth if haunch == "none" else round(ratio * depth, 2)
    lines = _lines(settings, arrangement, width, paper, draws)
    bottom = round(max(draw(settings, "flange_share", draws) * depth, 0.22), 3)
    top = round(max(draw(settings, "top_share", draws) * bottom, 0.18), 3)
    if arrangement == "box":
        top = round(_box_width(width, len(lines), pier_depth), 3)
    return PlateGirders(
        arrangement=arrangement,
        lines=lines,
        depth=depth,
        pier_depth=pier_depth,
        haunch=haunch,
        haunch_reach=reach,
        top_width=top,
        bottom_width=bottom,
        flange=draw(settings, "flange", draws),
        web=draw(settings, "web", draws),
        fillet=draw(settings, "fillet", draws),
        splice_share=draw(settings, "splice_share", draws),
        spliced=not paper if settings.splices is None else settings.splices,
    )


def _arrangement(settings: PlateGirderSettings, width: float, longest: float, draws: Draws) -> str:
    suited = {name: weight for name, weight in _ARRANGEMENTS.items() if _WIDTHS[name][0] <= width <= _WIDTHS[name][1]}
    suited = {name: weight for name, weight in suited.items() if name != "box" or longest >= _BOX_SPAN}
    choice = draw_option(settings, "arrangement", draws, suited)
    low, high = _WIDTHS[choice]
    if not low <= width <= high:
        nearest = low if width < low else high
        raise UnsuitedDeck(
            f"this arrangement does not suit a deck {width:.2f} m wide",
            field="bridge.girder.steel.arrangement",
            value=choice,
            allowed=f"decks {low:g} to {high:g} m wide, the nearest {nearest:g} m",
            hint="Choose multi, or change the lanes",
        )
    return choice


def _haunch(settings: PlateGirderSettings, spans: Spans, draws: Draws) -> str:
    haunch = draw_option(settings, "haunch", draws)
    possible = spans.one_row and spans.count > 1
    if settings.haunch not in (None, "none") and not possible:
        raise InputError(
            "a haunch requires a girder that is continuous over a pier",
            field="bridge.girder.steel.haunch",
            value=settings.haunch,
            allowed="none",
            hint="Give the bridge two spans or more and continuous = true, or leave the haunch out",
        )
    return haunch if possible else "none"


def _lines(
    settings: PlateGirderSettings, arrangement: str, width: float, paper: bool, draws: Draws
) -> tuple[float, ...]:
    target, share = draw(settings, "spacing", draws), draws.random()
    if arrangement == "ladder":
        half = round(0.5 * width * (0.54 + 0.08 * share), 3)
        return (-half, half)
    if arrangement == "box":
        return (0.0,) if width <= _ONE_BOX else (round(-0.25 * width, 3), round(0.25 * width, 3))
    if paper and settings.count is None and settings.spacing is None:
        return tuple(round(width * eighths / 8.0, 3) for eighths in (-3, -1, 1, 3))
    count = settings.count or max(2, round((width - 2.0) / target) + 1)
    least, most = max(0.6, 0.5 * (width - MOST_SPACING * (count - 1))), 0.5 * (width - LEAST_SPACING * (count - 1))
    most = min(most, 1.5)
    if least > most + 1e-9:
        if settings.count is None:
            least = most = 0.5 * (width - target * (count - 1))
        else:
            raise UnsuitedDeck(
                f"{count} girder lines cannot carry a deck {width:.2f} m wide",
                field="bridge.girder.steel.count",
                value=count,
                allowed=f"{LEAST_SPACING} to {MOST_SPACING} m apart, overhang 0.6 to 1.5 m; the nearest valid number "
                f"is {max(2, round((width - 2.2) / 2.9) + 1)}",
                hint="Leave it out, or change the lanes",
            )
    cantilever = least + share * (most - least)
    ends = 0.5 * width - cantilever
    return tuple(round(float(line), 3) for line in np.linspace(-ends, ends, count))


def _box_width(width: float, boxes: int, pier_depth: float) -> float:
    """Find the width over a box's top flanges, wide enough for two bearings under it [m]."""
    return max(0.52 * width / boxes, 2.0 * (0.22 * pier_depth + 0.95 + 0.20))
