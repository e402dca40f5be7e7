"""Pack data sets for a training on another machine, in few bytes; and unpack them there as one data set.

Usage: python -m benchmarks.shipped.pack DATASET… --out FILE [--validation NAME…] [--land NUMBER]
       python -m benchmarks.shipped.pack --unpack FILE… --out DATASET

What a training on positions needs is kept: places to the centimeter, labels, and which bridge a piece is of. Of the
pieces of a cloud that show nothing of a bridge, `--land` are kept; of the pieces for validation one in `--every`. There
`benchmarks.shipped.training` trains on it; its model, put as `model` beside the `dataset` in one folder, is what
`benchmarks.shipped.model CLOUDS… --work FOLDER` ships.
"""

import argparse
import json
import lzma
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.files import write_bytes, write_json
from learn.datasets.class_tables import is_background
from learn.datasets.layout import MANIFEST, DatasetFacts, PieceRow, manifest_record, read_facts, read_piece, write_piece
from learn.datasets.patch import Patch
from learn.datasets.split import TEST, TRAIN
from learn.sample import UNLABELED

I16 = NDArray[np.int16]
U8 = NDArray[np.uint8]

STEP = 0.01  # [m] places are kept to
CELL = 0.4  # [m] points are written cell by cell, so that the next one is near
LAND = 40  # pieces of a cloud without a bridge
EVERY = 16  # pieces for validation, one in so many


