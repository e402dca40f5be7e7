"""What a page says follows from the trials: differences and intervals, what is too few, and no empty columns."""

import numpy as np
import pytest

from learn.compare.experiment import ExperimentSettings
from learn.compare.findings import Trial, findings
from learn.compare.statistics import crossed_bootstrap
from learn.compare.tables import page, weakness

CLASSES = ("background", "column", "arch")


def trial(arm: str, seed: int, bridges: int, right: int) -> Trial:
    """Give a trial that calls `right` of 100 points of either class so, in every bridge; arches occur nowhere."""
    group = ("a", "b")
    matrix = np.array([[right, 100 - right, 0], [100 - right, right, 0], [0, 0, 0]])
    every = {f"b{number}": matrix + number * np.diag([1, 1, 0]) for number in range(bridges)}
    sure = {name: np.diag([5, 0, 0]) for name in every}
    return Trial(group, "forest", arm, seed, "t", every, sure)


def record_of(arms: tuple[str, ...], seeds: int, bridges: int) -> dict[str, object]:
    """Sum up trials as the verb does, the second arm being ten points of a hundred worse."""
    settings = ExperimentSettings.model_validate(
        {"arms": {arm: ["c"] for arm in arms}, "tests": {"t": "c"}, "models": ["forest"], "draws": 200}
    )
    trials = [
        Trial(**{**vars(trial(arm, seed, bridges, 90 - 10 * place + seed)), "group": tuple(arms)})
        for place, arm in enumerate(arms)
        for seed in range(seeds)
    ]
    found = findings(trials, CLASSES, settings)
    return {
        "title": "T",
        "classes": list(CLASSES),
        "groups": [list(arms)],
        "level": 0.95,
        "draws": 200,
        "facts": ["f"],
        "losses": [],
        "command": "falsework compare",
        **found,
    }


def test_a_difference_is_that_of_the_matrices() -> None:
    """Ten points of a hundred: difference, wins and both intervals by the functions that other tests prove."""
    record = record_of(("a", "b"), 3, 4)
    (row,) = record["differences"]  # type: ignore[misc]
    stacks = [
        np.array([list(trial(arm, seed, 4, 90 - 10 * place + seed).bridges.values()) for seed in range(3)])
        for place, arm in enumerate("ab")
    ]
    wanted = crossed_bootstrap(stacks[0], stacks[1], 200, 0, level=0.95, corrected=True)
    assert row["difference"] == pytest.approx(wanted.mean)
    assert row["interval"] == pytest.approx([wanted.low, wanted.high])
    assert (row["wins"], row["seeds"], row["bridges"]) == (3, 3, 4)
    assert row["over_seeds"][0] <= row["difference"] <= row["over_seeds"][1]
    ious = [
        [(stack.sum(axis=0)[0, 0] / (stack.sum(axis=0)[0].sum() + stack.sum(axis=0)[1, 0])) for stack in both]
        for both in stacks
    ]
    assert row["classes"]["background"]["difference"] == pytest.approx(np.mean(ious[0]) - np.mean(ious[1]))
    assert "arch" not in row["classes"]


def test_a_page_has_no_empty_parts() -> None:
    """A class that occurs nowhere has no column, one arm no differences; sure points are scored apart."""
    record = record_of(("a", "b"), 3, 4)
    text = page(record)
    assert "arch" not in text
    assert "| a − b |" in text
    assert "## Differences" in text
    for row in record["scores"]:  # type: ignore[attr-defined]
        assert f"| {row['arm']} | {100 * row['mean_iou']:.1f} (" in text
    assert text.count("| 100.0 |") >= 2  # sure points: all right
    alone = page(record_of(("a",), 3, 1))
    assert "Differences" not in alone
    assert "1 bridge, " in alone


@pytest.mark.parametrize(
    ("seeds", "bridges", "few"),
    [(2, 3, "3 test bridges, 2 seeds"), (5, 12, ""), (1, 12, "1 seed"), (6, 1, "1 test bridge")],
)
def test_what_is_too_few_is_said(seeds: int, bridges: int, few: str) -> None:
    """Fewer than twelve bridges or five seeds, with one arm as with two."""
    for arms in (("a", "b"), ("a",)):
        record = record_of(arms, seeds, bridges)
        assert weakness(record) == few
        assert ("Weak figures" in page(record)) == bool(few)
