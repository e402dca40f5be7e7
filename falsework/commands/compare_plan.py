"""Plan of an experiment: missing results, hours and disk space; nothing is written."""

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np

from falsework.commands.comparison import Experiment, Job
from falsework.execution.costs import free_space
from falsework.execution.events import read_events
from learn.trained import FOREST

# CPU-seconds per unit of work, used until one was measured here: a sample of 4,096 points through a network, forwards
# and backwards or only forwards; the cutting of a cloud; the covariance features of a draw for a forest.
_SECONDS = {
    "noise": 30.0,
    "pieces": 15.0,
    f"training {FOREST}": 0.6,
    f"scores {FOREST}": 0.6,
    "training pointnet2-ssg": 0.22,
    "training pointnet2-msg": 0.5,
    "training pointnext-s": 0.3,
    "training pointnext-b": 1.0,
    "training randlanet": 0.53,
    "scores": 0.07,
    "training": 0.5,
}
_POINT_BYTES = 40.0  # [bytes] per cut point: position, label, uncertainty, and its rows in windows
_MODEL_BYTES = {FOREST: 30e6}
_NETWORK_BYTES, _SCORE_BYTES = 8e6, 2e4


def planned(experiment: Experiment) -> dict[str, Any]:
    """List existing and missing results.

    Args:
        experiment: The experiment.

    Returns:
        For JSON: `kinds`, each with the numbers of existing and missing results and the time to make these [s];
        `hours`, `bytes` and `free_bytes`; `known` is false if windows can only be counted after the bridges are
        cut.
    """
    store, settings = experiment.store, experiment.settings
    noise = experiment.noise_jobs()
    pieces = experiment.piece_jobs(noise)
    jobs = [*noise.values(), *pieces.values()]
    known = all(store.has(job.task) for job in pieces.values())
    if known:
        trials = experiment.trials(pieces, experiment.cut_scenes(pieces))
        jobs += {one.training.task.key: one.training for one in trials}.values()
        jobs += {job.task.key: job for one in trials for job in one.tests.values()}.values()
    rates = _rates(experiment)
    kinds: dict[str, dict[str, float]] = {}
    for job in jobs:
        _add(kinds, job.kind, store.has(job.task), _seconds(job.kind, job.work, settings.points, rates))
    if not known:
        count = sum(len(group) for group in settings.groups) * settings.seeds
        for model in settings.models:
            work = settings.forest_draws if model == FOREST else settings.samples_each * settings.looks
            for _ in range(count):
                _add(kinds, f"training {model}", False, _seconds(f"training {model}", work, settings.points, rates))
    missing = Counter({kind: int(row["make"]) for kind, row in kinds.items()})
    return {
        "kinds": kinds,
        "known": known,
        "hours": sum(row["seconds"] for row in kinds.values()) / 3600.0,
        "bytes": _bytes(experiment, [job for job in jobs if not store.has(job.task)], missing),
        "free_bytes": free_space(store.root),
    }


def plan_lines(found: dict[str, Any]) -> list[str]:
    """Format a plan as lines.

    Args:
        found: Of `planned`.
    """
    lines = [f"{'result':<24}{'there':>8}{'to make':>10}{'hours':>9}"]
    lines += [
        f"{kind:<24}{row['there']:>8.0f}{row['make']:>10.0f}{row['seconds'] / 3600:>9.2f}"
        for kind, row in found["kinds"].items()
    ]
    lines.append(
        f"about {found['hours']:.1f} h in one process, {found['bytes'] / 1e6:.0f} MB more of disk space, "
        f"{found['free_bytes'] / 1e6:.0f} MB are free"
    )
    if not found["known"]:
        lines.append("tests are counted after the bridges are cut into windows")
    return lines


def _rates(experiment: Experiment) -> dict[str, float]:
    """Compute the mean seconds per unit of work of each kind, from results in this folder."""
    seconds: Counter[str] = Counter()
    work: Counter[str] = Counter()
    for event in read_events(experiment.store.root):
        if event.get("made") is True and isinstance(event.get("work"), int | float) and event["work"] > 0:
            seconds[event["stage"]] += event["seconds"]
            work[event["stage"]] += event["work"]
    return {kind: seconds[kind] / work[kind] for kind in work}


def _seconds(kind: str, work: float, points: int, rates: dict[str, float]) -> float:
    if kind in rates:
        return work * rates[kind]
    share = points / 4096 if kind.startswith(("training", "scores")) else 1.0
    return work * share * _SECONDS.get(kind, _SECONDS.get(kind.partition(" ")[0], 0.5))


def _add(kinds: dict[str, dict[str, float]], kind: str, there: bool, seconds: float) -> None:
    row = kinds.setdefault(kind, {"there": 0, "make": 0, "seconds": 0.0})
    row["there" if there else "make"] += 1
    row["seconds"] += 0.0 if there else seconds


def _bytes(experiment: Experiment, missing: Iterable[Job], counts: Counter[str]) -> float:
    """Estimate the size of the missing results."""
    points = {(one.set, one.name): sum(_points(path) for path in one.clouds.values()) for one in experiment.bridges}
    cut = {job.task.key for job in missing if job.task.stage == "pieces"}
    total = 0.0
    if cut:
        total += _POINT_BYTES * float(np.mean(list(points.values()))) * len(cut)
    for kind, count in counts.items():
        if kind.startswith("training "):
            total += count * _MODEL_BYTES.get(kind.removeprefix("training "), _NETWORK_BYTES)
        elif kind.startswith("scores"):
            total += count * _SCORE_BYTES
    return total


def _points(cloud: Any) -> int:
    from groundwork.files import read_json

    stored = read_json(cloud / "cloud.json")
    count = stored.get("count", 0) if isinstance(stored, dict) else 0
    return count if isinstance(count, int) else 0
