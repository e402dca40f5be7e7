"""Report page of a data set: classes, splits by bridge, sizes of pieces, and some pieces in 3D."""

from collections import Counter, defaultdict
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from falsework.report.cloud_view import Shown, cloud_view, instance_color
from falsework.report.page import SERIES, file_link, percent, plain_layout, settings_rows, write_page
from groundwork.progress import SILENT, Progress
from usd_schemas.components import ClassRow, class_rows

if TYPE_CHECKING:
    from learn.datasets.layout import DatasetFacts, PieceRow
    from learn.datasets.patch import Patch
    from recon.cloud import Cloud

I64 = NDArray[np.int64]

EXAMPLES = 3  # pieces shown in 3D
EXAMPLE_POINTS = 20_000  # of each
IGNORED = 255  # label of points of unknown class
LONG_TAIL = 8.0  # ratio of the largest to the median piece above which the axis is logarithmic


def write_dataset_page(path: Path, folder: Path, place: str = "", progress: Progress = SILENT) -> None:
    """Write the page of a data set.

    Args:
        path: HTML file to write.
        folder: Root of the data set.
        place: Relative path from the page to that folder; empty for its own.
        progress: Listener.
    """
    from learn.datasets.layout import read_facts

    facts = read_facts(folder)
    splits = [split for split in ("train", "val", "test") if any(row.split == split for row in facts.pieces)]
    counts = _counted(facts, folder, progress)
    rows = class_rows_of(facts.classes)
    write_page(
        path,
        "dataset.html.j2",
        title=f"Data set {folder.absolute().name}",
        lead=f"{facts.settings.kind}, {facts.settings.mode}, classes of the table {facts.settings.table}",
        tiles=_tiles(facts, counts),
        splits=splits,
        classes=_class_table(rows, counts, splits),
        absent=", ".join(row.name for row in rows if not any(counts[split][row.id] for split in splits)),
        summary=_split_table(facts, splits),
        missing=_missing_in_training(rows, counts, splits),
        shares=_share_figure(rows, counts, splits),
        bridges=_bridge_table(facts),
        sizes=_size_figure(facts, splits),
        sources=_source_table(facts),
        at_random=facts.settings.split != "bridge",
        examples=_examples(facts, folder, rows),
        settings=[("settings", settings_rows(facts.settings.model_dump(mode="json")))],
        files=[(name, file_link(*([""] if not place else place.split("/")), name)) for name in _files(folder)],
    )


def class_rows_of(names: tuple[str, ...]) -> tuple[ClassRow, ...]:
    """Return the colors of a table's classes: our own for our class names, else from a series.

    Args:
        names: Name of each class, in the order of the labels.
    """
    known = {row.name: row.color for row in class_rows()}
    few = len(names) <= len(SERIES)  # no two of many have the same color
    return tuple(
        ClassRow(k, name, known.get(name, _rgb(SERIES[k]) if few else instance_color(k + 1)))
        for k, name in enumerate(names)
    )


def _counted(facts: "DatasetFacts", folder: Path, progress: Progress) -> dict[str, I64]:
    """Count the points of each label in each split, shape (256,)."""
    from learn.datasets.layout import read_piece

    counts: dict[str, I64] = defaultdict(lambda: np.zeros(256, np.int64))
    progress.stage("read pieces", len(facts.pieces))
    for number, row in enumerate(facts.pieces):
        counts[row.split] += np.bincount(read_piece(folder, row, ()).labels, minlength=256)
        progress.advance(number + 1)
    return counts


def _tiles(facts: "DatasetFacts", counts: dict[str, I64]) -> list[dict[str, str]]:
    total = sum((int(values.sum()) for values in counts.values()), 0)
    known = sum((int(values[:IGNORED].sum()) for values in counts.values()), 0)
    return [
        {"label": "bridges", "value": f"{len({row.bridge for row in facts.pieces})}"},
        {"label": "pieces", "value": f"{len(facts.pieces):,}"},
        {"label": "points", "value": f"{total:,}"},
        {"label": "of the points have a class", "value": percent(known / total if total else None)},
        {"label": "classes", "value": f"{len(facts.classes)}"},
        {"label": "points of a sample", "value": f"{facts.settings.points:,}"},
    ]


