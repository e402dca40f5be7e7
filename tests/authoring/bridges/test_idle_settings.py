"""What the user sets is never silently without effect: it is refused by name, or what is open is drawn to suit it."""

import re
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Layout
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import FAMILIES
from authoring.parts.idle_settings import Use
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import Settings, parse_settings
from tests.authoring.bridges.draws_seen import leaves, merged, nested, sections

PAPER = 'bridge.profile = "paper"'
IDLE: list[
    tuple[str, dict[str, Any], str]
] = [  # what is set, as dotted keys; the first has no effect because of the cause
    ("beam", {"track.bed": "slab", "service": "road"}, 'bridge.service = "road"'),
    ("beam", {"roadway.lane_width": 3.5, "service": "rail_single"}, 'bridge.service = "rail_single"'),
    ("beam", {"fittings.lamps": True, "service": "rail_double"}, 'bridge.service = "rail_double"'),
    ("beam", {"track.spacing": 4.2, "service": "rail_single"}, 'bridge.service = "rail_single"'),
    ("beam", {"alignment.cant": 0.1, "service": "road"}, 'bridge.service = "road"'),
    ("beam", {"alignment.superelevation": 0.04, "service": "rail_single"}, 'bridge.service = "rail_single"'),
    ("beam", {"alignment.turn": "left", "alignment.kind": "straight"}, 'bridge.alignment.kind = "straight"'),
    ("beam", {"alignment.spiral": 0.3, "alignment.kind": "arc"}, 'bridge.alignment.kind = "arc"'),
    ("beam", {"bearing.pad_width": 0.4, "bearing.kind": "pot"}, 'bridge.bearing.kind = "pot"'),
    ("beam", {"bearing.pot_height": 0.15, "bearing.kind": "pad"}, 'bridge.bearing.kind = "pad"'),
    ("beam", {"parapet.coping_height": 0.12, "parapet.shape": "barrier"}, 'bridge.parapet.shape = "barrier"'),
    ("beam", {"parapet.plinth": 0.1, "parapet.shape": "wall"}, 'bridge.parapet.shape = "wall"'),
    ("beam", {"parapet.low_wall": 0.6, "parapet.shape": "railing"}, 'bridge.parapet.shape = "railing"'),
    ("beam", {"parapet.infill": "bars", "parapet.shape": "wall"}, 'bridge.parapet.shape = "wall"'),
    ("beam", {"parapet.rails": 2, "parapet.infill": "bars"}, 'bridge.parapet.infill = "bars"'),
    ("beam", {"parapet.coping_overhang": 0.05, "parapet.coping_height": 0.0}, "bridge.parapet.coping_height = 0.0"),
    ("beam", {"pier.wall_share": 0.8, "pier.kind": "multi"}, 'bridge.pier.kind = "multi"'),
    ("beam", {"pier.wall_thickness": 1.0, "pier.columns": 2}, "bridge.pier.columns = 2"),
    ("beam", {"pier.diameter": 1.0, "pier.kind": "y"}, 'bridge.pier.kind = "y"'),
    ("beam", {"pier.hammerhead_diameter": 1.5, "pier.kind": "multi"}, 'bridge.pier.kind = "multi"'),
    ("beam", {"pier.column_shape": "round", "pier.kind": "pi_frame"}, 'bridge.pier.kind = "pi_frame"'),
    ("beam", {"pier.taper": 0.4, "pier.cap": "drop"}, 'bridge.pier.cap = "drop"'),
    ("beam", {"pier.batter": 0.02, "pier.battered": False}, "bridge.pier.battered = false"),
    ("beam", {"abutment.footing_toe": 0.5, "abutment.footing": False}, "bridge.abutment.footing = false"),
    ("beam", {"abutment.batter": 0.05, "abutment.battered": False}, "bridge.abutment.battered = false"),
    ("beam", {"roadway.footway_width": 2.0, "roadway.footway": False}, "bridge.roadway.footway = false"),
    ("beam", {"roadway.verge_width": 0.5, "roadway.footway": True}, "bridge.roadway.footway = true"),
    ("beam", {"roadway.median": 2.0, "roadway.divided": False}, "bridge.roadway.divided = false"),
    ("beam", {"roadway.median": 2.0, "roadway.lanes": 3}, "bridge.roadway.lanes = 3"),
    ("beam", {"roadway.dash": 3.0, "roadway.lanes": 1}, "bridge.roadway.lanes = 1"),
    ("beam", {"track.ballast": 0.3, "track.bed": "slab"}, 'bridge.track.bed = "slab"'),
    ("beam", {"track.sleeper": "timber", "track.bed": "slab"}, 'bridge.track.bed = "slab"'),
    ("beam", {"track.slab_shoulder": 0.2, "track.bed": "ballast"}, 'bridge.track.bed = "ballast"'),
    ("beam", {"track.sleeper_height": 0.2, "track.sleeper": "timber"}, 'bridge.track.sleeper = "timber"'),
    ("beam", {"fittings.lamp_pitch": 30.0, "fittings.lamps": False}, "bridge.fittings.lamps = false"),
    ("beam", {"fittings.pipe_diameter": 0.1, "fittings.drainage": False}, "bridge.fittings.drainage = false"),
    ("beam", {"fittings.conduit_diameter": 0.08, "fittings.conduits": False}, "bridge.fittings.conduits = false"),
    ("beam", {"beam.span_count": 3, "beam.spans": [20.0, 20.0]}, "bridge.beam.spans = [20.0, 20.0]"),
    ("beam", {"beam.end_share": 0.8, "beam.span_count": 2}, "bridge.beam.span_count = 2"),
    ("beam", {"beam.continuous": True, "beam.span_count": 1}, "bridge.beam.span_count = 1"),
    ("beam", {"pier.cap_depth": 1.0, "beam.spans": [20.0]}, "bridge.beam.spans = [20.0]"),
    ("beam", {"beam.girder.top_width": 0.6, "beam.girder.shape": "u"}, 'bridge.beam.girder.shape = "u"'),
    ("beam", {"beam.girder.bulb_width": 1.2, "beam.girder.shape": "i"}, 'bridge.beam.girder.shape = "i"'),
    ("beam", {"beam.girder.stem": 0.5, "beam.girder.shape": "box"}, 'bridge.beam.girder.shape = "box"'),
    ("beam", {"beam.girder.wide_bottom": 1.1, "beam.girder.shape": "t"}, 'bridge.beam.girder.shape = "t"'),
    ("beam", {"beam.girder.spacing": 2.5, "beam.girder.count": 4, "roadway.lanes": 2}, "bridge.beam.girder.count = 4"),
    ("beam", {"beam.girder.slenderness": 18.0, "beam.girder.depth": 1.2}, "bridge.beam.girder.depth = 1.2"),
    ("beam", {"beam.girder.web": 0.2, "beam.girder.omitted": True}, "bridge.beam.girder.omitted = true"),
    (
        "girder",
        {"girder.steel.haunch_ratio": 1.7, "girder.steel.haunch": "none"},
        'bridge.girder.steel.haunch = "none"',
    ),
    (
        "girder",
        {"girder.steel.splice_share": 0.2, "girder.steel.splices": False},
        "bridge.girder.steel.splices = false",
    ),
    ("girder", {"girder.steel.splices": True, "girder.continuous": False}, "bridge.girder.continuous = false"),
    ("girder", {"girder.steel.count": 4, "girder.steel.arrangement": "box"}, 'bridge.girder.steel.arrangement = "box"'),
    ("girder", {"girder.frames.kind": "x", "girder.steel.arrangement": "box"}, 'girder.steel.arrangement = "box"'),
    ("girder", {"girder.frames.pitch": 6.0, "girder.steel.arrangement": "ladder"}, 'steel.arrangement = "ladder"'),
    ("girder", {"girder.frames.plate": 0.4, "girder.frames.kind": "k"}, 'bridge.girder.frames.kind = "k"'),
    ("slab", {"slab.cantilever": 0.2, "slab.section": "solid"}, 'bridge.slab.section = "solid"'),
    ("slab", {"slab.slenderness": 1.0, "slab.depth": 0.6}, "bridge.slab.depth = 0.6"),
    ("arch", {"pier.kind": "wall"}, 'bridge.family = "arch"'),
    ("arch", {"arch.span": 100.0, "arch.arrangement": "tied"}, 'bridge.arch.arrangement = "tied"'),
    ("arch", {"arch.bays": 10, "arch.arrangement": "through"}, 'bridge.arch.arrangement = "through"'),
    ("arch", {"arch.bracing": "k", "arch.arrangement": "deck"}, 'bridge.arch.arrangement = "deck"'),
    ("arch", {"arch.above.below_deck": 0.2, "arch.arrangement": "through"}, 'bridge.arch.arrangement = "through"'),
    ("arch", {"arch.form": "steel", "arch.arrangement": "masonry"}, 'bridge.arch.arrangement = "masonry"'),
    ("arch", {"arch.masonry.cutwater": 0.7, "arch.masonry.span_count": 1}, "bridge.arch.masonry.span_count = 1"),
    ("arch", {"parapet.shape": "railing", "arch.arrangement": "masonry"}, 'bridge.arch.arrangement = "masonry"'),
    ("arch", {"fittings.lamps": True, "arch.arrangement": "tied"}, 'bridge.arch.arrangement = "tied"'),
    ("arch", {"abutment.footing": True, "arch.approach": 0.0}, "bridge.arch.approach = 0.0"),
    ("arch", {"bearing.kind": "pot", "arch.arrangement": "masonry"}, 'bridge.arch.arrangement = "masonry"'),
    ("cable_stayed", {"cable_stayed.side_ratio": 0.4, "cable_stayed.pylons": 1}, "bridge.cable_stayed.pylons = 1"),
    ("cable_stayed", {"cable_stayed.strip": 0.9, "cable_stayed.shape": "portal"}, 'cable_stayed.shape = "portal"'),
    ("cable_stayed", {"cable_stayed.zone": 0.6, "cable_stayed.arrangement": "fan"}, 'cable_stayed.arrangement = "fan"'),
    ("cable_stayed", {"cable_stayed.gangways": True, "cable_stayed.deck": "edge_beam"}, 'deck = "edge_beam"'),
    ("cable_stayed", {"roadway.divided": True, "cable_stayed.shape": "mast"}, 'bridge.cable_stayed.shape = "mast"'),
    ("cable_stayed", {"fittings.conduits": True}, 'bridge.family = "cable_stayed"'),
    ("suspension", {"suspension.side_ratio": 0.3, "suspension.side_spans": "suspended"}, 'side_spans = "suspended"'),
    ("suspension", {"suspension.suspended_ratio": 0.4, "suspension.side_spans": "straight"}, 'spans = "straight"'),
    ("suspension", {"suspension.over_deck": 3.0, "suspension.tower_height": 40.0}, "suspension.tower_height = 40.0"),
    ("suspension", {"pier.kind": "wall", "suspension.side_spans": "suspended"}, 'side_spans = "suspended"'),
    ("beam", {"roadway.lane_width": 3.5, "profile": "paper"}, PAPER),
    ("beam", {"track.ballast": 0.3, "profile": "paper"}, PAPER),
    ("beam", {"track.upstand_top": 0.1, "profile": "paper"}, PAPER),
    ("beam", {"parapet.plinth": 0.1, "profile": "paper"}, PAPER),
    ("beam", {"pier.batter": 0.02, "profile": "paper"}, PAPER),
    ("beam", {"parapet.coping_overhang": 0.05, "profile": "paper"}, PAPER),
    ("beam", {"pier.wall_share": 0.8, "profile": "paper"}, PAPER),
    ("girder", {"girder.steel.splice_share": 0.2, "profile": "paper"}, PAPER),
    ("girder", {"girder.frames.stiffener_pitch": 1.2, "profile": "paper"}, PAPER),
    (
        "girder",
        {"girder.steel.web": 0.015, "girder.steel.arrangement": "box"},
        'bridge.girder.steel.arrangement = "box"',
    ),
    ("girder", {"girder.frames.stiffener": 0.015, "girder.steel.arrangement": "box"}, 'steel.arrangement = "box"'),
    ("arch", {"arch.above.span": 80.0, "profile": "paper"}, PAPER),
    ("arch", {"abutment.footing": True, "profile": "paper"}, PAPER),
    ("cable_stayed", {"cable_stayed.size": "realistic", "profile": "paper"}, PAPER),
    ("cable_stayed", {"pier.kind": "wall", "cable_stayed.anchor_piers": False}, "cable_stayed.anchor_piers = false"),
    ("suspension", {"pier.kind": "wall", "profile": "paper"}, PAPER),
]


