"""What lies on a deck: tracks at gauge, sleepers and their beds, parapets, railings, and how the site goes on."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment
from authoring.axis.track_section import CLEARANCE, GAUGE
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.parts.deck_top import DeckTop, DeckTopSettings, Runs, deck_top_parts, draw_deck_top
from authoring.parts.drawing import Draws
from authoring.parts.part import Part
from authoring.parts.railings import post_stations
from authoring.parts.spans import Spans
from authoring.parts.tracks import ballast_outline, sleeper_solid, track_range
from authoring.shapes.component import F64, Component
from authoring.shapes.sections import area, rectangle
from authoring.site.site import SiteSettings, draw_site
from authoring.solids.copies import LOCAL, copied_together, frames_along
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.conftest import Count

PLACE = Alignment(0.0)
SPANS = Spans((0.0, 13.0, 28.0), 0.35, 0.04)
RAIL = ("rail_single", "rail_double")


def top_of(seed: int, profile: str = "default", **settings: Any) -> DeckTop:
    """Draw what lies on a deck."""
    parsed = parse_settings(DeckTopSettings, settings, "test")
    return draw_deck_top(parsed, Draws(stream(seed, "bridge"), profile))


def build(top: DeckTop, spans: Spans = SPANS, place: Alignment = PLACE) -> list[Part]:
    """Build it over two spans and both approaches."""
    pieces: Runs = [(f"{number:03d}", piece) for number, piece in enumerate(spans.pieces)]
    near, far = spans.backwall, 8.0
    ends: Runs = [
        ("Approach_0", (spans.supports[0] - far, spans.supports[0] - near)),
        ("Approach_1", (spans.supports[-1] + near, spans.supports[-1] + far)),
    ]
    return deck_top_parts(top, spans, [*pieces, *ends], place)


def volume(surface: Surface) -> float:
    """Signed volume by the divergence theorem [m3]."""
    starts = np.cumsum(surface.face_counts) - surface.face_counts
    center, total = surface.points.mean(axis=0), 0.0
    for start, count in zip(starts, surface.face_counts, strict=True):
        ring = surface.points[surface.corners[start : start + count]] - center
        total += float(np.sum(ring[0] * np.cross(ring[1:-1], ring[2:])))
    return total / 6.0


def of_kind(parts: list[Part], kind: str) -> list[Part]:
    """Pick the parts of one kind."""
    return [part for part in parts if part.kind == kind]


def reach(part: Part, axis: int) -> tuple[float, float]:
    """Least and largest world coordinate [m]."""
    values = part.surface.points[:, axis]
    return float(values.min()), float(values.max())


@pytest.mark.parametrize("service", RAIL)
def test_rails_lie_at_gauge_and_run_through(service: str) -> None:
    """Two welded rails a track, their tops at height 0, inner faces 1.435 m apart 14 mm lower, tracks 4.0 to 4.5 m."""
    top = top_of(3, service=service)
    assert top.tracks is not None
    rails = of_kind(build(top), "rail")
    assert len(rails) == 2 * len(top.tracks.section.lines)
    for right, left in zip(rails[::2], rails[1::2], strict=True):
        assert reach(right, 0) == reach(left, 0) == pytest.approx(track_range(SPANS))
        assert reach(right, 2)[1] == reach(left, 2)[1] == pytest.approx(0.0, abs=1e-9)
        inner = []
        for rail in (right, left):
            z = rail.surface.points[:, 2]
            inner.append(rail.surface.points[(z > -0.033) & (z < -0.011), 1])  # both edges of the head's upright sides
        assert inner[1].min() - inner[0].max() == pytest.approx(GAUGE, abs=1e-9)
    lines = np.array(top.tracks.section.lines)
    assert np.all((np.diff(lines) >= 4.0) & (np.diff(lines) <= 4.5))
    # The tabulated cross-section of a 60E1 rail is 76.7 cm2; ours leaves out its fillets.
    assert area(top.tracks.section.rail_outline(0.0)) == pytest.approx(76.7e-4, rel=0.08)


@pytest.mark.parametrize("bed", ["ballast", "slab"])
@pytest.mark.parametrize("service", RAIL)
def test_sleepers_stand_at_even_pitch_and_on_one_bed(service: str, bed: str) -> None:
    """Pitch 0.60 to 0.65 m from end to end, none overlaps, none straddles a joint of the track slabs."""
    for seed in range(6):
        top = top_of(seed, service=service, track={"bed": bed})
        assert top.tracks is not None
        parts = build(top)
        section = top.tracks.section
        slabs = [reach(part, 0) for part in of_kind(parts, "track_slab")]
        for track in range(len(section.lines)):
            sleepers = [part for part in of_kind(parts, "sleeper") if part.parameters["track"] == track]
            spans = np.array([reach(part, 0) for part in sleepers])
            middles = spans.mean(axis=1)
            pitch = np.diff(middles)
            assert np.all(pitch > section.sleeper_width + 0.25)
            low, high = (0.60, 0.65) if bed == "ballast" else (0.56, 0.70)
            assert pitch.min() > low - 1e-9
            assert pitch.max() < high + 1e-9
            begin, end = track_range(SPANS)
            assert middles[0] - begin == pytest.approx(0.5 * pitch[0], rel=1e-6)
            assert end - middles[-1] == pytest.approx(0.5 * pitch[-1], rel=1e-6)
            for low, high in spans if slabs else []:
                assert any(a < low and high < b for a, b in slabs)
            tops = [reach(part, 2)[1] for part in sleepers]
            assert np.ptp(tops) < 1e-9


def test_rail_members_have_the_volumes_of_their_sections() -> None:
    """Ballast, rails and track slabs are prisms; the paper's sleepers are boxes of 0.2 m by 0.2 m by 2.0 m."""
    top = top_of(1, service="rail_double", track={"bed": "ballast"})
    assert top.tracks is not None
    section = top.tracks.section
    low, high = track_range(SPANS)
    parts = build(top)
    (ballast,) = of_kind(parts, "ballast")
    side, crown = top.tracks.kerb_face + 0.010, section.crown
    shoulder = (side - crown) / 1.5
    depth = section.bed_top - section.formation + 0.0035
    by_hand = 2.0 * side * depth - (side - crown) * shoulder
    assert area(ballast_outline(top.tracks)) == pytest.approx(by_hand, rel=1e-12)
    assert volume(ballast.surface) == pytest.approx(by_hand * (high - low), rel=1e-9)
    rail = of_kind(parts, "rail")[0]
    assert volume(rail.surface) == pytest.approx(area(section.rail_outline(0.0)) * (high - low), rel=1e-9)
    paper = top_of(1, "paper")
    assert paper.tracks is not None
    parts = build(paper)
    slab, size = of_kind(parts, "track_slab")[0], paper.tracks.section
    expected = 2.5 * (size.bed_depth + 0.005) * np.ptp(reach(slab, 0))
    assert volume(slab.surface) == pytest.approx(expected, rel=1e-9)
    assert volume(of_kind(parts, "sleeper")[0].surface) == pytest.approx(0.2 * 0.2 * 2.0, rel=1e-9)
    assert volume(of_kind(parts, "rail")[0].surface) == pytest.approx(0.1 * 0.2 * (high - low), rel=1e-9)


