"""Piers, bearings and abutments: volumes in closed form, contacts on sloping and skewed bridges, draws, bad input."""

import re
from collections import Counter
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import FAMILIES
from authoring.parts.pier_caps import CapShape, cap_surface
from authoring.parts.shafts import Shafts, fork_outline, limit_slenderness, shaft_base, shaft_outline, shaft_surfaces
from authoring.parts.wedges import road_slope, seat_slope
from authoring.shapes.component import F64, Component, triangles
from authoring.shapes.sections import area
from authoring.solids.sweep import Surface
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.bridges.built import STRAIGHT, Bridge, build_on, make_bridge, settings_of
from tests.conftest import Count

LEVEL = Alignment(10.0)
KINDS = ("wall", "single", "multi", "hammerhead", "pi_frame", "y", "v")
BENT: dict[str, Any] = {
    "service": "road",
    "grade": 0.04,
    "alignment": {"kind": "arc", "radius": 120.0, "skew": 22.0, "superelevation": 0.05},
}


def volume(surface: Surface | Component) -> float:
    """Signed volume by the divergence theorem [m3]."""
    mesh: Any = surface.mesh if isinstance(surface, Component) else surface
    a, b, c = np.moveaxis(mesh.points[triangles(mesh)] - mesh.points.mean(axis=0), 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def shafts(kind: str = "multi", shape: str = "rectangular", width: float = 2.0, **changes: float) -> Shafts:
    """A shaft 1.2 m along the bridge."""
    return Shafts(kind, shape, width, 1.2, (0.0,), changes.get("batter", 0.0), changes.get("arm", 0.0), 0.0)


@pytest.mark.parametrize(
    ("shape", "width", "plan"),
    [
        ("rectangular", 2.0, 2.4),
        ("octagonal", 1.2, 2.0 * (np.sqrt(2.0) - 1.0) * 1.2**2),
        ("octagonal", 2.0, 2.4 - 2.0 * 0.36**2),
        ("round", 1.2, 24.0 * 0.6**2 * np.sin(np.pi / 24.0)),
        ("round", 2.0, 1.2 * 0.8 + 12.0 * 0.6**2 * np.sin(np.pi / 12.0)),
    ],
)
def test_a_shaft_has_the_area_of_its_plan_times_its_height(shape: str, width: float, plan: float) -> None:
    """Rectangle, regular octagon, cut rectangle, 48-sided circle, rectangle with two round noses of 12 sides."""
    one = shafts("wall", shape, width)
    assert area(shaft_outline(one)) == pytest.approx(plan, rel=1e-12)
    (surface,) = shaft_surfaces(one, 20.0, -8.0, -3.0, LEVEL)
    assert volume(surface) == pytest.approx(5.0 * plan, rel=1e-12)
    np.testing.assert_allclose(surface.points[:, 2].min(), 2.0)


def test_a_battered_shaft_is_a_frustum() -> None:
    """Prismatoid rule over base, middle and top; its base is what the footing is laid out for."""
    one = shafts(batter=0.02)
    (surface,) = shaft_surfaces(one, 0.0, -10.0, -2.0, LEVEL)
    sizes = [(1.2 + 2.0 * g) * (2.0 + 2.0 * g) for g in (0.16, 0.08, 0.0)]
    assert volume(surface) == pytest.approx(8.0 / 6.0 * (sizes[0] + 4.0 * sizes[1] + sizes[2]), rel=1e-12)
    np.testing.assert_allclose(np.abs(surface.points[:, :2]).max(axis=0), shaft_base(one, 8.0), rtol=1e-12)


@pytest.mark.parametrize("kind", ["y", "v"])
@pytest.mark.parametrize(("height", "forked"), [(7.0, True), (1.2, False)])
def test_forks_open_where_there_is_room(kind: str, height: float, forked: bool) -> None:
    """The volume is the elevation's area times the thickness; a low pier only flares."""
    one = shafts(kind, width=1.6, arm=3.0)
    outline = fork_outline(one, -height, 0.0)
    assert (len(outline) == 10) == forked
    (surface,) = shaft_surfaces(one, 0.0, -height, 0.0, LEVEL)
    assert volume(surface) == pytest.approx(1.2 * area(outline), rel=1e-9)
    assert area(outline) > 1.6 * 0.3 * height
    np.testing.assert_allclose(outline[:, 0].max(), 3.0 + 0.3 * 1.6)


def test_shafts_grow_under_high_decks() -> None:
    """A column of 20 m at slenderness 10 is 2 m thick both ways, a wall only along the bridge; a low one stays."""
    column, wall = limit_slenderness(shafts(), 20.0, 10.0), limit_slenderness(shafts("wall", width=9.0), 20.0, 10.0)
    assert (column.length, column.width) == (2.0, pytest.approx(10.0 / 3.0, abs=1e-3))
    assert (wall.length, wall.width) == (2.0, 9.0)
    assert limit_slenderness(shafts(), 6.0, 10.0) == shafts()


def cap(kind: str, end: float, face: float = 0.0, upstand: float = 0.0) -> CapShape:
    """A cap of 10 x 1.5 x 1.2 m, flat over the middle 4 m."""
    return CapShape(kind, 10.0, 1.5, 1.2, end, 2.0, face, upstand, 0.0)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (cap("drop", 1.2), 10.0 * 1.2 * 1.5),
        (cap("tapered", 0.7), (10.0 * 1.2 - 3.0 * 0.5) * 1.5),
        # Chords of a parabola over six parts lose (1 + 1/72) thirds of the rectangle's rest.
        (cap("cantilevered", 0.6), (10.0 * 1.2 - 6.0 * 0.6 * (1.0 - (1.0 / 3.0 + 1.0 / 216.0))) * 1.5),
        (cap("integral", 1.2, face=1.6), (10.0 * 1.2 + 0.42**2) * 1.5),
        (cap("inverted_t", 1.2, upstand=0.3), 10.0 * (1.2 * 1.5 + 0.3 * 0.2)),
    ],
)
def test_each_cap_has_its_volume(shape: CapShape, expected: float) -> None:
    """Rectangle, trapezoids, parabolic arms, a frame's two knees, an inverted T's stem 0.2 m above the seat."""
    surface = cap_surface(shape, 15.0, -2.0, 0.2, LEVEL)
    assert volume(surface) == pytest.approx(expected, rel=1e-9)
    top = 8.2 if shape.upstand else 8.0
    np.testing.assert_allclose(surface.points[:, 2].max(), top)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_stands_square_and_symmetric(kind: str) -> None:
    """Mirrored about the axis each pier covers the same points; one cap and one footing; shafts of the right kind."""
    bridge = make_bridge(
        "beam", 4, **STRAIGHT, pier={"kind": kind}, beam={"spans": [20.0, 20.0]}, roadway={"lanes": 2}, service="road"
    )
    pier = [member for member in bridge.members if member.name.startswith("Pier_001")]
    words = Counter(member.name.split("_")[2] for member in pier)
    assert words["Cap"] == words["Footing"] == 1
    assert set(words) == {"Cap", "Footing", "Wall" if kind == "wall" else "Column"}
    assert {m.kind for m in pier} == {"pier_cap", "pier_footing", "wall_pier" if kind == "wall" else "column"}
    points = np.concatenate([member.mesh.points for member in pier]).round(6)
    mirrored = points * (1.0, -1.0, 1.0)
    assert {tuple(p) for p in (points + 0.0).tolist()} == {tuple(p) for p in (mirrored + 0.0).tolist()}


