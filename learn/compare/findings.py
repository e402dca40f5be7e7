"""Results of an experiment's trials: scores of each arm, and differences between arms with confidence intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.compare.experiment import ExperimentSettings
from learn.compare.statistics import class_iou, crossed_bootstrap, holm, paired_difference, signed_rank
from learn.metrics import known_or_none, scores

I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Trial:
    """Scores of one training in one test.

    Attributes:
        group: Arms that it shares its windows with.
        model: Network, or forest.
        arm: Name of the arm.
        seed: Seed of the training.
        test: Name of the test.
        bridges: Hash of each test bridge to its confusion matrix, shape (C, C), int64.
        sure: The same for the points with a small known uncertainty, shape (C, C), int64.
    """

    group: tuple[str, ...]
    model: str
    arm: str
    seed: int
    test: str
    bridges: Mapping[str, I64]
    sure: Mapping[str, I64]


def findings(trials: Sequence[Trial], classes: Sequence[str], settings: ExperimentSettings) -> dict[str, Any]:
    """Summarize an experiment.

    Args:
        trials: All of its trials.
        classes: Names of the classes.
        settings: The experiment.

    Returns:
        A record for JSON: `scores`, a row for each group, model, arm and test, and `differences`, one for each group,
        model, pair and test.
    """
    rows, differences = [], []
    for group in settings.groups:
        for model in settings.models:
            for test in settings.tests:
                mine = {
                    arm: [
                        one for one in trials if (one.group, one.model, one.arm, one.test) == (group, model, arm, test)
                    ]
                    for arm in group
                }
                rows += [_scores(own, classes) for own in mine.values() if own]
                for first, second in settings.compared:
                    if first in group and second in group and mine[first] and mine[second]:
                        differences.append(_difference(mine[first], mine[second], classes, settings))
    return {"scores": rows, "differences": differences}


def _scores(trials: Sequence[Trial], classes: Sequence[str]) -> dict[str, Any]:
    """Score each arm: mean over the seeds, each from the matrix summed over the bridges."""
    nothing = np.zeros((len(classes),) * 2, np.int64)
    sums = [sum(trial.bridges.values(), nothing) for trial in trials]
    sure = _mean([scores(sum(trial.sure.values(), nothing)).mean_iou for trial in trials])
    found = [scores(matrix) for matrix in sums]
    several = {
        name: [getattr(one, name) for one in found] for name in ("mean_iou", "mean_accuracy", "overall_accuracy")
    }
    total = np.sum(sums, axis=0)
    whole = scores(total)
    deviations = {
        f"{name}_sd": known_or_none(np.std(values, ddof=1)) if len(values) > 1 else None
        for name, values in several.items()
    }
    return {
        **_names(trials[0]),
        "arm": trials[0].arm,
        "seeds": [trial.seed for trial in trials],
        "bridges": len(trials[0].bridges),
        **{name: known_or_none(np.mean(values)) for name, values in several.items()},
        **deviations,
        "sure_mean_iou": known_or_none(sure),
        "classes_averaged": whole.classes_averaged,
        "iou": {name: known_or_none(_mean([one.iou[k] for one in found])) for k, name in enumerate(classes)},
        "accuracy": {name: known_or_none(_mean([one.accuracy[k] for one in found])) for k, name in enumerate(classes)},
        "confusion": total.tolist(),
    }


def _difference(
    first: Sequence[Trial], second: Sequence[Trial], classes: Sequence[str], settings: ExperimentSettings
) -> dict[str, Any]:
    """Compute the difference of two arms over their common seeds and bridges."""
    seeds = sorted({one.seed for one in first} & {one.seed for one in second})
    bridges = sorted(first[0].bridges.keys() & second[0].bridges.keys())
    stacks = [
        np.array([[_of(trials, seed).bridges[bridge] for bridge in bridges] for seed in seeds])
        for trials in (first, second)
    ]
    record: dict[str, Any] = {
        **_names(first[0]),
        "first": first[0].arm,
        "second": second[0].arm,
        "seeds": len(seeds),
        "bridges": len(bridges),
    }
    whole = [[scores(matrix.sum(axis=0)).mean_iou for matrix in stack] for stack in stacks]
    record["difference"] = float(np.mean(whole[0]) - np.mean(whole[1]))
    record["wins"] = int(np.sum(np.array(whole[0]) > np.array(whole[1])))
    record["over_seeds"] = record["interval"] = record["bootstrap_sd"] = None
    if len(seeds) > 1:
        over = paired_difference(np.array(whole[0]), np.array(whole[1]), settings.level)
        record["over_seeds"] = [over.low, over.high]
    if len(seeds) > 1 and len(bridges) > 1:
        both = crossed_bootstrap(
            stacks[0], stacks[1], settings.draws, settings.split_seed, level=settings.level, corrected=True
        )
        record["interval"], record["bootstrap_sd"] = [both.low, both.high], both.deviation
    record["classes"] = _classes(stacks[0], stacks[1], classes)
    return record


def _classes(first: I64, second: I64, classes: Sequence[str]) -> dict[str, Any]:
    """Compute the difference of each class's IoU, and Wilcoxon's p value over the bridges with Holm's correction."""
    ious = [class_iou(stack.sum(axis=1)) for stack in (first, second)]
    of_bridges = [class_iou(stack.sum(axis=0)) for stack in (first, second)]
    found = {}
    asked = [k for k in range(len(classes)) if not np.isnan(of_bridges[0][:, k] - of_bridges[1][:, k]).all()]
    p_values = holm([signed_rank(of_bridges[0][:, k], of_bridges[1][:, k]) for k in asked])
    for k, p in zip(asked, p_values, strict=True):
        found[classes[k]] = {"difference": known_or_none(_mean(ious[0][:, k]) - _mean(ious[1][:, k])), "p": p}
    return found


def _of(trials: Sequence[Trial], seed: int) -> Trial:
    return next(one for one in trials if one.seed == seed)


def _names(trial: Trial) -> dict[str, Any]:
    return {"group": list(trial.group), "model": trial.model, "test": trial.test}


def _mean(values: Any) -> float:
    known = np.array(values, np.float64)
    known = known[~np.isnan(known)]
    return float(known.mean()) if len(known) else float("nan")