def test_nothing_stands_in_the_clearance_of_a_track(proof_count: Count) -> None:
    """Over the rails' top nothing but rails and fastenings comes nearer than 2.20 m; walkways stay below it."""
    for seed in range(proof_count(20, 300)):
        narrow = {"walkway": 0.0, "shoulder": 0.2, "slab_shoulder": 0.05, "upstand": 0.12} if seed % 5 == 0 else {}
        top = top_of(seed, service=RAIL[seed % 2], track=narrow)
        assert top.tracks is not None
        lines = np.array(top.tracks.section.lines)
        assert 4.7 <= top.width <= (6.6 if len(lines) == 1 else 11.2)
        for part in build(top):
            if part.kind in ("rail", "sleeper"):
                continue
            high = part.surface.points[part.surface.points[:, 2] > 0.0]
            if len(high):
                assert np.abs(high[:, 1, None] - lines).min() >= CLEARANCE - 0.061, (
                    part.name
                )  # less a coping's overhang


def test_services_and_parapets_are_drawn_as_often_as_stated(proof_count: Count) -> None:
    """60 : 15 : 25 on default bridges; the paper's are always railways 10 m wide with plain walls."""
    count = proof_count(600, 4000)
    services: Counter[str] = Counter()
    shapes: dict[str, Counter[str]] = {"road": Counter(), "rail": Counter()}
    for seed in range(count):
        top = top_of(seed)
        tracks = 0 if top.tracks is None else len(top.tracks.section.lines)
        services[("road", "rail_single", "rail_double")[tracks]] += 1
        shapes[top.service][top.parapets.shape] += 1
    share = {name: services[name] / count for name in services}
    assert share == pytest.approx({"road": 0.60, "rail_single": 0.15, "rail_double": 0.25}, abs=0.06)
    assert set(shapes["road"]) == {"wall", "barrier", "railing", "wall_rail"}
    assert set(shapes["rail"]) == {"wall", "railing", "wall_rail"}
    for seed in range(20):
        top = top_of(seed, "paper")
        assert (top.service, top.parapets.shape, top.parapets.coping_height) == ("rail", "wall", 0.0)
        assert top.tracks is not None
        if len(top.tracks.section.lines) == 1:
            assert top.width == pytest.approx(10.0)
        assert 2.0 <= top.tracks.section.pitch <= 10.0


