"""Export of data sets for other training code: S3DIS text files, one HDF5 file per split, Parquet shards."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import canonical_json
from groundwork.errors import InputError
from groundwork.files import space_errors, write_text
from groundwork.slug import slug
from learn.datasets.draws import count_draws, exhaustive_draw
from learn.datasets.layout import DatasetFacts, PieceRow, read_facts, read_piece
from learn.datasets.patch import CHANNELS, Patch
from learn.datasets.split import SPLITS, TRAIN
from usd_schemas.components import UNLABELED

_AREAS = {"train": "Area_1", "val": "Area_2", "test": "Area_3"}  # S3DIS counts rooms in areas
_SHARD = 256  # draws in a Parquet file
_NAMES = {"train": "train", "val": "validation", "test": "test"}  # names of the splits in Hugging Face's loaders


def export_dataset(folder: Path, to: str, out: Path) -> list[str]:
    """Write a data set for other training code.

    Args:
        folder: A data set.
        to: Row of `EXPORTS`.
        out: Empty folder to fill.

    Returns:
        Files for people to open, relative to `out`.

    Raises:
        InputError: Not a data set, an unknown format, or a package that is not installed.
    """
    if to not in EXPORTS:
        raise InputError("not a format of data sets", field="--to", value=to, allowed=", ".join(EXPORTS))
    return EXPORTS[to](folder, read_facts(folder), out)


def write_s3dis(folder: Path, facts: DatasetFacts, out: Path) -> list[str]:
    """Write each piece as a room of S3DIS: all points as x y z r g b, and one file for each class.

    Training, validation and test are areas 1, 2 and 3. Underscores are removed from class names, because readers of
    S3DIS take the text before the first one as the class.

    Args:
        folder: A data set.
        facts: What its manifest says.
        out: Empty folder to fill.

    Returns:
        What to open.
    """
    names = [slug(name.replace("_", "")) for name in facts.classes]
    names = [f"{name}-{number}" if names.count(name) > 1 else name for number, name in enumerate(names)]
    for row in facts.pieces:
        inputs = [name for name in facts.inputs if name == "color"]
        patch = read_piece(folder, row, inputs, classes=len(facts.classes))
        color = patch.inputs.get("color", np.zeros((len(patch), 3), np.uint8))
        form = "%.4f %.4f %.4f %d %d %d\n"
        lines = np.array([form % (*p, *c) for p, c in zip(patch.coord.tolist(), color.tolist(), strict=True)], object)
        room = out / _AREAS[row.split] / row.name
        (room / "Annotations").mkdir(parents=True)
        write_text(room / f"{row.name}.txt", "".join(lines))
        for label in np.unique(patch.labels):
            name = "unlabelled" if label == UNLABELED else names[label]
            write_text(room / "Annotations" / f"{name}_1.txt", "".join(lines[patch.labels == label]))
    write_text(
        out / "classes.txt",
        "".join(f"{i} {a} {b}\n" for i, (a, b) in enumerate(zip(names, facts.classes, strict=True))),
    )
    return sorted({_AREAS[row.split] for row in facts.pieces})


def write_hdf5(folder: Path, facts: DatasetFacts, out: Path) -> list[str]:
    """Write every draw of a split into one file: `data` (M, points, 3 + channels), `label` (M, points), `bridge` (M).

    Args:
        folder: A data set.
        facts: What its manifest says.
        out: Empty folder to fill.

    Returns:
        What to open.

    Raises:
        InputError: The package h5py is not installed.
    """
    try:
        import h5py
    except ModuleNotFoundError:
        raise InputError("the package h5py is not installed", hint="pip install falsework[hdf5]") from None
    made = []
    for split in SPLITS:
        count = sum(row.draws for row in facts.pieces if row.split == split)
        if not count:
            continue
        channels = ("red", "green", "blue") if "color" in facts.inputs else ()
        points = facts.settings.points
        path = out / f"{split}.h5"
        with space_errors(path), h5py.File(path, "w", libver="latest") as file:  # inside an atomic folder
            file.attrs["classes"] = canonical_json(list(facts.classes))
            file.attrs["channels"] = canonical_json(["x", "y", "z", *channels])
            data = file.create_dataset("data", (count, points, 3 + len(channels)), np.float32, track_times=False)
            label = file.create_dataset("label", (count, points), np.uint8, track_times=False)
            bridges = []
            for number, (row, patch, rows) in enumerate(_draws(folder, facts, split, channels)):
                columns = [facts.scaling.apply(patch.coord[rows])]
                columns += [patch.inputs["color"][rows] / np.float32(255)] if channels else []
                data[number], label[number] = np.column_stack(columns), patch.labels[rows]
                bridges.append(row.bridge)
            names = [name.encode() for name in bridges]
            text = h5py.string_dtype("utf-8", max(64, *map(len, names)))
            file.create_dataset("bridge", data=np.array(names, text), track_times=False)
        made.append(path.name)
    return made


def write_parquet(folder: Path, facts: DatasetFacts, out: Path) -> list[str]:
    """Write every draw as a row of Parquet shards, with a card that names the splits as Hugging Face's loaders do.

    Args:
        folder: A data set.
        facts: What its manifest says.
        out: Empty folder to fill.

    Returns:
        What to open.

    Raises:
        InputError: The package pyarrow is not installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ModuleNotFoundError:
        raise InputError("the package pyarrow is not installed", hint="pip install falsework[parquet]") from None
    (out / "data").mkdir()
    entries = []
    for split in SPLITS:
        count = sum(row.draws for row in facts.pieces if row.split == split)
        shards = -(-count // _SHARD)
        draws = _draws(folder, facts, split, ("red",) if "color" in facts.inputs else ())
        for shard in range(shards):
            rows = [_parquet_row(*next(draws)) for _ in range(min(_SHARD, count - shard * _SHARD))]
            table = pa.table({name: pa.array([row[name] for row in rows], kind) for name, kind in _schema(pa, rows[0])})
            path = out / "data" / f"{_NAMES[split]}-{shard:05d}-of-{shards:05d}.parquet"
            with space_errors(path):
                pq.write_table(table, path)  # inside an atomic folder
        if shards:
            entries += [f"  - split: {_NAMES[split]}", f"    path: data/{_NAMES[split]}-*"]
    card = (folder / "README.md").read_text(encoding="utf-8")
    write_text(
        out / "README.md",
        "\n".join(["---", "configs:", "- config_name: default", "  data_files:", *entries, "---", card]),
    )
    return ["README.md", "data"]


def _schema(pa: Any, row: dict[str, Any]) -> list[tuple[str, Any]]:
    kinds = {
        "name": pa.string(),
        "bridge": pa.string(),
        "coord": pa.list_(pa.list_(pa.float32(), 3)),
        "color": pa.list_(pa.list_(pa.uint8(), 3)),
        "label": pa.list_(pa.uint8()),
        "uncertainty": pa.list_(pa.float32()),
    }
    return [(name, kinds[name]) for name in row]


def _parquet_row(row: PieceRow, patch: Patch, rows: NDArray[np.int64]) -> dict[str, Any]:
    color = {"color": list(patch.inputs["color"][rows])} if "color" in patch.inputs else {}
    return {
        "name": row.name,
        "bridge": row.bridge,
        "coord": list(patch.coord[rows]),
        **color,
        "label": patch.labels[rows],
        "uncertainty": patch.uncertainty[rows],
    }


def _draws(
    folder: Path, facts: DatasetFacts, split: str, channels: tuple[str, ...]
) -> Iterator[tuple[PieceRow, Patch, NDArray[np.int64]]]:
    """Yield the draws that visit all points of a split; those of training are not augmented either."""
    needed, points = {CHANNELS[name] for name in channels}, facts.settings.points
    inputs = [name for name in facts.inputs if name in needed]
    for row in (row for row in facts.pieces if row.split == split):
        patch = read_piece(folder, row, inputs, classes=len(facts.classes))
        # A piece that is drawn by class has one draw in an epoch, however many points it has.
        draws = count_draws(len(patch), points) if facts.settings.stratified and split == TRAIN else row.draws
        for number in range(draws):
            yield row, patch, exhaustive_draw(len(patch), points, number, patch.seed)


Export = Callable[[Path, DatasetFacts, Path], list[str]]
EXPORTS: dict[str, Export] = {"s3dis": write_s3dis, "hdf5": write_hdf5, "parquet": write_parquet}
