"""A cloud of points whose true position on the surface is known: the columns that all samplers fill alike."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.cloud import Cloud, without_observations
from recon.sampling.scene_surface import SceneSurface
from recon.sampling.thinning import one_in_each_cube
from recon.truth.bridge_digest import bridge_digest
from recon.truth.component_kinds import component_kinds, kind_rows
from usd_schemas.flat_scene import FlatScene
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_CHUNK = 1_000_000  # points per nearest-surface query


@dataclass(frozen=True, eq=False)
class Samples:
    """Measured points and their true positions.

    Attributes:
        points: Measured positions [m], shape (N, 3), float64.
        true_points: Positions on the surface that they come from [m], shape (N, 3), float64.
        rows: Triangle that each comes from, shape (N,), int64.
        normals: Unit normals of those triangles [1], shape (N, 3), float64.
        colors: sRGB base colors, shape (N, 3), uint8.
        uncertainty: Error of the measurement itself [m], shape (N,), float64.
        relative: That error over the measured distance, NaN where there is none [1], shape (N,), float64.
        views: Cameras that see the position, shape (N,), uint16.
        further: Some of `recon.cloud.OPTIONAL_COLUMNS`, shape (N,) each, unit and dtype as there.
    """

    points: F64
    true_points: F64
    rows: I64
    normals: F64
    colors: NDArray[np.uint8]
    uncertainty: F64
    relative: F64
    views: NDArray[np.uint16]
    further: Mapping[str, NDArray[Any]]

    def thinned(self, size: float, ranks: F64) -> "Samples":
        """Keep one point in each cube.

        Args:
            size: Edge of the cubes [m].
            ranks: A random number for each point: the lowest in a cube is kept [1], shape (N,), float64.
        """
        rows = one_in_each_cube(self.points, size, ranks)
        columns = {name: values[rows] for name, values in vars(self).items() if name != "further"}
        return Samples(**columns, further={name: values[rows] for name, values in self.further.items()})


def annotate_samples(
    samples: Samples,
    scene: FlatScene,
    surface: SceneSurface,
    rays: RayScene | None,
    source: str,
    facts: Mapping[str, Any],
) -> Cloud:
    """Label samples by the triangle that they come from.

    Args:
        samples: The points.
        scene: The stage.
        surface: Its surface.
        rays: The same surface for distances; None where no point was moved.
        source: One of `recon.cloud.SOURCES`.
        facts: JSON facts of the sampler, kept in the statistics.
    """
    count = len(samples.points)
    segment, instance = surface.labels[samples.rows], surface.instances[samples.rows]
    displacement = np.linalg.norm(samples.points - samples.true_points, axis=1)
    distance, nearest = _nearest(samples, displacement, rays)
    components = component_kinds(scene.instances)
    columns = {
        **_measured_columns(samples),
        "segment": segment,
        "instance": instance,
        "component": kind_rows(instance, scene.instances),
        "displacement": displacement.astype(np.float32),
        "surface_distance": distance.astype(np.float32),
        "surface_class": surface.labels[nearest],
    }
    statistics = {
        **facts,
        "points": count,
        "points_per_class": {row.name: int((segment == row.id).sum()) for row in scene.classes},
        "displacement_mean": float(displacement.mean()) if count else None,
        "right_class_share": float((segment == columns["surface_class"]).mean()) if count else None,
    }
    note = "sampled from the stage: labels are those of the surface that each point comes from"
    return Cloud(
        columns,
        without_observations(count),
        components,
        scene.classes,
        {"target": "stage", "note": note},
        (),
        statistics,
        source,
        bridge_digest(surface.corners, surface.instances, surface.labels, scene.instances),
    )


def _measured_columns(samples: Samples) -> dict[str, NDArray[Any]]:
    """Fill the columns of the measurement; those of photographs stay empty."""
    count = len(samples.points)
    nothing = np.full(count, np.nan, np.float32)
    error = samples.uncertainty.astype(np.float32)
    return {
        "coord": samples.points,
        "color": samples.colors,
        "normal": samples.normals.astype(np.float32),
        "confidence": np.ones(count, np.float32),
        "label_margin_px": nothing,
        "uncertainty": error,
        "uncertainty_min": error,
        "uncertainty_max": error,
        "uncertainty_relative": samples.relative.astype(np.float32),
        "reprojection_error": nothing,
        "n_views": samples.views,
        **samples.further,
    }


def _nearest(samples: Samples, displacement: F64, rays: RayScene | None) -> tuple[F64, I64]:
    """Find the distance to the nearest surface and its triangle; a point without displacement lies on its own."""
    distance, rows = np.zeros(len(displacement)), samples.rows.copy()
    if rays is None:
        return distance, rows
    moved = np.flatnonzero(displacement > 0)
    for first in range(0, len(moved), _CHUNK):
        at = moved[first : first + _CHUNK]
        distance[at], rows[at] = rays.distance(samples.points[at])
    return np.minimum(distance, displacement), rows  # at most its own displacement, despite rounding
