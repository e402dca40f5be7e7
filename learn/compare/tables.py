"""The results of an experiment as a Markdown page."""

from collections.abc import Mapping, Sequence
from typing import Any

Row = Mapping[str, Any]


def page(record: Row) -> str:
    """Format an experiment as Markdown.

    Args:
        record: What `falsework compare` writes as JSON.

    Returns:
        Markdown that ends with a line feed.
    """
    lines = [f"# {record['title']}", "", *_caution(record), "", "## What was compared", ""]
    lines += [f"- {line}" for line in record["facts"]]
    lines += [
        "",
        "## Windows",
        "",
        "Training windows that each arm's clouds can show; all arms of a line's group are "
        "trained on those that are common to them.",
        "",
        *_losses(record),
        "",
    ]
    lines += [
        "## Scores",
        "",
        "Mean over the seeds (standard deviation); each seed scores the confusion matrix summed "
        "over the test bridges. A class that occurs nowhere has a dash and no part in a mean. *Sure*: over the points "
        "whose uncertainty is known and at most 0.1 m; the other columns count every point, however uncertain.",
        "",
    ]
    lines += [*_scores(record), *(_compared(record) if record["differences"] else [])]
    lines += [
        "## Confusion matrices",
        "",
        "True classes down, predicted ones across; shares of the true points [%], all seeds and bridges together.",
        "",
        *_matrices(record),
    ]
    lines += ["## How it was made", "", "```", record["command"], "```", ""]
    return "\n".join(lines)


def _compared(record: Row) -> list[str]:
    """Format the difference between two arms."""
    return [
        "## Differences",
        "",
        *_about_intervals(record),
        "",
        *_differences(record),
        "",
        "## Differences of the classes' IoU",
        "",
        "In brackets Wilcoxon's p over the test bridges, with Holm's correction.",
        "",
        *_class_differences(record),
        "",
    ]


def weakness(record: Row) -> str:
    """Describe what an experiment has too few of; empty where it has enough.

    Args:
        record: What `falsework compare` writes as JSON.
    """
    few = [_several(row["bridges"], "test bridge") for row in record["scores"] if row["bridges"] < 12]
    seeds = [_several(len(row["seeds"]), "seed") for row in record["scores"] if len(row["seeds"]) < 5]
    return ", ".join(dict.fromkeys([*few, *seeds]))


def _caution(record: Row) -> list[str]:
    """Warn before the figures what a small experiment cannot show."""
    found = weakness(record)
    if not found:
        return ["Bridges are the sampling unit: intervals hold for bridges like these."]
    return [
        f"**Weak figures: {found}.** A difference of three points needs some eight seeds and a dozen "
        "test bridges; the intervals show the uncertainty; they do not show which arm is better."
    ]


def _about_intervals(record: Row) -> list[str]:
    level = f"{100 * record['level']:g} %"
    return [
        "First minus second arm, in points of mean IoU. "
        f"*Interval*: {level}, seeds and bridges drawn anew, crossed ({record['draws']} draws), with Student's t for "
        f"the fewer of the two. *Over seeds*: {level}, paired t over the seeds on these bridges; it does not cover "
        "other bridges. *Wins*: seeds in which the first is better."
    ]


def _losses(record: Row) -> list[str]:
    rows = [
        [
            " · ".join(row["group"]),
            row["part"],
            row["bridges"],
            row["candidates"],
            row["valid"],
            row["common"],
            _percent(1.0 - row["common"] / row["valid"]) if row["valid"] else "–",
        ]
        for row in record["losses"]
    ]
    return _table(["group", "clouds", "bridges", "windows that any shows", "valid here", "common", "lost [%]"], rows)


