"""Position of a user's world: close enough to the scene's origin, and away from bridge and drone."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from authoring.site.extent import AIR
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.guard.layer_walk import Warn
from usd_schemas.reading.stage_reader import stage_to_world

F64 = NDArray[np.float64]
Point = tuple[float, float, float]

HERE: Point = (0.0, 0.0, 0.0)
COARSE = 0.005  # [m] between two single-precision numbers: from here on, gaps appear at windows and curbs
FARTHEST = 10_000.0  # [m] single precision is 1 mm there
_BORDER = 0.998  # share of the site's plan: a world may touch its edge
_BELOW = 1.0  # [m] under the lowest ground, as for our own backgrounds
_NAMED = 5


def check_place(stage: Usd.Stage, file: Path, scene: Path, origin: Point, warn: Warn) -> None:
    """Check the position of a world in a scene.

    Args:
        stage: The world, in any unit and up axis.
        file: Its file, for errors.
        scene: Root layer of the scene.
        origin: Point of the world that becomes the scene's origin [m], z up.
        warn: Called with one line about objects in the keep-out volume above the site, and one about points
            that are too coarse.

    Raises:
        InputError: It is more than 10 km away, or its unit is not a length.
    """
    found, coarse = _bodies(stage, file)
    if not found:
        return
    bodies = {path: corners - np.array(origin) for path, corners in found.items()}
    worst = max(coarse, key=lambda path: coarse[path])
    if coarse[worst] > COARSE:
        warn(
            f"{worst}: its points are far from their origin, and rounded to {1000 * coarse[worst]:.0f} mm; move them "
            "to an origin nearby before export, and put the distance into a transform"
        )
    everything = np.concatenate([corners.reshape(-1, 3) for corners in bodies.values()])
    middle = (everything.min(axis=0) + everything.max(axis=0)) / 2
    if float(np.abs(middle).max()) > FARTHEST:
        far = ", ".join(f"{value / 1000:.1f}" for value in middle)
        raise InputError(
            "lies too far from the scene's origin, where the bridge begins",
            where=file,
            field="background",
            value=f"middle at ({far}) km",
            allowed=f"within {FARTHEST / 1000:.0f} km",
            hint="Give the point that becomes the scene's origin [m], z up: --re-origin "
            + " ".join(f"{value:.0f}" for value in middle + np.array(origin)),
        )
    planes = _keep_out(Usd.Stage.Open(str(scene)))
    inside = [path for path, corners in bodies.items() if planes is not None and _enters(corners, planes)]
    if inside:
        more = f" and {len(inside) - _NAMED} more" if len(inside) > _NAMED else ""
        warn(
            f"lies where the bridge and its cameras are: {', '.join(inside[:_NAMED])}{more}; "
            f"cut a hole of the site's size into the world, or check in a preview that the bridge is visible"
        )


def _bodies(stage: Usd.Stage, where: Path) -> tuple[dict[str, F64], dict[str, float]]:
    """Collect the triangles of each mesh in meters with z up, shape (T, 3, 3), and the precision of its numbers [m]."""
    cache, to_scene = UsdGeom.XformCache(Usd.TimeCode.EarliestTime()), stage_to_world(stage, where)
    found, coarse = {}, {}
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Mesh):
            continue
        mesh = UsdGeom.Mesh(prim)
        points = np.asarray(mesh.GetPointsAttr().Get(Usd.TimeCode.EarliestTime()) or np.zeros((0, 3)), np.float64)
        counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get() or (), np.int64)
        corners = np.asarray(mesh.GetFaceVertexIndicesAttr().Get() or (), np.int64)
        if points.ndim != 2 or points.shape[1] != 3 or corners.min(initial=0) < 0:
            continue  # of another type: readers also leave out such a mesh
        if not len(points) or not len(corners) or corners.max() >= len(points) or (counts < 3).any():
            continue
        matrix = to_scene @ np.array(cache.GetLocalToWorldTransform(prim)).T
        placed = points @ matrix[:3, :3].T + matrix[:3, 3]
        first = np.repeat(np.cumsum(counts) - counts, counts - 2)
        step = np.concatenate([np.arange(1, count - 1) for count in counts])
        fan = np.stack([corners[first], corners[first + step], corners[first + step + 1]], axis=1)
        found[str(prim.GetPath())] = placed[fan]
        step = float(np.spacing(np.float32(np.abs(points).max())))
        coarse[str(prim.GetPath())] = step * float(np.linalg.norm(matrix[:3, 0]))
    return found, coarse


def _keep_out(scene: Usd.Stage) -> F64 | None:
    """Bound the air over the site by half spaces n . x + d < 0, shape (P, 4); None for a scene without a site."""
    from scipy.spatial import ConvexHull

    cache = UsdGeom.XformCache()
    ground = scene.GetPrimAtPath(f"{tokens.SITE}/SiteGeom/SiteGround")
    points = [
        np.asarray(UsdGeom.Mesh(prim).GetPointsAttr().Get(), np.float64)
        + np.array(cache.GetLocalToWorldTransform(prim))[3, :3]
        for prim in (Usd.PrimRange(ground) if ground else ())
        if prim.IsA(UsdGeom.Mesh)
    ]
    if not points:
        return None
    nodes = np.concatenate(points)
    middle = (nodes[:, :2].min(axis=0) + nodes[:, :2].max(axis=0)) / 2
    sides = ConvexHull(middle + (nodes[:, :2] - middle) * _BORDER).equations
    low, high = float(nodes[:, 2].min()) - _BELOW, float(nodes[:, 2].max()) + AIR
    walls = np.column_stack([sides[:, :2], np.zeros(len(sides)), sides[:, 2]])
    return np.vstack([walls, [0, 0, 1, -high], [0, 0, -1, low]])


def _enters(corners: F64, planes: F64) -> bool:
    """Check whether a triangle reaches into a convex volume, by clipping it at each plane.

    Source: Sutherland, Hodgman, Reentrant polygon clipping, Communications of the ACM 17, 1974.
    """
    beyond = corners @ planes[:, :3].T + planes[:, 3] >= 0
    outside = beyond.all(axis=1)
    near = corners[~outside.any(axis=-1)]
    for triangle in near:
        polygon = triangle
        for plane in planes:
            polygon = _clip(polygon, polygon @ plane[:3] + plane[3])
            if len(polygon) == 0:
                break
        if len(polygon):
            return True
    return False


def _clip(polygon: F64, off: F64) -> F64:
    kept = []
    for here, there, a, b in zip(polygon, np.roll(polygon, -1, axis=0), off, np.roll(off, -1), strict=True):
        if a < 0:
            kept.append(here)
        if (a < 0) != (b < 0):
            kept.append(here + (there - here) * (a / (a - b)))
    return np.array(kept).reshape(-1, 3)
