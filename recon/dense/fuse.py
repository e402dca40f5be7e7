"""Fuse depth maps into one cloud: a point is made where several maps agree, and each pixel of a map is used once.

Compiled loops over pixels; the tests compare them with plain NumPy versions.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.pixel_fates import IN_POINTS, NARROW, SEEN_THROUGH, TOO_FEW
from recon.dense.points import DensePoints

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
Mask = NDArray[np.bool_]

_FREE_SPACE = 0.02  # [1] a map whose depth exceeds the point's by this share contradicts the point
_BLENDED = 0.05  # [1] share of the depth by which neighbors of one surface may differ, steep ones too
_RIM_OFF = 0.01  # [px] margin against rounding to a pixel outside the image


@dataclass(frozen=True)
class DepthView:
    """One view's depth map with image, normals and pose.

    Attributes:
        image: Row in the model.
        depth: Planar depth, 0 where unknown [model units], shape (H, W), float32.
        normal: Unit normals in camera axes, towards the camera [1], shape (H, W, 3), float32.
        color: Working image, shape (H, W, 3), uint8.
        used: Pixels that are already part of a point, shape (H, W), bool; set by the fusion.
        pose: camera_to_world [model units], shape (4, 4), float64.
        fate: What became of its pixels, numbers of `PIXEL_FATES`, shape (H, W), uint8; fusion sets them.
    """

    image: int
    depth: F32
    normal: F32
    color: U8
    used: Mask
    pose: F64
    fate: U8


class _Own(NamedTuple):
    """Maps of the view whose points are made, shape (H, W) each: depth, used pixels, fates."""

    depth: F32
    used: Mask
    fate: U8


class _Others(NamedTuple):
    """The views that a point is checked against, V of them.

    to_other: from the view's axes into theirs, shape (V, 4, 4); depths, used, fates: their maps, shape (V, H, W);
    camera: fx, fy, cx, cy of all [px], shape (4,); tolerance: largest difference of depths [1].
    """

    to_other: F64
    depths: F32
    used: Mask
    fates: U8
    camera: F64
    tolerance: float


class _Answer(NamedTuple):
    """Views that agree on one point, overwritten for each point: their numbers, their pixels, the mean position."""

    views: I64
    pixels: I64
    mean: F64


class _Seen(NamedTuple):
    """Observations of all points, one after the other: number of the view (0 is the view itself) and its pixel."""

    number: U8
    uv: F32


def fuse_view(
    reference: DepthView, others: list[DepthView], camera: F64, min_views: int, tolerance: float, min_angle: float
) -> DensePoints:
    """Make points from the pixels of one view that are not yet part of a point.

    Args:
        reference: The view.
        others: The views that it is checked against; used pixels and fates are marked in them and in `reference`.
        camera: fx, fy, cx, cy of the working camera [px], shape (4,), float64.
        min_views: Views that must agree, this one among them.
        tolerance: Largest difference of depths, as a share of the depth [1].
        min_angle: Smallest of the largest angles between a point's rays [deg].

    Returns:
        The points, in the order of the view's pixels.
    """
    poses = np.stack([view.pose for view in others])
    to_other = np.linalg.inv(poses) @ reference.pose
    depths = np.stack([view.depth for view in others])
    used = np.stack([view.used for view in others])
    fates = np.stack([view.fate for view in others])
    own = _Own(reference.depth, reference.used, reference.fate)
    asked = _Others(to_other, depths, used, fates, camera, tolerance)
    points, counts, seen, uv = _agreeing(own, asked, min_views, float(np.cos(np.radians(min_angle))))
    for view, mask, fate in zip(others, used, fates, strict=True):
        view.used[:], view.fate[:] = mask, fate
    world = points @ reference.pose[:3, :3].T + reference.pose[:3, 3]
    normals, colors = _blend(
        counts,
        seen,
        uv,
        np.stack([reference.normal, *(view.normal for view in others)]),
        np.stack([reference.color, *(view.color for view in others)]),
        np.stack([reference.pose[:3, :3], *poses[:, :3, :3]]),
    )
    images = np.array([reference.image, *(view.image for view in others)])
    image = images[seen]
    point = np.repeat(np.arange(len(counts)), counts)
    order = np.lexsort((image, point))
    return DensePoints(world, normals, colors, counts, image[order].astype(np.uint32), uv[order].astype(np.float32))


@njit(cache=True, nogil=True)
def _agreeing(own: _Own, others: _Others, min_views: int, max_cosine: float) -> tuple[F64, I64, U8, F32]:
    """Find the pixels that agree: points in the view's axes, view counts, view numbers (0 is the view), pixels."""
    height, width = own.depth.shape
    count = len(others.to_other)
    room, camera = height * width, others.camera
    points, counts = np.empty((room, 3)), np.empty(room, np.int64)
    # Sized for the worst case: pages that are never written take no memory.
    seen = _Seen(np.empty(room * (count + 1), np.uint8), np.empty((room * (count + 1), 2), np.float32))
    made = filled = 0
    answer = _Answer(np.empty(count + 1, np.int64), np.empty((count + 1, 2), np.int64), np.empty(3))
    for i in range(height):
        for j in range(width):
            z = np.float64(own.depth[i, j])
            if z <= 0.0 or own.used[i, j]:
                continue
            x, y = (j + 0.5 - camera[2]) / camera[0] * z, (i + 0.5 - camera[3]) / camera[1] * z
            answer.views[0], answer.pixels[0, 0], answer.pixels[0, 1] = 0, i, j
            agreeing, through = _ask(x, y, z, others, answer)
            own.fate[i, j] = TOO_FEW
            if agreeing < min_views:
                continue
            if 2 * through >= agreeing:
                own.fate[i, j] = SEEN_THROUGH
                continue
            if _narrowest(others.to_other, answer, agreeing) > max_cosine:
                own.fate[i, j] = NARROW
                continue
            first = filled
            filled = _use_pixels(own, others, answer, agreeing, seen, filled)
            enough = filled - first >= min_views
            _settle_all(own, others, answer, agreeing, enough)
            if not enough:
                filled = first
                continue
            counts[made], points[made] = filled - first, answer.mean
            made += 1
    return points[:made], counts[:made], seen.number[:filled], seen.uv[:filled]


