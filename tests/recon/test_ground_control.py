"""Ground control: both forms are read, points are triangulated as the closed form has it, bad files are one line."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.recon.gps_flights import frame_errors
from groundwork.errors import InputError, MissingError
from groundwork.length_units import METERS
from groundwork.progress import SILENT
from recon import reconstruct as conductor
from recon.cloud import read_cloud
from recon.placing.align import OK, Target
from recon.placing.align_control import align_to_control
from recon.placing.ground_control import (
    ControlPoint,
    GroundControl,
    Mark,
    ScaleBar,
    read_ground_control,
)
from recon.placing.map_projection import MapSystem, read_system
from recon.placing.marked_places import intersect_rays
from recon.placing.place import read_control
from recon.placing.similarity import Similarity
from recon.settings import ReconSettings
from recon.sfm.colmap_model import SparseModel, read_model
from recon.sfm.sparse import Sparse
from render.capture import CalibrationPrior, Capture, CaptureImage, read_capture
from tests.conftest import Count, RecordProof
from tests.recon.conftest import CAMERA
from tests.recon.test_align import random_rotations
from usd_schemas.distortion import Distortion
from usd_schemas.pinhole import look_at, project

F64 = NDArray[np.float64]
FILE = Path("gcp.txt")
SIZE = (1024, 768)
K1 = -0.08
NAMES = tuple(f"{row}.jpg" for row in range(8))
CORNERS = np.array([[0.0, 0, 0], [60, 0, 1], [60, 40, 0], [0, 40, 2], [30, 20, 5.0]])


def flown() -> tuple[SparseModel, Capture, Similarity, F64]:
    """Make eight cameras over a field in model units, the similarity to the world, and the true poses there."""
    rng = np.random.default_rng(0)
    true = np.stack(
        [
            look_at(np.array([x, y, 60.0]), np.array([x + 1.0, y + 6.0, 0.0]))
            for x in (0.0, 20.0, 40.0, 60.0)
            for y in (-5.0, 30.0)
        ]
    )
    known = Similarity(3.3, random_rotations(rng, 1)[0], np.array([400.0, -20.0, 7.0]))
    model = true.copy()
    model[:, :3, :3] = known.rotation.T @ true[:, :3, :3]
    model[:, :3, 3] = (true[:, :3, 3] - known.translation) @ known.rotation / known.scale
    params = (700.0, 512.0, 384.0, K1)
    nothing = np.zeros((0, 3))
    sparse = SparseModel(
        NAMES,
        model,
        "SIMPLE_RADIAL",
        params,
        nothing,
        nothing.astype(np.uint8),
        np.zeros(0),
        np.zeros(0, np.int64),
        np.zeros(0, np.int64),
        np.zeros((0, 2)),
    )
    images = tuple(CaptureImage(name=name[:-4], file=name) for name in NAMES)
    prior = CalibrationPrior(focal_px=700.0, cx=512.0, cy=384.0)
    return sparse, Capture(Path(), "s", SIZE, prior, (2.0, 2.0, 3.0), {}, images), known, true


def marked(points: F64, true: F64, noise: float = 0.0, seed: int = 1) -> tuple[ControlPoint, ...]:
    """Mark points in every photograph that shows them, with a keypoint noise [px]."""
    rng = np.random.default_rng(seed)
    found = []
    for number, point in enumerate(points):
        marks = []
        for name, pose in zip(NAMES, true, strict=True):
            local = (point - pose[:3, 3]) @ pose[:3, :3]
            uv = Distortion(K1, 0.0, 0.0, 0.0).distort((local[:2] / local[2])[None])[0] * 700.0 + [512.0, 384.0]
            uv = uv + rng.normal(0, noise, 2) if noise else uv
            if ((uv >= 0) & (uv <= SIZE)).all():
                marks.append(Mark(name, (float(uv[0]), float(uv[1]))))
        found.append(ControlPoint(f"P{number}", (float(point[0]), float(point[1]), float(point[2])), marks=marks))
    return tuple(found)


def no_gps() -> Target:
    """Make the target of photographs without GPS."""
    return Target("none", np.full((8, 3), np.nan), None, np.inf)


def placed(control: GroundControl) -> tuple[Any, Similarity]:
    """Lay the eight cameras onto some control."""
    sparse, capture, known, _ = flown()
    return align_to_control(sparse, np.arange(8), no_gps(), capture, control, np.random.default_rng(0)), known


def test_two_rays_meet_where_the_closed_form_says() -> None:
    """Of two skew rays at equal distances the point is the middle of their shortest connection; exact rays meet."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        point, centers = rng.normal(size=3), rng.normal(size=(5, 3)) * 8
        rays = point - centers
        np.testing.assert_allclose(
            intersect_rays(centers, rays / np.linalg.norm(rays, axis=1, keepdims=True)), point, atol=1e-9
        )
    centers, rays = np.array([[-3.0, 0.2, 0.0], [3.0, -0.2, 0.0]]), np.array([[0.6, 0.0, 0.8], [-0.6, 0.0, 0.8]])
    np.testing.assert_allclose(intersect_rays(centers, rays), [0.0, 0.0, 4.0], atol=1e-12)
    assert np.isnan(intersect_rays(centers, np.array([[0.0, 0.0, 1.0]] * 2))).all()


