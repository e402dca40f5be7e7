"""The score of a flight against the instance images that the renderer draws of it."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.surveys.framing import eye_of
from authoring.surveys.score import ENOUGH_VIEWS, WIDEST_INCIDENCE, score_flight
from authoring.surveys.stage_subject import stage_subject
from groundwork.progress import SILENT
from render.capture import Truth, read_capture, read_truth
from render.frames import render_stage
from render.settings import RenderSettings, SensorSettings
from tests.authoring.small_scene import write_small_scene
from tests.conftest import Count, RecordProof
from tests.render.prepared_here import prepared_here
from usd_schemas.pinhole import project
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
SLACK = (
    0.03,
    0.01,
)  # [m] and share of the depth by which an image's depth may differ from that of a point in its pixel


def scattered(corners: F64, owners: NDArray[np.integer], instance: int, count: int, seed: int) -> tuple[F64, F64]:
    """Random points on the surface of an instance, evenly by area, and their normals."""
    own = corners[owners == instance]
    cross = np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])
    area = np.linalg.norm(cross, axis=1)
    rng = np.random.default_rng(seed)
    rows = rng.choice(len(own), count, p=area / area.sum())
    u, v = rng.random((2, count))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    a, b, c = np.moveaxis(own[rows], 1, 0)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), cross[rows] / area[rows, None]


def counted(truth: Truth, instance: int, points: F64, normals: F64) -> float:
    """Share of points whose pixel shows their instance at their depth, squarely enough, in enough images."""
    views = np.zeros(len(points), np.int64)
    for index, pose in enumerate(truth.poses):
        toward = pose[:3, 3] - points
        square = np.sum(toward * normals, axis=1) >= np.cos(np.radians(WIDEST_INCIDENCE)) * np.linalg.norm(
            toward, axis=1
        )
        pixels, depth = project(points, truth.camera, pose)
        framed = (depth > 0) & ((pixels >= 0) & (pixels < [truth.camera.width, truth.camera.height])).all(axis=1)
        rows = np.flatnonzero(square & framed)
        column, line = pixels[rows].astype(np.int64).T
        ids, drawn = truth.instance(index)[line, column], truth.depth(index)[line, column]
        shown = (ids == instance) & (np.abs(drawn - depth[rows]) < SLACK[0] + SLACK[1] * depth[rows])
        views[rows[shown]] += 1
    return float((views >= ENOUGH_VIEWS).mean())


@pytest.mark.slow
def test_coverage_is_that_of_the_rendered_images(tmp_path: Path, proof_count: Count, record_proof: RecordProof) -> None:
    """For each class, and for each large component, the share that rays promise is the share that images show."""
    survey = {"kind": "global", "images": proof_count(8, 40), "spacing": 30.0, "width": proof_count(480, 1280)}
    scene = write_small_scene(tmp_path, survey=[survey])
    capture = tmp_path / "capture"
    capture.mkdir()
    settings = RenderSettings(quality="fast", shadow_size=256, sensor=SensorSettings(noise=False))
    with prepared_here():
        render_stage(scene, capture, settings, 1, SILENT)
    truth = read_truth(read_capture(capture))
    assert truth is not None
    flat = read_stage(scene)
    subject = stage_subject(flat)
    bridge = subject.bridge, subject.bridge_ids.astype(np.int64)
    score = score_flight(truth.poses, eye_of(truth.camera), 0.0, bridge, subject.obstacles)
    classes = {row.id: row.class_name for row in flat.instances}
    promised, shown, names = [], [], []
    for instance, share in score.covered.items():
        points, normals = scattered(*bridge, instance, 1000, instance)
        promised.append(share)
        shown.append(counted(truth, instance, points, normals))
        names.append(classes[instance])
    difference = 100.0 * np.abs(np.array(promised) - np.array(shown))
    of_class = {
        name: 100.0
        * abs(float(np.mean([p - s for p, s, other in zip(promised, shown, names, strict=True) if other == name])))
        for name in sorted(set(names))
    }
    figures = {
        "images": len(truth.poses),
        "components": len(names),
        "mean_difference_points": float(difference.mean()),
        "components_within_3_points": float((difference <= 3.0).mean()),
        "worst_points": float(difference.max()),
        **{f"{name}_points": value for name, value in of_class.items()},
    }
    assert difference.mean() <= 2.0, figures
    assert figures["components_within_3_points"] >= 0.75, figures
    # Grates and lamp posts are hardly wider than a pixel here: what their pixels show is what lies beside them.
    assert max(value for name, value in of_class.items() if name != "background") <= 3.0, figures
    record_proof("surveys/score against rendered instance images", len(names), 7, figures)
