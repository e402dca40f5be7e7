"""Main cables between tower and anchor block: they have a corner where each hanger of their side span holds on."""

import numpy as np
import pytest

from tests.authoring.bridges.built import make_bridge


@pytest.mark.parametrize("side", ["L", "R"])
def test_side_cables_have_a_corner_at_each_hanger(side: str) -> None:
    """The clamp of each hanger in a side span is round a corner of the cable of that end, and of no other."""
    bridge = make_bridge(
        "suspension",
        3,
        service="road",
        roadway={"lanes": 2},
        grade=0.0,
        suspension={"size": "compact", "side_spans": "suspended"},
    )
    cables, bodies = bridge.drawn.record.cables, {member.name: member for member in bridge.members}
    stations = sorted((*cables.main_hangers, *cables.side_hangers))
    names = [name for name in bodies if name.startswith(f"Clamp_{side}")]
    assert len(names) == len(stations)
    corners = [bodies[f"MainCable_{piece}_{side}"].mesh.points.reshape(-1, 16, 3).mean(axis=1) for piece in range(3)]
    seen = [0, 0, 0]
    for station, name in zip(stations, names, strict=True):
        clamp = bodies[name].mesh.points[:64].mean(axis=0)
        near = [np.linalg.norm(points - clamp, axis=1).min() < 1e-6 for points in corners]
        piece = int(np.searchsorted(cables.towers, station))
        assert near == [piece == row for row in range(3)], name
        seen[piece] += 1
    assert min(seen) > 0
