"""The report's pictures: contact sheet, flight path and histograms."""

import base64
from html import escape

import cv2
import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from render.capture import Capture, Truth, load_image
from usd_schemas.components import ClassRow

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

SHEET_FRAMES = 6
SHEET_WIDTH = 420  # [px]
FONT = {"family": "system-ui, sans-serif", "size": 13, "color": "#2b2f33"}


def contact_sheet(capture: Capture, truth: Truth | None) -> list[dict[str, str]]:
    """Show some frames side by side: photograph, labels, depth.

    Args:
        capture: A capture.
        truth: Its truth, or None for photographs alone.

    Returns:
        For each frame its `name` and data URIs `rgb`, and with a truth `labels` and `depth`.
    """
    count = len(capture.images)
    rows = []
    for index in np.unique(np.linspace(0, count - 1, min(SHEET_FRAMES, count)).round().astype(int)):
        row = {"name": capture.images[index].name, "rgb": _data_uri(load_image(capture, int(index)))}
        if truth is not None:
            row["labels"] = _data_uri(paint_labels(truth.semantic(int(index)), truth.classes), smooth=False)
            row["depth"] = _data_uri(paint_depth(truth.depth(int(index))))
        rows.append(row)
    return rows


def paint_labels(labels: U8, classes: tuple[ClassRow, ...]) -> U8:
    """Colour a label image.

    Args:
        labels: Class ids, shape (H, W), uint8.
        classes: Class table.

    Returns:
        sRGB colours, shape (H, W, 3), uint8.
    """
    palette = np.zeros((256, 3), np.uint8)
    for row in classes:
        palette[row.id] = row.color
    return palette[labels]


def paint_depth(depth: NDArray[np.float32]) -> U8:
    """Colour a depth image on a logarithmic scale, near bright, sky black.

    Args:
        depth: Planar depth [m], shape (H, W), float32.

    Returns:
        sRGB colours, shape (H, W, 3), uint8.
    """
    seen = np.isfinite(depth)
    if not seen.any():
        return np.zeros((*depth.shape, 3), np.uint8)
    scale = np.log(np.maximum(np.where(seen, depth, 1.0), 1e-3))
    near, far = np.percentile(scale[seen], [1, 99])
    level = np.clip((far - scale) / max(far - near, 1e-6), 0, 1)
    painted = cv2.applyColorMap((level * 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)[..., ::-1]
    return np.where(seen[..., None], painted, 0).astype(np.uint8)


def flight_figure(centres: F64, statuses: list[str], bridge: F64, good_label: str = "registered") -> go.Figure:
    """Draw the camera path in plan and elevation.

    Args:
        centres: True or measured camera centres [m], shape (N, 3), float64.
        statuses: `ok` or the reason why not, one a camera.
        bridge: Points on the bridge for orientation [m], shape (M, 3), float64.
        good_label: What cameras that are `ok` are called.
    """
    figure = go.Figure()
    good = np.array([status == "ok" for status in statuses])
    for name, first, second, axes in (("plan", 0, 1, ("x", "y")), ("elevation", 0, 2, ("x2", "y2"))):
        shown = name == "plan"
        place = {"xaxis": axes[0], "yaxis": axes[1], "showlegend": shown, "mode": "markers"}
        figure.add_scatter(
            x=bridge[:, first], y=bridge[:, second], marker={"size": 2, "color": "#b9bec4"}, name="bridge", **place
        )
        path = {**place, "mode": "lines", "showlegend": False}
        figure.add_scatter(x=centres[:, first], y=centres[:, second], line={"color": "#9db4d4", "width": 1}, **path)
        for mask, colour, label in ((good, "#1f5fa8", good_label), (~good, "#c8322b", "lost")):
            if mask.any():
                figure.add_scatter(
                    x=centres[mask, first],
                    y=centres[mask, second],
                    marker={"size": 6, "color": colour},
                    name=label,
                    **place,
                )
    _plain_layout(figure, 620)
    figure.update_layout(
        xaxis={"domain": [0, 1], "anchor": "y", "title": "x [m]"},
        yaxis={"domain": [0.4, 1], "scaleanchor": "x", "title": "y [m]"},
        xaxis2={"domain": [0, 1], "anchor": "y2", "matches": "x", "title": "x [m]"},
        yaxis2={"domain": [0, 0.27], "scaleanchor": "x2", "title": "z [m]"},
    )
    return figure


def class_figure(segment: U8, classes: tuple[ClassRow, ...]) -> go.Figure:
    """Count the points of each class on a logarithmic axis.

    Args:
        segment: Class id of each point, shape (N,), uint8.
        classes: Class table.
    """
    counts = np.bincount(segment, minlength=256)
    rows = [row for row in classes if counts[row.id]]
    figure = go.Figure(
        go.Bar(
            x=[escape(row.name) for row in rows],
            y=[int(counts[row.id]) for row in rows],
            marker_color=[_css(row.color) for row in rows],
            text=[f"{counts[row.id]:,}" for row in rows],
        )
    )
    _plain_layout(figure, 340)
    return figure.update_layout(yaxis={"type": "log", "title": "points"})


def uncertainty_figure(uncertainty: NDArray[np.float32], threshold: float) -> go.Figure:
    """Show how uncertain the points are.

    Args:
        uncertainty: Uncertainty of each point [m], shape (N,), float32.
        threshold: Value above which a point counts as noisy [m].
    """
    finite = uncertainty[np.isfinite(uncertainty) & (uncertainty > 0)]
    edges = np.logspace(-4, 2, 49)
    counts, _ = np.histogram(finite, edges)
    figure = go.Figure(
        go.Bar(x=np.sqrt(edges[1:] * edges[:-1]), y=counts, width=np.diff(edges), marker_color="#4a7ab5")
    )
    figure.add_vline(x=threshold, line={"color": "#c8322b", "dash": "dash"})
    figure.add_annotation(  # on a logarithmic axis a text's place is an exponent, a line's is not
        x=float(np.log10(threshold)), y=1.0, yref="paper", xanchor="left", showarrow=False, text=f"{threshold:g} m"
    )
    _plain_layout(figure, 340)
    return figure.update_layout(xaxis={"type": "log", "title": "uncertainty [m]"}, yaxis={"title": "points"}, bargap=0)


def _plain_layout(figure: go.Figure, height: int) -> None:
    figure.update_layout(
        height=height,
        margin={"l": 55, "r": 15, "t": 30, "b": 45},
        font=FONT,
        template="plotly_white",
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        legend={"orientation": "h", "y": 1.08},
    )


def _css(color: tuple[int, int, int]) -> str:
    return f"rgb({color[0]},{color[1]},{color[2]})"


def _data_uri(pixels: U8, *, smooth: bool = True) -> str:
    height = round(pixels.shape[0] * SHEET_WIDTH / pixels.shape[1])
    mode = cv2.INTER_AREA if smooth else cv2.INTER_NEAREST
    small = cv2.resize(pixels, (SHEET_WIDTH, height), interpolation=mode)
    kind, options = (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 85]) if smooth else (".png", [])
    _, data = cv2.imencode(kind, small[..., ::-1], options)
    return f"data:image/{'jpeg' if smooth else 'png'};base64,{base64.b64encode(data.tobytes()).decode()}"
