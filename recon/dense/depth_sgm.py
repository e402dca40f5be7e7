"""Depth of one view by semi-global matching with several others; only depths on which they agree are kept.

Source: Hirschmueller, Stereo processing by semiglobal matching and mutual information (2008); the matching is OpenCV's.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.rectify import RectifiedPair, rectify, source_maps
from usd_schemas.pinhole import Pinhole

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
Mask = NDArray[np.bool_]

_AGREEING = 2  # sources that must give a pixel the same depth

_BLOCK = 3  # [px]
_SMALL_STEP, _LARGE_STEP = 8 * _BLOCK**2, 32 * _BLOCK**2  # penalties of a change of disparity, as OpenCV advises
_UNIQUE = 5  # [%] by which the best match must be better than the second
_BLAND = 1.0  # [gray levels] smallest standard deviation of a block: twice the effect of noise in a clear sky
_SPECKLE = 60  # [px] smaller connected regions of disparity are removed
_FINE = 16  # OpenCV's integer disparities count 1/16 px
_CUBE = 45_000_000  # images are split into strips so that no more than this many matching costs are in memory
_OVERLAP = 24  # [px] overlap of the strips on either side


@dataclass(frozen=True)
class PosedImage:
    """A working image and its pose.

    Attributes:
        gray: Gray values, shape (H, W), uint8.
        pose: camera_to_world [model units], shape (4, 4), float64.
    """

    gray: U8
    pose: F64


def measure_depth(
    reference: PosedImage,
    others: Sequence[PosedImage],
    camera: Pinhole,
    covered: Mask,
    reach: tuple[float, float],
    tolerance: float,
) -> F32:
    """Measure the depth of every pixel of a view.

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
    found, weights = [], []
    covered = covered & textured(reference.gray)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    for other in others:
        pair = rectify(camera, reference.pose, other.pose, *reach)
        if pair is None:
            continue
        disparity = match(reference.gray, other.gray, pair, camera)
        to_other = np.linalg.inv(other.pose) @ reference.pose
        found.append(depth_of_disparity(disparity, pair.left, _plane(pair), to_other, lens, covered))
        weights.append((pair.focal * pair.baseline) ** 2)
    if not found:
        return np.zeros(reference.gray.shape, np.float32)
    return consensus_depth(np.stack(found), np.array(weights), tolerance, min(_AGREEING, len(found)))


def textured(gray: U8) -> Mask:
    """Find the pixels with enough texture to be matched.

    Semi-global matching spreads a depth over any area without texture, above all the sky beside a bridge, and does so
    alike in every view: no later step can detect it. The rim of such an area is excluded too.

    Args:
        gray: Gray values, shape (H, W), uint8.

    Returns:
        Their mask, shape (H, W), bool.
    """
    level = gray.astype(np.float32)
    mean, square = (cv2.boxFilter(values, -1, (_BLOCK, _BLOCK)) for values in (level, level * level))
    bland = (square - mean * mean < _BLAND**2).astype(np.uint8)
    areas = cv2.morphologyEx(bland, cv2.MORPH_OPEN, np.ones((_BLOCK, _BLOCK), np.uint8))
    rim = cv2.dilate(areas, np.ones((_BLOCK, _BLOCK), np.uint8))
    return np.asarray((bland == 0) & (rim == 0))


