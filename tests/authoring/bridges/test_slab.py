"""The slab bridge: spans, depths and sections in their bands, simple and continuous, and bad input."""

import re
from typing import Any

import numpy as np
import pytest

from authoring.families.bridge_settings import draw_layout
from authoring.families.slab import DrawnSlab
from authoring.parts.slabs import LEAST_DEPTH, Slab, slab_outline, usual_slenderness
from authoring.shapes.sections import area, is_convex
from authoring.streams import stream
from groundwork.errors import InputError
from tests.authoring.bridges.built import STRAIGHT, Bridge, make_bridge, settings_of
from tests.conftest import Count

OUTLINES = ("solid", "voided", "pk", "hexagon")


def count_of(bridge: Bridge) -> dict[str, int]:
    """Number of members of each kind."""
    kinds = [member.kind for member in bridge.members]
    return {kind: kinds.count(kind) for kind in kinds}


def volume(bridge: Bridge, name: str) -> float:
    """Signed volume of one member by the divergence theorem [m3]."""
    number = next(k for k, member in enumerate(bridge.members) if member.name == name)
    corners = bridge.corners[bridge.first[number] : bridge.first[number + 1]]
    a, b, c = np.moveaxis(corners - corners.mean(axis=(0, 1)), 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("service", ["road", "rail_double"])
def test_depths_and_spans_keep_their_ratios(service: str, proof_count: Count) -> None:
    """Depth is the longest span over 22 or 25 (15 or 17 under rails) within 15 %; end spans are the shorter ones."""
    sections, systems = set(), set()
    for seed in range(proof_count(25, 400)):
        slab: DrawnSlab = make_drawn(seed, service=service)
        lengths = np.diff(slab.spans.supports)
        assert 1 <= len(lengths) <= 8
        assert lengths.min() >= 5.0 - 1e-9
        assert lengths.max() <= (15.0 if slab.slab.section == "solid" else 18.0) + 1e-9
        assert slab.slab.section == "solid" or lengths.max() >= 9.0
        ratio = usual_slenderness(slab.top.service, continuous=slab.spans.continuous)
        usual = lengths.max() / ratio
        assert slab.slab.depth == LEAST_DEPTH or 0.86 * usual <= slab.slab.depth <= usual / 0.84
        assert slab.slab.depth >= LEAST_DEPTH
        if slab.spans.continuous and len(lengths) > 2:
            assert lengths[0] == pytest.approx(lengths[-1])
            assert 0.74 <= lengths[0] / lengths[1] <= 0.86 or lengths[0] == 5.0
        gaps = np.diff(slab.slab.lines)
        assert 2 <= len(slab.slab.lines) <= 5
        assert gaps.min() > 0.8
        assert slab.slab.lines[-1] + 0.5 * slab.bearings.plinth_width < 0.5 * slab.slab.soffit_width
        sections.add(slab.slab.section)
        systems.add(slab.spans.continuous)
    assert sections == {"solid", "voided", "pk"}
    assert systems == {True, False}


def make_drawn(seed: int, **changes: Any) -> DrawnSlab:
    """Draw a slab bridge."""
    return draw_layout(settings_of("slab", **changes), stream(seed, "bridge"))[1].record


@pytest.mark.parametrize(("system", "pieces", "rows"), [("simple", 3, 6), ("continuous", 1, 4)])
def test_a_continuous_slab_is_one_slab_on_one_row_of_bearings_a_pier(system: str, pieces: int, rows: int) -> None:
    """Three spans: three slabs on six rows, or one slab on four; joints at each support, or at the abutments only."""
    bridge = make_bridge(
        "slab", 2, **STRAIGHT, service="road", profile="default", slab={"spans": [9.0, 12.0, 9.0], "system": system}
    )
    slab: DrawnSlab = bridge.drawn.record
    count, lines = count_of(bridge), len(slab.slab.lines)
    assert count["deck_slab"] == pieces
    assert count["expansion_joint"] == (2 if system == "continuous" else 4)
    assert sum(count.get(kind, 0) for kind in ("bearing_pad", "bearing_pot")) >= rows * lines
    assert len({m.name for m in bridge.members if m.name.startswith("Plinth")}) == rows * lines
    assert count["pier_cap"] == 2
    decks = [member for member in bridge.members if member.kind == "deck_slab"]
    x = np.array([[m.mesh.points[:, 0].min(), m.mesh.points[:, 0].max()] for m in decks])
    assert x[0, 0] == pytest.approx(-slab.spans.overhang)
    assert x[-1, 1] == pytest.approx(30.0 + slab.spans.overhang)
    assert np.allclose(x[1:, 0] - x[:-1, 1], slab.spans.gap)


def test_slabs_have_the_volumes_of_their_sections() -> None:
    """A solid slab is width times depth less the two cut edges; a slab of any section is its outline's area long."""
    bridge = make_bridge("slab", 3, **STRAIGHT, service="road", grade=0.0, slab={"spans": [10.0], "section": "solid"})
    slab: DrawnSlab = bridge.drawn.record
    length = 10.0 + 2.0 * slab.spans.overhang
    by_hand = slab.top.width * slab.slab.depth - 0.02**2
    assert volume(bridge, "Deck_000") == pytest.approx(by_hand * length, rel=1e-9)
    bridge = make_bridge("slab", 3, **STRAIGHT, service="road", grade=0.0, slab={"spans": [10.0], "section": "pk"})
    slab = bridge.drawn.record
    outline = slab_outline(slab.slab, -slab.top.surfacing)
    assert volume(bridge, "Deck_000") == pytest.approx(area(outline) * length, rel=1e-9)


@pytest.mark.parametrize("section", OUTLINES)
def test_outlines_keep_width_depth_and_symmetry(section: str) -> None:
    """Each section is as deep and wide as told, symmetric, and simple; closed forms of two of them."""
    slab = Slab(section, 0.8, 10.0, 7.0, (-3.0, 3.0), plain=True)
    outline = slab_outline(slab, -0.1)
    top = outline[np.isclose(outline[:, 1], -0.1)]
    assert np.ptp(outline[:, 1]) == pytest.approx(0.8)
    assert np.ptp(top[:, 0]) == pytest.approx(10.0)
    assert np.allclose(np.sort(outline[:, 0]), np.sort(-outline[:, 0]))
    assert is_convex(outline) == (section in ("solid", "hexagon"))
    if section == "hexagon":  # two trapezia that meet at the widest line
        assert area(outline) == pytest.approx(0.4 * (0.5 * (7.0 + 10.6) + 0.5 * (10.6 + 10.0)))
    if section == "voided":  # a box of 7 m with cantilevers of 1.5 m, 0.30 m to 0.22 m thick
        assert area(outline) == pytest.approx(7.0 * 0.8 + 2.0 * 1.5 * 0.26)


def test_the_paper_puts_a_pier_every_ten_meters_under_a_slab_one_meter_deep() -> None:
    """Profile `paper`: L / 10, no chamfers, sections hexagon, PK and box."""
    seen = set()
    for seed in range(30):
        slab = make_drawn(seed, profile="paper")
        assert set(np.round(np.diff(slab.spans.supports), 6)) == {10.0}
        assert slab.slab.depth == 1.0
        assert slab.slab.plain
        seen.add(slab.slab.section)
    assert seen == {"hexagon", "pk", "voided"}


@pytest.mark.parametrize(
    ("settings", "field", "nearest"),
    [
        ({"slab": {"spans": [12.0, 300.0]}}, "bridge.slab.spans", "18 m"),
        ({"slab": {"spans": [2.0]}}, "bridge.slab.spans", "5 m"),
        ({"slab": {"spans": [17.0], "section": "solid"}}, "bridge.slab.spans", "15 m"),
        (
            {
                "slab": {"bearings": 5, "section": "pk", "cantilever": 0.3},
                "roadway": {"lanes": 1, "footway": False, "shoulder": 0.0},
            },
            "bridge.slab.bearings",
            "",
        ),
        ({"slab": {"spans": [10.0] * 9}}, "slab.spans", ""),
        (
            {"slab": {"spans": [18.0], "depth": 0.3}, "service": "road"},
            "bridge.slab.depth",
            "nearest valid value is 0.59 m",
        ),
        (
            {"slab": {"spans": [6.0], "depth": 1.5}, "service": "road"},
            "bridge.slab.depth",
            "nearest valid value is 0.45 m",
        ),
        ({"slab": {"depht": 0.5}}, "slab.depht", "depth"),
    ],
)
def test_bad_input_names_field_and_nearest_value(settings: dict[str, Any], field: str, nearest: str) -> None:
    """One line that names the key and what would be taken."""
    with pytest.raises(InputError, match=re.escape(field)) as caught:
        make_bridge("slab", 1, **({"service": "road"} if "roadway" in settings else {}), **settings)
    assert "\n" not in str(caught.value)
    assert nearest in str(caught.value)
