"""The conductor: from clouds to a data set, one source at a time."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.files import write_manifest, write_text
from groundwork.progress import SILENT, Progress
from learn.datasets.card import card_text
from learn.datasets.class_map import ClassMap
from learn.datasets.class_tables import NOISY_CLASS, OWN, ClassTable, class_table, own_table
from learn.datasets.draws import count_draws, random_draw
from learn.datasets.labeled_cloud import (
    HEIGHT,
    INPUTS,
    PIECE_INPUTS,
    LabeledCloud,
    SourceFacts,
    identify,
    read_labeled,
)
from learn.datasets.layout import MANIFEST, DatasetFacts, PieceRow, manifest_record, write_piece
from learn.datasets.patch import Patch, Scaling
from learn.datasets.scan_units import AS_STATED, ScanUnits
from learn.datasets.settings import DatasetSettings
from learn.datasets.split import SPLITS, TEST, TRAIN, split_at_random, split_bridges
from learn.datasets.tiles import cut_tiles, thin, with_heights
from learn.datasets.windows import cut_windows

I64 = NDArray[np.int64]
CARD = "README.md"
_WITHOUT = {
    "train": "nothing can be trained on this data set",
    "val": "training then holds out a bridge of train, and needs two there; a forest needs none",
    "test": "evaluate needs --split val",
}


@dataclass(frozen=True)
class Source:
    """A cloud or a scan of a data set.

    Attributes:
        path: Folder of a cloud, or file of a scan.
        class_map: Meaning of the class numbers of a scan; None for a cloud.
        bridge: Name of its bridge, for a scan that does not state it.
        seed: Seed of its scene; None where it is unknown.
        look: Hash of the files of its scene's looks; empty where it is unknown.
        units: Unit and up axis of a scan.
    """

    path: Path
    class_map: ClassMap | None = None
    bridge: str = ""
    seed: int | None = None
    look: str = ""
    units: ScanUnits = AS_STATED


def build_dataset(
    sources: Sequence[Source], folder: Path, settings: DatasetSettings, progress: Progress = SILENT
) -> DatasetFacts:
    """Cut clouds into pieces, assign them to splits, and write them.

    Args:
        sources: Clouds and scans.
        folder: Empty folder to fill.
        settings: How.
        progress: Listener.

    Returns:
        The manifest of the data set.

    Raises:
        InputError: A source is invalid, or nothing is left to train on.
    """
    settings = _with_own_classes(settings, sources)
    own = settings.table == OWN
    table = own_table(list(settings.own)) if own else class_table(settings.table, settings.noisy_class)
    known = [_identified(source) for source in sources]
    _check_sources(sources, known)
    _note_unnamed(sources, settings, progress)
    splits = split_bridges(known, settings)
    progress.stage("data set", len(sources))
    pieces: list[PieceRow] = []
    counts = {split: np.zeros(256, np.int64) for split in SPLITS}
    present = set(INPUTS)
    for number, (source, facts) in enumerate(zip(sources, known, strict=True)):
        cloud = read_labeled(source.path, source.class_map, table, progress, settings.moving, source.units)
        cloud = _with_noise(cloud, table, settings)
        present &= set(cloud.inputs)
        try:
            for row, patch in _rows(cloud, number, facts, settings, splits):
                write_piece(folder / row.split / row.name, patch)
                pieces.append(row)
                counts[row.split] += np.bincount(patch.labels, minlength=256)
        except InputError as error:
            error.found_in(source.path)
            raise
        progress.advance(number + 1)
    _note_empty(pieces, splits, settings, progress)
    _note_shared(pieces, known, settings, progress)
    _check_training(pieces, known, settings)
    present |= {HEIGHT} if settings.mode == "metric" else set()
    inputs = tuple(name for name in PIECE_INPUTS if name in present)
    whole = DatasetFacts(
        settings, table.names, inputs, _scaling(settings), tuple(pieces), tuple(vars(facts) for facts in known)
    )
    write_text(folder / CARD, card_text(whole, {split: seen for split, seen in counts.items() if seen.any()}))
    write_manifest(folder, manifest_record(whole), MANIFEST)
    return whole


def _identified(source: Source) -> SourceFacts:
    facts = identify(source.path, source.class_map, source.bridge, source.units)
    return replace(facts, seed=source.seed, look=source.look)


def _note_empty(
    pieces: Sequence[PieceRow], splits: Mapping[str, str], settings: DatasetSettings, progress: Progress
) -> None:
    """Report which splits are empty, and what cannot be done without them."""
    for split, share in zip(SPLITS, settings.shares, strict=True):
        if not any(row.split == split for row in pieces):
            wanted = "" if share else ", and its share is 0"
            progress.note(f"{split} is empty: the sources show {len(splits)} bridge(s){wanted}; {_WITHOUT[split]}")


def _note_shared(
    pieces: Sequence[PieceRow], known: Sequence[SourceFacts], settings: DatasetSettings, progress: Progress
) -> None:
    """Report seeds and looks that occur both in the test and in training or validation, though the bridges differ."""
    if settings.split == "random":  # all is shared
        return
    used = [{row.source for row in pieces if (row.split == TEST) is held} for held in (True, False)]
    for words, key in (("a seed", "seed"), ("a look", "look")):
        held, seen = ({getattr(known[number], key) for number in numbers} - {None, ""} for numbers in used)
        names = sorted(known[number].name for number in used[0] if getattr(known[number], key) in held & seen)
        if names:
            progress.note(
                f"the test has {words} in common with the training: {', '.join(names)}; its scores may be too good"
            )


def _check_training(pieces: Sequence[PieceRow], known: Sequence[SourceFacts], settings: DatasetSettings) -> None:
    """Refuse a data set without a training piece, unless its sources must not be trained on."""
    if any(row.split == TRAIN for row in pieces) or all(facts.evaluate_only for facts in known):
        return
    if not settings.shares[0]:
        raise InputError(
            "no piece is left to train on, because the share of train is 0",
            field="shares",
            value=settings.shares,
            hint="Give train a share",
        )
    raise InputError(
        "no piece is left to train on",
        field="fewest",
        value=settings.fewest,
        hint="Give more clouds, or lower fewest",
    )


def _note_unnamed(sources: Sequence[Source], settings: DatasetSettings, progress: Progress) -> None:
    """Report that scans without the name of their bridge count as different bridges."""
    unnamed = [source for source in sources if source.class_map is not None and not source.bridge]
    if len(unnamed) > 1 and settings.split == "bridge":
        progress.note(
            f"{len(unnamed)} scans count as different bridges: if some show the same one, they may be in different "
            "splits; name the bridge of each source with --bridge"
        )


def _with_own_classes(settings: DatasetSettings, sources: Sequence[Source]) -> DatasetSettings:
    """Take the classes from the class maps if none of our tables is chosen."""
    if settings.table != OWN:
        return settings
    if settings.noisy_class:
        raise InputError("own classes have no class for noisy points", field="noisy_class", value=True, allowed="false")
    found: dict[str, int] = {}
    for source in sources:
        if source.class_map is None:
            raise InputError(
                "own classes come from a class map, and a cloud has none",
                where=source.path,
                field="--table",
                value=OWN,
                hint="Give labeled scans with --class-map",
            )
        for code, row in sorted(source.class_map.codes.items()):
            if row.name != "unlabelled":
                found.setdefault(row.name, code)
    return settings.model_copy(update={"own": found})


def _check_sources(sources: Sequence[Source], known: Sequence[SourceFacts]) -> None:
    if not sources:
        raise InputError("no cloud is named", hint="Name the folders of clouds, or scans with --class-map")
    digests: dict[str, str] = {}
    for source, facts in zip(sources, known, strict=True):
        if facts.digest in digests:
            raise InputError(
                "the same points are given twice",
                where=source.path,
                value=digests[facts.digest],
                hint="Name each cloud once",
            )
        digests[facts.digest] = facts.name


def _with_noise(cloud: LabeledCloud, table: ClassTable, settings: DatasetSettings) -> LabeledCloud:
    """Make uncertain points a class of their own, if that is chosen."""
    if not settings.noisy_class:
        return cloud
    labels = np.where(cloud.uncertainty > settings.noisy, table.index(NOISY_CLASS), cloud.labels).astype(np.uint8)
    return replace(cloud, labels=labels)


def _rows(
    cloud: LabeledCloud, number: int, facts: SourceFacts, settings: DatasetSettings, splits: Mapping[str, str]
) -> Iterator[tuple[PieceRow, Patch]]:
    """Cut a cloud into pieces that are large enough, each with its row in the manifest."""
    first = _split_of(facts, 0, settings, splits)  # that of the only piece, where the split affects its points
    for place, (patch, draws) in enumerate(_pieces(cloud, facts, settings, first)):
        split = _split_of(facts, place, settings, splits)
        patch = _for_split(patch, split, settings)
        if len(patch) >= settings.fewest:
            row = PieceRow(
                f"{number:04d}_{place:06d}",
                split,
                facts.bridge,
                number,
                len(patch),
                min(draws, count_draws(len(patch), settings.points)),
                patch.seed,
                _three(patch.origin),
            )
            yield row, patch


def _pieces(
    cloud: LabeledCloud, facts: SourceFacts, settings: DatasetSettings, split: str
) -> Iterator[tuple[Patch, int]]:
    """Cut a cloud into pieces of any size; return with each the number of its draws."""
    if not len(cloud):
        return
    if settings.mode == "metric":
        voxels = with_heights(thin(cloud.coord, _columns(cloud), settings.tile), settings.tile)
        for tile in cut_tiles(voxels, settings.tile):
            yield tile_patch(voxels.coord, voxels.columns, tile.rows, tile.origin, tile.seed), 1 << 30
    elif settings.kind == "local":
        for window in cut_windows(cloud, settings.window, facts.name):
            yield _patch(cloud, window.rows, window.origin, window.number), 1 << 30
    else:
        seed = int(facts.digest[:8], 16)
        rows = random_draw(len(cloud), settings.points, np.random.default_rng([settings.seed, seed]))
        if settings.stratified and split == TRAIN:
            rows = np.arange(len(cloud))  # drawn by class from all points, differently each time
        middle = cloud.coord.mean(axis=0)
        yield _patch(cloud, rows, np.array([*middle[:2], cloud.coord[:, 2].min()]), seed), 1


def tile_patch(
    coord: NDArray[np.float64], columns: Mapping[str, NDArray[Any]], rows: I64, origin: NDArray[np.float64], seed: int
) -> Patch:
    """Make a patch of the points of a tile of a thinned cloud.

    Args:
        coord: Positions of the cloud [m], shape (V, 3), float64.
        columns: Inputs and, if known, `labels`, `uncertainty` and `instance`, shape (V,) or (V, C) each.
        rows: Points of the tile, shape (N,), int64.
        origin: Origin of its positions [m], shape (3,), float64.
        seed: Seed of its draws.
    """
    labels = columns["labels"][rows] if "labels" in columns else np.full(len(rows), 255, np.uint8)
    unknown = np.full(len(rows), np.nan, np.float32)
    uncertainty = columns["uncertainty"][rows] if "uncertainty" in columns else unknown
    inputs = {name: columns[name][rows] for name in PIECE_INPUTS if name in columns}
    instance = columns["instance"][rows] if "instance" in columns else np.zeros(len(rows), np.int64)
    place = (coord[rows] - origin).astype(np.float32)
    return Patch(place, inputs, labels, uncertainty, origin, seed, rows, instance)


def _columns(cloud: LabeledCloud) -> dict[str, NDArray[Any]]:
    columns = {**cloud.inputs, "labels": cloud.labels, "uncertainty": cloud.uncertainty}
    return columns if cloud.instance is None else {**columns, "instance": cloud.instance}


def _patch(cloud: LabeledCloud, rows: I64, origin: NDArray[np.float64], seed: int) -> Patch:
    return tile_patch(cloud.coord, _columns(cloud), rows, origin, seed)


def _split_of(facts: SourceFacts, place: int, settings: DatasetSettings, splits: Mapping[str, str]) -> str:
    return split_at_random(facts, place, settings) if settings.split == "random" else splits[facts.bridge]


def _for_split(patch: Patch, split: str, settings: DatasetSettings) -> Patch:
    """Remove noisy points from training pieces, unless they are a class; other splits keep all points."""
    if split != TRAIN or settings.noisy_class:
        return patch
    kept = ~(patch.uncertainty > settings.noisy)
    inputs = {name: values[kept] for name, values in patch.inputs.items()}
    assert patch.row is not None
    assert patch.instance is not None
    return Patch(
        patch.coord[kept],
        inputs,
        patch.labels[kept],
        patch.uncertainty[kept],
        patch.origin,
        patch.seed,
        patch.row[kept],
        patch.instance[kept],
    )


def _scaling(settings: DatasetSettings) -> Scaling:
    if settings.mode == "metric":
        return Scaling("constant", settings.tile.scale)
    return Scaling("extent") if settings.kind == "local" else Scaling("constant", 1.0)


def _three(origin: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = origin.tolist()
    return x, y, z
