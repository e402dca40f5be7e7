"""The scale of a model by measured distances between marked points."""

import numpy as np

from recon.placing.ground_control import ScaleBar
from recon.placing.marked_places import MarkedPlace, mark_variances


def scale_of_bars(bars: list[ScaleBar], places: dict[str, MarkedPlace]) -> tuple[float, float]:
    """Estimate the scale of a model from scale bars, each weighted by its own error and by those of its marks.

    Args:
        bars: Bars whose ends are marked.
        places: Place of each marked point.

    Returns:
        Scale [m per model unit], and the 95 % limit of its relative error [1]. If the bars contradict each other by
        more than their errors, the limit follows from the contradiction.
    """
    from scipy.stats import t as student  # half of the time to import the room

    variances = dict(zip(places, mark_variances(list(places.values())), strict=True))
    ratios, stated, marked = np.zeros(len(bars)), np.zeros(len(bars)), np.zeros(len(bars))
    for row, bar in enumerate(bars):
        one, other = (places[name] for name in bar.ends)
        line = one.place - other.place
        found = float(np.linalg.norm(line))
        spread = sum(variances[name] * places[name].covariance for name in bar.ends)
        ratios[row], stated[row] = bar.length / found, (bar.sigma / bar.length) ** 2
        marked[row] = line @ spread @ line / found**4
    weights = 1.0 / (stated + marked)
    weights /= weights.sum()
    scale = float(weights @ ratios)
    exact, clicked = float(weights**2 @ stated), float(weights**2 @ marked)
    variance, freedom = exact + clicked, max(sum(2 * place.images - 3 for place in places.values()), 1)
    limit = np.sqrt(variance) * student.ppf(0.975, freedom * (variance / max(clicked, 1e-300)) ** 2)
    if len(bars) > 1:
        scatter = float(weights @ (ratios / scale - 1.0) ** 2) / (len(bars) - 1)
        if scatter > variance:
            limit = max(limit, np.sqrt(scatter) * student.ppf(0.975, len(bars) - 1))
    return scale, float(limit)