def test_exact_marks_give_the_exact_similarity(record_proof: RecordProof) -> None:
    """Five surveyed points, a lens that bends: the similarity comes back to 0.03 mm, as far as gravity pulls at it."""
    _, _, known, true = flown()
    points = tuple(replace(point, sigma=(0.001, 0.001, 0.001)) for point in marked(CORNERS, true))
    found, _ = placed(GroundControl(FILE, MapSystem("local", None), points))
    moved = found.alignment.similarity.move(np.eye(3))
    origin = found.facts["origin"]
    shift = np.array([origin["east"], origin["north"], origin["up"]])
    np.testing.assert_allclose(moved + shift, known.move(np.eye(3)), atol=3e-5)
    assert found.alignment.status == (OK,) * 8
    for row in found.facts["control_points"]:
        assert row["distance"] < 1e-5
        assert row["pixels"] < 1e-5
        assert row["agrees"]
    worst = float(np.abs(moved + shift - known.move(np.eye(3))).max())
    figures = {
        "worst_error_m": worst,
        "worst_residual_m": max(row["distance"] for row in found.facts["control_points"]),
    }
    record_proof("ground control: exact marks give the exact frame", len(CORNERS), 0, figures)


def test_noise_stays_within_the_stated_limits(proof_count: Count, record_proof: RecordProof) -> None:
    """Five to twelve points surveyed to 3 cm, marked to half a pixel: each of the four limits of 95 % holds."""
    _, _, known, true = flown()
    count, spots = proof_count(25, 1000), np.array([[x, y] for x in (0.0, 20.0, 40.0, 60.0) for y in (0.0, 20.0, 40.0)])
    spots = np.column_stack([spots, np.sin(spots[:, 0]) + 0.1 * spots[:, 1]])
    kept, residuals = [], []
    for seed in range(count):
        draw = np.random.default_rng(seed)
        chosen = np.sort(draw.choice(len(spots), int(draw.integers(5, 13)), replace=False))
        points = tuple(
            replace(point, position=tuple(np.array(point.position) + draw.normal(0, 0.03, 3)))
            for point in marked(spots[chosen], true, 0.5, 1000 + seed)
        )
        found, _ = placed(GroundControl(FILE, MapSystem("local", None), points))
        fit, stated = found.alignment.similarity, found.alignment.errors
        fit = replace(
            fit, translation=fit.translation + [found.facts["origin"][axis] for axis in ("east", "north", "up")]
        )
        errors = frame_errors(fit, known, np.array([point.position or () for point in points]).mean(axis=0))
        kept.append([getattr(errors, name) <= getattr(stated, name) for name in ("scale", "tilt", "heading", "place")])
        residuals.append(np.mean([row["distance"] for row in found.facts["control_points"]]))
    shares = dict(zip(("scale", "tilt", "heading", "place"), np.mean(kept, axis=0).tolist(), strict=True))
    record_proof("ground control: stated 95 % limits", count, 0, {f"{name}_within": s for name, s in shares.items()})
    assert min(shares.values()) > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / count), shares
    assert 0.015 < np.mean(residuals) < 0.08


def test_a_point_surveyed_wrongly_is_named() -> None:
    """One of seven points two meters off is left out and reported so; the others still fit to a millimeter."""
    _, _, known, true = flown()
    more = np.concatenate([CORNERS, [[15.0, 10.0, 1.0], [45.0, 25.0, 3.0]]])
    points = list(marked(more, true))
    points[2] = replace(points[2], position=(62.0, 40.0, 0.0))
    found, _ = placed(GroundControl(FILE, MapSystem("local", None), tuple(points)))
    assert [row["agrees"] for row in found.facts["control_points"]] == [True, True, False, True, True, True, True]
    assert found.facts["control_points"][2]["distance"] == pytest.approx(2.0, abs=1e-3)
    assert found.alignment.similarity.scale == pytest.approx(known.scale, rel=1e-5)