def test_a_fixed_service_changes_no_other_draw() -> None:
    """The road's cross-section is the same whatever else was fixed; so are the tracks."""
    for seed in range(8):
        roads = [top_of(seed, service="road", track=track) for track in ({}, {"bed": "slab"})]
        assert roads[0] == roads[1]
        one, two = (top_of(seed, service="rail_double", roadway={"lanes": lanes}) for lanes in (1, 6))
        assert one == two
        if top_of(seed).service == "road":
            assert top_of(seed) == roads[0]


def test_a_continuous_deck_has_joints_at_its_ends_only() -> None:
    """Three stretches of asphalt and two joints instead of four and three; kerbs and parapets run through."""
    top = top_of(2, service="road", parapet={"shape": "wall"})
    for spans, joints in ((SPANS, 3), (replace(SPANS, continuous=True), 2)):
        parts = build(top, spans)
        assert len(of_kind(parts, "expansion_joint")) == joints
        assert len(of_kind(parts, "surfacing")) == joints + 1
        ends = [part for part in parts if part.name.startswith("Terminal_")]
        assert len(ends) == 4
        assert len(of_kind(parts, "parapet")) == 2 * (joints + 1) + len(ends)
    assert replace(SPANS, one_row=True).rows == [(0, 0, 0.0), (0, 1, 13.0), (1, 1, 28.0)]
    assert replace(SPANS, one_row=True).pier_setback == 0.0
    assert len(SPANS.rows) == 4


def test_only_roads_of_four_lanes_and_more_are_divided(proof_count: Count) -> None:
    """A raised strip parts the directions of some of them, between solid lines; two lanes cannot have one."""
    divided = Counter(
        top.roadway.divided
        for seed in range(proof_count(60, 600))
        if (top := top_of(seed, service="road", roadway={"lanes": 4})).roadway is not None
    )
    assert 0.4 < divided[True] / divided.total() < 0.8  # three in five are
    assert not any(top_of(seed, service="road", roadway={"lanes": 2}).roadway.divided for seed in range(40))  # pyright: ignore
    top = top_of(
        3, service="road", roadway={"lanes": 4, "divided": True, "median": 2.0, "lane_width": 3.5, "shoulder": 0.5}
    )
    assert top.kerb_face == 2 * 3.5 + 1.0 + 0.5
    parts = build(top)
    strips = [part for part in parts if part.name.startswith("Median") and "Nose" not in part.name]
    assert [reach(part, 1) for part in strips] == [pytest.approx((-0.8, 0.8))] * 2
    noses = [reach(part, 0) for part in parts if "Nose" in part.name]  # half a disc before either end of the bridge
    assert noses[0] == pytest.approx((reach(strips[0], 0)[0] - 0.796, reach(strips[0], 0)[0] + 0.01))
    assert noses[1] == pytest.approx((reach(strips[-1], 0)[1] - 0.01, reach(strips[-1], 0)[1] + 0.796))
    markings = [part for part in of_kind(parts, "road_marking") if part.name.startswith("Marking_001")]
    solid = sorted(sum(reach(part, 1)) / 2.0 for part in markings if not part.parameters["dashed"])
    assert solid == pytest.approx([-8.0, -1.0, 1.0, 8.0])
    with pytest.raises(InputError, match=r"bridge\.roadway\.divided.*lanes = 4"):
        top_of(0, service="road", roadway={"lanes": 3, "divided": True})


