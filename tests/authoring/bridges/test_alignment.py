"""Alignments: closed forms, a map without folds and its exact inverse, rings of sweeps, frames at supports."""

import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.special import fresnel

from authoring.axis.alignment import FAR, NEAR, Alignment, VerticalCurve
from authoring.axis.plan_curve import Element, PlanCurve, sine_elements
from authoring.families.alignments import LARGEST_TURN
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.parts.spans import level_at
from authoring.shapes.component import F64
from authoring.shapes.sections import rectangle
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import sweep
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.conftest import Count

NONE = np.zeros(1)


def drawn(seed: int, **alignment: Any) -> Alignment:
    """Draw the axis of a beam bridge."""
    settings = {"service": "road", "beam": {"spans": [20.0, 30.0]}, "alignment": alignment}
    return draw_layout(parse_settings(BridgeSettings, settings, "test"), stream(seed, "bridge"))[0].alignment


def curved(seed: int) -> Alignment:
    """Draw an axis that is not straight, with a skew, a crest and a heading of its own."""
    rng = np.random.default_rng(seed)
    kind = ("arc", "clothoid", "s", "sine")[seed % 4]
    skew, heading = rng.uniform(-30.0, 30.0), rng.uniform(-180.0, 180.0)
    own = {"wave": 60.0, "amplitude": 15.0} if kind == "sine" else {}
    settings = {
        "service": "road",
        "beam": {"spans": [20.0, 15.0, 25.0]},
        "heading": heading,
        "alignment": {"kind": kind, "skew": skew, "profile": "crest", **own},
    }
    return draw_layout(parse_settings(BridgeSettings, settings, "test"), stream(seed, "bridge"))[0].alignment


def tightest() -> list[Alignment]:
    """List the axes that bend hardest and turn widest for their skew, either way, as an arc and as an S."""
    axes = []
    for skew in np.radians([-30.0, -15.0, 0.0, 15.0, 30.0]):
        for sign in (-1.0, 1.0):
            bend = sign * float(np.cos(skew)) ** 2 / 60.0
            length = 2.0 * LARGEST_TURN / abs(bend)
            arc, back = Element(0.5 * length, bend, bend), Element(0.5 * length, -bend, -bend)
            plans = ((Element(length, bend, bend),), (arc, Element(4.0, bend, -bend), back))
            axes += [Alignment(0.0, plan=plan, skew=float(skew)) for plan in plans]
    return axes


