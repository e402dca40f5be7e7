"""Rivers so wide that one or two piers of a bridge stand in the water."""

from dataclasses import replace

import numpy as np

from authoring.axis.alignment import Layout
from authoring.site.shape import Crossing
from authoring.site.valley import floor_room

SHARE = 0.4  # of the rivers under bridges of several spans that are widened, where there is room [1]
LEAST_SPANS, LEAST_FOR_TWO = 3, 5  # spans of a bridge from which on one or two piers may stand in the water
IN_WATER = 3.0  # [m] least distance of a wet pier's support line from the water's edge: half a pier and 1.5 m
ON_LAND = 3.0  # [m] least distance of the next piers' support lines from the water
BANK = 4.5  # [m] least distance of the abutments' bearing lines from the water, for the bank
DRY_SHARE = 0.17  # of a span, that the next support keeps from the water at least [1]
WIDEST = 60.0  # [m] widest river
ASIDE, SWELL = 80.0, 1.25  # [m] beside the axis, up to which a river is at most so many times as wide as at the deck
_DEPTHS = (0.9, 1.4)  # [m] depth of the water
_TRIES = 6  # drawn widths per group of piers
_LEAST_FILLED = 0.3  # of the room for water beside the piers that is filled at least [1]


def widened(crossing: Crossing, layout: Layout, wanted: bool | None, rng: np.random.Generator) -> Crossing:
    """Widen some rivers so that one pier, or two of a longer bridge, stand in the water.

    All other supports stay dry under the whole width of the deck.

    Args:
        crossing: A river between two supports.
        layout: The bridge.
        wanted: Widen the river wherever there is room, or never; None: by chance.
        rng: Random stream, used for nothing else.

    Returns:
        The wider river with the numbers of the supports in it, or the same river.
    """
    spans = len(layout.supports) - 1
    by_chance = rng.random() < SHARE
    if not layout.river_piers or spans < LEAST_SPANS or not (by_chance if wanted is None else wanted):
        return crossing
    two, side, depth = rng.random() < 0.5, rng.choice((-1.0, 1.0)), rng.uniform(*_DEPTHS)
    for count in (2, 1) if two and spans >= LEAST_FOR_TWO else (1,):
        middles = [0.5 * (layout.supports[i] + layout.supports[i + count - 1]) for i in range(1, spans - count + 1)]
        for number in np.argsort(np.abs(np.array(middles) - crossing.station - 0.1 * side), kind="stable")[:2]:
            wet = tuple(range(int(number) + 1, int(number) + 1 + count))
            for shares in rng.uniform(_LEAST_FILLED, 1.0, (_TRIES, 2)):
                wide = _around(crossing, layout, wet, (float(shares[0]), float(shares[1])))
                if wide.half_width > crossing.half_width and has_room(wide, layout):
                    return replace(wide, depth=float(min(depth, wide.half_width / 3.0)))
    return crossing


def has_room(crossing: Crossing, layout: Layout) -> bool:
    """Check that the piers are far enough from the edges of a river, which is not too wide, and other supports dry.

    Args:
        crossing: The river.
        layout: The bridge.
    """
    if 2.0 * crossing.half_width > WIDEST or crossing.half_width + BANK > floor_room(layout, crossing.station):
        return False
    if swell(crossing, layout) > SWELL:
        return False
    first, last = crossing.piers[0], crossing.piers[-1]
    left = np.linspace(-0.5, 0.5, 41) * layout.width
    beyond = {n: crossing.distance(np.array(at), left) - crossing.half_width for n, at in enumerate(layout.supports)}
    if max(float(beyond[n].max()) for n in crossing.piers) > -IN_WATER:
        return False
    return all(
        float(beyond[n].min()) >= _dry(layout, n, beside) for n, beside in ((first - 1, first), (last + 1, last))
    )


def swell(crossing: Crossing, layout: Layout) -> float:
    """Measure how many times as wide as at the deck a river is beside a curved axis, at most [1].

    Args:
        crossing: The river.
        layout: The bridge.
    """
    left = np.linspace(-ASIDE, ASIDE, 9)
    reach = crossing.half_width * crossing.stretch(left)
    edges = [layout.alignment.point(crossing.center(left) + side * reach, left, 0.0 * left) for side in (-1.0, 1.0)]
    wide = np.hypot(*(edges[1] - edges[0])[:, :2].T)
    return float(wide.max() / wide[len(left) // 2])


def _dry(layout: Layout, support: int, beside: int) -> float:
    """Find the least distance of a dry support from the water [m], perpendicular to the river."""
    span = abs(layout.supports[beside] - layout.supports[support]) * float(np.cos(layout.alignment.skew))
    return max(BANK if support in (0, len(layout.supports) - 1) else ON_LAND, DRY_SHARE * span)


def _around(crossing: Crossing, layout: Layout, wet: tuple[int, ...], shares: tuple[float, float]) -> Crossing:
    """Place a river round some piers, by shares of the room between the least and the most on each side [1]."""
    stretch = float(crossing.stretch(np.zeros(1))[0])
    reach = []
    for inside, beside, share in ((wet[0], wet[0] - 1, shares[0]), (wet[-1], wet[-1] + 1, shares[1])):
        span = abs(layout.supports[beside] - layout.supports[inside])
        least, most = IN_WATER * stretch, span - _dry(layout, beside, inside) * stretch
        reach.append(least + share * max(most - least, 0.0))
    low, high = layout.supports[wet[0]] - reach[0], layout.supports[wet[-1]] + reach[1]
    return replace(crossing, station=0.5 * (low + high), half_width=0.5 * (high - low) / stretch, piers=wet)