@pytest.mark.parametrize("family", FAMILIES)
def test_footings_lie_in_the_ground(family: str) -> None:
    """On land no footing or pile cap shows: soil covers each by 0.25 m; asked for, it shows by what was asked."""
    bridge = make_bridge(family, 3, abutment={"footing": True})
    feet = [m for m in bridge.members if m.kind.endswith("_footing") and "springing" not in m.parameters]
    assert feet
    for foot in feet:
        top = foot.mesh.points[:, 2].max()
        assert (bridge.ground(foot.mesh.points[:, :2]) - top).min() > 0.2, foot.name


def test_a_footing_shows_by_what_is_asked_for() -> None:
    """On level ground its top stands 0.3 m out of it."""
    settings = settings_of("beam", pier={"footing_top": 0.3}, beam={"spans": [20.0, 20.0]})
    layout, drawn = draw_layout(settings, stream(3, "bridge"))
    bridge = build_on("beam", 3, layout, drawn, lambda xy: np.zeros(len(xy)))
    (foot,) = (member for member in bridge.members if member.kind == "pier_footing")
    assert foot.mesh.points[:, 2].max() == pytest.approx(0.3, abs=1e-9)


def deck_heights(bridge: Bridge, points: F64, above: float) -> F64:
    """Height of the deck's surface moved by `above`, at plan positions [m]."""
    place = bridge.layout.alignment
    station, left = place.locate(points)
    return place.point(station, left, np.full(len(points), above))[:, 2]


