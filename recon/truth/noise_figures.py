"""How well the measured uncertainty detects points with errors, and where these are."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

THRESHOLD = 0.1  # [m] as in the paper: a point with a larger uncertainty is noisy
BANDS = (0.0, 8.0, 15.0, 40.0, np.inf)  # [m] from the nearest camera that saw a point


def describe_noise(columns: Mapping[str, NDArray[Any]], distance: NDArray[np.float64]) -> dict[str, Any] | None:
    """Sum up the noisy points of a cloud with truth.

    Precision is the share of the noisy points with an error above the threshold; recall is the share of the points with
    such an error that are noisy. The error is measured twice: from the true surface, and from the point that the true
    camera sees.

    Args:
        columns: `uncertainty`, `surface_distance` and `displacement` of a cloud [m], shape (N,), float32 each.
        distance: Depth of each point in the nearest camera that saw it [m], shape (N,), float64.

    Returns:
        JSON figures; None without truth.
    """
    noisy = columns["uncertainty"] > THRESHOLD
    if np.isnan(columns["uncertainty"]).all():
        return None
    bands = []
    for low, high in pairwise(BANDS):
        inside = (distance >= low) & (distance < high)
        bands.append(
            {
                "from": low,
                "to": high if np.isfinite(high) else None,
                "points": int(inside.sum()),
                "noisy_share": _share(noisy[inside]),
            }
        )
    return {
        "threshold": THRESHOLD,
        "by_distance": bands,
        **{
            f"against_{name}": {
                "precision": _share(columns[name][noisy] > THRESHOLD),
                "recall": _share(noisy[columns[name] > THRESHOLD]),
            }
            for name in ("surface_distance", "displacement")
        },
    }


def _share(flags: NDArray[np.bool_]) -> float | None:
    return float(flags.mean()) if len(flags) else None
