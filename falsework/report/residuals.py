"""Contribution and residuals of each image, and the map of image overlap."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from falsework.report.page import BLUE, RED, number, plain_layout
from groundwork.files import read_json
from recon.cloud import SFM_DENSE
from recon.sfm.camera_model import project

if TYPE_CHECKING:
    from recon.cloud import Cloud

F64 = NDArray[np.float64]

CELLS = 140  # of the overlap map along its longer side
FINEST_CELL = 0.25  # [m]
MANY = 6  # number of images above which the color does not change
SCALE = ["#b8322a", "#dd7a35", "#e8c04a", "#a3bf5a", "#4f9d69", "#2b7a78"]


@dataclass(frozen=True)
class ImageRow:
    """Figures of one image of a reconstruction.

    Attributes:
        name: Its name.
        status: `ok` or the reason code.
        points: Number of the cloud's points that it shows.
        residual: Median distance between keypoint and reprojected point [px]; NaN if there is none.
        depth_error: Median difference of true and reconstructed depth [m]; NaN without truth.
        center_error: Distance from its true or measured position [m]; NaN if it has none.
        rotation_error: Angle to its true attitude [deg]; NaN without truth.
    """

    name: str
    status: str
    points: int
    residual: float
    depth_error: float
    center_error: float
    rotation_error: float


@dataclass(frozen=True)
class ModelFit:
    """How far the tie points of a model appear from their keypoints.

    Attributes:
        names: Name of each registered image, without its suffix.
        image: Row in `names` of each keypoint, shape (M,), int64.
        uv: The keypoints [px], shape (M, 2), float64.
        miss: From each keypoint to where its point appears [px], shape (M, 2), float64.
    """

    names: tuple[str, ...]
    image: NDArray[np.int64]
    uv: F64
    miss: F64

    def medians(self) -> dict[str, float]:
        """Give the median distance between keypoint and point [px], by the name of the image."""
        away = np.linalg.norm(self.miss, axis=1)
        return {name: _median(away[self.image == row]) for row, name in enumerate(self.names)}


def image_rows(cloud: "Cloud", folder: Path, fit: ModelFit | None = None) -> list[ImageRow]:
    """Sum up each image of a reconstructed cloud.

    A dense cloud holds no keypoints: what it holds of an image are the pixels of its own depth maps. What fits there
    is the model that it rests on.

    Args:
        cloud: A cloud.
        folder: Its folder, with the cameras of the reconstruction.
        fit: How well its model fits the keypoints; None where the folder has no model.
    """
    dense = cloud.source == SFM_DENSE
    residuals = None if dense else reprojection_residuals(cloud, folder)
    fits = fit.medians() if dense and fit is not None else {}
    image = cloud.observations["image"]
    order = np.argsort(image, kind="stable")
    ends = np.searchsorted(image[order], np.arange(len(cloud.cameras) + 1))
    rows = []
    for number_, camera in enumerate(cloud.cameras):
        mine = order[ends[number_] : ends[number_ + 1]]
        rows.append(
            ImageRow(
                str(camera["name"]),
                str(camera["status"]),
                len(mine),
                fits.get(str(camera["name"]), np.nan) if residuals is None else _median(residuals[mine]),
                _median(cloud.observations["depth_error"][mine]),
                _float(camera.get("center_error")),
                _float(camera.get("rotation_error")),
            )
        )
    return rows


def reprojection_residuals(cloud: "Cloud", folder: Path) -> F64:
    """Compute the reprojection error of each observation.

    Args:
        cloud: A cloud.
        folder: Its folder.

    Returns:
        Distance of each observation [px], shape (M,), float64; NaN if its camera is unknown.
    """
    image = cloud.observations["image"]
    result = np.full(len(image), np.nan)
    stored = stored_cameras(folder)
    if not stored or not len(image):
        return result
    poses = {row["name"]: np.array(row["camera_to_world"], np.float64) for row in stored["poses"]}
    point = np.repeat(np.arange(len(cloud)), np.diff(cloud.observations["start"]))
    for row, camera in enumerate(cloud.cameras):
        mine = np.flatnonzero(image == row)
        if camera["name"] not in poses or not len(mine):
            continue
        pose = poses[camera["name"]]
        local = (cloud.columns["coord"][point[mine]] - pose[:3, 3]) @ pose[:3, :3]
        lens = stored["camera"]
        seen = project(local[:, :2] / local[:, 2:], lens["model"], np.array(lens["params"], np.float64))
        result[mine] = np.linalg.norm(seen - cloud.observations["uv"][mine], axis=1)
    return result


def stored_cameras(folder: Path) -> dict[str, Any]:
    """Read lens and poses of a reconstruction; nothing where the folder has none.

    Args:
        folder: Folder of a cloud.
    """
    path = folder / "cameras_sfm.json"
    return read_json(path) if path.is_file() else {}


def model_fit(folder: Path) -> ModelFit | None:
    """Measure how well the model of structure from motion fits its keypoints.

    Args:
        folder: Folder of a cloud, with the model in `sparse`.

    Returns:
        The fit; None where there is no model.

    Raises:
        InputError: The model is damaged.
    """
    from recon.sfm.colmap_model import read_model

    if not (folder / "sparse" / "images.bin").is_file():
        return None
    model = read_model(folder / "sparse")
    poses = model.poses[model.obs_image]
    local = np.einsum("mi,mij->mj", model.points[model.obs_point] - poses[:, :3, 3], poses[:, :3, :3])
    seen = project(local[:, :2] / local[:, 2:], model.camera_model, np.array(model.camera_params))
    names = tuple(Path(name).stem for name in model.names)
    return ModelFit(names, model.obs_image, model.obs_uv, seen - model.obs_uv)


def residual_figure(rows: list[ImageRow]) -> go.Figure:
    """Plot the median residual of every image, in the order of the flight.

    Args:
        rows: Of `image_rows`.
    """
    good = [row.status == "ok" for row in rows]
    figure = go.Figure(
        go.Bar(
            x=list(range(len(rows))),
            y=[row.residual for row in rows],
            marker_color=[BLUE if right else RED for right in good],
            text=None,
            hovertemplate="image %{x}: %{y:.2f} px<extra></extra>",
        )
    )
    plain_layout(figure, 300)
    return figure.update_layout(xaxis={"title": "image"}, yaxis={"title": "median residual [px]"}, bargap=0.15)


def overlap_figure(cloud: "Cloud", unit: str = "m") -> go.Figure:
    """Plot in plan how many images show each place where the cloud has points.

    Args:
        cloud: A reconstructed cloud.
        unit: Unit of its lengths, for the axes.
    """
    counts, x, y = overlap_map(cloud)
    steps = [[k / (MANY - 1), color] for k, color in enumerate(SCALE)]
    figure = go.Figure(
        go.Heatmap(
            z=np.where(counts > 0, counts.astype(float), np.nan),
            x=x,
            y=y,
            zmin=1,
            zmax=MANY,
            colorscale=steps,
            colorbar={
                "title": "images",
                "tickvals": [1, 2, 3, 4, 5, MANY],
                "ticktext": ["1", "2", "3", "4", "5", f"≥ {MANY}"],
            },
            hovertemplate="%{z:.0f} images at x %{x:.1f}"
            + (", y %{y:.1f}" if unit != "m" else " m, y %{y:.1f} m")
            + "<extra></extra>",
        )
    )
    plain_layout(figure, 420)
    return figure.update_layout(
        xaxis={"title": f"x [{unit}]", "constrain": "domain"}, yaxis={"title": f"y [{unit}]", "scaleanchor": "x"}
    )


def overlap_map(cloud: "Cloud") -> tuple[NDArray[np.int64], F64, F64]:
    """Count the different images of the points in each cell of the plan.

    Args:
        cloud: A reconstructed cloud; the outermost 5 % of its points are left out.

    Returns:
        Number of images of each cell, shape (rows, columns), int64; centers of the columns [m], shape (columns,), and
        of the rows [m], shape (rows,), float64.
    """
    place = cloud.columns["coord"][:, :2]
    low, high = np.percentile(place, [1, 99], axis=0)
    cell = max(float((high - low).max()) / CELLS, FINEST_CELL)
    shape = np.maximum(np.ceil((high - low) / cell).astype(int), 1)
    at = np.floor((place - low) / cell).astype(int)
    inside = ((at >= 0) & (at < shape)).all(axis=1)
    point = np.repeat(np.arange(len(cloud)), np.diff(cloud.observations["start"]))
    kept = inside[point]
    flat = at[point[kept], 1] * shape[0] + at[point[kept], 0]
    images = max(len(cloud.cameras), 1)
    pairs = np.unique(flat.astype(np.int64) * images + cloud.observations["image"][kept])
    counts = np.bincount(pairs // images, minlength=int(shape[0] * shape[1])).reshape(shape[1], shape[0])
    x, y = (low[k] + cell * (np.arange(shape[k]) + 0.5) for k in (0, 1))
    return counts, x.round(3), y.round(3)


def image_table(rows: list[ImageRow], links: dict[str, str]) -> list[dict[str, Any]]:
    """Format the rows of a table.

    Args:
        rows: Of `image_rows`.
        links: Link to the file of each name.
    """
    return [
        {
            "name": row.name,
            "file": links.get(row.name, ""),
            "status": row.status,
            "cells": [
                f"{row.points:,}",
                number(round(row.residual, 3)),
                _millimeters(row.depth_error),
                _millimeters(row.center_error),
                number(round(row.rotation_error, 4)),
            ],
        }
        for row in rows
    ]


def _median(values: NDArray[Any]) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _float(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")


def _millimeters(value: float) -> str:
    return "–" if np.isnan(value) else f"{1000 * value:.1f}"