def set_keys(family: str, keys: dict[str, Any]) -> BridgeSettings:
    """Set dotted keys of a family's bridge."""
    values: dict[str, Any] = {"family": family}
    for key, value in keys.items():
        values = merged(values, nested(tuple(key.split(".")), value))
    return parse_settings(BridgeSettings, values, "test")


def drawn(family: str, keys: dict[str, Any], seed: int) -> tuple[Layout, Any]:
    """Draw a family's bridge with dotted keys that are set: its layout and its record."""
    layout, bridge = draw_layout(set_keys(family, keys), stream(seed, "bridge"))
    return layout, bridge.record


@pytest.mark.parametrize(("family", "keys", "cause"), IDLE, ids=lambda value: next(iter(value), None))
def test_what_has_no_effect_is_refused(family: str, keys: dict[str, Any], cause: str) -> None:
    """One line names the key, the choice that excludes it, and what to change; the choice alone is not refused."""
    idle, *others = keys
    with pytest.raises(InputError) as caught:
        drawn(family, keys, 1)
    told = str(caught.value)
    assert re.match(rf"bridge\.{re.escape(idle)}: has no effect with (bridge\.)?\S*{re.escape(cause)} ", told), told
    assert f"or leave {idle.rpartition('.')[2]} out" in told
    assert "\n" not in told
    drawn(family, {key: keys[key] for key in others}, 1)


