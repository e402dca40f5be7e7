"""Steel girder bridges: closed forms of plates, spacing and depth rules, haunches, frames, splices and bad input."""

import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.girder import DrawnGirder, build_girder
from authoring.parts.frame_shapes import pierced_plate
from authoring.parts.part import Part
from authoring.parts.plate_girders import EMBEDDED, section
from authoring.parts.splices import HALF_LENGTH
from authoring.shapes.component import F64
from authoring.shapes.sections import area
from authoring.solids.setting_out import bolts, in_one_chart, plates, to_world
from authoring.solids.sweep import Surface
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings

MULTI = {"arrangement": "multi"}
PLAIN: dict[str, Any] = {
    "service": "road",
    "grade": 0.0,
    "alignment": {"kind": "straight", "profile": "grade", "skew": 0.0},
    "roadway": {"lanes": 2, "lane_width": 3.5, "shoulder": 0.5, "footway": False},
}


def flat(xy: F64) -> F64:
    """Level ground."""
    return np.zeros(len(xy))


def make(seed: int, girder: dict[str, Any] | None = None, **bridge: Any) -> tuple[DrawnGirder, dict[str, Part]]:
    """Draw and build one bridge: its record, and its parts by name."""
    settings = {"family": "girder", "girder": girder or {}, **bridge}
    layout, drawn = draw_layout(parse_settings(BridgeSettings, settings, "test"), stream(seed, "bridge"))
    return drawn.record, {part.name: part for part in build_girder(layout, drawn.record, flat)}


def of_kind(parts: dict[str, Part], kind: str) -> list[Part]:
    """List the parts of a kind."""
    return [part for part in parts.values() if part.kind == kind]


def volume(surface: Surface) -> float:
    """Signed volume by the divergence theorem [m3]."""
    points = surface.points - surface.points.mean(axis=0)
    starts = np.cumsum(surface.face_counts) - surface.face_counts
    total = 0.0
    for start, count in zip(starts, surface.face_counts, strict=True):
        ring = points[surface.corners[start : start + count]]
        total += sum(float(ring[0] @ np.cross(ring[k], ring[k + 1])) for k in range(1, count - 1)) / 6.0
    return total


def lowest_at(surface: Surface, x: float) -> float:
    """Find the lowest point of an end face [m]."""
    return float(surface.points[surface.points[:, 0] == x, 2].min())


@pytest.mark.parametrize("axis", ["station", "left", "above"])
def test_plates_and_bolts_have_their_volume_and_look_outward(axis: Any) -> None:
    """Boxes and hexagons by their closed forms, on each axis; normals and winding agree; one chart holds them all."""
    low, high = np.array([[0.0, 1.0, 2.0], [5.0, 5.0, 5.0]]), np.array([[0.5, 1.2, 2.1], [6.0, 8.0, 9.0]])
    box = to_world([in_one_chart(plates(low, high, axis))], Alignment(4.0, 0.0, 0.7))[0]
    assert volume(box) == pytest.approx(0.5 * 0.2 * 0.1 + 1.0 * 3.0 * 4.0)
    assert box.points[:, 2].max() == pytest.approx(13.0)
    assert set(box.chart.tolist()) == {0}
    hexagon = to_world([bolts(low, 0.06, (-0.002, 0.02), axis)], Alignment(0.0))[0]
    assert volume(hexagon) == pytest.approx(2 * 0.022 * 1.5 * np.sqrt(3.0) * 0.03**2)
    for surface in (box, hexagon):
        a, b, c = surface.points[surface.corners.reshape(-1, 3)].transpose(1, 0, 2)
        facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), surface.normals[::3])
        np.testing.assert_allclose(facing, np.linalg.norm(np.cross(b - a, c - a), axis=1))


