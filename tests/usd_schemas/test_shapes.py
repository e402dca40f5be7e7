"""Native gprims against closed forms: area, volume, bounds, and normals that agree with the winding."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from tests.usd_schemas.stages import area, area_vectors, bounds, read_body, volume, write_stage
from usd_schemas.flat_scene import world_triangles

ROUND = 0.02  # share by which a tessellated round body may be smaller [1]

BODIES = {
    "Cube": ("double size = 2", 24.0, 8.0),
    "Sphere": ("double radius = 1.5", 4 * np.pi * 1.5**2, 4 / 3 * np.pi * 1.5**3),
    "Cylinder": ('double radius = 0.5\n double height = 3\n uniform token axis = "X"', 3.5 * np.pi, 0.75 * np.pi),
    "Cone": ('double radius = 3\n double height = 4\n uniform token axis = "Y"', 24 * np.pi, 12 * np.pi),
    "Capsule": ('double radius = 1\n double height = 2\n uniform token axis = "Z"', 8 * np.pi, (2 + 4 / 3) * np.pi),
    "Cylinder_1": (
        "double radiusBottom = 2\n double radiusTop = 1\n double height = 3",
        np.pi * (5 + 3 * np.sqrt(10)),
        7 * np.pi,
    ),
}


@pytest.mark.parametrize("kind", BODIES)
def test_area_volume_and_bounds(kind: str, tmp_path: Path) -> None:
    """Area and volume are the closed forms, bounds are USD's own, all faces look outwards."""
    text, surface, content = BODIES[kind]
    body = f'def {kind} "Body" {{\n {text}\n double3 xformOp:translate = (10, -4, 2)\n'
    body += ' uniform token[] xformOpOrder = ["xformOp:translate"]\n}'
    scene = read_body(tmp_path, body)
    exact = kind == "Cube"
    assert area(scene) == pytest.approx(surface, rel=1e-6 if exact else ROUND)
    assert volume(scene) == pytest.approx(content, rel=1e-6 if exact else ROUND)
    stage = Usd.Stage.Open(str(write_stage(tmp_path, body)))
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(stage.GetPseudoRoot())
    span = box.ComputeAlignedRange()
    np.testing.assert_allclose(bounds(scene), [span.GetMin(), span.GetMax()], atol=0.02)
    normals = scene.geometry.normals[scene.geometry.triangles].mean(axis=1)
    facing = np.einsum("ti,ti->t", normals, area_vectors(scene))
    assert facing.min() > 0.0


@pytest.mark.parametrize(
    ("axis", "corner", "facing"),
    [("X", (0, 1, 2), (1, 0, 0)), ("Y", (2, 0, 1), (0, 1, 0)), ("Z", (2, 1, 0), (0, 0, 1))],
)
def test_plane(axis: str, corner: tuple[float, ...], facing: tuple[float, ...], tmp_path: Path) -> None:
    """Width and length lie as UsdGeomPlane says, and the plane looks along its axis."""
    body = f'def Plane "P" {{\n double width = 4\n double length = 2\n uniform token axis = "{axis}"\n}}'
    scene = read_body(tmp_path, body)
    np.testing.assert_allclose(bounds(scene)[1], corner)
    np.testing.assert_allclose(area_vectors(scene).sum(axis=0), np.array(facing) * 8.0)


def test_closed_without_slivers(tmp_path: Path) -> None:
    """Poles leave no triangle without area, and every edge of a sphere is shared by two triangles."""
    scene = read_body(tmp_path, 'def Sphere "S" {}')
    assert np.linalg.norm(area_vectors(scene), axis=1).min() > 1e-4
    corners = np.round(world_triangles(scene)[0], 5)
    edges: dict[tuple[float, ...], int] = {}
    for triangle in corners.tolist():
        for first, second in ((0, 1), (1, 2), (2, 0)):
            edge = tuple(np.ravel(sorted([triangle[first], triangle[second]])).tolist())
            edges[edge] = edges.get(edge, 0) + 1
    assert set(edges.values()) == {2}
