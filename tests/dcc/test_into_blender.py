"""A scene of ours opens in Blender: the survey's camera and frames, parts where they belong, textures found."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from groundwork.progress import SILENT
from tests.conftest import RecordProof
from tests.dcc.blender import run_in_blender
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import USD_FROM_CAMERA
from usd_schemas.reading.stage_reader import read_stage

pytestmark = pytest.mark.dcc


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> tuple[FlatScene, dict[str, Any]]:
    """Author a small scene and open it in Blender."""
    folder = tmp_path_factory.mktemp("scene")
    settings = AuthoringSettings.model_validate({"look": {"texels": 256}, "background": {"name": "none"}})
    author_scene(settings, 7, folder, SILENT)
    facts = tmp_path_factory.mktemp("facts") / "facts.json"
    run_in_blender("import_scene.py", str(folder / "scene.usda"), str(facts))
    return read_stage(folder / "scene.usda"), json.loads(facts.read_text(encoding="utf-8"))


def test_camera_arrives_frame_by_frame(opened: tuple[FlatScene, dict[str, Any]], record_proof: RecordProof) -> None:
    """24 mm on 36 mm, one frame an image, each at the survey's pose."""
    scene, facts = opened
    track, camera = scene.cameras[0], facts["cameras"][0]
    assert camera["lens"] == pytest.approx(24.0, abs=1e-4)
    assert camera["sensor"] == pytest.approx(36.0, abs=1e-4)
    assert camera["near"] == pytest.approx(track.near)
    assert facts["frames"] == [0, len(track.poses) - 1]
    np.testing.assert_allclose(np.array(camera["poses"]) @ USD_FROM_CAMERA, track.poses, atol=1e-4)
    figures = {"lens_mm": float(camera["lens"]), "sensor_mm": float(camera["sensor"])}
    record_proof("stage/dcc: the survey's camera in Blender", len(track.poses), 7, figures)


def test_parts_stand_where_they_belong(opened: tuple[FlatScene, dict[str, Any]]) -> None:
    """Every mesh of the bridge keeps its name and its box."""
    scene, facts = opened
    paths = {row.id: row.path for row in scene.instances}
    geometry, draws = scene.geometry, scene.draws
    checked = 0
    for row, part in enumerate(draws.part):
        path = paths[int(draws.instance[row])]
        if not path.startswith("/World/Bridge/") or path.rsplit("/", 1)[-1] not in facts["boxes"]:
            continue
        first, count = geometry.part_first[part], geometry.part_count[part]
        used = geometry.positions[np.unique(geometry.triangles[first : first + count])]
        placed = used @ draws.transform[row, :3, :3].T + draws.transform[row, :3, 3]
        expected = facts["boxes"][path.rsplit("/", 1)[-1]]
        np.testing.assert_allclose([placed.min(axis=0), placed.max(axis=0)], expected, atol=1e-4)
        checked += 1
    bridge = {path for path in paths.values() if path.startswith("/World/Bridge/")}
    assert checked >= 0.9 * len(bridge)


def test_textures_are_found(opened: tuple[FlatScene, dict[str, Any]]) -> None:
    """Every texture that the materials read is loaded in Blender too."""
    scene, facts = opened
    wanted = {
        Path(texture.file).name
        for material in scene.materials
        for texture in (material.base_texture, material.roughness_texture, material.normal_texture)
        if texture
    }
    assert wanted
    assert wanted <= set(facts["images"])
