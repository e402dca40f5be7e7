"""Signs that a scan was read in a wrong unit: points that are too far apart, or one where there should be many."""

import numpy as np
from numpy.typing import NDArray

from groundwork.progress import Progress

_FEWEST_SEEN = 0.002  # [1] share of occupied cubes to points: below, the unit is probably wrong
_WIDE = 50_000.0  # [m] longer than any bridge
_SPARSE = 2.0  # [m] at this distance of the points no part of a bridge can be seen
_MOST_SEEN = 0.5  # [1] share of occupied cubes to points: below, most points lie closer than a cube
_ROWS, _PAIRS = 64, 100_000_000  # points whose neighbor is sought, and the distances that it may take


def spread_doubt(coord: NDArray[np.float64], count: int, meters: float) -> str:
    """Say that a scan is far larger or sparser than one of a bridge: millimeters that were read as meters.

    Args:
        coord: Thinned points [m], shape (V, 3), float64.
        count: Points before thinning.
        meters: Length of a unit of the scan [m].

    Returns:
        A line for people; empty where nothing is odd.
    """
    if len(coord) < 2:
        return ""
    extent, apart = float(np.ptp(coord, axis=0).max()), 0.0
    if len(coord) >= _MOST_SEEN * count:
        rows = np.linspace(0, len(coord) - 1, min(len(coord), _ROWS, max(9, _PAIRS // len(coord)))).astype(np.int64)
        apart = _median_gap(coord, rows)
    if extent <= _WIDE and apart <= _SPARSE:
        return ""
    words = f", with a median distance of {apart:.1f} m to the nearest one" if apart > _SPARSE else ""
    stray = "" if words else ", or for a stray point"
    return f"its points extend over {extent:,.0f} m{words}: check the unit of {meters:g} m (--unit){stray}"


def _median_gap(coord: NDArray[np.float64], rows: NDArray[np.int64]) -> float:
    """Find the median distance of some points to the nearest other point, in two buffers of one number a point [m]."""
    squares, along = np.empty(len(coord)), np.empty(len(coord))
    nearest = np.empty(len(rows))
    for index, row in enumerate(rows):
        squares.fill(0.0)
        for axis in range(3):
            np.subtract(coord[:, axis], coord[row, axis], out=along)
            squares += np.square(along, out=along)
        squares[row] = np.inf
        nearest[index] = squares.min()
    return float(np.sqrt(np.median(nearest)))


def note_spread(coord: NDArray[np.float64], count: int, meters: float, name: str, progress: Progress) -> None:
    """Warn of a `spread_doubt` in one line.

    Args:
        coord: Thinned points [m], shape (V, 3), float64.
        count: Points before thinning.
        meters: Length of a unit of the scan [m].
        name: Name of the scan.
        progress: Listener.
    """
    if doubt := spread_doubt(coord, count, meters):
        progress.note(f"warning: {name}: {doubt}")


def unit_doubts(contradicted: str, seen: int, count: int) -> tuple[str, ...]:
    """List what a finished prediction shows of a wrong unit, such as meters that were read as millimeters.

    Args:
        contradicted: How the user's unit differs from the scan's, or empty.
        seen: Points after thinning.
        count: Points before.

    Returns:
        Lines for people.
    """
    few = f"thinning left only {seen} of {count} points: check the unit" if seen < max(_FEWEST_SEEN * count, 2) else ""
    return tuple(line for line in (contradicted, few) if line)