def test_scale_bars_alone_give_meters() -> None:
    """Two bars between marked points, no coordinates and no GPS: the scale is right."""
    _, _, known, true = flown()
    points = tuple(replace(point, position=None) for point in marked(CORNERS, true))
    bars = (
        ScaleBar(("P0", "P1"), float(np.linalg.norm(CORNERS[1] - CORNERS[0])), 0.01),
        ScaleBar(("P1", "P2"), float(np.linalg.norm(CORNERS[2] - CORNERS[1])), 0.01),
    )
    found, _ = placed(GroundControl(FILE, MapSystem("local", None), points, bars))
    assert found.kind == "scale bars"
    assert found.alignment.similarity.scale == pytest.approx(known.scale, rel=1e-9)
    assert [abs(row["error"]) < 1e-6 for row in found.facts["scale_bars"]] == [True, True]


@pytest.mark.parametrize("bars", [1, 2])
def test_limits_of_scale_bars_hold(bars: int, proof_count: Count, record_proof: RecordProof) -> None:
    """Bars of ten meters known to 5 mm, their ends marked to a pixel: the limit of 95 % counts both errors."""
    _, _, known, true = flown()
    count, starts = proof_count(60, 1000), np.array([[10.0, 10.0, 0.0], [45.0, 25.0, 1.0]])[:bars]
    kept = []
    for seed in range(count):
        draw = np.random.default_rng(seed)
        ends = np.repeat(starts, 2, axis=0) + np.tile([[0.0, 0.0, 0.0], [8.0, 6.0, 0.0]], (bars, 1))
        points = tuple(replace(point, position=None) for point in marked(ends, true, 1.0, 1000 + seed))
        measured = tuple(
            ScaleBar((f"P{2 * row}", f"P{2 * row + 1}"), 10.0 + draw.normal(0, 0.005), 0.005) for row in range(bars)
        )
        found, _ = placed(GroundControl(FILE, MapSystem("local", None), points, measured))
        error = abs(found.alignment.similarity.scale / known.scale - 1.0)
        kept.append(100.0 * error <= found.alignment.errors.scale)
    share = float(np.mean(kept))
    record_proof(f"scale bars: stated 95 % limit, {bars}", count, 0, {"within": share})
    assert share > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / count), share


def test_one_wrong_mark_leaves_the_limits_of_the_others() -> None:
    """A mark 300 px off, in one photograph of a point: that point counts little, and the limits hardly change."""
    _, _, known, true = flown()
    points = list(marked(np.concatenate([CORNERS, [[15.0, 30.0, 1.0]]]), true, 0.5))
    sound, _ = placed(GroundControl(FILE, MapSystem("local", None), tuple(points)))
    mark = points[2].marks[0]
    wrong = Mark(mark.image, (mark.uv[0], mark.uv[1] - np.sign(mark.uv[1] - 400.0) * 300.0))
    points[2] = replace(points[2], marks=[wrong, *points[2].marks[1:]])
    found, _ = placed(GroundControl(FILE, MapSystem("local", None), tuple(points)))
    assert found.facts["control_points"][2]["pixels"] > 30.0
    assert found.alignment.similarity.scale == pytest.approx(known.scale, rel=2e-3)
    for name in ("scale", "tilt", "heading", "place"):
        assert getattr(found.alignment.errors, name) < 2.0 * getattr(sound.alignment.errors, name)


@pytest.mark.parametrize(
    "system", ["+proj=lcc +lat_1=35 +units=us-ft +no_defs", 'PROJCS["x",UNIT["US survey foot",0.3048006096]]']
)
def test_feet_become_meters(system: str) -> None:
    """A plane system in feet: the scale is that of meters, and so is the origin."""
    _, _, known, true = flown()
    feet = tuple(
        replace(point, position=tuple((np.array(point.position) / METERS["us-ft"] + [2e6, 5e5, 0.0]).tolist()))
        for point in marked(CORNERS, true)
    )
    read = read_system(system)
    assert read is not None
    assert not read.assumed
    found, _ = placed(GroundControl(FILE, read, feet))
    assert found.alignment.similarity.scale == pytest.approx(known.scale, rel=1e-5)
    assert found.facts["origin"]["east"] == pytest.approx(2e6 * METERS["us-ft"], abs=100.0)
    utm = read_system("+proj=utm +zone=10 +ellps=WGS84 +units=us-ft")
    assert utm is not None
    meters = MapSystem("", 10).geographic(np.array([[5e5, 4e6, 30.0]]))
    np.testing.assert_allclose(utm.geographic(np.array([[5e5, 4e6, 30.0]]) / METERS["us-ft"]), meters, atol=1e-9)


