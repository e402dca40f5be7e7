"""The second UV set: every chart of a bridge packed without overlap into the unit square."""

import numpy as np

from authoring.component import F64
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
    owner, low, size = _chart_boxes(surfaces)
    lying = size[:, 0] < size[:, 1]
    size = np.where(lying[:, None], size[:, ::-1], size)  # long side along s
    corner, side, margin = _best_square(size)
    atlas, first = [], 0
    for surface in surfaces:
        chart = np.repeat(surface.chart, surface.face_counts) + first
        local = surface.st - low[chart]
        # A chart is turned by a quarter, never mirrored, so that baked normals keep their hand.
        turned = np.stack([local[:, 1], size[chart, 1] - local[:, 0]], axis=1)
        atlas.append((corner[chart] + margin + np.where(lying[chart][:, None], turned, local)) / side)
        first += int(np.count_nonzero(owner == len(atlas) - 1))
    return atlas


def _chart_boxes(surfaces: list[Surface]) -> tuple[np.ndarray, F64, F64]:
    owners, lows, highs = [], [], []
    for number, surface in enumerate(surfaces):
        count = int(surface.chart.max()) + 1
        chart = np.repeat(surface.chart, surface.face_counts)
        low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        np.minimum.at(low, chart, surface.st)
        np.maximum.at(high, chart, surface.st)
        owners.append(np.full(count, number))
        lows.append(low)
        highs.append(high)
    low = np.concatenate(lows)
    return np.concatenate(owners), low, np.concatenate(highs) - low


def _best_square(size: F64) -> tuple[F64, float, float]:
    """Try shelves of several widths; keep the one whose square is smallest."""
    padded_area = float(np.sum(size[:, 0] * size[:, 1]))
    least = max(float(np.sqrt(padded_area)), float(size[:, 0].max()))
    best: tuple[F64, float, float] | None = None
    for width in least * np.linspace(1.0, 1.6, _TRIALS):
        margin = MARGIN * width / (1.0 - 2.0 * MARGIN)
        corner, height = _shelves(size + 2.0 * margin, width + 2.0 * margin)
        side = max(float(width + 2.0 * margin), height)
        if best is None or side < best[1]:
            # The margin was a share of this width; a taller square only makes it a smaller share, never an overlap.
            best = (corner, side, float(margin))
    assert best is not None
    return best


def _shelves(size: F64, width: float) -> tuple[F64, float]:
    """Pack boxes on shelves, tallest first, each on the first shelf with room.

    Source: Coffman, Garey, Johnson, Tarjan, Performance bounds for level-oriented two-dimensional packing, 1980.
    """
    corner = np.zeros_like(size)
    level: list[float] = []
    used: list[float] = []
    top = 0.0
    for box in np.lexsort((np.arange(len(size)), -size[:, 0], -size[:, 1])):
        length, height = float(size[box, 0]), float(size[box, 1])
        shelf = next((k for k, full in enumerate(used) if full + length <= width), None)
        if shelf is None:
            shelf = len(level)
            level.append(top)
            used.append(0.0)
            top += height
        corner[box] = used[shelf], level[shelf]
        used[shelf] += length
    return corner, top