@njit(cache=True, nogil=True)
def _use_pixels(own: _Own, others: _Others, answer: _Answer, agreeing: int, seen: _Seen, filled: int) -> int:
    """Mark the pixels that agree as used, and append a point's observations; returns the end of all observations."""
    height, width = own.depth.shape
    camera = others.camera
    x, y, z = answer.mean[0], answer.mean[1], answer.mean[2]
    for n in range(agreeing):
        k, row, column = answer.views[n], answer.pixels[n, 0], answer.pixels[n, 1]
        s, t, pz = x / z * camera[0] + camera[2], y / z * camera[1] + camera[3], z
        if k > 0:
            s, t, pz = _project(others.to_other[k - 1], x, y, z, camera)
            others.used[k - 1, row, column] = True
        else:
            own.used[row, column] = True
        if pz > 0.0 and 0.0 <= s < width - _RIM_OFF and 0.0 <= t < height - _RIM_OFF:
            seen.number[filled], seen.uv[filled, 0], seen.uv[filled, 1] = k, s, t
            filled += 1
    return filled


@njit(cache=True, nogil=True)
def _settle_all(own: _Own, others: _Others, answer: _Answer, agreeing: int, in_points: bool) -> None:
    """Record for all pixels that agree whether they are part of a point."""
    for n in range(agreeing):
        k = answer.views[n]
        _settle(own.fate if k == 0 else others.fates[k - 1], answer.pixels[n, 0], answer.pixels[n, 1], in_points)


@njit(cache=True, nogil=True)
def _settle(fate: U8, row: int, column: int, in_points: bool) -> None:
    """Record for a used pixel whether it is part of a point; a pixel that is part of one stays so."""
    if in_points:
        fate[row, column] = IN_POINTS
    elif fate[row, column] != IN_POINTS:
        fate[row, column] = TOO_FEW


