"""Global survey: around the whole bridge, in a loop alternately below and above the deck, or in rings."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from authoring.surveys.box import OrientedBox, oriented_box
from authoring.surveys.gaze import STEADINESS, aim, along_axis, drawn_to_lines, inner_box
from authoring.surveys.rings import draw_rings, extended_box
from authoring.surveys.settings import GlobalSettings
from authoring.surveys.subject import Subject
from authoring.surveys.way import equal_steps
from groundwork.errors import InputError

F64 = NDArray[np.float64]

STEP = 0.25  # [m] between the points of the route before images are placed on it
DECIMALS = 4  # positions are rounded to it [m], so that every CPU places the same cameras
DIVE = 26.0  # [m] length of a bridge without bearings per pass below the deck
LINGER = 1.5  # exponent of the wave: above 1, it is low for longer than high
BEHIND = 2.0  # [m] behind the bearings of an abutment where the first pass below the deck begins
SAME_LINE = 3.0  # [m] along the bridge within which bearings form one line
BEYOND = (-1.5, 0.5)  # [m] past the ends of the bridge, whose wing walls reach back
# Above the road, only slanted asphalt is near: with the spacing of the sides, common surfaces of the two sides are
# hundreds of meters away there, and one side was placed 18 m off.
CROSSING = 3.0  # [m] before the ends of the bridge where a crossing of the road begins
CROSSING_DENSITY = 1.8  # images a meter there, over those along the sides
ROUNDS = 12  # of placing images where cameras rotate too far; 4 are enough for most flights
STEADIER = 1.2  # times the smoothing of the gaze in each further round [1]
CLIMB = 3.0  # [m] that the crossings fly higher, so that the road is seen from above
POINTS_OF_INTEREST = {"box50": inner_box, "axis": along_axis}


def fly_whole(settings: GlobalSettings, subject: Subject, rng: np.random.Generator) -> F64:
    """Plan the flight and aim its cameras.

    Source: Shi, Kim, Narazaki: Development of large-scale synthetic 3D point cloud datasets for vision-based bridge
    structural condition assessment, global scenario (extended box, waypoints on its surface, points of interest on an
    inner box). That is the tour "rings"; the default is a loop that needs fewer images.

    Args:
        settings: Settings of the scenario.
        subject: Bridge and site.
        rng: Stream `survey/<id>`.

    Returns:
        camera_to_world of each image [m], shape (N, 4, 4), float64.

    Raises:
        InputError: No path around the bridge keeps the safety distance.
    """
    box = oriented_box(subject.bridge.reshape(-1, 3))
    lines = bearing_lines(box.to_local(subject.seats)) if len(subject.seats) else np.zeros((0, 2))
    if settings.tour == "rings":
        rings = draw_rings(settings, extended_box(settings, box), subject, rng)
        route = clear_route(rings, box, subject, settings.safety, "margin")
        length = float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum())
        positions = np.round(equal_steps(route, min(settings.spacing, length / (settings.images - 1))), DECIMALS)
        return aim(positions, np.round(box.to_world(targets_of(settings, box, lines, positions)), DECIMALS))
    route = clear_route(
        draw_route(settings, box, lines[:, 0], subject, rng), box, subject, settings.safety, "stand_off"
    )
    crossing = np.abs(box.to_local(route)[:, 0]) > box.half[0] - CROSSING
    return _fly_loop(settings, box, lines, route, np.where(crossing, CROSSING_DENSITY, 1.0))


def targets_of(
    settings: GlobalSettings, box: OrientedBox, lines: F64, positions: F64, steadiness: float = STEADINESS
) -> F64:
    """Choose where each camera looks.

    Args:
        settings: Settings of the scenario.
        box: The bridge's box.
        lines: Distance along the box and height of each bearing line [m], shape (L, 2), float64.
        positions: Camera centers [m], shape (N, 3), float64.
        steadiness: Standard deviation of the smoothing of the gaze, in images [1].

    Returns:
        Points of interest in the axes of the box [m], shape (N, 3), float64.
    """
    local, middle = box.to_local(positions), np.zeros(3)
    if settings.tour == "loop":
        middle[2] = (local[:, 2].min() + local[:, 2].max()) / 2
    targets = middle + POINTS_OF_INTEREST[settings.poi](local - middle)
    if settings.poi == "axis" and settings.tour == "loop":
        targets = drawn_to_lines(local, targets, lines, steadiness)
    return targets


def _fly_loop(settings: GlobalSettings, box: OrientedBox, lines: F64, route: F64, density: F64) -> F64:
    """Place images on the route and aim them; place more wherever a camera turns too far to the next one."""
    least, spacing, steadiness, poses = settings.images, settings.spacing, STEADINESS, np.zeros((0, 4, 4))
    for _ in range(ROUNDS):
        positions, stretch = place_images(route, density, least, spacing)
        positions = np.round(positions, DECIMALS)
        targets = targets_of(settings, box, lines, positions, steadiness)
        poses = aim(positions, np.round(box.to_world(targets), DECIMALS))
        excess = np.round(turns_to_next(poses) / settings.largest_turn, DECIMALS)
        if excess.max() <= 1.0:
            break
        least, spacing = 1, arc_of(route, density)[-1] / len(positions)  # elsewhere the steps do not change
        density = density * np.maximum(excess, 1.0)[stretch]
        steadiness *= STEADIER  # where the gaze changes its target, more images alone do not reduce the rotation
    return poses


def turns_to_next(poses: F64) -> F64:
    """Measure the angle between the viewing directions of each camera of a closed flight and the next [deg].

    Args:
        poses: camera_to_world [m], shape (N, 4, 4), float64.

    Returns:
        Angles, including that from the last camera to the first [deg], shape (N,), float64.
    """
    forward = poses[:, :3, 2]
    cosine = np.sum(forward * np.roll(forward, -1, axis=0), axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def bearing_lines(seats: F64) -> F64:
    """Group bearings into the lines across the bridge that they form; one pier gives one line.

    Args:
        seats: Middles of the bearings in the box's axes [m], shape (S, 3), float64.

    Returns:
        Distance along the box and height of each line, in order [m], shape (L, 2), float64.
    """
    order = seats[np.argsort(seats[:, 0], kind="stable")]
    groups = np.split(order, np.flatnonzero(np.diff(order[:, 0]) > SAME_LINE) + 1)
    return np.array([group[:, [0, 2]].mean(axis=0) for group in groups])


def draw_route(
    settings: GlobalSettings, box: OrientedBox, lines: F64, subject: Subject, rng: np.random.Generator
) -> F64:
    """Draw a closed route round the extended box: over the bridge at its bearing lines and ends, low along its spans.

    Args:
        settings: Settings of the scenario.
        box: The bridge's box.
        lines: Distances of the bearing lines along the box [m], shape (L,), float64.
        subject: Bridge and site.
        rng: Stream `survey/<id>`.

    Returns:
        Positions every `STEP` along the loop in plan [m], shape (M, 3), float64.
    """
    length = box.half[0] + rng.uniform(*BEYOND)
    width = box.half[1] + rng.uniform(*settings.stand_off)
    top = box.half[2] + rng.uniform(*settings.over_deck)
    plan = _racetrack(length, width)
    plan = np.roll(plan, int(rng.integers(len(plan))), axis=0)
    if rng.random() < 0.5:
        plan = plan[::-1]
    weight = _wave(plan[:, 0], _dive_ends(lines, length))
    world = box.to_world(np.column_stack([plan, np.zeros(len(plan))]))
    floor = subject.ground_height(world[:, :2]) + settings.over_ground - box.center[2]
    floor = np.where(np.isfinite(floor), floor, top - 1.0)
    reach = round(3.0 / STEP)
    floor = gaussian_filter1d(maximum_filter1d(floor, 2 * reach + 1, mode="wrap"), reach / 2, mode="wrap")
    climb = CLIMB * np.clip((np.abs(plan[:, 0]) - box.half[0] + CROSSING) / CROSSING, 0.0, 1.0)
    climb = gaussian_filter1d(climb, reach / 2, mode="wrap")
    height = floor + weight * np.maximum(top - floor, 0.0) + climb
    return box.to_world(np.column_stack([plan, height]))


def clear_route(route: F64, box: OrientedBox, subject: Subject, safety: float, distance: str) -> F64:
    """Move a route outwards and upwards until it is at a safe distance everywhere.

    Args:
        route: Closed route [m], shape (M, 3), float64.
        box: The bridge's box, which defines the outward direction.
        subject: Bridge and site.
        safety: Least distance to both [m].
        distance: Name of the setting that moves the whole route outwards, for the error.

    Returns:
        The route, moved where necessary [m], shape (M, 3), float64.

    Raises:
        InputError: There is an obstacle at every distance tried.
    """
    outward = box.to_local(route) * [0.3, 1.0, 0.0]
    outward = outward / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9) + [0.0, 0.0, 1.0]
    push = outward @ box.axes / np.sqrt(2)
    margin = safety + STEP  # images lie on chords of the route
    amount = np.zeros(len(route))
    moved = route
    for _ in range(60):
        moved = route + gaussian_filter1d(amount, 1.0 / STEP, mode="wrap")[:, None] * push
        near = subject.clearance(moved) < margin
        if not near.any():
            return moved
        amount = amount + 0.3 * maximum_filter1d(near.astype(float), round(2.0 / STEP) + 1, mode="wrap")
    row = int(subject.obstacles.distance(moved)[1][int(np.argmin(subject.clearance(moved)))])
    raise InputError(
        f"no path around the bridge keeps a distance of {safety} m: the instance {subject.obstacle_ids[row]} is in the "
        "way",
        field="survey.safety",
        value=safety,
        hint=f"Lower it, or raise survey.{distance}",
    )


def place_images(route: F64, density: F64, least: int, spacing: float) -> tuple[F64, NDArray[np.int64]]:
    """Place images on a closed route at steps that are equal where its density is.

    Args:
        route: Closed route [m], shape (M, 3), float64.
        density: Images a meter at each point of the route, over those where it is 1 [1], shape (M,), float64.
        least: Least number of images.
        spacing: Greatest step [m].

    Returns:
        Camera centers [m], shape (N, 3), float64; and the image behind each point of the route, shape (M,), int64.
    """
    closed = np.concatenate([route, route[:1]])
    arc = arc_of(route, density)
    count = max(least, int(np.ceil(arc[-1] / spacing)))
    stations = np.arange(count) * arc[-1] / count
    places = np.column_stack([np.interp(stations, arc, closed[:, axis]) for axis in range(3)])
    return places, np.searchsorted(stations, arc[:-1], side="right") - 1


def arc_of(route: F64, density: F64) -> F64:
    """Compute the length along a closed route, weighted by the density of images.

    Args:
        route: Closed route [m], shape (M, 3), float64.
        density: Images a meter at each point of the route, over those where it is 1 [1], shape (M,), float64.

    Returns:
        Length to each point, and back to the first [m], shape (M + 1,), float64.
    """
    weight = (density + np.roll(density, -1)) / 2
    steps = np.linalg.norm(np.diff(np.concatenate([route, route[:1]]), axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(weight * steps)])


def _dive_ends(lines: F64, length: float) -> F64:
    if len(lines) < 2:
        return np.linspace(-length, length, max(1, round(2 * length / DIVE)) + 1)
    ends = lines.copy()
    ends[0], ends[-1] = lines[0] - BEHIND, lines[-1] + BEHIND
    return ends


def _wave(along: F64, ends: F64) -> F64:
    """Fall from 1 to 0 and rise to 1 again between each two ends, slightly longer low than high."""
    bay = np.clip(np.searchsorted(ends, along, side="right") - 1, 0, len(ends) - 2)
    phase = np.clip((along - ends[bay]) / (ends[bay + 1] - ends[bay]), 0.0, 1.0)
    return (0.5 + 0.5 * np.cos(2 * np.pi * phase)) ** LINGER


def _racetrack(length: float, width: float) -> F64:
    """Outline a rectangle of half sizes `length` and `width` whose short ends are rounded off, counter-clockwise."""
    radius = min(width, length) * 0.8
    centers = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length - radius, width - radius]
    turns = np.linspace(0.0, np.pi / 2, 16)
    corners = [
        center + radius * np.column_stack([np.cos(turns + quarter * np.pi / 2), np.sin(turns + quarter * np.pi / 2)])
        for quarter, center in enumerate(centers)
    ]
    closed = np.concatenate([*corners, corners[0][:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    stations = np.linspace(0.0, arc[-1], max(int(arc[-1] / STEP), 16), endpoint=False)
    return np.column_stack([np.interp(stations, arc, closed[:, axis]) for axis in range(2)])