def test_a_choice_that_is_drawn_refuses_nothing() -> None:
    """Sizes of options that are open apply to the bridges that have them; so with a table of families."""
    for seed in range(10):
        keys = {"bearing.pad_width": 0.42, "bearing.pot_width": 0.4, "parapet.plinth": 0.1, "track.ballast": 0.3}
        bearings = drawn("beam", {**keys, "roadway.verge_width": 0.5}, seed)[1].bearings
        assert bearings.pad_width == {"pad": 0.42, "pot": 0.4}[bearings.kind]
    bent = {"kind": "arc", "radius": 900.0, "superelevation": 0.04, "skew": 5.0, "profile": "crest"}
    weights = {"family": {"arch": 1.0, "beam": 1.0}, "pier": {"kind": "wall"}, "alignment": bent, "service": "road"}
    for seed in range(10):
        draw_layout(parse_settings(BridgeSettings, weights, "test"), stream(seed, "bridge"))
    only = parse_settings(BridgeSettings, {**weights, "family": {"arch": 1.0}}, "test")
    draw_layout(only, stream(1, "bridge"))


def test_what_does_not_exist_may_be_excluded() -> None:
    """`false`, and the value that the excluded options have anyway, are true of such a bridge."""
    drawn("beam", {"service": "rail_single", "fittings.lamps": False}, 1)
    drawn("arch", {"arch.arrangement": "masonry", "parapet.shape": "wall", "abutment.footing": False}, 1)
    drawn("beam", {"track.bed": "slab", "track.sleeper": "concrete"}, 1)


