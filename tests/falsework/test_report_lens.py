"""What a page says of lens and tie points, against numbers that were put in."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsework.report.lens import FEWEST, footprint, lens_rows, miss_field, miss_figure, tie_rows
from falsework.report.pictures import depth_range, paint_depth
from falsework.report.residuals import ModelFit
from render.capture import CalibrationPrior, Capture, Truth
from tests.falsework.test_cloud_view import VIEWS, small_cloud
from usd_schemas.distortion import Distortion
from usd_schemas.pinhole import Pinhole

SIZE = (960, 720)


def fit_of(miss: np.ndarray, uv: np.ndarray) -> ModelFit:
    """Make the fit of one photograph."""
    return ModelFit(("a",), np.zeros(len(uv), np.int64), uv, miss)


def test_the_lens_stands_as_told_found_and_true() -> None:
    """Each number in its column, and a dash where nobody said one; nothing where no lens was found."""
    cloud, prior = small_cloud(20), CalibrationPrior(focal_px=634.0, cx=480.0, cy=360.0)
    capture = Capture(Path(), "s", SIZE, prior, (0.0, 0.0, 0.0), {}, ())
    bend = Distortion(k1=-0.02)
    truth = Truth(Path(), Pinhole(*SIZE, 640.0, 641.0, 480.5, 360.0), (), np.zeros((0, 4, 4)), (), (), bend)
    found = {"camera_model": "RADIAL", "camera_params": [639.97, 481.0, 361.0, -0.019, 0.001]}
    cloud = replace(cloud, statistics={**cloud.statistics, **found})
    assert lens_rows(cloud, capture, truth) == [
        ["", "given", "found", "true"],
        ["model", "SIMPLE_RADIAL", "RADIAL", "–"],
        ["focal length [px]", "634.00", "639.97", "640.00, 641.00"],
        ["principal point [px]", "480.00, 360.00", "481.00, 361.00", "480.50, 360.00"],
        ["k1", "–", "-0.019", "-0.02"],
        ["k2", "–", "0.001", "0"],
    ]
    two = {"camera_model": "OPENCV", "camera_params": [640.0, 641.0, 480.0, 360.0, 0.1, 0.2, 0.3, 0.4]}
    rows = lens_rows(replace(cloud, statistics=two), None, None)
    assert rows[0] == ["", "found"]
    assert [row[1] for row in rows[2:]] == ["640.00, 641.00", "480.00, 360.00", "0.1", "0.2", "0.3", "0.4"]
    assert lens_rows(replace(cloud, statistics={}), capture, truth) == []


def test_tie_points_in_figures() -> None:
    """Counts as the cloud has them; median and root mean square of misses that are known."""
    told = {"sparse": {"keypoints": 9000, "pairs": 12, "verified": 10}, "model_points": 400, "mean_track_length": 3.5}
    cloud = replace(small_cloud(20), statistics=told)
    miss = np.array([[3.0, 4.0], [0.0, 1.0], [1.0, 0.0]])
    rows = dict(tie_rows(cloud, fit_of(miss, np.zeros((3, 2)))))
    assert rows["keypoints"] == "9,000"
    assert rows["of these, verified"] == "10"
    assert rows["their median residual [px]"] == "1"
    assert float(rows["root of their mean square [px]"]) == pytest.approx(3.0)
    assert tie_rows(replace(cloud, statistics={}), None) == []


def test_where_points_miss_their_keypoints() -> None:
    """A lens that is wrong outwards: the mean of each cell; a cell of few keypoints is left out."""
    rng = np.random.default_rng(2)
    uv = rng.uniform(0.0, 1.0, (40_000, 2)) * SIZE
    uv = uv[(uv > 60.0).all(axis=1)]
    few = np.tile([[1.0, 1.0]], (FEWEST - 1, 1))
    uv = np.concatenate([uv, few])
    miss = 0.01 * (uv - np.array(SIZE) / 2) + rng.normal(0.0, 0.2, uv.shape)
    middle, found, side = miss_field(fit_of(miss, uv), SIZE)
    np.testing.assert_allclose(side, 60.0)
    assert len(middle) == 15 * 11
    assert middle.min() == 90.0
    np.testing.assert_allclose(found, 0.01 * (middle - np.array(SIZE) / 2), atol=0.1)
    figure = miss_figure(fit_of(miss, uv), SIZE)
    assert figure is not None
    drawn: Any = figure.data[0]
    lines = np.array([drawn.x, drawn.y], float).T.reshape(-1, 3, 2)
    length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    assert length.max() == pytest.approx(0.8 * 60.0, abs=0.2)
    assert miss_figure(fit_of(np.zeros((3, 2)), np.ones((3, 2))), SIZE) is None


def test_what_a_pixel_covers() -> None:
    """Ten meters away at a focal length of 500 px: 2 cm; a camera that was lost does not count."""
    cloud = small_cloud(30)
    columns = {**cloud.columns, "coord": np.zeros((30, 3))}
    cloud = replace(cloud, columns=columns)
    pose = np.eye(4)
    pose[:3, 3] = 6.0, 8.0, 0.0
    poses = [{"name": cloud.cameras[row]["name"], "camera_to_world": pose.tolist()} for row in range(VIEWS - 1)]
    assert footprint(cloud, {"camera": {"params": [500.0]}, "poses": poses}) == pytest.approx(0.02)
    assert footprint(cloud, {}) is None
    assert footprint(cloud, {"camera": {"params": [500.0]}, "poses": []}) is None


def test_the_ends_of_the_scale_of_depths() -> None:
    """Between them the colors change, beyond them they do not; sky alone has no ends."""
    depth = np.geomspace(1.0, 1000.0, 10_001, dtype=np.float32).reshape(1, -1)
    ends = depth_range(depth)
    assert ends == pytest.approx((1000.0**0.01, 1000.0**0.99), rel=1e-3)
    painted = paint_depth(depth)[0]
    assert len(np.unique(painted[:90], axis=0)) == len(np.unique(painted[-90:], axis=0)) == 1
    assert len(np.unique(painted, axis=0)) > 200
    sky = np.full((2, 2), np.inf, np.float32)
    assert depth_range(sky) is None
    assert not paint_depth(sky).any()
