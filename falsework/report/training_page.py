"""Report page of trainings: curves side by side, and the scores of each model by class."""

import csv
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from falsework.report.page import GRAY, SERIES, number, percent, plain_layout, settings_rows, write_page
from groundwork.errors import InputError, MissingError
from groundwork.files import read_json

SCORES = ("iou", "accuracy", "precision", "f1")
MOST_ERRORS = 10  # rows in the table of the most frequent confusions
ENDS = 12  # signs of a long name at each end
FACTS = "model.json"
LOG = "log.csv"


def write_training_page(path: Path, models: Mapping[str, Path], evaluations: Mapping[str, Path]) -> None:
    """Write the page of models and scores.

    Args:
        path: HTML file to write.
        models: Name of each model to its folder.
        evaluations: Name of each table of scores to its JSON file.
    """
    trained = [_model(name, folder) for name, folder in models.items()]
    scored = [_scores(name, read_evaluation(file), trained) for name, file in evaluations.items()]
    write_page(
        path,
        "training.html.j2",
        title=f"{'Training' if models else 'Scores'}: {' · '.join(models or evaluations)}",
        lead=_lead(len(trained), len(scored)),
        models=trained,
        curves=_curves(trained) if any(row["log"] for row in trained) else [],
        evaluations=scored,
        side_by_side=_side_by_side(scored) if len(scored) > 1 else None,
    )


def _lead(models: int, scores: int) -> str:
    """State the content of the page, and for a model without scores the command that makes them."""
    counted = ((models, "model", "models"), (scores, "table of scores", "tables of scores"))
    of = ", ".join(f"{count} {several if count > 1 else one}" for count, one, several in counted if count)
    return of if scores else f"{of}; for scores: falsework evaluate MODEL DATASET -o scores.json, and name it, too"


def read_evaluation(path: Path) -> dict[str, Any]:
    """Read scores that `falsework evaluate` wrote.

    Args:
        path: JSON file.

    Raises:
        InputError: Not a file of scores, or of another version.
    """
    record = read_json(path)
    told = (record.get("format"), record.get("format_version")) if isinstance(record, dict) else None
    if not isinstance(record, dict) or told != ("falsework.evaluation", 3):
        raise InputError(
            "not a file of scores of this version",
            where=path,
            field="format",
            value=told,
            allowed="falsework.evaluation, version 3",
            hint="Write it with falsework evaluate MODEL DATASET -o scores.json",
        )
    return record


def _model(name: str, folder: Path) -> dict[str, Any]:
    """Read the training record of a model, without its weights."""
    path = folder / FACTS
    if not path.is_file():
        raise MissingError(
            f"not a model: no {FACTS}", where=folder, hint="Name a folder that falsework train has written"
        )
    stored = read_json(path)
    if not isinstance(stored, dict) or stored.get("format") != "falsework.model":
        raise InputError("not a model of Falsework", where=path, field="format", allowed="falsework.model")
    training = stored.get("training") or {}
    log = _log(folder / LOG)
    best = training.get("validation") or {}
    counted = list(zip(stored.get("classes", ()), training.get("training_points") or (), strict=False))
    tiles = [
        {"label": "network", "value": str(stored.get("network", "–"))},
        {"label": "epochs", "value": number(len(log)) if log else "–"},
        {"label": "best epoch", "value": number(_epoch_number(training.get("picked_epoch")))},
        {"label": "mean IoU on validation", "value": percent(best.get("miou"))},
        {"label": "bridges for training", "value": number(len(training.get("training_bridges", ())))},
        {"label": "bridges for validation", "value": number(len(training.get("validation_bridges", ())))},
    ]
    return {
        "name": name,
        "network": str(stored.get("network", "")),
        "log": log,
        "tiles": [tile for tile in tiles if tile["value"] != "–"],  # a forest has no epochs
        "bridges": {
            "was trained on": set(training.get("training_bridges", ())),
            "chose its epoch by": set(training.get("validation_bridges", ())),
            "began with a model that had seen": set(_mapping(stored.get("data")).get("earlier") or ()),
        },
        "classes": [[str(label), number(count)] for label, count in counted if count],
        "absent": ", ".join(str(label) for label, count in counted if not count),
        "settings": [
            ("training", settings_rows(_mapping(training.get("settings")))),
            ("network", settings_rows(_mapping(stored.get("settings")))),
            (
                "samples",
                settings_rows({key: value for key, value in _mapping(stored.get("data")).items() if key != "earlier"}),
            ),
        ],
    }


def _log(path: Path) -> list[dict[str, float | None]]:
    """Read the history: one row an epoch."""
    if not path.is_file():
        return []
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [{key: float(text) if text else None for key, text in row.items()} for row in csv.DictReader(file)]
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise InputError(f"not the log of a training: {error}", where=path) from None


