"""Lamp posts, scuppers, drain pipes and conduits: how many, where, and when there are none."""

import numpy as np
import pytest

from authoring.parts.fittings import _lamp, fitting_stations, lamp_stations
from authoring.parts.spans import Spans
from tests.authoring.bridges.built import STRAIGHT, Bridge, make_bridge

KINDS = ("lamp_post", "scupper", "drain_pipe", "conduit")


def fitted(**changes: object) -> Bridge:
    """A straight two-span road bridge with every fitting."""
    there = {"lamps": True, "drainage": True, "conduits": True, "lamp_pitch": 20.0, "scupper_pitch": 10.0}
    values = STRAIGHT | {"fittings": there, "service": "road", "beam": {"spans": [20.0, 25.0]}} | changes
    return make_bridge("beam", 4, **values)


def count(bridge: Bridge) -> dict[str, int]:
    """How many of each kind there are."""
    return {kind: sum(member.kind == kind for member in bridge.members) for kind in KINDS}


@pytest.mark.parametrize("pitch", [7.0, 15.0, 40.0])
def test_stations_keep_their_pitch_and_clear_the_joints(pitch: float) -> None:
    """No two neighbors further apart than the pitch, every span has one, none within 1 m of a support."""
    spans = Spans((0.0, 12.0, 41.0, 60.0), 0.4, 0.04)
    for stations in (fitting_stations(pitch, spans), lamp_stations(pitch, spans)):
        assert np.all(np.diff(stations) > 0.0)
        assert np.abs(stations[:, None] - spans.supports).min() >= 1.0 - 1e-9
        assert np.diff(stations).max(initial=0.0) <= pitch + 2.0
    assert np.all(np.diff(np.searchsorted(spans.supports, fitting_stations(pitch, spans))) <= 1)


def test_counts_follow_the_pitches() -> None:
    """45 m of road: three lamps a side, five scuppers along each kerb with a pipe each, a conduit for each deck."""
    bridge = fitted(roadway={"lanes": 4})
    assert count(bridge) == {
        "lamp_post": 6,
        "scupper": 10,
        "drain_pipe": 10,
        "conduit": len(bridge.drawn.record.spans.pieces),
    }
    assert count(fitted(roadway={"lanes": 1}))["lamp_post"] == 3  # a narrow road is lit from one side


def test_pipes_end_below_the_girders_and_lamps_reach_over_the_road() -> None:
    """A pipe hangs outside the deck and ends 15 cm under the soffit; a lamp stands behind the kerb, its head before."""
    bridge = fitted(roadway={"lanes": 4})
    beam, place = bridge.drawn.record, bridge.layout.alignment
    for member, points in zip(bridge.members, bridge.bridge_coordinates, strict=True):
        above = points[:, 2] - place.height(points[:, 0])
        if member.kind == "drain_pipe":
            assert above.min() == pytest.approx(beam.levels.girder_soffit - 0.15, abs=0.01)
            assert np.abs(points[:, 1]).min() == pytest.approx(0.5 * beam.top.width, abs=0.011)
        if member.kind == "lamp_post":
            assert above.max() == pytest.approx(beam.top.fittings.lamp_height, abs=0.4)
            assert np.abs(points[above < 0.5, 1]).min() > beam.top.kerb_face - 0.02
            assert np.abs(points[:, 1]).min() < beam.top.kerb_face


@pytest.mark.parametrize("pipe", [0.06, 0.09, 0.13, 0.16])
@pytest.mark.parametrize("conduit", [0.03, 0.06, 0.09, 0.10])
def test_drain_pipes_keep_clear_of_the_conduit(pipe: float, conduit: float) -> None:
    """Outlets cross over the conduit, pipes run down outside it, and it still lies against the deck's edge."""
    there = {"drainage": True, "scupper_pitch": 10.0, "pipe_diameter": pipe}
    bridge = fitted(fittings={**there, "conduits": True, "conduit_diameter": conduit, "lamps": False})
    beam, place = bridge.drawn.record, bridge.layout.alignment
    above = [p[:, 2] - place.height(p[:, 0]) for p in bridge.bridge_coordinates]
    out = [-p[:, 1] - 0.5 * beam.top.width for p in bridge.bridge_coordinates]
    kinds = [member.kind for member in bridge.members]
    conduits, pipes = ([n for n, kind in enumerate(kinds) if kind == key] for key in ("conduit", "drain_pipe"))
    top, outside = max(above[n].max() for n in conduits), max(out[n].max() for n in conduits)
    assert min(out[n].min() for n in conduits) == pytest.approx(-0.005, abs=0.002)
    assert top - 0.5 * conduit > beam.levels.soffit + 0.02  # beside the slab, not below it
    right = [n for n in pipes if out[n].max() > 0.0]
    assert len(right) == 5
    for n in right:
        stub = out[n] < 0.0
        assert stub.sum() == 12
        assert above[n][stub].min() > top + 0.001
        assert above[n][stub].max() < -beam.top.surfacing
        assert out[n][above[n] < top].min() > outside + 0.001


def test_the_arm_of_a_lamp_runs_from_its_column_into_its_head() -> None:
    """Nothing at the foot's axis is above the column, and the arm ends between bottom and top of the head."""
    points = _lamp(8.0, 1.5).points
    column = points[np.abs(points[:, 1]) < 0.09]
    assert column[:, 2].max() == pytest.approx(8.0)
    top = 8.0 - 0.06 + 0.12 * 1.5
    end = points[np.abs(points[:, 1] + 1.5) < 1e-9]
    assert len(end) == 8
    assert np.abs(end[:, 2] - top).max() == pytest.approx(0.025, abs=0.002)  # an octagon
    head = points[points[:, 1] < -1.9]
    np.testing.assert_allclose([head[:, 2].min(), head[:, 2].max()], [top - 0.05, top + 0.05], atol=0.021)


def test_railways_and_the_paper_have_none() -> None:
    """Nothing on a railway, nothing in profile paper unless it is asked for."""
    assert not any(count(make_bridge("beam", 4, service="rail_single")).values())
    assert not any(count(make_bridge("beam", 4, service="road", profile="paper")).values())
    asked = make_bridge("beam", 4, service="road", profile="paper", fittings={"drainage": True})
    assert count(asked)["scupper"] > 0
