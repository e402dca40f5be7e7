"""Scores as Markdown tables, which can also be read in a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

_NAMES = {"accuracy": "accuracy", "precision": "precision", "iou": "IoU", "f1": "F1"}
_MEANS = ("mean_accuracy", "mean_precision", "mean_iou", "mean_f1")


def score_lines(record: Mapping[str, Any]) -> list[str]:
    """Format scores as Markdown.

    Args:
        record: Of `learn.evaluate.evaluate_model`.

    Returns:
        Lines of text; a class that does not occur has dashes.
    """
    sure = f"{record['sure']['uncertainty']:g} m"
    lines = [*_classes(record), "", _summary(record), "", f"Points with an uncertainty of at most {sure}:", ""]
    return [
        *lines,
        *_classes(record["sure"]),
        *_uncertainty(record),
        *_calibration(record),
        *_confusion(record),
        *_panoptic(record),
        *_bridges(record),
    ]


def short_lines(record: Mapping[str, Any]) -> list[str]:
    """Format only the scores of classes, the means and those of bridges.

    Args:
        record: Of `learn.evaluate.evaluate_model`.
    """
    return [*_classes(record), "", _summary(record), *_bridges(record)]


def _classes(record: Mapping[str, Any]) -> list[str]:
    rows = [
        [name, str(row["points"]), *(_figure(row[key]) for key in _NAMES)] for name, row in record["classes"].items()
    ]
    rows.append(
        [
            "mean",
            str(sum(row["points"] for row in record["classes"].values())),
            *(_figure(record[key]) for key in _MEANS),
        ]
    )
    return table(["class", "points", *_NAMES.values()], rows)


def _summary(record: Mapping[str, Any]) -> str:
    quality = {key: (row or {}).get("mean") for key, row in record["panoptic"].items() if key != "link"}
    return (
        f"{record['points']} points, each scored once, of {record['votes']} votes; means over "
        f"{record['classes_averaged']} classes that occur; overall accuracy {_figure(record['overall_accuracy'])}, "
        f"calibration error {_figure(record['calibration_error'])}, panoptic quality {_figure(quality['parts'])} "
        f"against connected parts and {_figure(quality['modelled'])} against components"
    )


def _uncertainty(record: Mapping[str, Any]) -> list[str]:
    by = record["by_uncertainty"]
    rows = [
        [f"{limit:g} m", str(count), _figure(value)]
        for limit, count, value in zip(by["thresholds"], by["points"], by["mean_iou"], strict=True)
    ]
    return ["", "Mean IoU of the points up to an uncertainty:", "", *table(["uncertainty", "points", "mean IoU"], rows)]


def _calibration(record: Mapping[str, Any]) -> list[str]:
    pairs = [
        (kept, wrong)
        for kept, wrong in zip(record["coverage"], record["risk"], strict=True)
        if round(20 * kept) in (2, 5, 10, 15, 20)
    ]
    rows = [[f"{kept:.0%}", _figure(wrong)] for kept, wrong in pairs]
    return (
        ["", "Share of errors among the points with the highest confidence:", "", *table(["kept", "wrong"], rows)]
        if rows
        else []
    )


def _confusion(record: Mapping[str, Any]) -> list[str]:
    names = list(record["class_names"])
    seen = [
        i
        for i, name in enumerate(names)
        if record["classes"][name]["points"] or any(row[i] for row in record["confusion"])
    ]
    rows = [[names[i], *(_figure(record["confusion_shares"][i][j], 2) for j in seen)] for i in seen]
    return [
        "",
        "Confusion matrix, as shares of the points of each true class:",
        "",
        *table(["true class", *(names[j] for j in seen)], rows),
    ]


def _panoptic(record: Mapping[str, Any]) -> list[str]:
    lines: list[str] = []
    titles = {"parts": "connected parts of the true classes", "modelled": "components as they were modeled"}
    for key, title in titles.items():
        if record["panoptic"][key] is None:
            continue
        rows = [
            [
                name,
                *(str(row[word]) for word in ("true", "found", "matched")),
                *(_figure(row[word]) for word in ("quality", "segmentation", "recognition")),
            ]
            for name, row in record["panoptic"][key]["classes"].items()
            if row["true"] + row["found"]
        ]
        lines += ["", f"Instances, against the {title}:", ""]
        lines += table(["class", "true", "found", "matched", "quality", "segmentation", "recognition"], rows)
    return lines


def _bridges(record: Mapping[str, Any]) -> list[str]:
    names = [name for name, row in record["classes"].items() if row["points"]]
    worst = sorted(record["bridges"].items(), key=lambda item: item[1]["mean_iou"] or 0.0)
    rows = [
        [
            name[:12],
            str(row["points"]),
            _figure(row["overall_accuracy"]),
            _figure(row["mean_iou"]),
            _figure(row["calibration_error"]),
            *(_figure(row["classes"][word]["iou"]) for word in names),
        ]
        for name, row in worst
    ]
    header = ["bridge", "points", "accuracy", "mean IoU", "calibration", *(f"IoU {name}" for name in names)]
    return ["", "Bridges, the worst first:", "", *table(header, rows)]


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Format an aligned Markdown table.

    Args:
        header: Cells of the first row.
        rows: Cells of the others.

    Returns:
        One line per row, and the line below the header.
    """
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    lines = [
        [
            cell.rjust(width) if place else cell.ljust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        for row in [header, *rows]
    ]
    rule = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]
    return [f"| {' | '.join(cells)} |" for cells in [lines[0], rule, *lines[1:]]]


def _figure(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
