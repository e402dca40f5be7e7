"""Homesteads: a drive leads from a road to every house, gardens have a gate, and nothing overlaps."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.plan_curve import Element
from authoring.backgrounds.byways import (
    HIGHEST,
    RAISED,
    RAMP,
    Byway,
    ground,
    laid,
    resampled,
    road_byways,
    road_distance,
)
from authoring.backgrounds.countryside import VERGE
from authoring.backgrounds.facade_parts import HOME
from authoring.backgrounds.far_ways import far_ways
from authoring.backgrounds.farm_lanes import draw_farm_lanes
from authoring.backgrounds.groves import draw_groves
from authoring.backgrounds.hamlet import draw_hamlet, occupied
from authoring.backgrounds.homesteads import DRIVE, PANEL, Homestead, Plan, draw_cottage, draw_farm
from authoring.backgrounds.lanes import Lane, lane_pieces
from authoring.backgrounds.lowland import valley_fields
from authoring.backgrounds.registry import BackgroundSettings, build_background
from authoring.backgrounds.solids import box
from authoring.backgrounds.terrain import Terrain, grow_terrain, rolling_hills
from authoring.backgrounds.waters import Basin
from authoring.backgrounds.yards import boundary
from authoring.shapes.component import Component, Mesh, Scatter, triangles
from authoring.site.covers import to_world
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.site.ways import Line, ribbon
from authoring.streams import stream

F64 = NDArray[np.float64]
B = NDArray[np.bool_]
Pieces = tuple[Component | Scatter, ...]

AXES = {
    "straight": Alignment(5.0),
    "bent": Alignment(5.0, plan=(Element(60.0, 1 / 150.0, 1 / 150.0),), skew=0.3),
}


@dataclass(frozen=True, eq=False)
class Hamlet:
    """A hamlet and the roads and land that it lies on."""

    terrain: Terrain
    roads: list[Byway]
    lanes: list[Byway]
    homes: tuple[Homestead, ...]


@cache
def _site(name: str) -> Site:
    layout = Layout(AXES[name], (0.0, 30.0, 60.0), 11.5, 1.9, soffit=1.3)
    return draw_site(SiteSettings(crossing="road", fine_spacing=2.0, coarse_spacing=6.0), layout, stream(4, "site"))


@pytest.fixture(scope="module", params=sorted(AXES))
def hamlet(request: pytest.FixtureRequest) -> Hamlet:
    """A hamlet on a straight and on a bent skewed axis."""
    site = _site(request.param)
    own, rng = site.field, stream(4, "background")
    inner = (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
    terrain = grow_terrain(site, rolling_hills(site.land, inner, 30.0, rng), 2000.0)
    roads = road_byways(terrain, far_ways(terrain), VERGE)
    lanes = [lane for _, lane in draw_farm_lanes(terrain, roads, 3, rng)]
    return Hamlet(terrain, roads, lanes, draw_hamlet(terrain, roads, lanes, 20, rng))


def test_a_long_bridge_has_a_hamlet_at_its_ends() -> None:
    """Where the middle of the site is farther from its ends than lanes and drives reach, they are sought there."""
    layout = Layout(AXES["straight"], (0.0, 700.0), 11.5, 1.9)
    site = draw_site(SiteSettings(crossing="river", fine_spacing=2.0, coarse_spacing=6.0), layout, stream(4, "site"))
    pieces = build_background("countryside", BackgroundSettings(), site, stream(4, "background"))
    walls = [piece for piece in pieces if isinstance(piece, Component) and "_House_" in piece.name]
    assert len({piece.name.split("_")[2] for piece in walls}) > 4


def test_every_drive_joins_a_road_at_its_edge(hamlet: Hamlet) -> None:
    """It begins on the edge of a road or lane, leaves it at about a right angle, and ends within its own lot."""
    assert len(hamlet.homes) > 8
    assert len(hamlet.lanes) > 0
    ways = [*hamlet.roads, *hamlet.lanes]
    for home in hamlet.homes:
        path = resampled(home.driveway(), 1.0)
        assert abs(road_distance(ways, path[:1])[0]) < 0.3  # a skewed cross-section is longer than a road is wide
        assert (road_distance(ways, path[1:]) > 0.5).all()
        assert home.inside(path[-1:])[0] > 2.0
        assert len(home.houses) == len(home.plan.houses) > 0


def test_lots_overlap_neither_each_other_nor_ways(hamlet: Hamlet) -> None:
    """Points every 1.5 m of every lot lie outside all other lots, all roads, lanes, drives of others and the site."""
    ways = [*hamlet.roads, *hamlet.lanes]
    for home in hamlet.homes:
        wide, deep = home.plan.size
        grid = np.stack(np.meshgrid(np.arange(-wide / 2, wide / 2, 1.5), np.arange(0.0, deep, 1.5)), -1).reshape(-1, 2)
        places = home.world(grid)
        assert road_distance(ways, places).min() > 1.5
        station, left = hamlet.terrain.land.layout.alignment.locate(np.column_stack([places, np.zeros(len(places))]))
        assert min(hamlet.terrain.beyond(station, left).min(), hamlet.terrain.clear(station, left).min()) > 5.0
        for other in hamlet.homes:
            if other is not home:
                assert other.inside(places).max() < 0.0
                assert home.inside(resampled(other.driveway(), 0.5)).max() < -DRIVE


def test_a_hedge_or_fence_leaves_a_gate(hamlet: Hamlet) -> None:
    """Hedge and fence surround the lot but for the drive: the gap is where it enters, and a panel wide."""
    for home in hamlet.homes:
        wide, deep = home.plan.size
        for step in (1.5, PANEL):
            line = boundary(home, step)
            middle = line[:, :2] + (0.5 * PANEL if step == PANEL else 0.0) * np.column_stack(
                [np.cos(line[:, 2]), np.sin(line[:, 2])]
            )
            front = np.sort(middle[(line[:, 2] == 0.0), 0])
            gaps = np.diff(front)
            widest = int(np.argmax(gaps))
            assert front[widest] < home.plan.drive[0] < front[widest + 1]
            assert 2 * DRIVE < gaps[widest] <= 2 * PANEL + 1e-9
            assert np.delete(gaps, widest).max() < step + 1e-9
            assert len(line) == pytest.approx(2 * (wide + deep) / step, abs=4)


@pytest.mark.parametrize("draw", [draw_cottage, draw_farm])
def test_nothing_in_a_garden_overlaps(draw: Callable[[np.random.Generator], Plan]) -> None:
    """In 200 plans: buildings and garages keep apart, clear of the drive, within the lot, and no tree on paving."""
    rng = np.random.default_rng(5)
    for _ in range(200):
        plan = draw(rng)
        boxes = []
        for house, x, y, turn in plan.houses:
            hx, hy = (house.length / 2, house.width / 2) if turn == 0.0 else (house.width / 2, house.length / 2)
            boxes.append((x - hx, x + hx, y - hy, y + hy))
        boxes += [(x - 1.9, x + 1.9, y - 3.1, y + 3.1) for x, y in plan.sheds]
        drive = (plan.drive[0] - DRIVE, plan.drive[0] + DRIVE, 0.0, plan.drive[1] - 0.01)
        for number, one in enumerate(boxes):
            assert not any(_meet(one, other) for other in (*boxes[:number], drive))
            assert -plan.size[0] / 2 < one[0]
            assert one[1] < plan.size[0] / 2
            assert one[2] > 0.0
            assert one[3] < plan.size[1]
        paved = [*boxes, drive, *(area for area, _ in plan.yards)]
        for x, y in plan.trees:
            assert not any(_meet((x, x, y, y), area) for area in paved)


def test_a_lane_lies_on_the_ground_and_rises_to_its_road(hamlet: Hamlet) -> None:
    """Its edges are `RAISED` above the ground away from its road, and at the road's height where it joins it."""
    home = hamlet.homes[0]
    path = resampled(home.driveway())
    start = float(home.joint[2])
    _, edges = laid(hamlet.terrain, path, DRIVE, start)
    for edge in (edges.left, edges.right):
        above = edge[:, 2] - ground(hamlet.terrain, edge[:, :2])
        along = np.hypot(*(path - path[0]).T)
        np.testing.assert_allclose(above[:-1][along[:-1] > RAMP + 0.5], RAISED, atol=1e-6)
        assert edge[0, 2] == start
        assert above[:-1].max() < HIGHEST + RAISED