def test_girder_and_slab_have_the_volume_of_their_sections() -> None:
    """A straight level bridge: flanges, web and embedment add up; the box is its trapezoid and lips."""
    record, parts = make(3, {"spans": [30.0], "steel": {"arrangement": "multi"}}, **PLAIN)
    g, girder = record.steel, parts["PlateGirder_000_00"]
    plate = g.flange * (g.bottom_width + g.top_width) + g.web * (g.depth - 2.0 * g.flange) + EMBEDDED * g.top_width
    low, high = record.spans.ends(0)
    assert volume(girder.surface) == pytest.approx(plate * (high - low - 0.024))
    assert girder.parameters["length"] == pytest.approx(high - low - 0.024)
    box, parts = make(3, {"spans": [30.0], "steel": {"arrangement": "box"}}, **PLAIN)
    g = box.steel
    half = 0.5 * g.top_width - 0.2
    webs = [half - 0.22 * (g.depth - g.flange), half - 0.22 * g.flange]
    trapezoid = sum(webs) * (g.depth - 2.0 * g.flange)
    lips = g.flange * (2.0 * (webs[0] + 0.05) + g.top_width) + EMBEDDED * g.top_width
    assert area(section(g, g.depth)) == pytest.approx(trapezoid + lips)
    assert len(of_kind(parts, "plate_girder")) == 1
    assert len({part.parameters["line"] for part in parts.values() if part.name.startswith("Plinth")}) == 2


def test_rules_hold_over_many_seeds(proof_count: Any) -> None:
    """Spacing, overhang, flange and depth stay in their bands, and every arrangement and haunch occurs."""
    seen: set[Any] = set()
    for seed in range(proof_count(120, 600)):
        _, drawn = draw_layout(parse_settings(BridgeSettings, {"family": "girder"}, "test"), stream(seed, "bridge"))
        record, g = drawn.record, drawn.record.steel
        lengths, width = np.diff(record.spans.supports), record.top.width
        assert 18.0 - 1e-9 <= lengths.min() <= lengths.max() <= 60.0
        slimmer = 1.0 if g.haunch == "none" else 1.25
        assert g.depth == 0.70 or 19.8 <= lengths.max() / g.depth / slimmer <= 28.3
        assert 1.49 <= g.pier_depth / g.depth <= 2.02 if g.haunch != "none" else g.pier_depth == g.depth
        np.testing.assert_allclose(g.lines, -np.array(g.lines)[::-1], atol=2e-3)
        assert g.bottom_width >= g.top_width or g.box
        assert max(g.bearing_lines) + 0.5 * record.bearings.pad_width < 0.5 * width
        if g.arrangement == "multi":
            assert np.diff(g.lines).min() >= 2.0
            assert np.diff(g.lines).max() <= 3.8
            assert 0.3 <= 0.5 * width - g.lines[-1] <= 1.8, (seed, width)
        assert not (g.haunch != "none" and not record.spans.one_row)
        seen |= {g.arrangement, g.haunch, record.frames.kind, record.frames.laterals, ("through", record.spans.one_row)}
    assert seen >= {"multi", "ladder", "box", "none", "parabolic", "straight", "x", "k", "solid", True, False}
    assert seen >= {("through", True), ("through", False)}


@pytest.mark.parametrize("haunch", ["parabolic", "straight"])
def test_haunches_are_continuous_and_meet_their_bearings(haunch: str) -> None:
    """Soffits of neighboring pieces meet, are deepest over the piers, and the seats follow."""
    steel = {"arrangement": "multi", "haunch": haunch, "count": 4}
    record, parts = make(5, {"spans": [32.0, 44.0, 32.0], "continuous": True, "steel": steel}, **PLAIN)
    g, spans = record.steel, record.spans
    stations = np.linspace(0.0, 108.0, 1081)
    depth = g.depths(spans, stations)
    assert np.abs(np.diff(depth)).max() < 0.1 * 2.5 * g.pier_depth / (g.haunch_reach * 32.0)
    assert (depth.min(), depth.max()) == pytest.approx((g.depth, g.pier_depth))
    np.testing.assert_allclose(depth[[320, 760]], g.pier_depth)
    np.testing.assert_allclose(depth, depth[::-1], atol=1e-9)
    line = [part for part in of_kind(parts, "plate_girder") if part.parameters["line"] == 0]
    ends = [lowest_at(part.surface, part.surface.points[:, 0].max()) for part in line]
    begins = [
        part.surface.points[part.surface.points[:, 0] == part.surface.points[:, 0].min(), 2].min() for part in line
    ]
    np.testing.assert_allclose(ends[:-1], begins[1:], atol=2e-3)
    deep = g.pier_depth - g.depth
    caps = [parts[f"Pier_{k:03d}_Cap"].surface.points[:, 2].max() for k in (1, 2)]
    seat = parts["Abutment_000_Wall"].surface.points[:, 2].max()
    np.testing.assert_allclose(seat - np.array(caps), deep, atol=0.06)


