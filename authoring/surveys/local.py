"""Local survey: a random path through the free space around a stretch of the bridge, dense and close."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from authoring.parts.drawing import option_at
from authoring.surveys.freespace import FreeSpace, Ways, cut_free_space, gap_between, link_cells, smooth_field
from authoring.surveys.local_box import draw_local_box
from authoring.surveys.local_gaze import gaze
from authoring.surveys.settings import LocalSettings
from authoring.surveys.subject import Subject
from authoring.surveys.way import eased_way, equal_steps, rounded_way, shortcut
from groundwork.errors import InputError
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

DECIMALS = 4  # positions are rounded to it [m], so that every CPU places the same cameras
CLOSE = 1.5  # [m], deviation of the distances at which goals are drawn
GOALS = (3, 5)  # least and largest number of goals of a flight, including both ends
APART = 0.4  # least distance between goals, in lengths of the box [1]
WANDER = 0.7  # influence of the random field on the path [1]
CORRELATION = 4.0  # [m] over which that field changes
FAR = 6.0  # [m] from the bridge beyond which every further meter increases the cost ...
DEAR = 2.0  # ... by this share [1]
TRIES = 60
STRAIGHT = 0.92  # least ratio of the chord between neighboring images to the longest [1]
COARSE = 2.0  # [m] between the cameras among which key cameras are chosen


def fly_local(settings: LocalSettings, subject: Subject, rng: np.random.Generator) -> F64:
    """Plan the flight and aim its cameras.

    Source: Shi 2024, local scenario: voxels, random collision-free path, points of interest on the nearest component,
    slerp between key cameras, up-sampling to 0.5 m. How the path is drawn is unknown; goals, costs and field are ours.

    Args:
        settings: Settings of the scenario.
        subject: Bridge and site.
        rng: Stream `survey/<id>`.

    Returns:
        camera_to_world of each image [m], shape (N, 4, 4), float64.

    Raises:
        InputError: No free space, or no path of the required length.
    """
    limited = (settings.pitch or option_at(settings, "pitch", rng.random(), "default")) == "limited"
    box = draw_local_box(settings, subject, rng)
    space = cut_free_space(box, subject, settings.cell, settings.safety, settings.over_ground)
    if not space.free.any():
        _, row = subject.obstacles.distance(box.center[None])
        raise InputError(
            f"no free space: the instance {subject.obstacle_ids[int(row[0])]} fills the box",
            field="survey.safety",
            value=settings.safety,
            hint="Lower it, or raise survey.beside and survey.above",
        )
    target = None if settings.target is None else _reach_target(settings, settings.target, space, subject)
    way = _draw_way(settings, space, subject, target, rng)
    positions = np.round(equal_steps(way, settings.spacing), DECIMALS)
    highest = np.radians(settings.pitch_limit) if limited else 0.5 * np.pi
    return gaze(positions, subject, highest, COARSE)


@dataclass(frozen=True, eq=False)
class _GoalField:
    """Free cells of a flight, and the probability of each as its next goal.

    Attributes:
        ways: Graph of the free cells.
        middles: Middle of each free cell [m], shape (N, 3), float64.
        chance: Probability of each free cell as a goal, with sum 1, shape (N,), float64.
    """

    ways: Ways
    middles: F64
    chance: F64


def _reach_target(settings: LocalSettings, target: int, space: FreeSpace, subject: Subject) -> int:
    """Find the free cell nearest to a component: its row among the free cells."""
    own = subject.bridge_ids == target
    if not own.any():
        raise InputError(
            "no component of the bridge has this id",
            field="survey.target",
            value=target,
            hint="falsework scene info SCENE --members lists them",
        )
    component = RayScene(subject.bridge[own], subject.bridge_ids[own].astype(np.uint32))
    middles = space.middles(np.argwhere(space.free))
    away = np.round(component.distance(middles)[0], 2)
    row = int(np.argmin(away))
    if away[row] > settings.near + 2.0 * CLOSE:
        nearest, _ = component.nearest(middles[row : row + 1])
        toward = nearest - middles[row]
        _, _, hit = subject.obstacles.cast(middles[row : row + 1], toward)
        between = (
            f"the instance {int(hit[0])} lies between" if int(hit[0]) not in (0, target) else "the box ends before it"
        )
        raise InputError(
            f"cannot be reached: the smallest possible distance is {away[row]:.1f} m; {between}",
            field="survey.target",
            value=target,
            hint="Raise survey.beside, survey.above or survey.length, or lower survey.safety",
        )
    return row


def _limits(space: FreeSpace, subject: Subject) -> str:
    """Describe the limits of a flight besides its box; empty if only the box limits it."""
    gap = gap_between(space)
    if gap is None:
        return ""
    _, row = subject.obstacles.distance(gap[None])
    share = float(space.free.sum()) / float(space.free.sum() + space.cut_off.sum())
    return (
        f"; only {share:.0%} of the free space is connected; the instance {subject.obstacle_ids[int(row[0])]} divides "
        "it"
    )


def _draw_way(
    settings: LocalSettings, space: FreeSpace, subject: Subject, target: int | None, rng: np.random.Generator
) -> F64:
    """Draw paths through the box until one is long enough for the images [m], shape (M, 3), float64."""
    goal_field = _goal_field(settings, space, subject, rng)
    low, high = ((count - 1) * settings.spacing for count in settings.images)
    tried, longer = [], []
    for _ in range(TRIES):
        goals = _draw_goals(goal_field, APART * settings.length, target, rng)
        legs = [goal_field.ways.between(int(a), int(b)) for a, b in pairwise(goals)]
        rows = np.concatenate([legs[0], *(leg[1:] for leg in legs[1:])]) if legs else goals
        short = shortcut(goal_field.middles[rows], subject, settings.safety)
        way = eased_way(rounded_way(short, subject, settings.safety), subject, settings.safety)
        length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        if low <= length <= high and _is_smooth(way, settings.spacing):
            return way
        tried.append(length)
        if length > high:
            longer.append(way)
    for way in longer if target is None else ():
        part = _part(way, rng.uniform(low, high), float(rng.random()))
        if _is_smooth(part, settings.spacing):
            return part
    raise InputError(
        f"no flight of the requested length: {TRIES} attempts were {min(tried):.0f} to {max(tried):.0f} m long"
        + _limits(space, subject),
        field="survey.images",
        value=list(settings.images),
        allowed=f"{int(min(tried) / settings.spacing)} to {int(max(tried) / settings.spacing) + 1} images in this box",
    )


def _part(way: F64, length: float, share: float) -> F64:
    """Cut a part of a given length out of a path [m], shape (K, 3), float64; `share` sets where it begins."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    first = share * (arc[-1] - length)
    inner = (arc > first) & (arc < first + length)
    stations = np.concatenate([[first], arc[inner], [first + length]])
    return np.column_stack([np.interp(stations, arc, way[:, axis]) for axis in range(3)])


