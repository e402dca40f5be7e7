"""The page of a comparison: what was compared, what each arm scores, and how sure the differences are."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from falsework.report.page import BLUE, GRAY, SERIES, number, percent, plain_layout, settings_rows, write_page
from groundwork.errors import InputError, MissingError
from groundwork.files import read_json

RECORD = "comparison.json"
FEW_BRIDGES, FEW_SEEDS = 12, 5  # below which a comparison says little


def write_comparison_page(path: Path, folder: Path) -> None:
    """Write the page of a comparison.

    Args:
        path: HTML file to write.
        folder: Folder that `falsework compare` has written.
    """
    record = read_comparison(folder)
    rows = record["scores"]
    names = [one for one in record["classes"] if any(row["iou"][one] is not None for row in rows)]
    few = [f"{n} test bridge{'s'[: n != 1]}" for n in sorted({row["bridges"] for row in rows}) if n < FEW_BRIDGES]
    few += [f"{n} seed{'s'[: n != 1]}" for n in sorted({len(row["seeds"]) for row in rows}) if n < FEW_SEEDS]
    write_page(
        path,
        "comparison.html.j2",
        title=str(record["title"]),
        lead="ways of making training clouds, compared on the same bridges, windows, steps and seeds",
        few=", ".join(few),
        level=f"{100 * record['level']:.0f} %",
        draws=number(record["draws"]),
        facts=[str(line).replace("`", "") for line in record["facts"]],
        scores=[_score_row(row, record) for row in rows],
        score_figure=_score_figure(rows, record),
        classes=names,
        iou=[[*_place(row, record), *(percent(row["iou"][one]) for one in names)] for row in rows],
        differences=[_difference_row(row) for row in record["differences"]],
        difference_figure=_difference_figure(record["differences"]) if record["differences"] else None,
        class_differences=[
            [row["model"], row["test"], _pair(row), *(_of_class(row["classes"].get(one)) for one in names)]
            for row in record["differences"]
        ],
        losses=[_loss_row(row) for row in record["losses"]],
        matrices=[
            (" · ".join(_place(row, record)), _matrix(row["confusion"], record["classes"], names)) for row in rows
        ],
        command=str(record["command"]),
        settings=[("settings", settings_rows(record["settings"]))],
    )


def read_comparison(folder: Path) -> dict[str, Any]:
    """Read the record of a comparison.

    Args:
        folder: Folder that `falsework compare` has written.

    Raises:
        MissingError: Not such a folder.
        InputError: Of another version.
    """
    path = folder / RECORD
    if not path.is_file():
        raise MissingError(f"not a comparison: no {RECORD}", where=folder, hint="Name a folder of falsework compare")
    record = read_json(path)
    told = (record.get("format"), record.get("format_version")) if isinstance(record, dict) else None
    if not isinstance(record, dict) or told != ("falsework.comparison", 1):
        raise InputError(
            "not a comparison of this version",
            where=path,
            field="format",
            value=told,
            allowed="falsework.comparison, version 1",
        )
    return record


def _place(row: Mapping[str, Any], record: Mapping[str, Any]) -> list[str]:
    """Name the model, what it was trained on, and its test; with several groups, those it shares its windows with."""
    arm = row["arm"] if len(record["groups"]) < 2 else f"{row['arm']} ({' · '.join(row['group'])})"
    return [str(row["model"]), str(arm), str(row["test"])]


def _score_row(row: Mapping[str, Any], record: Mapping[str, Any]) -> list[str]:
    return [
        *_place(row, record),
        *(_spread(row, key) for key in ("mean_iou", "mean_accuracy", "overall_accuracy")),
        percent(row["sure_mean_iou"]),
        f"{len(row['seeds'])}",
        f"{row['bridges']}",
    ]


def _spread(row: Mapping[str, Any], key: str) -> str:
    deviation = row.get(f"{key}_sd")
    return percent(row[key]) + ("" if deviation is None else f" ± {100 * deviation:.1f}")


def _score_figure(rows: Sequence[Mapping[str, Any]], record: Mapping[str, Any]) -> go.Figure:
    """Draw the mean IoU of every arm; a group of bars for each test and model."""
    figure = go.Figure()
    arms = list(dict.fromkeys(row["arm"] for row in rows))
    for arm, color in zip(arms, SERIES * (len(arms) // len(SERIES) + 1), strict=False):
        mine = [row for row in rows if row["arm"] == arm and row["mean_iou"] is not None]
        several = len(record["groups"]) > 1
        places = [
            escape(f"{row['model']}, {row['test']}" + (f", {' · '.join(row['group'])}" if several else ""))
            for row in mine
        ]
        figure.add_bar(
            x=places,
            y=[100 * row["mean_iou"] for row in mine],
            error_y={"type": "data", "array": [100 * (row.get("mean_iou_sd") or 0.0) for row in mine], "color": GRAY},
            name=escape(str(arm)),
            marker_color=color,
        )
    plain_layout(figure, 380)
    return figure.update_layout(yaxis={"title": "mean IoU [%]", "rangemode": "tozero"})


def _difference_row(row: Mapping[str, Any]) -> list[str]:
    return [
        str(row["model"]),
        str(row["test"]),
        _pair(row),
        _points(row["difference"]),
        _interval(row["interval"]),
        _interval(row["over_seeds"]),
        f"{row['wins']} of {row['seeds']}",
        f"{row['bridges']}",
    ]


def _difference_figure(rows: Sequence[Mapping[str, Any]]) -> go.Figure:
    """Draw each difference with its intervals: thick that over seeds and bridges, thin that over seeds alone."""
    figure = go.Figure()
    names = [escape(f"{row['model']}, {row['test']}: {_pair(row)}") for row in rows]
    for key, title, width, color in (
        ("over_seeds", "over seeds alone", 2, GRAY),
        ("interval", "over seeds and bridges", 5, BLUE),
    ):
        known = [(name, row) for name, row in zip(names, rows, strict=True) if row[key] is not None]
        if not known:
            continue
        figure.add_scatter(
            x=[100 * row["difference"] for _, row in known],
            y=[name for name, _ in known],
            mode="markers",
            marker={"size": 9, "color": color},
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [100 * (row[key][1] - row["difference"]) for _, row in known],
                "arrayminus": [100 * (row["difference"] - row[key][0]) for _, row in known],
                "thickness": width,
                "width": 0,
                "color": color,
            },
            name=title,
        )
    if not figure.data:
        figure.add_scatter(x=[100 * row["difference"] for row in rows], y=names, mode="markers", name="difference")
    plain_layout(figure, 130 + 44 * len(rows))
    figure.add_vline(x=0, line={"color": GRAY, "dash": "dot"})
    return figure.update_layout(
        xaxis={"title": "difference of mean IoU [points]", "automargin": True},
        yaxis={"autorange": "reversed", "automargin": True},
    )


def _loss_row(row: Mapping[str, Any]) -> list[str]:
    lost = percent(1.0 - row["common"] / row["valid"]) if row["valid"] else "–"
    counts = [number(row[key]) for key in ("bridges", "candidates", "valid", "common")]
    return [" · ".join(map(str, row["group"])), str(row["part"]), *counts, lost]


def _matrix(matrix: Sequence[Sequence[int]], classes: Sequence[str], names: Sequence[str]) -> list[list[float | None]]:
    places = [list(classes).index(name) for name in names]
    return [[matrix[i][j] / sum(matrix[i]) if sum(matrix[i]) else None for j in places] for i in places]


def _pair(row: Mapping[str, Any]) -> str:
    return f"{row['first']} − {row['second']}"


def _points(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:+.1f}"


def _interval(ends: Sequence[float] | None) -> str:
    return "–" if ends is None else f"{_points(ends[0])} to {_points(ends[1])}"


def _of_class(found: Mapping[str, Any] | None) -> str:
    return "–" if found is None else f"{_points(found['difference'])} ({found['p']:.2f})"
