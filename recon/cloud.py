"""The cloud on disk: a folder of .npy columns, its observations, and `cloud.json`, which describes them."""

from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import canonical_json
from groundwork.errors import InputError, MissingError
from groundwork.files import read_json, write_bytes, write_json
from groundwork.foreign_file import check_regular
from groundwork.output.reading import reading
from recon.columns import COLUMNS, OBSERVATION_COLUMNS, OPTIONAL_COLUMNS, Column, ColumnKind
from usd_schemas.components import NOISY_POINT, ClassRow

FORMAT = "falsework.cloud"
FORMAT_VERSION = 3
# Version 1 held sparse reconstructions only, without optional columns; version 2 did not state which bridge it shows.
_READABLE = (1, 2, FORMAT_VERSION)
OBSERVATIONS = "observations"
SFM_SPARSE, SFM_DENSE = "sfm-sparse", "sfm-dense"
MESH = "mesh"
LIDAR_TERRESTRIAL, LIDAR_MOBILE, LIDAR_AIRBORNE = "lidar-terrestrial", "lidar-mobile", "lidar-airborne"
_OF_NUMPY = "Convert a number of numpy with float() or int(), and an array with tolist()"
RECONSTRUCTED = (SFM_SPARSE, SFM_DENSE)  # each of their points has at least one observation
SOURCES = (*RECONSTRUCTED, MESH, LIDAR_TERRESTRIAL, LIDAR_MOBILE, LIDAR_AIRBORNE)


@dataclass(frozen=True)
class Cloud:
    """An annotated point cloud of N points with M observations.

    Attributes:
        columns: One array per name of `COLUMNS`, and some of `OPTIONAL_COLUMNS`, shape (N,) or (N, width).
        observations: One array per name of `OBSERVATION_COLUMNS`, shape (M,) or (M, width); `start` (N + 1,).
        components: Component kinds that the numbers in the column `component` refer to; the first is empty, for none.
        classes: Class table of the cloud.
        alignment: JSON facts of the alignment: target, method, scale, rotation, translation, singular values, limits.
        cameras: One JSON row per image of the capture: name, status, center_error [m], rotation_error [deg].
        statistics: JSON figures of the whole cloud.
        source: How the points were made, one of `SOURCES`.
        bridge: Hash of the bridge's shape, the same for every cloud of one bridge; empty where it is unknown.
    """

    columns: Mapping[str, Column]
    observations: Mapping[str, Column]
    components: tuple[str, ...]
    classes: tuple[ClassRow, ...]
    alignment: Mapping[str, Any]
    cameras: tuple[Mapping[str, Any], ...]
    statistics: Mapping[str, Any]
    source: str = SFM_SPARSE
    bridge: str = ""

    def __len__(self) -> int:
        """Count the points."""
        return len(self.columns["coord"])


def segment_with_noise(cloud: Cloud, threshold: float) -> NDArray[np.uint8]:
    """Turn uncertain points into the class `noisy_point`.

    Args:
        cloud: A cloud.
        threshold: Uncertainty above which a point is noisy [m]; infinite uncertainty always is, unknown never.

    Returns:
        Class ids, shape (N,), uint8.
    """
    noisy = cloud.columns["uncertainty"] > threshold
    return np.where(noisy, NOISY_POINT, cloud.columns["segment"]).astype(np.uint8)