def places(seed: int, count: int) -> tuple[F64, F64]:
    """Scatter bridge coordinates: half over the site, half over four kilometers."""
    rng = np.random.default_rng(seed)
    near = rng.uniform([-140.0, -90.0], [200.0, 90.0], (count // 2, 2))
    far = rng.uniform(-4000.0, 4000.0, (count - count // 2, 2))
    station, left = np.concatenate([near, far]).T
    return station, left


def area(axis: Alignment, station: F64, left: F64) -> F64:
    """Find how much world area a piece of bridge coordinates covers."""
    (a, b), (c, d) = (slope.T for slope in axis.slopes(station, left))
    return a * d - b * c


def test_arc_has_the_chord_sagitta_and_headings_of_a_circle() -> None:
    """Chord 2 R sin(L / 2R), sagitta R (1 - cos(L / 2R)), end headings L / 2R off the chord, straight on beyond."""
    radius, length, heading = 75.0, 60.0, 0.7
    axis = Alignment(5.0, heading=heading, plan=(Element(length, 1.0 / radius, 1.0 / radius),))
    half = 0.5 * length / radius
    first, middle, last, beyond = axis.point(np.array([0.0, 30.0, 60.0, 90.0]), np.zeros(4), np.zeros(4))[:, :2]
    assert np.linalg.norm(last - first) == pytest.approx(2.0 * radius * np.sin(half), abs=1e-12)
    chord, normal = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    np.testing.assert_allclose(first, 0.0, atol=1e-12)
    assert last @ normal == pytest.approx(0.0, abs=1e-12)
    assert middle @ normal == pytest.approx(-radius * (1.0 - np.cos(half)), abs=1e-12)
    np.testing.assert_allclose(axis.heading_at(np.array([0.0, 60.0, 90.0])), heading + np.array([-half, half, half]))
    np.testing.assert_allclose(beyond - last, 30.0 * np.array([np.cos(heading + half), np.sin(heading + half)]))
    edge = axis.point(np.linspace(0.0, 60.0, 50), np.full(50, 6.0), np.zeros(50))[:, :2]
    center = 0.5 * last - (chord * 0.0 - normal) * radius * np.cos(half)
    np.testing.assert_allclose(np.linalg.norm(edge - center, axis=1), radius - 6.0, atol=1e-12)


def test_clothoid_is_the_fresnel_integral() -> None:
    """From a straight tangent the clothoid of parameter A is A sqrt(pi) (C, S)(s / (A sqrt(pi)))."""
    length, radius = 40.0, 70.0
    scale = np.sqrt(length * radius * np.pi)
    curve = PlanCurve((Element(length, 0.0, 1.0 / radius),))
    station = np.linspace(0.0, length, 60)
    sine, cosine = fresnel(station / scale)
    turn = curve.first_heading
    exact = scale * np.stack([cosine, sine], axis=1) @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    np.testing.assert_allclose(curve.points(station), exact, atol=1e-11)
    np.testing.assert_allclose(curve.headings(station), turn + station**2 / (2.0 * length * radius), atol=1e-14)
    np.testing.assert_allclose(curve.curvatures(station), station / (length * radius), atol=1e-15)


def test_sine_follows_the_wave() -> None:
    """Turned back into its own axes the curve is y = a sin(x / b), to three millimeters over 150 m."""
    a, b = 12.0, 60.0
    curve = PlanCurve(sine_elements(a, b, 150.0))
    turn = np.arctan(a / b) - curve.first_heading
    x, y = (
        curve.points(np.linspace(0.0, 150.0, 400)) @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    ).T
    np.testing.assert_allclose(y, a * np.sin(x / b), atol=3e-3)


@pytest.mark.parametrize("skew", [0.0, 0.4])
def test_straight_axis_keeps_its_closed_forms(skew: float) -> None:
    """Without skew the old formula to the last bit; with one a shear along the axis that fades out."""
    axis = Alignment(7.0, 0.02, 0.4, skew=skew)
    station, left = places(1, 200)
    x, y, z = axis.point(station, left, np.full(200, 0.3)).T
    cosine, sine = np.cos(0.4), np.sin(0.4)
    if skew == 0.0:
        assert np.array_equal(x, station * cosine - left * sine)
        assert np.array_equal(y, station * sine + left * cosine)
        assert np.array_equal(z, 7.0 + 0.02 * station + 0.3)
    along = x * cosine + y * sine - station
    near, beside = np.abs(left) < NEAR, np.abs(left) > FAR
    np.testing.assert_allclose(along[near], np.tan(skew) * left[near], atol=1e-12)
    np.testing.assert_allclose(along[beside], np.tan(skew) * np.sign(left[beside]) * (NEAR + FAR) / 2.0, atol=1e-9)
    np.testing.assert_allclose(y * cosine - x * sine, left, atol=1e-9)


def test_locate_undoes_point(proof_count: Count) -> None:
    """Random axes, places on the bridge and four kilometers off: identity within a nanometer."""
    for seed, axis in enumerate([*tightest(), *(curved(seed) for seed in range(proof_count(24, 400)))]):
        station, left = places(seed, 600)
        found = axis.locate(axis.point(station, left, np.zeros(600)))
        np.testing.assert_allclose(found, (station, left), atol=1e-9)


def test_map_never_folds(proof_count: Count) -> None:
    """The area of the map stays above zero, also for the tightest curve with the widest turn and the largest skew."""
    station, left = (
        grid.ravel() for grid in np.meshgrid(np.linspace(-300.0, 400.0, 141), np.linspace(-90.0, 90.0, 91))
    )
    for axis in tightest():
        assert area(axis, station, left).min() > 0.1
    for seed in range(proof_count(24, 400)):
        axis = curved(seed)
        assert axis.curve is not None
        assert axis.curve.largest_turn <= LARGEST_TURN + 1e-9
        assert area(axis, station, left).min() > 0.15


def test_slopes_are_the_derivatives_of_point() -> None:
    """Against central differences, away from the joints between elements."""
    axis, step = curved(1), 1e-5
    station, left = places(3, 300)
    for slope, shift in zip(axis.slopes(station, left), ((step, 0.0), (0.0, step)), strict=True):
        ahead = axis.point(station + shift[0], left + shift[1], np.zeros(300))
        behind = axis.point(station - shift[0], left - shift[1], np.zeros(300))
        np.testing.assert_allclose((ahead - behind)[:, :2] / (2.0 * step), slope, atol=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_rings_keep_chords_within_a_centimeter(seed: int) -> None:
    """Between two rings no line of the bridge leaves its chord by more than 10 mm; a straight bridge needs none."""
    axis = curved(seed)
    rings = np.concatenate([[-9.0], axis.steps(-9.0, 69.0), [69.0]])
    assert np.all(np.diff(rings) > 0.0)
    share = np.linspace(0.0, 1.0, 9)
    for low, high in pairwise(rings):
        for left in (-11.0, 0.0, 11.0):
            line = axis.point(low + share * (high - low), np.full(9, left), np.zeros(9))
            chord = line[-1] - line[0]
            off = np.linalg.norm(np.cross(line - line[0], chord), axis=1) / np.linalg.norm(chord)
            assert off.max() < 0.010
    assert len(drawn(seed, kind="straight", profile="grade").steps(-9.0, 69.0)) == 0


def test_a_curved_prism_bends_with_its_axis() -> None:
    """Volume area times length of the centroid's arc (Pappus), texture lengths the arc's, corners on the curve."""
    radius = 80.0
    axis = Alignment(0.0, plan=(Element(60.0, 1.0 / radius, 1.0 / radius),))
    solid = Prism(rectangle((3.0, -1.0), (5.0, 0.0)), 2.0, 50.0, "station", axis, 0.02).surface
    at = solid.points[solid.corners]
    starts = np.concatenate([[0], np.cumsum(solid.face_counts)[:-1]])
    volume = 0.0
    for start, count in zip(starts, solid.face_counts, strict=True):
        for k in range(1, count - 1):
            volume += float(np.linalg.det(at[[start, start + k, start + k + 1]])) / 6.0
    assert volume == pytest.approx(2.0 * 48.0 * (radius - 4.0) / radius, rel=2e-3)
    sides = np.repeat(solid.chart == 0, solid.face_counts)
    assert np.ptp(solid.st[sides, 0]) == pytest.approx(48.0 * (radius - 4.0) / radius, rel=2e-3)
    station, left = axis.locate(solid.points)
    assert np.abs(np.abs(left - 4.0) - 1.0).max() < 0.021
    assert (station.min(), station.max()) == pytest.approx((2.0, 50.0), abs=1e-9)


def test_a_sweep_between_two_sections_bends_and_tapers_evenly() -> None:
    """Rings between the given ones hold the section in proportion; texture lengths grow with the arc, or as given."""
    axis = Alignment(0.0, plan=(Element(60.0, 1.0 / 80.0, 1.0 / 80.0),))
    sections = np.stack([rectangle((-1.0, -1.0), (1.0, 0.0)), rectangle((-2.0, -1.0), (2.0, 0.0))])
    for lengths in (None, np.array([0.0, 7.0])):
        solid = sweep(sections, np.array([5.0, 45.0]), "station", axis, lengths=lengths)
        station, left = axis.locate(solid.points)
        assert len(np.unique(np.round(station, 6))) == len(axis.steps(5.0, 45.0)) + 2 > 10
        np.testing.assert_allclose(np.abs(left), 1.0 + (station - 5.0) / 40.0, atol=1e-9)
        assert solid.points[:, 2].min() == pytest.approx(-1.0)
        sides = np.repeat(solid.chart == 0, solid.face_counts)
        assert np.ptp(solid.st[sides, 0]) == pytest.approx(40.0 if lengths is None else 7.0, rel=5e-3)
        along = (station[solid.corners][sides] - 5.0) / 40.0
        u = np.abs(solid.st[sides, 0] - solid.st[sides, 0][np.argmin(along)])
        np.testing.assert_allclose(u / u.max(), along, atol=0.01)


def test_crest_is_a_parabola_between_its_tangents() -> None:
    """In the middle the crest lies L^2 / 8R under the tangents' meeting point; beyond, the grade has changed by L/R."""
    axis = Alignment(10.0, 0.03, crest=VerticalCurve(0.0, 60.0, 1200.0))
    assert axis.height(np.array(30.0)) == pytest.approx(10.0 + 0.03 * 30.0 - 30.0**2 / 2400.0)
    assert axis.height(np.array(60.0)) == pytest.approx(10.0 + 30.0 * (0.03 - 0.02))
    assert axis.height(np.array(100.0)) == pytest.approx(10.0 + 0.3 + 40.0 * -0.02)
    np.testing.assert_allclose(axis.grade_at(np.array([-5.0, 30.0, 80.0])), [0.03, 0.005, -0.02], atol=1e-15)


def test_superelevation_is_a_plumb_shear_that_fades_out() -> None:
    """Inside the arc the road falls towards the center by the crossfall; webs stay plumb; the approaches are level."""
    axis = drawn(5, kind="arc", turn="left", radius=150.0, superelevation=0.06, skew=0.0)
    station, left = np.meshgrid([0.0, 17.0, 50.0], [-5.0, 0.0, 4.0])
    rise = axis.point(station, left, np.zeros_like(left))[..., 2] - axis.height(station)
    np.testing.assert_allclose(rise, -0.06 * left, atol=1e-12)
    high, low = (axis.point(np.full(1, 20.0), np.full(1, 4.0), np.full(1, above)) for above in (0.0, -1.5))
    np.testing.assert_allclose(high - low, [[0.0, 0.0, 1.5]], atol=1e-12)
    assert axis.crossfall(np.array([-60.0, 110.0])).tolist() == [0.0, 0.0]
    s = drawn(5, kind="s", turn="left", radius=150.0, superelevation=0.03, skew=0.0)
    falls = s.crossfall(np.array([2.0, 25.0, 48.0]))
    np.testing.assert_allclose(falls, [-0.03, 0.0, 0.03], atol=1e-9)


def test_supports_of_a_skewed_bridge_are_parallel_and_girders_keep_their_distance() -> None:
    """On a straight axis every support line runs at the skew against the square; lines stay parallel to the axis."""
    skew = float(np.radians(25.0))
    axis = Alignment(5.0, 0.01, 0.3, skew=skew)
    ends = [axis.point(np.full(2, s), np.array([-6.0, 6.0]), np.zeros(2))[:, :2] for s in (0.0, 20.0, 45.0)]
    for low, high in ends:
        along = high - low
        assert np.linalg.norm(along) == pytest.approx(12.0 / np.cos(skew))
        assert np.arctan2(along[1], along[0]) == pytest.approx(0.3 + np.pi / 2.0 - skew)
    apart = np.abs(np.cross(np.append(ends[1][0] - ends[0][0], 0.0), np.append(ends[0][1] - ends[0][0], 0.0))[2])
    assert apart / (12.0 / np.cos(skew)) == pytest.approx(20.0 * np.cos(skew))


@pytest.mark.parametrize("seed", range(6))
def test_frames_meet_the_bridge_where_they_stand(seed: int) -> None:
    """A support's frame agrees on its whole line; a right-angled frame at its place, with right angles and meters."""
    axis = curved(seed)
    left = np.linspace(-12.0, 12.0, 7)
    station, above = np.full(7, 20.0), np.linspace(-3.0, 1.0, 7)
    level = level_at(axis, 20.0)
    np.testing.assert_allclose(level.point(station, left, above), axis.point(station, left, above), atol=1e-9)
    assert level.steps(-50.0, 50.0).size == 0
    ahead = level.point(np.full(1, 21.0), NONE, NONE) - level.point(np.full(1, 20.0), NONE, NONE)
    heading = axis.heading_at(np.array(20.0))
    np.testing.assert_allclose(ahead, [[np.cos(heading), np.sin(heading), 0.0]], atol=1e-12)
    for tilted in (False, True):
        frame = axis.frame_at(20.0, 3.5, turn=-axis.skew, tilted=tilted)
        here, there = (place.point(np.full(1, 20.0), np.full(1, 3.5), np.full(1, -2.0)) for place in (frame, axis))
        np.testing.assert_allclose(here, there, atol=1e-9)
        along, across = (
            (frame.point(np.full(1, 20.0 + s), np.full(1, 3.5 + t), NONE) - here)[0, :2] for s, t in ((1, 0), (0, 1))
        )
        assert along @ across == pytest.approx(0.0, abs=1e-12)
        assert np.hypot(*along) == pytest.approx(1.0)
        line = axis.point(np.full(1, 20.0), np.full(1, 4.5), NONE)[0, :2] - there[0, :2]
        assert abs(np.cross(np.append(across, 0.0), np.append(line, 0.0))[2]) < 1e-9


def test_frames_of_a_straight_bridge_are_its_own_axes() -> None:
    """No origin is moved and no heading turned, so that numbers stay the same to the last bit."""
    axis = Alignment(7.0, 0.02, 0.4)
    expected = Alignment(7.0 + 0.02 * 18.0, 0.0, 0.4)
    assert axis.frame_at(18.0, 3.0) == expected
    assert level_at(axis, 18.0) == expected


def test_draws_have_their_shares_and_keep_their_bounds(proof_count: Count) -> None:
    """Every kind, profile and skew occurs about as often as stated, and radii, grades and clearances hold."""
    count = proof_count(200, 2000)
    found = {"straight": 0, "skew": 0, "crest": 0, "sag": 0}
    for seed in range(count):
        axis = drawn(seed)
        found["straight"] += not axis.plan
        found["skew"] += axis.skew != 0.0
        found["crest"] += axis.crest is not None and axis.crest.radius > 0.0
        found["sag"] += axis.crest is not None and axis.crest.radius < 0.0
        assert abs(axis.skew) <= np.radians(30.0) + 1e-12
        bends = [abs(value) for element in axis.plan for value in (element.begin, element.end)]
        assert max(bends, default=0.0) <= np.cos(axis.skew) ** 2 / 60.0
        stations = np.linspace(0.0, 50.0, 11)
        assert np.abs(axis.grade_at(stations)).max() <= 0.05 + 1e-6
        assert np.abs(axis.crossfall(stations)).max() <= 0.06
    for key, share in (("straight", 0.4), ("skew", 0.4), ("crest", 0.3), ("sag", 0.1)):
        assert found[key] / count == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / count)), key


@pytest.mark.parametrize(
    ("settings", "field", "nearest"),
    [
        ({"alignment": {"kind": "arc", "radius": 60.0, "skew": 25.0}}, "bridge.alignment.radius", 73.1),
        (
            {"alignment": {"kind": "arc", "radius": 80.0, "skew": 0.0}, "beam": {"spans": [60.0, 60.0]}},
            "bridge.alignment.radius",
            98.4,
        ),
        (
            {"service": "rail_single", "alignment": {"kind": "clothoid", "radius": 120.0, "skew": 0.0}, "grade": 0.01},
            "bridge.alignment.radius",
            300.0,
        ),
        ({"service": "rail_single", "grade": 0.04}, "bridge.grade", 0.025),
        (
            {
                "alignment": {"kind": "sine", "amplitude": 20.0, "wave": 40.0, "skew": 30.0},
                "beam": {"spans": [30.0] * 4},
            },
            "bridge.alignment.amplitude",
            None,
        ),
        (
            {"grade": 0.045, "alignment": {"profile": "crest", "crest_radius": 400.0}, "beam": {"spans": [40.0]}},
            "bridge.alignment.crest_radius",
            4000.0,
        ),
    ],
)
def test_impossible_axis_names_key_rule_and_nearest_value(
    settings: dict[str, Any], field: str, nearest: float | None
) -> None:
    """The nearest valid value that the message names is accepted, the asked one is not."""
    settings = {"service": "road", **settings}

    def attempt() -> Alignment:
        return draw_layout(parse_settings(BridgeSettings, settings, "test"), stream(1, "bridge"))[0].alignment

    with pytest.raises(InputError, match=re.escape(field)) as caught:
        attempt()
    message = str(caught.value)
    assert "\n" not in message
    named = re.search(r"nearest valid value is ([\d.]+\d)", message)
    assert named is not None, message
    value = float(named[1])
    assert nearest is None or value == pytest.approx(nearest, abs=0.15)
    path = field.split(".")[1:]
    settings = {**settings, path[0]: value if len(path) == 1 else {**settings[path[0]], path[1]: value}}
    attempt()


def test_what_is_drawn_gives_way_to_what_is_fixed() -> None:
    """A tight radius leaves no room for a drawn skew, and a tight crest none for a drawn grade: no error for either."""
    tight = [drawn(seed, kind="arc", radius=66.0) for seed in range(60)]
    assert max(abs(axis.skew) for axis in tight) == pytest.approx(np.arccos(np.sqrt(60.0 / 66.0)))
    humped = [drawn(seed, kind="straight", profile="crest", crest_radius=700.0) for seed in range(60)]
    ends = np.array([axis.grade_at(np.array([0.0, 50.0])) for axis in humped])
    assert np.abs(ends).max() == pytest.approx(0.05, abs=1e-5)
    assert all(axis.crest is not None and axis.crest.radius == 700.0 for axis in humped)
