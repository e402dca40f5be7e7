"""The format of a data set on disk: Pointcept's folders of arrays, and the manifest `dataset.json`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError, MissingError
from groundwork.files import read_json, space_errors
from groundwork.foreign_file import check_regular
from groundwork.settings import parse_settings
from learn.datasets.labeled_cloud import PIECE_INPUTS
from learn.datasets.patch import Patch, Scaling
from learn.datasets.settings import DatasetSettings
from usd_schemas.components import UNLABELED

FORMAT = "falsework.dataset"
FORMAT_VERSION = 2
_READABLE = (1, 2)  # version 1 has no `height`, `row` and `instance`; it can still be used for training
MANIFEST = "dataset.json"
_IGNORED = -1  # Pointcept's label for points that are excluded from the loss
_KINDS = {
    "coord": ("float32", 3),
    "color": ("uint8", 3),
    "normal": ("float32", 3),
    "n_views": ("uint16", 1),
    "height": ("float32", 1),
    "segment": ("int32", 1),
    "uncertainty": ("float32", 1),
    "row": ("int32", 1),
    "instance": ("int32", 1),
}


@dataclass(frozen=True)
class PieceRow:
    """One piece in the manifest.

    Attributes:
        name: Its folder, relative to that of its split.
        split: train, val or test.
        bridge: Hash of its bridge.
        source: Row in the list of sources.
        points: Number of its points.
        draws: Number of draws that visit all points.
        seed: Seed of these draws.
        origin: Origin of its positions [m].
    """

    name: str
    split: str
    bridge: str
    source: int
    points: int
    draws: int
    seed: int
    origin: tuple[float, float, float]


@dataclass(frozen=True)
class DatasetFacts:
    """The manifest of a data set.

    Attributes:
        settings: Settings that it was made with.
        classes: Class names in the order of the labels.
        inputs: Columns of every piece beside its positions.
        scaling: How positions are scaled for a network.
        pieces: All pieces, in the order in which they were cut.
        sources: JSON facts of each source.
        identified: Whether pieces hold the row of each point in its cloud.
    """

    settings: DatasetSettings
    classes: tuple[str, ...]
    inputs: tuple[str, ...]
    scaling: Scaling
    pieces: tuple[PieceRow, ...]
    sources: tuple[Mapping[str, Any], ...]
    identified: bool = True


def write_piece(folder: Path, patch: Patch) -> None:
    """Write the arrays of one piece.

    Args:
        folder: Folder to make, inside one that the caller writes atomically.
        patch: The piece.

    Raises:
        InputError: An instance id is too large for int32.
    """
    segment = patch.labels.astype(np.int32)
    arrays = {
        "coord": patch.coord,
        **patch.inputs,
        "uncertainty": patch.uncertainty,
        "segment": np.where(segment == UNLABELED, _IGNORED, segment),
    }
    if patch.row is not None and patch.instance is not None:
        if patch.instance.max(initial=0) > np.iinfo(np.int32).max:
            raise InputError(
                "an instance id is too large for int32",
                field="instance",
                value=int(patch.instance.max()),
                allowed=f"up to {np.iinfo(np.int32).max}",
                hint="Give the instances of the source smaller ids",
            )
        arrays |= {"row": patch.row, "instance": np.where(patch.instance > 0, patch.instance, _IGNORED)}
    folder.mkdir(parents=True)
    with space_errors(folder):
        for name, values in arrays.items():
            np.save(folder / f"{name}.npy", values.astype(_KINDS[name][0]))  # inside an atomic folder


def read_piece(
    folder: Path, row: PieceRow, inputs: Sequence[str], *, classes: int = UNLABELED, identified: bool = False
) -> Patch:
    """Read the arrays of one piece.

    Args:
        folder: Root of the data set.
        row: Which piece.
        inputs: Columns to read beside positions, labels and uncertainty.
        classes: Number of classes of the data set; a larger label is refused.
        identified: Whether to read rows and instances too.

    Raises:
        InputError: A column is missing, damaged, or of a wrong length or type, or holds an invalid class id.
    """
    place = folder / row.split / row.name
    columns = {
        name: _column(place / f"{name}.npy", name, row.points)
        for name in ("coord", "segment", "uncertainty", *inputs, *(("row", "instance") if identified else ()))
    }
    segment = columns["segment"]
    wrong = segment[(segment < _IGNORED) | (segment >= classes)]
    if len(wrong):
        raise InputError(
            "not a class id",
            where=place / "segment.npy",
            value=int(wrong[0]),
            allowed=f"{_IGNORED} to {classes - 1}",
            hint="Make the data set again",
        )
    labels = np.where(segment == _IGNORED, UNLABELED, segment).astype(np.uint8)
    return Patch(
        columns["coord"],
        {name: columns[name] for name in inputs},
        labels,
        columns["uncertainty"],
        np.array(row.origin),
        row.seed,
        *_identity(columns),
    )


def _identity(columns: Mapping[str, NDArray[Any]]) -> tuple[NDArray[np.int64] | None, NDArray[np.int64] | None]:
    if "row" not in columns:
        return None, None
    return columns["row"].astype(np.int64), np.maximum(columns["instance"], 0).astype(np.int64)


def _column(path: Path, name: str, count: int) -> NDArray[Any]:
    dtype, width = _KINDS[name]
    shape = (count,) if width == 1 else (count, width)
    try:
        check_regular(path)
        mapped = np.load(path, mmap_mode="r", allow_pickle=False)
    except MissingError:
        raise MissingError("a column is missing", where=path, hint="Make the data set again") from None
    except (OSError, ValueError, OverflowError, EOFError, TokenError) as error:  # the last of a header
        raise InputError(f"damaged: {error}", where=path, hint="Make the data set again") from None
    if not isinstance(mapped, np.ndarray) or mapped.shape != shape or mapped.dtype != np.dtype(dtype):
        raise InputError(
            "a column of a wrong shape or type", where=path, allowed=f"{dtype} {shape}", hint="Make the data set again"
        )
    return np.array(mapped)


def manifest_record(facts: DatasetFacts) -> dict[str, Any]:
    """Convert the manifest to JSON.

    Args:
        facts: The manifest.
    """
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "settings": facts.settings.model_dump(mode="json"),
        "classes": list(facts.classes),
        "inputs": list(facts.inputs),
        "scaling": vars(facts.scaling),
        "pieces": [vars(row) for row in facts.pieces],
        "sources": [dict(source) for source in facts.sources],
    }


def read_facts(folder: Path) -> DatasetFacts:
    """Read the manifest of a data set and check it.

    Args:
        folder: Root of a data set.

    Raises:
        MissingError: Not a data set.
        InputError: Of another version, or a key is missing or of a wrong kind.
    """
    path = folder / MANIFEST
    if not path.is_file():
        raise MissingError(f"not a data set: no {MANIFEST}", where=folder, hint="Name a folder of falsework dataset")
    stored = read_json(path)
    found = (stored.get("format"), stored.get("format_version")) if isinstance(stored, dict) else None
    if not isinstance(stored, dict) or found not in [(FORMAT, version) for version in _READABLE]:
        raise InputError(
            "not a data set of this version",
            where=path,
            field="format",
            value=found,
            allowed=f"{FORMAT}, versions {_READABLE[0]} to {_READABLE[-1]}",
        )
    try:
        facts = DatasetFacts(
            parse_settings(DatasetSettings, stored["settings"], path),
            tuple(stored["classes"]),
            tuple(stored["inputs"]),
            Scaling(**stored["scaling"]),
            tuple(_row(path, row) for row in stored["pieces"]),
            tuple(stored["sources"]),
            stored["format_version"] > 1,
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"a key is missing or of a wrong kind: {error}", where=path) from None
    if not set(facts.inputs) <= set(PIECE_INPUTS) or not all(isinstance(name, str) for name in facts.classes):
        raise InputError(
            "invalid inputs or classes",
            where=path,
            field="inputs",
            value=facts.inputs,
            allowed=", ".join(PIECE_INPUTS),
        )
    return facts


def _row(path: Path, stored: Mapping[str, Any]) -> PieceRow:
    row = PieceRow(**{**stored, "origin": tuple(stored["origin"])})
    numbers = (row.points, row.draws, row.seed, row.source)
    if not all(type(number) is int and number >= 0 for number in numbers) or row.points < 1 or row.draws < 1:
        raise InputError("invalid piece", where=path, field="pieces", value=row.name)
    for name in (row.name, row.split):
        if not isinstance(name, str) or Path(name).name != name or name in ("", ".", ".."):
            raise InputError("a name that leads out of the data set", where=path, field="pieces", value=name)
    return row
