"""Our clouds and scans from elsewhere in one format: positions, allowed inputs, labels, and the bridge's name."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import digest, file_digest
from groundwork.errors import InputError, MissingError
from groundwork.files import read_json
from groundwork.progress import SILENT, Progress
from learn.datasets.class_map import CLASSIFICATION, SEGMENT, ClassMap
from learn.datasets.class_tables import ClassTable, class_table, labels_of_cloud
from learn.datasets.frame import Frame, check_heights, choose_frame, contradiction
from learn.datasets.scan_units import AS_STATED, ScanUnits
from recon.cloud import Cloud, read_cloud
from recon.formats.scan import height_unit, read_scan, stated_unit
from usd_schemas.components import UNLABELED

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

INPUTS = ("color", "normal", "n_views")  # all inputs that a network may have, beside coord
HEIGHT = "height"  # computed from coord: see learn.datasets.tiles
PIECE_INPUTS = (*INPUTS, HEIGHT)
# Columns of a cloud that a data set depends on.
_READ = ("coord", *INPUTS, "segment", "component", "uncertainty", "instance")
_MARKS = "surface_distance"  # NaN on moving objects: read only if the cloud says that anything moved
_DECK = ("deck", "slab", "sleeper", "track", "parapet")  # classes of the base table that span the deck's width


@dataclass(frozen=True)
class SourceFacts:
    """Facts of a source, known before its points are read.

    Attributes:
        name: Its name, without its folder.
        bridge: Hash that all clouds of one bridge share.
        digest: SHA-256 of everything that the data set depends on.
        kind: How its points were made, or `scan`.
        evaluate_only: Whether it must not be used for training.
        licence: Terms, as its class map states them.
        test: Whether its publishers reserve it for the test.
        seed: Seed of its scene; None where it is unknown.
        look: Hash of the files of its scene's looks; empty where it is unknown.
    """

    name: str
    bridge: str
    digest: str
    kind: str
    evaluate_only: bool = False
    licence: str = ""
    test: bool = False
    seed: int | None = None
    look: str = ""


@dataclass(frozen=True, eq=False)
class LabeledCloud:
    """Points with the inputs of a network and the true labels.

    Attributes:
        coord: Positions [m], shape (N, 3), float64.
        inputs: Those of `INPUTS` that the source has, shape (N,) or (N, 3) each.
        labels: Index of each point's class in the table, 255 where unknown, shape (N,), uint8.
        uncertainty: Uncertainty of each point, NaN where unknown [m], shape (N,), float32; never an input.
        base: Label of each point in the base table, 255 where unknown, shape (N,), uint8.
        instance: Instance of each point, 0 for none, shape (N,), int64; None where the source knows none; never an
            input.
    """

    coord: F64
    inputs: Mapping[str, NDArray[Any]]
    labels: U8
    uncertainty: NDArray[np.float32]
    base: U8
    instance: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        """Count the points."""
        return len(self.coord)

    @property
    def deck(self) -> NDArray[np.bool_]:
        """Tell whether each point is on the deck, shape (N,), bool."""
        table = class_table("falsework")
        return np.isin(self.base, [table.index(name) for name in _DECK])

    @property
    def bridge(self) -> NDArray[np.bool_]:
        """Tell whether each point is on the bridge, shape (N,), bool."""
        return (self.base != class_table("falsework").index("background")) & (self.base != UNLABELED)


def identify(path: Path, class_map: ClassMap | None, bridge: str = "", units: ScanUnits = AS_STATED) -> SourceFacts:
    """Find the bridge of a source, and hash what the data set takes from it.

    Args:
        path: Folder of a cloud, or file of a scan.
        class_map: What the numbers of a scan mean.
        bridge: Name of the bridge, where the source cannot know it.
        units: Unit and up axis of a scan.

    Raises:
        MissingError: There is no such source.
        InputError: A scan without a class map, or a cloud that does not say which bridge it shows.
    """
    if path.is_dir():
        stored = read_json(path / "cloud.json") if (path / "cloud.json").is_file() else None
        if not isinstance(stored, dict):
            raise MissingError("not a cloud: no cloud.json", where=path, hint="Name the folder that holds cloud.json")
        found = bridge or stored.get("bridge", "")
        if not isinstance(found, str) or not found:
            raise InputError(
                "does not state its bridge, so no bridge can be held out for the test",
                where=path,
                field="bridge",
                hint="Make the cloud again, or name it with --bridge",
            )
        statistics = stored.get("statistics")
        moved = isinstance(statistics, dict) and bool(statistics.get("moving_points"))
        read = (*_READ, _MARKS) if moved else _READ
        parts = {name: file_digest(path / f"{name}.npy") for name in read if (path / f"{name}.npy").is_file()}
        facts = {key: stored.get(key) for key in ("classes", "components", "source")}
        return SourceFacts(cloud_name(path), found, digest([parts, facts]), str(stored.get("source", "")))
    if not path.is_file():
        raise MissingError("no such file", where=path, hint="Name the folder of a cloud, or a scan")
    if class_map is None:
        raise InputError(
            "a scan of another program needs a class map",
            where=path,
            field="--class-map",
            hint="Name a map of the package, or a .toml file of your own",
        )
    whole = file_digest(path)
    number = (re.findall(r"\d+", path.stem) or [""])[-1].lstrip("0")
    return SourceFacts(
        path.name,
        bridge or whole,
        whole if units == AS_STATED else digest([whole, units]),
        "scan",
        class_map.facts.use == "evaluate",
        class_map.facts.licence,
        number in class_map.facts.test,
    )


def cloud_name(folder: Path) -> str:
    """Name a cloud: one of a run by scene and cloud, because their folders have the same names; others by their folder.

    Args:
        folder: Folder of a cloud.
    """
    return f"{folder.parent.parent.name}/{folder.name}" if folder.parent.name == "cloud" else folder.name


def read_labeled(
    path: Path,
    class_map: ClassMap | None,
    table: ClassTable,
    progress: Progress = SILENT,
    moving: bool = False,
    units: ScanUnits = AS_STATED,
) -> LabeledCloud:
    """Read a source and convert its labels to those of a data set, and the coordinates of a scan to meters, z up.

    Args:
        path: Folder of a cloud, or file of a scan.
        class_map: What the numbers of a scan mean; None for a cloud of ours.
        table: Classes of the data set.
        progress: Listener for warnings.
        moving: Keep the points of objects that moved while the photographs were taken.
        units: Unit and up axis of a scan.

    Raises:
        MissingError: There is no such source.
        InputError: It is damaged, has no labels, or its coordinates are angles.
    """
    base = class_table("falsework")
    if path.is_dir():
        cloud = read_cloud(path)
        inputs = {name: cloud.columns[name] for name in INPUTS if _known(cloud, name)}
        found = LabeledCloud(
            cloud.columns["coord"],
            inputs,
            labels_of_cloud(cloud, table),
            cloud.columns["uncertainty"],
            labels_of_cloud(cloud, base),
            cloud.columns["instance"].astype(np.int64),
        )
        return found if moving else _still(found, cloud, progress)
    assert class_map is not None
    return _read_labeled_scan(path, class_map, table, progress, units)


def _read_labeled_scan(
    path: Path, class_map: ClassMap, table: ClassTable, progress: Progress, units: ScanUnits
) -> LabeledCloud:
    frame = _frame_of(path, units, progress)
    column = class_map.facts.column
    scan = read_scan(path, progress=progress, labels=True if column in (SEGMENT, CLASSIFICATION) else column)
    codes = scan.classification if column == CLASSIFICATION else scan.segment
    if codes is None:
        raise InputError(
            "has no column of labels",
            where=path,
            field=column,
            hint="Name another class map, or write the column into the file",
        )
    unknown = sorted({int(code) for code in np.unique(codes)} - {*class_map.codes, UNLABELED})
    if unknown:
        progress.note(
            f"{path.name}: class numbers that are not in the class map {class_map.name} are read as "
            f"unlabelled: {unknown}"
        )
    normal = None if scan.normal is None else frame.rotate(scan.normal)
    inputs = {name: values for name, values in (("color", scan.color), ("normal", normal)) if values is not None}
    nothing = np.full(len(scan), np.nan, np.float32)
    instance = None if scan.instance is None else scan.instance.astype(np.int64)
    return LabeledCloud(
        frame.apply(scan.coord),
        inputs,
        class_map.labels(codes, table),
        nothing,
        class_map.labels(codes, class_table("falsework")),
        instance,
    )


def _frame_of(path: Path, units: ScanUnits, progress: Progress) -> Frame:
    """Choose the frame of a scan as in a prediction, but for a scan without a unit: it is read in meters."""
    said = stated_unit(path)
    check_heights(said, height_unit(path), units, path)
    if said is None and units.unit is None and units.scale is None:
        progress.note(f"{path.name} does not state the unit of its coordinates: meters are assumed; else give --unit")
        said = 1.0
    frame = choose_frame(said, units, path)
    if doubt := contradiction(said, frame):
        progress.note(f"{path.name}: {doubt}")
    return frame


def _still(found: LabeledCloud, cloud: Cloud, progress: Progress) -> LabeledCloud:
    """Leave out the points of moving objects: they have an uncertainty but no distance to a surface."""
    gone = np.isnan(cloud.columns[_MARKS]) & ~np.isnan(found.uncertainty)
    if not gone.any():
        return found
    progress.note(f"{int(gone.sum())} points of moving objects are left out")
    inputs = {name: values[~gone] for name, values in found.inputs.items()}
    instance = None if found.instance is None else found.instance[~gone]
    return LabeledCloud(
        found.coord[~gone], inputs, found.labels[~gone], found.uncertainty[~gone], found.base[~gone], instance
    )


def _known(cloud: Cloud, name: str) -> bool:
    """Tell whether a column is usable as input; one of zeros is not: sampled clouds may have no views."""
    return bool(cloud.columns[name].any())
