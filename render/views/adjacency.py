"""Triangles that share an edge: a ray that just misses the surface that a pixel shows may hit a neighboring face."""

import numpy as np
from numpy.typing import NDArray

from render.gpu.welding import mixed, welded_places
from usd_schemas.flat_scene import Geometry

I32 = NDArray[np.int32]
I64 = NDArray[np.int64]

NONE = -1


def edge_neighbors(geometry: Geometry) -> I32:
    """Find for each edge of each triangle the triangle of the same part that shares it, by position.

    Args:
        geometry: Meshes; vertices at the same position count as one, because flat shading duplicates them.

    Returns:
        Triangle counted from the part's first, `NONE` for an open edge; edges from corner 0 to 1, 1 to 2, 2 to 0;
        shape (T, 3), int32.
    """
    count = len(geometry.triangles)
    part = np.zeros(count, np.int64)
    for row in range(len(geometry.part_first)):
        part[geometry.part_first[row] :][: geometry.part_count[row]] = row
    corners = welded_places(geometry)[geometry.triangles.astype(np.int64)]
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1)
    low, high = ends.min(axis=-1).ravel(), ends.max(axis=-1).ravel()
    key = mixed(mixed(low.astype(np.uint64), high.astype(np.uint64)), np.repeat(part, 3).astype(np.uint64))
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = order[same], order[same + 1]
    result = np.full(count * 3, NONE, np.int32)
    first = geometry.part_first.astype(np.int64)[part]
    result[one] = other // 3 - first[one // 3]
    result[other] = one // 3 - first[other // 3]
    return result.reshape(count, 3)
