"""The lens: prior, estimated and true values, with standard deviations and residuals."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from falsework.report.page import BLUE, number, plain_layout
from falsework.report.residuals import ModelFit
from recon.sfm.camera_model import BENDS, parameter_names

if TYPE_CHECKING:
    from recon.cloud import Cloud
    from recon.sfm.covariance import Precision
    from render.capture import Capture, Truth

F64 = NDArray[np.float64]

COLUMNS = 16  # cells along the longer side of a photograph
FEWEST = 100  # keypoints of a cell whose mean says something
_LONGEST = 0.8  # of a cell: the longest arrow
_FOCAL, _CENTER = "focal length [px]", "principal point [px]"


def lens_rows(
    cloud: "Cloud", capture: "Capture | None", truth: "Truth | None", precision: "Precision | None" = None
) -> list[list[str]]:
    """Tabulate the prior, estimated and true values of the lens side by side.

    Args:
        cloud: The cloud.
        capture: Its photographs; None where they are not at hand.
        truth: Their truth; None where there is none.
        precision: Expected errors of its model, None where unknown.

    Returns:
        The headings, then a row for each number; empty where the cloud does not say what was found.
    """
    model, params = cloud.statistics.get("camera_model"), cloud.statistics.get("camera_params")
    if not isinstance(model, str) or not isinstance(params, list):
        return []
    columns = {"found": _of_colmap(model, params)}
    if precision is not None:
        columns["±"] = _spread(precision)
    if capture is not None:
        given = capture.prior
        told = {"model": given.model, _FOCAL: f"{given.focal_px:.2f}", _CENTER: _place(given.cx, given.cy)}
        columns = {"given": told, **columns}
    if truth is not None:
        lens, bend = truth.camera, truth.distortion
        columns["true"] = {
            "model": "–",
            _FOCAL: _pair(lens.fx, lens.fy),
            _CENTER: _place(lens.cx, lens.cy),
            **{name: f"{getattr(bend, name):.2g}" for name in BENDS},
        }
    names = [name for name in ("model", _FOCAL, _CENTER, *BENDS) if name in columns["found"]]
    return [["", *columns], *([name, *(column.get(name, "–") for column in columns.values())] for name in names)]


def tie_rows(cloud: "Cloud", fit: ModelFit | None) -> list[tuple[str, str]]:
    """Say what structure from motion had to work with, and how well it fits.

    Args:
        cloud: The cloud.
        fit: Of the keypoints of its model, None where it has none.
    """
    said = cloud.statistics
    found = said.get("sparse")
    told: dict[str, Any] = found if isinstance(found, dict) else {}
    rows = [("keypoints", told.get("keypoints")), ("pairs of images tried", told.get("pairs"))]
    rows += [("of these, verified", told.get("verified")), ("tie points", said.get("model_points"))]
    rows.append(("images of a tie point, on average", said.get("mean_track_length")))
    if fit is not None:
        away = np.linalg.norm(fit.miss, axis=1)
        rows.append(("keypoints of tie points", len(away)))
        rows.append(("their median residual [px]", float(np.median(away)) if len(away) else None))
        rows.append(("root of their mean square [px]", float(np.sqrt(np.mean(away**2))) if len(away) else None))
    return [(name, number(value)) for name, value in rows if value is not None]


def footprint(cloud: "Cloud", cameras: Mapping[str, Any]) -> float | None:
    """Tell what one pixel covers where the points are.

    Args:
        cloud: A cloud whose lengths are meters.
        cameras: Lens and poses of its reconstruction.

    Returns:
        Median over all sights of points [m]; None where there is none.
    """
    if not cameras:
        return None
    places = {row["name"]: np.array(row["camera_to_world"], np.float64)[:3, 3] for row in cameras["poses"]}
    nowhere = np.full(3, np.nan)
    centers = np.array([places.get(camera["name"], nowhere) for camera in cloud.cameras]).reshape(-1, 3)
    point = np.repeat(np.arange(len(cloud)), np.diff(cloud.observations["start"]))
    away = np.linalg.norm(cloud.columns["coord"][point] - centers[cloud.observations["image"]], axis=1)
    away = away[np.isfinite(away)]
    return float(np.median(away)) / float(cameras["camera"]["params"][0]) if len(away) else None


def miss_field(fit: ModelFit, size: tuple[int, int]) -> tuple[F64, F64, F64]:
    """Average over each part of the photographs by how much points miss their keypoints.

    Args:
        fit: Of the keypoints of a model.
        size: Width and height of a photograph [px].

    Returns:
        Middles of the cells with enough keypoints [px], shape (C, 2), mean misses [px], shape (C, 2), both float64, and
        side of a cell [px], shape (2,), float64.
    """
    cells = np.array([COLUMNS, max(round(COLUMNS * size[1] / size[0]), 1)])
    side = np.array(size, np.float64) / cells
    at = np.clip((fit.uv / side).astype(int), 0, cells - 1)
    flat = at[:, 1] * cells[0] + at[:, 0]
    count = np.bincount(flat, minlength=int(cells.prod()))
    total = np.stack([np.bincount(flat, fit.miss[:, axis], int(cells.prod())) for axis in (0, 1)], axis=1)
    kept = np.flatnonzero(count >= FEWEST)
    middle = (np.stack([kept % cells[0], kept // cells[0]], axis=1) + 0.5) * side
    return middle, total[kept] / count[kept, None], side


def miss_figure(fit: ModelFit, size: tuple[int, int]) -> go.Figure | None:
    """Draw where on the photographs points miss their keypoints, and which way: a lens that was found wrong shows.

    Args:
        fit: Of the keypoints of a model.
        size: Width and height of a photograph [px].

    Returns:
        The figure; None where no part has enough keypoints.
    """
    middle, miss, side = miss_field(fit, size)
    longest = float(np.linalg.norm(miss, axis=1).max()) if len(miss) else 0.0
    if longest == 0.0:
        return None
    tips = middle + miss * (_LONGEST * float(side.min()) / longest)
    gaps = np.full(len(middle), np.nan)
    figure = go.Figure()
    lines = [np.stack([middle[:, axis], tips[:, axis], gaps], axis=1).ravel().round(1) for axis in (0, 1)]
    figure.add_scatter(x=lines[0], y=lines[1], mode="lines", line={"color": BLUE, "width": 2}, hoverinfo="skip")
    words = [f"{np.hypot(*one):.3f} px" for one in miss]
    marker = {"size": 4, "color": BLUE}
    hover = "%{text}<extra></extra>"
    figure.add_scatter(
        x=tips[:, 0].round(1), y=tips[:, 1].round(1), mode="markers", marker=marker, text=words, hovertemplate=hover
    )
    plain_layout(figure, 420)
    return figure.update_layout(
        showlegend=False,
        xaxis={"title": f"column [px]; the longest stroke stands for {longest:.3f} px", "range": [0, size[0]]},
        yaxis={"title": "row [px]", "range": [size[1], 0], "scaleanchor": "x", "constrain": "domain"},
    )


def correlation_rows(precision: "Precision | None") -> list[list[str]]:
    """Spell how the errors of the parameters of the lens go together.

    Args:
        precision: Expected errors of a model, None where unknown.

    Returns:
        The headings, then a row for each parameter; empty where there are not two.
    """
    if precision is None or len(precision.lens) < 2:
        return []
    rows = zip(precision.lens, precision.correlation.tolist(), strict=True)
    return [["", *precision.lens], *([name, *(f"{value:+.2f}" for value in row)] for name, row in rows)]


def _of_colmap(model: str, params: list[float]) -> dict[str, str]:
    """Spell the parameters of a camera of COLMAP."""
    value = dict(zip(parameter_names(model, len(params)), params, strict=False))
    focal = _pair(value["fx"], value["fy"]) if "fx" in value else f"{value['f']:.2f}"
    bend = {name: f"{value[name]:.2g}" for name in BENDS if name in value}
    return {"model": model, _FOCAL: focal, _CENTER: _place(value["cx"], value["cy"]), **bend}


def _spread(precision: "Precision") -> dict[str, str]:
    """Spell the standard deviations of the parameters of the lens."""
    value = dict(zip(precision.lens, precision.lens_sigma.tolist(), strict=True))
    focal = ", ".join(f"{value[name]:.2g}" for name in ("f", "fx", "fy") if name in value)
    return {_FOCAL: focal, **{name: f"{value[name]:.1g}" for name in BENDS if name in value}}


def _pair(first: float, second: float) -> str:
    return f"{first:.2f}" if abs(first - second) < 0.005 else f"{first:.2f}, {second:.2f}"


def _place(x: float, y: float) -> str:
    return f"{x:.2f}, {y:.2f}"
