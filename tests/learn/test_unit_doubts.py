"""A scan that is read in a wrong unit is named before the work, which would take hours."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from groundwork.errors import InputError
from groundwork.progress import Silent
from learn.predict import predict
from learn.predict.predict import predict_scan
from learn.predict.settings import PredictSettings
from learn.predict.unit_doubts import spread_doubt, unit_doubts
from tests.learn.oracle_model import ColorModel

BOX = np.random.default_rng(3).uniform((0.0, 0.0, 0.0), (60.0, 12.0, 8.0), (4000, 3))  # [m] mean distance 0.6


def test_millimeters_as_meters_are_doubted() -> None:
    """By the extent, or by the distance of the points, which a slow search confirms; never a bridge in its own unit."""
    assert spread_doubt(BOX, len(BOX), 1.0) == ""
    assert spread_doubt(BOX[:1] * 1000.0, 1, 1.0) == ""
    doubt = spread_doubt(BOX * 1000.0, len(BOX), 1.0)
    assert doubt.startswith(f"its points extend over {np.ptp(BOX[:, 0]) * 1000.0:,.0f} m, with a median distance of ")
    assert doubt.endswith(" m to the nearest one: check the unit of 1 m (--unit)")
    rows = np.linspace(0, len(BOX) - 1, 64).astype(int)
    gaps = np.linalg.norm(BOX[rows, None] - BOX[None], axis=2)
    gaps[np.arange(64), rows] = np.inf
    assert f" {np.median(gaps.min(axis=1)) * 1000.0:.1f} m to the nearest" in doubt
    wide = spread_doubt(BOX * 1000.0, 10 * len(BOX), 1.0)  # long, but most points share their cubes
    assert "median" not in wide
    assert wide.endswith("check the unit of 1 m (--unit), or for a stray point")
    assert "median" in spread_doubt(BOX * 25.4, len(BOX), 0.0254)  # a bridge of 1.5 km, points 15 m apart


def test_the_distance_of_points_needs_little_memory() -> None:
    """Two numbers a point, whatever the number of points that are looked at."""
    coord = np.random.default_rng(5).uniform(0.0, 1000.0, (100_000, 3))
    tracemalloc.start()
    try:
        spread_doubt(coord, len(coord), 1.0)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 2.5 * 8 * len(coord)


def test_memory_is_checked_before_the_distances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scan that does not fit is refused before anything is computed of all its points."""
    np.save(tmp_path / "a.npy", np.column_stack([BOX[:40], np.full((40, 3), 64.0)]))
    monkeypatch.setattr(predict, "available_memory", lambda: 0.0)
    monkeypatch.setattr(predict, "note_spread", lambda *given: pytest.fail("computed first"))
    with pytest.raises(InputError, match="of memory"):
        predict_scan(tmp_path / "a.npy", tmp_path / "b.npy", ColorModel(), PredictSettings(unit="m", fewest=1))


@pytest.mark.parametrize(("seen", "said"), [(1, True), (7, True), (8, False)])
def test_meters_as_millimeters_are_doubted(seen: int, said: bool) -> None:
    """Thinning leaves fewer than 2 of 1000 points."""
    few = (f"thinning left only {seen} of 4000 points: check the unit",) if said else ()
    assert unit_doubts("", seen, 4000) == few
    assert unit_doubts("feet?", seen, 4000) == ("feet?", *few)


def test_the_doubt_comes_before_the_work(tmp_path: Path) -> None:
    """One line that names the file, the extent and the option, when the model has not been asked yet."""
    model, before, notes = ColorModel(), 0, list[tuple[int, str]]()

    class Listener(Silent):
        def note(self, message: str) -> None:
            """Keep the line, and what the model had seen by then."""
            notes.append((len(model.seen), message))

    for name, scale in (("m", 0.1), ("mm", 1000.0)):
        table = np.column_stack([BOX[:40] * scale, np.full((40, 3), 64.0)])
        np.save(tmp_path / f"{name}.npy", table)
        settings = PredictSettings(unit="m", fewest=1)
        predict_scan(tmp_path / f"{name}.npy", tmp_path / f"{name}-out.npy", model, settings, Listener())
        assert len(notes) == (name == "mm"), notes
        before = before if notes else len(model.seen)
    ((seen, line),) = notes
    assert line.startswith("warning: mm.npy: its points extend over ")
    assert line.endswith("(--unit)")
    assert "\n" not in line
    assert seen == before < len(model.seen)