def test_what_does_not_fit_is_one_line(tmp_path: Path) -> None:
    """No file, a picture, marks of other photographs, outside the image, on one line, too few: a line for each."""
    with pytest.raises(MissingError, match="no such file"):
        read_ground_control(tmp_path / "none.txt")
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff\xe0" + bytes(range(256)))
    with pytest.raises(InputError, match="not a text file"):
        read_ground_control(tmp_path / "a.jpg")
    _, capture, _, true = flown()
    (tmp_path / "gcp.txt").write_text("LOCAL\n1 2 3 4 5 other.jpg P\n", encoding="utf-8")
    with pytest.raises(InputError, match="has no mark in these photographs"):
        read_control(tmp_path / "gcp.txt", replace(capture, folder=tmp_path), SILENT)
    points = marked(CORNERS, true)
    local = MapSystem("local", None)
    outside = replace(points[0], marks=[Mark("0.jpg", (-5.0, 3.0))])
    with pytest.raises(InputError, match="mark of P0 lies outside the image"):
        placed(GroundControl(FILE, local, (outside,)))
    with pytest.raises(InputError, match="2 of 2 control points"):
        placed(GroundControl(FILE, local, points[:2]))
    row = marked(np.array([[12.0 * x, 20.0 - 2.0 * x, 0.0] for x in range(5)]), true, 0.3)
    with pytest.raises(InputError, match=r"control points do not determine a coordinate frame \((tilt|two ways)"):
        placed(GroundControl(FILE, local, row))


def test_photographs_are_laid_onto_control(
    plane_capture: Path,
    plane_cloud: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    record_proof: RecordProof,
) -> None:
    """The planes' model, placed by corners that photographs show: residuals stand in cloud.json, meters are right."""
    truth = read_capture(plane_capture)
    bare, folder = tmp_path / "bare", tmp_path / "cloud"
    shutil.copytree(plane_capture, bare, ignore=shutil.ignore_patterns("truth"))
    folder.mkdir()
    model = read_model(plane_cloud / "sparse")
    spots = np.array(
        [[-2.0, 5.0, 0.5], [2.0, 5.0, 0.5], [2.0, 5.0, 3.0], [-2.0, 5.0, 3.0], [0.0, 1.5, 0.0], [1, 2.5, 0]]
    )
    true = {row["name"]: np.array(row["camera_to_world"]) for row in conductor_poses(plane_capture)}
    lines = ["LOCAL"]
    for number, spot in enumerate(spots):
        for image in truth.images:
            uv, depth = project(spot[None], CAMERA, true[image.name])
            if depth[0] > 0 and (uv[0] > 0).all() and (uv[0] < [CAMERA.width, CAMERA.height]).all():
                lines.append(
                    f"{1000 + spot[0]} {2000 + spot[1]} {spot[2]} {uv[0][0]} {uv[0][1]} {image.name}.jpg C{number}"
                )
    (tmp_path / "gcp_list.txt").write_text("\n".join(lines), encoding="utf-8")
    made = Sparse(model, plane_cloud / "sparse", "", {}, {})
    monkeypatch.setattr(conductor, "run_sparse", lambda *_: made)
    conductor.reconstruct(bare, folder, ReconSettings(mode="sparse"), SILENT, tmp_path / "gcp_list.txt")
    cloud = read_cloud(folder)
    assert cloud.alignment["target"] == "control points"
    assert cloud.alignment["unit"] == "m"
    assert len(cloud.alignment["control_points"]) == len(spots)
    assert max(row["distance"] for row in cloud.alignment["control_points"]) < 0.05
    assert cloud.alignment["expected_error"]["scale_percent"] < 2.0
    assert cloud.alignment["origin"]["system"] == "LOCAL"
    assert "aligned to 6 control points (" in cloud.alignment["note"]
    origin = np.array([cloud.alignment["origin"][axis] for axis in ("east", "north", "up")])
    coord = cloud.columns["coord"] + origin - [1000.0, 2000.0, 0.0]
    near = (np.abs(coord[:, 1] - 5.0) < 0.1) | (np.abs(coord[:, 2]) < 0.1)
    assert near.mean() > 0.6
    figures = {"worst_residual_m": max(row["distance"] for row in cloud.alignment["control_points"])}
    figures["stated_scale_percent"] = cloud.alignment["expected_error"]["scale_percent"]
    record_proof("ground control: photographs laid onto points", len(spots), 0, figures)
    with pytest.raises(InputError, match="a capture with truth is aligned to its truth"):
        conductor.reconstruct(plane_capture, tmp_path, ReconSettings(mode="sparse"), SILENT, tmp_path / "gcp_list.txt")


def conductor_poses(capture: Path) -> Any:
    """Read the true poses of a capture."""
    import json

    return json.loads((capture / "truth" / "poses.json").read_text(encoding="utf-8"))["poses"]
