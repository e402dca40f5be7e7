"""Noisy shares, precision and recall of a handful of points counted by hand."""

import numpy as np
import pytest

from benchmarks.recon.noise import noise_page
from recon.truth.noise_figures import describe_noise


def columns_of(uncertainty: list[float], surface: list[float], displacement: list[float]) -> dict[str, np.ndarray]:
    """Make the three columns."""
    names = ("uncertainty", "surface_distance", "displacement")
    return {
        name: np.array(values, np.float32)
        for name, values in zip(names, (uncertainty, surface, displacement), strict=True)
    }


def test_figures_are_counted_by_hand() -> None:
    """Three of six are noisy, sky among them; each share follows."""
    columns = columns_of(
        [0.01, 0.05, 0.2, 0.3, np.inf, 0.02], [0.01, 0.2, 0.3, 0.01, 0.5, 0.02], [0.2, 0.3, 0.4, 0.5, np.inf, 0.01]
    )
    figures = describe_noise(columns, np.array([1.0, 7.99, 8.0, 15.0, 50.0, 3.0]))
    assert figures is not None
    assert [row["points"] for row in figures["by_distance"]] == [3, 1, 1, 1]
    assert [row["noisy_share"] for row in figures["by_distance"]] == [0.0, 1.0, 1.0, 1.0]
    assert figures["against_surface_distance"] == {"precision": pytest.approx(2 / 3), "recall": pytest.approx(2 / 3)}
    assert figures["against_displacement"] == {"precision": 1.0, "recall": pytest.approx(3 / 5)}
    assert figures["by_distance"][-1]["to"] is None  # JSON has no infinity
    page = noise_page([("six points", {**figures, "points": 6, "mode": "sparse", "same_class": None})])
    assert "| six points | sparse | 50.0% | 6 | 0.0% of 3 | 100.0% of 1 | 100.0% of 1 | 100.0% of 1 |" in page
    assert "| six points | sparse | 60.0% | 66.7% | 66.7% |  |" in page


def test_nothing_noisy_and_nothing_known() -> None:
    """Shares of nothing are unknown, and so is everything without truth."""
    figures = describe_noise(columns_of([0.01], [0.01], [0.01]), np.array([2.0]))
    assert figures is not None
    assert figures["against_displacement"] == {"precision": None, "recall": None}
    assert figures["by_distance"][2]["noisy_share"] is None
    nan = [np.nan]
    assert describe_noise(columns_of(nan, nan, nan), np.array([2.0])) is None
