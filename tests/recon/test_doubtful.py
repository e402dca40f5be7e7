"""Doubtful pairs: a bridge whose two ends look alike is not folded onto itself."""

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray

from recon.settings import SparseSettings
from recon.sfm import mapping
from recon.sfm.colmap_model import read_model
from recon.sfm.database import DATABASE
from recon.sfm.doubtful import doubtful_pairs
from render.capture import Capture
from tests.conftest import Count, RecordProof
from tests.recon.test_mapping import FOCAL, SIZE, Heard, write_matches
from usd_schemas.pinhole import look_at

F64 = NDArray[np.float64]
Alike = tuple[Capture, F64, set[int]]
HALF, SIDE, STEP = 50.0, 16.0, 4.0  # [m] half a bridge, the flight beside it, and between two images
ENDS = 160  # points of each end


def alike(folder: Path, seed: int, places: F64 | None = None) -> Alike:
    """Write the matches of a flight round a bridge whose one end is the other one, turned by half a turn.

    Args:
        folder: Receives the database.
        seed: Of the bridge.
        places: Fixes [m], shape (I, 3); the true places, 0.5 m off, when None.

    Returns:
        The capture, true camera centers [m], shape (I, 3), and the ids of the pairs that show both ends.
    """
    rng = np.random.default_rng(seed)
    end = rng.uniform((-HALF - 8, -4, -3), (-HALF + 14, 4, 3), (ENDS, 3))
    middle = rng.uniform((-HALF, -4, -3), (HALF, 4, 3), (2 * ENDS, 3))
    points, twin = np.concatenate([end, end * [-1, -1, 1], middle]), np.arange(ENDS)
    side = np.arange(-HALF, HALF + 0.1, STEP)
    turn = np.linspace(-1.4, 1.4, 11)
    plan = [(x, -SIDE) for x in side] + [(HALF + SIDE * np.cos(a), SIDE * np.sin(a)) for a in turn]
    eyes = np.array([*plan, *(np.array(plan) * -1)])
    eyes = np.column_stack([eyes, rng.normal(0, 1, len(eyes))])
    poses = np.stack([look_at(eye, np.array([np.clip(eye[0], -HALF, HALF), 0.0, 0.0])) for eye in eyes])
    local = np.einsum("iba,inb->ina", poses[:, :3, :3], points - poses[:, None, :3, 3])
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = 0.6 * FOCAL * local[..., :2] / local[..., 2:] + np.array(SIZE) / 2
    seen = ((pixels > 0) & (pixels < SIZE)).all(axis=2) & (local[..., 2] > 1)
    pixels = np.where(seen[..., None], pixels, 0.0) + rng.normal(0, 0.3, pixels.shape)
    fixes = eyes + rng.normal(0, 0.5, eyes.shape) if places is None else places
    capture = write_matches(folder, pixels, seen, fixes)
    return capture, eyes, _geometries(folder, poses, pixels, seen, twin)


def _geometries(folder: Path, poses: F64, pixels: F64, seen: NDArray[np.bool_], twin: NDArray[np.int64]) -> set[int]:
    """Verify the pairs anew, as matching does, and add pairs of cameras at the two ends; return these."""
    half, false = len(poses) // 2, set[int]()
    number = np.cumsum(seen, axis=1) - 1
    with pycolmap.Database.open(folder / DATABASE) as database:
        images = sorted(database.read_all_images(), key=lambda image: image.image_id)
        camera = database.read_all_cameras()[0]
        camera.params = [0.6 * FOCAL, *np.array(SIZE) / 2, 0.0][: len(camera.params)]
        database.update_camera(camera)
        database.clear_matches()
        database.clear_two_view_geometries()
        for i in range(len(poses)):
            for j in range(i + 1, len(poses)):
                near = np.linalg.norm(poses[i, :3, 3] - poses[j, :3, 3]) < 6 * STEP
                other = i % 6 == 0 and abs(j - i - half) <= 2 and np.abs(poses[[i, j], 0, 3]).min() > HALF - 12
                if not near and not other:
                    continue
                first, second = (twin, twin + len(twin)) if other else (np.arange(seen.shape[1]),) * 2
                if other and poses[i, 0, 3] > 0:
                    first, second = second, first
                both = seen[i, first] & seen[j, second]
                matches = np.column_stack([number[i, first[both]], number[j, second[both]]]).astype(np.uint32)
                if len(matches) < 20:
                    continue
                sides = (pixels[i][seen[i]], pixels[j][seen[j]])  # keypoints as they are stored
                geometry = pycolmap.estimate_calibrated_two_view_geometry(
                    camera, sides[0], camera, sides[1], matches, pycolmap.TwoViewGeometryOptions()
                )
                if len(geometry.inlier_matches) < 20:
                    continue
                pair = images[i].image_id, images[j].image_id
                database.write_matches(*pair, geometry.inlier_matches)
                database.write_two_view_geometry(*pair, geometry)
                false |= {pycolmap.image_pair_to_pair_id(*pair)} if other else set()
    return false


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Alike:
    """Give the first bridge; read only."""
    return alike(tmp_path_factory.mktemp("first") / "pairs", 1)


def test_pairs_of_two_ends_are_told_by_gps(
    first: Alike, tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """Exactly the false pairs are found; none where fixes are missing, and none where GPS itself must be wrong."""
    count, found = proof_count(1, 12), 0
    for seed in range(1, count + 1):
        capture, eyes, false = first if seed == 1 else alike(tmp_path / str(seed), seed)
        folder = capture.folder
        fixes = {image.file: image.gps for image in capture.images if image.gps is not None}
        assert len(false) >= 5
        assert doubtful_pairs(folder / DATABASE, fixes) == false
        assert doubtful_pairs(folder / DATABASE, {}) == set()
        mixed = np.random.default_rng(seed).permutation(eyes).tolist()
        wrong = {name: (x, y, z) for name, (x, y, z) in zip(fixes, mixed, strict=True)}
        assert doubtful_pairs(folder / DATABASE, wrong) == set()
        found += len(false)
    record_proof("doubtful pairs: two like ends of a bridge", count, 1, {"false_pairs_found": found})


def test_a_bridge_with_two_like_ends_is_not_folded(first: Alike, tmp_path: Path) -> None:
    """All cameras stand where they were, up to a similarity; the log tells how many pairs were left out."""
    capture, eyes, false = first
    (tmp_path / "out").mkdir()
    heard = Heard()
    result = mapping.map_images(capture, capture.folder, tmp_path / "out", SparseSettings(), 0, heard)
    model = read_model(tmp_path / "out" / mapping.MODEL)
    names = [image.file for image in capture.images]
    rows = [names.index(name) for name in model.names]
    assert len(rows) == len(eyes)
    fit = pycolmap.estimate_sim3d(model.poses[:, :3, 3], eyes[rows])
    assert fit is not None
    moved = fit.scale * model.poses[:, :3, 3] @ fit.rotation.matrix().T + fit.translation
    assert np.linalg.norm(moved - eyes[rows], axis=1).max() < 0.5
    assert result["doubtful"] == len(false)
    assert any(note.startswith(f"{len(false)} pairs") for note in heard.notes)