@pytest.mark.parametrize("place", [PLACE, Alignment(0.0, grade=0.03, heading=0.4)])
def test_lines_on_the_road_are_lit_as_their_tops(place: Alignment) -> None:
    """No side wall along a line: what is not its top, bottom or end slopes by 30 degrees and has the top's normals."""
    top = top_of(3, service="road", roadway={"lanes": 3, "marking_width": 0.12})
    for part in of_kind(build(top, place=place), "road_marking"):
        mesh = part.surface
        ring = mesh.points[mesh.corners.reshape(-1, 4)]
        face = np.cross(ring[:, 2] - ring[:, 0], ring[:, 3] - ring[:, 1])
        face /= np.linalg.norm(face, axis=1, keepdims=True)
        normals = mesh.normals.reshape(-1, 4, 3)
        flat = face[:, 2] > 0.99
        ahead = np.array([np.cos(place.heading), np.sin(place.heading), 0.0])
        edge = ~flat & (np.abs(face @ ahead) < 0.5) & (face[:, 2] > -0.5)
        assert edge.sum() == 2 * flat.sum()
        assert (face[edge, 2] > np.cos(np.radians(32.0))).all()
        np.testing.assert_allclose(normals[edge] - face[flat][0], 0.0, atol=1e-6)
    ends = reach(of_kind(build(top), "road_marking")[0], 1)
    assert ends[1] - ends[0] == pytest.approx(0.12 + 2 * 1.75 * 0.005)  # 0.12 m where it meets the asphalt


@pytest.mark.parametrize("shape", ["wall", "barrier", "railing", "wall_rail"])
def test_parapets_end_in_blocks_on_the_approaches(shape: str) -> None:
    """A meter of concrete, higher than the parapet, closes each end; what comes from the bridge ends in it."""
    top = top_of(5, service="road", parapet={"shape": shape})
    parts = build(top)
    for number, outer in ((0, -8.0 + 0.004), (1, 28.0 + 8.0 - 0.004)):
        for side in ("L", "R"):
            block = next(part for part in parts if part.name == f"Terminal_Approach_{number}_{side}")
            ends = reach(block, 0)
            assert outer in (pytest.approx(ends[0]), pytest.approx(ends[1]))
            assert ends[1] - ends[0] == pytest.approx(1.0)
            assert reach(block, 2)[1] == pytest.approx(top.walk_level + top.parapets.height + 0.05)
            runs = [part for part in parts if part.name.endswith(f"Approach_{number}_{side}") and part is not block]
            runs = [part for part in runs if part.kind in ("parapet", "parapet_coping", "railing")]
            assert runs
            for part in runs:
                end = reach(part, 0)[number]
                assert ends[0] < end < ends[1]
                assert end == pytest.approx(ends[1] - 0.01 if number == 0 else ends[0] + 0.01)
    assert not any(part.name.startswith("Terminal") for part in build(top_of(5, "paper", service="road")))


@pytest.mark.parametrize("service", ["road", "rail_single"])
@pytest.mark.parametrize("shape", ["wall", "barrier", "railing", "wall_rail"])
def test_parapets_reach_their_height_on_both_sides(service: str, shape: str) -> None:
    """Each kind is mirrored, as high above the way beside it as it says, and outside the road or track."""
    for infill in ("rails", "bars"):
        top = top_of(5, service=service, parapet={"shape": shape, "infill": infill})
        parts = [part for part in build(top) if part.group == "Furniture" and "_000_" in part.name]
        by_side = [[part for part in parts if part.name.endswith(side)] for side in ("_L", "_R")]
        for left, right in zip(*by_side, strict=True):
            assert volume(left.surface) == pytest.approx(volume(right.surface), rel=1e-9)
            assert reach(left, 1) == pytest.approx([-edge for edge in reach(right, 1)[::-1]])
        highest = max(reach(part, 2)[1] for part in parts)
        assert highest == pytest.approx(top.walk_level + top.parapets.height, abs=2e-3)
        assert min(abs(y) for part in parts for y in reach(part, 1)) > top.kerb_face
        assert max(reach(part, 1)[1] for part in parts) <= 0.5 * top.width + 0.04  # a coping's overhang less the ledge
        assert ({part.kind for part in parts} >= {"railing", "railing_post"}) == (shape in ("railing", "wall_rail"))


def test_railings_have_evenly_spaced_posts_and_close_bars() -> None:
    """Posts at most the pitch apart, bars every 0.12 m but where a post stands, and as many rails as told."""
    top = top_of(4, service="road", parapet={"shape": "railing", "infill": "bars", "post_pitch": 1.8})
    railings = top.parapets.railings
    stations = post_stations(railings, 0.0, 14.0)
    assert np.ptp(np.diff(stations)) < 1e-9
    assert np.diff(stations).max() <= 1.8
    assert (stations[0], stations[-1]) == (0.25, 13.75)
    railing = next(part for part in build(top) if part.name == "Railing_000_L")
    post = next(part for part in build(top) if part.name == "Post_000_L")
    middle = 0.5 * sum(reach(railing, 2))
    x = np.concatenate([part.surface.points[:, 0] for part in (railing, post)])
    z = np.concatenate([part.surface.points[:, 2] for part in (railing, post)])
    upright = np.unique(np.round(x[(z > middle - 0.6) & (z < middle + 0.6)], 4))
    assert np.diff(upright).max() < 0.121 + 0.12  # where a bar is left out for a post, the post stands in the gap
    told = top_of(4, service="road", parapet={"shape": "railing", "infill": "rails", "rails": 3})
    railing = next(part for part in build(told) if part.name == "Railing_000_L")
    assert int(railing.surface.chart.max()) + 1 == 3 * (1 + 3)  # sides and two ends of each rail


