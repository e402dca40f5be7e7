"""The hash of a bridge's shape: the same for whatever shows it, another for another bridge."""

from pathlib import Path

import numpy as np

from groundwork.progress import SILENT
from recon.cloud import read_cloud
from recon.sampling.sample_mesh import sample_mesh
from recon.sampling.sampler_settings import MeshSettings
from recon.sampling.scene_surface import lay_out
from recon.truth.bridge_digest import bridge_digest
from render.images.truth_checks import read_surface
from render.writing.capture_writer import _write_surface
from tests.render.scenes import random_scene
from usd_schemas.flat_scene import InstanceRow


def rows(*paths: str) -> tuple[InstanceRow, ...]:
    """Give instances 1, 2, … these paths."""
    return tuple(InstanceRow(i, path, "", "") for i, path in enumerate(paths, 1))


BOXES = np.random.default_rng(2).normal(0, 20, (60, 3, 3))
IDS = np.repeat(np.arange(1, 4), 20).astype(np.uint32)
LABELS = np.repeat([9, 8, 0], 20).astype(np.uint8)
PATHS = ("/World/Bridge/A", "/World/Bridge/B", "/World/Site/C")


def test_only_the_shape_of_the_bridge_counts() -> None:
    """Order, ids, labels, the site and rounding change nothing; a millimeter or a triangle more does."""
    found = bridge_digest(BOXES, IDS, LABELS, rows(*PATHS))
    assert len(found) == 64
    order = np.random.default_rng(0).permutation(60)
    other = np.array([0, 7, 5, 90], np.uint32)[IDS[order]]
    renamed = tuple(InstanceRow(int(i), path, "", "") for i, path in zip((7, 5, 90), PATHS, strict=True))
    assert bridge_digest(BOXES[order], other, LABELS * 0, renamed) == found
    moved = BOXES.copy()
    moved[40:] += 5.0
    assert bridge_digest(moved + 1e-9, IDS, LABELS, rows(*PATHS)) == found
    moved[3] += 100.0
    assert bridge_digest(moved, IDS, LABELS, rows(*PATHS)) != found
    assert bridge_digest(BOXES[1:], IDS[1:], LABELS[1:], rows(*PATHS)) != found


def test_stages_from_elsewhere_have_a_bridge_too() -> None:
    """Without a bridge of ours, components, then classes, then everything counts."""
    below = bridge_digest(BOXES, IDS, LABELS, rows(*PATHS))
    parts = tuple(InstanceRow(i, "/x", kind, "") for i, kind in enumerate(("girder_box", "column", "tree"), 1))
    parts = (InstanceRow(1, "/x", "box_girder", ""), *parts[1:])
    assert bridge_digest(BOXES, IDS, LABELS, parts) == below
    assert bridge_digest(BOXES, IDS, LABELS, rows("/x", "/y", "/z")) == below
    assert bridge_digest(BOXES, IDS, LABELS * 0, rows("/x", "/y", "/z")) != below
    assert bridge_digest(BOXES[:0], IDS[:0], LABELS[:0], ()) == ""


def test_a_sampled_cloud_and_a_capture_say_the_same(tmp_path: Path) -> None:
    """The stage laid out by the samplers, and the surface that a capture keeps of it, have one hash."""
    scene = random_scene(4, np.array([100.0, -50.0, 3.0]))
    (tmp_path / "cloud").mkdir()
    cloud = sample_mesh(scene, tmp_path / "cloud", MeshSettings(points=500), SILENT)
    _write_surface(tmp_path / "surface.npz", scene)
    surface = read_surface(tmp_path / "surface.npz")
    assert bridge_digest(*surface, scene.instances) == cloud.bridge != ""
    assert read_cloud(tmp_path / "cloud").bridge == cloud.bridge
    assert len(lay_out(scene).corners) == len(surface[0])
