"""Arch bridges against closed forms and against what an engineer would measure on them."""

import re
from functools import cache
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment
from authoring.families.arch import ArchSettings
from authoring.families.arch_settings import ARRANGEMENTS, MasonrySettings, draw_choice
from authoring.families.arch_through import GAUGE
from authoring.parts.arch_axis import ArchAxis, Rib
from authoring.parts.arches import EMBEDDED, RibSection, rib_parts, rib_surface
from authoring.parts.drawing import Draws, drawn_range
from authoring.parts.masonry import ring_of
from authoring.shapes.component import F64, Component
from authoring.streams import stream
from groundwork.errors import InputError
from tests.authoring.bridges.built import Bridge, make_bridge
from tests.conftest import Count
from usd_schemas.components import class_of

AXES = [
    ArchAxis(shape, span, rise)
    for shape in ("parabola", "circle", "catenary")
    for span, rise in ((30.0, 10.0), (100.0, 25.0), (150.0, 18.75))
]


@cache
def built(arrangement: str, seed: int = 1, **own: Any) -> Bridge:
    """Build an arch bridge of one arrangement."""
    return make_bridge("arch", seed, service="road", arch={"arrangement": arrangement, **own})


def of_kind(bridge: Bridge, kind: str) -> list[Component]:
    """Members of one kind."""
    return [member for member in bridge.members if member.kind == kind]


def coordinates(bridge: Bridge, member: Component) -> F64:
    """Vertices (station, left, height) of a member [m], shape (V, 3)."""
    return bridge.bridge_coordinates[bridge.members.index(member)]


@pytest.mark.parametrize("axis", AXES, ids=str)
def test_axis_meets_its_closed_form(axis: ArchAxis) -> None:
    """Nodes obey the equation of their curve; chords stay within a millimeter of sag per meter of radius."""
    x = axis.nodes(1.0)
    y = axis.height(x)
    off = x - 0.5 * axis.span
    assert y[[0, -1]] == pytest.approx(0.0, abs=1e-9)
    assert float(axis.height(np.array(0.5 * axis.span))) == pytest.approx(axis.rise, abs=1e-9)
    np.testing.assert_allclose(x + x[::-1], axis.span, atol=1e-9)
    if axis.shape == "parabola":
        np.testing.assert_allclose(y, 4.0 * axis.rise * x * (axis.span - x) / axis.span**2, atol=1e-9)
    elif axis.shape == "circle":
        center = axis.rise - axis.radius
        np.testing.assert_allclose(np.hypot(off, y - center), axis.radius, rtol=1e-12)
    else:
        a = axis.constant
        np.testing.assert_allclose(np.cosh(off / a), 1.0 + (axis.rise - y) / a, rtol=1e-9)
        length = np.hypot(np.diff(x), np.diff(y)).sum()
        assert length == pytest.approx(2.0 * a * np.sinh(0.5 * axis.span / a), rel=3e-4)
    steps = np.hypot(np.diff(x), np.diff(y))
    assert steps.max() <= 1.0 + 1e-6
    assert np.ptp(steps) < 0.01 * steps.max()
    middle = 0.5 * (x[1:] + x[:-1])
    cosine = axis.tangent(middle)[:, 0]
    sag = (axis.height(middle) - 0.5 * (y[1:] + y[:-1])) * cosine
    radius = steps**2 / (8.0 * np.maximum(sag, 1e-12))
    assert np.all(sag < 1.0 / (8.0 * radius.min()) + 1e-3)


@pytest.mark.parametrize("axis", AXES, ids=str)
def test_tangent_is_the_derivative(axis: ArchAxis) -> None:
    """The tangent agrees with central differences."""
    x = np.linspace(0.02, 0.98, 37) * axis.span
    slope = (axis.height(x + 1e-5) - axis.height(x - 1e-5)) / 2e-5
    way = axis.tangent(x)
    np.testing.assert_allclose(way[:, 1] / way[:, 0], slope, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(np.hypot(*way.T), 1.0, rtol=1e-12)


@pytest.mark.parametrize("shape", ["parabola", "circle", "catenary"])
@pytest.mark.parametrize("slope", [0.0, 0.02])
def test_rib_volume_is_section_times_length(shape: str, slope: float) -> None:
    """Of a rib without taper: area times the length of its polygon, as Pappus has it for the straight pieces."""
    rib = Rib(ArchAxis(shape, 60.0, 14.0), 5.0, -20.0, slope, 1.1, 1.1)
    section = RibSection("concrete", 1.6, (0.0,), 0.025)
    surface = rib_surface(rib, section, 0.0, Alignment(0.0))
    corners = surface.points[fan(surface.face_counts, surface.corners)]
    volume = np.sum(corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])) / 6.0
    length = np.linalg.norm(np.diff(rib.polygon[0], axis=0), axis=1).sum() + 2.0 * EMBEDDED
    area = 1.6 * 1.1 - 2.0 * 0.025**2
    assert volume == pytest.approx(area * length, rel=1e-4)


