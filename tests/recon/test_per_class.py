"""Points of each class: what stays and goes, along the bridge, against counting one by one."""

import numpy as np
import pytest

from recon.dense.pixel_fates import PIXEL_FATES
from recon.points.fates import FATES
from recon.truth.per_class import FEW, PIXEL_WORDS, describe_classes, lost_classes, scarce_classes_in_words
from recon.truth.windows import LENGTH, lay_windows
from usd_schemas.components import UNLABELED, class_rows

ROWS = class_rows()
BACKGROUND, ABUTMENT, BEARING = (
    next(row.id for row in ROWS if row.name == name) for name in ("background", "abutment", "bearing")
)


def strip(low: float, high: float, heading: float) -> np.ndarray:
    """Two triangles over a stretch of a bridge one meter wide: shape (2, 3, 3)."""
    flat = np.array([[[low, 0, 0], [high, 0, 0], [high, 1, 0]], [[low, 0, 0], [high, 1, 0], [low, 1, 0]]], float)
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    flat[..., :2] = flat[..., :2] @ turn.T + [300.0, -40.0]
    return flat


@pytest.mark.parametrize("heading", [0.0, 0.7, 1.5])
def test_windows_follow_the_bridge(heading: float) -> None:
    """A strip of 46 m has five windows whichever way it runs; what stands in each has its area there, and no more."""
    corners = np.concatenate([strip(0, 46, heading), strip(12, 12.5, heading), strip(-900, 900, heading)])
    classes = np.repeat(np.array([ABUTMENT, BEARING, BACKGROUND], np.uint8), 2)
    windows = lay_windows(corners, classes)
    assert windows is not None
    assert windows.count == 5
    np.testing.assert_allclose(windows.area[ABUTMENT], [10, 10, 10, 10, 6], atol=1e-3)
    assert windows.area[BEARING].argmax() == 1
    assert windows.area[BEARING].sum() == pytest.approx(0.5)
    assert windows.present[[BACKGROUND, ABUTMENT, BEARING]].sum(axis=1).tolist() == [0, 5, 1]
    along = np.array([-20.0, 0.5, 10.5, 25.0, 45.0, 70.0])
    points = np.column_stack([along * np.cos(heading) + 300, along * np.sin(heading) - 40, np.zeros(6)])
    assert windows.of(points).tolist() == [0, 0, 1, 2, 4, 4]
    assert lay_windows(corners[4:], classes[4:]) is None


def test_every_point_is_counted_once() -> None:
    """Kept, dropped by each reason and duplicates, for each class and window, against a loop."""
    rng = np.random.default_rng(3)
    count = 4000
    segment = rng.choice(np.array([BACKGROUND, ABUTMENT, BEARING, UNLABELED], np.uint8), count, p=[0.3, 0.4, 0.2, 0.1])
    fate = rng.integers(0, len(FATES), count).astype(np.uint8)
    copies = rng.integers(1, 4, count)
    coord = np.column_stack([rng.uniform(0, 30, count) ** 0.9 + 300, np.full(count, -39.5), np.zeros(count)])
    corners = np.concatenate([strip(0, 52, 0.0), strip(3, 18, 0.0)])
    windows = lay_windows(corners, np.repeat(np.array([ABUTMENT, BEARING], np.uint8), 2))
    assert windows is not None
    found = describe_classes(segment, fate, copies, coord, ROWS, windows)
    assert set(found["classes"]) >= {"background", "abutment", "bearing"}
    assert "deck" not in found["classes"]
    for row in ROWS:
        if row.name not in found["classes"]:
            continue
        told = found["classes"][row.name]
        mine = [point for point in range(count) if segment[point] == row.id]
        for number, name in enumerate(FATES):
            wanted = sum(fate[point] == number for point in mine)
            assert (told["kept"] if name == "kept" else told["dropped"][name]) == wanted
        assert told["dropped"]["duplicate"] == sum(copies[point] - 1 for point in mine)
        for window, inside in enumerate(told["in_windows"]):
            begin = LENGTH * window
            assert inside == sum(fate[point] == 0 and begin <= coord[point, 0] - 300 < begin + LENGTH for point in mine)
    assert found["windows"]["seen"] == [True, True, True, False, False]  # the flight went no farther
    assert (found["classes"]["abutment"]["windows"], found["classes"]["bearing"]["windows"]) == (3, 2)
    few = [inside < FEW for inside in found["classes"]["bearing"]["in_windows"][:2]]
    assert found["classes"]["bearing"]["few_in"] == sum(few)


def test_few_and_lost_are_named() -> None:
    """The class that is few most often comes first, over all clouds; lost is what the limit took by more than half."""
    rows = {
        "deck": {"windows": 3, "few_in": 0},
        "bearing": {"windows": 2, "few_in": 2},
        "abutment": {"windows": 3, "few_in": 1},
    }
    assert scarce_classes_in_words([{"classes": rows}, {"classes": rows}, {"points": 3}]) == (
        "fewer than 50 points in a window of 10 m: bearing in 4 of 4, abutment in 2 of 6"
    )
    assert scarce_classes_in_words([{"classes": {"deck": rows["deck"]}}]) == ""
    pixels = {
        "bearing": {"no_depth": 20, "views": 25, "seen_through": 0, "angle": 5, "in_points": 50},
        "deck": dict.fromkeys(PIXEL_FATES, 9),
    }
    other = {"bearing": {"no_depth": 30, "views": 10, "seen_through": 0, "angle": 0, "in_points": 10}}
    assert scarce_classes_in_words([{"classes": rows, "pixels": pixels}, {"classes": rows, "pixels": other}]) == (
        "fewer than 50 points in a window of 10 m: bearing in 4 of 4 (40% of its pixels are in points; main reason: "
        "no depth found), abutment in 2 of 6"
    )
    assert {*PIXEL_WORDS, "in_points"} == set(PIXEL_FATES)
    dropped = {"views": 40, "reprojection": 0, "duplicate": 900}
    table = {
        "half": {"kept": 10, "dropped": {**dropped, "deviation": 50}},
        "more": {"kept": 10, "dropped": {**dropped, "deviation": 51}},
    }
    assert lost_classes({"classes": table}) == ["more"]


def test_without_truth_all_are_unlabeled() -> None:
    """Real photographs have counts, and no windows."""
    nothing = np.full(5, UNLABELED, np.uint8)
    fate = np.array([0, 0, 3, 3, 3], np.uint8)
    found = describe_classes(nothing, fate, np.ones(5, np.int64), np.zeros((5, 3)), ROWS, None)
    assert found["windows"] is None
    assert found["classes"]["unlabelled"]["kept"] == 2
    assert lost_classes(found) == ["unlabelled"]
    assert scarce_classes_in_words([found]) == ""