@njit(cache=True, nogil=True)
def _ask(x: float, y: float, z: float, others: _Others, answer: _Answer) -> tuple[int, int]:
    """Compare a point with every view; returns how many agree, including the view itself, and how many contradict it.

    Fills in which views agree, at which row and column, and the mean position, weighted by each view's precision.
    """
    _, height, width = others.depths.shape
    camera, mean = others.camera, answer.mean
    total = 1.0 / (z * z)
    mean[0], mean[1], mean[2] = total * x, total * y, total * z
    agreeing, through = 1, 0
    for k in range(len(others.to_other)):
        turn = others.to_other[k]
        s, t, pz = _project(turn, x, y, z, camera)
        if pz <= 0.0 or not (0.0 <= s < width and 0.0 <= t < height):
            continue
        there = _depth_at(others.depths[k], s, t)
        if there > pz * (1.0 + _FREE_SPACE):
            through += 1
        if there <= 0.0 or abs(there - pz) > others.tolerance * pz:
            continue
        bx = (s - camera[2]) / camera[0] * there - turn[0, 3]
        by = (t - camera[3]) / camera[1] * there - turn[1, 3]
        bz = there - turn[2, 3]
        weight = 1.0 / (there * there)
        total += weight
        for axis in range(3):
            mean[axis] += weight * (turn[0, axis] * bx + turn[1, axis] * by + turn[2, axis] * bz)
        answer.views[agreeing], answer.pixels[agreeing, 0], answer.pixels[agreeing, 1] = k + 1, int(t), int(s)
        agreeing += 1
    for axis in range(3):
        mean[axis] /= total
    return agreeing, through


@njit(cache=True, nogil=True)
def _project(turn: F64, x: float, y: float, z: float, camera: F64) -> tuple[float, float, float]:
    """Project a point into another view: column, row [px], depth."""
    px = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + turn[0, 3]
    py = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + turn[1, 3]
    pz = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + turn[2, 3]
    if pz <= 0.0:
        return 0.0, 0.0, -1.0
    return px / pz * camera[0] + camera[2], py / pz * camera[1] + camera[3], pz


@njit(cache=True, nogil=True)
def _depth_at(depth: F32, s: float, t: float) -> float:
    """Interpolate a depth: bilinear in inverse depth if the four neighbors are one surface, else the nearest."""
    height, width = depth.shape
    u, v = s - 0.5, t - 0.5
    x, y = int(np.floor(u)), int(np.floor(v))
    if x >= 0 and x + 1 < width and y >= 0 and y + 1 < height:
        p, q, r, w = depth[y, x], depth[y, x + 1], depth[y + 1, x], depth[y + 1, x + 1]
        least, most = min(min(p, q), min(r, w)), max(max(p, q), max(r, w))
        if least > 0.0 and most - least <= _BLENDED * least:
            a, b = u - x, v - y
            return 1.0 / ((1 - b) * ((1 - a) / p + a / q) + b * ((1 - a) / r + a / w))
    return np.float64(depth[int(t), int(s)])


@njit(cache=True, nogil=True)
def _narrowest(to_other: F64, answer: _Answer, count: int) -> float:
    """Find the cosine of the widest angle between the rays of a point."""
    rays = np.empty((count, 3))
    for n in range(count):
        rays[n] = answer.mean
        if answer.views[n] > 0:
            turn = to_other[answer.views[n] - 1]
            for axis in range(3):  # the other's center in these axes is -R^T t
                rays[n, axis] += turn[0, axis] * turn[0, 3] + turn[1, axis] * turn[1, 3] + turn[2, axis] * turn[2, 3]
        length = np.sqrt(rays[n, 0] ** 2 + rays[n, 1] ** 2 + rays[n, 2] ** 2)
        for axis in range(3):
            rays[n, axis] /= length
    least = 1.0
    for n in range(count):
        for m in range(n):
            least = min(least, rays[n, 0] * rays[m, 0] + rays[n, 1] * rays[m, 1] + rays[n, 2] * rays[m, 2])
    return least


@njit(cache=True, nogil=True)
def _blend(counts: I64, seen: U8, uv: F32, normals: F32, colors: U8, turns: F64) -> tuple[F32, U8]:
    """Average normals (in the world's axes) and colors over the views of each point."""
    normal, color = np.empty((len(counts), 3), np.float32), np.empty((len(counts), 3), np.uint8)
    at = 0
    for row in range(len(counts)):
        n, c = np.zeros(3), np.zeros(3)
        for _ in range(counts[row]):
            k, x, y = seen[at], int(uv[at, 0]), int(uv[at, 1])
            for axis in range(3):
                c[axis] += colors[k, y, x, axis]
                for part in range(3):
                    n[axis] += turns[k, axis, part] * normals[k, y, x, part]
            at += 1
        length = np.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
        for axis in range(3):
            color[row, axis] = np.uint8(c[axis] / counts[row] + 0.5)
            normal[row, axis] = n[axis] / length if length > 0.0 else 0.0
    return normal, color
