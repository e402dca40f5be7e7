"""Cable-stayed and suspension bridges against closed forms and against what an engineer would measure on them."""

from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.cable_stayed import CableStayedSettings, DrawnCableStayed
from authoring.families.stayed_elevation import FLATTEST, GAUGE
from authoring.families.suspension import DrawnSuspension
from authoring.parts.anchors import clamps, hanger_sockets, sleeves
from authoring.parts.cables import CHORD_SAG, Plane, chords, tube
from authoring.parts.drawing import drawn_range
from authoring.parts.stays import HeadZone, head_heights
from authoring.parts.suspension_cables import _cable_points, _Run
from authoring.shapes.component import F64, Component, triangles
from authoring.solids.sweep import Surface
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.bridges.built import Bridge, make_bridge
from tests.conftest import Count

SHAPES = ("a", "h", "portal", "diamond", "mast")
ROAD: dict[str, Any] = {"service": "road", "roadway": {"lanes": 2}, "grade": 0.0}


@cache
def stayed(seed: int = 3, **own: Any) -> Bridge:
    """Build a cable-stayed road bridge."""
    return make_bridge("cable_stayed", seed, **ROAD, cable_stayed={"size": "compact", **own})


@cache
def hung(seed: int = 3, **own: Any) -> Bridge:
    """Build a level suspension bridge."""
    return make_bridge("suspension", seed, **ROAD, suspension={"size": "compact", **own})


def record_of(family: str, seed: int, values: dict[str, Any] | None = None) -> Any:
    """Draw a bridge without building it."""
    settings = parse_settings(BridgeSettings, {"family": family, **(values or {})}, "test")
    return draw_layout(settings, stream(seed, "bridge"))[1].record


def corners_of(surface: Any) -> F64:
    """Triangles of a surface or mesh, shape (T, 3, 3)."""
    return surface.points[triangles(surface)]


def volume(surface: Surface) -> float:
    """Volume enclosed by a surface."""
    a, b, c = corners_of(surface).transpose(1, 0, 2)
    return float(np.sum(np.einsum("td,td->t", a, np.cross(b, c))) / 6.0)


def winding(point: F64, faces: F64) -> float:
    """How often a closed surface winds round a point: 1 inside, 0 outside (van Oosterom and Strackee's solid angle)."""
    a, b, c = (faces - point).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    top = np.einsum("td,td->t", a, np.cross(b, c))
    dots = [np.einsum("td,td->t", *pair) for pair in ((a, b), (b, c), (c, a))]
    return float(np.sum(2.0 * np.arctan2(top, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)) / (4 * np.pi))


def ends_of(member: Component, sides: int) -> tuple[F64, F64]:
    """Both ends of a straight round member's axis."""
    points = member.mesh.points
    return points[:sides].mean(axis=0), points[-sides:].mean(axis=0)


def named(bridge: Bridge, start: str) -> list[Component]:
    """Members whose names begin so."""
    return [member for member in bridge.members if member.name.startswith(start)]


def test_tubes_have_the_volume_of_their_polygon() -> None:
    """A straight tube is a prism over a polygon; a bent one follows its axis; an oblique cut takes nothing from it."""
    polygon = 0.5 * 12 * 0.3**2 * np.sin(2.0 * np.pi / 12)
    straight = tube(np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 12.0]]), 0.3, 12)
    assert volume(straight) == pytest.approx(13.0 * polygon, rel=1e-12)
    x = np.linspace(0.0, 100.0, 101)
    points = np.stack([x, 0.0 * x, (x - 50.0) ** 2 / 200.0], axis=1)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert volume(tube(points, 0.3, 12)) == pytest.approx(length * polygon, rel=1e-3)
    face = np.array([0.0, 0.0, 1.0])
    cut = tube(np.array([[0.0, 0, 0], [3, 0, 4]]), 0.3, 12, Plane(np.zeros(3), face))
    assert volume(cut) == pytest.approx(5.0 * polygon, rel=1e-12)
    assert np.abs(cut.points[:12, 2]).max() < 1e-12


