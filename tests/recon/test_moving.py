"""Points on things that move have no distance to a surface that stands as at the first image."""

from pathlib import Path

import numpy as np

from recon.truth.surface_distance import without_moving
from render.capture import Truth
from usd_schemas.components import UNLABELED, class_rows
from usd_schemas.flat_scene import InstanceRow
from usd_schemas.pinhole import Pinhole


def test_points_on_what_moves_have_no_distance() -> None:
    """Distance and class are kept for what stands still, NaN and unlabelled for the rest."""
    rows = tuple(InstanceRow(number, f"/P{number}", "", "deck", moves=number == 2) for number in (1, 2, 3))
    truth = Truth(Path(), Pinhole(4, 4, 4.0, 4.0, 2.0, 2.0), (), np.zeros((0, 4, 4)), rows, class_rows())
    ids, distance, nearest = np.array([1, 2, 3, 2, 0], np.uint32), np.arange(5.0), np.full(5, 7, np.uint8)
    found, label = without_moving(ids, truth, distance, nearest)
    np.testing.assert_array_equal(found, [0.0, np.nan, 2.0, np.nan, 4.0])
    np.testing.assert_array_equal(label, [7, UNLABELED, 7, UNLABELED, 7])
