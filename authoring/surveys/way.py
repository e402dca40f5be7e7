"""Processing of a path: straightened, rounded, and divided into equal steps, always at a safe distance."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from authoring.surveys.subject import Subject

F64 = NDArray[np.float64]

_PROBE = 0.1  # [m] spacing of the points at which a path is checked
_ROUNDS = 2  # of straightening
_EASES = (0.8, 0.5, 0.3)  # [m] lengths over which corners are rounded, the first that is safe


def shortcut(way: F64, subject: Subject, safety: float) -> F64:
    """Straighten a path: a leg replaces all corners between two that a safe straight line connects.

    Args:
        way: Corners [m], shape (M, 3), float64.
        subject: Bridge and site.
        safety: Least distance to both [m].

    Returns:
        Corners about every two meters [m], shape (K, 3), float64.
    """
    reach = 6  # a leg replaces at most this many corners, so that the flight does not become one straight line
    for _ in range(_ROUNDS):
        kept, at = [0], 0
        while at < len(way) - 1:
            ahead = min(at + reach, len(way) - 1)
            while ahead > at + 1 and not is_safe(way[[at, ahead]], subject, safety):
                ahead -= 1
            kept.append(ahead)
            at = ahead
        way = way[kept]
        reach = 2
    return way


def rounded_way(way: F64, subject: Subject, safety: float) -> F64:
    """Round a path with a centripetal Catmull-Rom spline, leg by leg; a leg that would be too close stays straight.

    Source: E. Catmull, R. Rom 1974; parametrization of P. Lee 1989, which makes no loops.

    Args:
        way: Corners [m], shape (M, 3), float64.
        subject: Bridge and site.
        safety: Least distance to both [m].

    Returns:
        Points along it, close together [m], shape (K, 3), float64.
    """
    moved = np.linalg.norm(np.diff(way, axis=0), axis=1) > 1e-9
    way = way[np.concatenate([[True], moved])]
    if len(way) < 3:
        return way
    padded = np.vstack([2.0 * way[0] - way[1], way, 2.0 * way[-1] - way[-2]])
    places = [way[:1]]
    for leg in range(len(way) - 1):
        count = max(2, int(np.ceil(np.linalg.norm(way[leg + 1] - way[leg]) / _PROBE)))
        curve = _catmull_rom(padded[leg : leg + 4], np.linspace(0.0, 1.0, count + 1))
        straight = not is_safe(curve, subject, safety)
        places.append((np.linspace(way[leg], way[leg + 1], count + 1) if straight else curve)[1:])
    return np.concatenate(places)


def eased_way(way: F64, subject: Subject, safety: float) -> F64:
    """Round the corners of a path as far as is safe: a drone does not turn on the spot.

    Args:
        way: Points along it [m], shape (M, 3), float64.
        subject: Bridge and site.
        safety: Least distance to both [m].

    Returns:
        Points along it, close together, with the same ends [m], shape (K, 3), float64.
    """
    fine = equal_steps(way, _PROBE)
    for reach in _EASES:
        cells = reach / _PROBE
        # Mirrored through its ends, so that both keep their positions.
        padded = np.vstack([2.0 * fine[0] - fine[:0:-1], fine, 2.0 * fine[-1] - fine[-2::-1]])
        eased = gaussian_filter1d(padded, cells, axis=0)[len(fine) - 1 : 2 * len(fine) - 1]
        if is_safe(eased, subject, safety):
            return eased
    return fine


def equal_steps(way: F64, spacing: float) -> F64:
    """Place images at equal steps along a path, including the ends.

    Args:
        way: Points along it [m], shape (M, 3), float64.
        spacing: Largest step along the path [m].

    Returns:
        Positions [m], shape (N, 3), float64: steps of L / ceil(L / spacing) for a path of length L.
    """
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    count = max(1, int(np.ceil(arc[-1] / spacing - 1e-9)))
    stations = np.linspace(0.0, arc[-1], count + 1)
    return np.column_stack([np.interp(stations, arc, way[:, axis]) for axis in range(3)])


def is_safe(way: F64, subject: Subject, safety: float) -> bool:
    """Check whether a path is at a safe distance everywhere.

    Args:
        way: Corners [m], shape (M, 3), float64.
        subject: Bridge and site.
        safety: Least distance to both [m].
    """
    probes = equal_steps(way, _PROBE)
    # Between two checked points a path can be closer by half their distance.
    return bool(np.round(subject.clearance(probes), 2).min() > safety + 0.5 * _PROBE)


def _catmull_rom(corners: F64, share: F64) -> F64:
    """Evaluate the spline between the second and the third of four corners, shape (len(share), 3)."""
    knots = np.concatenate([[0.0], np.cumsum(np.sqrt(np.linalg.norm(np.diff(corners, axis=0), axis=1)))])
    t = (knots[1] + share * (knots[2] - knots[1]))[:, None]

    def blend(a: F64, b: F64, low: float, high: float) -> F64:
        return ((high - t) * a + (t - low) * b) / (high - low)

    first = [blend(corners[k], corners[k + 1], knots[k], knots[k + 1]) for k in range(3)]
    second = [blend(first[k], first[k + 1], knots[k], knots[k + 2]) for k in range(2)]
    return blend(second[0], second[1], knots[1], knots[2])