@pytest.mark.parametrize(("arrangement", "kind"), [("multi", "x"), ("multi", "k"), ("multi", "solid"), ("ladder", "x")])
def test_frames_stand_at_every_row_and_reach_both_girders(arrangement: str, kind: str) -> None:
    """Frames lie no further apart than said, one at each row of bearings, from stiffener to stiffener or web to web."""
    settings = {
        "spans": [30.0, 36.0],
        "continuous": True,
        "steel": {"arrangement": arrangement},
        "frames": {"kind": kind} if arrangement == "multi" else {},
    }
    record, parts = make(4, settings, **PLAIN)
    frames = of_kind(parts, "floor_beam" if arrangement == "ladder" else "cross_frame")
    frames = [part for part in frames if part.parameters["type"] != "lateral"]
    at = sorted({float(str(part.parameters["station"])) for part in frames})
    assert set(record.spans.supports) <= set(at)
    assert max(np.diff(at)) <= record.frames.pitch + 2.0 * (HALF_LENGTH + 0.60)
    assert len(frames) == len(at) * (len(record.steel.lines) - 1)
    lines = np.array(record.steel.lines)
    for part in frames:
        left = part.surface.points[:, 1]
        bay = int(part.name.split("_")[-1])
        reach = 0.5 * record.steel.bottom_width
        assert lines[bay] - 1e-6 <= left.min() <= lines[bay] + reach
        assert lines[bay + 1] - reach <= left.max() <= lines[bay + 1] + 1e-6
        heights = part.surface.points[:, 2] - parts["Surfacing_000"].surface.points[:, 2].max()
        assert record.pier_levels.girder_soffit < heights.min() < heights.max() < record.levels.soffit


def test_splices_bridge_the_gaps_of_continuous_girders() -> None:
    """Every gap between two pieces is 8 mm wide, about a quarter of the span from a pier, and covered by a splice."""
    record, parts = make(
        6, {"spans": [40.0, 50.0, 40.0], "continuous": True, "steel": {"arrangement": "multi"}}, **PLAIN
    )
    lines = len(record.steel.lines)
    pieces = [part for part in of_kind(parts, "plate_girder") if part.parameters["line"] == 0]
    spans = [(part.surface.points[:, 0].min(), part.surface.points[:, 0].max()) for part in pieces]
    gaps = [(one[1], two[0]) for one, two in pairwise(spans)]
    splice = of_kind(parts, "splice_plate")
    assert (len(gaps), len(splice)) == (4, 4 * lines)
    for number, (low, high) in enumerate(gaps):
        assert high - low == pytest.approx(0.008, abs=1e-6)
        pier = np.abs(np.array(record.spans.supports) - low)
        assert 0.19 * 40.0 <= pier.min() <= 0.26 * 50.0
        points = parts[f"Splice_{number:03d}_00"].surface.points
        assert points[:, 0].min() == pytest.approx(0.5 * (low + high) - HALF_LENGTH, abs=2e-3)
        assert points[:, 0].max() == pytest.approx(0.5 * (low + high) + HALF_LENGTH, abs=2e-3)
    assert not of_kind(make(6, {"spans": [40.0, 50.0], "continuous": False})[1], "splice_plate")
    plain = {"spans": [40.0, 50.0], "continuous": True, "steel": {"splices": False, "arrangement": "multi"}}
    assert not of_kind(make(6, plain)[1], "splice_plate")


