"""The figures of a cloud: numbers of cameras and points, errors, and quality of the labels."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.placing.align import OK, REGISTERED, Alignment
from recon.sfm.colmap_model import SparseModel
from usd_schemas.components import UNLABELED, ClassRow

NEAR = 0.1  # [m] a point this close to the true surface counts as on it
CLEAR = 3.0  # [px] a point this far from label edges counts as inside
HISTOGRAM_EDGES = tuple(float(f"{10 ** (power / 4):.3g}") for power in range(-12, 5))  # [m] 1 mm to 10 m


def describe(
    columns: Mapping[str, NDArray[Any]], alignment: Alignment, model: SparseModel, classes: tuple[ClassRow, ...]
) -> dict[str, Any]:
    """Sum up a cloud.

    Args:
        columns: The cloud's columns, shape (N,) or (N, width) each; units and types as in `recon.cloud.COLUMNS`.
        alignment: Its alignment.
        model: The model that it came from.
        classes: Class table of the cloud.

    Returns:
        JSON figures; None where nothing is known.
    """
    status = np.array(alignment.status)
    valid, registered = status == OK, np.isin(status, REGISTERED)
    views, segment, uncertainty = columns["n_views"], columns["segment"], columns["uncertainty"]
    figures: dict[str, Any] = {
        "images": len(status),
        "registered": int(registered.sum()),
        "registered_share": float(registered.mean()),
        "valid": int(valid.sum()),
        "center_error_median": _quantile(alignment.center_errors[valid], 0.5),
        "center_error_p95": _quantile(alignment.center_errors[valid], 0.95),
        "rotation_error_median": _quantile(alignment.rotation_errors[valid], 0.5),
        "rotation_error_p95": _quantile(alignment.rotation_errors[valid], 0.95),
        "model_points": len(model.points),
        "points": len(segment),
        "observations": int(views.sum()),
        "mean_track_length": _mean(views),
        "mean_reprojection_error": _mean(columns["reprojection_error"][~np.isnan(columns["reprojection_error"])]),
        "camera_model": model.camera_model,
        "camera_params": list(model.camera_params),
        "points_per_class": {row.name: int((segment == row.id).sum()) for row in classes},
        "uncertainty_median": _quantile(uncertainty, 0.5),
        "uncertainty_p95": _quantile(uncertainty, 0.95),
        "noisy_share_0.1m": _mean(uncertainty > NEAR) if np.isfinite(uncertainty).any() else None,
        "uncertainty_histogram": _histogram(uncertainty),
        "surface_distance_median": _quantile(columns["surface_distance"], 0.5),
        "surface_distance_p95": _quantile(columns["surface_distance"], 0.95),
    }
    moving = int((np.isnan(columns["surface_distance"]) & ~np.isnan(uncertainty)).sum())
    return figures | _label_figures(columns) | ({"moving_points": moving} if moving else {})


def verdict_in_words(status: tuple[str, ...], points: int, found: int, note: str, lost: Sequence[str]) -> str:
    """Describe in one line the result for the photographs.

    Args:
        status: Reason code of each.
        points: Number of points in the cloud.
        found: Number of points before uncertain ones were removed.
        note: What the model was aligned to.
        lost: Classes of which `max_deviation` removed more than half.
    """
    others = ", ".join(f"{count} {code}" for code, count in sorted(Counter(status).items()) if code != OK)
    where = f" ({others})" if others else ""
    count = f"{points:,} of {found:,}" if points < found else f"{points:,}"
    who = "the points" if lost == ["unlabelled"] else ", ".join(lost)
    hint = (
        f" (more than half of {who} left out as too uncertain: raise [recon] max_deviation to keep more)"
        if lost
        else ""
    )
    return f"{status.count(OK)} of {len(status)} photographs ok{where}, {count} points{hint}; {note}"


def _label_figures(columns: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    known = columns["surface_class"] != UNLABELED
    near = known & (columns["surface_distance"] <= NEAR)
    clear = near & (columns["label_margin_px"] >= CLEAR)
    right = columns["segment"] == columns["surface_class"]
    anything = bool(known.any())
    return {
        "within_0.1m_share": _mean(near) if anything else None,
        "right_class_share": _mean(right[near]) if anything else None,
        "right_class_share_margin_3px": _mean(right[clear]) if anything else None,
        "margin_3px_share": _mean(clear[near]) if anything else None,
    }


def _histogram(values: NDArray[Any]) -> dict[str, Any]:
    """Count below the first edge, between edges, above the last, and at infinity."""
    finite = values[np.isfinite(values)]
    counts = np.bincount(np.searchsorted(HISTOGRAM_EDGES, finite, side="right"), minlength=len(HISTOGRAM_EDGES) + 1)
    return {"edges": list(HISTOGRAM_EDGES), "counts": counts.tolist(), "infinite": int(np.isposinf(values).sum())}


def _quantile(values: NDArray[Any], share: float) -> float | None:
    known = values[~np.isnan(values)]
    if not len(known):
        return None
    value = float(np.quantile(known.astype(np.float64), share, method="nearest"))  # "nearest" does not mix infinities
    return value if np.isfinite(value) else None


def _mean(values: NDArray[Any]) -> float | None:
    return float(values.mean(dtype=np.float64)) if len(values) else None
