"""Conductor of predictions: run a model on the tiles of a scan and label every point of the scan."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError, MissingError
from groundwork.files import read_json, write_json
from groundwork.memory import available_memory
from groundwork.output.file import check_output_file, fresh_file
from groundwork.progress import SILENT, Progress
from learn.datasets.build import tile_patch
from learn.datasets.draws import count_draws, exhaustive_draw
from learn.datasets.frame import Frame, check_heights, choose_frame, contradiction
from learn.datasets.labeled_cloud import HEIGHT
from learn.datasets.patch import CHANNELS, Scaling, check_channels, make_sample
from learn.datasets.tiles import cut_tiles, with_heights
from learn.datasets.voxels import VoxelCloud, add_points, empty_cloud, lay_grid
from learn.instance_defaults import least_link
from learn.instances import Boxes, connected_parts
from learn.predict.class_sum import sum_classes
from learn.predict.model import PointModel
from learn.predict.settings import PredictSettings
from learn.predict.unit_doubts import note_spread, unit_doubts
from learn.sample import Sample
from recon.cloud import read_cloud
from recon.formats.scan import (
    Labels,
    Scan,
    ScanStream,
    check_copy,
    height_unit,
    open_scan,
    stated_unit,
    write_labeled_copy,
)

F32 = NDArray[np.float32]

_OWN_FILES = {".laz": "cloud.laz", ".las": "cloud.laz", ".ply": "cloud.ply"}  # files beside a cloud's columns
_ASPRS = "asprs"  # only this table has the codes of LAS' field `classification`
FORMAT = "falsework.instances"
BOXES = ".instances.json"
_CUBE_BYTES = 140  # for each occupied cube, beside its probabilities: of tiles or of instances, whichever is more


@dataclass(frozen=True)
class Prediction:
    """Result of a prediction.

    Attributes:
        points: Number of points.
        thinned: Points after thinning, which the model processed.
        counts: Points of each predicted class, by name.
        unlabelled: Points without a class.
        instances: Number of instances.
        doubts: Warnings that the unit may be wrong, one line each.
    """

    points: int
    thinned: int
    counts: dict[str, int]
    unlabelled: int
    instances: int
    doubts: tuple[str, ...] = ()


def predict_scan(
    source: Path, out: Path, model: PointModel, settings: PredictSettings, progress: Progress = SILENT
) -> Prediction:
    """Label every point of a scan, and write a copy of it with class, confidence and instance.

    The scan is read three times in chunks: for its bounding box, for one point in each small cube, and to copy the
    labels of the cubes to all their points. A JSON file with the instances' boxes is written beside the copy.

    Args:
        source: LAS, LAZ, PLY, E57, NPY or text file, or the folder of a cloud.
        out: File to write.
        model: What knows the classes.
        settings: Units, classes, and the distance between instances.
        progress: Listener.

    Raises:
        InputError: The scan cannot be read, states no unit, lacks a channel of the model, or needs too much memory.
    """
    file = _file_of(source, out)
    former = _check_outputs(source, out)
    check_copy(file, out)
    link, ids = _link_of(settings, model), tuple(getattr(model, "ids", ()))  # a user's own classes have own numbers
    summing = sum_classes(model.classes, model.table, settings.table, settings.classes, ids)
    with open_scan(file, progress=progress) as stream:
        told = stated_unit(source) if source.is_dir() else stream.unit
        frame = _frame_of(file, told, settings, source)
        own = _own_columns(source, model, frame, stream.count)
        cloud = thin_stream(stream, frame, model, settings.chunk, source, own)
        check_memory(len(cloud), len(summing.names), available_memory(), source)
        note_spread(cloud.coord, stream.count, frame.meters, source.name, progress)  # its tiles may take hours
        summed = vote(cloud, model, settings.batch, progress, summing.matrix)
        classes, sure = summing.decide(summed, settings.min_confidence)
        instance = connected_parts(cloud.coord, classes, link, settings.fewest, summing.background)
        boxes, counts = Boxes(int(instance.max(initial=0))), np.zeros(256, np.int64)

        def labels() -> Iterator[Labels]:
            progress.stage("write", stream.count)
            done = 0
            for scan in stream.chunks(settings.chunk):
                rows = cloud.find(frame.apply(scan.coord))
                part = Labels(classes[rows], sure[rows], instance[rows].astype(np.uint32))
                boxes.add(scan.coord, instance[rows], part.classes, part.confidence)
                np.add(counts, np.bincount(part.classes, minlength=256), out=counts)
                done += len(scan)
                progress.advance(done)
                yield part

        names = {int(i): name for i, name in zip(summing.ids, summing.names, strict=True)}
        with _copy_and_boxes(source, out, former) as (copy, record):
            write_labeled_copy(file, stream, copy, labels, settings.chunk, summing.table == _ASPRS)
            found = boxes.rows(names, frame.meters)
            record |= {
                "table": summing.table,
                "meters_per_unit": frame.meters,
                "instances": found,
                "classes": {str(i): name for i, name in names.items()},
            }
        given = {name: int(counts[i]) for i, name in names.items() if counts[i]}
    doubts = unit_doubts(contradiction(told, frame), len(cloud), stream.count)
    return Prediction(stream.count, len(cloud), given, int(counts[255]), len(found), doubts)


def _check_outputs(source: Path, out: Path) -> dict[str, Any]:
    """Refuse to overwrite files that are not from an earlier prediction of this name; return its record of boxes."""
    former = _boxes_record(out.with_suffix(BOXES))
    _refuse_boxes_of_another(former, out)
    check_output_file(out.with_suffix(BOXES), [source], lambda path: bool(former))
    check_output_file(out, [source], lambda path: _is_former(former, path))
    return former


def _link_of(settings: PredictSettings, model: PointModel) -> float:
    if settings.link is None:
        return least_link(model.tile.voxel)
    if settings.link < model.tile.voxel:
        raise InputError(
            "is smaller than the model's voxel",
            field="--link",
            value=settings.link,
            allowed=f"at least {model.tile.voxel:g} m",
        )
    return settings.link


@contextmanager
def _copy_and_boxes(source: Path, out: Path, former: dict[str, Any]) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield a temporary name for the copy and a record to fill, and put both into place afterwards.

    The boxes are put first, with the sizes of both copies, the new and the former one, so that after a kill in between
    the next command still recognizes both files as ours.
    """
    record: dict[str, Any] = {"format": FORMAT, "format_version": 1}
    with fresh_file(out, [source], lambda path: _is_former(former, path)) as copy:
        yield copy, record
        record["copy"] = _size_of(copy, out)
        replaced = {"replaces": _size_of(out, out)} if out.exists() else {}
        write_json(out.with_suffix(BOXES), {**record, **replaced})
    if replaced:
        write_json(out.with_suffix(BOXES), record)


