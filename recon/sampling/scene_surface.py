"""The surface of a whole stage as triangles with their mesh, instance, class and wanted part."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas import tokens
from usd_schemas.flat_scene import FlatScene, world_triangles

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class SceneSurface:
    """Triangles of a scene in the world; a triangle without area has no normal and is never sampled.

    Attributes:
        corners: Corner positions [m], shape (T, 3, 3), float64.
        normals: Unit normals of the faces, outward [1]; NaN where there is no area, shape (T, 3), float64.
        areas: Areas [m²], shape (T,), float64.
        vertices: Rows in the geometry's vertices, shape (T, 3), uint32.
        draws: Row in the scene's draws, shape (T,), int64.
        instances: Instance ids, shape (T,), uint32.
        labels: Class ids, shape (T,), uint8.
    """

    corners: F64
    normals: F64
    areas: F64
    vertices: U32
    draws: I64
    instances: U32
    labels: U8


@dataclass(frozen=True, eq=False)
class Fragments:
    """Pieces of the triangles of a surface.

    Attributes:
        rows: Triangle that each piece lies in, shape (F,), int64.
        barycentric: Corners of the piece in the triangle's barycentric coordinates [1], shape (F, 3, 3), float64.
    """

    rows: I64
    barycentric: F64

    def areas(self, surface: SceneSurface) -> F64:
        """Compute the areas of the pieces [m²], shape (F,), float64.

        Args:
            surface: The surface that they are pieces of.
        """
        return np.abs(np.linalg.det(self.barycentric)) * surface.areas[self.rows]


def lay_out(scene: FlatScene) -> SceneSurface:
    """Expand a scene into world triangles, including mirrored and repeated parts.

    Args:
        scene: A composed stage.
    """
    corners, instances, rows = world_triangles(scene)
    draws = rows.astype(np.int64)
    geometry, parts = scene.geometry, scene.draws.part
    counts = geometry.part_count[parts].astype(np.int64)
    within = np.arange(len(draws)) - np.repeat(np.cumsum(counts) - counts, counts)
    vertices = geometry.triangles[geometry.part_first[parts].astype(np.int64)[draws] + within]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    mirrored = np.where(np.linalg.det(scene.draws.transform[:, :3, :3]) < 0, -1.0, 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = cross / length[:, None] * mirrored[draws, None]
    return SceneSurface(corners, normals, 0.5 * length, vertices, draws, instances, scene.draws.label[draws])


def bridge_triangles(scene: FlatScene, surface: SceneSurface) -> NDArray[np.bool_]:
    """Tell which triangles belong to the bridge.

    On a stage of ours these are the triangles below the bridge prim; on others those of a class other than background;
    if there is no such class, all.

    Args:
        scene: A composed stage.
        surface: Its surface.

    Returns:
        Whether each is, shape (T,), bool.
    """
    own = [row.id for row in scene.instances if row.path.startswith(f"{tokens.BRIDGE}/")]
    labeled = [row.id for row in scene.instances if row.base_class not in ("background", "")]
    for ids in (own, labeled):
        chosen = np.isin(surface.instances, np.array(ids, np.uint32))
        if chosen.any():
            return chosen
    return np.ones(len(surface.instances), bool)


def made_of(scene: FlatScene, surface: SceneSurface, kinds: tuple[str, ...]) -> NDArray[np.bool_]:
    """Tell which triangles belong to components of some kinds.

    Args:
        scene: A composed stage.
        surface: Its surface.
        kinds: Component kinds.

    Returns:
        Whether each does, shape (T,), bool.
    """
    return np.isin(surface.instances, [row.id for row in scene.instances if row.component in kinds])


def bounds_of(surface: SceneSurface, chosen: NDArray[np.bool_], reach: float) -> F64:
    """Compute the box around some triangles, widened by a distance.

    Args:
        surface: A surface.
        chosen: Triangles in the box, shape (T,), bool.
        reach: Distance by which it is widened on every side [m].

    Returns:
        Lower and upper corner [m], shape (2, 3), float64.
    """
    flat = surface.corners[chosen].reshape(-1, 3)
    return np.array([flat.min(axis=0) - reach, flat.max(axis=0) + reach])


def whole(chosen: NDArray[np.bool_]) -> Fragments:
    """Make fragments of whole triangles.

    Args:
        chosen: Triangles to take, shape (T,), bool.
    """
    rows = np.flatnonzero(chosen)
    return Fragments(rows, np.broadcast_to(np.eye(3), (len(rows), 3, 3)).copy())


def clip(surface: SceneSurface, box: F64) -> Fragments:
    """Cut out the part of a surface that lies in a box.

    Cut by a plane, a triangle becomes itself, nothing, one triangle or two. Corners are stored as barycentric
    coordinates, so that points of a piece stay in the plane of its triangle after any number of cuts.

    Args:
        surface: A surface.
        box: Lower and upper corner [m], shape (2, 3), float64.
    """
    low, high = surface.corners.min(axis=1), surface.corners.max(axis=1)
    pieces = whole(((low <= box[1]) & (high >= box[0])).all(axis=1))
    for axis in range(3):
        for side, border in ((1.0, box[0, axis]), (-1.0, box[1, axis])):
            pieces = _cut(pieces, surface, axis, side, border)
    return pieces


def _cut(pieces: Fragments, surface: SceneSurface, axis: int, side: float, border: float) -> Fragments:
    """Keep the part where side * (position - border) is not negative."""
    height = side * ((pieces.barycentric @ surface.corners[pieces.rows, :, axis, None])[..., 0] - border)
    inside = height >= 0.0
    count = inside.sum(axis=1)
    rows, corners = [pieces.rows[count == 3]], [pieces.barycentric[count == 3]]
    for alone, lone_is_inside in ((1, True), (2, False)):
        cut = count == alone
        lone = np.argmax(inside[cut] == lone_is_inside, axis=1)
        order = (lone[:, None] + np.arange(3)) % 3  # the only corner on its side comes first
        bary = np.take_along_axis(pieces.barycentric[cut], order[..., None], axis=1)
        depth = np.take_along_axis(height[cut], order, axis=1)
        share = (depth[:, :1] / (depth[:, :1] - depth[:, 1:]))[..., None]
        first, second = np.moveaxis(bary[:, :1] + share * (bary[:, 1:] - bary[:, :1]), 1, 0)
        if lone_is_inside:
            made = [np.stack([bary[:, 0], first, second], axis=1)]
        else:
            made = [np.stack([first, bary[:, 1], bary[:, 2]], axis=1), np.stack([first, bary[:, 2], second], axis=1)]
        rows += [pieces.rows[cut]] * len(made)
        corners += made
    return Fragments(np.concatenate(rows), np.concatenate(corners))
