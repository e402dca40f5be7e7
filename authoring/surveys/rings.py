"""The paper's tour of a whole bridge: waypoints on the surface of its extended box, joined along that surface."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from authoring.surveys.box import OrientedBox
from authoring.surveys.settings import GlobalSettings
from authoring.surveys.subject import Subject
from authoring.surveys.way import equal_steps

F64 = NDArray[np.float64]

STEP = 0.25  # [m] between the points of the route before images are placed on it
MARGIN, NEAREST, FARTHEST = 0.35, 8.0, 40.0  # extension: a share of the larger of width and height, within limits [m]
APART = 15.0  # [m] of the box's outline for one waypoint ...
FEWEST, MOST = 12, 40  # ... within these numbers a ring
BANDS = ((0.2, 0.5), (0.6, 0.9))  # heights that the two rings are drawn from, as shares between floor and top [1]
SWAY = 0.08  # largest deviation of a waypoint from the height of its ring [1]
STRIP = 12.0  # [m] of the top's width for one strip over it
SOFT = 3.0  # [m] over which the floor is widened and smoothed


def extended_box(settings: GlobalSettings, box: OrientedBox) -> OrientedBox:
    """Extend a bridge's box on all sides.

    Source: Shi 2024, global scenario; the distance is unknown, the default is ours.

    Args:
        settings: `margin`, if it is given.
        box: The tight box.
    """
    share = MARGIN * 2.0 * float(max(box.half[1], box.half[2]))
    margin = settings.margin if settings.margin is not None else float(np.clip(share, NEAREST, FARTHEST))
    return OrientedBox(box.center, box.axes, box.half + margin)


def draw_rings(settings: GlobalSettings, outer: OrientedBox, subject: Subject, rng: np.random.Generator) -> F64:
    """Draw two rings round the extended box and strips over its top, as one path along its surface.

    Its bottom is in the ground and is left out; where the ground is high, the rings rise above it.

    Args:
        settings: Least height over the ground.
        outer: The extended box.
        subject: Bridge and site.
        rng: Stream `survey/<id>`.

    Returns:
        Positions every `STEP` along the way [m], shape (M, 3), float64.
    """
    around = 4.0 * float(outer.half[0] + outer.half[1])
    count = int(np.clip(round(around / APART), FEWEST, MOST))
    begin, turn = rng.uniform(0.0, around), 1.0 if rng.random() < 0.5 else -1.0
    laps, heights = [], []
    for lap, (low, high) in enumerate(BANDS):
        laps.append(lap + (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count)
        heights.append(rng.uniform(low, high) + rng.uniform(-SWAY, SWAY, count))
    lap, share = np.concatenate([*laps, [2.0, 2.0]]), np.concatenate([*heights, [heights[-1][-1], 1.0]])
    # Between two waypoints the path is straight on the unfolded walls: the shortest on the surface.
    unfolded = equal_steps(np.column_stack([lap * around, share * 2.0 * outer.half[2], np.zeros(len(lap))]), STEP)
    plan = _outline(begin + turn * unfolded[:, 0], outer)
    floor = _floor(settings, outer, plan, subject)
    top = float(outer.half[2])
    height = floor + unfolded[:, 1] / (2.0 * top) * np.maximum(top - floor, 0.0)
    walls = np.column_stack([plan, height])
    return outer.to_world(np.concatenate([walls, equal_steps(_strips(walls[-1], outer, rng), STEP)[1:]]))


def _outline(along: F64, outer: OrientedBox) -> F64:
    """Find the places on the box's outline in plan, from a corner on counter-clockwise [m], shape (M, 2)."""
    x, y = float(outer.half[0]), float(outer.half[1])
    corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y], [-x, -y]])
    arc = np.array([0.0, 2 * x, 2 * x + 2 * y, 4 * x + 2 * y, 4 * x + 4 * y])
    wrapped = along % arc[-1]
    return np.column_stack([np.interp(wrapped, arc, corners[:, axis]) for axis in range(2)])


def _floor(settings: GlobalSettings, outer: OrientedBox, plan: F64, subject: Subject) -> F64:
    """Find the least height of the path in the box's axes [m], shape (M,)."""
    world = outer.to_world(np.column_stack([plan, np.zeros(len(plan))]))
    floor = subject.ground_height(world[:, :2]) + settings.over_ground - outer.center[2]
    floor = np.where(np.isfinite(floor), floor, -outer.half[2])
    reach = round(SOFT / STEP)
    floor = gaussian_filter1d(maximum_filter1d(floor, 2 * reach + 1, mode="nearest"), reach / 2, mode="nearest")
    return np.maximum(floor, -outer.half[2])


def _strips(start: F64, outer: OrientedBox, rng: np.random.Generator) -> F64:
    """List the corners of the strips over the top, from the end of the rings [m], shape (K, 3)."""
    count = max(1, round(2.0 * float(outer.half[1]) / STRIP) - 1)
    rows = (np.arange(1, count + 1) / (count + 1) * 2.0 - 1.0) * outer.half[1]
    rows = rows[:: 1 if start[1] < 0.0 else -1] + rng.uniform(-0.05, 0.05, count) * outer.half[1]
    side = 1.0 if start[0] > 0.0 else -1.0
    corners = [start]
    for number, row in enumerate(rows):
        near = side if number % 2 == 0 else -side
        corners += [np.array([sign * outer.half[0], row, outer.half[2]]) for sign in (near, -near)]
    return np.array(corners)
