"""What a viewport draws in place of a heavy plant: eight faces of the same extent (purpose `proxy`)."""

import numpy as np

from authoring.shapes.component import Mesh

HEAVY = 40  # [1] faces from which on a part of a prototype has a stand-in
_FACES = np.array(  # of an octahedron: -x +x -y +y -z +z, counter-clockwise from outside
    [[1, 3, 5], [3, 0, 5], [0, 2, 5], [2, 1, 5], [3, 1, 4], [0, 3, 4], [2, 0, 4], [1, 2, 4]], np.int32
)


def is_heavy(mesh: Mesh) -> bool:
    """Check whether a part of a prototype gets a stand-in for viewports.

    Args:
        mesh: The part.
    """
    return len(mesh.face_counts) >= HEAVY


def stand_in(mesh: Mesh) -> Mesh:
    """Make an octahedron as wide and as high as a mesh, about its middle.

    Args:
        mesh: Any mesh.
    """
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    points = np.repeat((low + high)[None] / 2, 6, axis=0)
    for axis in range(3):
        points[2 * axis, axis], points[2 * axis + 1, axis] = low[axis], high[axis]
    corner = points[_FACES]
    normals = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Mesh(
        points,
        np.full(8, 3, np.int32),
        _FACES.reshape(-1),
        np.repeat(normals, 3, axis=0).astype(np.float32),
        corner.reshape(-1, 3)[:, :2].astype(np.float32),
    )
