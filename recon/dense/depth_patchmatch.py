"""Depth of one view by PatchMatch: a slanted plane for every pixel, handed on between neighbours and tried anew.

Where semi-global matching needs a rectified pair and likes walls that face the camera, this compares slanted windows in
all sources at once: slower, and more complete. Draws come from a hash of pixel and round, and all pixels of one colour
of a chessboard look at the other colour only, so that no order of work and no number of threads changes a bit.

Source: Bleyer, Rhemann, Rother, PatchMatch Stereo (2011); the chessboard is from Galliani, Lasinger, Schindler,
Massively parallel multiview stereopsis by surface normal diffusion (2015).
"""

from collections.abc import Sequence

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
_SIMILAR = 14.0  # [grey levels] in which a sample's weight falls to 1/e
_ROUNDS = 3
_WORST = 2.0  # cost of what no source sees
_GOOD = 0.3  # 1 - correlation up to which a depth is believed
_STEEP = 0.15  # [1] smallest cosine between normal and ray


def measure_slanted(
    reference: PosedImage,
    others: Sequence[PosedImage],
    camera: Pinhole,
    covered: Mask,
    reach: tuple[float, float],
    tolerance: float,
) -> F32:
    """Measure the depth of every pixel of a view, starting from what semi-global matching finds.

    Args:
        reference: The view.
        others: Its sources, best first.
        camera: Working camera of all of them.
        covered: Working pixels that hold a picture, shape (H, W), bool.
        reach: Smallest and largest depth to look for.
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
    cost = refine(gray, sources, to_other, lens, wanted, 1.0 / reach[1], 1.0 / reach[0], depth, normal)
    return np.where(wanted & (cost <= _GOOD), depth, 0.0).astype(np.float32)


@njit(cache=True, nogil=True)
def refine(
    gray: F32, sources: F32, to_other: F64, lens: F64, wanted: Mask, least: float, most: float, depth: F32, normal: F32
) -> F32:
    """Improve a plane for every pixel, in rounds over the two colours of a chessboard.

    Args:
        gray: Grey values of the view, shape (H, W), float32.
        sources: Grey values of the sources, shape (S, H, W), float32.
        to_other: Transforms from the view into each source, shape (S, 4, 4), float64.
        lens: fx, fy, cx, cy [px], shape (4,), float64.
        wanted: Pixels to work on, shape (H, W), bool.
        least: Smallest inverse depth.
        most: Largest inverse depth.
        depth: Planar depth to start from, 0 where unknown [model units]; receives the result, shape (H, W), float32.
        normal: Unit normals in camera axes; receives the result, shape (H, W, 3), float32.

    Returns:
        Cost of each pixel's plane: 1 - correlation, shape (H, W), float32.
    """
    height, width = gray.shape
    cost = np.full((height, width), np.float32(_WORST))
    weights, window, costs = np.empty(_SIDE * _SIDE), np.empty(_SIDE * _SIDE), np.empty(len(sources))
    plane, trial = np.empty(4), np.empty(4)
    for turn in range(-1, 2 * _ROUNDS):  # the turn before the first gives every pixel a plane
        for i in range(height):
            for j in range(width):
                if not wanted[i, j] or (turn >= 0 and (i + j + turn) % 2):
                    continue
                count = _gather(gray, i, j, weights, window)
                if turn < 0:
                    _begin(plane, depth, normal, i, j, least, most)
                    _face(plane, i, j, lens)
                    best = _cost(sources, to_other, lens, i, j, plane, weights, window, count, costs)
                else:
                    _set(plane, 1.0 / depth[i, j], normal[i, j, 0], normal[i, j, 1], normal[i, j, 2])
                    best = np.float64(cost[i, j])
                    for di, dj in ((-1, 0), (1, 0), (0, -1), (0, 1), (-3, 0), (3, 0), (0, -3), (0, 3)):
                        y, x = i + di, j + dj
                        if not (0 <= y < height and 0 <= x < width) or not wanted[y, x]:
                            continue
                        _set(
                            trial,
                            _carried(depth, normal, y, x, i, j, lens),
                            normal[y, x, 0],
                            normal[y, x, 1],
                            normal[y, x, 2],
                        )
                        best = _better(
                            sources,
                            to_other,
                            lens,
                            i,
                            j,
                            trial,
                            weights,
                            window,
                            count,
                            costs,
                            plane,
                            best,
                            least,
                            most,
                        )
                    reach = 0.5 ** (turn // 2 + 1)
                    for way in range(3):
                        trial[:] = plane
                        if way != 1:
                            trial[0] *= 1.0 + 0.08 * reach * (2.0 * _draw(i, j, turn + 1, way) - 1.0)
                        if way != 0:
                            _tilt(trial, plane, 0.8 * reach, i, j, 10 * (turn + 1) + way)
                        _face(trial, i, j, lens)
                        best = _better(
                            sources,
                            to_other,
                            lens,
                            i,
                            j,
                            trial,
                            weights,
                            window,
                            count,
                            costs,
                            plane,
                            best,
                            least,
                            most,
                        )
                depth[i, j], cost[i, j] = 1.0 / plane[0], best
                normal[i, j, 0], normal[i, j, 1], normal[i, j, 2] = plane[1], plane[2], plane[3]
    return cost


@njit(cache=True, nogil=True)
def _begin(plane: F64, depth: F32, normal: F32, i: int, j: int, least: float, most: float) -> None:
    """Write the plane that a pixel starts with: what is known of it, or a draw."""
    known = depth[i, j] > 0.0
    inverse = 1.0 / depth[i, j] if known else least + (most - least) * _draw(i, j, 0, 0)
    _set(plane, inverse, normal[i, j, 0], normal[i, j, 1], normal[i, j, 2])
    if not known:
        _tilt(plane, plane, 1.0, i, j, 0)


@njit(cache=True, nogil=True)
def _set(plane: F64, inverse: float, x: float, y: float, z: float) -> None:
    """Write a plane: inverse depth at its pixel, and its normal."""
    plane[0], plane[1], plane[2], plane[3] = inverse, x, y, z


@njit(cache=True, nogil=True)
def _better(
    sources: F32,
    to_other: F64,
    lens: F64,
    i: int,
    j: int,
    trial: F64,
    weights: F64,
    window: F64,
    count: float,
    costs: F64,
    plane: F64,
    best: float,
    least: float,
    most: float,
) -> float:
    """Take a trial plane over where it costs less; returns the cost of the plane that stays."""
    if not least <= trial[0] <= most:
        return best
    found = _cost(sources, to_other, lens, i, j, trial, weights, window, count, costs)
    if found < best:
        plane[:] = trial
        return found
    return best


@njit(cache=True, nogil=True)
def _gather(gray: F32, i: int, j: int, weights: F64, window: F64) -> float:
    """Read the window about a pixel, less its weighted mean; returns the weighted sum of its squares."""
    height, width = gray.shape
    total, mean, at = 0.0, 0.0, 0
    for di in range(-_RADIUS, _RADIUS + 1, _STEP):
        for dj in range(-_RADIUS, _RADIUS + 1, _STEP):
            y, x = min(max(i + di, 0), height - 1), min(max(j + dj, 0), width - 1)
            window[at] = gray[y, x]
            weights[at] = np.exp(-abs(gray[y, x] - gray[i, j]) / _SIMILAR)
            total, mean = total + weights[at], mean + weights[at] * window[at]
            at += 1
    mean, square = mean / total, 0.0
    for at in range(_SIDE * _SIDE):
        weights[at] /= total
        window[at] -= mean
        square += weights[at] * window[at] * window[at]
    return square


@njit(cache=True, nogil=True)
def _cost(
    sources: F32,
    to_other: F64,
    lens: F64,
    i: int,
    j: int,
    plane: F64,
    weights: F64,
    window: F64,
    square: float,
    costs: F64,
) -> float:
    """Compare the window with what the best sources show of the plane: 1 - weighted correlation."""
    x, y = (j + 0.5 - lens[2]) / lens[0], (i + 0.5 - lens[3]) / lens[1]
    facing = plane[1] * x + plane[2] * y + plane[3]
    if facing > -1e-3:
        return _WORST
    for s in range(len(sources)):
        costs[s] = _correlate(sources[s], to_other[s], lens, x, y, plane, plane[0] / facing, weights, window, square)
    first = second = _WORST
    for s in range(len(sources)):
        if costs[s] < first:
            first, second = costs[s], first
        elif costs[s] < second:
            second = costs[s]
    return first if len(sources) == 1 else 0.5 * (first + second)


@njit(cache=True, nogil=True)
def _correlate(
    image: F32,
    turn: F64,
    lens: F64,
    x: float,
    y: float,
    plane: F64,
    scale: float,
    weights: F64,
    window: F64,
    square: float,
) -> float:
    """Compare the window with one source through the plane's homography (R + t n^T / d)."""
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
            cross += weights[at] * value * window[at]
            at += 1
    spread = (total - mean * mean) * square
    if spread <= 1e-3:
        return _WORST
    return 1.0 - cross / np.sqrt(spread)  # the window's own mean is zero


@njit(cache=True, nogil=True)
def _carried(depth: F32, normal: F32, y: int, x: int, i: int, j: int, lens: F64) -> float:
    """Carry a neighbour's plane to a pixel: its inverse depth there."""
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
    """Turn a normal towards the camera where it looks away, or along the ray."""
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
    """Draw from 0 to 1 by hashing where and when: the same whatever was drawn before.

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