@pytest.mark.parametrize("family", FAMILIES)
def test_rules_name_keys_that_exist(family: str) -> None:
    """Every key and every choice of every rule is a key of its section."""
    settings = parse_settings(BridgeSettings, {"family": family}, "test")
    rules: list[tuple[Settings, Settings, Use]] = [
        (section, section, use) for _, section in sections(settings, family) for use in getattr(section, "uses", ())
    ]
    own = getattr(settings, family)
    rules += [(settings, own if use.choice else settings, use) for use in getattr(own, "shared_uses", ())]
    for keys, owner, use in rules:
        for section, key in [*((keys, key) for key in use.keys), (owner, use.choice or "family")]:
            found: Any = section
            for name in key.split("."):
                assert name in type(found).model_fields, f"{use}: no key {key}"
                found = getattr(found, name)


SUITED: list[tuple[str, dict[str, Any], str, object]] = [  # what is set; a drawn value and what it then is
    ("cable_stayed", {"cable_stayed.deck": "concrete_box"}, "deck", "concrete_box"),
    ("cable_stayed", {"cable_stayed.planes": 1}, "planes", 1),
    ("cable_stayed", {"cable_stayed.shape": "mast"}, "shape", "mast"),
    ("cable_stayed", {"cable_stayed.planes": 1, "cable_stayed.arrangement": "harp"}, "shape", "mast"),
    ("cable_stayed", {"cable_stayed.shape": "mast", "profile": "paper"}, "shape", "mast"),
    ("cable_stayed", {"roadway.divided": True, "service": "road"}, "divided", True),
    ("suspension", {"suspension.main": 40.0}, "main", 40.0),
    ("suspension", {"suspension.main": 1000.0, "profile": "paper"}, "main", 1000.0),
    ("girder", {"girder.steel.haunch": "parabolic"}, "haunch", "parabolic"),
    ("girder", {"girder.steel.haunch": "straight", "profile": "paper"}, "haunch", "straight"),
    ("girder", {"girder.steel.arrangement": "ladder"}, "arrangement", "ladder"),
    ("girder", {"girder.steel.arrangement": "box"}, "arrangement", "box"),
    ("girder", {"roadway.divided": True, "service": "road"}, "divided", True),
    ("arch", {"arch.form": "ring"}, "arrangement", "deck"),
    ("beam", {"pier.kind": "y"}, "kind", "y"),
    ("beam", {"pier.cap": "cantilevered"}, "cap", "cantilevered"),
    ("beam", {"pier.cap": "inverted_t"}, "cap", "inverted_t"),
    ("girder", {"pier.cap": "inverted_t"}, "cap", "inverted_t"),
    ("slab", {"pier.cap": "inverted_t"}, "cap", "inverted_t"),
    ("slab", {"service": "road", "roadway.lanes": 6, "profile": "paper"}, "lanes", 6),
    ("beam", {"beam.girder.shape": "u"}, "shape", "u"),
    *((family, {"pier.columns": 4}, "columns", 4) for family in ("beam", "slab")),
    ("girder", {"girder.steel.count": 3}, "spliced", True),
    ("cable_stayed", {"cable_stayed.planes": 1, "cable_stayed.main": 60.0}, "planes", 1),
    ("cable_stayed", {"cable_stayed.deck": "concrete_box", "cable_stayed.main": 60.0}, "deck", "concrete_box"),
    ("beam", {"beam.girder.depth": 3.075}, "depth", 3.075),
    *((family, {"grade": 0.04}, "service", "road") for family in FAMILIES),
]


