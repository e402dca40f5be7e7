"""Subdivision surfaces: refined cages against the limit surface, against rules worked out by hand, and on stages."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.usd_schemas.stages import bounds, read_body, write_stage
from usd_schemas.flat_scene import world_triangles
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.stage_reader import read_stage
from usd_schemas.reading.subdivision import Cage, refine

CUBE_POINTS = np.array([[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)])
CUBE_FACES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
RIM = [(0, 1), (1, 3), (2, 3), (0, 2), (4, 5), (5, 7), (6, 7), (4, 6), (0, 4), (1, 5), (2, 6), (3, 7)]


def cage(
    points: np.ndarray,
    faces: list[list[int]],
    creases: list[tuple[int, int]] | None = None,
    sharpness: float = 0.0,
    sharp_corners: bool = True,
) -> Cage:
    """Make a cage."""
    pairs = np.array(creases or [], np.int64).reshape(-1, 2)
    return Cage(
        points,
        np.array([len(face) for face in faces]),
        np.concatenate(faces),
        pairs,
        np.full(len(pairs), sharpness),
        np.zeros(len(points)),
        sharp_corners,
        np.arange(len(faces)),
    )


def test_a_cube_goes_where_the_rules_say() -> None:
    """One refinement of the cube of side 2: vertices to 5/9, edges to 3/4 and 3/4, faces to 1; 26 points, 24 quads."""
    finer, _ = refine(cage(CUBE_POINTS, CUBE_FACES), [])
    assert len(finer.points) == 26
    assert len(finer.counts) == 24
    np.testing.assert_allclose(np.abs(finer.points[:8]), 5 / 9)
    np.testing.assert_allclose(np.sort(np.abs(finer.points[8:20]), axis=1), np.tile([0.0, 0.75, 0.75], (12, 1)))
    np.testing.assert_allclose(np.sort(np.abs(finer.points[20:]), axis=1), np.tile([0.0, 0.0, 1.0], (6, 1)))
    np.testing.assert_array_equal(np.bincount(finer.parent), np.full(6, 4))


def test_refined_cages_come_to_the_limit() -> None:
    """The vertices of valence 3 of the cube run to their limit, which is worked out on the cage."""
    mesh = cage(CUBE_POINTS, CUBE_FACES)
    # Limit mask of valence n: n^2 v, 4 times its neighbors, and the diagonals of its faces, over n (n + 5).
    vertex, edges, diagonals = CUBE_POINTS[7], CUBE_POINTS[[3, 5, 6]], CUBE_POINTS[[1, 2, 4]]
    limit = (9 * vertex + 4 * edges.sum(axis=0) + diagonals.sum(axis=0)) / 24
    for _ in range(5):
        mesh, _ = refine(mesh, [])
    np.testing.assert_allclose(mesh.points[7], limit, atol=2e-3)


def test_creases_and_corners() -> None:
    """All edges creased for ever leave the cube; a boundary's corners stay where they are told to and round else."""
    mesh = cage(CUBE_POINTS, CUBE_FACES, RIM, 10.0)
    for _ in range(3):
        mesh, _ = refine(mesh, [])
    np.testing.assert_allclose(np.abs(mesh.points).max(axis=1), 1.0)
    np.testing.assert_allclose(np.abs(mesh.points[:8]), 1.0)
    worn = cage(CUBE_POINTS, CUBE_FACES, RIM, 1.0)
    worn, _ = refine(worn, [])
    np.testing.assert_allclose(np.abs(worn.points[:8]), 1.0)
    assert len(worn.creases) == 0
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    sharp, _ = refine(cage(square, [[0, 1, 2, 3]]), [])
    np.testing.assert_allclose(sharp.points[:4], square)
    rounded, _ = refine(cage(square, [[0, 1, 2, 3]], sharp_corners=False), [])
    np.testing.assert_allclose(rounded.points[0], [0.125, 0.125, 0])


def test_values_change_evenly_over_faces() -> None:
    """Values at the corners of a square and of a triangle are where their refined corners lie."""
    points = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [4, 1, 0]])
    faces = [[0, 1, 2, 3], [1, 4, 2]]
    plain = points[np.concatenate(faces)][:, :2]
    _, (values,) = refine(cage(points, faces), [plain])
    np.testing.assert_allclose(values[:4], [[0, 0], [1, 0], [1, 1], [0, 1]])
    np.testing.assert_allclose(values[16:20], [[2, 0], [3, 0.5], [8 / 3, 1], [2, 1]])


CAGE = """def Mesh "Ball" {{
    point3f[] points = {}
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = {}
    {}
    def GeomSubset "Lid" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
    }}
}}
"""
POINTS = str([tuple(row) for row in CUBE_POINTS.tolist()])
INDICES = str(np.concatenate(CUBE_FACES).tolist())
NORMALS = 'normal3f[] normals = [(0, 0, 1)] (interpolation = "constant")'


@pytest.mark.parametrize(("level", "widest"), [(0, 1.0), (1, 1.0), (2, 253 / 288)])
def test_a_stage_is_refined_as_often_as_asked_for(level: int, widest: float, tmp_path: Path) -> None:
    """Each level has four times the triangles; subsets keep their share; normals point outwards from a ball."""
    path = write_stage(tmp_path, CAGE.format(POINTS, INDICES, ""))
    scene = read_stage(path, choices=StageChoices(subdivision=level))
    corners, _, rows = world_triangles(scene)
    assert len(corners) == 12 * 4**level
    assert np.bincount(rows).tolist() == [10 * 4**level, 2 * 4**level]
    assert np.abs(bounds(scene)).max() == pytest.approx(widest)
    outwards = np.einsum("vi,vi->v", scene.geometry.normals, scene.geometry.positions)
    assert (outwards > 0.5 * np.linalg.norm(scene.geometry.positions, axis=1)).all()


def test_a_crease_has_one_sharpness_or_one_for_each_edge(tmp_path: Path) -> None:
    """Two rims of four edges with eight sharpnesses are as eight creases with one each; two mean one for each rim."""
    rims, sharp = [[0, 1, 3, 2, 0], [4, 5, 7, 6, 4]], [10.0, 0.0, 2.0, 10.0, 0.0, 10.0, 0.5, 10.0]

    along = [*rims[0], *rims[1]]

    def positions(lengths: list[int], along: list[int], sharpness: list[float]) -> np.ndarray:
        words = f"int[] creaseLengths = {lengths}\nint[] creaseIndices = {along}\n"
        words += f"float[] creaseSharpnesses = {sharpness}"
        return read_body(tmp_path, CAGE.format(POINTS, INDICES, words), subdivision=2).geometry.positions

    def apart(values: list[float]) -> np.ndarray:
        pairs = [pair for rim in rims for pair in pairwise(rim)]
        return positions([2] * 8, np.array(pairs).reshape(-1).tolist(), values)

    np.testing.assert_array_equal(positions([5, 5], along, sharp), apart(sharp))
    np.testing.assert_array_equal(positions([5, 5], along, [10.0, 0.5]), apart([10.0] * 4 + [0.5] * 4))
    assert not np.array_equal(apart(sharp), apart([10.0] * 4 + [0.0] * 4))


def test_polygons_are_not_refined(tmp_path: Path) -> None:
    """A scheme of none or bilinear, and normals that the file brings, leave the faces as they are."""
    for more in ('uniform token subdivisionScheme = "none"', 'uniform token subdivisionScheme = "bilinear"', NORMALS):
        corners, _, _ = world_triangles(read_body(tmp_path, CAGE.format(POINTS, INDICES, more)))
        assert len(corners) == 12
