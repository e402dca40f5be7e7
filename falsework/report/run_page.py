"""Report page of runs: scenes and stages, rejections and failures, points of each class, and times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from falsework.report.page import SERIES, number, settings_rows, write_page
from groundwork.progress import duration

MOST_ROWS = 400  # scenes in a table; of more, incomplete ones come first
MOST_BARS = 80  # scenes in the plot of times
LET_GO = "removed"  # made, used and removed, because `keep` does not name its stage


@dataclass(frozen=True)
class SceneRow:
    """Results of one scene of a run.

    Attributes:
        name: Its number.
        results: Number of existing results of each stage.
        clouds: Name of each cloud to the points of each class.
        cameras: Name of each cloud to the numbers of registered cameras and of all cameras.
        page: Link to its own page, or empty.
    """

    name: str
    results: Mapping[str, int]
    clouds: Mapping[str, Mapping[str, int]]
    cameras: Mapping[str, tuple[int, int]]
    page: str = ""


@dataclass(frozen=True)
class FailureRow:
    """Reason why a result does not exist.

    Attributes:
        scene: Number of its scene; empty if unknown.
        stage: Its stage.
        kind: `rejected` or `failed`.
        reason: Short code.
        message: One line.
        last_lines: Last lines of its process on standard error.
    """

    scene: str
    stage: str
    kind: str
    reason: str
    message: str
    last_lines: tuple[str, ...] = ()


@dataclass(frozen=True)
class Event:
    """The making of one result.

    Attributes:
        scene: Number of its scene.
        stage: Its stage.
        end: Time of its end [s].
        seconds: Duration [s].
        size: Disk space that it added [bytes].
    """

    scene: str
    stage: str
    end: float
    seconds: float
    size: int = 0


@dataclass(frozen=True)
class RunFacts:
    """Facts of one run.

    Attributes:
        name: Name of its folder.
        stages: Stages, in their order.
        wanted: Number of scenes in the scenario.
        scenes: Scenes with any result.
        failures: Tasks without result.
        events: Results made with their times, if times are wanted.
        settings: The scenario.
    """

    name: str
    stages: tuple[str, ...]
    wanted: int
    scenes: Sequence[SceneRow]
    failures: Sequence[FailureRow]
    events: Sequence[Event] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)


def write_run_page(path: Path, runs: Sequence[RunFacts]) -> None:
    """Write the page of one run, or of several side by side.

    Args:
        path: HTML file to write.
        runs: Facts of the runs.
    """
    write_page(
        path,
        "run.html.j2",
        title=" · ".join(run.name for run in runs),
        lead="run of scenes: results, rejections, points of each class, times",
        runs=[_run(run) for run in runs],
        side_by_side=_side_by_side(runs) if len(runs) > 1 else None,
    )


def _run(run: RunFacts) -> dict[str, Any]:
    failed = {row.scene for row in run.failures if row.scene}
    totals = _class_totals(run)
    classes = sorted((name for name, count in totals.items() if count), key=lambda name: -totals[name])
    shown = sorted(run.scenes, key=lambda scene: (scene.name not in failed, scene.name))[:MOST_ROWS]
    bad = {(row.scene, row.stage): row for row in run.failures}
    keep = run.settings.get("keep")
    rows = [
        {"name": scene.name, "page": scene.page, "cells": [_cell(scene, stage, bad, keep) for stage in run.stages]}
        for scene in sorted(shown, key=lambda scene: scene.name)
    ]
    return {
        "name": run.name,
        "tiles": _tiles(run),
        "stages": run.stages,
        "scenes": rows,
        "let_go": any(cell["text"] == LET_GO for row in rows for cell in row["cells"]),
        "left_out": len(run.scenes) - len(shown),
        "failures": run.failures,
        "classes": classes,
        "clouds": [
            [
                scene.name,
                name,
                _cameras(scene, name),
                number(sum(cloud.values())),
                *(number(cloud.get(one, 0)) for one in classes),
            ]
            for scene in sorted(shown, key=lambda scene: scene.name)
            for name, cloud in scene.clouds.items()
        ],
        "totals": ["all", "", "", number(sum(totals.values())), *(number(totals[name]) for name in classes)],
        "times": _times(run),
        "bars": _bars(run),
        "colors": dict(zip(run.stages, SERIES, strict=False)),
        "settings": [("scenario", settings_rows(run.settings))] if run.settings else [],
    }


def _class_totals(run: RunFacts) -> dict[str, int]:
    """Sum the points of each class over all clouds."""
    totals: dict[str, int] = {}
    for scene in run.scenes:
        for cloud in scene.clouds.values():
            for name, count in cloud.items():
                totals[name] = totals.get(name, 0) + count
    return totals


def _tiles(run: RunFacts) -> list[dict[str, str]]:
    counts = {
        kind: len({row.scene or number for number, row in enumerate(run.failures) if row.kind == kind})
        for kind in ("rejected", "failed")
    }
    points = sum(count for scene in run.scenes for cloud in scene.clouds.values() for count in cloud.values())
    tiles = [
        {"label": "scenes with results", "value": f"{len(run.scenes)} of {run.wanted}"},
        {"label": "rejected", "value": number(counts["rejected"])},
        {"label": "failed", "value": number(counts["failed"])},
        {"label": "clouds", "value": number(sum(len(scene.clouds) for scene in run.scenes))},
        {"label": "points", "value": number(points)},
    ]
    if run.events:
        tiles.append({"label": "working time", "value": duration(sum(event.seconds for event in run.events))})
    return tiles


def _cell(
    scene: SceneRow, stage: str, bad: Mapping[tuple[str, str], FailureRow], keep: Sequence[str] | None
) -> dict[str, str]:
    if (scene.name, stage) in bad:
        row = bad[scene.name, stage]
        return {"text": f"{row.kind}: {row.reason}", "look": "bad"}
    if count := scene.results.get(stage, 0):
        return {"text": "✓" if count == 1 else f"✓ {count}", "look": "good"}
    used = any(cameras for _, cameras in scene.cameras.values()) or (scene.name, "cloud") in bad
    let_go = used and stage in ("capture", "model") and keep is not None and stage not in keep
    return {"text": LET_GO if let_go else "–", "look": "soft"}


def _cameras(scene: SceneRow, name: str) -> str:
    good, every = scene.cameras.get(name, (0, 0))
    return f"{good} of {every}" if every else "–"


def _times(run: RunFacts) -> list[list[str]]:
    """Sum the times of each stage."""
    rows = []
    for stage in dict.fromkeys([*run.stages, *(event.stage for event in run.events)]):
        mine = [event for event in run.events if event.stage == stage]
        if mine:
            seconds = [event.seconds for event in mine]
            rows.append(
                [
                    stage,
                    number(len(mine)),
                    *(duration(value) for value in (sum(seconds), median(seconds), max(seconds))),
                    f"{sum(event.size for event in mine) / 1e6:,.0f} MB",
                ]
            )
    return rows


def _bars(run: RunFacts) -> dict[str, Any] | None:
    """Compute the bars of a timeline, one row for each scene."""
    if not run.events:
        return None
    first = min(event.end - event.seconds for event in run.events)
    whole = max(max(event.end for event in run.events) - first, 1e-9)
    names = sorted({event.scene for event in run.events})
    rows = [
        {
            "name": name,
            "bars": [
                {
                    "stage": event.stage,
                    "left": round(100.0 * (event.end - event.seconds - first) / whole, 3),
                    "width": round(max(100.0 * event.seconds / whole, 0.15), 3),
                    "words": f"{event.stage}: {duration(event.seconds)}",
                }
                for event in run.events
                if event.scene == name
            ],
        }
        for name in names[:MOST_BARS]
    ]
    return {"rows": rows, "whole": duration(whole), "left_out": len(names) - len(rows)}


def _side_by_side(runs: Sequence[RunFacts]) -> list[list[str]]:
    names = list(dict.fromkeys(tile["label"] for run in runs for tile in _tiles(run)))
    tiles = [{tile["label"]: tile["value"] for tile in _tiles(run)} for run in runs]
    rows = [[name, *(told.get(name, "–") for told in tiles)] for name in names]
    sums = [_class_totals(run) for run in runs]
    rows += [
        [f"points of {name}", *(number(told.get(name, 0)) for told in sums)]
        for name in dict.fromkeys(name for told in sums for name in told)
        if any(told.get(name, 0) for told in sums)
    ]
    return [["", *(run.name for run in runs)], *rows]