def test_a_wall_is_open_where_a_drive_leaves() -> None:
    """The parapet is 0.45 m high along a lane, and below its surface over 4 m at a gate; the lane is the same."""
    site = _site("straight")
    terrain = grow_terrain(site, lambda station, left: np.zeros(np.shape(station)), 2000.0)
    at = np.arange(200.0, 300.0, 8.0)
    line = Line(at, np.full(len(at), 150.0), np.tile([0.0, 1.0], (len(at), 1)))
    lane = Lane(line, np.full(len(at), 5.0), np.full(len(at), 4.0), 2.3, 1.0)
    gates = np.array([[243.0, 150.0 - 2.3], [260.0, 190.0]])  # the second is beside another lane
    whole, opened = (lane_pieces(terrain, (lane,), gates=rows) for rows in (None, gates))
    top = opened[1][4].points.reshape(4, -1, 3)[1]
    gap = np.abs(top[:, 0] - 243.0) < 2.01
    assert gap.sum() >= 2
    assert (top[gap, 2] < 5.0).all()
    np.testing.assert_allclose(top[np.abs(top[:, 0] - 243.0) > 2.2, 2], 5.45)
    assert np.ptp(top[gap, 0]) == pytest.approx(4.0)
    assert _area(opened[0][4]) == pytest.approx(_area(whole[0][4]))


