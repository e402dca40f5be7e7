"""The benchmark on real scans counts what it says that it counts."""

import numpy as np
import pytest

from benchmarks.shipped.real_scans import figures_of
from benchmarks.shipped.scan_scores import Labeled
from learn.datasets.class_tables import class_table


def test_plausible_and_false_points_are_counted() -> None:
    """Of six points of a bridge three can be what they were called, five are any part; one of four others is false."""
    names = class_table("falsework").names
    said = [
        "column",
        "column",
        "pier_cap",
        "deck",
        "deck",
        "background",
        "background",
        "deck",
        "background",
        "background",
    ]
    found = np.array([names.index(name) for name in said])
    truth = np.array([1, 1, 1, 1, 1, 1, 0, 0, 0, 0])
    figures = figures_of(
        Labeled(np.zeros((10, 3)), {"falsework": truth}, {"falsework": found}, np.arange(10)), ("column", "pier_cap")
    )
    assert (figures.points, figures.on_bridge) == (10, 6)
    assert figures.plausible == pytest.approx(3 / 6)
    assert figures.any_part == pytest.approx(5 / 6)
    assert figures.false == pytest.approx(1 / 4)
    assert figures.most == {"column": 2 / 6, "deck": 2 / 6, "background": 1 / 6}


def test_a_scan_that_is_all_bridge_has_no_false_points() -> None:
    """Where all of a scan is a bridge, there is nothing that could be called one falsely."""
    labeled = Labeled(np.zeros((3, 3)), {"falsework": np.ones(3, int)}, {"falsework": np.zeros(3, int)}, np.arange(3))
    figures = figures_of(labeled, ("deck",))
    assert np.isnan(figures.false)
    assert (figures.plausible, figures.any_part) == (0.0, 0.0)