def test_pierced_plate_is_a_plate_less_four_triangles() -> None:
    """Closed, of genus four, and its volume is that of the rectangle without its holes."""
    record, _ = make(1, profile="paper", **{key: PLAIN[key] for key in ("grade", "alignment")})
    g = record.steel
    surface = pierced_plate(g, g.depth, 2.5, 0.5)
    faces = surface.corners.reshape(-1, 3)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert {(a, b) for a, b in edges.tolist()} == {(b, a) for a, b in edges.tolist()}
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert len(surface.points) - len(edges) // 2 + len(faces) == 2 - 2 * 4
    solid = 0.5 * (2.5 - g.web + 0.008) * (g.depth - 2.0 * g.flange + 0.008)
    assert 0.3 * solid < volume(surface) < 0.95 * solid


def test_paper_profile_is_the_generators_bridge() -> None:
    """Four lines at eighths of the width, 1.2 deep and 1.0 wide, plates of 0.1, pierced plates, spans of 10 m."""
    for seed in range(2):
        record, parts = make(seed, profile="paper")
        g, width = record.steel, record.top.width
        np.testing.assert_allclose(g.lines, width * np.array([-3, -1, 1, 3]) / 8.0, atol=1e-3)
        assert (g.depth, g.pier_depth, g.flange, g.web, g.fillet) == (1.2, 1.2, 0.1, 0.1, 0.0)
        assert g.bottom_width == g.top_width == pytest.approx(1.0, abs=1e-3)
        assert set(np.diff(record.spans.supports).round(3)) == {10.0}
        assert {part.parameters["type"] for part in of_kind(parts, "cross_frame")} == {"plate"}
        assert not of_kind(parts, "stiffener") + of_kind(parts, "splice_plate")


def test_a_long_bridge_stays_within_its_parts() -> None:
    """Eight wide spans of 60 m: fewer than 1,500 parts, each name once."""
    wide = {"roadway": {"lanes": 4, "lane_width": 3.5, "footway": True}, "service": "road"}
    record, parts = make(2, {"spans": [60.0] * 8, "continuous": True, "steel": {"arrangement": "multi"}}, **wide)
    assert len(parts) < 1500
    assert len(record.steel.lines) >= 5


@pytest.mark.parametrize(
    ("girder", "field", "words"),
    [
        ({"spans": [30.0, 300.0]}, "bridge.girder.spans", "10 to 90 m.*nearest valid value is 90 m"),
        ({"spans": [30.0], "steel": {"haunch": "parabolic"}}, "bridge.girder.steel.haunch", "continuous over a pier"),
        (
            {"spans": [30.0, 30.0], "continuous": False, "steel": {"haunch": "straight"}},
            "bridge.girder.steel.haunch",
            "continuous over a pier",
        ),
        ({"steel": {"count": 12}}, "bridge.girder.steel.count", "2.2 to 3.6 m apart.*nearest valid number is [0-9]"),
    ],
)
def test_contradictions_name_key_rule_and_nearest_value(girder: dict[str, Any], field: str, words: str) -> None:
    """Bad input: one line with the key and what is allowed."""
    with pytest.raises(InputError) as caught:
        make(0, girder, **PLAIN)
    assert field in str(caught.value)
    assert re.search(words, str(caught.value))


def test_a_wide_deck_has_no_ladder() -> None:
    """Four lanes with footways are too wide for two girders: the arrangement's rule is told."""
    with pytest.raises(InputError, match=r"bridge.girder.steel.arrangement.*7 to 18 m.*nearest 18 m"):
        make(0, {"steel": {"arrangement": "ladder"}}, service="road", roadway={"lanes": 6, "footway": True})
