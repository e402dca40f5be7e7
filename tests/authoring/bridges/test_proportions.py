"""What the proof found out once: columns, boxes, anchor piers, joints and bars that were too thin, short or close."""

import numpy as np
import pytest

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import FAMILIES, build_bridge
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.bridges.built import Bridge, make_bridge, rolling_ground, settings_of
from tests.authoring.bridges.conftest import FIXED
from tests.authoring.bridges.ratios import RATIOS, ratios_in_bands
from tests.authoring.bridges.test_cables import record_of


def of_kind(bridge: Bridge, *kinds: str) -> list[int]:
    """Numbers of the members of some kinds."""
    return [number for number, member in enumerate(bridge.members) if member.kind in kinds]


def test_a_ratio_out_of_its_band_is_told() -> None:
    """A girder three times as deep as usual is found by its own mesh, with band and source."""
    wrong = ratios_in_bands(make_bridge("beam", FIXED, beam={"spans": [24.0], "girder": {"shape": "i", "depth": 2.4}}))
    assert any("span / girder depth: 10.0" in line and "AASHTO" in line for line in wrong), wrong
    assert set(RATIOS) == set(FAMILIES)


def test_floor_beams_reach_beyond_columns_of_every_width() -> None:
    """Under a half-through arch no floor beam ends in the plane of the column under it."""
    for depth in (45.0, 57.0, 70.0):
        own = {"arrangement": "half_through", "form": "steel", "span_to_depth": depth, "above": {"span": 97.3}}
        bridge = make_bridge("arch", FIXED, arch=own)
        reach = {round(float(bridge.bridge_coordinates[n][:, 0].mean()), 2): n for n in of_kind(bridge, "floor_beam")}
        columns = of_kind(bridge, "spandrel_column")
        assert columns
        for number in columns:
            points = bridge.bridge_coordinates[number]
            beam = bridge.bridge_coordinates[reach[round(float(points[:, 0].min() + points[:, 0].max()) / 2.0, 2)]]
            assert beam[:, 1].max() - np.abs(points[:, 1]).max() > 0.04


@pytest.mark.parametrize("skew", [-28.0, 28.0])
def test_bars_of_a_skewed_railing_stand_clear_of_its_posts(skew: float) -> None:
    """No bar begins or ends beside a post, whichever way the deck's lines run."""
    bridge = make_bridge(
        "girder",
        FIXED,
        service="road",
        parapet={"shape": "railing", "infill": "bars"},
        alignment={"kind": "straight", "profile": "grade", "skew": skew},
    )
    (posts,) = (m for m in bridge.members if m.name == "Post_000_L")
    (rails,) = (m for m in bridge.members if m.name == "Railing_000_L")
    post_x = np.unique(np.round(posts.mesh.points[:, 0], 4))
    groups = np.split(post_x, np.flatnonzero(np.diff(post_x) > 0.5) + 1)
    middles = np.array([0.5 * (group[0] + group[-1]) for group in groups])
    inner = rails.mesh.points[:, 0]
    inner = inner[(inner > middles[0] + 0.05) & (inner < middles[-1] - 0.05)]
    assert len(inner) > 100
    assert np.abs(inner[:, None] - middles).min() > 0.031  # half a post, and a hair


def test_joints_of_cable_decks_lie_between_floor_beams() -> None:
    """No piece of girder ends in the plane of a floor beam's flange."""
    bridge = make_bridge("cable_stayed", 7)
    floor = np.array([bridge.bridge_coordinates[n][:, 0].mean() for n in of_kind(bridge, "floor_beam")])
    ends = np.concatenate(
        [
            [bridge.bridge_coordinates[n][:, 0].min(), bridge.bridge_coordinates[n][:, 0].max()]
            for n in of_kind(bridge, "plate_girder")
        ]
    )
    inner = ends[(ends > ends.min() + 1.0) & (ends < ends.max() - 1.0)]
    assert len(inner)
    assert np.abs(inner[:, None] - floor).min() > 0.30


def test_anchor_piers_stand_under_long_side_spans_alone() -> None:
    """They divide side spans from 40 m on, never the main span; shorter side spans have none."""
    fixed = {"main": 200.0, "pylons": 2, "shape": "portal", "side_ratio": 0.4, "anchor_piers": True}
    long = make_bridge("cable_stayed", FIXED, cable_stayed=fixed)
    supports = np.array(long.layout.supports)
    assert np.diff(supports).round(3).tolist() == [26.667, 26.666, 26.667, 200.0, 26.667, 26.666, 26.667]
    piers = {m.parameters["support"] for m in long.members if m.kind == "pier_cap"}
    assert piers == {1, 2, 5, 6}
    assert {m.parameters["support"] for m in long.members if m.kind == "pylon_leg"} == {3, 4}
    short = settings_of("cable_stayed", cable_stayed={**fixed, "main": 90.0})
    assert len(draw_layout(short, stream(FIXED, "bridge"))[0].supports) == 4