def chosen_rows(folder: Path, facts: DatasetFacts, validation: Sequence[str], land: int, every: int) -> list[PieceRow]:
    """Choose the pieces to keep.

    Args:
        folder: Data set.
        facts: Its manifest.
        validation: First digits of the bridges that an epoch is picked on.
        land: Pieces without a bridge of each cloud, evenly taken.
        every: Of the pieces for validation one in so many.
    """
    background = np.array([*np.flatnonzero(is_background(facts.classes)), UNLABELED])
    chosen, free = [], {}
    for row in facts.pieces:
        if row.split == TRAIN:
            labels = read_piece(folder, row, ()).labels
            if np.isin(labels, background).all():
                free.setdefault(row.source, []).append(row)
            else:
                chosen.append(row)
    for rows in free.values():
        chosen += rows[:: max(1, -(-len(rows) // max(land, 1)))] if land else []
    held = [row for row in facts.pieces if row.split == TEST and row.bridge.startswith(tuple(validation))]
    return chosen + (held[::every] if validation else [])


def pack(folder: Path, rows: Sequence[PieceRow]) -> dict[str, Any]:
    """Read pieces and order their points cell by cell.

    Args:
        folder: Data set.
        rows: Its pieces to keep.

    Returns:
        `places`, shape (N, 3), int16, in steps; `labels`, shape (N,), uint8; `counts`, points of each piece, shape
        (P,), int64.
    """
    places, labels = [], []
    for row in rows:
        patch = read_piece(folder, row, ())
        steps = np.rint(patch.coord / STEP)
        kept = (np.abs(steps) < np.iinfo(np.int16).max).all(axis=1)
        steps = steps[kept].astype(np.int16)
        cell = np.floor(steps * (STEP / CELL)).astype(np.int64)
        cell[:, 1] = np.where(cell[:, 0] % 2, -cell[:, 1], cell[:, 1])  # there and back, as a plough goes
        order = np.lexsort((cell[:, 2], cell[:, 1], cell[:, 0]))
        places.append(steps[order])
        labels.append(patch.labels[kept][order])
    return {
        "places": np.concatenate(places),
        "labels": np.concatenate(labels),
        "counts": np.array([len(part) for part in labels]),
    }


def write_pack(path: Path, facts: DatasetFacts, rows: Sequence[PieceRow], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write a pack.

    Args:
        path: File.
        facts: Manifest of the data set.
        rows: Its pieces that are kept.
        arrays: Of `pack`: `places`, shape (N, 3), int16; `labels`, shape (N,), uint8; `counts`, shape (P,), int64.
    """
    counts = arrays["counts"]
    kept = [replace(row, points=int(count)) for row, count in zip(rows, counts, strict=True)]
    record = json.dumps(manifest_record(replace(facts, inputs=(), pieces=tuple(kept), identified=False)))
    steps = np.diff(arrays["places"], axis=0, prepend=np.zeros((1, 3), np.int16)).astype(np.int16)
    planes = np.ascontiguousarray(steps.T).view(np.uint8).reshape(3, -1, 2)
    buffer = BytesIO()
    np.savez(
        buffer,
        record=np.frombuffer(record.encode(), np.uint8),
        low=planes[:, :, 0],
        high=planes[:, :, 1],
        labels=arrays["labels"],
    )
    write_bytes(path, lzma.compress(buffer.getvalue(), preset=6))


def read_pack(path: Path) -> Iterator[tuple[dict[str, Any], PieceRow, Patch]]:
    """Read the pieces of a pack.

    Args:
        path: File.

    Returns:
        Of each piece the manifest of its data set, its row there and itself.
    """
    with np.load(BytesIO(lzma.decompress(path.read_bytes())), allow_pickle=False) as stored:
        record = json.loads(stored["record"].tobytes())
        planes = np.stack([stored["low"], stored["high"]], axis=-1)
        labels: U8 = stored["labels"]
    steps = np.ascontiguousarray(planes).view(np.int16)[:, :, 0].T
    places: I16 = np.cumsum(steps, axis=0, dtype=np.int16)
    first = 0
    for stored_row in record["pieces"]:
        row = PieceRow(**{**stored_row, "origin": tuple(stored_row["origin"])})
        part = slice(first, first + row.points)
        first += row.points
        coord = (places[part] * np.float32(STEP)).astype(np.float32)
        unknown = np.full(row.points, np.nan, np.float32)
        yield record, row, Patch(coord, {}, labels[part], unknown, np.array(row.origin), row.seed)


def unpack(paths: Sequence[Path], folder: Path) -> None:
    """Write what packs hold as one data set.

    Args:
        paths: Packs of data sets with the same settings.
        folder: Data set to make.

    Raises:
        InputError: Packs whose tiles or classes differ.
    """
    rows: list[PieceRow] = []
    sources: list[Any] = []
    record: dict[str, Any] = {}
    for path in paths:
        first = len(sources)
        for said, row, patch in read_pack(path):
            if record and _made_as(record) != _made_as(said):
                raise InputError("a pack of other tiles or classes than the one before it", where=path)
            record = said
            name = f"{len(rows):06d}"
            rows.append(replace(row, name=name, source=first + row.source))
            write_piece(folder / row.split / name, patch)
        sources += record["sources"]
    # one pass counts: the draws of a validation would visit every point
    pieces = [vars(replace(row, draws=1)) for row in rows]
    write_json(folder / MANIFEST, {**record, "pieces": pieces, "sources": sources})


def _made_as(record: Mapping[str, Any]) -> list[Any]:
    """How tiles were cut; which bridges are held back may differ from pack to pack."""
    return [{**record["settings"], "test": []}, record["classes"], record["scaling"]]


def main() -> None:
    """Pack or unpack."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("datasets", type=Path, nargs="*")
    parser.add_argument("--unpack", type=Path, nargs="*", default=[])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--validation", nargs="+", default=[])
    parser.add_argument("--land", type=int, default=LAND)
    parser.add_argument("--every", type=int, default=EVERY)
    given = parser.parse_args()
    if given.unpack:
        unpack(given.unpack, given.out)
        return
    for folder in given.datasets:
        facts = read_facts(folder)
        rows = chosen_rows(folder, facts, given.validation, given.land, given.every)
        out = given.out if len(given.datasets) == 1 else given.out.with_stem(f"{given.out.stem}_{folder.name}")
        write_pack(out, facts, rows, pack(folder, rows))


if __name__ == "__main__":
    main()