def test_rings_stand_square_to_the_cable_and_do_not_twist() -> None:
    """Every inner ring lies in the plane square to the bisector; the frame of an upright cable stays upright."""
    x = np.linspace(0.0, 60.0, 25)
    points = np.stack([x, 0.0 * x + 3.0, (x - 30.0) ** 2 / 100.0], axis=1)
    rings = tube(points, 0.2, 16).points.reshape(25, 16, 3)
    unit = np.diff(points, axis=0) / np.linalg.norm(np.diff(points, axis=0), axis=1)[:, None]
    square = np.einsum("kjd,kd->kj", rings[1:-1] - points[1:-1, None], unit[:-1] + unit[1:])
    assert np.abs(square).max() < 1e-12
    assert np.ptp(rings[:, :, 1], axis=0).max() < 1e-12


@pytest.mark.parametrize(
    "surface",
    [
        clamps(np.zeros((2, 3)), np.array([[0.0, 1.0, 0.0], [0.8, 0.0, 0.6]]), 0.1, 0.4, 0.2, 0.02)[1],
        hanger_sockets(np.zeros((2, 3)), 0.03, 0.4)[1],
        sleeves(
            np.zeros((2, 3)),
            np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
            np.array([[0.0, 1.0, 0.0], [0.8, 0.0, 0.6]]),
            0.12,
            np.array([0.5, 0.9]),
        )[1].surface,
    ],
    ids=["clamp", "socket", "sleeve"],
)
def test_fittings_are_closed_and_outward(surface: Surface) -> None:
    """Every edge is used once each way, the volume is positive, and no texture is mirrored."""
    starts = np.concatenate([[0], np.cumsum(surface.face_counts)[:-1]])
    following = np.arange(len(surface.corners)) + 1
    following[starts + surface.face_counts - 1] = starts
    edges = np.stack([surface.corners, surface.corners[following]], axis=1)
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert {tuple(edge) for edge in edges.tolist()} == {tuple(edge) for edge in edges[:, ::-1].tolist()}
    assert volume(surface) > 0.0
    s, t = surface.st.T
    assert np.all(np.add.reduceat(s * t[following] - s[following] * t, starts) > 0.0)


def test_chords_keep_to_the_parabola() -> None:
    """The middle of a chord leaves a parabola by no more than the limit, and one chord fewer would."""
    for sag in (4.0, 12.5, 60.0):
        count = chords(sag)
        assert sag / count**2 <= CHORD_SAG < sag / (count - 1) ** 2


@pytest.mark.parametrize("shape", ["h", "portal", "mast"])
@pytest.mark.parametrize("pylons", [1, 2])
def test_a_harps_stays_are_parallel(shape: str, pylons: int) -> None:
    """All stays on one side of a pylon in one plane have the same direction."""
    bridge = stayed(shape=shape, pylons=pylons, arrangement="harp")
    groups: dict[str, list[F64]] = {}
    for stay in named(bridge, "Stay_"):
        begin, end = ends_of(stay, 12)
        groups.setdefault(stay.name.rsplit("_", 1)[0], []).append((end - begin) / np.linalg.norm(end - begin))
    assert len(groups) == pylons * (2 if shape == "mast" else 4)
    for directions in groups.values():
        assert len(directions) >= 3
        assert np.ptp(directions, axis=0).max() < 1e-6


