"""Main cables, hangers, stays and anchor blocks against the forces in them, by closed forms."""

from typing import Any

import numpy as np
import pytest

from authoring.families.cable_stayed import DrawnCableStayed
from authoring.families.suspension import DrawnSuspension
from authoring.parts.cable_forces import hanger_diameter, main_cable
from authoring.parts.suspension_cables import anchorage_volume
from groundwork.errors import InputError
from tests.authoring.bridges.built import make_bridge
from tests.authoring.bridges.invariants import no_collision, nothing_floats
from tests.authoring.bridges.test_cables import ROAD, hung, record_of

SLOPE_STEP = 1e-4  # [m] beside a tower


def load_of(record: Any) -> float:
    """Weight of the deck and of a queue of vehicles on it [kN/m]: 25 kN/m3 of concrete, 3.0 and 3.5 kN/m2."""
    return record.deck.width * (25.0 * (record.deck.slab + record.top.surfacing) + 3.0 + 3.5)


def test_a_cable_by_hand() -> None:
    """100 kN/m on 400 m with a sag of 40 m: H is 50 MN and the cable's own weight, T is 1.077 H, 680 MPa at most."""
    cable = main_cable(100.0, 400.0, 40.0, 0.4, 0.14)
    area = 0.8 * np.pi * cable.diameter**2 / 4.0
    assert cable.pull == pytest.approx((100.0 + 78.5 * area) * 500.0, rel=1e-5)
    assert 650.0 < 1e-3 * cable.pull * np.hypot(1.0, 0.4) / area <= 680.0
    assert main_cable(100.0, 400.0, 40.0, 0.4, 0.6).diameter == 0.6
    hanger = hanger_diameter(100.0, 10.0)
    assert 500.0 < 1.0 / (0.62 * np.pi * hanger**2 / 4.0) <= 600.0  # 1 MN


@pytest.mark.parametrize("seed", range(24))
def test_no_drawn_cable_is_overstressed(seed: int) -> None:
    """Main cables have at most 680 MPa at the towers by H = w L^2 / (8 f), hangers 600 MPa."""
    record: DrawnSuspension = record_of("suspension", seed)
    cables, load = record.cables, 0.5 * load_of(record)
    area = 0.8 * np.pi * cables.diameter**2 / 4.0
    first, last = cables.towers
    pull = (load + 78.5 * area) * (last - first) ** 2 / (8.0 * cables.sag)
    assert cables.pull == pytest.approx(pull, rel=1e-4)
    at = first + SLOPE_STEP * np.array([-2.0, -1.0, 1.0, 2.0])
    slopes = np.abs(np.diff(cables.height(at))[[0, 2]]) / SLOPE_STEP
    assert 1e-3 * pull * np.hypot(1.0, slopes).max() / area <= 680.5
    pitches = [np.diff(cables.main_hangers)]
    pitches += [np.diff([s for s in cables.side_hangers if s < first])] if cables.side_hangers else []
    hanger = 0.62 * np.pi * cables.hanger_diameter**2 / 4.0
    assert 1e-3 * load * np.concatenate(pitches).max() / hanger <= 600.5


@pytest.mark.parametrize("seed", range(24))
def test_no_drawn_stay_is_overstressed(seed: int) -> None:
    """Stays in the main span have at most 0.45 of 1770 MPa, the steel 0.55 of their section."""
    record: DrawnCableStayed = record_of("cable_stayed", seed)
    stays = record.stays
    pitches = np.gradient(stays.offsets)
    runs = np.array(stays.offsets) - [record.pylon.face(height) for height in stays.heights]
    angles = np.arctan2(np.array(stays.heights) - stays.foot, runs)
    tensions = load_of(record) / stays.planes * pitches / np.sin(angles)
    assert 1e-3 * tensions.max() / (0.55 * np.pi * stays.diameter**2 / 4.0) <= 0.45 * 1770.0


