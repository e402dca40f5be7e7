"""Figures of a report that show where cameras and points are: against numbers that were put in."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsework.report.lens import correlation_rows, lens_rows
from falsework.report.plan_view import height_figure, plan_view
from falsework.report.positions import expected_errors, measured_centers, position_figures
from recon.cloud import Cloud
from recon.sfm.covariance import Precision
from render.capture import CalibrationPrior, Capture, CaptureImage, Truth
from tests.falsework.test_cloud_view import small_cloud
from usd_schemas.distortion import Distortion
from usd_schemas.pinhole import Pinhole

CENTERS = {"a": np.array([0.0, 0.0, 5.0]), "<b>": np.array([40.0, 10.0, 6.0])}


def precision() -> Precision:
    """Make expected errors of two cameras: 3 mm along x, 1 mm along y, and 2 mm in height."""
    spread = np.diag([0.003, 0.001, 0.002]) ** 2
    correlation = np.array([[1.0, -0.25], [-0.25, 1.0]])
    return Precision(
        ("a.jpg", "<b>.jpg"), np.stack([spread] * 2), ("f", "k1"), np.array([0.05, 6e-5]), correlation, 0.3
    )


def test_ellipses_hold_what_is_expected() -> None:
    """Half axes of 2.45 standard deviations, by the factor that the axis names; heights in mm by color."""
    found: Any = position_figures(precision(), CENTERS, {})
    figure, none = found
    assert none is None
    assert "drawn 200 times" in figure.layout.xaxis.title.text  # 1.6 m at the most
    lines, cameras = figure.data
    first = np.array([lines.x, lines.y])[:, :25]
    assert np.abs(first).max(axis=1) == pytest.approx([200 * 2.45 * 0.003, 200 * 2.45 * 0.001], abs=2e-3)
    assert list(cameras.marker.color) == pytest.approx([2.0, 2.0])
    assert cameras.text[1].startswith("&lt;b&gt;")
    assert position_figures(precision(), {}, {}) == (None, None)


def test_strokes_lead_to_where_cameras_were_measured() -> None:
    """By the same factor as the ellipses, in plan; the height is the color, zero in its middle."""
    measured = {name: place + np.array([0.0, 0.01, -0.004]) for name, place in CENTERS.items()}
    found: Any = position_figures(precision(), CENTERS, {**measured, "other": np.zeros(3)})
    ellipses, figure = found
    assert ["drawn 100 times" in each.layout.xaxis.title.text for each in found] == [True, True]
    assert float(np.nanmax(ellipses.data[0].x[:25])) == pytest.approx(100 * 2.45 * 0.003, abs=2e-3)
    lines, cameras = figure.data
    assert (lines.x[0], lines.y[0], lines.x[1]) == (0.0, 0.0, 0.0)
    assert lines.y[1] == pytest.approx(100 * 0.01)
    assert list(cameras.marker.color) == pytest.approx([-4.0, -4.0])
    assert (cameras.marker.cmin, cameras.marker.cmax) == pytest.approx((-4.0, 4.0))
    assert "10.8 mm" in cameras.text[0]


def test_one_wrong_camera_does_not_hide_the_others() -> None:
    """The factor follows most errors; that of the wrong one is drawn as long as it is."""
    row = {f"{k}": np.array([2.0 * k, 0.0, 5.0]) for k in range(21)}
    measured = {name: at + np.array([0.0, 4.0 if name == "3" else 0.003, 0.0]) for name, at in row.items()}
    found: Any = position_figures(None, row, measured)
    assert "drawn 500 times" in found[1].layout.xaxis.title.text


def test_positions_are_compared_in_one_frame() -> None:
    """Truth where the cloud stands on it, GPS where the cloud does; neither in a frame of its own."""
    image = CaptureImage(name="a", file="images/a.jpg", gps=(1.0, 2.0, 3.0))
    capture = Capture(
        Path(), "s", (4, 3), CalibrationPrior(focal_px=4.0, cx=2.0, cy=1.5), (0.0, 0.0, 0.0), {}, (image,)
    )
    pose = np.eye(4)
    pose[:3, 3] = [5.0, 6.0, 7.0]
    truth = Truth(Path(), Pinhole(4, 3, 4.0, 4.0, 2.0, 1.5), (), pose[None], (), (), Distortion())
    cloud = small_cloud(5)

    def compared(alignment: dict[str, Any], known: Truth | None) -> list[list[float]]:
        found = measured_centers(replace(cloud, alignment=alignment), capture, known)
        return [place.tolist() for place in found.values()]

    assert compared({"target": "truth", "unit": "m"}, truth) == [[5.0, 6.0, 7.0]]
    assert compared({"target": "truth", "unit": "m"}, None) == []  # GPS is no truth
    assert compared({"target": "gps", "unit": "m"}, None) == [[1.0, 2.0, 3.0]]
    assert compared({"target": "gps", "unit": "unknown"}, None) == []
    assert compared({"target": "control", "unit": "m"}, truth) == []
    assert measured_centers(cloud, None, None) == {}


def test_the_lens_has_its_expected_errors() -> None:
    """Beside the values that were found, and with their correlations."""
    found = {"camera_model": "SIMPLE_RADIAL", "camera_params": [640.0, 480.0, 360.0, -0.02]}
    cloud = replace(small_cloud(20), statistics=found)
    rows = lens_rows(cloud, None, None, precision())
    assert [row[2] for row in rows] == ["±", "–", "0.05", "–", "6e-05"]
    assert correlation_rows(precision()) == [["", "f", "k1"], ["f", "+1.00", "-0.25"], ["k1", "-0.25", "+1.00"]]
    assert correlation_rows(None) == []


def test_a_cloud_from_above_shows_its_highest_points() -> None:
    """A red roof over a wide blue floor, north up; cells without points stay empty, heights are those of the points."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0, 20, 0.1), np.arange(0, 10, 0.1)))
    floor = np.stack([x, y, np.zeros(len(x))], axis=1)[(x < 9) | (x > 11)]
    roof = np.stack([x, y, np.full(len(x), 3.0)], axis=1)[(x < 4) & (y > 6)]
    place = np.concatenate([roof, floor]).astype(np.float32)
    color = np.where(place[:, 2:] > 1, [[200, 0, 0]], [[0, 0, 200]]).astype(np.uint8)
    view = plan_view(of_points(place, color))
    assert view is not None
    middle = view.height.shape[0] // 2
    column = {at: round((at - view.corner[0]) / view.cell) for at in (2.0, 10.0, 15.0)}
    assert view.height[2, column[2.0]] == pytest.approx(3.0)  # the first row is the northernmost
    assert view.height[-3, column[2.0]] == pytest.approx(0.0)
    assert tuple(view.color[2, column[2.0]]) == (200, 0, 0)
    assert np.isnan(view.height[middle, column[10.0]])
    assert tuple(view.color[middle, column[15.0]]) == (0, 0, 200)
    assert np.isfinite(view.height[:, column[15.0]]).mean() > 0.95
    figure: Any = height_figure(view)
    assert figure.layout.images[0].source.startswith("data:image/webp;base64,")
    scale = figure.data[0].marker
    assert (scale.cmin, scale.cmax) == pytest.approx((0.0, 3.0))
    assert plan_view(of_points(place[:0], color[:0])) is None
    assert [plan_view(of_points(place[:few], color[:few])) for few in (1, 2, 3)] == [None, None, None]


def of_points(place: np.ndarray, color: np.ndarray) -> Cloud:
    """Make a cloud of some points."""
    cloud = small_cloud(3)
    return replace(cloud, columns={**cloud.columns, "coord": place, "color": color})


def test_a_model_that_is_not_there(tmp_path: Path) -> None:
    """A cloud without its model has no expected errors."""
    assert expected_errors(tmp_path) is None