def _curves(models: list[dict[str, Any]]) -> list[tuple[str, go.Figure]]:
    """Plot loss and validation over the epochs, one color for each model."""
    drawn = []
    for title, keys in (
        ("Loss of training", ("loss",)),
        ("Validation on whole bridges that were held out", ("miou", "accuracy", "mean_accuracy")),
    ):
        figure = go.Figure()
        for model, color in zip(models, SERIES * (len(models) // len(SERIES) + 1), strict=False):
            for key, dash in zip(keys, ("solid", "dot", "dash"), strict=False):
                known = [
                    (_epoch_number(row.get("epoch")), row[key]) for row in model["log"] if row.get(key) is not None
                ]
                if known:
                    words = {"miou": "mean IoU", "accuracy": "accuracy", "mean_accuracy": "mean accuracy"}.get(key, key)
                    figure.add_scatter(
                        x=[epoch for epoch, _ in known],
                        y=[value for _, value in known],
                        mode="lines+markers" if len(known) < 60 else "lines",
                        marker={"size": 5},
                        line={"color": color, "dash": dash},
                        name=escape(f"{_short(model['name'])}: {words}" if len(models) > 1 else words),
                    )
        if figure.data:
            plain_layout(figure, 340)
            scale = (
                {"title": "score", "range": [0, 1]} if keys[0] != "loss" else {"title": "loss", "rangemode": "tozero"}
            )
            last = max(len(model["log"]) for model in models)
            axis = {"title": "epoch", "dtick": max(-(-last // 10), 1)}
            drawn.append((title, figure.update_layout(xaxis=axis, yaxis=scale)))
    return drawn


def _short(name: str) -> str:
    """Shorten a name for a legend, which cuts off what is too long: the word behind it was lost."""
    return name if len(name) <= 2 * ENDS + 1 else f"{name[:ENDS]}…{name[-ENDS:]}"


def _epoch_number(epoch: float | None) -> int | None:
    """Number an epoch from 1; logs and models count from 0."""
    return None if epoch is None else int(epoch) + 1


def _scores(name: str, record: Mapping[str, Any], models: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Format one table of scores, with classes in the order of the confusion matrix."""
    names, classes, panoptic = list(record["class_names"]), record["classes"], record["panoptic"]
    seen = [k for k, one in enumerate(names) if classes[one]["points"] or any(row[k] for row in record["confusion"])]
    true = [k for k in seen if classes[names[k]]["points"]]
    return {
        "name": name,
        "tiles": _tiles(record),
        "notes": _notes(record, models),
        "classes": [
            {
                "name": names[k],
                "points": number(classes[names[k]]["points"]),
                "scores": [percent(classes[names[k]][key]) for key in SCORES],
                "share": 100.0 * (classes[names[k]]["iou"] or 0.0),
            }
            for k in seen
        ],
        "absent": ", ".join(one for k, one in enumerate(names) if k not in seen),
        "iou": {one: classes[one]["iou"] for one in names} | {"mean": record["mean_iou"]},
        "heads": [names[k] for k in seen],
        "matrix": [(names[line], [record["confusion_shares"][line][k] for k in seen]) for line in true],
        "frequent": _frequent_errors(record, names),
        "calibration": _calibration(record),
        "errors": _errors(record),
        "by_uncertainty": [
            [f"{limit:g} m", number(points), percent(value)]
            for limit, points, value in zip(
                *(record["by_uncertainty"][k] for k in ("thresholds", "points", "mean_iou")), strict=True
            )
        ],
        "panoptic": [
            (title, _instances(panoptic[key], names))
            for key, title in (
                ("parts", "connected parts of the true classes"),
                ("modelled", "components as they were modeled"),
            )
            if panoptic.get(key)
        ],
        "bridges": [
            [one[:12], number(row["points"]), percent(row["mean_iou"]), percent(row["overall_accuracy"])]
            for one, row in record["bridges"].items()
        ],
    }


def _tiles(record: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the main scores of a model, beside those of the simplest baseline."""
    largest, points = max(
        ((one, row["points"]) for one, row in record["classes"].items()), key=lambda pair: pair[1], default=("–", 0)
    )
    return [
        {
            "label": f"mean IoU of the {record['classes_averaged']} classes that occur",
            "value": percent(record["mean_iou"]),
        },
        {
            "label": f"the same for points up to {record['sure']['uncertainty']:g} m of uncertainty",
            "value": percent(record["sure"]["mean_iou"]),
        },
        {"label": "overall accuracy", "value": percent(record["overall_accuracy"])},
        {
            "label": f"accuracy if every point were {largest}",
            "value": percent(points / record["points"] if record["points"] else None),
        },
        {"label": "mean accuracy", "value": percent(record["mean_accuracy"])},
        {"label": "calibration error", "value": percent(record["calibration_error"])},
        {"label": "points, each scored once", "value": number(record["points"])},
        {"label": f"bridge{'s'[: len(record['bridges']) != 1]}", "value": number(len(record["bridges"]))},
    ]


def _notes(record: Mapping[str, Any], models: Sequence[Mapping[str, Any]]) -> list[str]:
    """List bridges that a model was both trained and scored on."""
    return [
        f"Model {model['name']} {what} {', '.join(sorted(one[:12] for one in known))}: its scores there are too good."
        for model in models
        for what, bridges in model["bridges"].items()
        if (known := bridges & record["bridges"].keys())
    ]


def _frequent_errors(record: Mapping[str, Any], names: Sequence[str]) -> list[list[str]]:
    """List the most frequent confusions: true class, predicted class, points, share."""
    pairs = [
        (count, i, j) for i, row in enumerate(record["confusion"]) for j, count in enumerate(row) if i != j and count
    ]
    return [
        [names[i], names[j], number(count), percent(record["confusion_shares"][i][j])]
        for count, i, j in sorted(pairs, key=lambda pair: (-pair[0], *pair[1:]))[:MOST_ERRORS]
    ]


def _calibration(record: Mapping[str, Any]) -> go.Figure | None:
    """Plot the accuracy against the confidence."""
    rows = [row for row in record.get("reliability", ()) if row["points"]]
    if not rows:
        return None
    figure = go.Figure()
    figure.add_scatter(x=[0, 1], y=[0, 1], mode="lines", line={"color": GRAY, "dash": "dot"}, name="calibrated")
    figure.add_scatter(
        x=[row["confidence"] for row in rows],
        y=[row["accuracy"] for row in rows],
        mode="lines+markers",
        marker={"color": SERIES[0], "size": [5 + 16 * (row["points"] / record["points"]) ** 0.5 for row in rows]},
        line={"color": SERIES[0]},
        name="this model",
        hovertemplate="confidence %{x:.2f}, correct %{y:.2f}<extra></extra>",
    )
    plain_layout(figure, 340)
    return figure.update_layout(
        xaxis={"title": "confidence of the model", "range": [0, 1]},
        yaxis={"title": "share that is correct", "range": [0, 1]},
    )


def _errors(record: Mapping[str, Any]) -> go.Figure | None:
    """Plot the share of errors among the points with the highest confidences."""
    if not record["coverage"]:
        return None
    figure = go.Figure(
        go.Scatter(
            x=record["coverage"], y=record["risk"], mode="lines+markers", line={"color": SERIES[0]}, marker={"size": 5}
        )
    )
    plain_layout(figure, 340)
    return figure.update_layout(
        xaxis={"title": "share of the points that is kept, by decreasing confidence"},
        yaxis={"title": "share of errors among them", "rangemode": "tozero"},
    )


def _instances(row: Mapping[str, Any], names: Sequence[str]) -> list[list[str]]:
    return [
        [
            name,
            *(number(one[word]) for word in ("true", "found", "matched")),
            *(percent(one[word]) for word in ("quality", "segmentation", "recognition")),
        ]
        for name in names
        if (one := row["classes"][name])["true"] + one["found"]
    ]


def _side_by_side(scored: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Compare the IoU of each class in all scores, one row each."""
    names = list(
        dict.fromkeys(name for one in scored for name, iou in one["iou"].items() if name != "mean" and iou is not None)
    )
    rows = [[name, *(percent(one["iou"].get(name)) for one in scored)] for name in [*names, "mean"]]
    figure = go.Figure()
    for one, color in zip(scored, SERIES * (len(scored) // len(SERIES) + 1), strict=False):
        values = [None if (value := one["iou"].get(name)) is None else 100.0 * value for name in names]
        figure.add_bar(
            x=values,
            y=[escape(name) for name in names],
            name=escape(_short(one["name"])),
            marker_color=color,
            orientation="h",
        )
    plain_layout(figure, 110 + (10 + 8 * len(scored)) * max(len(names), 1))
    return {
        "heads": ["class", *(one["name"] for one in scored)],
        "rows": rows,
        "figure": figure.update_layout(
            xaxis={"title": "IoU [%]", "range": [0, 100]},
            yaxis={"type": "category", "autorange": "reversed", "automargin": True, "dtick": 1},
            legend={"traceorder": "normal"},
            bargap=0.25,
        ),
    }


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
