"""Plots of a scene: its flight in plan and elevation, points of each class, uncertainty."""

from html import escape

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from falsework.report.page import BLUE, GRAY, RED, plain_layout
from usd_schemas.components import ClassRow

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

BRIDGE_POINTS = 6_000  # drawn in plan and in elevation: more make the page slow to open
_ROOM = 0.35  # share of the axis for the count behind the longest bar


def flight_figure(
    centers: F64, statuses: list[str], bridge: F64, good_label: str = "registered", unit: str = "m"
) -> go.Figure:
    """Plot the camera path in plan and elevation.

    Args:
        centers: True or measured camera centers [m], shape (N, 3), float64.
        statuses: `ok` or the reason code of each camera.
        bridge: Points on the bridge for orientation [m], shape (M, 3), float64; at most `BRIDGE_POINTS` are drawn.
        good_label: Label of cameras that are `ok`.
        unit: Unit of length, for the axes.
    """
    figure = go.Figure()
    good = np.array([status == "ok" for status in statuses], bool)
    drawn = bridge[:: max(-(-len(bridge) // BRIDGE_POINTS), 1)].astype(np.float32)
    for name, first, second, axes in (("plan", 0, 1, ("x", "y")), ("elevation", 0, 2, ("x2", "y2"))):
        shown = name == "plan"
        place = {"xaxis": axes[0], "yaxis": axes[1], "showlegend": shown, "mode": "markers"}
        figure.add_scatter(
            x=drawn[:, first],
            y=drawn[:, second],
            marker={"size": 2, "color": GRAY, "opacity": 0.7},
            name="bridge",
            hoverinfo="skip",
            **place,
        )
        path = {**place, "mode": "lines", "showlegend": False, "hoverinfo": "skip"}
        figure.add_scatter(x=centers[:, first], y=centers[:, second], line={"color": "#8fb0d6", "width": 1}, **path)
        for mask, color, label in ((good, BLUE, good_label), (~good, RED, "lost")):
            if mask.any():
                figure.add_scatter(
                    x=centers[mask, first],
                    y=centers[mask, second],
                    marker={"size": 6, "color": color},
                    name=label,
                    **place,
                )
    plain_layout(figure, 620)
    return figure.update_layout(
        xaxis={"domain": [0, 1], "anchor": "y", "title": f"x [{unit}]"},
        yaxis={"domain": [0.4, 1], "scaleanchor": "x", "title": f"y [{unit}]"},
        xaxis2={"domain": [0, 1], "anchor": "y2", "matches": "x", "title": f"x [{unit}]"},
        yaxis2={"domain": [0, 0.27], "scaleanchor": "x2", "title": f"z [{unit}]"},
    )


def class_figure(segment: U8, classes: tuple[ClassRow, ...]) -> go.Figure:
    """Plot the points of each class on a logarithmic axis, one row each, so that names and counts fit on a phone.

    Args:
        segment: Class id of each point, shape (N,), uint8.
        classes: Class table.
    """
    counts = np.bincount(segment, minlength=256)
    rows = [row for row in classes if counts[row.id]]
    figure = go.Figure(
        go.Bar(
            x=[int(counts[row.id]) for row in rows],
            y=[escape(row.name) for row in rows],
            marker_color=[_css(row.color) for row in rows],
            text=[f"{counts[row.id]:,}" for row in rows],
            textposition="outside",
            cliponaxis=False,
            orientation="h",
        )
    )
    most = float(np.log10(max(counts.max(), 1)))
    plain_layout(figure, max(340, 90 + 24 * len(rows)))
    return figure.update_layout(
        xaxis={"type": "log", "title": "points", "range": [0, most + _ROOM * max(most, 1.0)], "dtick": 1},
        yaxis={"type": "category", "autorange": "reversed", "automargin": True, "dtick": 1},
        bargap=0.25,
    )


def uncertainty_figure(uncertainty: NDArray[np.float32], threshold: float) -> go.Figure:
    """Plot the distribution of the uncertainty.

    Args:
        uncertainty: Uncertainty of each point [m], shape (N,), float32.
        threshold: Value above which a point counts as noisy [m].
    """
    finite = uncertainty[np.isfinite(uncertainty) & (uncertainty > 0)]
    edges = np.logspace(-4, 2, 49)
    counts, _ = np.histogram(finite, edges)
    figure = go.Figure(go.Bar(x=np.sqrt(edges[1:] * edges[:-1]), y=counts, width=np.diff(edges), marker_color=BLUE))
    figure.add_vline(x=threshold, line={"color": RED, "dash": "dash"})
    figure.add_annotation(  # on a logarithmic axis the position of a text is an exponent, that of a line is not
        x=float(np.log10(threshold)), y=1.0, yref="paper", xanchor="left", showarrow=False, text=f"{threshold:g} m"
    )
    plain_layout(figure, 340)
    return figure.update_layout(
        xaxis={"type": "log", "title": "uncertainty [m]", "exponentformat": "none"}, yaxis={"title": "points"}, bargap=0
    )


def _css(color: tuple[int, int, int]) -> str:
    return f"rgb({color[0]},{color[1]},{color[2]})"
