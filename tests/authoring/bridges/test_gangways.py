"""Inspection gangways below box decks: which bridges have them, and the room round each."""

from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment
from authoring.families.bridge_settings import draw_layout
from authoring.parts.gangways import DEEPEST, GAP, HEADROOM, OVER_GROUND, WIDTH, gangway_parts
from authoring.streams import stream
from tests.authoring.bridges.built import Bridge, make_bridge, settings_of
from tests.authoring.bridges.kernels import touching

FAMILIES = ("cable_stayed", "suspension")
_APART = 0.02  # [m] between a gangway and everything but the box that it hangs from


def with_gangways(family: str, seed: int, clearance: float = 9.0, **own: Any) -> Bridge:
    """Build a bridge on a box with gangways."""
    return make_bridge(
        family, seed, clearance=clearance, **{family: {"deck": "steel_box", "main": 120.0, "gangways": True, **own}}
    )


def gangways(bridge: Bridge) -> list[int]:
    """Numbers of the gangways among the members."""
    return [n for n, member in enumerate(bridge.members) if member.kind == "inspection_gangway"]


@pytest.mark.parametrize(("family", "seed"), [("cable_stayed", 3), ("cable_stayed", 14), ("suspension", 3)])
def test_gangways_keep_clear_of_everything_else(family: str, seed: int) -> None:
    """Each triangle of a gangway is 20 mm or more from each of any other member, but for the box that it hangs from."""
    bridge = with_gangways(family, seed)
    found = gangways(bridge)
    assert found
    assert {"access_hatch", "pylon_beam" if family == "cable_stayed" else "tower_beam"} <= {
        member.kind for member in bridge.members
    }
    others = [n for n, member in enumerate(bridge.members) if n not in found and member.kind != "box_girder"]
    pairs = np.array([(number, other) for number in found for other in others])
    near = touching(bridge.corners, bridge.low, bridge.high, bridge.first, bridge.boxes, pairs, _APART)
    assert not near.any(), [(bridge.members[i].name, bridge.members[j].name) for i, j in pairs[near]]
    for number in found:
        assert {bridge.members[n].kind for n in bridge.neighbors[number]} == {"box_girder"}


@pytest.mark.parametrize(
    ("family", "seed", "clearance"),
    [("cable_stayed", 3, 9.0), ("cable_stayed", 14, 7.0), ("suspension", 3, 9.0), ("suspension", 2, 6.8)],
)
def test_gangways_end_before_supports_and_over_high_ground(family: str, seed: int, clearance: float) -> None:
    """Nothing that carries the deck lies beside a gangway or closer to its ends than the gap; there is air below it."""
    bridge = with_gangways(family, seed, clearance)
    record = bridge.drawn.record
    floor = record.levels.girder_soffit - HEADROOM
    ranges = []
    for number in gangways(bridge):
        points, world = bridge.bridge_coordinates[number], bridge.members[number].mesh.points
        above = points[:, 2] - bridge.layout.alignment.height(points[:, 0])
        assert above.min() == pytest.approx(floor + DEEPEST, abs=0.005)
        assert above.max() == pytest.approx(record.levels.girder_soffit, abs=0.01)
        ranges.append((float(points[:, 0].min()), float(points[:, 0].max())))
        assert (world[:, 2] - bridge.ground(world[:, :2])).min() > OVER_GROUND - 0.05
    assert ranges
    assert ranges == sorted(ranges)
    for support in bridge.layout.supports:
        assert all(support < low or support > high for low, high in ranges)
    for member, points in zip(bridge.members, bridge.bridge_coordinates, strict=True):
        above = points[:, 2] - bridge.layout.alignment.height(points[:, 0])
        across = points[:, 1].min() < 0.5 and points[:, 1].max() > -0.5
        if member.parameters.get("support") is None or above.max() < floor + DEEPEST or not across:
            continue
        for low, high in ranges:
            assert points[:, 0].max() < low - GAP + 1e-6 or points[:, 0].min() > high + GAP - 1e-6, member.name


