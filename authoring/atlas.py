"""The second UV set: every chart of a bridge packed without overlap into the unit square."""

import numpy as np

from authoring.component import F64, I64
from authoring.sweep import Surface

MARGIN = 1.0 / 1024.0  # free border round each chart, as a share of the atlas: two texels of 2048
_TRIALS = 48


def pack_atlas(surfaces: list[Surface]) -> list[F64]:
    """Place the charts of all surfaces in one square at one common scale.

    Args:
        surfaces: Members with metric `st`.

    Returns:
        For each surface its atlas coordinates [1], shape (C, 2), float64, all within 0 to 1.
    """
    st = np.concatenate([surface.st for surface in surfaces])
    chart = _chart_of_corners(surfaces)
    low, high = np.full((chart[-1] + 1, 2), np.inf), np.full((chart[-1] + 1, 2), -np.inf)
    np.minimum.at(low, chart, st)
    np.maximum.at(high, chart, st)
    unused = low > high  # chart numbers that no face has
    low[unused] = high[unused] = 0.0
    size = high - low
    lying = size[:, 0] < size[:, 1]
    size = np.where(lying[:, None], size[:, ::-1], size)  # long side along s
    corner, side, margin = _best_square(size)
    local = st - low[chart]
    # A chart is turned by a quarter, never mirrored, so that baked normals keep their hand.
    turned = np.stack([local[:, 1], size[chart, 1] - local[:, 0]], axis=1)
    atlas = (corner[chart] + margin + np.where(lying[chart][:, None], turned, local)) / side
    return np.split(atlas, np.cumsum([len(surface.st) for surface in surfaces])[:-1])


def _chart_of_corners(surfaces: list[Surface]) -> I64:
    """Number the charts through all surfaces: one number for each face corner, shape (C,)."""
    charts = [int(surface.chart.max()) + 1 for surface in surfaces]
    first = np.repeat(np.cumsum([0, *charts[:-1]]), [len(surface.chart) for surface in surfaces])
    faces = first + np.concatenate([surface.chart for surface in surfaces])
    return np.repeat(faces.astype(np.int64), np.concatenate([surface.face_counts for surface in surfaces]))


def _best_square(size: F64) -> tuple[F64, float, float]:
    """Try shelves of several widths; keep the one whose square is smallest."""
    padded_area = float(np.sum(size[:, 0] * size[:, 1]))
    least = max(float(np.sqrt(padded_area)), float(size[:, 0].max()))
    order = np.lexsort((-size[:, 0], -size[:, 1]))  # tallest first
    best: tuple[F64, float, float] | None = None
    for width in least * np.linspace(1.0, 1.6, _TRIALS):
        margin = MARGIN * width / (1.0 - 2.0 * MARGIN)
        corner, height = _shelves(size + 2.0 * margin, order, width + 2.0 * margin)
        side = max(float(width + 2.0 * margin), height)
        if best is None or side < best[1]:
            # The margin was a share of this width; a taller square only makes it a smaller share, never an overlap.
            best = (corner, side, float(margin))
    assert best is not None
    return best


def _shelves(size: F64, order: I64, width: float) -> tuple[F64, float]:
    """Pack boxes on shelves, tallest first, each beside the one before, or on a new shelf where there is no room.

    Source: Coffman, Garey, Johnson, Tarjan, Performance bounds for level-oriented two-dimensional packing, 1980.

    Args:
        size: Length and height of each box [m], shape (B, 2), float64.
        order: Boxes by falling height, shape (B,), int64.
        width: Length of a shelf [m].
    """
    corner = np.zeros_like(size)
    ends = np.cumsum(size[order, 0])
    begins = ends - size[order, 0]
    first, top = 0, 0.0
    while first < len(order):
        last = max(int(np.searchsorted(ends, begins[first] + width, side="right")), first + 1)
        row = order[first:last]
        corner[row, 0] = begins[first:last] - begins[first]
        corner[row, 1] = top
        top += float(size[row[0], 1])
        first = last
    return corner, top
