"""A stage that Blender made reads as Blender sees it: areas, volume, bounds, camera, sun."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.dcc.blender import export_scene
from tests.usd_schemas.stages import bounds, volume
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.pinhole import USD_FROM_CAMERA, pinhole_from_lens, project
from usd_schemas.reading.stage_reader import read_stage

pytestmark = pytest.mark.dcc

CENTIMETERS_Y_UP = {
    "convert_orientation": True,
    "export_global_forward_selection": "NEGATIVE_Z",
    "export_global_up_selection": "Y",
    "convert_scene_units": "CENTIMETERS",
}
EXPORTS: dict[str, dict[str, Any]] = {
    "plain": {},
    "instanced": {"use_instancing": True},
    "y_up_cm": CENTIMETERS_Y_UP,
    "y_up_cm_instanced": {**CENTIMETERS_Y_UP, "use_instancing": True},
    "moving": {"frames": 5},
    "triangulated": {"triangulate_meshes": True, "export_normals": False},
}


@pytest.fixture(scope="module", params=EXPORTS)
def exported(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[FlatScene, dict[str, Any]]:
    """Export the test scene in one of several ways and read it."""
    file, facts = export_scene(tmp_path_factory.mktemp("blender"), request.param, **EXPORTS[request.param])
    return read_stage(file), facts


def test_geometry(exported: tuple[FlatScene, dict[str, Any]]) -> None:
    """Area by material, enclosed volume and bounds are Blender's, whatever unit, up axis and instancing."""
    scene, facts = exported
    corners, _, rows = world_triangles(scene)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    names = [scene.materials[row].name.rsplit("/", 1)[-1] for row in scene.draws.material]
    found: dict[str, float] = {}
    for row, name in enumerate(names):
        found[name] = found.get(name, 0.0) + float(areas[rows == row].sum())
    assert found == pytest.approx(facts["areas"], rel=1e-5)
    assert volume(scene) == pytest.approx(facts["volume"], rel=1e-4)
    np.testing.assert_allclose(bounds(scene), [facts["low"], facts["high"]], atol=1e-4)


def test_normals_look_outwards(exported: tuple[FlatScene, dict[str, Any]]) -> None:
    """Shading normals agree with the winding on every triangle, mirrored objects included."""
    scene, _ = exported
    for row, part in enumerate(scene.draws.part):
        first, count = scene.geometry.part_first[part], scene.geometry.part_count[part]
        triangles = scene.geometry.triangles[first : first + count]
        transform = scene.draws.transform[row]
        corners = scene.geometry.positions[triangles] @ transform[:3, :3].T
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        facing *= np.sign(np.linalg.det(transform[:3, :3]))  # a mirror turns the winding round
        normals = scene.geometry.normals[triangles][:, 0] @ np.linalg.inv(transform[:3, :3])
        assert np.einsum("ti,ti->t", facing, normals).min() > 0.0


def test_camera(exported: tuple[FlatScene, dict[str, Any]]) -> None:
    """Every pose, and every pixel that Blender projects to, within 0.02 px; the resolution's aspect is kept."""
    scene, facts = exported
    track, product = scene.cameras[0], scene.products[0]
    assert [product.width, product.height] == facts["size"]
    assert len(track.poses) == len(facts["poses"])
    np.testing.assert_allclose(track.poses, np.array(facts["poses"]) @ USD_FROM_CAMERA, atol=1e-5)
    pinhole = pinhole_from_lens(track.lens, product.width, product.height)
    for pose, expected in zip(track.poses, np.array(facts["pixels"]), strict=True):
        pixels, depth = project(np.array(facts["corners"]), pinhole, pose)
        np.testing.assert_allclose(pixels, expected[:, :2], atol=0.02)
        np.testing.assert_allclose(depth, expected[:, 2], rtol=1e-5)


def test_sun_and_labels(exported: tuple[FlatScene, dict[str, Any]]) -> None:
    """The sun stands where Blender has it; everything is background, each object with an id of its own."""
    scene, facts = exported
    assert scene.sun is not None
    np.testing.assert_allclose(scene.sun.direction, facts["sun"], atol=1e-6)
    assert not scene.draws.label.any()
    assert [row.id for row in scene.instances] == list(range(1, 9))
    assert not scene.warnings


def test_instances_share_their_mesh(tmp_path: Path) -> None:
    """With instancing the posts are one mesh, plain and mirrored."""
    plain = read_stage(export_scene(tmp_path, "plain")[0])
    shared = read_stage(export_scene(tmp_path, "shared", use_instancing=True)[0])
    assert len(shared.geometry.positions) < len(plain.geometry.positions)
    assert len(shared.draws.part) == len(plain.draws.part)