def _class_table(rows: tuple[ClassRow, ...], counts: dict[str, I64], splits: list[str]) -> list[dict[str, Any]]:
    table = []
    for row in (*rows, ClassRow(IGNORED, "unlabelled", (154, 160, 166))):
        each = [int(counts[split][row.id]) for split in splits]
        if not any(each):
            continue
        shares = [
            percent(count / int(counts[split].sum())) if counts[split].sum() else "–"
            for count, split in zip(each, splits, strict=True)
        ]
        table.append(
            {"id": row.id, "name": row.name, "color": row.color, "cells": list(zip(each, shares, strict=True))}
        )
    return table


def _share_figure(rows: tuple[ClassRow, ...], counts: dict[str, I64], splits: list[str]) -> go.Figure:
    """Plot the share of each class that occurs, one row each, so that names fit on a phone."""
    figure = go.Figure()
    there = [row for row in rows if any(counts[split][row.id] for split in splits)]
    for split, color in zip(splits, SERIES, strict=False):
        total = max(int(counts[split][:IGNORED].sum()), 1)
        shares = [100.0 * int(counts[split][row.id]) / total for row in there]
        names = [escape(row.name) for row in there]
        figure.add_bar(x=shares, y=names, name=split, marker_color=color, orientation="h")
    plain_layout(figure, 110 + (10 + 8 * len(splits)) * max(len(there), 1))
    return figure.update_layout(
        xaxis={"title": "share of the points with a class [%]"},
        yaxis={"autorange": "reversed", "automargin": True, "dtick": 1, "type": "category"},
        legend={"traceorder": "normal"},
        bargap=0.25,
    )


def _missing_in_training(rows: tuple[ClassRow, ...], counts: dict[str, I64], splits: list[str]) -> str:
    """List the classes of a held-out split that no training piece has; empty if there is no training split."""
    held = [split for split in splits if split != "train"]
    if "train" not in splits:
        return ""
    names = [row.name for row in rows if not counts["train"][row.id] and any(counts[s][row.id] for s in held)]
    return ", ".join(names)


def _split_table(facts: "DatasetFacts", splits: list[str]) -> list[list[str]]:
    """Count bridges, pieces, points and draws of each split."""
    table = []
    for split in splits:
        mine = [row for row in facts.pieces if row.split == split]
        points, draws = sum(row.points for row in mine), sum(row.draws for row in mine)
        bridges = len({row.bridge for row in mine})
        table.append([split, f"{bridges:,}", f"{len(mine):,}", f"{points:,}", f"{draws:,}"])
    return table


def _bridge_table(facts: "DatasetFacts") -> list[list[str]]:
    pieces: dict[str, list[PieceRow]] = defaultdict(list)
    for row in facts.pieces:
        pieces[row.bridge].append(row)
    table = []
    for bridge, mine in sorted(pieces.items(), key=lambda pair: (pair[1][0].split, pair[0])):
        splits = Counter(row.split for row in mine)
        names = sorted({str(facts.sources[row.source].get("name", "")) for row in mine})
        points, draws = sum(row.points for row in mine), sum(row.draws for row in mine)
        table.append(
            [
                bridge[:12],
                ", ".join(f"{name} ({count})" if len(splits) > 1 else name for name, count in sorted(splits.items())),
                ", ".join(names),
                f"{len(mine):,}",
                f"{points:,}",
                f"{draws:,}",
            ]
        )
    return table