def test_a_field_that_a_drive_touches_has_no_crop(hamlet: Hamlet) -> None:
    """A circle of a drive inside a field of a valley takes the crop from all of it, and from no other field."""
    terrain = hamlet.terrain
    sea = Basin(1.0, -9.0, 9000.0, lambda x, y: -9000.0 + 0.0 * x, lambda x: 9000.0 + 0.0 * x)
    parcels, crops = valley_fields(terrain, sea, np.zeros((0, 3)), (), stream(4, "fields"))
    crop = [parcel for parcel in parcels if parcel.crop == "crop" and parcel.half[0] > 60.0]
    field = next(parcel for parcel in crop if parcel.side * parcel.center[1] > 50.0)
    drive = np.array([[*field.center, 1.5]])
    after, fewer = valley_fields(terrain, sea, drive, (), stream(4, "fields"))
    assert [one.crop for one in after] == ["" if one is field else one.crop for one in parcels]
    inside = field.inside(*terrain.nodes()) > 0.0
    assert any((values[inside] > 0.0).any() for _, values in crops)
    assert not any((values[inside] > 0.0).any() for _, values in fewer)


@pytest.mark.parametrize("shares", [(1.0, -1.0), (1.0, 0.0, -1.0), (1.0, 0.6, 0.2, -0.2, -0.6, -1.0)])
@pytest.mark.parametrize("flanks", [True, False])
def test_road_edges_are_found_in_any_cross_section(hamlet: Hamlet, shares: tuple[float, ...], flanks: bool) -> None:
    """A road of 2 to 8 lines, with or without buried flanks, has the edges that it was built with, line by line."""
    at, half = np.linspace(0.0, 120.0, 41), 3.4
    profile = [(half * share, 2.0 + 0.08 * (1.0 - abs(share))) for share in shares]
    if flanks:
        profile = [(half, 1.5), *profile, (-half, 1.5)]
    rows = [np.column_stack([at, np.full((41, 2), (left + 160.0, height))]) for left, height in profile]
    axis = hamlet.terrain.land.layout.alignment
    outer = (
        [half + 0.5, *(half * share for share in shares), -half - 0.5] if flanks else [half * share for share in shares]
    )
    mesh = ribbon(axis, rows, at, tuple(outer))
    pond = box(HOME, (10.0, 160.0, 0.0), (30.0, 20.0, 1.0))
    pieces = [
        ("Road", "road", "asphalt", mesh),
        ("Pad", "road", "asphalt", pond),
        ("Marks", "road", "road_marking", mesh),
    ]
    (road,) = road_byways(hamlet.terrain, pieces, 1.0)
    np.testing.assert_allclose(road.left, to_world(axis, rows[1 if flanks else 0]), atol=1e-9)
    np.testing.assert_allclose(road.right, to_world(axis, rows[-2 if flanks else -1]), atol=1e-9)


def test_trees_stand_in_rows_along_lanes(hamlet: Hamlet) -> None:
    """Each lane has a row on one side, 4.4 m from its edge, but where a homestead or its drive is."""
    terrain, lanes, homes = hamlet.terrain, hamlet.lanes, hamlet.homes
    taken = occupied(terrain, homes, lanes)
    groves = draw_groves(
        terrain, (), lanes, taken, 10_000, stream(4, "trees"), outside=lambda x, y: np.full(x.shape, -1.0)
    )
    places = terrain.land.layout.alignment.point(groves[:, 0], groves[:, 1], np.zeros(len(groves)))[:, :2]
    for lane in lanes:
        edges = np.concatenate([lane.left[:, :2], lane.right[:, :2]])
        apart = np.linalg.norm(places[:, None] - edges, axis=2).min(axis=1)  # edges have points every 1.5 m
        assert ((apart > 4.3) & (apart < 4.6)).sum() >= 3
    assert road_distance(lanes, places).min() > 4.0


def _meet(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Whether two boxes (lowest and highest x, lowest and highest y) share more than a border."""
    return one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]


def _area(mesh: Mesh) -> float:
    corners = mesh.points[triangles(mesh)]
    return float(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum())