def _boxes_record(boxes_file: Path) -> dict[str, Any]:
    """Read an existing file of boxes; empty if Falsework did not write it."""
    try:
        record = read_json(boxes_file)
    except InputError:
        return {}
    return record if isinstance(record, dict) and record.get("format") == FORMAT else {}


def _refuse_boxes_of_another(record: dict[str, Any], out: Path) -> None:
    """Refuse boxes of a copy in another format: their file name is that of the copy without its suffix."""
    other = out.with_suffix(str((record.get("copy") or {}).get("suffix") or out.suffix))
    if other.suffix != out.suffix and other.exists():
        raise InputError(
            f"belongs to {other.name}",
            where=out.with_suffix(BOXES),
            hint="Choose a name for the copy that does not differ in its suffix alone",
        )


def _is_former(record: dict[str, Any], copy: Path) -> bool:
    """Tell whether the boxes beside a copy belong to it; its format may lack room for a signature."""
    return _size_of(copy, copy) in (record.get("copy"), record.get("replaces"))


def _size_of(copy: Path, name: Path) -> dict[str, object]:
    return {"suffix": name.suffix, "bytes": copy.stat().st_size}


def _frame_of(file: Path, unit: float | None, settings: PredictSettings, source: Path) -> Frame:
    check_heights(unit, height_unit(file), settings, source)
    return choose_frame(unit, settings, source)


