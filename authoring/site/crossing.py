"""The obstacle that a bridge crosses: a river, a road, a railway, a valley or a harbour, chosen to fit the bridge."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from authoring.axis.alignment import Layout
from authoring.site.river_piers import BANK, widened
from authoring.site.shape import Crossing
from authoring.site.valley import Valley, draw_valley, floor_room
from authoring.streams import weighted_choice
from groundwork.errors import InputError

CrossingKind = Literal["river", "road", "rail", "valley", "harbour"]

MIN_SPAN_SHARE, MAX_SPAN_SHARE = 0.52, 0.66  # of the longest span that water covers [1]
HARBOUR_SHARE = (0.72, 0.86)  # of the longest span that a harbour's water covers [1]
NARROWEST = 3.0  # narrowest crossing [m]
ROOM = 4.0  # between a crossing road and the supports beside it, both together [m]
LANE = 3.25  # width of a lane of the crossing road [m]
RAIL_TOP = 0.95  # rails' top over the land [m]
RAIL_HALF = 4.1  # half the ground that a double track's ballast covers [m]
_BESIDE = 3.0  # [m] least distance between a crossing and the nearest support


@dataclass(frozen=True)
class _Rule:
    """Conditions for a crossing.

    Attributes:
        weight: Weight among the crossings that fit.
        spans: Least and largest longest span [m].
        headroom: Least height of the bearing seats over the land [m].
    """

    weight: float
    spans: tuple[float, float]
    headroom: float


_RULES: dict[CrossingKind, _Rule] = {
    "river": _Rule(35.0, (7.0, 110.0), 2.5),
    "road": _Rule(25.0, (11.0, 60.0), 4.6),
    "rail": _Rule(20.0, (15.0, 60.0), 6.0),
    "valley": _Rule(30.0, (14.0, 400.0), 8.0),
    "harbour": _Rule(40.0, (60.0, 2000.0), 5.0),
}
SPARED: CrossingKind = "river"  # if nothing else fits


def choose_crossing(layout: Layout, rng: np.random.Generator) -> CrossingKind:
    """Draw a crossing among those that fit the bridge's longest span and height.

    Args:
        layout: The bridge.
        rng: Random stream.
    """
    span = _longest(layout)[1]
    room = float(layout.alignment.height(np.array(layout.supports)).min()) - layout.depth
    fits: list[CrossingKind] = [
        kind for kind, rule in _RULES.items() if rule.spans[0] <= span <= rule.spans[1] and room >= rule.headroom
    ]
    fits = fits or [SPARED]
    return weighted_choice({kind: _RULES[kind].weight for kind in fits}, rng.random())


def told_crossings() -> str:
    """State how often each crossing is drawn among those that fit a bridge, and which bridges fit it."""
    return ", ".join(
        f"{kind} {rule.weight:g} (spans of {rule.spans[0]:g} to {rule.spans[1]:g} m, bearing seats at least "
        f"{rule.headroom:g} m above z = 0)"
        for kind, rule in _RULES.items()
    )


def draw_crossing(
    kind: CrossingKind,
    layout: Layout,
    rng: np.random.Generator,
    apart: tuple[np.random.Generator, np.random.Generator],
    river_piers: bool | None = None,
) -> tuple[Crossing, Valley | None]:
    """Place the crossing under the longest span, nearly square to the axis.

    It lies under the middle of the span; that of a high bridge nearer to the middle of the bridge.
    Some rivers are wider and lie around piers: see `widened`.

    Args:
        kind: Kind of the crossing.
        layout: The bridge.
        rng: Random stream.
        apart: Random streams of a valley's sides, and of rivers with piers in them.
        river_piers: Whether piers stand in a river where there is room; None: by chance.

    Returns:
        The crossing, and its valley, None on level land.

    Raises:
        InputError: It does not fit under this bridge.
    """
    station, span = _longest(layout)
    _check(kind, layout)
    swing, wavelength = rng.uniform(24.0, 34.0), rng.uniform(130.0, 170.0)
    phase = rng.uniform(0.3 * np.pi, 0.7 * np.pi) * rng.choice((-1.0, 1.0))
    bottom, width, level, depth = _BOTTOMS[kind](span, rng)
    if bottom == "river":  # the width of the water depends on the valley's sides
        width = min(width, max(2.0 * (floor_room(layout, _inward(layout, station, width)) - BANK), NARROWEST))
        depth = min(depth, width / 6)
    if width < NARROWEST:
        raise InputError(
            "no room for this crossing under the longest span",
            field="site.crossing",
            value=kind,
            allowed=f"a {kind} under spans of at least {NARROWEST + ROOM:g} m",
            hint="Choose a bridge with a longer span",
        )
    station = _inward(layout, station, width)
    crossing = Crossing(
        bottom,
        station,
        float(swing),
        float(wavelength),
        float(phase),
        float(width / 2),
        float(level),
        float(depth),
        layout.alignment,
    )
    if kind == "river":
        crossing = widened(crossing, layout, river_piers, apart[1])
    floor = crossing.half_width + BANK
    return crossing, draw_valley(layout, crossing.station, floor, kind == "valley", apart[0])


def _longest(layout: Layout) -> tuple[float, float]:
    """Find the middle of the longest span, and its length between support lines, perpendicular to both [m]."""
    spans = np.diff(layout.supports)
    longest = int(np.argmax(spans))
    middle = float(np.mean(layout.supports[longest : longest + 2]))
    return middle, float(spans[longest]) * float(np.cos(layout.alignment.skew))


def _inward(layout: Layout, station: float, width: float) -> float:
    """Move a crossing of a high bridge towards the bridge's middle, as far as the supports beside it allow [m].

    Args:
        layout: The bridge.
        station: Middle of its longest span [m].
        width: Of the crossing [m].
    """
    if not np.isfinite(floor_room(layout, station)):
        return station
    supports = np.array(layout.supports)
    before, behind = float(supports[supports < station].max()), float(supports[supports > station].min())
    room = 0.6 * width / float(np.cos(layout.alignment.skew)) + _BESIDE
    middle = 0.5 * (layout.supports[0] + layout.supports[-1])
    return float(np.clip(middle, min(before + room, station), max(behind - room, station)))


def _check(kind: CrossingKind, layout: Layout) -> None:
    rule, lowest = _RULES[kind], float(layout.alignment.height(np.array(layout.supports)).min())
    room = lowest - layout.depth
    if kind in ("valley", "harbour") and _longest(layout)[1] < rule.spans[0]:
        raise InputError(
            "no room for this crossing under the longest span",
            field="site.crossing",
            value=kind,
            allowed=f"a {kind} under spans of at least {rule.spans[0]:g} m",
            hint="Choose a bridge with a longer span",
        )
    if kind in ("valley", "rail") and room < rule.headroom - 1.0:
        raise InputError(
            f"the bearing seats are only {room:.1f} m above z = 0",
            field="site.crossing",
            value=kind,
            allowed=f"a {kind} under bearing seats at least {rule.headroom - 1.0:g} m high",
            hint="Raise bridge.clearance",
        )
    under = lowest - (layout.soffit or layout.depth)
    if kind in ("road", "harbour") and under < rule.headroom - 1.0:
        raise InputError(
            f"the bridge is only {under:.1f} m above z = 0",
            field="site.crossing",
            value=kind,
            allowed=f"a {kind} under bridges at least {rule.headroom - 1.0:g} m high",
            hint="Raise bridge.clearance",
        )


Bottom = tuple[str, float, float, float]  # kind of the crossing at the bottom, its width, level and depth [m]


def _river(span: float, rng: np.random.Generator) -> Bottom:
    width = min(rng.uniform(MIN_SPAN_SHARE, MAX_SPAN_SHARE) * span, 60.0)
    return "river", width, -rng.uniform(1.4, 1.8), min(rng.uniform(0.9, 1.4), width / 6)


def _road(span: float, rng: np.random.Generator) -> Bottom:
    return "road", min(2 * LANE + 1.0, span - ROOM), 0.05, 0.0


def _rail(span: float, rng: np.random.Generator) -> Bottom:
    return "rail", 2.0 * RAIL_HALF if span >= 2.0 * RAIL_HALF + ROOM else 0.0, RAIL_TOP, 0.0


def _valley(span: float, rng: np.random.Generator) -> Bottom:
    """Place a brook or a road along a valley's bottom."""
    brook, width = rng.random() < 0.6, min(rng.uniform(4.0, 9.0), 0.4 * span)
    return ("river", width, -rng.uniform(1.0, 1.4), min(0.6, width / 6)) if brook else _road(span, rng)


def _harbour(span: float, rng: np.random.Generator) -> Bottom:
    return "river", rng.uniform(*HARBOUR_SHARE) * span, -rng.uniform(1.6, 2.2), min(rng.uniform(5.0, 9.0), span / 12)


_BOTTOMS: dict[CrossingKind, Callable[[float, np.random.Generator], Bottom]] = {
    "river": _river,
    "road": _road,
    "rail": _rail,
    "valley": _valley,
    "harbour": _harbour,
}
