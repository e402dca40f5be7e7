"""Global survey: one closed loop round the whole bridge that waves between under the deck and over it."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from authoring.surveys.box import OrientedBox, oriented_box
from authoring.surveys.gaze import aim, along_axis, inner_box
from authoring.surveys.settings import GlobalSettings
from authoring.surveys.subject import Subject
from groundwork.errors import InputError

F64 = NDArray[np.float64]

STEP = 0.25  # [m] between the points of the route before images are placed on it
DIP_LENGTH = 26.0  # [m] of the side of a bridge for one dive under the deck
BEYOND = (1.0, 2.5)  # [m] past the ends of the bridge
POINTS_OF_INTEREST = {"box50": inner_box, "axis": along_axis}


def fly_whole(settings: GlobalSettings, subject: Subject, rng: np.random.Generator) -> F64:
    """Plan the flight and aim its cameras.

    Source: Shi, Kim, Narazaki: Development of large-scale synthetic 3D point cloud datasets for vision-based bridge
    structural condition assessment, global scenario (extended box, points of interest on an inner box). Their tour
    over waypoints is a loop here, so that few images suffice.

    Args:
        settings: What the scenario says.
        subject: Bridge and site.
        rng: Stream `survey/<id>`.

    Returns:
        camera_to_world of each image [m], shape (N, 4, 4), float64.

    Raises:
        InputError: No way round the bridge keeps the safety distance.
    """
    box = oriented_box(subject.bridge.reshape(-1, 3))
    route = clear_route(draw_route(settings, box, subject, rng), box, subject, settings.safety)
    positions = place_images(route, settings.images, settings.spacing)
    local = box.to_local(positions)
    middle = np.array([0.0, 0.0, (local[:, 2].min() + local[:, 2].max()) / 2])
    targets = middle + POINTS_OF_INTEREST[settings.poi](local - middle)
    return aim(positions, box.to_world(targets))


def draw_route(settings: GlobalSettings, box: OrientedBox, subject: Subject, rng: np.random.Generator) -> F64:
    """Draw a closed route round the extended box.

    One side of the bridge has one dive more than the other, so that what one side sees from above is seen from below
    on the other side.

    Args:
        settings: What the scenario says.
        box: The bridge's box.
        subject: Bridge and site.
        rng: Stream `survey/<id>`.

    Returns:
        Positions every `STEP` along the loop in plan [m], shape (M, 3), float64.
    """
    length = box.half[0] + rng.uniform(*BEYOND)
    width = box.half[1] + rng.uniform(*settings.stand_off)
    top = box.half[2] + rng.uniform(*settings.over_deck)
    dives = max(1, round(2 * length / DIP_LENGTH))
    left, right = (dives, dives + 1) if rng.random() < 0.5 else (dives + 1, dives)
    plan = _racetrack(length, width)
    plan = np.roll(plan, int(rng.integers(len(plan))), axis=0)
    if rng.random() < 0.5:
        plan = plan[::-1]
    progress = (plan[:, 0] + length) / (2 * length)
    weight = 0.5 + 0.5 * np.cos(2 * np.pi * np.where(plan[:, 1] > 0, left, right) * progress)
    world = box.to_world(np.column_stack([plan, np.zeros(len(plan))]))
    floor = subject.ground_height(world[:, :2]) + settings.over_ground - box.center[2]
    floor = np.where(np.isfinite(floor), floor, top - 1.0)
    reach = round(3.0 / STEP)
    floor = gaussian_filter1d(maximum_filter1d(floor, 2 * reach + 1, mode="wrap"), reach / 2, mode="wrap")
    height = floor + weight * np.maximum(top - floor, 0.0)
    return box.to_world(np.column_stack([plan, height]))


def clear_route(route: F64, box: OrientedBox, subject: Subject, safety: float) -> F64:
    """Push a route outwards and upwards until it keeps its distance everywhere.

    Args:
        route: Closed route [m], shape (M, 3), float64.
        box: The bridge's box, which tells outwards.
        subject: Bridge and site.
        safety: Least distance to both [m].

    Returns:
        The route, moved where it had to be [m], shape (M, 3), float64.

    Raises:
        InputError: Something stands in the way at every distance tried.
    """
    outward = box.to_local(route) * [0.3, 1.0, 0.0]
    outward = outward / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9) + [0.0, 0.0, 1.0]
    push = outward @ box.axes / np.sqrt(2)
    margin = safety + STEP  # images lie on chords of the route
    amount = np.zeros(len(route))
    for _ in range(60):
        moved = route + gaussian_filter1d(amount, 1.0 / STEP, mode="wrap")[:, None] * push
        near = subject.clearance(moved) < margin
        if not near.any():
            return moved
        amount = amount + 0.3 * maximum_filter1d(near.astype(float), round(2.0 / STEP) + 1, mode="wrap")
    row = int(subject.obstacles.distance(moved)[1][int(np.argmin(subject.clearance(moved)))])
    raise InputError(
        f"no way round the bridge keeps {safety} m of distance: the instance {subject.obstacles.ids[row]} is in the way",
        field="survey.safety", value=safety, mend="Lower it, or widen survey.stand_off",
    )  # fmt: skip


def place_images(route: F64, least: int, spacing: float) -> F64:
    """Place images at equal steps of arc length on a closed route.

    Args:
        route: Closed route [m], shape (M, 3), float64.
        least: Least number of images.
        spacing: Greatest step [m].

    Returns:
        Camera centres [m], shape (N, 3), float64.
    """
    closed = np.concatenate([route, route[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    count = max(least, int(np.ceil(arc[-1] / spacing)))
    stations = np.arange(count) * arc[-1] / count
    return np.column_stack([np.interp(stations, arc, closed[:, axis]) for axis in range(3)])


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