def test_copies_are_rigid() -> None:
    """Copies keep volume and right angles on a bridge with grade and crossfall; upright ones stay plumb."""
    place = Alignment(3.0, 0.04, 0.3, falls=((0.0, 0.05),))
    box = Prism(rectangle((-0.1, -0.2), (0.1, 0.2)), 0.0, 1.0, "above", LOCAL).surface
    for upright in (True, False):
        frames = frames_along(place, np.array([1.0, 7.0, 9.5]), 2.0, 0.5, upright=upright)
        turn = frames[:, :3, :3]
        np.testing.assert_allclose(turn @ turn.transpose(0, 2, 1), np.tile(np.eye(3), (3, 1, 1)), atol=1e-12)
        assert np.all(np.linalg.det(turn) > 0.0)
        assert np.allclose(frames[:, :3, 2], (0.0, 0.0, 1.0)) == upright
        assert volume(copied_together(box, frames)) == pytest.approx(3 * 0.08, rel=1e-9)
        np.testing.assert_allclose(
            frames[:, :3, 3], place.point(np.array([1.0, 7.0, 9.5]), np.full(3, 2.0), np.full(3, 0.5))
        )


def test_a_concrete_sleeper_is_waisted_and_holds_the_rails() -> None:
    """Its body is thinner between the rails, and its fastenings stand beside the rails' feet, not in them."""
    top = top_of(1, service="rail_single", track={"sleeper": "concrete", "bed": "ballast"})
    assert top.tracks is not None
    section = top.tracks.section
    points = sleeper_solid(section).points
    body = section.sleeper_length * section.sleeper_width * section.sleeper_height
    assert 0.75 * body < volume(sleeper_solid(section)) < body
    middle = points[np.abs(points[:, 1]) < 0.5, 2].max()
    assert middle < -0.015
    clips = points[points[:, 2] > 0.01]
    apart = np.abs(np.abs(clips[:, 1]) - 0.5 * (GAUGE + section.rail_head))
    assert apart.min() > 0.5 * section.rail_foot


def rail_meshes(pieces: tuple[Any, ...], prefix: str) -> F64:
    """Points of the pieces whose names begin so [m], shape (N, 3)."""
    return np.concatenate([p.mesh.points for p in pieces if isinstance(p, Component) and p.name.startswith(prefix)])


@pytest.mark.parametrize("kind", ["straight", "arc"])
def test_the_site_takes_over_where_the_track_ends(kind: str) -> None:
    """Rails meet within 5 mm, the first sleeper comes half a pitch later, and no road is left."""
    settings = {
        "family": "slab",
        "service": "rail_double",
        "alignment": {"kind": kind},
        "slab": {"spans": [10.0, 10.0]},
    }
    layout, drawn = draw_layout(parse_settings(BridgeSettings, settings, "test"), stream(6, "bridge"))
    assert layout.track is not None
    site = draw_site(SiteSettings(), layout, stream(6, "site"))
    approach = [
        piece for piece in site.pieces if isinstance(piece, Component) and piece.name.startswith("Site_Approach")
    ]
    assert {piece.kind for piece in approach} == {"rail_bed"}
    begin, end = track_range(drawn.record.spans)
    for number, station in enumerate((begin, end)):
        found = rail_meshes(site.pieces, f"Site_ApproachRails_{number}")
        for left in layout.track.rails:
            head = layout.alignment.point(np.array([station]), np.array([left]), np.zeros(1))[0]
            near = found[np.linalg.norm(found[:, :2] - head[:2], axis=1) < 0.04]
            assert abs(near[:, 2].max() - head[2]) < 5e-3
        sleepers = rail_meshes(site.pieces, f"Site_ApproachSleepers_{number}")
        stations = layout.alignment.locate(sleepers)[0]
        first = np.abs(stations - station).min() + 0.5 * layout.track.sleeper_width
        assert 0.28 < first < 0.36
