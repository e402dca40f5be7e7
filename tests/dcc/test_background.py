"""A world that was made in the real Blender becomes a background: in meters, upright, textured, and background only."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from authoring.scenes.validate import validate_scene
from authoring.variants.add import set_choices
from groundwork.canonical import file_digest
from groundwork.errors import InputError
from tests.conftest import RecordProof
from tests.dcc.blender import run_in_blender
from tests.dcc.round_trip import copy_scene, harvest, trip
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.guard.guard import check_stage
from usd_schemas.reading.stage_reader import read_stage

pytestmark = pytest.mark.dcc

CENTIMETERS_Y_UP = {
    "convert_orientation": True,
    "export_global_forward_selection": "NEGATIVE_Z",
    "export_global_up_selection": "Y",
    "convert_scene_units": "CENTIMETERS",
}
EXPORTS: dict[str, dict[str, Any]] = {
    "as_it_comes": {},
    "without_a_root": {"root_prim_path": ""},
    "centimetres": CENTIMETERS_Y_UP,
    "centimetres_without_a_root": {**CENTIMETERS_Y_UP, "root_prim_path": ""},
}


def export_world(folder: Path, name: str, options: dict[str, Any]) -> Path:
    """Let Blender make and export the world."""
    folder.mkdir()
    request = {"out": str(folder / f"{name}.usdc"), "options": options, "image": str(folder / "brick_work.png")}
    run_in_blender("world_scene.py", json.dumps(request))
    (folder / "brick_work.png").unlink()
    return folder / f"{name}.usdc"


@pytest.mark.parametrize("name", EXPORTS)
def test_world_from_blender_is_a_background(
    name: str, original: Path, tmp_path: Path, record_proof: RecordProof
) -> None:
    """Right size and place, textured, class background; bridge, survey and light stay as they were."""
    scene = copy_scene(original, tmp_path / "scene")
    world = export_world(tmp_path / "world", name, EXPORTS[name])
    check_stage(world, (), pytest.fail)
    set_choices(scene, {"background": str(world)}, lambda line: None)
    before, after = read_stage(original), read_stage(scene)
    low, high = _box(after, "Tower")
    np.testing.assert_allclose([low, high], [[55.0, 74.0, 0.0], [65.0, 86.0, 30.0]], atol=1e-3)
    rows = {row.path.rsplit("/", 1)[-1]: row for row in after.instances}
    assert rows["Tower"].class_name == rows["Field"].class_name == "background"
    (brick,) = [material for material in after.materials if material.name.endswith("/Brick")]
    assert brick.base_texture is not None
    assert Path(brick.base_texture.file).is_relative_to(scene.parent.resolve())
    poses = [(one.poses, two.poses) for one, two in zip(before.cameras, after.cameras, strict=True)]
    changed = sum(one.tobytes() != two.tobytes() for one, two in poses)
    assert changed == 0
    assert after.sun == before.sun
    for layer in ("bridge/geometry.usdc", "bridge/semantics.usda", "surveys/global.usdc", "lighting.usda"):
        assert file_digest(scene.parent / layer) == file_digest(original.parent / layer)
    assert validate_scene(scene) == []
    off = float(np.abs(np.array([low, high]) - [[55.0, 74.0, 0.0], [65.0, 86.0, 30.0]]).max())
    record_proof(
        f"stage/dcc: a world from Blender, {name}", 1, 7, {"largest_offset_m": off, "changed_cameras": changed}
    )


def test_missing_texture_names_its_material(original: Path, tmp_path: Path) -> None:
    """A world whose texture stayed behind is refused, and nothing of it is left in the scene."""
    scene = copy_scene(original, tmp_path / "scene")
    world = export_world(tmp_path / "world", "bare", {})
    (image,) = (tmp_path / "world").rglob("*.png")
    image.unlink()
    with pytest.raises(InputError, match=r"/_materials/Brick.*brick_work.png"):
        set_choices(scene, {"background": str(world)}, print)
    assert scene.read_bytes() == original.read_bytes()


def test_objects_of_a_foreign_world_are_no_new_objects(original: Path, tmp_path: Path) -> None:
    """A scene with such a world goes through Blender and comes back without a change."""
    scene = copy_scene(original, tmp_path / "scene")
    set_choices(scene, {"background": str(export_world(tmp_path / "world", "town", CENTIMETERS_Y_UP))}, print)
    found = harvest(scene, trip(scene, tmp_path / "out", [])[0])
    assert not any(asdict(found).values())


def _box(scene: FlatScene, name: str) -> tuple[list[float], list[float]]:
    number = next(row.id for row in scene.instances if row.path.rsplit("/", 1)[-1] == name)
    corners, _, rows = world_triangles(scene)
    own = corners[np.isin(rows, np.flatnonzero(scene.draws.instance == number))].reshape(-1, 3)
    return own.min(axis=0).tolist(), own.max(axis=0).tolist()