def test_what_the_user_sets_stays() -> None:
    """Diameters of hangers and stays that a user sets are kept, however thin; main cables may be made thicker."""
    for seed in range(4):
        thin = {"suspension": {"hanger_diameter": 0.025, "size": "realistic"}}
        assert record_of("suspension", seed, thin).cables.hanger_diameter == 0.025
        thick = record_of("suspension", seed, {"suspension": {"cable_ratio": 800.0, "main": 400.0}})
        assert thick.cables.diameter >= 0.5
        assert record_of("cable_stayed", seed, {"cable_stayed": {"stay_diameter": 0.05}}).stays.diameter == 0.05


EXTREMES: list[dict[str, Any]] = [
    {"main": 1000.0, "sag_ratio": 0.05, "size": "realistic", "pitch": 20.0},
    {"main": 1000.0, "sag_ratio": 0.05, "size": "realistic", "pitch": 20.0, "side_spans": "suspended"},
    {"main": 60.0, "sag_ratio": 0.25, "size": "realistic", "pitch": 1.5, "side_spans": "suspended"},
    {"main": 60.0, "sag_ratio": 0.05, "size": "compact", "pitch": 1.5, "leg": 0.7},
]


@pytest.mark.parametrize("own", EXTREMES)
def test_saddles_clamps_and_blocks_have_room(own: dict[str, Any]) -> None:
    """At the extremes of span, sag and pitch nothing collides, and a saddle is no longer than its tower's top."""
    bridge = make_bridge("suspension", 3, **ROAD, suspension=own)
    record: DrawnSuspension = bridge.drawn.record
    cables = record.cables
    length, width, _ = cables.saddle_size
    assert length <= record.tower.length - 0.09
    assert width <= record.tower.width
    clamp = 0.16 + 1.2 * cables.diameter
    beside = np.abs(np.subtract.outer((*cables.main_hangers, *cables.side_hangers), cables.towers)).min()
    assert beside - 0.5 * (length + clamp) > 0.1
    assert np.diff(cables.main_hangers).min() - clamp > 0.1
    inner, outer = cables.block_sides
    assert min(cables.plane - inner, outer - cables.plane) > 0.9 * cables.diameter + 0.06
    assert no_collision(bridge) == []
    assert nothing_floats(bridge) == []


def test_hangers_too_close_for_their_clamps() -> None:
    """A pitch below the length of the clamps is refused with the least that fits; that one is drawn."""
    wide = {"service": "road", "roadway": {"lanes": 6}, "grade": 0.0}
    own = {"main": 1000.0, "sag_ratio": 0.05, "size": "realistic", "side_spans": "straight"}
    with pytest.raises(InputError, match=r"bridge\.suspension\.pitch: .*clamps") as caught:
        record_of("suspension", 3, {**wide, "suspension": {**own, "pitch": 1.5}})
    least = float(str(caught.value).split("at least ")[1].split(" m")[0])
    record = record_of("suspension", 3, {**wide, "suspension": {**own, "pitch": least}})
    assert 0.16 + 1.2 * record.cables.diameter < np.diff(record.cables.main_hangers).min() < least + 0.05


def test_anchor_blocks_hold_their_cables() -> None:
    """Friction and earth on 0.8 of a block's weight hold the pull of a parabola under half the deck, 1.3 times."""
    for seed in (2, 3):
        bridge = hung(seed)
        record: DrawnSuspension = bridge.drawn.record
        cables = record.cables
        load = 0.5 * load_of(record) + 78.5 * 0.8 * np.pi * cables.diameter**2 / 4.0  # [kN/m] of one cable
        pull = load * record.choice.main**2 / (8.0 * (cables.crown - cables.low))
        assert cables.pull == pytest.approx(pull, rel=1e-3)
        assert 0.8 * 24.0 * anchorage_volume(pull) == pytest.approx(1.3 * pull)
        blocks = [n for n, member in enumerate(bridge.members) if member.kind == "anchor_block"]
        assert len(blocks) == 4
        for number in blocks:
            assert 0.8 * 24.0 * bridge.volumes[number] > 1.3 * pull
