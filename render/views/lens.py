"""Lens distortion: a wider view without distortion is drawn, and every pixel of the image is looked up in it.

The photograph is resampled, the truth is not: the distorted ray of each pixel is intersected in double precision with
the triangles that the wider view shows around its position, and the nearest one gives id, depth and normal. Nothing is
blended across an edge.
"""

from copy import copy
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.views.adjacency import edge_neighbors
from render.views.targets import View
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import ALIKE, FlatScene
from usd_schemas.pinhole import Pinhole

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U16 = NDArray[np.uint16]
U32 = NDArray[np.uint32]

_MARGIN = 3  # [px] around the wider view
_FINEST = (5, 4, 3, 2)  # finer pixels per pixel, along rows and columns: railings are thinner than a pixel
_MOST_FINE = 24_000_000  # finer pixels of one view; each takes 16 bytes
_SMALL = 4.0  # [px^2] a ray may have missed a smaller triangle and hit its neighbor
Window = tuple[int, int]
Index = int | np.int64


class Geometry(NamedTuple):  # numba reads these, and no data classes
    """The triangles for ray intersection, in the layout of the kernel.

    Attributes:
        positions: Mesh-local positions [m], shape (V, 3), float32.
        normals: Mesh-local normals [1], shape (V, 3), float32.
        triangles: Vertex numbers, shape (T, 3), uint32.
        first: First triangle of each draw, shape (D,), int64.
        transform: Mesh to world [m], shape (D, 4, 4), float64.
        cofactor: Cofactors that transform each draw's normals [1], shape (D, 3, 3), float64.
        mirrored: Whether a draw is mirrored, shape (D,), bool.
        alike: Whether both sides of a draw are lit alike, shape (D,), bool.
        cut_out: Whether a draw has holes in its texture, shape (D,), bool.
        neighbors: Triangles that share an edge, counted within the part, shape (T, 3), int32.
    """

    positions: F32
    normals: F32
    triangles: U32
    first: NDArray[np.int64]
    transform: F64
    cofactor: F64
    mirrored: NDArray[np.bool_]
    alike: NDArray[np.bool_]
    cut_out: NDArray[np.bool_]
    neighbors: NDArray[np.int32]


def ray_geometry(scene: FlatScene, cut_out: NDArray[np.bool_]) -> Geometry:
    """Convert a scene to the kernel's layout.

    Args:
        scene: A scene.
        cut_out: Whether each draw has holes in its texture, shape (D,), bool.
    """
    geometry, draws = scene.geometry, scene.draws
    linear = draws.transform[:, :3, :3]
    mirrored = np.linalg.det(linear) < 0
    cofactor = np.cross(np.roll(linear, -1, axis=1), np.roll(linear, -2, axis=1))
    cofactor /= np.maximum(np.abs(cofactor).max(axis=(1, 2), keepdims=True), 1e-300)
    cofactor *= np.where(mirrored, -1.0, 1.0)[:, None, None]
    return Geometry(
        geometry.positions,
        geometry.normals,
        geometry.triangles,
        geometry.part_first.astype(np.int64)[draws.part],
        draws.transform,
        cofactor,
        mirrored,
        geometry.part_double_sided[draws.part] == ALIKE,
        cut_out,
        edge_neighbors(geometry),
    )


class _Wider(NamedTuple):
    """A wider view, and the positions of a lens's pixels in it, in the kernel's layout."""

    draw: U32  # its finer pixels
    triangle: U32
    place: F64  # of each pixel of the lens's image, among the finer ones
    rays: F64
    near: float  # [m]
    around: int  # finer pixels along the square about a place whose triangles a ray may meet
    focal: float  # [px^2] of the finer pixels


