"""Roads, railways and rivers beyond the site: to the land's border, or to where they are hidden."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh
from authoring.site.roads import Piece, approach_pieces, crossing_pieces, spread

FAR_STEP = 8.0  # distance between cross-sections of far roads and rivers [m]
SLEEPERS, RAILS = 300.0, 1200.0  # distance from the site up to which a railway has them [m]
FAR_BED = "ballast_limestone"  # as pale as ballast and concrete sleepers together, where these cannot be told apart


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
    timber = any(role == "timber" for _, _, role, _ in pieces)
    thinned = [part for piece in pieces for part in _thinned(terrain, piece, FAR_BED if not timber else piece[2])]
    return with_faces(thinned)


def with_faces(pieces: list[Piece]) -> list[Piece]:
    """Leave out the pieces that have no face left: a stage holds no empty mesh.

    Args:
        pieces: Leaf prim name, component kind, material recipe and mesh of each piece.
    """
    return [piece for piece in pieces if len(piece[3].face_counts)]


def without(mesh: Mesh, lost: NDArray[np.bool_]) -> Mesh:
    """Leave out the faces of a mesh without an atlas that touch some of its points.

    Args:
        mesh: The mesh.
        lost: Which of its points are removed, shape (N,), bool.
    """
    face = np.repeat(np.arange(len(mesh.face_counts)), mesh.face_counts)
    return _chosen(mesh, np.bincount(face, lost[mesh.corners], len(mesh.face_counts)) == 0)


def _chosen(mesh: Mesh, faces: NDArray[np.bool_]) -> Mesh:
    kept = np.repeat(faces, mesh.face_counts)
    used, corners = np.unique(mesh.corners[kept], return_inverse=True)
    return Mesh(
        mesh.points[used],
        mesh.face_counts[faces],
        corners.reshape(-1).astype(np.int32),
        mesh.normals[kept],
        mesh.st[kept],
    )


def _thinned(terrain: Terrain, piece: Piece, far_bed: str) -> list[Piece]:
    """Leave out distant sleepers and rails; the top of the ballast, whose color they change, is a separate piece."""
    prim, kind, role, mesh = piece
    if "Sleepers" not in prim and "Rails" not in prim and "RailBed" not in prim:
        return [piece]
    away = terrain.beyond(*terrain.land.layout.alignment.locate(mesh.points))
    if "RailBed" not in prim:
        return [(prim, kind, role, without(mesh, away > (SLEEPERS if "Sleepers" in prim else RAILS)))]
    strips = np.arange(len(mesh.face_counts)) // (len(mesh.face_counts) // 3)  # flank, level top, flank
    distant = (strips == 1) & (away[mesh.corners].reshape(-1, 4).max(axis=1) > SLEEPERS)
    if role == far_bed or not distant.any():
        return [piece]
    return [(prim, kind, role, _chosen(mesh, ~distant)), (f"Distant{prim}", kind, far_bed, _chosen(mesh, distant))]
