"""Depth of one view by PatchMatch: a slanted plane for every pixel, propagated to neighbors and refined.

Semi-global matching needs a rectified pair and prefers surfaces facing the camera; PatchMatch compares slanted windows
in all sources at once, which is slower and more complete. Random numbers come from a hash of pixel and round, and
pixels of one color of a chessboard read only those of the other color, so that neither the order of work nor the
number of threads changes the result.

Source: Bleyer, Rhemann, Rother, PatchMatch Stereo (2011); the chessboard is from Galliani, Lasinger, Schindler,
Massively parallel multiview stereopsis by surface normal diffusion (2015).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.depth_sgm import PosedImage, measure_depth, textured
from recon.dense.smooth import smooth
from usd_schemas.pinhole import Pinhole

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
Mask = NDArray[np.bool_]

_RADIUS = 4  # [px] of the window
_STEP = 2  # [px] between its samples
_SIDE = 2 * _RADIUS // _STEP + 1
_SIMILAR = 14.0  # [gray levels] difference from the pixel at which a sample's weight is 1/e
_ROUNDS = 3
_WORST = 2.0  # cost of a plane that is visible in no source
_GOOD = 0.3  # 1 - correlation up to which a depth is accepted
_STEEP = 0.15  # [1] smallest cosine between normal and ray


def measure_slanted(
    reference: PosedImage,
    others: Sequence[PosedImage],
    camera: Pinhole,
    covered: Mask,
    reach: tuple[float, float],
    tolerance: float,
) -> F32:
    """Measure the depth of every pixel of a view, starting from the result of semi-global matching.

    Args:
        reference: The view.
        others: Its sources, best first.
        camera: Working camera of all of them.
        covered: Working pixels that hold a picture, shape (H, W), bool.
        reach: Smallest and largest depth to search [model units].
        tolerance: Difference of depths that still agree, as a share of the depth [1].

    Returns:
        Planar depth, 0 where nothing is known [model units], shape (H, W), float32.
    """
    if not others:
        return np.zeros(reference.gray.shape, np.float32)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    depth, normal = smooth(measure_depth(reference, others, camera, covered, reach, tolerance), lens)
    wanted = covered & textured(reference.gray)
    gray = reference.gray.astype(np.float32)
    sources = np.stack([other.gray for other in others]).astype(np.float32)
    to_other = np.stack([np.linalg.inv(other.pose) @ reference.pose for other in others])
    views = Views(sources, to_other, lens, 1.0 / reach[1], 1.0 / reach[0])
    cost = refine(gray, views, wanted, depth, normal)
    return np.where(wanted & (cost <= _GOOD), depth, 0.0).astype(np.float32)


class Views(NamedTuple):
    """The sources that planes are compared with.

    Attributes:
        sources: Gray values of the sources [of 255], shape (S, H, W), float32.
        to_other: Transforms from the view into each source [model units], shape (S, 4, 4), float64.
        lens: fx, fy, cx, cy of all cameras [px], shape (4,), float64.
        least: Smallest inverse depth that is searched [1 / model units].
        most: Largest [1 / model units].
    """

    sources: F32
    to_other: F64
    lens: F64
    least: float
    most: float


class _Window(NamedTuple):
    """The window about pixel (i, j): weight and value of each sample, shape (W,), and the weighted sum of squares."""

    i: int
    j: int
    weights: F64
    values: F64
    square: float


@njit(cache=True, nogil=True)
def refine(gray: F32, views: Views, wanted: Mask, depth: F32, normal: F32) -> F32:
    """Improve a plane for every pixel, in rounds over the two colors of a chessboard.

    Args:
        gray: Gray values of the view [of 255], shape (H, W), float32.
        views: Its sources.
        wanted: Pixels to work on, shape (H, W), bool.
        depth: Planar depth to start from, 0 where unknown [model units]; receives the result, shape (H, W), float32.
        normal: Unit normals in camera axes [1]; receives the result, shape (H, W, 3), float32.

    Returns:
        Cost of each pixel's plane: 1 - correlation [1], shape (H, W), float32.
    """
    height, width = gray.shape
    cost = np.full((height, width), np.float32(_WORST))
    weights, values = np.empty(_SIDE * _SIDE), np.empty(_SIDE * _SIDE)
    plane, trial = np.empty(4), np.empty(4)
    for turn in range(-1, 2 * _ROUNDS):  # the round before the first gives every pixel a plane
        for i in range(height):
            for j in range(width):
                if not wanted[i, j] or (turn >= 0 and (i + j + turn) % 2):
                    continue
                window = _Window(i, j, weights, values, _gather(gray, i, j, weights, values))
                if turn < 0:
                    _begin(plane, depth, normal, window, views)
                    best = _cost(views, window, plane)
                else:
                    _set(plane, 1.0 / depth[i, j], normal[i, j, 0], normal[i, j, 1], normal[i, j, 2])
                    best = np.float64(cost[i, j])
                    for di, dj in ((-1, 0), (1, 0), (0, -1), (0, 1), (-3, 0), (3, 0), (0, -3), (0, 3)):
                        y, x = i + di, j + dj
                        if 0 <= y < height and 0 <= x < width and wanted[y, x]:
                            carried = _carried(depth, normal, (y, x), (i, j), views.lens)
                            _set(trial, carried, normal[y, x, 0], normal[y, x, 1], normal[y, x, 2])
                            best = _better(views, window, trial, plane, best)
                    for way in range(3):
                        _vary(trial, plane, window, views, turn, way)
                        best = _better(views, window, trial, plane, best)
                depth[i, j], cost[i, j] = 1.0 / plane[0], best
                normal[i, j, 0], normal[i, j, 1], normal[i, j, 2] = plane[1], plane[2], plane[3]
    return cost


@njit(cache=True, nogil=True)
def _vary(trial: F64, plane: F64, window: _Window, views: Views, turn: int, way: int) -> None:
    """Write a plane a random step away, smaller in each round: in depth, in the normal, or in both."""
    reach = 0.5 ** (turn // 2 + 1)
    trial[:] = plane
    if way != 1:
        trial[0] *= 1.0 + 0.08 * reach * (2.0 * _draw(window.i, window.j, turn + 1, way) - 1.0)
    if way != 0:
        _tilt(trial, plane, 0.8 * reach, window.i, window.j, 10 * (turn + 1) + way)
    _face(trial, window.i, window.j, views.lens)


@njit(cache=True, nogil=True)
def _begin(plane: F64, depth: F32, normal: F32, window: _Window, views: Views) -> None:
    """Write the initial plane of a pixel: from the known depth and normal, or random."""
    i, j = window.i, window.j
    known = depth[i, j] > 0.0
    inverse = 1.0 / depth[i, j] if known else views.least + (views.most - views.least) * _draw(i, j, 0, 0)
    _set(plane, inverse, normal[i, j, 0], normal[i, j, 1], normal[i, j, 2])
    if not known:
        _tilt(plane, plane, 1.0, i, j, 0)
    _face(plane, i, j, views.lens)


@njit(cache=True, nogil=True)
def _set(plane: F64, inverse: float, x: float, y: float, z: float) -> None:
    """Write a plane: inverse depth at its pixel, and its normal."""
    plane[0], plane[1], plane[2], plane[3] = inverse, x, y, z


@njit(cache=True, nogil=True)
def _better(views: Views, window: _Window, trial: F64, plane: F64, best: float) -> float:
    """Keep a trial plane if its cost is lower; returns the cost of the plane kept."""
    if not views.least <= trial[0] <= views.most:
        return best
    found = _cost(views, window, trial)
    if found < best:
        plane[:] = trial
        return found
    return best


@njit(cache=True, nogil=True)
def _gather(gray: F32, i: int, j: int, weights: F64, values: F64) -> float:
    """Read the window about a pixel, less its weighted mean; returns the weighted sum of its squares."""
    height, width = gray.shape
    total, mean, at = 0.0, 0.0, 0
    for di in range(-_RADIUS, _RADIUS + 1, _STEP):
        for dj in range(-_RADIUS, _RADIUS + 1, _STEP):
            y, x = min(max(i + di, 0), height - 1), min(max(j + dj, 0), width - 1)
            values[at] = gray[y, x]
            weights[at] = np.exp(-abs(gray[y, x] - gray[i, j]) / _SIMILAR)
            total, mean = total + weights[at], mean + weights[at] * values[at]
            at += 1
    mean, square = mean / total, 0.0
    for at in range(_SIDE * _SIDE):
        weights[at] /= total
        values[at] -= mean
        square += weights[at] * values[at] * values[at]
    return square


@njit(cache=True, nogil=True)
def _cost(views: Views, window: _Window, plane: F64) -> float:
    """Compare the window with the best sources through the plane: 1 - weighted correlation."""
    x, y = _ray(window, views.lens)
    facing = plane[1] * x + plane[2] * y + plane[3]
    if facing > -1e-3:
        return _WORST
    first = second = _WORST
    for source in range(len(views.sources)):
        cost = _correlate(views, source, window, plane, plane[0] / facing)
        if cost < first:
            first, second = cost, first
        elif cost < second:
            second = cost
    return first if len(views.sources) == 1 else 0.5 * (first + second)


@njit(cache=True, nogil=True)
def _ray(window: _Window, lens: F64) -> tuple[float, float]:
    """Find the ray of the window's pixel: where it cuts the plane at depth 1."""
    return (window.j + 0.5 - lens[2]) / lens[0], (window.i + 0.5 - lens[3]) / lens[1]


