"""How far the positions of the cameras are expected to be off, and how far they are."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from falsework.report.page import GRAY, plain_layout
from recon.sfm.colmap_model import read_model
from recon.sfm.covariance import Precision, precision_of

if TYPE_CHECKING:
    from render.capture import Capture, Truth

F64 = NDArray[np.float64]

_INSIDE = 2.45  # standard deviations of an ellipse that holds 95 % of the errors in plan
_CORNERS = 25  # of a drawn ellipse
_DRAWN = 0.04  # of the longer side of the plan: the largest ellipse or stroke
_STEPS = (1, 2, 5)
COLORS = "Viridis"


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


def measured_centers(capture: "Capture | None", truth: "Truth | None") -> dict[str, F64]:
    """List where the cameras were, by truth or else by GPS.

    Args:
        capture: Photographs; None where they are not at hand.
        truth: Their truth; None where there is none.

    Returns:
        Position of each image that has one, by its name [m], shape (3,), float64.
    """
    if capture is None:
        return {}
    if truth is not None:
        return {image.name: pose[:3, 3] for image, pose in zip(capture.images, truth.poses, strict=True)}
    return {image.name: np.array(image.gps) for image in capture.images if image.gps is not None}


def ellipse_figure(precision: Precision, centers: Mapping[str, F64], unit: str = "m") -> go.Figure | None:
    """Draw the expected error of each camera position in plan, its height by color.

    Args:
        precision: Expected errors of a model.
        centers: Found position of each image, by its name [m], shape (3,), float64.
        unit: Unit of length.

    Returns:
        The figure; None where no image has a position.
    """
    rows = [row for row, name in enumerate(precision.names) if Path(name).stem in centers]
    if not rows:
        return None
    places = np.array([centers[Path(precision.names[row]).stem] for row in rows])
    value, axes = np.linalg.eigh(precision.centers[rows][:, :2, :2])
    reach = _INSIDE * np.sqrt(np.maximum(value, 0.0))
    factor = enlarged(places, float(reach.max()))
    angle = np.linspace(0.0, 2 * np.pi, _CORNERS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    lines = places[:, :2, None] + factor * (axes * reach[:, None, :]) @ circle
    figure = _lines(lines)
    up = np.sqrt(precision.centers[rows][:, 2, 2])
    words = [
        f"{escape(name)}: ±{_spelled(float(np.sqrt(np.trace(cov))), unit)}"
        for name, cov in zip((precision.names[row] for row in rows), precision.centers[rows], strict=True)
    ]
    return _finished(figure, places, up, words, (unit, f"ellipses hold 95 %, drawn {factor:,} times as large"))


def difference_figure(centers: Mapping[str, F64], measured: Mapping[str, F64], unit: str = "m") -> go.Figure | None:
    """Draw how far each camera is from where it was measured: in plan by a stroke, in height by color.

    Args:
        centers: Found position of each image, by its name [m], shape (3,), float64.
        measured: Measured position of each image, by its name [m], shape (3,), float64.
        unit: Unit of length.

    Returns:
        The figure; None where no image has both.
    """
    names = [name for name in centers if name in measured]
    if not names:
        return None
    places = np.array([centers[name] for name in names])
    away = np.array([measured[name] for name in names]) - places
    factor = enlarged(places, float(np.linalg.norm(away[:, :2], axis=1).max()))
    figure = _lines(np.stack([places[:, :2], places[:, :2] + factor * away[:, :2]], axis=2))
    lengths = np.linalg.norm(away, axis=1).tolist()
    words = [f"{escape(name)}: {_spelled(length, unit)}" for name, length in zip(names, lengths, strict=True)]
    return _finished(figure, places, away[:, 2], words, (unit, f"strokes drawn {factor:,} times as long"))


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


def _lines(lines: F64) -> go.Figure:
    """Draw lines, shape (N, 2, corners), with gaps between them."""
    gap = np.full((len(lines), 2, 1), np.nan)
    x, y = np.concatenate([lines, gap], axis=2).transpose(1, 0, 2).reshape(2, -1).round(3)
    figure = go.Figure()
    return figure.add_scatter(x=x, y=y, mode="lines", line={"color": GRAY, "width": 1.5}, hoverinfo="skip")


def _finished(figure: go.Figure, places: F64, height: F64, words: list[str], told: tuple[str, str]) -> go.Figure:
    """Add the cameras, colored by the error of their heights, and the axes."""
    unit, about = told
    scale, small = (1000.0, "mm") if unit == "m" and float(np.abs(height).max()) < 1.0 else (1.0, unit)
    bar = {"title": {"text": f"height [{small}]", "side": "right"}, "thickness": 12}
    marker = {"size": 7, "color": (scale * height).round(3), "colorscale": COLORS, "colorbar": bar, "showscale": True}
    hover = "%{text}<extra></extra>"
    figure.add_scatter(
        x=places[:, 0].round(3),
        y=places[:, 1].round(3),
        mode="markers",
        marker=marker,
        text=words,
        hovertemplate=hover,
    )
    plain_layout(figure, 420)
    return figure.update_layout(
        showlegend=False,
        xaxis={"title": f"x [{unit}]; {about}", "constrain": "domain"},
        yaxis={"title": f"y [{unit}]", "scaleanchor": "x"},
    )


def _spelled(length: float, unit: str) -> str:
    return f"{1000 * length:.1f} mm" if unit == "m" and length < 1.0 else f"{length:.3g} {unit}"
