"""Component kinds of points: a sorted list, and a row in it for every instance id."""

from __future__ import annotations

import numpy as np

from recon.truth.component_kinds import component_kinds, kind_rows
from usd_schemas.flat_scene import InstanceRow


def test_points_have_the_kind_of_their_instance() -> None:
    """Ids in any order and with gaps; no instance, an unknown one, and one without a kind are row 0."""
    kinds = {7: "pier", 2: "slab", 30: "", 4: "pier"}
    instances = [InstanceRow(number, f"/World/i{number}", kind, "") for number, kind in kinds.items()]
    assert component_kinds(instances) == ("", "pier", "slab")
    rows = kind_rows(np.array([0, 1, 2, 3, 4, 7, 30, 31], np.uint32), instances)
    assert rows.dtype == np.uint16
    assert rows.tolist() == [0, 0, 2, 0, 1, 1, 0, 0]


def test_without_instances_there_is_no_kind() -> None:
    """A scan of nothing known: one empty name, row 0 for all."""
    assert component_kinds(()) == ("",)
    assert kind_rows(np.array([0, 5], np.uint32), ()).tolist() == [0, 0]