@pytest.mark.parametrize(("family", "keys", "name", "value"), SUITED)
def test_what_is_open_suits_what_is_set(family: str, keys: dict[str, Any], name: str, value: object) -> None:
    """Thirty seeds: never refused, and the bridge is what was set."""
    for seed in range(30):
        layout, record = drawn(family, keys, seed)
        assert value in leaves({"layout": asdict(layout), **asdict(record)}, name), f"seed {seed}"


@pytest.mark.parametrize("family", FAMILIES)
def test_a_median_or_a_small_radius_is_never_refused(family: str) -> None:
    """A median needs four or six lanes, and a small radius a road: both are drawn so, also beside a railway."""
    roads = 0
    for seed in range(30):
        layout, record = drawn(family, {"roadway.divided": True}, seed)
        roads += layout.service == "road"
        assert layout.service != "road" or True in leaves(asdict(record), "divided"), f"seed {seed}"
        if family == "beam":
            assert drawn(family, {"alignment.radius": 150.0}, seed)[0].service == "road"
    assert roads > 5


@pytest.mark.parametrize(
    ("family", "key", "value", "name"),
    [
        ("beam", "track.upstand", 0.25, "upstand"),
        ("suspension", "suspension.cable_ratio", 1600.0, "cable"),
        ("beam", "beam.girder.slenderness", 20.0, "girders"),
        ("slab", "slab.slenderness", 1.1, "depth"),
        ("beam", "beam.girder.spacing", 2.8, "lines"),
        ("girder", "girder.steel.spacing", 3.4, "lines"),
        ("beam", "beam.end_share", 0.75, "supports"),
        ("girder", "girder.end_share", 1.2, "supports"),
    ],
)
def test_profile_paper_uses_what_is_set(family: str, key: str, value: float, name: str) -> None:
    """Values that the paper's generator has fixed are replaced by the user's, and nothing else moves."""
    changed = 0
    for seed in range(5):
        (_, free), (_, given) = (drawn(family, {"profile": "paper", **keys}, seed) for keys in ({}, {key: value}))
        changed += list(leaves(asdict(free), name)) != list(leaves(asdict(given), name))
        if name == "cable":
            choice = given.choice
            assert choice.cable == pytest.approx(max(choice.main / value, 0.14), abs=1e-3)
            assert choice.pitch == free.choice.pitch
            assert choice.hanger == free.choice.hanger
        if name == "girders":
            assert given.girders.depth in (0.0, 0.5)  # some have no girders
        if name == "supports":
            ends = np.diff(given.spans.supports)
            assert ends[0] == pytest.approx(10.0 * value)
            assert ends[1] == pytest.approx(10.0)
    assert changed >= (1 if name == "girders" else 5)