class Lens:
    """A distorted camera: the wider view that it needs, and the image made from it."""

    def meeting(self, geometry: Geometry) -> "Lens":
        """Return the same lens with the geometry of another moment of the scene.

        Args:
            geometry: Triangles that rays may hit.
        """
        other = copy(self)
        other._geometry = geometry
        return other

    def __init__(self, camera: Pinhole, distortion: Distortion, geometry: Geometry, *, normals: bool) -> None:
        """Find each pixel's position in the wider view.

        Args:
            camera: Intrinsics of the distorted image.
            distortion: Distortion of the lens.
            geometry: Triangles that rays may hit.
            normals: Whether normals are needed.

        Raises:
            InputError: The distortion has no inverse inside the image.
        """
        self._geometry, self._normals = geometry, normals
        rows, columns = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
        bent = np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy], axis=-1)
        rays = distortion.undistort(bent)
        place = rays * [camera.fx, camera.fy]
        low = np.floor(place.min(axis=(0, 1))).astype(int) - _MARGIN
        high = np.ceil(place.max(axis=(0, 1))).astype(int) + _MARGIN
        width, height = (high - low).tolist()
        self.wide = Pinhole(width, height, camera.fx, camera.fy, float(-low[0]), float(-low[1]))
        self.finer = next((n for n in _FINEST if n * n * width * height <= _MOST_FINE), _FINEST[-1])
        self._rays, self._place = rays, place - low

    def window(self, band: Window) -> Window:
        """Find the rows of the wider view that a band of the image needs.

        Args:
            band: First row of the image and the row after the last.
        """
        rows = self._place[band[0] : band[1], :, 1]
        return max(int(rows.min()) - 2, 0), min(int(rows.max()) + 3, self.wide.height)

    def look(self, views: list[View], poses: F64, bands: tuple[Window, ...], near: float) -> View:
        """Make the image of a distorted lens from wider views.

        Args:
            views: The window of each band.
            poses: Camera pose of each band [m], shape (B, 4, 4), float64.
            bands: First row of each band of the image and the row after its last.
            near: Near plane [m].
        """
        shape = self._rays.shape[:2]
        code = np.empty((*shape, 3), np.uint16)
        draw, depth = np.empty(shape, np.uint32), np.empty(shape, np.float32)
        normal = np.zeros((*shape, 3) if self._normals else (1, 1, 3), np.float32)
        for view, pose, band in zip(views, poses, bands, strict=True):
            top, (first, end) = self.window(band)[0], band
            rows = slice(first, end)
            place = self._place[rows] - [0.0, top]
            code[rows] = _resample(view.code, place)
            assert view.triangle is not None
            focal = self.wide.fx * self.wide.fy * self.finer**2
            around, rays = 2 * self.finer + 1, self._rays[rows]
            wider = _Wider(view.draw, view.triangle, self.finer * place, rays, near, around, focal)
            seen, met = self._from_camera(pose), normal[rows] if self._normals else normal
            _meet(wider, seen, draw[rows], depth[rows], met, self._normals)
        return View(code, draw, depth, normal if self._normals else None)

    def _from_camera(self, pose: F64) -> Geometry:
        """Transform the geometry to the camera's coordinates."""
        geometry = self._geometry
        linear = pose[:3, :3].T @ geometry.transform[:, :3, :3]
        shift = (geometry.transform[:, :3, 3] - pose[:3, 3]) @ pose[:3, :3]
        seen = np.concatenate([linear, shift[:, :, None]], axis=2)
        return geometry._replace(transform=np.ascontiguousarray(seen))