def test_a_floor_with_rails_on_both_sides() -> None:
    """At the middle of a field: a floor 0.75 m wide, toe boards, knee and hand rails; few triangles."""
    bridge = with_gangways("suspension", 3)
    for number in gangways(bridge):
        member = bridge.members[number]
        size = int(np.sum(member.mesh.face_counts - 2))
        length = float(np.ptp(bridge.bridge_coordinates[number][:, 0]))
        assert member.parameters["length"] == pytest.approx(length, abs=1e-3)
        assert (member.parameters["width"], member.parameters["headroom"]) == (WIDTH, HEADROOM)
        assert size < 120.0 * length
        points = bridge.bridge_coordinates[number]
        above = points[:, 2] - bridge.layout.alignment.height(points[:, 0])
        above -= bridge.drawn.record.levels.girder_soffit - HEADROOM
        ends = points[:, 0] < points[:, 0].min() + 1e-3
        floor = np.abs(above[ends]) < 1e-6
        assert np.ptp(points[ends, 1][floor]) == pytest.approx(WIDTH)
        tops = above[ends & (np.abs(points[:, 1]) > 0.3)]
        assert tops.max() == pytest.approx(1.10, abs=0.01)
        assert ((tops > 0.5) & (tops < 0.6)).any()
        assert (np.abs(tops - 0.12) < 1e-6).any()


def test_no_hanger_is_below_a_joint_of_the_deck() -> None:
    """Head plates lie 0.5 m or more from the ends of the box's pieces."""
    for family in FAMILIES:
        bridge = with_gangways(family, 3)
        boxes = [
            p[:, 0] for m, p in zip(bridge.members, bridge.bridge_coordinates, strict=True) if m.kind == "box_girder"
        ]
        joints = np.array([float(box.min()) for box in boxes])
        for number in gangways(bridge):
            points = bridge.bridge_coordinates[number]
            above = points[:, 2] - bridge.layout.alignment.height(points[:, 0])
            heads = points[above > bridge.drawn.record.levels.girder_soffit - 0.008, 0]
            assert np.abs(heads[:, None] - joints).min() > 0.5


def test_some_bridges_have_them_and_a_draw_changes_nothing_else() -> None:
    """Boxes over long spans have them in some seeds; the last draw of a bridge, so that all else stays as it was."""
    for family in FAMILIES:
        drawn = [draw_layout(settings_of(family), stream(seed, "bridge"))[1].record for seed in range(40)]
        assert {record.gangways for record in drawn} == {True, False}
        for record in drawn:
            assert not record.gangways or record.deck.kind in ("steel_box", "concrete_box")
            assert not record.gangways or record.choice.main >= 80.0
    with_them, without = (with_gangways("suspension", 3, gangways=on) for on in (True, False))
    assert not gangways(without)
    assert gangways(with_them)[0] == len(without.members)
    for one, two in zip(with_them.members, without.members, strict=False):
        assert (one.name, one.instance_id) == (two.name, two.instance_id)
        assert one.mesh.points.tobytes() == two.mesh.points.tobytes()


def test_low_bridges_and_plate_girders_have_none() -> None:
    """Where the soffit is too close to the ground there is no room; a plate girder has no soffit to hang them from."""
    assert not gangways(make_bridge("suspension", 3, suspension={"deck": "plate_girder"}))
    own = {"deck": "steel_box", "main": 120.0, "gangways": True, "air": 0.0}
    for clearance, there in ((5.0, False), (9.0, True)):
        bridge = make_bridge("cable_stayed", 3, clearance=clearance, grade=0.0, cable_stayed=own)
        assert bridge.drawn.record.gangways
        assert bool(gangways(bridge)) == there


def test_short_stretches_are_built_wherever_a_joint_is() -> None:
    """Of a stretch of 10 m, a joint of the deck may lie at either end, or anywhere between."""
    place, levels = Alignment(20.0), make_bridge("cable_stayed", 3).drawn.record.levels
    for joint in np.arange(4.0, 15.0, 0.35).tolist():
        pieces = [(0.0, joint), (joint, 18.6)]
        (part,) = gangway_parts(pieces, levels, place, lambda plan: np.zeros(len(plan)), [])
        assert 10.0 <= float(str(part.parameters["length"])) < 10.3
        assert part.parameters["hangers"] in (4, 5, 6)
