"""Rigid copies of one small solid along the axis: sleepers, posts, bars. The solid is made once, then only moved."""

from dataclasses import replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.shapes.component import F64
from authoring.solids.sweep import Surface

LOCAL = Alignment(0.0)  # bridge coordinates equal world coordinates: for templates around the origin
_ARM = 0.05  # [m] distance on each side of a place over which directions are measured


def frames_along(place: Alignment, stations: F64, left: float, above: float, *, upright: bool) -> F64:
    """Compute the positions and directions of copies.

    Args:
        place: Axis of the bridge.
        stations: Stations of the copies [m], shape (N,), float64.
        left: Distance of their origins to the left of the axis [m].
        above: Height of their origins above the finished surface on the axis [m].
        upright: Whether they are vertical; otherwise they follow grade and superelevation.

    Returns:
        Transforms of template coordinates (along, left, up) to the world [m], shape (N, 4, 4), float64.
    """
    stations = np.asarray(stations, dtype=np.float64)
    side, height = np.full(len(stations), left), np.full(len(stations), above)
    along = place.point(stations + _ARM, side, height) - place.point(stations - _ARM, side, height)
    across = place.point(stations, side + _ARM, height) - place.point(stations, side - _ARM, height)
    if upright:
        along[:, 2] = 0.0
        up = np.tile([0.0, 0.0, 1.0], (len(stations), 1))
    else:
        up = np.cross(along, across)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    up = up / np.linalg.norm(up, axis=1, keepdims=True)
    frames = np.tile(np.eye(4), (len(stations), 1, 1))
    frames[:, :3, 0], frames[:, :3, 1], frames[:, :3, 2] = along, np.cross(up, along), up
    frames[:, :3, 3] = place.point(stations, side, height)
    return frames


def copied(template: Surface, frame: F64) -> Surface:
    """Move a solid to one place.

    Args:
        template: Solid round the origin of `LOCAL`.
        frame: A row of `frames_along` [m], shape (4, 4), float64.
    """
    turn = frame[:3, :3].T
    return replace(template, points=template.points @ turn + frame[:3, 3], normals=template.normals @ turn)


def copied_together(template: Surface, frames: F64) -> Surface:
    """Copy one solid to many places, as one surface.

    Args:
        template: Solid round the origin of `LOCAL`.
        frames: Result of `frames_along` [m], shape (N, 4, 4), float64, N > 0.
    """
    count, charts = len(frames), int(template.chart.max()) + 1
    number = np.arange(count, dtype=np.int32)[:, None]
    turn = frames[:, :3, :3].transpose(0, 2, 1)
    return Surface(
        points=(template.points @ turn + frames[:, None, :3, 3]).reshape(-1, 3),
        face_counts=np.tile(template.face_counts, count),
        corners=(template.corners + number * len(template.points)).astype(np.int32).ravel(),
        normals=(template.normals @ turn).reshape(-1, 3),
        st=np.tile(template.st, (count, 1)),
        chart=(template.chart + number * charts).astype(np.int32).ravel(),
    )
