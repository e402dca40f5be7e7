"""Scenes that laser scanners are tested in, and a scan of one."""

import dataclasses
from pathlib import Path

import numpy as np

from groundwork.progress import SILENT
from recon.cloud import Cloud
from recon.sampling.sample_lidar import sample_lidar
from recon.sampling.sampler_settings import SCANNERS
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.flat_scene import FlatScene, InstanceRow
from usd_schemas.pinhole import look_at

POSE = look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3))[None]
EXACT = {"range_noise": 0.0, "range_noise_ppm": 0.0, "drop_out": 0.0, "beam_divergence": 0.0, "reach": 500.0}
SQUARE = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]], float)


def scanned(scene: FlatScene, folder: Path, **settings: object) -> Cloud:
    """Scan a scene into a new folder."""
    folder.mkdir()
    model = SCANNERS[str(settings.get("kind", "terrestrial"))]
    return sample_lidar(scene, folder, model.model_validate(settings), SILENT)


def ground(size: float = 400.0) -> FlatScene:
    """Build a level square at z = 0 that reflects one half."""
    builder = SceneBuilder()
    builder.add_mesh(SQUARE, placed((0.0, 0.0, 0.0), (size, size, 1.0)), 1)
    return builder.build(POSE)


def named(scene: FlatScene, **parts: tuple[int, str]) -> FlatScene:
    """Give instances a component: `component=(id, class)`."""
    rows = {number: InstanceRow(number, f"/P{number}", kind, name, {}, name) for kind, (number, name) in parts.items()}
    return dataclasses.replace(scene, instances=tuple(rows[number] for number in sorted(rows)))


def deck_on_walls() -> FlatScene:
    """Build a deck of 20 x 8 m at 6 m on two walls over level ground, with a parapet along one side."""
    builder = SceneBuilder()
    builder.add_mesh(SQUARE, placed((0.0, 0.0, 0.0), (60.0, 60.0, 1.0)), 1, 0)
    builder.add_box(placed((10.0, 0.0, 6.5), (20.0, 8.0, 1.0)), 2, 9)
    builder.add_box(placed((1.0, 0.0, 3.0), (2.0, 8.0, 6.0)), 3, 1)
    builder.add_box(placed((19.0, 0.0, 3.0), (2.0, 8.0, 6.0)), 4, 1)
    builder.add_box(placed((10.0, 3.9, 7.5), (20.0, 0.2, 1.0)), 5, 11)
    scene = builder.build(POSE)
    parts = {
        "ground": (1, "background"),
        "deck_slab": (2, "deck"),
        "abutment_wall": (3, "abutment"),
        "wing_wall": (4, "abutment"),
        "parapet": (5, "parapet"),
    }
    return named(scene, **parts)
