"""Parts of a page about one cloud, reconstructed or sampled: figures, tables, unit of length."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from falsework.report.cloud_view import Shown, cloud_view
from falsework.report.figures import class_figure, flight_figure, uncertainty_figure
from falsework.report.flight import flight_of_cloud
from falsework.report.lens import correlation_rows, footprint, lens_rows, miss_figure, tie_rows
from falsework.report.plan_view import color_figure, height_figure, plan_view
from falsework.report.positions import expected_errors, measured_centers, position_figures
from falsework.report.residuals import (
    image_rows,
    image_table,
    model_fit,
    overlap_figure,
    residual_figure,
    stored_cameras,
)
from falsework.report.scene_tables import (
    NOISE_THRESHOLD,
    fact_rows,
    headline_tiles,
    kept_rows,
    noise_rows,
    pixel_rows,
    unit_of,
    window_rows,
)
from groundwork.slug import slug
from recon.cloud import SFM_DENSE
from usd_schemas.components import UNLABELED

if TYPE_CHECKING:
    from recon.cloud import Cloud
    from recon.sfm.covariance import Precision
    from render.capture import Capture, Truth

NOTHING: Mapping[str, Any] = {
    "is_cloud": False,
    "classes": None,
    "threshold": None,
    "noise": [],
    "residuals": None,
    "misses": None,
    "overlap": None,
    "above": None,
    "heights": None,
    "ellipses": None,
    "differences": None,
    "known": False,
    "from_truth": True,
    **dict.fromkeys(("facts", "kept", "windows", "pixels", "images", "lens", "correlation", "ties"), ()),
}
"""What a page says of photographs without a cloud."""


def reconstruction_parts(
    cloud: "Cloud",
    folder: Path,
    links: Mapping[str, str],
    capture: "Capture | None" = None,
    truth: "Truth | None" = None,
    *,
    of_model: bool = True,
) -> dict[str, Any]:
    """Fill what the template shows of a reconstructed cloud.

    Args:
        cloud: The cloud.
        folder: Its folder, with the cameras of the reconstruction.
        links: Link to the file of each photograph, by name.
        capture: The photographs; None where they are not at hand.
        truth: Their truth; None where there is none.
        of_model: Show the expected errors of its model, too; not where another cloud of the same model shows them.
    """
    fit, cameras = model_fit(folder), stored_cameras(folder)
    rows = image_rows(cloud, folder, fit)
    size = cameras.get("camera", {}).get("size")
    one_pixel = footprint(cloud, cameras) if unit_of(cloud) == "m" else None
    noise, segment = cloud.statistics.get("noise"), cloud.columns["segment"]
    precision = expected_errors(folder) if of_model else None
    return {
        **_seen_from_above(cloud),
        **(_positions(cloud, cameras, precision, measured_centers(cloud, capture, truth)) if of_model else {}),
        "is_cloud": True,
        "threshold": None if noise is None else f"{noise['threshold']:g} m",
        "noise": noise_rows(noise),
        "classes": class_figure(segment, cloud.classes) if (segment != UNLABELED).any() else None,
        "known": bool(np.isfinite(cloud.columns["uncertainty"]).any()),
        "uncertainty": uncertainty_figure(cloud.columns["uncertainty"], NOISE_THRESHOLD),
        "residuals": residual_figure(rows) if any(np.isfinite(row.residual) for row in rows) else None,
        "overlap": overlap_figure(cloud, unit_of(cloud)) if len(cloud.observations["image"]) else None,
        "from_truth": cloud.alignment.get("target", "truth") == "truth",
        "facts": fact_rows(cloud),
        "kept": kept_rows(cloud.statistics),
        "windows": window_rows(cloud.statistics),
        "pixels": pixel_rows(cloud.statistics),
        "images": image_table(rows, dict(links)),
        "lens": lens_rows(cloud, capture, truth, precision),
        "correlation": correlation_rows(precision),
        "ties": tie_rows(cloud, fit)
        + ([] if one_pixel is None else [("size of a pixel on the surface [mm]", f"{1000 * one_pixel:.1f}")]),
        "misses": miss_figure(fit, (size[0], size[1])) if fit is not None and size else None,
    }


def _seen_from_above(cloud: "Cloud") -> dict[str, Any]:
    """Draw colors and heights of a dense cloud; a sparse one has too few points."""
    view = plan_view(cloud) if cloud.source == SFM_DENSE else None
    if view is None:
        return {}
    painted = color_figure(view, unit_of(cloud)) if view.color.any() else None
    return {"above": painted, "heights": height_figure(view, unit_of(cloud))}


def _positions(
    cloud: "Cloud", cameras: Mapping[str, Any], precision: "Precision | None", measured: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """Draw expected and actual errors of the positions of good cameras."""
    good = {str(camera["name"]) for camera in cloud.cameras if camera["status"] == "ok"}
    poses = cameras.get("poses", ())
    centers = {row["name"]: np.array(row["camera_to_world"], np.float64)[:3, 3] for row in poses if row["name"] in good}
    ellipses, differences = position_figures(precision, centers, measured, unit_of(cloud))
    return {"ellipses": ellipses, "differences": differences}


def cloud_parts(name: str, cloud: "Cloud", folder: Path, shown: Shown) -> dict[str, Any]:
    """Make the template's values of a reconstructed cloud whose photographs are not at hand.

    Args:
        name: Its name.
        cloud: The cloud.
        folder: Its folder, with the cameras of the reconstruction.
        shown: Limits of its data on the page.
    """
    flight = flight_of_cloud(cloud, folder)
    centers, nothing = flight.poses[:, :3, 3], np.zeros((0, 3))
    plan = flight_figure(centers, list(flight.statuses), nothing, unit=unit_of(cloud)) if len(centers) else None
    return {
        **NOTHING,
        **reconstruction_parts(cloud, folder, {}),
        "name": name,
        "heading": f"Cloud {name}",
        "key": slug(name),
        "tiles": headline_tiles(len(cloud.cameras), cloud),
        "view": cloud_view(cloud, flight, shown),
        "flight": plan,
        **dict.fromkeys(("sheet", "frames", "legend"), ()),
    }


def sample_parts(name: str, cloud: "Cloud", shown: Shown) -> dict[str, Any]:
    """Make the template's values of a cloud that was sampled from a stage.

    Args:
        name: Its name.
        cloud: The cloud.
        shown: Limits of its data on the page.
    """
    return {
        "name": name,
        "key": slug(f"sample {name}"),
        "source": cloud.source,
        "tiles": [{"label": "points", "value": f"{len(cloud):,}"}],
        "view": cloud_view(cloud, None, shown),
        "classes": class_figure(cloud.columns["segment"], cloud.classes),
    }