def match(left: U8, right: U8, pair: RectifiedPair, camera: Pinhole) -> NDArray[np.int16]:
    """Match a rectified pair.

    Args:
        left: Working image of the reference, shape (H, W), uint8.
        right: Working image of the source, shape (H, W), uint8.
        pair: How to rectify them.
        camera: Working camera.

    Returns:
        Disparities [1/16 px], negative where nothing matches, shape (height, width) of the pair, int16.
    """
    images = [
        cv2.remap(image, *source_maps(pair, camera, right=is_right), cv2.INTER_CUBIC, None, cv2.BORDER_REPLICATE)
        for image, is_right in ((left, False), (right, True))
    ]
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=pair.disparities,
        blockSize=_BLOCK,
        P1=_SMALL_STEP,
        P2=_LARGE_STEP,
        disp12MaxDiff=1,
        preFilterCap=31,
        uniquenessRatio=_UNIQUE,
        speckleWindowSize=_SPECKLE,
        speckleRange=1,
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    width, height = pair.size
    strip = max(64, _CUBE // ((width - pair.disparities) * pair.disparities))
    found = np.full((height, width), -_FINE, np.int16)
    for begin in range(0, height, strip):
        first, last = max(0, begin - _OVERLAP), min(height, begin + strip + _OVERLAP)
        rows = matcher.compute(images[0][first:last], images[1][first:last])
        end = min(begin + strip, height)
        found[begin:end] = rows[begin - first : end - first]
    return found


def _plane(pair: RectifiedPair) -> F64:
    """Collect a pair's numbers for the compiled code, in the order of the argument `plane` of `depth_of_disparity`."""
    return np.array([pair.focal, *pair.left_center, pair.focal * pair.baseline, pair.infinity])


@njit(cache=True, nogil=True)
def depth_of_disparity(
    disparity: NDArray[np.int16], turn: F64, plane: F64, to_other: F64, camera: F64, covered: Mask
) -> F32:
    """Convert disparities of the rectified plane to depths of the view's own pixels.

    Args:
        disparity: Disparities [1/16 px], shape (H', W'), int16.
        turn: Rotation from the view's axes into the common ones [1], shape (3, 3), float64.
        plane: Focal length [px], center (x, y) [px], focal times baseline [px model units], disparity of infinity,
            negated [px], shape (5,), float64.
        to_other: Transform from the view into the source [model units], shape (4, 4), float64.
        camera: fx, fy, cx, cy of the working camera [px], shape (4,), float64.
        covered: Pixels of view and source that hold a picture, shape (H, W), bool.

    Returns:
        Planar depth, 0 where unknown or outside the source [model units], shape (H, W), float32.
    """
    rows, columns = disparity.shape
    height, width = covered.shape
    depth = np.zeros((height, width), np.float32)
    for i in range(height):
        for j in range(width):
            if not covered[i, j]:
                continue
            x, y = (j + 0.5 - camera[2]) / camera[0], (i + 0.5 - camera[3]) / camera[1]
            a = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2]
            b = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2]
            c = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2]
            if c < 1e-6:
                continue
            u, v = plane[0] * a / c + plane[1] - 0.5, plane[0] * b / c + plane[2] - 0.5
            d = _between(disparity, u, v, rows, columns)
            if d < 0.0 or d + plane[4] < 1e-3:
                continue
            z = plane[3] / (d + plane[4]) / c
            px = (to_other[0, 0] * x + to_other[0, 1] * y + to_other[0, 2]) * z + to_other[0, 3]
            py = (to_other[1, 0] * x + to_other[1, 1] * y + to_other[1, 2]) * z + to_other[1, 3]
            pz = (to_other[2, 0] * x + to_other[2, 1] * y + to_other[2, 2]) * z + to_other[2, 3]
            if pz <= 0.0:
                continue
            s, t = px / pz * camera[0] + camera[2], py / pz * camera[1] + camera[3]
            if 1.0 <= s <= width - 1.0 and 1.0 <= t <= height - 1.0 and covered[int(t), int(s)]:
                depth[i, j] = z
    return depth


@njit(cache=True, nogil=True)
def _between(disparity: NDArray[np.int16], u: float, v: float, rows: int, columns: int) -> float:
    """Interpolate a disparity [px]: bilinear if its four neighbors are one surface, else the nearest."""
    x, y = int(np.floor(u)), int(np.floor(v))
    if x < 0 or y < 0 or x + 1 >= columns or y + 1 >= rows:
        return -1.0
    p, q = disparity[y, x], disparity[y, x + 1]
    r, s = disparity[y + 1, x], disparity[y + 1, x + 1]
    least, most = min(min(p, q), min(r, s)), max(max(p, q), max(r, s))
    if least >= 0 and most - least <= 24:
        a, b = u - x, v - y
        return ((1 - b) * ((1 - a) * p + a * q) + b * ((1 - a) * r + a * s)) / 16.0
    nearest = disparity[int(np.floor(v + 0.5)), int(np.floor(u + 0.5))]
    return nearest / 16.0 if nearest >= 0 else -1.0


@njit(cache=True, nogil=True)
def consensus_depth(depths: F32, weights: F64, tolerance: float, least: int) -> F32:
    """Keep the depth that most sources agree on, as their weighted mean.

    A depth that only one source has is kept, and fusion decides: at the ends of a flight, and where the camera moves
    forwards, no second source sees it. Depths on which sources disagree are removed.

    Args:
        depths: Depths by each source, 0 where unknown [model units], shape (S, H, W), float32.
        weights: Precision of each source [px² model units²], shape (S,), float64; only their ratios count.
        tolerance: Largest difference, as a share of the depth [1].
        least: Sources that must agree.

    Returns:
        Depth, 0 where too few agree [model units], shape (H, W), float32.
    """
    count, height, width = depths.shape
    result = np.zeros((height, width), np.float32)
    for i in range(height):
        for j in range(width):
            best, known, best_weight, best_depth = 0, 0, 0.0, 0.0
            for p in range(count):
                middle = depths[p, i, j]
                if middle <= 0.0:
                    continue
                known += 1
                votes, total, mean = 0, 0.0, 0.0
                for q in range(count):
                    z = depths[q, i, j]
                    if z > 0.0 and abs(z - middle) <= tolerance * middle:
                        votes += 1
                        total += weights[q]
                        mean += weights[q] * z
                if votes > best or (votes == best and total > best_weight):
                    best, best_weight, best_depth = votes, total, mean / total
            if best >= least or known == 1:
                result[i, j] = best_depth
    return result