def _resample(code: U16, place: F64) -> U16:
    """Look the photograph up between pixels; a cubic interpolation keeps the sharpness of a lens."""
    across, down = (np.ascontiguousarray(place[..., axis] - 0.5, np.float32) for axis in (0, 1))
    image = np.ascontiguousarray(code)
    found = cv2.remap(image, across, down, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return found.astype(np.uint16, copy=False)


@njit(cache=True, nogil=True)
def _meet(wider: _Wider, seen: Geometry, draw_out: U32, depth_out: F32, normal_out: F32, wants_normals: bool) -> None:
    """Intersect the ray of each pixel with the triangles in the square of finer pixels around its position."""
    height, width = wider.draw.shape
    around, near = wider.around, wider.near
    corners, known, chosen = np.empty((3, 3)), np.empty((4 * around * around, 2), np.int64), np.empty(3)
    for row in range(wider.place.shape[0]):
        for column in range(wider.place.shape[1]):
            x, y = wider.rays[row, column, 0], wider.rays[row, column, 1]
            left = min(max(int(wider.place[row, column, 0]), 0), width - 1)
            top = min(max(int(wider.place[row, column, 1]), 0), height - 1)
            count, sky = _candidates(known, wider, seen, left, top)
            best, best_draw, best_part = np.inf, 0, 0
            for number in range(count):
                draw, part = known[number]
                _corners(corners, seen, draw, part)
                depth, inside, a, b, c = _hit(corners, x, y)
                if (inside or seen.cut_out[draw - 1]) and near <= depth < best:
                    best, best_draw, best_part = depth, draw, part
                    chosen[0], chosen[1], chosen[2] = a, b, c
            if best_draw == 0 and wider.draw[top, left] != 0:
                draw, part = np.int64(wider.draw[top, left]), np.int64(wider.triangle[top, left])
                _corners(corners, seen, draw, part)
                if not (sky and _area(corners, near) * wider.focal > _SMALL):
                    best, best_draw, best_part = _beside(corners, x, y), draw, part
                    chosen[:] = 1.0 / 3.0
            draw_out[row, column], depth_out[row, column] = best_draw, best
            if wants_normals and best_draw != 0:
                _corners(corners, seen, best_draw, best_part)
                flip = _faces_away(corners, x, y) != seen.mirrored[best_draw - 1]
                flip = flip and not seen.alike[best_draw - 1]
                _normal(normal_out[row, column], seen, best_draw, best_part, chosen, flip)


@njit(cache=True, nogil=True)
def _candidates(known: NDArray[np.int64], wider: _Wider, seen: Geometry, left: int, top: int) -> tuple[int, bool]:
    """List the triangles that the pixels around show, the middle one's first, and then their neighbors."""
    height, width = wider.draw.shape
    around, cut_out = wider.around, seen.cut_out
    count, sky = 0, False
    for step in range(around * around):
        shift = (around * around // 2 + step) % (around * around)
        down = min(max(top + shift // around - around // 2, 0), height - 1)
        across = min(max(left + shift % around - around // 2, 0), width - 1)
        draw = np.int64(wider.draw[down, across])
        sky = sky or draw == 0
        if draw == 0 or (step > 0 and cut_out[draw - 1]):
            continue
        count = _add(known, count, draw, np.int64(wider.triangle[down, across]))
    if count <= 1 and not sky:
        return count, sky
    for number in range(count):
        draw, part = known[number]
        if not cut_out[draw - 1]:
            for edge in range(3):
                beside = np.int64(seen.neighbors[seen.first[draw - 1] + part, edge])
                if beside >= 0:
                    count = _add(known, count, draw, beside)
    return count, sky


@njit(cache=True, nogil=True)
def _add(known: NDArray[np.int64], count: int, draw: Index, part: Index) -> int:
    for other in range(count):
        if known[other, 0] == draw and known[other, 1] == part:
            return count
    known[count, 0], known[count, 1] = draw, part
    return count + 1


@njit(cache=True, nogil=True)
def _corners(corners: F64, seen: Geometry, draw: Index, part: Index) -> None:
    """Fill in the corners of a triangle of a draw as the camera sees them, shape (3, 3)."""
    positions, transform = seen.positions, seen.transform[draw - 1]
    for corner in range(3):
        vertex = seen.triangles[seen.first[draw - 1] + part, corner]
        x, y, z = np.float64(positions[vertex, 0]), np.float64(positions[vertex, 1]), np.float64(positions[vertex, 2])
        for axis in range(3):
            corners[corner, axis] = (
                transform[axis, 0] * x + transform[axis, 1] * y + transform[axis, 2] * z + transform[axis, 3]
            )


@njit(cache=True, nogil=True)
def _volume(a: F64, b: F64, x: float, y: float) -> float:
    """Compute the volume between the ray (x, y, 1) and two corners; its sign tells on which side it passes."""
    return x * (a[1] * b[2] - a[2] * b[1]) + y * (a[2] * b[0] - a[0] * b[2]) + (a[0] * b[1] - a[1] * b[0])


@njit(cache=True, nogil=True)
def _hit(corners: F64, x: float, y: float) -> tuple[float, bool, float, float, float]:
    """Depth at which the ray meets the triangle's plane, whether inside it, and the weights of its corners there."""
    a, b, c = (
        _volume(corners[1], corners[2], x, y),
        _volume(corners[2], corners[0], x, y),
        _volume(corners[0], corners[1], x, y),
    )
    total = a + b + c
    if total == 0.0:
        return np.nan, False, 0.0, 0.0, 0.0
    a, b, c = a / total, b / total, c / total
    return a * corners[0, 2] + b * corners[1, 2] + c * corners[2, 2], a >= 0 and b >= 0 and c >= 0, a, b, c


@njit(cache=True, nogil=True)
def _beside(corners: F64, x: float, y: float) -> float:
    """Depth of a ray that passes just beside a triangle: that of its plane, within the range of its corners."""
    depth = _hit(corners, x, y)[0]
    low, high = min(corners[0, 2], corners[1, 2], corners[2, 2]), max(corners[0, 2], corners[1, 2], corners[2, 2])
    return min(max(depth, low), high) if depth == depth else 0.5 * (low + high)


@njit(cache=True, nogil=True)
def _area(corners: F64, near: float) -> float:
    """Area of a triangle in the image plane at distance 1; infinite where it passes the camera."""
    if min(corners[0, 2], corners[1, 2], corners[2, 2]) < near:
        return np.inf
    x0, y0 = corners[0, 0] / corners[0, 2], corners[0, 1] / corners[0, 2]
    x1, y1 = corners[1, 0] / corners[1, 2] - x0, corners[1, 1] / corners[1, 2] - y0
    x2, y2 = corners[2, 0] / corners[2, 2] - x0, corners[2, 1] / corners[2, 2] - y0
    return 0.5 * abs(x1 * y2 - x2 * y1)


@njit(cache=True, nogil=True)
def _faces_away(corners: F64, x: float, y: float) -> bool:
    a, b, c = corners[0], corners[1], corners[2]
    ux, uy, uz, vx, vy, vz = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return x * (uy * vz - uz * vy) + y * (uz * vx - ux * vz) + (ux * vy - uy * vx) > 0.0


@njit(cache=True, nogil=True)
def _normal(out: F32, seen: Geometry, draw: Index, part: Index, weight: F64, flip: bool) -> None:
    """Fill in the normal of a triangle of a draw where its corners have these weights, shape (3,)."""
    cofactor, local = seen.cofactor[draw - 1], np.zeros(3)
    for corner in range(3):
        vertex = seen.triangles[seen.first[draw - 1] + part, corner]
        for axis in range(3):
            local[axis] += weight[corner] * seen.normals[vertex, axis]
    length = 0.0
    turned = np.empty(3)
    for axis in range(3):
        turned[axis] = cofactor[axis, 0] * local[0] + cofactor[axis, 1] * local[1] + cofactor[axis, 2] * local[2]
        length += turned[axis] * turned[axis]
    length = max(np.sqrt(length), 1e-30) * (-1.0 if flip else 1.0)
    for axis in range(3):
        out[axis] = turned[axis] / length
