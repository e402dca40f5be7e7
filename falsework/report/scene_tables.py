"""Figures and tables of a scene's page: summary, points kept, points removed with reasons."""

from collections.abc import Mapping
from itertools import compress
from typing import TYPE_CHECKING, Any

import numpy as np

from falsework.report.page import number, percent

if TYPE_CHECKING:
    from recon.cloud import Cloud

NOISE_THRESHOLD = 0.1  # [m] Shi 2024 calls points above it noisy
NEAR = 0.1  # [m]
REASONS = ("views", "reprojection", "deviation", "duplicate")
UNITS = {
    "center_error": "m",
    "rotation_error": "°",
    "surface_distance": "m",
    "uncertainty": "m",
    "mean_reprojection_error": "px",
}  # by the prefix of a statistic's name


def unit_of(cloud: "Cloud") -> str:
    """Return the unit of a cloud's lengths; a cloud that was not placed has none.

    Args:
        cloud: A cloud.
    """
    return "units of the model" if cloud.alignment.get("unit") == "unknown" else "m"


def headline_tiles(images: int, cloud: "Cloud | None") -> list[dict[str, str]]:
    """Return the main results as a few large figures.

    Args:
        images: Number of photographs.
        cloud: Their cloud, or None.
    """
    tiles = [{"label": "images", "value": f"{images}"}]
    if cloud is None:
        return tiles
    good = [camera for camera in cloud.cameras if camera["status"] == "ok"]
    tiles[0] = {"label": "cameras registered", "value": f"{len(good)} of {len(cloud.cameras)}"}
    tiles.append({"label": "points", "value": f"{len(cloud):,}"})
    errors = np.array([camera["center_error"] for camera in good], dtype=np.float64)
    if np.isfinite(errors).any() and cloud.alignment.get("target", "truth") == "truth":
        tiles.append(
            {"label": "median error of the camera positions", "value": f"{np.nanmedian(errors) * 1000:.0f} mm"}
        )
    elif np.isfinite(errors).any():  # distances of cameras to their GPS fixes are errors of the receiver
        tiles.append(
            {"label": "median distance of a camera from its GPS fix", "value": f"{np.nanmedian(errors):.2f} m"}
        )
    if np.isfinite(cloud.columns["surface_distance"]).any():
        near = cloud.columns["surface_distance"] <= NEAR
        right = (
            float(np.mean(cloud.columns["segment"][near] == cloud.columns["surface_class"][near]))
            if near.any()
            else 0.0
        )
        quiet = float(np.mean(cloud.columns["uncertainty"] <= NOISE_THRESHOLD))
        tiles.append(
            {"label": f"of the points are within {NEAR:g} m of the true surface", "value": f"{near.mean():.1%}"}
        )
        tiles.append({"label": "of these have the class of the surface", "value": f"{right:.1%}"})
        tiles.append(
            {"label": f"of the points have an uncertainty of at most {NOISE_THRESHOLD:g} m", "value": f"{quiet:.1%}"}
        )
    return tiles


def fact_rows(cloud: "Cloud") -> list[tuple[str, str]]:
    """Format all figures of the statistics, and the errors of the model's placement.

    Args:
        cloud: A cloud.
    """
    plain = sorted((key, value) for key, value in cloud.statistics.items() if isinstance(value, int | float | str))
    return [
        *((key.replace("_", " "), number(value) + _unit(key)) for key, value in plain),
        *placing_rows(cloud.alignment),
    ]


def placing_rows(alignment: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Describe the possible errors of a model that was placed without truth, and the residual of every control point.

    Args:
        alignment: Facts of the alignment.
    """
    units = {"scale_percent": " %", "tilt_deg": "°", "heading_deg": "°", "place_m": " m"}
    limits = alignment.get("expected_error", {})
    rows = [("unit of length", "unknown")] if alignment.get("unit") == "unknown" else []
    if alignment.get("unfixed"):
        rows.append(("GPS does not determine the frame", str(alignment["unfixed"])))
    if alignment.get("agreeing_fixes") is not None:
        rows.append(("GPS fixes that agree", f"{alignment['agreeing_fixes']} of {alignment['fixes']}"))
    rows += [
        (
            f"error of {key.partition('_')[0]}, 95 % below",
            f"{limits[key]:{'.2g' if limits[key] < 100.0 else '.0f'}}{unit}",
        )
        for key, unit in units.items()
        if limits.get(key) is not None
    ]
    for row in alignment.get("control_points", ()):
        left_out = "" if row["agrees"] else ", left out"
        rows.append((f"control point {row['name']} off by", f"{row['distance']:.3f} m{left_out}"))
    rows += [
        (f"scale bar {' to '.join(row['ends'])} off by", f"{row['error']:+.4f} m")
        for row in alignment.get("scale_bars", ())
    ]
    return rows


def kept_rows(statistics: Mapping[str, Any]) -> list[list[str]]:
    """List for each class the points kept and removed, with reasons, and the windows along the bridge with few points.

    Args:
        statistics: Of a cloud.
    """
    rows = []
    for name, row in statistics.get("classes", {}).items():
        dropped = [f"{row['dropped'][why]:,}" for why in REASONS]
        few = f"{row['few_in']} of {row['windows']}" if row.get("windows") else ""
        rows.append([name, f"{row['kept']:,}", *dropped, few])
    return rows


def window_rows(statistics: Mapping[str, Any]) -> list[list[str]]:
    """Count the points of each class in each window along the bridge that the flight covered.

    Args:
        statistics: Of a cloud.

    Returns:
        The headings (the start of each window along the bridge) and a row for each class; empty if the bridge is
        unknown.
    """
    windows = statistics.get("windows")
    if not windows:
        return []
    seen = windows["seen"]
    heads = ["class", *(f"{number * windows['length']:g} m" for number in compress(range(len(seen)), seen))]
    classes = statistics["classes"].items()
    return [heads, *([name, *(f"{points:,}" for points in compress(row["in_windows"], seen))] for name, row in classes)]


def pixel_rows(statistics: Mapping[str, Any]) -> list[list[str]]:
    """List for each class its pixels in the depth maps, the share in points, and the reasons for the others.

    Args:
        statistics: Of a cloud.
    """
    rows = []
    for name, row in statistics.get("pixels", {}).items():
        total = sum(row.values())
        shares = [percent(row[fate] / total) for fate in ("in_points", "no_depth", "views", "seen_through", "angle")]
        rows.append([name, f"{total:,}", *shares])
    return rows


def noise_rows(noise: dict[str, Any] | None) -> list[tuple[str, str]]:
    """List the share of noisy points by distance, and how well the uncertainty detects points with errors.

    Args:
        noise: Entry of the statistics of a cloud, or None.
    """
    if noise is None:
        return []
    rows = []
    for band in noise["by_distance"]:
        span = f"from {band['from']:g} m" if band["to"] is None else f"{band['from']:g} to {band['to']:g} m"
        rows.append((f"noisy of the {band['points']:,} seen {span} away", percent(band["noisy_share"])))
    for name, place in (
        ("displacement", "the point where their pixels look"),
        ("surface_distance", "the true surface"),
    ):
        found, limit = noise[f"against_{name}"], f"{noise['threshold']:g} m"
        if name != "displacement":  # the noisy are displaced by definition
            rows.append((f"of the noisy, off by more than {limit} from {place}", percent(found["precision"])))
        rows.append((f"of those off by more than {limit} from {place}, noisy", percent(found["recall"])))
    return rows


def _unit(key: str) -> str:
    return next((f" {unit}" for start, unit in UNITS.items() if key.startswith(start)), "")
