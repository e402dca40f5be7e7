"""Memory of a prediction: forecast from the occupied cubes and the classes, and refused before the work."""

from __future__ import annotations

import tracemalloc
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.errors import InputError
from learn.datasets.settings import TileSettings
from learn.datasets.voxels import add_points, empty_cloud, lay_grid
from learn.instances import connected_parts
from learn.predict.predict import check_memory, memory_needed, predict_scan, vote
from learn.predict.settings import PredictSettings
from learn.sample import Sample
from tests.learn.oracle_model import ColorModel, color_model
from tests.learn.test_predict import lattice, write_las


@dataclass
class Undecided(ColorModel):
    """A model to which all classes are equally likely, and that keeps no sample."""

    def probabilities(self, samples: Sequence[Sample]) -> list[NDArray[np.float32]]:
        """Give the same for every point.

        Args:
            samples: Clouds.
        """
        return [np.full((self.points, len(self.classes)), 1.0 / len(self.classes), np.float32) for _ in samples]


@pytest.mark.parametrize(("count", "classes"), [(20_000, 17), (60_000, 4)])
def test_the_forecast_of_memory_holds(count: int, classes: int) -> None:
    """Points that do not thin, all of one class: votes and instances need what is forecast, at most twice as little."""
    rng = np.random.default_rng(0)
    side = np.sqrt(count / 4.0)  # [m] as an airborne scan of 4 points/m2
    cloud = add_points(empty_cloud(lay_grid(np.zeros(3), np.full(3, 400.0), 0.1)), rng.random((count, 3)) * side, {})
    names = tuple(f"c{number}" for number in range(classes))
    model = Undecided(names, channels=("x", "y", "z", "height"), tile=TileSettings(voxel=0.1))
    tracemalloc.start()
    ids = vote(cloud, model, 8).argmax(axis=1).astype(np.uint8) * 0
    connected_parts(cloud.coord, ids, 0.3, 5, ())
    peak = tracemalloc.get_traced_memory()[1] / 1e9
    tracemalloc.stop()
    assert 0.5 * memory_needed(len(cloud), classes) < peak <= memory_needed(len(cloud), classes)


def test_a_scan_that_does_not_fit_is_refused_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line names the points that do not thin, the classes, and both memories; nothing is asked or written."""
    coord, color = lattice(400)
    scan = write_las(tmp_path / "in.las", coord, color)
    monkeypatch.setattr("learn.predict.predict.available_memory", lambda: 1e-6)
    model = color_model()
    with pytest.raises(
        InputError, match=r"in\.las: after thinning, its \d+ points and 5 classes need 0\.0 GB.*available"
    ):
        predict_scan(scan, tmp_path / "out.las", model, PredictSettings(unit="m"))
    assert model.seen == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.las"]
    check_memory(1_000, 4, memory_needed(1_000, 4), "in.las")