def test_steel_boxes_are_drawn_for_long_spans_alone() -> None:
    """Khan gives them 30 m and more; asked for, they are built on shorter ones too."""
    short = settings_of("girder", girder={"spans": [22.0, 22.0]}, roadway={"lanes": 3}, service="road")
    found = {draw_layout(short, stream(seed, "bridge"))[1].record.steel.arrangement for seed in range(40)}
    assert found == {"multi", "ladder"}
    asked = settings_of("girder", girder={"spans": [22.0], "steel": {"arrangement": "box"}}, roadway={"lanes": 3})
    assert draw_layout(asked, stream(FIXED, "bridge"))[1].record.steel.arrangement == "box"


@pytest.mark.parametrize(("family", "own"), [("slab", {"depth": 0.6}), ("beam", {"girder": {"depth": 0.9}})])
def test_drawn_spans_follow_a_fixed_depth(family: str, own: dict[str, object]) -> None:
    """A depth alone never makes a bridge that its own rule would refuse: the open spans give way."""
    for seed in range(60):
        layout, _ = draw_layout(settings_of(family, service="road", **{family: own}), stream(seed, "bridge"))
        longest = float(np.diff(layout.supports).max())
        low, high = (0.6 * 0.6 * 22.0, 0.6 * 1.4 * 25.0) if family == "slab" else (9.0, 27.0)
        assert low - 0.01 <= longest <= high + 0.01


def test_an_open_sag_follows_a_fixed_tower() -> None:
    """Towers of 30 m on a span of 200 m: whatever sag was drawn, the cables end 1.6 to 8 m over the deck."""
    settings = settings_of("suspension", suspension={"main": 200.0, "tower_height": 30.0})
    for seed in range(30):
        choice = draw_layout(settings, stream(seed, "bridge"))[1].record.choice
        assert choice.crown == 30.0
        assert 1.6 <= choice.low <= 8.0


@pytest.mark.parametrize("family", FAMILIES)
def test_ground_above_any_deck_is_refused(family: str) -> None:
    """A hill through the road is one line that names the key and how much higher it has to be."""
    bridge = make_bridge(family, FIXED)
    with pytest.raises(InputError, match=r"bridge\.clearance: the ground lies .* above the deck") as caught:
        build_bridge(bridge.layout, bridge.drawn, lambda xy: rolling_ground(xy) + 200.0)
    assert "Raise it by" in str(caught.value)


@pytest.mark.parametrize("family", ["slab", {"slab": 1.0, "girder": 2.0}])
def test_settings_of_a_family_that_is_not_drawn_are_refused(family: object) -> None:
    """They would be without effect; the section alone, or with its family in the table of weights, is fine."""
    with pytest.raises(InputError, match=r"arch: the settings of family 'arch' have no effect"):
        parse_settings(BridgeSettings, {"family": family, "arch": {"span": 80.0}}, "test")
    parse_settings(BridgeSettings, {"family": family, "arch": {}}, "test")
    parse_settings(BridgeSettings, {"family": {"slab": 1.0, "arch": 1.0}, "arch": {"span": 80.0}}, "test")


@pytest.mark.parametrize(("family", "each"), [("suspension", 40.0), ("cable_stayed", 27.0)])
def test_lanes_and_tracks_suit_the_span(family: str, each: float) -> None:
    """No drawn road has a lane for fewer meters of main span, no railway there two tracks; a user may have them."""
    counts = []
    for seed in range(60):
        top, main = (record := record_of(family, seed)).top, record.choice.main
        lanes = top.roadway.lanes if top.roadway else {1: 2, 2: 4}[len(top.tracks.section.lines)]
        counts.append(lanes)
        assert lanes <= max(2.0, main / each), (seed, main)
    assert len(set(counts)) > 2
    own = record_of(family, 3, {"service": "road", "roadway": {"lanes": 6}, family: {"main": 120.0}})
    assert own.top.roadway.lanes == 6
    assert len(record_of(family, 3, {"service": "rail_double", family: {"main": 100.0}}).top.tracks.section.lines) == 2
