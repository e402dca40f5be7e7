"""How a model labels scans whose classes are known: a scan may be changed first, as scans of others differ."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from learn.datasets.class_tables import class_table, labels_of_cloud
from learn.datasets.frame import choose_frame
from learn.datasets.voxels import VoxelCloud, add_points, empty_cloud, lay_grid
from learn.metrics import confusion, scores
from learn.predict.class_sum import sum_classes
from learn.predict.model import PointModel
from learn.predict.predict import vote
from learn.predict.settings import PredictSettings
from recon.cloud import read_cloud

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

TABLES = ("falsework", "kim2023")


def mean_iou_of_seen(matrix: I64) -> float:
    """Give the mean IoU over the classes that the scan has.

    A class that is called and is not there counts against those whose points it took, and not as a class of its own:
    three such points among 100,000 would halve the mean of a scan with two classes.

    Args:
        matrix: True classes down, predicted ones across, shape (C, C), int64.

    Returns:
        Mean IoU [1]; NaN where no class has points.
    """
    found = scores(matrix)
    seen = found.iou[found.support > 0]
    return float(seen.mean()) if len(seen) else float("nan")


@dataclass(frozen=True, eq=False)
class Scan:
    """A scan and its truth.

    Attributes:
        coord: Positions in the unit and frame of the scan, shape (N, 3), float64.
        place: The same points in meters with z up, where they were before any change, shape (N, 3), float64.
        labels: True classes in each of `TABLES`, 255 where unknown, shape (N,), uint8.
        settings: Its settings.
    """

    coord: F64
    place: F64
    labels: Mapping[str, U8]
    settings: PredictSettings

    def take(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> "Scan":
        """Keep some points.

        Args:
            rows: Which ones, shape (M,), or shape (N,), bool.
        """
        labels = {table: values[rows] for table, values in self.labels.items()}
        return Scan(self.coord[rows], self.place[rows], labels, self.settings)


@dataclass(frozen=True, eq=False)
class Labeled:
    """A model's predictions for the thinned points of a scan.

    Attributes:
        place: Where they were before any change [m], shape (V, 3), float64.
        truth: True labels in each table, shape (V,), int64.
        found: Labels that the model gives, shape (V,), int64.
        cube: For each point of the scan the thinned point whose label it gets, shape (N,), int64.
    """

    place: F64
    truth: Mapping[str, I64]
    found: Mapping[str, I64]
    cube: I64

    def matrix(self, table: str) -> I64:
        """Count how often each class was taken for each.

        Args:
            table: Classes.

        Returns:
            Shape (C, C), int64.
        """
        return confusion(self.truth[table], self.found[table], len(class_table(table).names))


def read_labeled_scan(folder: Path) -> Scan:
    """Read a cloud of ours as a scan whose unit is known.

    Args:
        folder: A cloud.
    """
    cloud = read_cloud(folder)
    labels = {table: labels_of_cloud(cloud, class_table(table)) for table in TABLES}
    coord = cloud.columns["coord"]
    return Scan(coord, coord, labels, PredictSettings(unit="m"))


def label_scan(scan: Scan, model: PointModel) -> Labeled:
    """Label a scan as `falsework predict` does.

    Args:
        scan: The scan.
        model: What knows the classes.
    """
    frame = choose_frame(None, scan.settings, "scan")
    coord = frame.apply(scan.coord)
    columns = {"place": scan.place, **{table: values for table, values in scan.labels.items()}}
    grid = lay_grid(coord.min(axis=0), coord.max(axis=0), model.tile.voxel)
    thinned: VoxelCloud = add_points(empty_cloud(grid), coord, columns)
    told = vote(VoxelCloud(thinned.grid, thinned.keys, thinned.coord, {}), model, scan.settings.batch)
    found = {}
    for table in TABLES:
        summing = sum_classes(model.classes, model.table, table, ())
        names = class_table(table).names
        order = np.array([summing.names.index(name) for name in names])
        found[table] = (told @ summing.matrix[:, order]).argmax(axis=1)
    truth = {table: thinned.columns[table].astype(np.int64) for table in TABLES}
    return Labeled(thinned.columns["place"], truth, found, thinned.find(coord))