def _own_columns(source: Path, model: PointModel, frame: Frame, count: int) -> dict[str, NDArray[Any]]:
    """Read the inputs of a model that the LAZ and PLY files of a cloud of ours lack, but its columns have."""
    needed = {"normal", "n_views"} & {CHANNELS[name] for name in model.channels}
    if not needed or not source.is_dir():
        return {}
    cloud = read_cloud(source)
    if len(cloud) != count:
        raise InputError(
            "its columns and its file have different numbers of points",
            where=source,
            value=count,
            allowed=str(len(cloud)),
            hint=f"Make the file again with falsework export {source} --to laz -o DIR",
        )
    found = {name: cloud.columns[name] for name in sorted(needed) if cloud.columns[name].any()}  # zeros: not known
    return {name: frame.rotate(rows) if name == "normal" else rows for name, rows in found.items()}


def thin_stream(
    stream: ScanStream,
    frame: Frame,
    model: PointModel,
    chunk: int,
    where: object,
    own: Mapping[str, NDArray[Any]] = MappingProxyType({}),
) -> VoxelCloud:
    """Keep one point in each cube of a scan: the first of the file, independent of the chunk size.

    Args:
        stream: The scan.
        frame: Conversion of its coordinates to meters.
        model: Determines the columns and the size of the cubes.
        chunk: Points at a time.
        where: Scan, for the error.
        own: Further columns of its points, shape (N,) or (N, C) each.

    Raises:
        InputError: The scan lacks a channel of the model, or is too large.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for scan in stream.chunks(chunk):
        coord = frame.apply(scan.coord)
        low, high = np.minimum(low, coord.min(axis=0)), np.maximum(high, coord.max(axis=0))
    cloud = empty_cloud(lay_grid(low, high, model.tile.voxel, where))
    first = 0
    for scan in stream.chunks(chunk):
        columns = {**_inputs(scan, frame), **{name: column[first : first + len(scan)] for name, column in own.items()}}
        first += len(scan)
        check_channels(model.channels, (*columns, HEIGHT), where)
        needed = {CHANNELS[name] for name in model.channels}
        kept = {name: values for name, values in columns.items() if name in needed}
        cloud = add_points(cloud, frame.apply(scan.coord), kept)
    return cloud


def memory_needed(cubes: int, classes: int) -> float:
    """Forecast the memory that votes and instances take beside the thinned points and the model [GB].

    Args:
        cubes: Occupied cubes.
        classes: Classes of the file.
    """
    return cubes * (4 * classes + _CUBE_BYTES) / 1e9


def check_memory(cubes: int, classes: int, available: float, where: object) -> None:
    """Refuse a scan before the work if its votes and instances do not fit into memory.

    Args:
        cubes: Occupied cubes.
        classes: Classes of the file.
        available: Memory that this process can still use [GB].
        where: Scan, for the error.

    Raises:
        InputError: They do not fit.
    """
    needed = memory_needed(cubes, classes)
    if needed > available:
        raise InputError(
            f"after thinning, its {cubes:,} points and {classes} classes need {needed:.1f} GB of memory",
            where=where,
            allowed=f"{available:.1f} GB, which are available",
            hint="Cut the scan into parts, check its unit, or close other programs",
        )


def vote(
    cloud: VoxelCloud, model: PointModel, batch: int, progress: Progress = SILENT, matrix: F32 | None = None
) -> F32:
    """Predict draws of every tile until all points are drawn, and average the probabilities of each point.

    Args:
        cloud: Thinned points.
        model: What knows the classes.
        batch: Samples per call of the model.
        progress: Listener.
        matrix: Mapping of the model's classes to others [1], shape (K, T), float32; their sums need less memory where
            these are fewer. None keeps the model's classes, and T is K.

    Returns:
        Probabilities [1], shape (V, T), float32.
    """
    if HEIGHT in model.channels:
        cloud = with_heights(cloud, model.tile)
    total = np.zeros((len(cloud), len(model.classes) if matrix is None else matrix.shape[1]), np.float32)
    seen = np.zeros(len(cloud), np.float32)
    overlap = round(model.tile.size / model.tile.stride) ** 2  # number of tiles that hold each point
    progress.stage("predict", overlap * len(cloud))
    done = 0
    waiting: list[tuple[NDArray[np.int64], Sample]] = []

    def ask() -> None:
        for (rows, _), told in zip(waiting, model.probabilities([sample for _, sample in waiting]), strict=True):
            if told.shape != (len(rows), len(model.classes)):
                raise InputError(
                    "the model returned an array of a wrong shape",
                    field="probabilities",
                    value=told.shape,
                    allowed=str((len(rows), len(model.classes))),
                )
            np.add.at(total, rows, told if matrix is None else told @ matrix)
            np.add.at(seen, rows, np.float32(1.0))
        waiting.clear()

    for tile in cut_tiles(cloud, model.tile):
        for rows, sample in tile_samples(cloud, tile.rows, tile.origin, tile.seed, model):
            waiting.append((rows, sample))
            if len(waiting) == batch:
                ask()
        done += len(tile.rows)
        progress.advance(done)
    if waiting:
        ask()
    total /= seen[:, None]
    return total


def tile_samples(
    cloud: VoxelCloud, rows: NDArray[np.int64], origin: NDArray[np.float64], seed: int, model: PointModel
) -> Iterator[tuple[NDArray[np.int64], Sample]]:
    """Yield draws of a tile until all points are drawn, as for the samples of a test split.

    Args:
        cloud: Thinned points.
        rows: Points of the tile, shape (N,), int64.
        origin: Origin of its positions [m], shape (3,), float64.
        seed: Seed of its draws.
        model: Channels, size of a draw, and scale.

    Yields:
        Rows of the points in the thinned cloud, shape (points,), int64, and the sample.
    """
    patch = tile_patch(cloud.coord, cloud.columns, rows, origin, seed)
    for number in range(count_draws(len(patch), model.points)):
        drawn = exhaustive_draw(len(patch), model.points, number, seed)
        yield rows[drawn], make_sample(patch, drawn, model.channels, Scaling("constant", model.tile.scale))


def _inputs(scan: Scan, frame: Frame) -> dict[str, NDArray[Any]]:
    found: dict[str, NDArray[Any]] = {}
    if scan.color is not None:
        found["color"] = scan.color
    if scan.normal is not None:
        found["normal"] = frame.rotate(scan.normal)
    return found


def _file_of(source: Path, out: Path) -> Path:
    """Return the file to copy: a cloud's folder holds its points as LAZ and PLY too."""
    if not source.is_dir():
        return source
    if not (source / "cloud.json").is_file():
        raise InputError("not a cloud: no cloud.json", where=source, hint="Name a scan, or the folder of a cloud")
    name = _OWN_FILES.get(out.suffix.lower())
    if name is None:
        raise InputError(
            "a cloud can be copied as LAZ, LAS or PLY",
            where=out,
            field="-o",
            value=out.suffix,
            allowed=", ".join(_OWN_FILES),
        )
    if not (source / name).is_file():
        hint = f"Make it with falsework export {source} --to {Path(name).suffix[1:]} -o DIR, and label that file"
        raise MissingError(f"this cloud has no {name} to copy", where=source, hint=hint)
    return source / name
