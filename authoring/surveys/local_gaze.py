"""Viewing directions of a local flight: at the nearest component, rotating evenly from one to the next."""

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.subject import Subject
from authoring.surveys.turning import angle_between, limit_pitch, look_along, lowered, turn_between

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

DECIMALS = 4  # points of interest are rounded to it [m], so that every CPU aims alike
WIDEST = np.radians(120.0)  # between two key cameras: for larger angles the rotation passes through the sky
FASTEST = np.radians(12.0)  # largest rotation between neighboring images
TOO_NEAR = 0.7  # [m] to a point of interest: nearer cameras see only the surface of one member


def gaze(positions: F64, subject: Subject, highest: float, coarse: float) -> F64:
    """Aim the cameras of a flight.

    Source: Shi 2024, local scenario: runs of cameras with the same nearest component, the nearest camera of each run
    looks at the nearest point of it, all others are turned between these by slerp.

    Args:
        positions: Camera centers in the order of flight [m], shape (N, 3), float64.
        subject: Bridge and site.
        highest: Highest pitch of the gimbal [rad]; pi/2 for a free one.
        coarse: Distance between the cameras among which key cameras are chosen [m].

    Returns:
        camera_to_world of each image [m], shape (N, 4, 4), float64.
    """
    stations = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    stride = max(1, round(coarse * (len(positions) - 1) / max(stations[-1], 1e-9)))
    chosen = np.unique([*range(0, len(positions), stride), len(positions) - 1])
    nearest, rows = subject.surface.nearest(positions[chosen])
    points, components = np.round(nearest, DECIMALS), subject.bridge_ids[rows]
    keys = key_cameras(positions[chosen], points, components)
    rows = chosen[keys]
    looks = limit_pitch(points[keys] - positions[rows], highest)
    followed = _followed(rows, looks, np.linalg.norm(points[keys] - positions[rows], axis=1))
    where, looks, targets = stations[rows[followed]], looks[followed], points[keys][followed]
    where, looks = _eased(where, looks, targets, positions, stations, highest)
    turned = turn_between(look_along(looks), where, stations)
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    # A great arc between two key cameras may rise over both: the gimbal's limit applies there as well.
    poses[:, :3, :3] = lowered(turned, highest)
    poses[:, :3, 3] = positions
    return poses


def key_cameras(positions: F64, points: F64, components: NDArray[np.integer]) -> list[int]:
    """Choose the key cameras: the nearest of each run with one nearest component, and both ends.

    Args:
        positions: Camera centers [m], shape (N, 3), float64.
        points: Nearest point of the bridge to each [m], shape (N, 3), float64.
        components: Instance that each of these lies on, shape (N,), int.

    Returns:
        Rows of the key cameras, rising.
    """
    distance = np.linalg.norm(points - positions, axis=1)
    borders = np.flatnonzero(np.diff(components)) + 1
    runs = np.split(np.arange(len(positions)), borders)
    nearest = [int(run[int(np.argmin(distance[run]))]) for run in runs]
    keys = sorted({0, *nearest, len(positions) - 1})
    far = [key for key in keys if distance[key] >= TOO_NEAR]
    return far or keys


def _followed(rows: I64, looks: F64, distance: F64) -> list[int]:
    """Choose the key cameras that a gimbal can follow; of two with too fast a rotation, the closer one is kept."""
    turns = look_along(looks)
    kept = [0]
    for key in range(1, len(rows)):
        while kept:
            rate = angle_between(turns[kept[-1]], turns[key]) / max(int(rows[key] - rows[kept[-1]]), 1)
            if rate <= FASTEST or distance[key] >= distance[kept[-1]]:
                break
            kept.pop()
        else:
            rate = 0.0
        if rate <= FASTEST:
            kept.append(key)
    return kept


def _eased(where: F64, looks: F64, targets: F64, positions: F64, stations: F64, highest: float) -> tuple[F64, F64]:
    """Insert a key camera between two that differ by more than the widest turn, aimed between their targets."""
    places, directions = [float(where[0])], [looks[0]]
    for key in range(1, len(where)):
        if angle_between(look_along(looks[key - 1 : key])[0], look_along(looks[key : key + 1])[0]) > WIDEST:
            middle = 0.5 * (where[key - 1] + where[key])
            at = np.array([np.interp(middle, stations, positions[:, axis]) for axis in range(3)])
            toward = 0.5 * (targets[key - 1] + targets[key]) - at
            if np.linalg.norm(toward) > TOO_NEAR:
                places.append(float(middle))
                directions.append(limit_pitch(toward[None], highest)[0])
        places.append(float(where[key]))
        directions.append(looks[key])
    return np.array(places), np.array(directions)