@pytest.mark.parametrize("kind", ["pad", "pot"])
@pytest.mark.parametrize("pier", ["multi", "y"])
def test_bearings_meet_soffit_and_seat_on_a_bent_bridge(kind: str, pier: str) -> None:
    """On an arc with grade, crossfall and skew no corner of a sole plate or plinth is off by more than 5 mm."""
    bridge = make_bridge(
        "beam",
        5,
        **BENT,
        bearing={"kind": kind},
        pier={"kind": pier},
        roadway={"lanes": 2},
        beam={"spans": [24.0, 24.0]},
    )
    levels = bridge.drawn.record.levels
    found = {member.name: member for member in bridge.members}
    names = [name.removeprefix("Bearing_") for name in found if name.startswith("Bearing_")]
    assert len(names) == 4 * len(bridge.drawn.record.girders.lines)
    for where in names:
        points, plinth = (found[f"{word}_{where}"].mesh.points for word in ("Bearing", "Plinth"))
        plate, bearing = points[-8:], points[:-8]
        high = plate[plate[:, 2] > plate[:, 2].mean()]
        lift = high[:, 2] - deck_heights(bridge, high, levels.girder_soffit)
        assert np.abs(lift).max() < 0.005, where
        np.testing.assert_allclose(np.sort(plate[:, 2])[:4], plate[:, 2].min(), atol=1e-9)  # level below
        assert 0.0 <= bearing[:, 2].max() - plate[:, 2].min() < 0.005
        assert 0.0 <= plinth[:, 2].max() - bearing[:, 2].min() < 0.005
        assert plate[:, 2].max() - plate[:, 2].min() > 0.01
        span, end = int(where[:3]), int(where[4])
        station = bridge.layout.supports[span + end]
        frame = bridge.layout.alignment.straight_at(station)
        foot = plinth[:4]  # the first ring
        s, left = frame.locate(foot)
        seat = frame.point(s, left, np.full(4, levels.seat))[:, 2]
        assert np.all((seat - foot[:, 2] > 0.0) & (seat - foot[:, 2] < 0.02)), where


def test_slopes_are_those_of_the_deck() -> None:
    """Slopes in a support's frame agree with differences of the alignment itself."""
    bridge = make_bridge("beam", 5, **BENT)
    place = bridge.layout.alignment
    station = bridge.layout.supports[1]
    for along in (0, 1):
        frame, step = place.frame_at(station, turn=-place.skew), 0.05
        lefts = np.array([-step, step]) * along
        stations = station + np.array([-step, step]) * (1 - along)
        low, high = deck_heights(bridge, frame.point(stations, lefts, np.zeros(2)), 0.0)
        assert (high - low) / (2.0 * step) == pytest.approx(road_slope(place, station)[along], abs=1e-3)
    assert seat_slope(place, station) != road_slope(place, station)