def _size_figure(facts: "DatasetFacts", splits: list[str]) -> go.Figure:
    sizes = np.maximum([row.points for row in facts.pieces] or [1], 1).astype(float)
    tail = float(sizes.max()) > LONG_TAIL * float(np.median(sizes))
    ends = 0.99 * float(sizes.min()), 1.01 * float(sizes.max())
    edges = np.geomspace(*ends, 41) if tail else np.linspace(0.0, float(sizes.max()), 41)
    figure = go.Figure()
    for split, color in zip(splits, SERIES, strict=False):
        counts, _ = np.histogram([row.points for row in facts.pieces if row.split == split], edges)
        middle = np.sqrt(edges[1:] * edges[:-1]) if tail else 0.5 * (edges[1:] + edges[:-1])
        figure.add_bar(x=middle, y=counts, width=np.diff(edges), name=split, marker_color=color)
    plain_layout(figure, 340)
    return figure.update_layout(
        barmode="stack",
        bargap=0,
        legend={"traceorder": "normal"},
        xaxis={"title": "points of a piece", **(_log_axis(*ends) if tail else {})},
        yaxis={"title": "pieces"},
    )


def _log_axis(low: float, high: float) -> dict[str, Any]:
    """Make a logarithmic axis with ticks at 1, 2 and 5 times each power of ten; Plotly's ticks omit the zeros."""
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    ticks = [step * 10**power for power in decades if power >= 0 for step in (1, 2, 5)]
    ticks = [tick for tick in ticks if low <= tick <= high]
    return {"type": "log", "tickvals": ticks, "ticktext": [f"{tick:,}" for tick in ticks]}


def _source_table(facts: "DatasetFacts") -> list[list[str]]:
    return [
        [
            str(source.get("name", "")),
            str(source.get("kind", "")),
            str(source.get("bridge", ""))[:12],
            f"{source.get('licence') or 'own'}{', evaluate only' if source.get('evaluate_only') else ''}",
        ]
        for source in facts.sources
    ]


def _examples(facts: "DatasetFacts", folder: Path, rows: tuple[ClassRow, ...]) -> list[dict[str, Any]]:
    """Show the piece of each split with the most classes."""
    from learn.datasets.layout import read_piece

    examples = []
    inputs = tuple(name for name in ("color",) if name in facts.inputs)
    for split in ("train", "val", "test"):
        mine = [row for row in facts.pieces if row.split == split][:40]
        if not mine or len(examples) >= EXAMPLES:
            continue
        found = [(read_piece(folder, row, inputs), row) for row in mine]
        patch, row = max(found, key=lambda pair: len(np.unique(pair[0].labels)))
        view = cloud_view(_as_cloud(patch, rows), None, Shown(EXAMPLE_POINTS, 0, whole=True))
        view["first_paint"] = "class"
        examples.append({"name": row.name, "split": split, "points": f"{row.points:,}", "view": view})
    return examples


def _as_cloud(patch: "Patch", rows: tuple[ClassRow, ...]) -> "Cloud":
    from recon.cloud import COLUMNS, MESH, Cloud, without_observations

    count = len(patch.coord)
    columns = {
        name: np.zeros((count, kind.width) if kind.width > 1 else count, kind.dtype) for name, kind in COLUMNS.items()
    }
    columns |= {
        "coord": patch.coord.astype(np.float64),
        "segment": patch.labels,
        "uncertainty": np.asarray(patch.uncertainty, np.float32),
        "color": np.asarray(patch.inputs.get("color", columns["color"]), np.uint8),
    }
    if patch.instance is not None:
        columns["instance"] = np.maximum(patch.instance, 0).astype(np.uint32)
    return Cloud(columns, without_observations(count), ("",), rows, {}, (), {}, MESH)


def _files(folder: Path) -> list[str]:
    return [name for name in ("dataset.json", "README.md", "train", "val", "test") if (folder / name).exists()]


def _rgb(color: str) -> tuple[int, int, int]:
    red, green, blue = (int(color[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue
