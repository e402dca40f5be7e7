"""Concrete girders, diaphragms and slabs: volumes in closed form, lines that suit the section, draws, bad input."""

import re
from collections import Counter
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.parts.decks import DeckEdge, Haunches, deck_outline, deck_parts
from authoring.parts.girder_sections import Girders, diaphragm_outline, girder_outline, u_top_width
from authoring.parts.girders import diaphragm_stations, girder_parts, girder_surface
from authoring.parts.spans import Levels, Spans
from authoring.shapes.component import Component, triangles
from authoring.shapes.sections import area
from authoring.solids.sweep import Surface
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.bridges.built import STRAIGHT, make_bridge
from tests.conftest import Count

LEVEL = Alignment(10.0)
LEVELS = Levels(surfacing=0.08, slab=0.22, girder=1.25, pad=0.1, plinth=0.2)
SHAPES = ("i", "bulb_t", "t", "u", "box", "rectangle")
LINES = (-3.0, 0.0, 3.0)


def girders(shape: str, **changes: Any) -> Girders:
    """A girder 1.2 m deep without chamfers, haunch 0.05 m."""
    sizes = {
        "i": (0.6, 0.6, 0.2, 0.12, 0.18),
        "bulb_t": (1.2, 0.6, 0.2, 0.08, 0.18),
        "t": (0.84, 0.6, 0.6, 0.10, 0.0),
        "u": (u_top_width(1.2, 1.2, 0.15), 1.2, 0.2, 0.15, 0.2),
        "box": (1.2, 1.2, 1.2, 0.0, 0.0),
        "rectangle": (0.5, 0.5, 0.5, 0.0, 0.0),
    }[shape]
    return Girders(shape, 1.2, LINES, *sizes, 0.0, 0.3, 0.05, **changes)