def write_cloud(folder: Path, cloud: Cloud) -> None:
    """Write the columns, the observations and `cloud.json`.

    Args:
        folder: An existing folder.
        cloud: What to write.

    Raises:
        InputError: A field has another type than `Cloud` states; a column is missing, unknown, not an array, or of a
            wrong shape or type; the source is unknown; or a table or figure has no form in JSON, such as NaN.
    """
    _check_fields(folder / "cloud.json", cloud)
    kinds = _kinds(cloud.columns)
    if unknown := cloud.columns.keys() - kinds.keys():
        raise InputError(
            "not a column of the format",
            field="columns",
            value=min(unknown, key=str),
            allowed=", ".join(kinds),
            hint="Store it in a separate file",
        )
    _check(folder, cloud)
    described = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "source": cloud.source,
        "bridge": cloud.bridge,
        "count": len(cloud),
        "observation_count": len(cloud.observations["image"]),
        "columns": {name: vars(kind) for name, kind in kinds.items()},
        "observations": {name: vars(kind) for name, kind in OBSERVATION_COLUMNS.items()},
        "components": cloud.components,
        "classes": tuple(vars(row) for row in cloud.classes),
        "alignment": cloud.alignment,
        "cameras": cloud.cameras,
        "statistics": cloud.statistics,
    }
    _check_described(folder / "cloud.json", described)
    (folder / OBSERVATIONS).mkdir()
    for name in kinds:
        _save(folder / f"{name}.npy", cloud.columns[name])
    for name in OBSERVATION_COLUMNS:
        _save(folder / OBSERVATIONS / f"{name}.npy", cloud.observations[name])
    write_json(folder / "cloud.json", described)


def read_cloud(folder: Path | str) -> Cloud:
    """Read a cloud and check that it is complete.

    Args:
        folder: A cloud.

    Raises:
        MissingError: Not a cloud.
        InputError: A column is missing, damaged, of a wrong type or length, or a coordinate is not finite.
    """
    with reading(Path(folder)):
        return _read_cloud(Path(folder))


def is_metric(alignment: Mapping[str, Any]) -> bool:
    """Tell whether a cloud's coordinates are in meters; nothing brought the others to scale.

    Args:
        alignment: Facts of the alignment, as in `Cloud`.
    """
    return alignment.get("target") != "none"


def cloud_unit(folder: Path) -> float | None:
    """Find the length of one unit of a cloud's coordinates; no column is loaded.

    Args:
        folder: A cloud.

    Returns:
        The length [m]: 1, or None where nothing brought the cloud to scale.

    Raises:
        MissingError: Not a cloud.
        InputError: Its description is damaged.
    """
    alignment = _read_description(folder / "cloud.json").get("alignment")
    if not isinstance(alignment, dict):
        raise InputError("a key is missing or of a wrong kind", where=folder / "cloud.json", field="alignment")
    return 1.0 if is_metric(alignment) else None


def _read_description(path: Path) -> dict[str, Any]:
    """Read `cloud.json`, and check only that it is one."""
    folder = path.parent
    if not path.is_file():
        raise MissingError("not a cloud: no cloud.json", where=folder, hint="Name the folder that holds cloud.json")
    stored = read_json(path)
    found = (stored.get("format"), stored.get("format_version")) if isinstance(stored, dict) else None
    if found not in [(FORMAT, version) for version in _READABLE]:
        raise InputError(
            "not a cloud of this version",
            where=path,
            field="format",
            value=found,
            allowed=f"{FORMAT}, version {' or '.join(map(str, _READABLE))}",
        )
    return stored


def _read_cloud(folder: Path) -> Cloud:
    path = folder / "cloud.json"
    stored = _read_description(path)
    try:
        kinds, count, observation_count = _kinds(stored["columns"]), stored["count"], stored["observation_count"]
        _want(type(count) is type(observation_count) is int, "count")
        tables = _tables(stored)
        cloud = Cloud(
            columns={name: _load(folder / f"{name}.npy") for name in kinds},
            observations={name: _load(folder / OBSERVATIONS / f"{name}.npy") for name in OBSERVATION_COLUMNS},
            source=stored.get("source", SFM_SPARSE),
            **tables,
        )
    except (KeyError, TypeError) as error:
        raise InputError(f"a key is missing or of a wrong kind: {error}", where=path) from None
    _check(folder, cloud, count, observation_count)
    return cloud