@pytest.mark.parametrize("shrink", [1.0, 0.6])
def test_fans_meet_and_semi_fans_spread(shrink: float) -> None:
    """A fan's heads are as close as the steeper side's collars allow, a semi-fan's even, a harp's in proportion."""
    offsets = np.linspace(8.0, 40.0, 9)
    runs, where = [(float(x) - 0.5, shrink * (float(x) - 0.5)) for x in offsets], HeadZone(-2.0, 20.0, 12.0, 0.1, 0.01)
    fan = np.array(head_heights("fan", runs, where))
    reach = 0.1 * np.hypot(1.0, (fan + 2.0) / (shrink * (offsets - 0.5)))
    apart = np.diff(fan) - (reach[1:] + reach[:-1])  # between two collars on the steeper side
    assert apart.min() > 0.06 - 1e-12
    assert apart.max() < 0.06 + 0.03
    assert fan[-1] == 20.0
    assert fan[0] > 15.0
    semi = np.array(head_heights("semi_fan", runs, where))
    np.testing.assert_allclose(semi, np.linspace(12.0, 20.0, 9), atol=1e-9)
    harp = np.array(head_heights("harp", runs, where))
    faces = 0.5 + 0.01 * (20.0 - harp)
    np.testing.assert_allclose((harp + 2.0) / (offsets - faces), 22.0 / 39.5, rtol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_stays_end_inside_their_fittings(shape: str) -> None:
    """The axis of every stay begins inside its socket and ends inside its upper anchorage."""
    bridge = stayed(shape=shape)
    bodies = {member.name: member for member in bridge.members}
    stays = named(bridge, "Stay_")
    assert len(stays) >= 12
    for stay in stays:
        for end, kind in zip(ends_of(stay, 12), ("Socket", "Anchorage"), strict=True):
            body = bodies[stay.name.replace("Stay", kind)]
            assert winding(end, corners_of(body.mesh)) == pytest.approx(1.0, abs=1e-6), (stay.name, kind)


def test_hangers_reach_from_the_deck_to_the_parabola() -> None:
    """Hangers are upright, end inside clamp and socket, and their clamps sit on the exact parabola."""
    bridge = hung(side_spans="suspended")
    record: DrawnSuspension = bridge.drawn.record
    cables, bodies = record.cables, {member.name: member for member in bridge.members}
    first, last = cables.towers
    at = np.array([first, 0.5 * (first + last), last])
    np.testing.assert_allclose(cables.height(at), [cables.crown, cables.low, cables.crown], atol=1e-12)
    quarter = cables.height(np.array([0.75 * first + 0.25 * last]))
    assert quarter[0] == pytest.approx(cables.low + 0.25 * cables.sag, abs=1e-9)
    stations = sorted((*cables.main_hangers, *cables.side_hangers))
    hangers = named(bridge, "Hanger_L")
    assert len(hangers) == len(stations)
    assert cables.side_hangers
    level = bridge.layout.alignment.level
    for station, hanger in zip(stations, hangers, strict=True):
        low, high = ends_of(hanger, 8)
        assert np.ptp(np.stack([low, high])[:, :2], axis=0).max() < 1e-9
        ring = bodies[hanger.name.replace("Hanger", "Clamp")]
        axis = float(cables.height(np.array([station]))[0]) + level
        assert ring.mesh.points[:64].mean(axis=0)[2] == pytest.approx(axis, abs=1e-9)
        assert 0.0 < axis - high[2] < 0.5
        assert 0.0 < low[2] - level - cables.foot < 0.5
        for end, kind in ((low, "HangerSocket"), (high, "Clamp")):
            faces = corners_of(bodies[hanger.name.replace("Hanger", kind)].mesh)
            assert winding(end, faces) == pytest.approx(1.0, abs=1e-6), (hanger.name, kind)


def test_side_spans_hang_by_their_sag() -> None:
    """A suspended side span runs from crown to entry, and halfway hangs its sag below the chord."""
    cables = hung(side_spans="suspended").drawn.record.cables
    for tower, anchor in zip(cables.towers, cables.anchors, strict=True):
        ends, middle = cables.height(np.array([tower, anchor])), 0.5 * (tower + anchor)
        np.testing.assert_allclose(ends, [cables.crown, cables.entry], atol=1e-9)
        assert cables.side_sag > 0.5
        assert cables.height(np.array([middle]))[0] == pytest.approx(ends.mean() - cables.side_sag, abs=1e-9)


def test_corners_of_a_cable_are_at_hangers_and_so_many_between() -> None:
    """Both ends, each hanger farther than a decimeter from them, and equal runs that keep the chords to the limit."""
    cables = hung(side_spans="straight").drawn.record.cables
    first, last = cables.towers
    low, high = first + 1.0, last - 1.0
    hangers = np.linspace(low + 0.05, high - 0.05, 9)
    held = np.concatenate([[first - 5.0], hangers, [last + 5.0]])
    found = _cable_points(cables, _Run(low, high, held, 12.0), 3.0, Alignment(2.0))
    corners = np.array([low, *hangers[1:-1], high])
    expected = [low]
    for a, b in pairwise(corners):
        count = chords(12.0, (b - a) / (high - low))
        expected += [a + (b - a) * (k + 1) / count for k in range(count)]
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(found[:, 1], 3.0, atol=1e-12)
    np.testing.assert_allclose(found[:, 2] - 2.0, cables.height(np.array(expected)), atol=1e-9)


def test_drawn_cables_keep_to_the_parabola() -> None:
    """Corners of a main cable lie on it, one at each hanger; middles of chords leave it by the limit at most."""
    bridge = hung(side_spans="straight")
    record: DrawnSuspension = bridge.drawn.record
    cables, level = record.cables, bridge.layout.alignment.level
    for cable in named(bridge, "MainCable_1"):
        points = cable.mesh.points.reshape(-1, 16, 3).mean(axis=1)
        along = np.linalg.norm(points[:, :2] - points[0, :2], axis=1)
        station = 0.5 * sum(cables.towers) + along - 0.5 * along[-1]
        np.testing.assert_allclose(points[:, 2], cables.height(station) + level, atol=1e-6)
        off = 0.5 * (points[1:, 2] + points[:-1, 2]) - cables.height(0.5 * (station[1:] + station[:-1])) - level
        assert 0.0 < off.max() <= CHORD_SAG * (1.0 + 1e-6)
        held = np.array(cables.main_hangers)
        np.testing.assert_allclose(station[np.abs(station[:, None] - held).argmin(axis=0)], held, atol=1e-6)
        assert np.diff(station).min() > 0.05


@pytest.mark.parametrize("sides", ["straight", "suspended"])
def test_main_cables_run_from_anchor_to_anchor(sides: str) -> None:
    """Every cable's ends lie inside a saddle or a casting; the outer pieces of a straight backstay are straight."""
    bridge = hung(side_spans=sides)
    holders = [corners_of(m.mesh) for m in bridge.members if m.kind == "saddle" or m.name.startswith("CableSocket")]
    assert len(holders) == 8
    for cable in named(bridge, "MainCable"):
        for end in ends_of(cable, 16):
            assert sum(round(winding(end, faces)) for faces in holders) == 1, cable.name
        points = cable.mesh.points.reshape(-1, 16, 3).mean(axis=1)
        bent = not (sides == "straight" and cable.name[10] in "02")
        assert (len(points) > 2) == bent


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("service", ["road", "rail_double"])
def test_stays_and_legs_leave_the_traffic_its_gauge(shape: str, service: str) -> None:
    """Between the kerbs and below the clear height nothing of pylons and stays is found, a median apart."""
    if shape == "mast" and service != "road":
        return
    values = {"service": service, "grade": 0.0, "cable_stayed": {"shape": shape, "size": "compact"}}
    for seed in range(3):
        bridge = make_bridge("cable_stayed", seed, **values)
        record: DrawnCableStayed = bridge.drawn.record
        kerb, high = record.top.kerb_face, GAUGE[record.top.service]
        inner = 0.5 * record.top.roadway.median if record.choice.planes == 1 and record.top.roadway else 0.0
        for member, points in zip(bridge.members, bridge.bridge_coordinates, strict=True):
            if member.kind not in ("stay", "pylon_leg", "upper_anchorage", "cable_socket"):
                continue
            rings = points - (0.0, 0.0, bridge.layout.alignment.level)
            faces = rings[triangles(member.mesh)]
            begin, end = faces[:, :, None], np.roll(faces, -1, axis=1)[:, :, None]
            along = begin + np.linspace(0.0, 1.0, 40)[:, None] * (end - begin)
            left, above = np.abs(along[..., 1]), along[..., 2]
            inside = (above > 0.05) & (above < high) & (left < kerb) & (left > inner)
            assert not inside.any(), (seed, member.name)


def test_ratios_hold(proof_count: Count) -> None:
    """Side spans, pylons, stays, sag and slenderness stay in their bands; no cables where girders would do."""
    for seed in range(proof_count(40, 200)):
        record: DrawnCableStayed = record_of("cable_stayed", seed)
        choice, stays, pylon = record.choice, record.stays, record.pylon
        low, high = drawn_range(CableStayedSettings, "side_ratio" if choice.pylons == 2 else "back_ratio")
        assert low - 0.002 <= choice.side / choice.main <= high + 0.002
        low, high = drawn_range(CableStayedSettings, "height_ratio" if choice.pylons == 2 else "single_height_ratio")
        assert low - 0.001 <= pylon.top / choice.main <= high + 0.03
        slope = (stays.heights[-1] - stays.foot) / (stays.offsets[-1] - pylon.face(stays.heights[-1]))
        assert np.degrees(np.arctan(slope)) >= FLATTEST
        assert min(np.diff(stays.offsets)) > 1.2
        assert min(np.diff(stays.heights)) > 0.1
        assert record.spans.supports[-1] <= (260.0 if choice.size == "compact" else 620.0)
        assert choice.main >= {1: 55.0, 2: 70.0}[choice.pylons]
        other: DrawnSuspension = record_of("suspension", seed)
        cables, span = other.cables, other.choice.main
        assert 1 / 12 - 1e-3 <= cables.sag / span <= 1 / 8 + 1e-3
        assert 2.0 - 1e-9 <= cables.low <= 4.0 + 1e-9
        assert 0.2 - 0.002 <= other.choice.side / span <= 0.5 + 0.002
        assert span >= 80.0
        assert 0.09 <= other.tower.top / span <= 0.16
        assert cables.diameter >= span / 2000.0 - 1e-3


def test_two_pylons_mirror_each_other() -> None:
    """Stays, towers and hangers lie alike about the middle of the main span."""
    for bridge, start in ((stayed(pylons=2, shape="h"), "Stay_"), (hung(), "Hanger")):
        middle = 0.5 * bridge.layout.supports[-1]
        places = [
            points.mean(axis=0)
            for member, points in zip(bridge.members, bridge.bridge_coordinates, strict=True)
            if member.name.startswith(start)
        ]
        here = np.array(sorted(np.round(places, 6).tolist()))
        there = np.array(sorted(np.round(np.array(places) * (-1, 1, 1) + (2.0 * middle, 0, 0), 6).tolist()))
        np.testing.assert_allclose(here, there, atol=1e-4)


@pytest.mark.parametrize(
    ("family", "own", "told"),
    [
        ("cable_stayed", {"shape": "a", "arrangement": "harp"}, "arrangement"),
        ("cable_stayed", {"shape": "h", "planes": 1}, "planes"),
        ("cable_stayed", {"shape": "mast", "deck": "edge_beam"}, "deck"),
        ("cable_stayed", {"shape": "diamond", "main": 31.0, "pylons": 2}, "main"),
        ("cable_stayed", {"main": 32.0, "pylons": 2, "pitch": 20.0, "shape": "portal"}, "pitch"),
        (
            "cable_stayed",
            {"main": 300.0, "pylons": 2, "height_ratio": 0.15, "shape": "h", "pitch": 4.0},
            "height_ratio",
        ),
        ("suspension", {"main": 100.0, "sag_ratio": 0.12, "tower_height": 10.0}, "sag_ratio"),
        ("suspension", {"main": 200.0, "sag_ratio": 0.1, "tower_height": 90.0}, "sag_ratio"),
        ("suspension", {"main": 200.0, "tower_height": 9.0}, "tower_height"),
        ("suspension", {"main": 200.0, "tower_height": 90.0}, "tower_height"),
        ("suspension", {"main": 40.0, "pitch": 25.0}, "pitch"),
        ("suspension", {"main": 30.0}, "main"),
    ],
)
def test_bad_input_names_the_key_and_what_is_allowed(family: str, own: dict[str, Any], told: str) -> None:
    """An impossible choice is refused with its key and a valid value."""
    with pytest.raises(InputError) as error:
        record_of(family, 3, {**ROAD, family: own})
    assert f"{family}.{told}" in str(error.value)


def test_boxes_have_hatches_and_free_edges_drip_grooves() -> None:
    """Two hatches lie under the soffit of a box, 5 m from its ends; a slab's free edge has a groove of 20 mm."""
    bridge = hung(2, deck="steel_box")
    hatches = [n for n, member in enumerate(bridge.members) if member.kind == "access_hatch"]
    ends = bridge.drawn.record.spans.pieces[0]
    middles = [bridge.bridge_coordinates[n].mean(axis=0) for n in hatches]
    assert [float(middle[0]) for middle in middles] == pytest.approx([ends[0] + 5.0, ends[1] - 5.0])
    soffit = bridge.drawn.record.levels.girder_soffit
    for number, middle in zip(hatches, middles, strict=True):
        under = bridge.layout.alignment.height(middle[:1])[0] + soffit
        assert bridge.boxes[number, 0, 2] < under < bridge.boxes[number, 1, 2] + 0.03
    plated = hung(2, deck="plate_girder")
    slab = next(n for n, member in enumerate(plated.members) if member.kind == "deck_slab")
    section = plated.bridge_coordinates[slab]
    half = 0.5 * plated.drawn.record.deck.width
    grooved = section[np.abs(np.abs(section[:, 1]) - (half - 0.12)) < 1e-6]
    deck = plated.layout.alignment.height(grooved[:, 0])
    np.testing.assert_allclose(grooved[:, 2] - deck, plated.drawn.record.levels.soffit + 0.020, atol=1e-6)
