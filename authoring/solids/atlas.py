"""The second UV set: every chart of a bridge packed without overlap into the unit square."""

import numpy as np

from authoring.shapes.component import F64, I64
from authoring.solids.sweep import Surface

MARGIN = 1.0 / 1024.0  # free border round each chart, as a share of the atlas: two texels of 2048
_TRIALS = 48
_DIGITS = 6  # of a chart's size in meters: so that rounding errors of equal sizes do not change the order of packing


def pack_atlas(surfaces: list[Surface]) -> list[F64]:
    """Place the charts of all surfaces in one square at one common scale.

    Args:
        surfaces: Members with metric `st`.

    Returns:
        For each surface its atlas coordinates [1], shape (C, 2), float64, all within 0 to 1.
    """
    st = np.concatenate([surface.st for surface in surfaces])
    chart = np.repeat(_chart_of_faces(surfaces), np.concatenate([surface.face_counts for surface in surfaces]))
    low, high = _boxes(st, chart)
    size = np.round(high - low, _DIGITS)
    lying = size[:, 0] < size[:, 1]
    size = np.where(lying[:, None], size[:, ::-1], size)  # long side along s
    corner, side, margin = _best_square(size)
    local = st - low.take(chart, axis=0)
    # A chart may be rotated by 90 degrees, but not mirrored, because of baked normals.
    rows = np.flatnonzero(lying.take(chart))
    turned = local.take(rows, axis=0)
    local[rows] = np.stack([turned[:, 1], size[:, 1].take(chart.take(rows)) - turned[:, 0]], axis=1)
    atlas = ((corner + margin).take(chart, axis=0) + local) / side
    return np.split(atlas, np.cumsum([len(surface.st) for surface in surfaces])[:-1])


def _boxes(st: F64, chart: I64) -> tuple[F64, F64]:
    """Find the least and largest coordinates of each chart, from those of its corners; 0 for a number that none has."""
    if np.any(chart[1:] < chart[:-1]):
        order = np.argsort(chart, kind="stable")
        st, chart = st.take(order, axis=0), chart.take(order)
    corners, rows = np.bincount(chart), np.ascontiguousarray(st.T)
    used = corners > 0
    first = (np.cumsum(corners) - corners)[used]
    bounds = []
    for least in (np.minimum, np.maximum):
        bounds.append(np.zeros((len(corners), 2)))
        bounds[-1][used] = least.reduceat(rows, first, axis=1).T
    return bounds[0], bounds[1]


def _chart_of_faces(surfaces: list[Surface]) -> I64:
    """Number the charts through all surfaces: one number for each face, shape (F,)."""
    charts = [int(surface.chart.max()) + 1 for surface in surfaces]
    first = np.repeat(np.cumsum([0, *charts[:-1]]), [len(surface.chart) for surface in surfaces])
    return (first + np.concatenate([surface.chart for surface in surfaces])).astype(np.int64)


def _best_square(size: F64) -> tuple[F64, float, float]:
    """Try shelves of several widths; keep the one whose square is smallest."""
    padded_area = float(np.sum(size[:, 0] * size[:, 1]))
    least = max(float(np.sqrt(padded_area)), float(size[:, 0].max()))
    order = np.lexsort((-size[:, 0], -size[:, 1]))  # tallest first
    length, height = size[order].T
    best: tuple[float, float, list[int]] | None = None
    for width in least * np.linspace(1.0, 1.6, _TRIALS):
        margin = MARGIN * width / (1.0 - 2.0 * MARGIN)
        first, top = _shelves(length + 2.0 * margin, height + 2.0 * margin, width + 2.0 * margin)
        side = max(float(width + 2.0 * margin), top)
        if best is None or side < best[0]:
            # The margin was a share of this width; a taller square only makes it a smaller share, never an overlap.
            best = (side, float(margin), first)
    assert best is not None
    side, margin, first = best
    corner = np.empty_like(size)
    corner[order] = _places(length + 2.0 * margin, height + 2.0 * margin, first)
    return corner, side, margin


def _shelves(length: F64, height: F64, width: float) -> tuple[list[int], float]:
    """Pack boxes on shelves, tallest first, each beside the one before, or on a new shelf if there is no room.

    Source: Coffman, Garey, Johnson, Tarjan, Performance bounds for level-oriented two-dimensional packing, 1980.

    Args:
        length: Length of each box [m], shape (B,), float64.
        height: Height of each box, falling [m], shape (B,), float64.
        width: Length of a shelf [m].

    Returns:
        Number of each shelf's first box, and the height of all shelves [m].
    """
    ends = np.cumsum(length)
    begins = ends - length
    shelves, first, top = [], 0, 0.0
    while first < len(length):
        shelves.append(first)
        top += float(height[first])
        first = max(int(ends.searchsorted(begins[first] + width, side="right")), first + 1)
    return shelves, top


def _places(length: F64, height: F64, first: list[int]) -> F64:
    """Find the lower left corner of each box on its shelf [m], shape (B, 2); arguments as for `_shelves`."""
    begins = np.cumsum(length) - length
    tops = np.cumsum(height[first])
    counts = np.diff([*first, len(length)])
    return np.stack([begins - np.repeat(begins[first], counts), np.repeat([0.0, *tops[:-1]], counts)], axis=1)