def volume(surface: Surface | Component) -> float:
    """Signed volume by the divergence theorem [m3]."""
    mesh: Any = surface.mesh if isinstance(surface, Component) else surface
    a, b, c = np.moveaxis(mesh.points[triangles(mesh)] - mesh.points.mean(axis=0), 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def trapezoid(low: float, high: float, height: float) -> float:
    """Area between two widths [m2]."""
    return 0.5 * (low + high) * height


# From the soffit up: widths and heights of each layer; girders reach 10 mm into what lies on them.
AREAS = {
    "i": 0.6 * 0.18
    + trapezoid(0.6, 0.2, 0.144)
    + 0.2 * (1.2 - 0.18 - 0.144 - 0.12 - 0.084)
    + trapezoid(0.2, 0.6, 0.084)
    + 0.6 * 0.13,
    "bulb_t": 0.6 * 0.18
    + trapezoid(0.6, 0.2, 0.144)
    + 0.2 * (1.2 - 0.18 - 0.144 - 0.08 - 0.11)
    + trapezoid(0.2, 1.2, 0.11)
    + 1.2 * 0.09,
    "t": trapezoid(0.6, 0.64, 1.1) + trapezoid(0.64, 0.84, 0.09) + 0.84 * 0.02,
    "u": trapezoid(1.2, 1.725, 1.05)
    + trapezoid(1.725, 1.845, 0.02)
    + 1.845 * 0.14  # the outside
    - (0.965 * 0.16 + trapezoid(0.88, 0.965, 0.75) + trapezoid(0.68, 0.88, 0.10)),  # less the trough
    "box": 1.2 * 1.21,
    "rectangle": 0.5 * 1.21,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_girder_has_the_volume_of_its_layers(shape: str) -> None:
    """Without end blocks: the area of the section, layer by layer, times the length."""
    one = girders(shape, end_blocks=False)
    assert area(girder_outline(one)) == pytest.approx(AREAS[shape], rel=1e-9)
    surface = girder_surface(one, 0.0, 0.0, 20.0, LEVELS, LEVEL)
    assert volume(surface) == pytest.approx(20.0 * AREAS[shape], rel=1e-9)
    np.testing.assert_allclose(np.abs(surface.points[:, 1]).max(), 0.5 * max(one.top_width, one.bottom_width))


@pytest.mark.parametrize("shape", ["i", "bulb_t"])
def test_end_blocks_add_concrete_at_both_ends(shape: str) -> None:
    """More than the plain girder by the thickened web over a depth at either end and half of it over the tapers."""
    plain, block = girders(shape, end_blocks=False), girders(shape)
    extra = area(girder_outline(block, 1.0)) - area(girder_outline(block, 0.0))
    found = [volume(girder_surface(one, 0.0, 0.0, 20.0, LEVELS, LEVEL)) for one in (plain, block)]
    assert extra > 0.2
    assert found[1] - found[0] == pytest.approx(extra * (2.0 * 1.2 + 2.0 * 0.5 * 0.72), rel=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("thickening", [0.0, 1.0])
def test_diaphragms_reach_from_girder_to_girder_and_into_the_slab(shape: str, thickening: float) -> None:
    """Its top lies 10 mm in the slab; its sides run 10 mm inside the girders' faces; both halves are alike."""
    one = girders(shape)
    outline = diaphragm_outline(one, 0.0, 3.0, thickening)
    assert outline[:, 1].max() == pytest.approx(1.26)
    np.testing.assert_allclose(np.sort(outline[:, 0]), np.sort(3.0 - outline[:, 0]), atol=1e-12)
    section = girder_outline(one, thickening)
    right = section[: len(section) // 2]
    for x, z in outline[: len(outline) // 2 - 1]:
        rising = right[: np.argmax(right[:, 1]) + 1]
        face = 3.0 - float(np.interp(z, rising[:, 1], rising[:, 0]))
        assert x - face == pytest.approx(0.010, abs=1e-9) or z > 1.19


def test_long_spans_have_diaphragms_between() -> None:
    """None within 20 m, one at the middle within 30 m, two at the thirds beyond."""
    spans = Spans((0.0, 18.0, 43.0, 83.0), 0.35, 0.04)
    rows = [diaphragm_stations(spans, span) for span in range(3)]
    assert [len(row) for row in rows] == [2, 3, 4]
    assert rows[1][2] == (pytest.approx(0.5 * sum(spans.bearing_lines(1))), 0.0)
    low, high = spans.bearing_lines(2)
    np.testing.assert_allclose([row[0] for row in rows[2][2:]], [low + (high - low) / 3.0, high - (high - low) / 3.0])


@pytest.mark.parametrize("lines", [(-3.0, 0.0, 3.0), (-4.0, -1.5, 1.5, 4.0)])
def test_a_slab_has_haunches_cantilevers_and_grooves(lines: tuple[float, ...]) -> None:
    """Slab, a trapezoid on every girder, a wedge under each cantilever, less two V grooves."""
    width, half, h = 11.0, 0.5 * 0.6 - 0.02, 0.06
    outline = deck_outline(width, 0.0, -0.22, DeckEdge(0.12, 0.0), Haunches(lines, 0.6, h))
    cantilever = 0.5 * width - (lines[-1] + half)
    inner = len(lines) - 2
    haunches = inner * h * (2.0 * half + h) + 2.0 * h * (2.0 * half + 0.5 * h) + cantilever * h
    groove = 0.02 * 0.02
    assert area(outline) == pytest.approx(width * 0.22 + haunches - 2.0 * groove, rel=1e-9)
    edge = deck_outline(width, 0.0, -0.22, DeckEdge(0.0, 0.03))
    assert area(edge) == pytest.approx(width * 0.22 - 0.03**2, rel=1e-12)


def test_a_continuous_slab_is_one_piece_over_girders_that_stop() -> None:
    """Two slabs and a gap, or one slab; the girders are the same."""
    stops, runs = (Spans((0.0, 20.0, 40.0), 0.35, 0.04, continuous=through) for through in (False, True))
    found = [deck_parts(10.0, spans, LEVELS, LEVEL, edge=DeckEdge(0.0, 0.0)) for spans in (stops, runs)]
    assert [len(parts) for parts in found] == [2, 1]
    volumes = [sum(volume(part.surface) for part in parts) for parts in found]
    assert volumes[1] - volumes[0] == pytest.approx(10.0 * 0.22 * 0.04, rel=1e-9)
    counts = [len(girder_parts(girders("i"), spans, LEVELS, LEVEL)) for spans in (stops, runs)]
    assert counts == [6, 6]


def test_sections_and_lines_suit_the_deck(proof_count: Count) -> None:
    """Each section in 2 % of the draws; tops never meet nor leave the deck; T and rectangle on short spans only."""
    count, shapes = proof_count(500, 2000), Counter()
    blocks, slabs = Counter(), Counter()
    for seed in range(count):
        layout, drawn = draw_layout(BridgeSettings(), stream(seed, "bridge"))
        g, longest = drawn.record.girders, float(np.diff(layout.supports).max())
        shapes[g.shape] += 1
        blocks[g.end_blocks] += 1
        slabs[drawn.record.spans.continuous] += 1
        assert longest <= 24.0 or g.shape not in ("t", "rectangle")
        assert layout.width >= 7.5 or g.shape not in ("u", "box")
        assert np.diff(g.lines).min() >= g.top_width + 0.449
        assert 0.5 * layout.width - g.lines[-1] - 0.5 * g.top_width >= 0.299
        assert np.diff(g.lines).max() <= 5.001
        assert drawn.record.bearings.pad_width <= g.bottom_width
        np.testing.assert_allclose(g.lines, -np.array(g.lines)[::-1])
    assert set(shapes) == set(SHAPES)
    for found in (shapes, blocks, slabs):
        assert min(found.values()) >= 0.02 * count, found


def test_profile_paper_is_the_random_bridge_generator() -> None:
    """Five lines at a fifth of the width, 0.6 m deep, every 10 m a pier; half of the bridges without girders."""
    settings = parse_settings(BridgeSettings, {"profile": "paper"}, "test")
    omitted = 0
    for seed in range(60):
        layout, drawn = draw_layout(settings, stream(seed, "bridge"))
        record = drawn.record
        omitted += record.girders.depth == 0.0
        assert record.girders.depth in (0.0, 0.6)
        assert record.girders.shape in ("i", "rectangle")
        np.testing.assert_allclose(record.girders.lines, 0.2 * layout.width * np.arange(-2, 3), atol=6e-4)
        np.testing.assert_allclose(np.diff(layout.supports), 10.0)
        assert record.piers.kind in ("single", "multi")
        assert record.piers.cap in ("drop", "tapered")
        assert record.slab == 1.0
        assert (record.girders.chamfer, record.piers.chamfer, record.edge.groove) == (0.0, 0.0, 0.0)
    assert 15 <= omitted <= 45


def test_omitted_girders_leave_the_slab_on_its_bearings() -> None:
    """No girder and no diaphragm; the same rows of bearings reach the slab."""
    bridge = make_bridge("beam", 2, **STRAIGHT, grade=0.0, service="road", beam={"girder": {"omitted": True}})
    kinds = Counter(member.kind for member in bridge.members)
    assert not kinds["concrete_girder"]
    assert not kinds["diaphragm"]
    assert kinds["bearing_plinth"] == 2 * (len(bridge.layout.supports) - 1) * len(bridge.drawn.record.girders.lines)
    top = max(m.mesh.points[:, 2].max() for m in bridge.members if m.name.startswith("Bearing_"))
    soffit = min(m.mesh.points[:, 2].min() for m in bridge.members if m.kind == "deck_slab")
    assert 0.0 <= top - soffit < 0.005


@pytest.mark.parametrize(
    ("beam", "field", "allowed"),
    [
        ({"girder": {"shape": "u", "count": 7}}, "bridge.beam.girder.count", "lines"),
        ({"girder": {"shape": "i", "count": 2}}, "bridge.beam.girder.count", "here 5 to 7"),
        ({"spans": [12.0, 300.0]}, "bridge.beam.spans", "6 to 60 m"),
        ({"spans": [40.0], "girder": {"depth": 0.6}}, "bridge.beam.girder.depth", "nearest valid value is 1.34 m"),
        ({"spans": [14.0], "girder": {"depth": 2.0}}, "bridge.beam.girder.depth", "nearest valid value is 1.4 m"),
        ({"girder": {"shape": "z"}}, "beam.girder.shape", "bulb_t"),
        ({"girder": {"haunch": 0.4}}, "beam.girder.haunch", "0.15"),
    ],
)
def test_bad_input_names_key_and_way_out(beam: dict[str, Any], field: str, allowed: str) -> None:
    """One line with the key, the rule and what would do."""
    lanes = {"lanes": 2, "lane_width": 3.5, "shoulder": 1.0, "footway": True, "footway_width": 1.8}
    settings = {"service": "road", "beam": {"spans": [20.0], **beam}, "roadway": lanes}
    with pytest.raises(InputError, match=re.escape(field)) as caught:
        draw_layout(parse_settings(BridgeSettings, settings, "test"), stream(1, "bridge"))
    assert allowed in str(caught.value), str(caught.value)
    assert "\n" not in str(caught.value)
