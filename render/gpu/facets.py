"""Long thin triangles, whose depth is drawn again from planes computed in double precision.

A rasterizer computes the depth gradient from a triangle's corners on the image, in single precision. The thinner the
triangle, the more digits cancel: rails and curbs along the line of sight would have relative depth errors of a
ten-thousandth. There are few such triangles, so their planes are computed here for each view.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

# One corner of a facet: its position, as a vertex attribute of the renderer; then the facet's 1 / depth [1/m] at some
# pixel of the image, its change per pixel along rows and columns [1/m], and that pixel [px].
CORNER = np.dtype([("position", "3f4"), ("offset", "3f4"), ("plane", "3f4"), ("place", "2f4"), ("draw", "u4")])
CORNER_FORMAT = "3f4 3f4 3f4 2f4 1u4"
CORNER_NAMES = ("in_position", "in_offset", "in_plane", "in_place", "in_draw")

_ROUNDING = 2.0**-24
_LOSS = 4e-6  # relative error of the depth from which on a facet is drawn again
_SLENDER = _LOSS / _ROUNDING  # ratio of slenderness to the camera's distance from the plane: smaller ones lose less
_LEAST = 300.0  # slenderness as a multiple of the near distance: planes of less slender ones are never close enough
_AT_ONCE = 1 << 16  # triangles that are measured together
_ALIKE = 1e-3  # of the squared scale; if scales along the axes differ by less, they count as one


@dataclass(frozen=True)
class Facets:
    """Every triangle of a scene that may be long and thin in some image, by draw.

    Attributes:
        draw: Draw of each, ascending, shape (N,), int64.
        positions: Mesh-local corners [m], shape (N, 3, 3), float32.
        corners: Corners counted from `anchor` [m], shape (N, 3, 3), float64.
        normals: Unit normals [1], shape (3, N), float64.
        heights: Distance of the plane from `anchor` along the normal [m], shape (N,), float64.
        slenderness: Length^2 over height [m], shape (N,), float64.
        anchor: Origin of `corners` [m], shape (3,), float64.
    """

    draw: I64
    positions: F32
    corners: F64
    normals: F64
    heights: F64
    slenderness: F64
    anchor: F64

    def near(self, eyes: F64, stray: float) -> "Facets":
        """Keep only those that the cameras come close enough to for `seen` to find them.

        Args:
            eyes: Camera centers [m], shape (N, 3), float64.
            stray: Largest distance of a camera from its stated center [m].
        """
        kept = np.zeros(len(self.draw), bool)
        for eye in eyes - self.anchor:
            kept |= self.slenderness > _SLENDER * (np.abs(self.heights - _dot(self.normals, eye)) - stray)
        return Facets(
            self.draw[kept],
            self.positions[kept],
            self.corners[kept],
            np.ascontiguousarray(self.normals[:, kept]),
            self.heights[kept],
            self.slenderness[kept],
            self.anchor,
        )

    def seen(
        self, visible: NDArray[np.bool_], camera: Pinhole, window: tuple[int, int], pose: F64, near: float, origins: F64
    ) -> NDArray[np.void]:
        """Find the planes of those facets whose depth a rasterizer would compute wrongly.

        The result for a facet depends neither on the other facets nor on the window, not even in the last bit.

        Args:
            visible: Whether to look at the facets of a draw, shape (D,), bool.
            camera: Intrinsics.
            window: First row of the image that is drawn, and the row after the last.
            pose: Camera pose [m], shape (4, 4), float64.
            near: Near plane [m].
            origins: Origin of each draw [m], shape (D, 3), float64.

        Returns:
            Corners, three per facet, shape (3 K,), dtype `CORNER`.
        """
        eye = pose[:3, 3] - self.anchor
        away = self.heights - _dot(self.normals, eye)
        facets = np.flatnonzero((self.slenderness > _SLENDER * np.abs(away)) & visible[self.draw])
        corners = _turned(np.moveaxis(self.corners[facets], 2, 0) - eye[:, None, None], pose)
        kept = np.flatnonzero(_in_view(corners, camera, window, near) & (away[facets] != 0.0))
        kept = kept[_loss(corners[:, kept], camera, near) > _LOSS]
        facets, corners = facets[kept], corners[:, kept]
        slope = _turned(self.normals[:, facets], pose) / (away[facets] * [[camera.fx], [camera.fy], [1.0]])
        x, y, z = corners[:, np.arange(len(facets)), np.argmax(corners[2], axis=1)]
        place = np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], axis=1).astype(np.float32)
        inverse = slope[0] * (place[:, 0] - camera.cx) + slope[1] * (place[:, 1] - camera.cy) + slope[2]
        result = np.empty((len(facets), 3), CORNER)
        result["position"] = self.positions[facets]
        draw = self.draw[facets]
        result["offset"] = (origins[draw] - pose[:3, 3]).astype(np.float32)[:, None]
        result["plane"] = np.stack([inverse, slope[0], slope[1]], axis=1)[:, None]
        result["place"], result["draw"] = place[:, None], draw[:, None]
        return result.reshape(-1)


def find_facets(scene: FlatScene, anchor: F64) -> Facets:
    """Find the long thin triangles of a scene.

    Args:
        scene: A scene.
        anchor: Origin of their corners [m], shape (3,), float64.
    """
    geometry, draws = scene.geometry, scene.draws
    least = _LEAST * min((track.near for track in scene.cameras), default=0.1)
    linear = draws.transform[:, :3, :3]
    growth = _growth(linear)
    most = np.zeros(len(geometry.part_first))
    np.maximum.at(most, draws.part, growth)
    blocks = (geometry.triangles[start : start + _AT_ONCE] for start in range(0, len(geometry.triangles), _AT_ONCE))
    slender = np.concatenate([_slenderness(geometry.positions[block])[0] for block in blocks])
    runs = zip(geometry.part_first.tolist(), geometry.part_count.tolist(), most.tolist(), strict=True)
    worst = [first + np.flatnonzero(slender[first : first + count] * limit >= least) for first, count, limit in runs]
    sizes = np.array([len(part) for part in worst], np.int64)
    draw = np.repeat(np.arange(len(draws.part)), sizes[draws.part])
    ends = np.cumsum(sizes[draws.part])
    within = np.arange(len(draw)) - (ends - sizes[draws.part])[draw]
    triangle = np.concatenate(worst)[(np.cumsum(sizes) - sizes)[draws.part][draw] + within]
    thin = slender[triangle] * growth[draw] >= least
    draw, positions = draw[thin], geometry.positions[geometry.triangles[triangle[thin]]]
    corners = np.einsum("nij,ncj->nci", linear[draw], positions) + (draws.transform[draw, None, :3, 3] - anchor)
    exact, normals = _slenderness(corners)
    thin = exact >= least
    corners, normals = corners[thin], np.ascontiguousarray(normals[:, thin])
    heights = _dot(normals, corners[:, 0].T)
    return Facets(draw[thin], positions[thin], corners, normals, heights, exact[thin], anchor)


def _growth(linear: F64) -> F64:
    """Compute by how much a linear map makes a triangle more slender, at most, shape (N,)."""
    square = np.einsum("nki,nkj->nij", linear, linear)
    scale = np.trace(square, axis1=1, axis2=2) / 3
    growth = np.sqrt(scale)
    unlike = np.flatnonzero(np.abs(square - scale[:, None, None] * np.eye(3)).max(axis=(1, 2)) > _ALIKE * scale)
    size = np.linalg.svd(linear[unlike], compute_uv=False)
    growth[unlike] = size[:, 0] ** 3 / np.maximum(size[:, 1] * size[:, 2], 1e-300)
    return growth


def _slenderness(corners: NDArray[np.floating]) -> tuple[F64, F64]:
    """Find length^2 over height of triangles [m], 0 for those without area, shape (N,); unit normals, shape (3, N)."""
    a, b, c = (corners[:, corner].T for corner in range(3))
    (ux, uy, uz), (vx, vy, vz), (wx, wy, wz) = (b - a).astype(np.float64), (c - a).astype(np.float64), c - b
    normals = np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx])
    twice = np.sqrt(normals[0] ** 2 + normals[1] ** 2 + normals[2] ** 2)  # the area
    longest = np.sqrt(np.maximum(np.maximum(ux**2 + uy**2 + uz**2, vx**2 + vy**2 + vz**2), wx**2 + wy**2 + wz**2))
    flat = twice > 1e-12 * longest**2
    safe = np.where(flat, twice, 1.0)
    return np.where(flat, longest**3 / safe, 0.0), normals / safe


def _dot(vectors: F64, other: F64) -> F64:
    """Multiply vectors, shape (3, N), with one or as many; a matrix product would round depending on its size."""
    return vectors[0] * other[0] + vectors[1] * other[1] + vectors[2] * other[2]


def _turned(vectors: F64, pose: F64) -> F64:
    """Rotate vectors, shape (3, ...), from world axes to camera axes."""
    return np.stack([_dot(vectors, pose[:3, axis]) for axis in range(3)])


def _in_view(corners: F64, camera: Pinhole, window: tuple[int, int], near: float) -> NDArray[np.bool_]:
    """Tell whether facets may be in some rows of the image, with a margin of one pixel, shape (N,)."""
    (x, y, z), (first, end) = corners, window
    outside = (z < near).all(axis=1)
    for place, low, high in (
        (camera.fx * x, -camera.cx - 1, camera.width - camera.cx + 1),
        (camera.fy * y, first - camera.cy - 1, end - camera.cy + 1),
    ):
        outside |= (place < low * z).all(axis=1) | (place > high * z).all(axis=1)
    return ~outside


def _loss(corners: F64, camera: Pinhole, near: float) -> F64:
    """Estimate the relative error of the depth, shape (N,): cancellation in the area, times the change of the depth."""
    x, y, z = corners
    depth = np.maximum(z, near)
    across, down = camera.fx * x / depth, camera.fy * y / depth
    (ax, bx, cx), (ay, by, cy) = (across[:, [1, 2, 0]] - across).T, (down[:, [1, 2, 0]] - down).T
    longest = np.maximum(np.maximum(ax**2 + ay**2, bx**2 + by**2), cx**2 + cy**2)
    twice = np.abs(ax * by - ay * bx)
    low, high = depth.min(axis=1), depth.max(axis=1)
    loss = _ROUNDING * longest / np.maximum(twice, 1e-30) * (high / low - 1.0)
    return np.where(low > near, loss, np.inf)
