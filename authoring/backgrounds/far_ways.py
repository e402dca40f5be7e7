"""Roads, railways and rivers beyond the site: to the land's border, or to where they are hidden."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh
from authoring.site.roads import Piece, approach_pieces, crossing_pieces, spread

FAR_STEP = 8.0  # distance between cross-sections of far roads and rivers [m]
TRACK = 300.0  # distance from the site up to which a railway has rails and sleepers [m]


def far_ways(terrain: Terrain) -> list[Piece]:
    """Continue the crossing and the approach roads to the terrain's border.

    Args:
        terrain: The terrain.

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece.
    """
    first, last, low, high = terrain.inner
    field, land, hills = terrain.field, terrain.land, terrain.hills
    pieces: list[Piece] = []
    for suffix, start, stop in (("_Right", low, field.lefts[1]), ("_Left", high, field.lefts[-2])):
        pieces += crossing_pieces(land, spread(start, stop, FAR_STEP), hills, suffix, terrain.height)
    for number, start, stop in ((0, first, field.stations[1]), (1, last, field.stations[-2])):
        pieces += approach_pieces(land, number, spread(start, stop, FAR_STEP), hills, "_Far", terrain.height)
    return [
        (prim, kind, role, _near_track(terrain, mesh) if "Sleepers" in prim or "Rails" in prim else mesh)
        for prim, kind, role, mesh in pieces
    ]


def without(mesh: Mesh, lost: NDArray[np.bool_]) -> Mesh:
    """Leave out the faces of a mesh without an atlas that touch some of its points.

    Args:
        mesh: The mesh.
        lost: Which of its points are removed, shape (N,), bool.
    """
    face = np.repeat(np.arange(len(mesh.face_counts)), mesh.face_counts)
    gone = np.bincount(face, lost[mesh.corners], len(mesh.face_counts)) > 0
    kept = ~gone[face]
    used, corners = np.unique(mesh.corners[kept], return_inverse=True)
    return Mesh(
        mesh.points[used],
        mesh.face_counts[~gone],
        corners.reshape(-1).astype(np.int32),
        mesh.normals[kept],
        mesh.st[kept],
    )


def _near_track(terrain: Terrain, mesh: Mesh) -> Mesh:
    return without(mesh, terrain.beyond(*terrain.land.layout.alignment.locate(mesh.points)) > TRACK)