def _tables(stored: dict[str, Any]) -> dict[str, Any]:
    """Check and return what `cloud.json` holds beside the columns; a TypeError names what is wrong."""
    components, classes, cameras = stored["components"], stored["classes"], stored["cameras"]
    bridge = stored.get("bridge", "")
    _want(isinstance(components, list | tuple) and all(isinstance(name, str) for name in components), "components")
    _want(isinstance(cameras, list | tuple), "cameras")
    _want(all(isinstance(row, Mapping) and isinstance(row.get("name"), str) for row in cameras), "cameras")
    _want(isinstance(bridge, str), "bridge")
    alignment, statistics = stored["alignment"], stored["statistics"]
    _want(isinstance(alignment, Mapping), "alignment")
    _want(isinstance(statistics, Mapping), "statistics")
    return {
        "components": tuple(components),
        "classes": tuple(_class_row(row) for row in classes),
        "alignment": alignment,
        "cameras": tuple(cameras),
        "statistics": statistics,
        "bridge": bridge,
    }


def _check_fields(path: Path, cloud: Cloud) -> None:
    """Refuse a cloud of a script with a field that has another type than `Cloud` states."""
    rows = (list, tuple)
    named = isinstance(cloud.cameras, rows) and all(
        isinstance(row, Mapping) and isinstance(row.get("name"), str) for row in cloud.cameras
    )
    classes = isinstance(cloud.classes, rows) and all(isinstance(row, ClassRow) for row in cloud.classes)
    components = isinstance(cloud.components, rows) and all(isinstance(name, str) for name in cloud.components)
    for field, right, allowed in (
        ("columns", isinstance(cloud.columns, Mapping), "a dict from name to array"),
        ("observations", isinstance(cloud.observations, Mapping), "a dict from name to array"),
        ("components", components, "a tuple of names"),
        ("classes", classes, "a tuple of ClassRow(id, name, color)"),
        ("alignment", isinstance(cloud.alignment, Mapping), "a dict"),
        ("cameras", named, "a tuple of dicts, each with a name"),
        ("statistics", isinstance(cloud.statistics, Mapping), "a dict"),
        ("source", isinstance(cloud.source, str), ", ".join(SOURCES)),
        ("bridge", isinstance(cloud.bridge, str), "a str"),
    ):
        if not right:
            value = getattr(cloud, field)
            raise InputError("of a wrong kind", where=path, field=field, value=value, allowed=allowed)


def _check_described(path: Path, described: dict[str, Any]) -> None:
    """Refuse to write what no reader would accept."""
    for key, value in described.items():
        parts = (
            value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list | tuple) else ()
        )
        for name, part in (*parts, ("", value)):
            try:
                canonical_json(part)
            except (ValueError, TypeError) as error:
                field = f"{key}.{name}" if name != "" else key
                hint = None if isinstance(error, ValueError) else _OF_NUMPY
                raise InputError(f"has no form in JSON: {error}", where=path, field=field, hint=hint) from None
    try:
        _tables(described)
    except TypeError as error:
        allowed = "ids and colors from 0 to 255, printable names" if str(error) == "classes" else None
        raise InputError("of a wrong kind, or out of range", where=path, field=str(error), allowed=allowed) from None


def _want(right: bool, key: str) -> None:
    if not right:
        raise TypeError(key)


def _class_row(row: dict[str, Any]) -> ClassRow:
    _want(isinstance(row["color"], list | tuple), "classes")
    numbers = (row["id"], *row["color"])
    _want(all(type(number) is int and 0 <= number < 256 for number in numbers) and len(numbers) == 4, "classes")
    _want(isinstance(row["name"], str) and 0 < len(row["name"]) <= 200 and row["name"].isprintable(), "classes")
    return ClassRow(row["id"], row["name"], tuple(row["color"]))


def without_observations(count: int) -> dict[str, Column]:
    """Make the observations of a cloud that no camera saw.

    Args:
        count: Number of points.

    Returns:
        One empty array per name of `OBSERVATION_COLUMNS`, shape (0,) or (0, width); `start` is all zeros, shape (N +
        1,).
    """
    empty = {
        name: np.zeros((0,) if kind.width == 1 else (0, kind.width), kind.dtype)
        for name, kind in OBSERVATION_COLUMNS.items()
    }
    return {**empty, "start": np.zeros(count + 1, np.int64)}


def _kinds(present: Mapping[str, Any]) -> dict[str, ColumnKind]:
    """Return every required column, and the optional ones among `present`."""
    return {**COLUMNS, **{name: kind for name, kind in OPTIONAL_COLUMNS.items() if name in present}}