def fan(counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Triangles of convex faces, vertex numbers, shape (T, 3)."""
    starts = np.cumsum(counts) - counts
    return np.array(
        [
            (corners[s], corners[s + k], corners[s + k + 1])
            for s, n in zip(starts, counts, strict=True)
            for k in range(1, n - 1)
        ]
    )


def test_rib_lies_square_about_its_axis() -> None:
    """Back and soffit of the built rib lie half a depth from the axis, thickening towards the springings."""
    rib = Rib(ArchAxis("circle", 80.0, 16.0), 0.0, 0.0, 0.0, 1.2, 1.8)
    part = rib_parts(rib, RibSection("concrete", 2.0, (0.0,), 0.0), "arch_rib", Alignment(0.0))[0]
    center = np.array([40.0, 16.0 - rib.axis.radius])
    reach = np.linalg.norm(part.surface.points[:, [0, 2]] - center, axis=1) - rib.axis.radius
    away = np.abs(part.surface.points[:, 0] - 40.0) / 40.0
    crown = away < 0.02
    assert np.abs(reach[crown]) == pytest.approx(0.6, abs=2e-3)
    ends = away > 0.99
    assert np.abs(reach[ends]).max() == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("ratio", [0.2, 0.35, 0.5])
def test_ring_surrounds_its_intrados(ratio: float) -> None:
    """A ring's intrados has the clear span and the rise that were asked for."""
    rib = Rib(ring_of("circle", 12.0, 12.0 * ratio, 0.6), 0.0, 0.0, 0.0, 0.6, 0.6)
    soffit = rib.edge(-1.0)
    assert soffit[-1, 0] - soffit[0, 0] == pytest.approx(12.0, abs=3e-3)
    assert soffit[:, 1].max() - soffit[0, 1] == pytest.approx(12.0 * ratio, abs=2e-3)


def test_ratios_and_weights_over_many_draws(proof_count: Count) -> None:
    """Every arrangement and shape occurs as often as told; ratios stay in their bands."""
    count = proof_count(600, 4000)
    choices = [draw_choice(ArchSettings(), Draws(stream(seed, "bridge"))) for seed in range(count)]
    for name, weight in ARRANGEMENTS.items():
        share = np.mean([choice.arrangement == name for choice in choices])
        assert abs(share - weight) < 4.0 * np.sqrt(weight * (1.0 - weight) / count), name
    rises = np.array([choice.rise / choice.span for choice in choices])
    assert rises.min() >= 0.1249
    assert rises.max() <= 0.3334
    assert 1 / 6 < np.median(rises) < 1 / 4.5
    for choice in choices:
        assert 30.0 <= choice.span <= 150.0
        assert 44.9 <= choice.span / choice.depth <= 70.1
        assert 1.0 <= choice.springing_depth / choice.depth <= 1.501
        assert 8 <= choice.bays <= 14
        assert choice.arrangement in ("deck", "masonry") or (choice.span >= 60.0 and choice.form != "ring")
    spans = np.array([choice.span for choice in choices if choice.arrangement in ("deck", "masonry")])
    assert np.ptp(spans) > 0.8 * 120.0


def test_fixing_one_value_changes_no_other() -> None:
    """The generator advances alike whether a value is fixed or drawn."""
    free = draw_choice(ArchSettings(), Draws(stream(4, "bridge")))
    fixed = draw_choice(
        ArchSettings.model_validate({"bays": 9, "shape": free.shape, "form": free.form}), Draws(stream(4, "bridge"))
    )
    assert (fixed.bays, fixed.rise, fixed.springing, fixed.below_deck) == (
        9,
        free.rise,
        free.springing,
        free.below_deck,
    )


@pytest.mark.parametrize("form", ["ring", "concrete", "steel"])
def test_spandrel_columns_touch_arch_and_cross_head(form: str) -> None:
    """Every spandrel column touches the arch below and its cross-head above, every cross-head the deck."""
    bridge = built("deck", 2, form=form, deck="beam_slab")
    columns = of_kind(bridge, "spandrel_column")
    assert len(columns) >= 14
    for number, member in enumerate(bridge.members):
        kinds = {bridge.members[n].kind for n in bridge.neighbors[number]}
        if member.kind == "spandrel_column":
            assert "cross_head" in kinds
            assert kinds & {"arch_ring", "arch_rib"}, member.name
        if member.kind == "cross_head":
            assert kinds & {"concrete_girder", "plate_girder"}, member.name
    heights = [member.parameters["height"] for member in columns]
    assert min(float(str(height)) for height in heights) > 0.2


@pytest.mark.parametrize("arrangement", ["through", "half_through", "tied"])
def test_hangers_end_in_socket_and_anchorage(arrangement: str) -> None:
    """Each hanger has its own socket on floor beam or tie, and its own anchorage under the rib; pitch 3 to 10 m."""
    bridge = built(arrangement)
    hangers = of_kind(bridge, "hanger")
    assert len(hangers) == len(of_kind(bridge, "cable_socket")) == len(of_kind(bridge, "upper_anchorage")) >= 8
    names = {member.name: number for number, member in enumerate(bridge.members)}
    for hanger in hangers:
        where = hanger.name.removeprefix("Hanger_")
        base, top = names[f"Hanger_Base_{where}"], names[f"Hanger_Top_{where}"]
        held = set(bridge.neighbors[names[hanger.name]])
        assert held == {base, top}
        assert {bridge.members[n].kind for n in bridge.neighbors[base]} <= {"hanger", "floor_beam", "edge_beam"}
        assert "arch_rib" in {bridge.members[n].kind for n in bridge.neighbors[top]}
        low, high = coordinates(bridge, hanger)[:, 2].min(), coordinates(bridge, hanger)[:, 2].max()
        assert low < bridge.boxes[base, 1, 2]
        assert high > bridge.boxes[top, 0, 2]
    stations = np.unique([round(float(coordinates(bridge, hanger)[:, 0].mean()), 3) for hanger in hangers])
    assert 3.0 <= np.diff(stations).min() <= 10.0


@pytest.mark.parametrize("arrangement", ["through", "half_through", "tied"])
@pytest.mark.parametrize("service", ["road", "rail_single"])
@pytest.mark.parametrize("bracing", ["struts", "k"])
def test_traffic_passes_under_the_braces(arrangement: str, service: str, bracing: str) -> None:
    """Between the deck's edges nothing but traffic's own furniture stands in the clearance gauge."""
    own = {"arrangement": arrangement, "bracing": bracing}
    bridge = make_bridge("arch", 5, service=service, arch=own)
    braces = of_kind(bridge, "arch_brace")
    assert braces
    for member in braces:
        points = coordinates(bridge, member)
        road = bridge.layout.alignment.point(points[:, 0], 0.0 * points[:, 0], 0.0 * points[:, 0])[:, 2]
        assert (points[:, 2] - road).min() >= GAUGE[bridge.layout.service]
    half = 0.5 * bridge.layout.width
    for rib in of_kind(bridge, "arch_rib"):
        assert np.abs(coordinates(bridge, rib)[:, 1]).min() > half


@pytest.mark.parametrize("arrangement", ["deck", "through", "half_through", "tied", "masonry"])
def test_arch_is_symmetric_about_mid_span(arrangement: str) -> None:
    """On a level road the arch and what stands on it or hangs from it mirror about mid-span."""
    bracing = {} if arrangement in ("deck", "masonry") else {"bracing": "struts"}
    bridge = make_bridge("arch", 3, grade=0.0, arch={"arrangement": arrangement, **bracing})
    supports = bridge.layout.supports
    middle = 0.5 * (supports[0] + supports[-1])
    kinds = ("arch_rib", "arch_ring", "arch_brace", "hanger", "spandrel_column", "floor_beam", "spandrel_wall")
    boxes = []
    for member in bridge.members:
        if member.kind in kinds:
            points = coordinates(bridge, member) - (middle, 0.0, 0.0)
            boxes.append([*points.min(axis=0), *points.max(axis=0)])
    table = np.array(boxes)
    mirrored = table[:, [3, 1, 2, 0, 4, 5]] * (-1.0, 1.0, 1.0, -1.0, 1.0, 1.0)
    apart = np.abs(table[:, None] - mirrored[None]).max(axis=2).min(axis=1)
    assert apart.max() < 2e-3


def test_tied_arch_follows_its_grade() -> None:
    """Both ribs of a tied arch stand on the ties at either end, whatever the grade."""
    bridge = make_bridge("arch", 6, grade=0.02, service="road", arch={"arrangement": "tied"})
    for rib in of_kind(bridge, "arch_rib"):
        points = coordinates(bridge, rib)
        feet = [
            points[points[:, 0] < points[:, 0].min() + 0.3, 2].min(),
            points[points[:, 0] > points[:, 0].max() - 0.3, 2].min(),
        ]
        run = np.ptp(points[:, 0])
        assert (feet[1] - feet[0]) / run == pytest.approx(0.02, abs=2e-3)
    pads = [member for member in bridge.members if member.kind in ("bearing_pad", "bearing_pot")]
    assert len({round(float(coordinates(bridge, pad)[:, 1].mean()), 2) for pad in pads}) == 2


def test_masonry_is_a_closed_body_without_bearings() -> None:
    """Rings, walls and fill leave no hole: a vertical line through the crown meets ring, fill and surfacing in turn."""
    own = {"arrangement": "masonry", "masonry": {"span_count": 3, "span": 12.0}}
    bridge = make_bridge("arch", 7, service="road", arch=own)
    assert not [member for member in bridge.members if class_of(member.kind) == "bearing"]
    assert bridge.without_bearings == frozenset(range(4))
    assert len(of_kind(bridge, "arch_ring")) == 3
    assert len(of_kind(bridge, "pier_cap")) == 2
    fill = next(member for member in bridge.members if member.name == "Fill")
    assert fill.parameters["filled_spandrel"] is True
    assert np.all(bridge.volumes > 0.0)
    record = bridge.drawn.record.arch
    rib = record.viaduct.rib(1)
    level = float(bridge.layout.alignment.height(np.array([rib.middle]))[0])
    tops = coordinates(bridge, of_kind(bridge, "arch_ring")[1])[:, 2].max() - level
    crown_fill = -record.top.surfacing - tops
    low, high = drawn_range(MasonrySettings, "crown_fill")
    assert low - 0.02 < crown_fill < high + 0.02
    parapets = of_kind(bridge, "parapet")
    assert parapets
    assert {member.role for member in parapets} == {"Role_Masonry"}


def test_springings_reach_into_sloping_ground() -> None:
    """Blocks and footings are founded below the lowest ground round them, wherever the ground lies."""
    bridge = built("deck", 2, approach=1.2)
    for member in bridge.members:
        if member.kind in ("pier_footing", "abutment_wall") and "springing" in member.parameters:
            points = member.mesh.points
            assert points[:, 2].min() < bridge.ground(points[:, :2]).min() - 0.5


def test_level_keeps_springing_and_clearance() -> None:
    """The springings lie at least as high as asked for, and the middle half of the intrados keeps the clearance."""
    bridge = make_bridge("arch", 8, clearance=6.5, grade=0.0, arch={"arrangement": "deck", "springing": 3.0})
    rib = bridge.drawn.record.arch.rib
    level = bridge.layout.alignment.level
    assert level + rib.base >= 3.0 - 1e-3
    quarter = level + float(rib.intrados(np.array([rib.start + 0.25 * rib.axis.span]))[0])
    assert quarter >= 6.5 - 1e-3
    assert min(level + rib.base - 3.0, quarter - 6.5) < 0.3  # and no higher than needed


def test_paper_profile_is_the_known_arch() -> None:
    """Span 100, rise 25, a parabola, a ring 10 m wide and 2 m deep, two columns a station, a box deck 3 m deep."""
    record = make_bridge("arch", 1, profile="paper").drawn.record
    arch = record.arch
    assert record.arrangement == "deck"
    assert (arch.rib.axis.shape, arch.rib.axis.span, arch.rib.axis.rise) == ("parabola", 100.0, 25.0)
    assert (arch.section.width, arch.rib.depth, arch.rib.springing_depth) == (10.0, 2.0, 2.0)
    assert arch.slab.slab + arch.slab.girder == pytest.approx(3.0)
    assert len(arch.bents.lines) == 2
    assert arch.bents.lines[1] == pytest.approx(0.25 * arch.top.width, abs=1e-3)


@pytest.mark.parametrize("arrangement", ["through", "half_through", "tied"])
def test_paper_profile_builds_ribs_above_a_deck(arrangement: str) -> None:
    """A ring cannot rise above its deck: profile `paper` draws ribs there, of steel or concrete."""
    forms = {
        make_bridge("arch", seed, profile="paper", arch={"arrangement": arrangement}).drawn.record.arch.section.form
        for seed in range(8)
    }
    assert forms == {"concrete", "steel"}


@pytest.mark.parametrize(
    ("own", "field"),
    [
        ({"span_to_rise": 2.0}, "arch.span_to_rise"),
        ({"arrangement": "tied", "above": {"span": 45.0, "span_to_rise": 8.0}}, "bridge.arch.above.span_to_rise"),
        (
            {"arrangement": "half_through", "above": {"span": 60.0, "span_to_rise": 5.0, "below_deck": 0.5}},
            "bridge.arch.above.below_deck",
        ),
        ({"arrangement": "through", "form": "ring"}, "bridge.arch.form"),
        ({"hanger_pitch": 1.0}, "arch.hanger_pitch"),
        ({"span": 300.0}, "arch.span"),
        ({"masonry": {"span": 60.0}}, "arch.masonry.span"),
        ({"sag": 3.0}, "arch.sag"),
        ({"arrangement": "tied", "span": 100.0}, "bridge.arch.span"),
        ({"arrangement": "deck", "above": {"span": 100.0}}, "bridge.arch.above.span"),
        ({"arrangement": "through", "masonry": {"span": 10.0}}, "bridge.arch.masonry.span"),
    ],
)
def test_bad_input_names_the_key_and_the_nearest_value(own: dict[str, Any], field: str) -> None:
    """One line that names the key and what is allowed."""
    with pytest.raises(InputError, match=re.escape(field)) as caught:
        make_bridge("arch", 0, service="road", arch=own)
    assert "\n" not in str(caught.value)


def test_the_nearest_value_of_the_message_is_valid() -> None:
    """What the message about a low arch allows can be built."""
    above = {"span": 45.0, "span_to_rise": 8.0}
    with pytest.raises(InputError) as caught:
        make_bridge("arch", 0, service="road", arch={"arrangement": "tied", "above": above})
    found = re.search(r"at most ([0-9.]+) here", str(caught.value))
    assert found is not None
    above["span_to_rise"] = float(found[1])
    assert of_kind(make_bridge("arch", 0, service="road", arch={"arrangement": "tied", "above": above}), "hanger")


@pytest.mark.parametrize("arrangement", ["through", "half_through", "tied"])
@pytest.mark.parametrize("service", ["road", "rail_double"])
def test_every_draw_leaves_room_for_traffic(arrangement: str, service: str) -> None:
    """The corner of all ranges that leaves least room can be built."""
    above = {"span": 60.0, "span_to_rise": 5.5, **({"below_deck": 0.25} if arrangement == "half_through" else {})}
    own = {"arrangement": arrangement, "span_to_depth": 45.0, "above": above}
    for seed in range(3):
        assert of_kind(make_bridge("arch", seed, service=service, arch=own), "arch_brace")


def test_ground_above_the_deck_is_refused() -> None:
    """A hill through the deck is an error that names the site."""
    from authoring.families.registry import build_bridge

    bridge = built("deck", 2)
    with pytest.raises(InputError, match="ground"):
        build_bridge(bridge.layout, bridge.drawn, lambda xy: np.full(len(xy), 200.0))
