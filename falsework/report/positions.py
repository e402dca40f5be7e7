"""How far the positions of the cameras are expected to be off, and how far they are."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from falsework.report.page import GRAY, plain_layout
from falsework.report.scene_tables import unit_of
from recon.sfm.colmap_model import read_model
from recon.sfm.covariance import Precision, precision_of

if TYPE_CHECKING:
    from recon.cloud import Cloud
    from render.capture import Capture, Truth

F64 = NDArray[np.float64]

_INSIDE = 2.45  # standard deviations of an ellipse that holds 95 % of the errors in plan
_CORNERS = 25  # of a drawn ellipse
_DRAWN = 0.04  # of the longer side of the plan: the length of a large error
_MOST = 90.0  # [%] of the cameras whose errors set the factor: single wrong ones may be drawn longer
_STEPS = (1, 2, 5)


def expected_errors(folder: Path) -> Precision | None:
    """Compute the expected errors of the model that a cloud was made from.

    Args:
        folder: Folder of a cloud, with the model in `sparse`.

    Returns:
        The errors; None where there is no model, or they cannot be computed.

    Raises:
        InputError: The model is damaged.
    """
    model = folder / "sparse"
    return precision_of(read_model(model)) if (model / "images.bin").is_file() else None


def measured_centers(cloud: "Cloud", capture: "Capture | None", truth: "Truth | None") -> dict[str, F64]:
    """List where the cameras were in the frame of a cloud: by truth, or by GPS where it fixed that frame.

    Args:
        cloud: The cloud.
        capture: Its photographs; None where they are not at hand.
        truth: Their truth; None where there is none.

    Returns:
        Position of each image that has one, by its name [m], shape (3,), float64.
    """
    target = cloud.alignment.get("target", "truth")
    if capture is None or unit_of(cloud) != "m" or target not in ("truth", "gps"):
        return {}
    if target == "truth":
        poses = [] if truth is None else zip(capture.images, truth.poses, strict=True)
        return {image.name: pose[:3, 3] for image, pose in poses}
    return {image.name: np.array(image.gps) for image in capture.images if image.gps is not None}


def position_figures(
    precision: Precision | None, centers: Mapping[str, F64], measured: Mapping[str, F64], unit: str = "m"
) -> tuple[go.Figure | None, go.Figure | None]:
    """Draw expected and actual errors of camera positions, enlarged by the same factor.

    Args:
        precision: Expected errors of the model, None where unknown.
        centers: Found position of each camera, by its name [m], shape (3,), float64.
        measured: Measured position of each that has one, by its name [m], shape (3,), float64.
        unit: Unit of length.

    Returns:
        Ellipses, and strokes from found to measured positions; each None where nothing is known.
    """
    places = np.array(list(centers.values())).reshape(-1, 3)
    spread = {} if precision is None else _spreads(precision)
    reach = [_INSIDE * float(np.sqrt(spread[name].diagonal()[:2].max())) for name in centers if name in spread]
    away = [float(np.linalg.norm((measured[name] - at)[:2])) for name, at in centers.items() if name in measured]
    most = [float(np.percentile(lengths, _MOST)) for lengths in (reach, away) if lengths]
    factor = enlarged(places, max(most)) if most else 1
    return ellipse_figure(spread, centers, factor, unit), difference_figure(centers, measured, factor, unit)


def ellipse_figure(
    spread: Mapping[str, F64], centers: Mapping[str, F64], factor: int, unit: str = "m"
) -> go.Figure | None:
    """Draw the expected error of each camera position in plan, that of its height by color.

    Args:
        spread: Covariance of each position, by its name [m²], shape (3, 3), float64.
        centers: Found position of each camera, by its name [m], shape (3,), float64.
        factor: By which ellipses are enlarged.
        unit: Unit of length.

    Returns:
        The figure; None where no camera has both.
    """
    names = [name for name in centers if name in spread]
    if not names:
        return None
    places, found = np.array([centers[name] for name in names]), np.array([spread[name] for name in names])
    value, axes = np.linalg.eigh(found[:, :2, :2])
    reach = _INSIDE * np.sqrt(np.maximum(value, 0.0))
    angle = np.linspace(0.0, 2 * np.pi, _CORNERS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    figure = _lines(places[:, :2, None] + factor * (axes * reach[:, None, :]) @ circle)
    total = np.sqrt(np.einsum("ijj->i", found)).tolist()
    words = [f"{escape(name)}: 1 σ {_spelled(length, unit)}" for name, length in zip(names, total, strict=True)]
    told = (unit, f"ellipses hold 95 %, drawn {factor:,} times as large", "1 σ of the height")
    return _finished(figure, places, np.sqrt(found[:, 2, 2]), words, told)


def difference_figure(
    centers: Mapping[str, F64], measured: Mapping[str, F64], factor: int, unit: str = "m"
) -> go.Figure | None:
    """Draw how far each camera is from where it was measured: in plan by a stroke, in height by color.

    Args:
        centers: Found position of each camera, by its name [m], shape (3,), float64.
        measured: Measured position of each that has one, by its name [m], shape (3,), float64.
        factor: By which strokes are enlarged.
        unit: Unit of length.

    Returns:
        The figure; None where no camera has both.
    """
    names = [name for name in centers if name in measured]
    if not names:
        return None
    places = np.array([centers[name] for name in names])
    away = np.array([measured[name] for name in names]) - places
    figure = _lines(np.stack([places[:, :2], places[:, :2] + factor * away[:, :2]], axis=2))
    lengths = np.linalg.norm(away, axis=1).tolist()
    words = [f"{escape(name)}: {_spelled(length, unit)}" for name, length in zip(names, lengths, strict=True)]
    told = (unit, f"strokes drawn {factor:,} times as long", "reference above found")
    return _finished(figure, places, away[:, 2], words, told)


def enlarged(places: F64, largest: float) -> int:
    """Choose a round factor by which errors are drawn larger than they are.

    Args:
        places: Positions of cameras [m], shape (N, 3), float64.
        largest: The largest error [m].
    """
    wanted = _DRAWN * float(np.ptp(places[:, :2], axis=0).max()) / largest if largest > 0.0 else 1.0
    if wanted <= 1.0:
        return 1
    ten = 10 ** int(np.floor(np.log10(wanted)))
    return ten * max(step for step in _STEPS if step * ten <= wanted)


def _spreads(precision: Precision) -> dict[str, F64]:
    return {Path(name).stem: found for name, found in zip(precision.names, precision.centers, strict=True)}


def _lines(lines: F64) -> go.Figure:
    """Draw lines, shape (N, 2, corners), with gaps between them."""
    gap = np.full((len(lines), 2, 1), np.nan)
    x, y = np.concatenate([lines, gap], axis=2).transpose(1, 0, 2).reshape(2, -1).astype(np.float32)
    figure = go.Figure()
    return figure.add_scatter(x=x, y=y, mode="lines", line={"color": GRAY, "width": 1.5}, hoverinfo="skip")


def _finished(figure: go.Figure, places: F64, height: F64, words: list[str], told: tuple[str, str, str]) -> go.Figure:
    """Add the cameras, colored by the height errors that are known, and the axes."""
    unit, about, title = told
    most = float(np.abs(height).max())
    scale, small = (1000.0, "mm") if unit == "m" and most < 1.0 else (1.0, unit)
    bar = {"title": {"text": f"{title} [{small}]", "side": "right"}, "thickness": 12}
    signed = bool((height < 0.0).any())
    ends = {"cmin": -scale * most, "cmax": scale * most, "colorscale": "RdBu"} if signed else {"colorscale": "Viridis"}
    line = {"color": GRAY, "width": 0.5}
    marker = {"size": 7, "color": scale * height, "colorbar": bar, "showscale": True, "line": line, **ends}
    x, y = places[:, :2].astype(np.float32).T
    hover = "%{text}<extra></extra>"
    figure.add_scatter(x=x, y=y, mode="markers", marker=marker, text=words, hovertemplate=hover)
    plain_layout(figure, 420)
    return figure.update_layout(
        showlegend=False,
        xaxis={"title": f"x [{unit}]; {about}", "constrain": "domain"},
        yaxis={"title": f"y [{unit}]", "scaleanchor": "x"},
    )


def _spelled(length: float, unit: str) -> str:
    return f"{1000 * length:.1f} mm" if unit == "m" and length < 1.0 else f"{length:.3g} {unit}"