def _scores(record: Row) -> list[str]:
    lines: list[str] = []
    classes = _present(record)
    for model, test, rows in _by(record["scores"]):
        first = rows[0]
        about = f"{_several(first['bridges'], 'bridge')}, {first['classes_averaged']} classes"
        lines += [f"**{model}**, tested on `{test}`, {about}:", ""]
        table = [
            [
                arm_name(row, record),
                _spread(row, "mean_iou"),
                _spread(row, "mean_accuracy"),
                _spread(row, "overall_accuracy"),
                _percent(row["sure_mean_iou"]),
                *(_percent(row["iou"][name]) for name in classes),
            ]
            for row in rows
        ]
        heads = [
            "trained on",
            "mean IoU",
            "mean accuracy",
            "accuracy",
            "mean IoU, sure",
            *(f"IoU {name}" for name in classes),
        ]
        lines += [*_table(heads, table), ""]
    return lines


def _differences(record: Row) -> list[str]:
    rows = [
        [
            row["model"],
            row["test"],
            f"{row['first']} − {row['second']}",
            points(row["difference"]),
            interval(row["interval"]),
            interval(row["over_seeds"]),
            f"{row['wins']} of {row['seeds']}",
            row["bridges"],
        ]
        for row in record["differences"]
    ]
    return _table(["model", "tested on", "arms", "difference", "interval", "over seeds", "wins", "bridges"], rows)


def _class_differences(record: Row) -> list[str]:
    rows = []
    for row in record["differences"]:
        cells = [of_class(row["classes"].get(name)) for name in _present(record)]
        rows.append([row["model"], row["test"], f"{row['first']} − {row['second']}", *cells])
    return _table(["model", "tested on", "arms", *_present(record)], rows)


def _matrices(record: Row) -> list[str]:
    lines: list[str] = []
    names = _present(record)
    places = [record["classes"].index(name) for name in names]
    for row in record["scores"]:
        lines += [f"{row['model']}, trained on {arm_name(row, record)}, tested on `{row['test']}`:", ""]
        cells = []
        for name, place in zip(names, places, strict=True):
            counts = row["confusion"][place]
            shares = (_percent(counts[k] / sum(counts)) if sum(counts) else "–" for k in places)
            cells.append([name, *shares, f"{sum(counts):,}"])
        lines += [*_table(["", *names, "points"], cells), ""]
    return lines


def _present(record: Row) -> list[str]:
    """List the classes that are true or predicted anywhere; the others would be columns of dashes."""
    return [name for name in record["classes"] if any(row["iou"][name] is not None for row in record["scores"])]


def _several(count: int, thing: str) -> str:
    return f"{count} {thing}" + ("" if count == 1 else "s")


def _by(rows: Sequence[Row]) -> list[tuple[str, str, list[Row]]]:
    keys = dict.fromkeys((row["model"], row["test"]) for row in rows)
    return [
        (model, test, [row for row in rows if (row["model"], row["test"]) == (model, test)]) for model, test in keys
    ]


def arm_name(row: Row, record: Row) -> str:
    """Format an arm's name; with several groups, also the arms that it shares its windows with.

    Args:
        row: One row of the results.
        record: Content of comparison.json.

    Returns:
        The name, such as `dense (mesh · dense)`.
    """
    return row["arm"] if len(record["groups"]) < 2 else f"{row['arm']} ({' · '.join(row['group'])})"


def _spread(row: Row, name: str) -> str:
    deviation = row[f"{name}_sd"]
    return _percent(row[name]) + ("" if deviation is None else f" ({100 * deviation:.1f})")


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f}"


def points(value: float | None) -> str:
    """Format a difference of two shares in percentage points.

    Args:
        value: The difference [1]; None: unknown.
    """
    return "–" if value is None else f"{100 * value:+.1f}"


def interval(ends: Sequence[float] | None) -> str:
    """Format a confidence interval of a difference in percentage points.

    Args:
        ends: Its ends [1]; None: unknown.
    """
    return "–" if ends is None else f"{points(ends[0])} to {points(ends[1])}"


def of_class(found: Row | None) -> str:
    """Format the difference of one class, and its p value.

    Args:
        found: `difference` [1] and `p` [1]; None: the class is absent.
    """
    return "–" if found is None else f"{points(found['difference'])} ({found['p']:.2f})"


def _table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    return lines + [f"| {' | '.join(str(cell) for cell in row)} |" for row in rows]
