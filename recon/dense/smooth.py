"""Prepare a depth map for fusion: remove rims, smooth depths, and find the surface normal at every pixel."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_RADIUS = 2  # [px] of the window to which a plane is fitted
_SAME_SURFACE = 0.03  # [1] neighbors whose inverse depths differ by more belong to another surface
_MIN_FIT = 8  # least number of pixels of a plane fit
_STEP = 0.04  # [1] share of the depth by which the surface behind an edge is farther
_RIM = 2  # [px] by which matching extends a surface over the background


@njit(cache=True, nogil=True)
def smooth(depth: F32, camera: F64) -> tuple[F32, F32]:
    """Fit a plane to the inverse depth around each pixel: a smoother depth, and the surface normal.

    Inverse depth is linear in the pixel on any plane, whatever its slope.

    Args:
        depth: Planar depth, 0 where unknown [model units], shape (H, W), float32.
        camera: fx, fy, cx, cy [px], shape (4,), float64.

    Returns:
        Depth, 0 where it was, on rims, and where no plane fits [model units], shape (H, W), float32; unit normals in
        camera axes, towards the camera, shape (H, W, 3), float32.
    """
    height, width = depth.shape
    steady, normal = np.zeros((height, width), np.float32), np.zeros((height, width, 3), np.float32)
    for i in range(height):
        for j in range(width):
            z = depth[i, j]
            if z <= 0.0:
                continue
            if _at_edge(depth, i, j):
                continue
            n = sx = sy = sxx = sxy = syy = sr = sxr = syr = 0.0
            for y in range(max(0, i - _RADIUS), min(height, i + _RADIUS + 1)):
                for x in range(max(0, j - _RADIUS), min(width, j + _RADIUS + 1)):
                    if depth[y, x] <= 0.0:
                        continue
                    r = z / depth[y, x] - 1.0
                    if abs(r) > _SAME_SURFACE:
                        continue
                    dx, dy = x - j, y - i
                    n += 1.0
                    sx, sy, sr = sx + dx, sy + dy, sr + r
                    sxx, sxy, syy = sxx + dx * dx, sxy + dx * dy, syy + dy * dy
                    sxr, syr = sxr + dx * r, syr + dy * r
            if n < _MIN_FIT:
                continue
            xx, xy, yy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
            xr, yr = sxr - sx * sr / n, syr - sy * sr / n
            area = xx * yy - xy * xy
            if area < 1.0:
                continue
            a, b = (yy * xr - xy * yr) / area, (xx * yr - xy * xr) / area
            c = (sr - a * sx - b * sy) / n
            if c <= -0.5:
                continue
            steady[i, j] = z / (1.0 + c)
            nx, ny = a * camera[0], b * camera[1]
            nz = 1.0 + c - a * (j + 0.5 - camera[2]) - b * (i + 0.5 - camera[3])
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            normal[i, j, 0], normal[i, j, 1], normal[i, j, 2] = -nx / length, -ny / length, -nz / length
    return steady, normal


@njit(cache=True, nogil=True)
def _at_edge(depth: F32, i: int, j: int) -> bool:
    """Tell whether a pixel lies on a surface's rim, which matching extends over the background.

    If a part is so thin that all of it is rim, its middle is kept, so that hangers do not vanish.
    """
    for di, dj in ((0, 1), (1, 0)):
        after, before = _steps(depth, i, j, di, dj), _steps(depth, i, j, -di, -dj)
        if min(after, before) <= _RIM and abs(after - before) > 1:
            return True
    return False


@njit(cache=True, nogil=True)
def _steps(depth: F32, i: int, j: int, di: int, dj: int) -> int:
    """Count the pixels to where a farther surface begins, up to twice the rim; four times the rim if none begins.

    It must be farther than the pixel's own surface, whose inverse depth is extrapolated from the other side.
    """
    height, width = depth.shape
    here = 1.0 / depth[i, j]
    for step in range(1, 2 * _RIM + 1):
        y, x = i + step * di, j + step * dj
        if not (0 <= y < height and 0 <= x < width):
            break
        if depth[y, x] <= 0.0:
            continue
        behind, v, u = here, i - step * di, j - step * dj
        if 0 <= v < height and 0 <= u < width and depth[v, u] > 0.0:
            behind = 1.0 / depth[v, u]
        if 1.0 / depth[y, x] < here - max(behind - here, 0.0) - _STEP * here:
            return step
    return 4 * _RIM