def _is_smooth(way: F64, spacing: float) -> bool:
    """Check that neighboring images are nearly a full step apart: no reversal on the spot."""
    chords = np.linalg.norm(np.diff(equal_steps(way, spacing), axis=0), axis=1)
    return bool(chords.min() > STRAIGHT * chords.max())


def _goal_field(settings: LocalSettings, space: FreeSpace, subject: Subject, rng: np.random.Generator) -> _GoalField:
    field = smooth_field(space.free.shape, CORRELATION / settings.cell, rng)
    cells = np.argwhere(space.free)
    middles = space.middles(cells)
    away = np.full(space.free.shape, np.inf)
    away[space.free] = np.round(subject.surface.distance(middles)[0], 2)
    weight = np.exp(WANDER * field) * (1.0 + DEAR * np.maximum(np.where(np.isfinite(away), away, FAR) - FAR, 0.0))
    chance = np.exp(-((away[space.free] - settings.near) ** 2) / (2.0 * CLOSE**2)) + 1e-12
    return _GoalField(link_cells(space, weight), middles, chance / chance.sum())


def _draw_goals(goal_field: _GoalField, apart: float, target: int | None, rng: np.random.Generator) -> I64:
    """Draw goal cells with a least distance; fewer if the free space is small; the target is one of them."""
    wanted = int(rng.integers(GOALS[0], GOALS[1] + 1))
    edges = np.cumsum(goal_field.chance)
    goals: list[int] = [] if target is None else [target]
    for share in rng.random(40 * wanted):
        row = int(min(np.searchsorted(edges, share), len(edges) - 1))
        if all(np.linalg.norm(goal_field.middles[row] - goal_field.middles[goal]) >= apart for goal in goals):
            goals.append(row)
        if len(goals) == wanted:
            break
    return np.array(goals, np.int64)
