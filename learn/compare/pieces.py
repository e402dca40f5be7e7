"""Cutting of all clouds of one bridge into the same windows, so that arms differ only in their points."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from groundwork.canonical import digest
from groundwork.errors import InputError
from groundwork.files import read_json, space_errors, write_json
from groundwork.progress import Progress
from groundwork.settings import Settings
from groundwork.slug import slug
from learn.compare.noise import noise_from_json, sensor_places, with_noise
from learn.datasets.class_tables import NOISY_CLASS, class_table
from learn.datasets.labeled_cloud import HEIGHT, PIECE_INPUTS, LabeledCloud, read_labeled
from learn.datasets.patch import CHANNELS, Patch
from learn.datasets.settings import TileSettings, WindowSettings
from learn.datasets.tiles import cut_tiles, with_heights
from learn.datasets.voxels import add_points, empty_cloud, lay_grid
from learn.datasets.windows import lay_windows
from recon.cloud import read_cloud

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FORMAT_VERSION = 1
FACTS = "windows.json"
_MOST = 65_536  # most points kept in a window: sixteen of the paper's draws


class CutSettings(Settings):
    """Settings that determine the pieces of a bridge; no other setting of an experiment changes them."""

    mode: Literal["metric", "paper", "whole"] = "metric"
    """Metric tiles, the paper's windows, or the whole cloud."""
    table: str = "kim2023"
    """Table of classes."""
    noisy: float = 0.1
    """Uncertainty above which a point is noisy [m]."""
    noisy_class: bool = False
    """Noisy points are a class."""
    inputs: tuple[str, ...] = ()
    """Columns beside the positions."""
    tile: TileSettings = Field(default_factory=TileSettings)
    """Metric tiles."""
    window: WindowSettings = Field(default_factory=WindowSettings)
    """The paper's windows."""

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes."""
        return class_table(self.table, self.noisy_class).names


@dataclass(frozen=True)
class CloudSource:
    """One of the clouds of a bridge.

    Attributes:
        name: Its name in the pieces.
        path: Its folder.
        like: Cloud of the sensor whose noise is simulated on it; None for none.
        noise: File of the noise model of that sensor, or None.
    """

    name: str
    path: Path
    like: Path | None = None
    noise: Path | None = None


@dataclass(frozen=True)
class PieceCounts:
    """Points of one cloud in each window.

    Attributes:
        all: Number of labeled points in each window, shape (W,).
        quiet: Number of points that are not noisy in each window, shape (W,).
    """

    all: tuple[int, ...]
    quiet: tuple[int, ...]


def cut_pieces(sources: Sequence[CloudSource], folder: Path, settings: CutSettings, progress: Progress) -> None:
    """Cut the clouds of a bridge into common windows, and write them.

    Args:
        sources: Its clouds; windows along the bridge are laid out over the first.
        folder: Empty folder to fill.
        settings: How.
        progress: Listener.

    Raises:
        InputError: A cloud is damaged, or there is no deck to lay windows along.
    """
    progress.stage("windows", len(sources))
    clouds: dict[str, LabeledCloud] = {}
    for number, source in enumerate(sources):
        clouds[source.name] = _read(source, settings, progress)
        progress.advance(number + 1)
    low = np.min([cloud.coord.min(axis=0) for cloud in clouds.values()], axis=0)
    high = np.max([cloud.coord.max(axis=0) for cloud in clouds.values()], axis=0)
    places, found = _windows(clouds, settings, (low, high), sources[0].path)
    base, counts = np.floor(low), {}
    for name, (cloud, rows, origins) in found.items():
        labeled = cloud.labels != 255
        quiet = labeled & ~(cloud.uncertainty > settings.noisy)
        counts[name] = {
            "all": [int(labeled[part].sum()) for part in rows],
            "quiet": [int(quiet[part].sum()) for part in rows],
        }
        arrays = {
            "coord": (cloud.coord - base).astype(np.float32),
            "labels": cloud.labels,
            "uncertainty": cloud.uncertainty,
            "rows": np.concatenate(rows).astype(np.int32),
            "origins": origins - base,
            "start": np.cumsum([0, *map(len, rows)]),
            **{key: cloud.inputs[key] for key in settings.inputs},
        }
        with space_errors(folder):
            (folder / slug(name)).mkdir()
            for key, values in arrays.items():
                np.save(folder / slug(name) / f"{key}.npy", values)  # inside an atomic folder
    write_json(
        folder / FACTS,
        {
            "format": "falsework.pieces",
            "format_version": FORMAT_VERSION,
            "windows": places,
            "counts": counts,
            "classes": settings.classes,
        },
    )


def _read(source: CloudSource, settings: CutSettings, progress: Progress) -> LabeledCloud:
    table, moving = class_table(settings.table, settings.noisy_class), source.like is not None  # rows are of the whole
    cloud = read_labeled(source.path, None, table, progress, moving)
    if source.like is not None and source.noise is not None:
        noise, seed = read_json(source.noise), digest([source.name, source.path.name])
        exact = read_cloud(source.path)
        rows, coord = with_noise(exact, noise_from_json(noise), sensor_places(source.like), int(seed[:8], 16))
        inputs = {name: values[rows] for name, values in cloud.inputs.items()}
        moved = np.linalg.norm(coord - exact.columns["coord"][rows], axis=1)  # displaced points are uncertain, too
        doubt = np.fmax(cloud.uncertainty[rows], moved.astype(np.float32))
        cloud = LabeledCloud(coord, inputs, cloud.labels[rows], doubt, cloud.base[rows])
    if not len(cloud):
        raise InputError("no point is left after cutting", where=source.path, field="arms", value=source.name)
    lacking = [name for name in settings.inputs if name not in (*cloud.inputs, HEIGHT)]
    if lacking:
        raise InputError(
            f"has no column {lacking[0]}, which a channel needs",
            where=source.path,
            field="channels",
            value=lacking[0],
            hint="Choose channels that every cloud has, such as x, y, z",
        )
    if settings.noisy_class:
        noisy = class_table(settings.table, True).index(NOISY_CLASS)
        labels = np.where(cloud.uncertainty > settings.noisy, noisy, cloud.labels).astype(np.uint8)
        cloud = LabeledCloud(cloud.coord, cloud.inputs, labels, cloud.uncertainty, cloud.base)
    return cloud


Found = dict[str, tuple[LabeledCloud, list[I64], F64]]


def _windows(
    clouds: Mapping[str, LabeledCloud], settings: CutSettings, box: tuple[F64, F64], where: Path
) -> tuple[list[list[int]], Found]:
    """Lay out the common windows of all clouds; return places, and per cloud points, rows and origins."""
    if settings.mode == "metric":
        return _tiles(clouds, settings, box)
    if settings.mode == "whole":
        middle, bottom = 0.5 * (box[0] + box[1]), box[0][2]
        origin = np.array([[middle[0], middle[1], bottom]])
        return [[0]], {name: (cloud, [np.arange(len(cloud))], origin) for name, cloud in clouds.items()}
    boxes = lay_windows(next(iter(clouds.values())), settings.window, where)
    if not boxes:
        raise InputError(
            "no window along its deck has enough points",
            where=where,
            field="mode",
            value="paper",
            hint="Use denser clouds",
        )
    origins = np.array([one.origin for one in boxes]).reshape(-1, 3)
    found = {}
    for name, cloud in clouds.items():
        rows = [_fewer(np.flatnonzero(one.holds(cloud.coord)), one.number) for one in boxes]
        found[name] = (cloud, rows, origins)
    return [[one.number] for one in boxes], found


def _tiles(
    clouds: Mapping[str, LabeledCloud], settings: CutSettings, box: tuple[F64, F64]
) -> tuple[list[list[int]], Found]:
    """Cut every cloud by one grid, each with the ground estimated from its own points, as in prediction."""
    for name, cloud in clouds.items():  # each by itself first, so that the error names the cloud with a stray point
        lay_grid(cloud.coord.min(axis=0), cloud.coord.max(axis=0), settings.tile.voxel, name)
    grid = lay_grid(box[0], box[1], settings.tile.voxel)
    thin: dict[str, LabeledCloud] = {}
    tiles: dict[str, dict[tuple[int, int], tuple[I64, F64]]] = {}
    for name, cloud in clouds.items():
        kept = {key: cloud.inputs[key] for key in settings.inputs if key != HEIGHT}
        columns = {**kept, "labels": cloud.labels, "uncertainty": cloud.uncertainty, "base": cloud.base}
        voxels = add_points(empty_cloud(grid), cloud.coord, columns)
        if HEIGHT in settings.inputs:
            voxels = with_heights(voxels, settings.tile)
        part = voxels.columns
        thin[name] = LabeledCloud(
            voxels.coord, {key: part[key] for key in settings.inputs}, part["labels"], part["uncertainty"], part["base"]
        )
        tiles[name] = {tile.place: (tile.rows, tile.origin) for tile in cut_tiles(voxels, settings.tile)}
    places = sorted({place for own in tiles.values() for place in own})
    nothing = (np.zeros(0, np.int64), np.zeros(3))
    found = {}
    for name, own in tiles.items():
        cut = [own.get(place, nothing) for place in places]
        found[name] = (thin[name], [rows for rows, _ in cut], np.array([origin for _, origin in cut]).reshape(-1, 3))
    return [list(place) for place in places], found


def _fewer(rows: I64, seed: int) -> I64:
    if len(rows) <= _MOST:
        return rows
    return np.sort(np.random.default_rng([seed, len(rows)]).choice(rows, _MOST, replace=False))


def counts_of(folder: Path) -> dict[str, PieceCounts]:
    """Count the points of each cloud in each window.

    Args:
        folder: What `cut_pieces` wrote.

    Returns:
        Name of each cloud to its counts.
    """
    record = read_json(folder / FACTS)
    return {name: PieceCounts(tuple(row["all"]), tuple(row["quiet"])) for name, row in record["counts"].items()}


def read_window(folder: Path, cloud: str, number: int, inputs: tuple[str, ...] = ()) -> Patch:
    """Read the points of one cloud in one window.

    Args:
        folder: What `cut_pieces` wrote.
        cloud: Name of the cloud.
        number: Row in the list of windows.
        inputs: Columns beside the positions.
    """
    columns = _columns(folder / slug(cloud), inputs)
    start, origins = columns["start"], columns["origins"]
    rows = np.array(columns["rows"][start[number] : start[number + 1]], np.int64)
    coord = (columns["coord"][rows].astype(np.float64) - origins[number]).astype(np.float32)
    kept = {name: np.array(columns[name][rows]) for name in inputs}
    return Patch(
        coord,
        kept,
        np.array(columns["labels"][rows]),
        np.array(columns["uncertainty"][rows]),
        np.array(origins[number]),
        number,
        rows,
    )


@lru_cache(maxsize=256)
def _columns(folder: Path, inputs: tuple[str, ...]) -> Mapping[str, NDArray[Any]]:
    names = ("coord", "labels", "uncertainty", "rows", "origins", "start", *inputs)
    return {name: np.load(folder / f"{name}.npy", mmap_mode="r", allow_pickle=False) for name in names}


def known_inputs(channels: Sequence[str]) -> Iterator[str]:
    """Name the columns that channels are made of, beside the positions.

    Args:
        channels: Names of `learn.datasets.patch.CHANNELS`.
    """
    needed = {CHANNELS[name] for name in channels if name in CHANNELS}
    yield from (name for name in PIECE_INPUTS if name in needed)