def _save(path: Path, column: Column) -> None:
    data = BytesIO()
    np.lib.format.write_array(data, column, allow_pickle=False)
    write_bytes(path, data.getvalue())


def _load(path: Path) -> Column:
    try:
        check_regular(path)
        mapped = np.load(path, mmap_mode="r", allow_pickle=False)  # a header with too large a shape allocates nothing
        if not isinstance(mapped, np.ndarray):
            raise ValueError("an archive, not an array")
        return np.array(mapped)
    except FileNotFoundError:
        raise MissingError("a column is missing", where=path, hint="Reconstruct again") from None
    except (OSError, ValueError, OverflowError, EOFError, TokenError) as error:  # the last of a header
        raise InputError(f"damaged: {error}", where=path, hint="Reconstruct again") from None


def _check(folder: Path, cloud: Cloud, count: int | None = None, observation_count: int | None = None) -> None:
    _check_arrays(folder, _kinds(cloud.columns), cloud.columns)
    _check_arrays(folder / OBSERVATIONS, OBSERVATION_COLUMNS, cloud.observations)
    is_read = count is not None
    count = len(cloud) if count is None else count
    observation_count = len(cloud.observations["image"]) if observation_count is None else observation_count
    if cloud.source not in SOURCES:
        raise InputError(
            "an unknown source",
            where=folder / "cloud.json",
            field="source",
            value=cloud.source,
            allowed=", ".join(SOURCES),
        )
    for name, kind in _kinds(cloud.columns).items():
        _check_column(folder / f"{name}.npy", cloud.columns[name], kind, count, is_read)
    for name, kind in OBSERVATION_COLUMNS.items():
        rows = count + 1 if name == "start" else observation_count
        _check_column(folder / OBSERVATIONS / f"{name}.npy", cloud.observations[name], kind, rows, is_read)
    fewest = int(cloud.source in RECONSTRUCTED)
    start, image = cloud.observations["start"], cloud.observations["image"]
    if start[0] != 0 or start[-1] != observation_count or (np.diff(start) < fewest).any():
        raise InputError(
            "must increase from 0 to the number of observations", where=folder / OBSERVATIONS / "start.npy"
        )
    if observation_count and image.max() >= len(cloud.cameras):
        raise InputError("an image that is not listed", where=folder / OBSERVATIONS / "image.npy")
    if not np.isfinite(cloud.columns["coord"]).all():
        raise InputError("a coordinate is not finite", where=folder / "coord.npy")
    if count and cloud.columns["component"].max() >= len(cloud.components):
        raise InputError("a component that is not listed", where=folder / "component.npy")


def _check_arrays(folder: Path, kinds: Mapping[str, ColumnKind], found: Mapping[str, Column]) -> None:
    for name, kind in kinds.items():
        column = found.get(name)
        if not isinstance(column, np.ndarray) or not column.ndim:
            raise InputError(
                "a column is missing" if column is None else "a column is not an array",
                where=folder / f"{name}.npy",
                field=name,
                value=None if column is None else type(column).__name__,
                allowed=f"{kind.dtype}, {kind.width} in each row [{kind.unit}]",
                hint="Fill this column too" if column is None else "Make it one with numpy.array",
            )


def _check_column(path: Path, column: Column, kind: ColumnKind, rows: int, is_read: bool) -> None:
    shape = (rows,) if kind.width == 1 else (rows, kind.width)
    if column.shape != shape or column.dtype != np.dtype(kind.dtype):
        of_script = (
            f'Convert it with astype("{kind.dtype}")' if column.shape == shape else "Give one row for each point"
        )
        if path.parent.name == OBSERVATIONS and column.shape != shape:
            of_script = "Give one row for each observation, and of start one more than there are points"
        raise InputError(
            "a column of a wrong shape or type",
            where=path,
            field=path.stem,
            value=f"{column.dtype} {column.shape}",
            allowed=f"{kind.dtype} {shape}",
            hint="Reconstruct again" if is_read else of_script,
        )