@njit(cache=True, nogil=True)
def _correlate(views: Views, source: int, window: _Window, plane: F64, scale: float) -> float:
    """Compare the window with one source through the plane's homography (R + t n^T / d)."""
    image, turn, lens = views.sources[source], views.to_other[source], views.lens
    weights, values = window.weights, window.values
    x, y = _ray(window, lens)
    height, width = image.shape
    dx, dy = _STEP / lens[0], _STEP / lens[1]
    h = np.empty((3, 3))
    for row in range(3):
        for column in range(3):
            h[row, column] = turn[row, column] + turn[row, 3] * plane[1 + column] * scale
    mean = cross = total = 0.0
    at = 0
    for m in range(_SIDE):
        b = y + (m - _SIDE // 2) * dy
        for n in range(_SIDE):
            a = x + (n - _SIDE // 2) * dx
            depth = h[2, 0] * a + h[2, 1] * b + h[2, 2]
            if depth <= 1e-9:
                return _WORST
            u = (h[0, 0] * a + h[0, 1] * b + h[0, 2]) / depth * lens[0] + lens[2] - 0.5
            v = (h[1, 0] * a + h[1, 1] * b + h[1, 2]) / depth * lens[1] + lens[3] - 0.5
            if not (0.0 <= u < width - 1 and 0.0 <= v < height - 1):
                return _WORST
            p, q = int(u), int(v)
            f, g = u - p, v - q
            value = (1 - g) * ((1 - f) * image[q, p] + f * image[q, p + 1]) + g * (
                (1 - f) * image[q + 1, p] + f * image[q + 1, p + 1]
            )
            mean += weights[at] * value
            total += weights[at] * value * value
            cross += weights[at] * value * values[at]
            at += 1
    spread = (total - mean * mean) * window.square
    if spread <= 1e-3:
        return _WORST
    return 1.0 - cross / np.sqrt(spread)  # the window's own mean is zero


@njit(cache=True, nogil=True)
def _carried(depth: F32, normal: F32, neighbor: tuple[int, int], pixel: tuple[int, int], lens: F64) -> float:
    """Extend a neighbor's plane to a pixel: its inverse depth there."""
    (y, x), (i, j) = neighbor, pixel
    a, b, c = normal[y, x, 0], normal[y, x, 1], normal[y, x, 2]
    there = a * (x + 0.5 - lens[2]) / lens[0] + b * (y + 0.5 - lens[3]) / lens[1] + c
    here = a * (j + 0.5 - lens[2]) / lens[0] + b * (i + 0.5 - lens[3]) / lens[1] + c
    return here / (there * depth[y, x])


@njit(cache=True, nogil=True)
def _tilt(plane: F64, former: F64, reach: float, i: int, j: int, number: int) -> None:
    """Turn a normal by a random step."""
    length = 0.0
    for axis in range(3):
        plane[1 + axis] = former[1 + axis] + reach * (2.0 * _draw(i, j, number, 5 + axis) - 1.0)
        length += plane[1 + axis] ** 2
    for axis in range(3):
        plane[1 + axis] /= np.sqrt(max(length, 1e-12))


@njit(cache=True, nogil=True)
def _face(plane: F64, i: int, j: int, lens: F64) -> None:
    """Turn a normal towards the camera if it points away from it or is perpendicular to the ray."""
    x, y = (j + 0.5 - lens[2]) / lens[0], (i + 0.5 - lens[3]) / lens[1]
    ray = np.sqrt(x * x + y * y + 1.0)
    cosine = (plane[1] * x + plane[2] * y + plane[3]) / ray
    if cosine > 0.0:
        plane[1], plane[2], plane[3], cosine = -plane[1], -plane[2], -plane[3], -cosine
    if cosine > -_STEEP:
        more = (-_STEEP - cosine) / ray
        a, b, c = plane[1] + more * x, plane[2] + more * y, plane[3] + more
        length = np.sqrt(a * a + b * b + c * c)
        plane[1], plane[2], plane[3] = a / length, b / length, c / length


@njit(cache=True, nogil=True)
def _draw(i: int, j: int, number: int, which: int) -> float:
    """Draw a number from 0 to 1 by hashing pixel and round: it does not depend on earlier draws.

    Source: the finalizer of MurmurHash3 (Appleby, public domain), applied twice.
    """
    key = np.uint64(i) * np.uint64(73856093) + np.uint64(j) * np.uint64(19349663)
    key += np.uint64(number) * np.uint64(83492791) + np.uint64(which) * np.uint64(2654435761)
    for _ in range(2):
        key ^= key >> np.uint64(33)
        key *= np.uint64(0xFF51AFD7ED558CCD)
        key ^= key >> np.uint64(33)
        key *= np.uint64(0xC4CEB9FE1A85EC53)
        key ^= key >> np.uint64(33)
    return np.float64(key >> np.uint64(11)) / 9007199254740992.0
