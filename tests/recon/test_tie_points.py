"""Tie points hold every cell and every pair, by a loop's word; a model mapped with them is the model of all matches."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from groundwork.progress import SILENT
from recon.settings import SparseSettings
from recon.sfm.colmap_model import SparseModel, read_model
from recon.sfm.database import DATABASE
from recon.sfm.mapping import MODEL, map_images
from recon.sfm.tie_points import Matches, choose_tie_points, write_tie_points
from render.capture import CalibrationPrior, Capture, CaptureImage

_CELLS = 4


def draw(rng: np.random.Generator, images: int = 6, points: int = 1500) -> Matches:
    """Draw points that some images see, matched in some of their pairs, with a few wrong matches."""
    per_image = [np.flatnonzero(rng.random(points) < 0.5) for _ in range(images)]
    sizes = [len(seen) for seen in per_image]
    begin = np.concatenate([[0], np.cumsum(sizes)])
    pairs, firsts, seconds = [], [], []
    for number, (a, b) in enumerate(pair for pair in combinations(range(images), 2) if sum(pair) % 3):
        _, in_a, in_b = np.intersect1d(per_image[a], per_image[b], return_indices=True)
        wrong = rng.random(len(in_b)) < 0.01
        in_b = np.where(wrong, rng.integers(0, sizes[b], len(in_b)), in_b)
        keep = rng.random(len(in_a)) < 0.8
        pairs.append(np.full(keep.sum(), number))
        firsts.append(begin[a] + in_a[keep])
        seconds.append(begin[b] + in_b[keep])
    image = np.repeat(np.arange(images), sizes)
    cell = image * _CELLS + rng.integers(0, _CELLS, len(image))
    return Matches(image, cell, *(np.concatenate(part) for part in (pairs, firsts, seconds)))


def tracks_of(matches: Matches) -> np.ndarray:
    """Follow matches from keypoint to keypoint, one by one."""
    leader = list(range(len(matches.image)))

    def find(keypoint: int) -> int:
        while leader[keypoint] != keypoint:
            keypoint = leader[keypoint]
        return keypoint

    for first, second in zip(matches.first.tolist(), matches.second.tolist(), strict=True):
        leader[find(first)] = find(second)
    return np.array([find(keypoint) for keypoint in range(len(leader))])


@pytest.mark.parametrize("seed", range(5))
def test_every_cell_and_every_pair_keeps_its_share(seed: int) -> None:
    """Whole tracks stay; as many as a cell and a pair are due; sound ones first, longer ones before those of two."""
    rng = np.random.default_rng(seed)
    matches = draw(rng)
    limit = 192  # two of a cell; and 100 of a pair
    stays = choose_tie_points(matches, limit, np.random.default_rng(seed))
    track = tracks_of(matches)
    members = {int(name): np.flatnonzero(track == name) for name in np.unique(track)}
    sound = {n for n, m in members.items() if len(m) > 1 and len(set(matches.image[m])) == len(m)}
    joined = {name for name, m in members.items() if len(m) > 1}
    kept = set(track[matches.first[stays]].tolist())
    assert 0 < len(kept) < len(sound) < len(joined)
    assert stays.tolist() == [name in kept for name in track[matches.first]]
    groups = [
        ({int(name) for name in names[group == one]} & joined, due)
        for group, names, due in ((matches.cell, track, 2), (matches.pair, track[matches.first], 100))
        for one in np.unique(group)
    ]
    assert all(len(here & kept) >= min(due, len(here)) for here, due in groups)
    for better in (sound, {name for name in sound if len(members[name]) > 2}):
        wanting = set().union(*(here for here, due in groups if len(here & better) < due))
        assert kept <= better | wanting  # a worse track stays only where the better ones are too few
    assert (choose_tie_points(matches, limit, np.random.default_rng(seed)) == stays).all()
    assert (choose_tie_points(matches, limit, np.random.default_rng(seed + 1)) != stays).any()


def synthetic(folder: Path, images: int = 10, points: int = 3000) -> Capture:
    """Write a database of images that see some points, four each, with noise."""
    pycolmap.set_random_seed(1)
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1,
        num_cameras_per_rig=1,
        num_frames_per_rig=images,
        num_points3D=points,
        track_length=4,
        prior_position=True,
    )
    with pycolmap.Database.open(folder / DATABASE) as database:
        model = pycolmap.synthesize_dataset(options, database)
        pycolmap.synthesize_noise(pycolmap.SyntheticNoiseOptions(point2D_stddev=0.2), model, database)
        names = sorted(image.name for image in database.read_all_images())
    shots = tuple(CaptureImage(name=name, file=name, gps=None) for name in names)
    prior = CalibrationPrior(focal_px=1280.0, cx=512.0, cy=384.0)
    return Capture(folder, "s", (1024, 768), prior, (1.0, 1.0, 1.0), {"kind": "local"}, shots)


@pytest.mark.parametrize("mapper", ["incremental", "global"])
def test_a_model_of_tie_points_is_the_model_of_all_matches(mapper: str, tmp_path: Path) -> None:
    """All points come back, the cameras stand where all matches put them, and nothing is left on the disk."""
    capture = synthetic(tmp_path, 7, 900)  # more than two hundred matches of each pair
    models: list[SparseModel] = []
    for limit in (100, 4000):
        folder = tmp_path / str(limit)
        folder.mkdir()
        settings = SparseSettings.model_validate({"mapper": mapper, "tie_points": limit})
        found = map_images(capture, tmp_path, folder, settings, 0, SILENT)
        assert found["tie_points"] == (limit == 100)
        models.append(read_model(folder / MODEL))
        assert found["models"] == [{"images": 7, "points": len(models[-1].points)}]
        assert [path.name for path in folder.iterdir()] == [MODEL]
    few, all_ = models
    assert len(few.points) >= 0.99 * len(all_.points)
    assert len(few.obs_point) >= 0.99 * len(all_.obs_point)
    # Same units: the distance between two cameras sets the scale of both.
    a, b = (model.poses[:, :3, 3] - model.poses[0, :3, 3] for model in (few, all_))
    lengths = [np.linalg.norm(part[1:], axis=1) / np.linalg.norm(part[1]) for part in (a, b)]
    np.testing.assert_allclose(lengths[0], lengths[1], rtol=2e-3)


def test_tie_points_are_few(tmp_path: Path) -> None:
    """The mapper's database holds the same images and keypoints, and about as many matches as were asked for."""
    synthetic(tmp_path)
    thin = tmp_path / "thin.db"
    assert write_tie_points(tmp_path / DATABASE, thin, 200, seed=3)
    with pycolmap.Database.open(tmp_path / DATABASE) as before, pycolmap.Database.open(thin) as after:
        assert after.num_images() == before.num_images() == after.num_frames()
        assert after.num_keypoints() == before.num_keypoints()
        assert after.num_descriptors() == 0
        assert after.num_verified_image_pairs() == before.num_verified_image_pairs()
        assert after.num_inlier_matches() < 0.5 * before.num_inlier_matches()
        whole, kept = (
            dict(zip(*opened.read_two_view_geometry_num_inliers(), strict=True)) for opened in (before, after)
        )
        assert all(min(kept[pair], 100) == min(whole[pair], 100) for pair in whole)
        priors = [
            [(prior.corr_data_id.id, *prior.position) for prior in opened.read_all_pose_priors()]
            for opened in (before, after)
        ]
        assert priors[0] == priors[1]
        assert len(priors[0]) == 10
    assert not write_tie_points(tmp_path / DATABASE, tmp_path / "no.db", 4000, seed=3)
    assert not (tmp_path / "no.db").exists()
