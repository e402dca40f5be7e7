"""Report page of a comparison: the arms, their scores, and their differences with confidence intervals."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from falsework.report.page import BLUE, GRAY, SERIES, number, percent, plain_layout, settings_rows, write_page
from groundwork.errors import InputError, MissingError
from groundwork.files import read_json
from learn.compare.tables import arm_name, interval, of_class, points

RECORD = "comparison.json"
FEW_BRIDGES, FEW_SEEDS = 12, 5  # fewer give a weak comparison
FEW_FOR_P = 6  # with fewer test bridges Wilcoxon's p cannot be below 0.05


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
    models = _models(record)
    write_page(
        path,
        "comparison.html.j2",
        title=str(record["title"]),
        lead="ways of making training clouds, compared on the same bridges, windows, steps and seeds; "
        f"model{'s'[: len(models) != 1]}: {', '.join(models)}",
        few=", ".join(few),
        no_p=any(row["bridges"] < FEW_FOR_P for row in record["differences"]),
        level=f"{100 * record['level']:.0f} %",
        draws=number(record["draws"]),
        facts=[str(line).replace("`", "") for line in record["facts"]],
        model_heads=["model"] if len(models) > 1 else [],
        scores=[_score_row(row, record) for row in rows],
        score_figure=_score_figure(rows, record),
        classes=names,
        iou=[[*_place(row, record), *(percent(row["iou"][one]) for one in names)] for row in rows],
        differences=[_difference_row(row, record) for row in record["differences"]],
        difference_figure=_difference_figure(record) if record["differences"] else None,
        class_differences=[
            [*_model_of(row, record), row["test"], _pair(row), *(of_class(row["classes"].get(one)) for one in names)]
            for row in record["differences"]
        ],
        group_heads=["group"] if len(record["groups"]) > 1 else [],
        losses=[_loss_row(row, record) for row in record["losses"]],
        matrices=[_matrix(row, record, names) for row in rows],
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


def _models(record: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(str(row["model"]) for row in record["scores"]))


def _model_of(row: Mapping[str, Any], record: Mapping[str, Any]) -> list[str]:
    """Name the model of a row if there is more than one model."""
    return [str(row["model"])] if len(_models(record)) > 1 else []


def _place(row: Mapping[str, Any], record: Mapping[str, Any]) -> list[str]:
    """Name the model, what it was trained on, and its test."""
    return [*_model_of(row, record), arm_name(row, record), str(row["test"])]


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
    """Plot the mean IoU of every arm; a group of bars for each test and model."""
    figure = go.Figure()
    arms = list(dict.fromkeys(row["arm"] for row in rows))
    for arm, color in zip(arms, SERIES * (len(arms) // len(SERIES) + 1), strict=False):
        mine = [row for row in rows if row["arm"] == arm and row["mean_iou"] is not None]
        several = len(record["groups"]) > 1
        places = [
            escape(f"{_tested(row, record)}" + (f", {' · '.join(row['group'])}" if several else "")) for row in mine
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


def _tested(row: Mapping[str, Any], record: Mapping[str, Any]) -> str:
    return ", ".join([*_model_of(row, record), f"tested on {row['test']}"])


def _difference_row(row: Mapping[str, Any], record: Mapping[str, Any]) -> list[str]:
    return [
        *_model_of(row, record),
        str(row["test"]),
        _pair(row),
        points(row["difference"]),
        interval(row["interval"]),
        interval(row["over_seeds"]),
        f"{row['wins']} of {row['seeds']}",
        f"{row['bridges']}",
    ]


def _difference_figure(record: Mapping[str, Any]) -> go.Figure:
    """Plot each difference with its intervals: over seeds and bridges thick, over seeds only thin."""
    figure, rows = go.Figure(), record["differences"]
    names = [escape(f"{', '.join([*_model_of(row, record), row['test']])}: {_pair(row)}") for row in rows]
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
    plain_layout(figure, 130 + 48 * len(rows))  # room for names of three lines on a phone
    figure.add_vline(x=0, line={"color": GRAY, "dash": "dot"})
    return figure.update_layout(
        xaxis={"title": "difference of mean IoU [points]", "automargin": True},
        yaxis={"autorange": "reversed", "automargin": True},
    )


def _loss_row(row: Mapping[str, Any], record: Mapping[str, Any]) -> list[str]:
    lost = percent(1.0 - row["common"] / row["valid"]) if row["valid"] else "–"
    counts = [number(row[key]) for key in ("bridges", "candidates", "valid", "common")]
    group = [" · ".join(map(str, row["group"]))] if len(record["groups"]) > 1 else []
    return [*group, str(row["part"]), *counts, lost]


def _matrix(row: Mapping[str, Any], record: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Format the confusion of one arm in one test: a row for each class that occurs, as shares of its points."""
    matrix, places = row["confusion"], [list(record["classes"]).index(name) for name in names]
    models = "".join(f"{model}, " for model in _model_of(row, record))
    return {
        "title": f"{models}trained on {arm_name(row, record)}, tested on {row['test']}",
        "rows": [
            (name, [matrix[i][j] / sum(matrix[i]) for j in places])
            for name, i in zip(names, places, strict=True)
            if sum(matrix[i])
        ],
    }


def _pair(row: Mapping[str, Any]) -> str:
    return f"{row['first']} − {row['second']}"
