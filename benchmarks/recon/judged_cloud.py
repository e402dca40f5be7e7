"""A cloud compared with its truth: which points are on the surface, which have its class, which are clearly wrong."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.cloud import Cloud
from recon.truth.statistics import NEAR
from recon.truth.triangle_points import nearest_on_triangles
from usd_schemas.raycast import RayScene

Bools = NDArray[np.bool_]
F64 = NDArray[np.float64]

CLEAR = 0.03  # [m] a point that its own class is no farther from than the nearest surface and this lies at a border
PRECISE = 0.05  # [m] uncertainty up to which a point counts as precise
FEWEST, ALL_RIGHT = 20, 0.95  # points of an instance that counts, and share of them that makes it right [1]


@dataclass(frozen=True, eq=False)
class Judged:
    """What is known of the points of a cloud.

    Attributes:
        cloud: The cloud.
        distance: Distance of each point from the nearest camera that saw it [m], shape (N,), float64.
        near: Whether each point is on the true surface, shape (N,), bool.
        right: Whether each is there and has the class of that surface, shape (N,), bool.
        clear: Whether each is there, has another class, and the nearest surface of its own class lies more than
            `CLEAR` farther than that one, shape (N,), bool.
    """

    cloud: Cloud
    distance: F64
    near: Bools
    right: Bools
    clear: Bools

    @property
    def agreed(self) -> Bools:
        """Whether all views of a point show its class, shape (N,), bool."""
        return self.cloud.columns["confidence"] == 1.0

    @property
    def precise(self) -> Bools:
        """Whether the uncertainty of each point is at most `PRECISE`, shape (N,), bool."""
        return self.cloud.columns["uncertainty"] <= PRECISE

    @property
    def classes(self) -> dict[int, str]:
        """Name of each class by its number."""
        return {row.id: row.name for row in self.cloud.classes}


def judge(cloud: Cloud, distance: F64, corners: F64, labels: NDArray[np.uint8]) -> Judged:
    """Compare a cloud with its truth.

    Args:
        cloud: A cloud of a capture with truth.
        distance: Distance of each point from the nearest camera that saw it [m], shape (N,), float64.
        corners: Triangles of its stage [m], shape (T, 3, 3), float64.
        labels: Class of each, shape (T,), uint8.
    """
    columns = cloud.columns
    near = columns["surface_distance"] <= NEAR
    right = near & (columns["segment"] == columns["surface_class"])
    wrong = np.flatnonzero(near & ~right)
    own = distance_to_class(columns["coord"][wrong].astype(np.float64), columns["segment"][wrong], corners, labels)
    clear = np.zeros(len(near), bool)
    clear[wrong] = own - columns["surface_distance"][wrong] > CLEAR
    return Judged(cloud, distance, near, right, clear)


def distance_to_class(points: F64, classes: NDArray[np.uint8], corners: F64, labels: NDArray[np.uint8]) -> F64:
    """Measure how far the nearest surface of its own class is from each point.

    Args:
        points: World positions [m], shape (N, 3), float64.
        classes: Class of each, shape (N,), uint8.
        corners: Triangles [m], shape (T, 3, 3), float64.
        labels: Class of each, shape (T,), uint8.

    Returns:
        Distances [m], infinite where the class has no surface, shape (N,), float64.
    """
    found = np.full(len(points), np.inf)
    for number in np.unique(classes):
        mine, rows = corners[labels == number], np.flatnonzero(classes == number)
        if len(mine):
            _, nearest = RayScene(mine, np.zeros(len(mine), np.uint32)).nearest(points[rows])
            foot = nearest_on_triangles(points[rows], mine, nearest)
            found[rows] = np.linalg.norm(points[rows] - foot, axis=1)
    return found


def instances_right(judged: Judged, within: Bools | None = None) -> tuple[int, int]:
    """Count instances that are labeled right, as a whole.

    Args:
        judged: The cloud.
        within: Points to look at, shape (N,), bool; all when None.

    Returns:
        Instances of which at least `ALL_RIGHT` of the points on the surface have its class, and instances with
        `FEWEST` such points.
    """
    taken = judged.near if within is None else judged.near & within
    instance = judged.cloud.columns["instance"]
    named = taken & (instance > 0)
    _, which, count = np.unique(instance[named], return_inverse=True, return_counts=True)
    share = np.bincount(which, weights=judged.right[named], minlength=len(count)) / np.maximum(count, 1)
    counts = count >= FEWEST
    return int((counts & (share >= ALL_RIGHT)).sum()), int(counts.sum())


def fewest(cloud: Cloud) -> tuple[str, int] | None:
    """Find the class of the bridge that has fewest points, of those that have surface where the flight saw the bridge.

    Args:
        cloud: A cloud of a capture with truth.

    Returns:
        Name of the class, and its points; None where nothing is known of the bridge.
    """
    kept = {
        name: int(row["kept"])
        for name, row in cloud.statistics.get("classes", {}).items()
        if row.get("windows") and name not in ("background", "unlabelled")
    }
    return min(kept.items(), key=lambda item: (item[1], item[0])) if kept else None