@pytest.mark.parametrize(
    ("family", "keys", "told"),
    [
        ("beam", {"profile": "paper", "beam.end_share": 0.5}, "bridge.beam.end_share: end spans too short"),
        ("cable_stayed", {"cable_stayed.deck": "concrete_box", "service": "rail_single"}, "bridge.cable_stayed.deck"),
        ("cable_stayed", {"cable_stayed.deck": "concrete_box", "cable_stayed.shape": "h"}, "bridge.cable_stayed.deck"),
        ("cable_stayed", {"cable_stayed.shape": "mast", "roadway.lanes": 3, "service": "road"}, "cable_stayed.shape"),
        ("cable_stayed", {"cable_stayed.main": 30.0, "cable_stayed.size": "realistic"}, "bridge.cable_stayed.main"),
        ("beam", {"pier.cap": "cantilevered", "roadway.lanes": 6, "service": "road"}, "bridge.pier.cap"),
        (
            "cable_stayed",
            {"cable_stayed.planes": 1, "roadway.lanes": 3},
            "bridge.cable_stayed.planes: does not fit the other choices (found 1); allowed: a road",
        ),
    ],
)
def test_a_refusal_names_what_was_set(family: str, keys: dict[str, Any], told: str) -> None:
    """Where values that are set exclude each other, or there is no room, the line names one of them."""
    lines = []
    for seed in range(30):
        try:
            drawn(family, keys, seed)
        except InputError as error:
            lines.append(str(error))
    assert lines
    assert [line for line in lines if not line.startswith(f"bridge.{told.removeprefix('bridge.')}")] == []