def drawn_words(count: int) -> dict[str, Counter[str]]:
    """What options were drawn, over many bridges."""
    words: dict[str, Counter[str]] = {
        key: Counter() for key in ("kind", "cap", "shape", "bearing", "batter", "footing")
    }
    for seed in range(count):
        record = draw_layout(BridgeSettings(), stream(seed, "bridge"))[1].record
        words["bearing"][record.bearings.kind] += 1
        words["footing"][str(record.abutments.footing_toe > 0.0)] += 1
        words["kind"][record.piers.kind] += 1
        words["cap"][record.piers.cap] += 1
        words["shape"][record.piers.column_shape] += 1
        words["batter"][str(record.piers.batter > 0.0)] += 1
    return words


def test_every_option_is_drawn(proof_count: Count) -> None:
    """Each kind of pier, cap, section and bearing in at least 2 % of the draws."""
    count = proof_count(500, 2000)
    words = drawn_words(count)
    assert set(words["kind"]) == set(KINDS)
    assert set(words["cap"]) == {"drop", "tapered", "inverted_t", "cantilevered", "integral"}
    assert set(words["shape"]) == {"round", "octagonal", "rectangular"}
    assert set(words["bearing"]) == {"pad", "pot"}
    for key, found in words.items():
        assert len(found) > 1, key
        assert min(found.values()) >= 0.02 * count, (key, found)


def draw_one(settings: dict[str, Any]) -> Layout:
    """Draw one road bridge of two spans."""
    full = {"service": "road", "beam": {"spans": [18.0, 18.0]}, **settings}
    return draw_layout(parse_settings(BridgeSettings, full, "test"), stream(1, "bridge"))[0]


@pytest.mark.parametrize(
    ("settings", "field", "allowed"),
    [
        ({"pier": {"kind": "single", "columns": 3}}, "bridge.pier.columns", "1"),
        ({"pier": {"kind": "pi_frame", "columns": 4}}, "bridge.pier.columns", "2"),
        ({"pier": {"kind": "y", "columns": 2}}, "bridge.pier.columns", "leave it out"),
        ({"pier": {"kind": "wall", "cap": "cantilevered"}}, "bridge.pier.cap", "drop or inverted_t"),
        ({"pier": {"columns": 3, "cap": "integral"}}, "bridge.pier.cap", "drop, tapered or inverted_t"),
        ({"pier": {"kind": "single"}, "roadway": {"lanes": 6}}, "bridge.pier.kind", "multi or wall"),
        (
            {"pier": {"cap": "inverted_t", "kind": "multi"}, "bearing": {"kind": "pot", "pot_width": 0.5}},
            "bridge.pier.cap",
            "drop or tapered",
        ),
        ({"bearing": {"kind": "pot", "pot_width": 0.9}}, "bridge.bearing.pot_width", "at most"),
    ],
)
def test_contradictions_name_key_and_way_out(settings: dict[str, Any], field: str, allowed: str) -> None:
    """One line with the key, the rule and the nearest valid choice."""
    with pytest.raises(InputError, match=re.escape(field)) as caught:
        draw_one({**settings, "beam": {"spans": [18.0, 18.0], "girder": {"shape": "i"}, "gap": 0.02, "overhang": 0.3}})
    assert allowed in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fixed", "kinds"),
    [
        ({"columns": 4}, {"multi"}),
        ({"cap": "cantilevered"}, {"hammerhead"}),
        ({"columns": 1}, {"single", "hammerhead"}),
    ],
)
def test_what_is_fixed_narrows_the_draw(fixed: dict[str, Any], kinds: set[str]) -> None:
    """A fixed cap or number of columns leaves only the kinds that have it."""
    settings = parse_settings(BridgeSettings, {"pier": fixed, "service": "road", "roadway": {"lanes": 2}}, "test")
    found = {draw_layout(settings, stream(seed, "bridge"))[1].record.piers.kind for seed in range(20)}
    assert found == kinds
