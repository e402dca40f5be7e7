"""A dense cloud from above: colors and heights of its highest points on a regular grid."""

import base64
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from falsework.report.page import plain_layout

if TYPE_CHECKING:
    from recon.cloud import Cloud

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

LONGEST = 1400  # cells along the longer side
_POINTS_OF_A_CELL = 3.0  # where cells have points at all, and around them, at least so many on average
_FEWEST = 100  # points of a view
_SIZES, _COARSER = 16, 1.3  # cells that are tried, and how much larger each is than the one before
_OUTSIDE = 0.5  # [%] of the points that may lie beyond each edge
_NEIGHBORS = 4  # filled ones of eight around an empty cell that is filled from them
_ROUNDS = 2  # of filling
_ENDS = (1.0, 99.0)  # [%] of the cells: ends of the scale of heights
_QUALITY = 80  # of WebP, which is small and has transparent pixels
_MAP, _COLORS = cv2.COLORMAP_TURBO, "Turbo"


@dataclass(frozen=True, eq=False)
class PlanView:
    """A cloud from above.

    Attributes:
        color: sRGB color of the highest point of each cell, first row at the largest y, shape (H, W, 3), uint8.
        height: Its height [m], NaN where the cell has no point, shape (H, W), float32.
        corner: Smallest x and y [m], shape (2,), float64.
        cell: Side of a cell [m].
    """

    color: U8
    height: F32
    corner: F64
    cell: float

    @property
    def extent(self) -> tuple[float, float]:
        """Lengths along x and y [m]."""
        return self.height.shape[1] * self.cell, self.height.shape[0] * self.cell


def plan_view(cloud: "Cloud") -> PlanView | None:
    """Look at a cloud from above.

    Args:
        cloud: A cloud with colors.

    Returns:
        The view; None where there are too few points, or they have no extent.
    """
    place = cloud.columns["coord"]
    low, high = np.percentile(place[:, :2], [_OUTSIDE, 100.0 - _OUTSIDE], axis=0) if len(place) else np.zeros((2, 2))
    longer = float((high - low).max())
    if longer <= 0.0:
        return None
    cell = longer / LONGEST
    for coarser in range(_SIZES):  # sparser clouds get larger cells
        cell = longer / LONGEST * _COARSER**coarser
        shape, inside, flat = _cells(place, low, high, cell)
        if len(inside) >= _POINTS_OF_A_CELL * _covered(np.unique(flat), shape):
            break
    shape, inside, flat = _cells(place, low, high, cell)
    if len(inside) < _FEWEST:
        return None
    order = np.argsort(place[inside, 2], kind="stable")  # the highest is written last
    height = np.full(shape, np.nan, np.float32)
    color = np.zeros((*shape, 3), np.uint8)
    height.reshape(-1)[flat[order]] = place[inside[order], 2]
    color.reshape(-1, 3)[flat[order]] = cloud.columns["color"][inside[order]]
    for _ in range(_ROUNDS):
        _fill(height, color)
    return PlanView(color, height, low, cell)


def color_figure(view: PlanView, unit: str = "m") -> go.Figure:
    """Show the colors of a view from above.

    Args:
        view: The view.
        unit: Unit of length.
    """
    return _figure(view, view.color, unit, go.Figure())


def height_figure(view: PlanView, unit: str = "m") -> go.Figure:
    """Show the heights of a view from above.

    Args:
        view: The view, with at least one point.
        unit: Unit of length.
    """
    low, high = (float(end) for end in np.nanpercentile(view.height, _ENDS))
    level = np.clip((np.nan_to_num(view.height) - low) / max(high - low, 1e-9), 0.0, 1.0)
    painted = np.asarray(cv2.applyColorMap((255 * level).astype(np.uint8), _MAP), np.uint8)[..., ::-1]
    bar = {"title": {"text": f"height [{unit}]", "side": "right"}, "thickness": 12}
    scale = {"colorscale": _COLORS, "cmin": low, "cmax": high, "color": [low], "colorbar": bar, "opacity": 0}
    figure = go.Figure(go.Scatter(x=[view.corner[0]], y=[view.corner[1]], mode="markers", marker=scale))
    return _figure(view, painted, unit, figure)


def _cells(place: F64, low: F64, high: F64, cell: float) -> tuple[tuple[int, int], I64, I64]:
    """Lay a grid: its rows and columns, the points on it, and the cell of each, row by row from the north."""
    columns, rows = (max(int(np.ceil(length / cell)), 1) for length in high - low)
    at = np.floor((place[:, :2] - low) / cell).astype(np.int64)
    inside = np.flatnonzero(((at >= 0) & (at < (columns, rows))).all(axis=1))
    return (rows, columns), inside, (rows - 1 - at[inside, 1]) * columns + at[inside, 0]


def _covered(cells: I64, shape: tuple[int, int]) -> int:
    """Count the cells that have a point or a neighbor with one."""
    mask = np.zeros(shape, np.uint8)
    mask.reshape(-1)[cells] = 1
    return int(cv2.dilate(mask, np.ones((3, 3), np.uint8)).sum())


def _fill(height: F32, color: U8) -> None:
    """Fill empty cells between filled ones with their mean, in place."""
    known = np.isfinite(height).astype(np.float32)
    around = cv2.blur(known, (3, 3), borderType=cv2.BORDER_CONSTANT) * 9
    empty = (known == 0) & (around > _NEIGHBORS - 0.5)
    for values in (height, color):
        held = np.nan_to_num(values.astype(np.float32)) * (known if values.ndim == 2 else known[..., None])
        total = cv2.blur(held, (3, 3), borderType=cv2.BORDER_CONSTANT) * 9
        mean = total[empty] / (around[empty] if values.ndim == 2 else around[empty][:, None])
        values[empty] = mean if values.ndim == 2 else np.round(mean).astype(np.uint8)


def _figure(view: PlanView, pixels: U8, unit: str, figure: go.Figure) -> go.Figure:
    width, depth = view.extent
    seen = np.where(np.isfinite(view.height), 255, 0).astype(np.uint8)
    opaque = np.concatenate([pixels[..., ::-1], seen[..., None]], axis=2)
    _, data = cv2.imencode(".webp", opaque, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
    left, low = (float(value) for value in view.corner)
    source = f"data:image/webp;base64,{base64.b64encode(data.tobytes()).decode()}"
    placed = {"x": left, "y": low + depth, "sizex": width, "sizey": depth, "xref": "x", "yref": "y"}
    figure.add_layout_image(source=source, sizing="stretch", layer="below", **placed)
    plain_layout(figure, 420)
    plain = {"showgrid": False, "zeroline": False}
    return figure.update_layout(
        showlegend=False,
        xaxis={"title": f"x [{unit}]", "range": [left, left + width], "constrain": "domain", **plain},
        yaxis={"title": f"y [{unit}]", "range": [low, low + depth], "scaleanchor": "x", **plain},
    )
