"""The worlds `lakeside` and `hillside`: they join the site, leave it empty, and their water and houses lie right."""

from functools import cache
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import KDTree

from authoring.axis.alignment import Alignment, Layout
from authoring.backgrounds.harbour import crane
from authoring.backgrounds.hillside import HillsideSettings
from authoring.backgrounds.lakeside import LakesideSettings
from authoring.backgrounds.lowland import STEEPEST
from authoring.backgrounds.registry import BackgroundSettings, build_background
from authoring.backgrounds.slope_plants import TREE_LINE
from authoring.shapes.component import FIRST_BACKGROUND_ID, LAST_ID, Component, Mesh, Scatter, triangles
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from tests.authoring.world_parts import Pieces, along_border, runs, solids, standing_on, yards
from usd_schemas.components import class_of

F64 = NDArray[np.float64]
World = tuple[str, Site, Pieces]
LAYOUTS = {
    "river": Layout(Alignment(7.0), (0.0, 18.0, 40.0), 11.5, 1.9),
    "road": Layout(Alignment(7.0, 0.015, 0.4), (0.0, 18.0, 40.0), 11.5, 1.9, "road", 8.0, 3.4),
}
KINDS = {
    "building",
    "roof",
    "window",
    "tree",
    "shrub",
    "fence",
    "wall_retaining",
    "pole",
    "vehicle",
    "vessel",
    "water",
    "ground",
    "road",
}
OVER: dict[str, Literal["river", "rail"]] = {"lakeside": "rail", "hillside": "river"}
WHOLE = BackgroundSettings()
FEW = BackgroundSettings(
    lakeside=LakesideSettings(reach=2500.0, villas=25, town_houses=6, trees=150, boats=8),
    hillside=HillsideSettings(reach=2500.0, houses=40, blocks=8, sheds=4, cranes=2, trees=150),
)


def make(
    name: str, crossing: Literal["river", "road", "rail"], seed: int, settings: BackgroundSettings = WHOLE
) -> World:
    """Build a site with a world round it."""
    drawn = SiteSettings(crossing=crossing, fine_spacing=1.6, coarse_spacing=5.0)
    site = draw_site(drawn, LAYOUTS.get(crossing, LAYOUTS["road"]), stream(seed, "site"))
    return name, site, build_background(name, settings, site, stream(seed, "background"))


@cache
def small_world(name: str, seed: int) -> World:
    """A site over a railway or a river with a small world round it, made once."""
    return make(name, OVER[name], seed, FEW)


@pytest.fixture(
    scope="module",
    params=[
        ("lakeside", "river", 7),
        pytest.param(("lakeside", "road", 3), marks=pytest.mark.proof_only),
        pytest.param(("hillside", "river", 7), marks=pytest.mark.proof_only),
        ("hillside", "road", 4),
    ],
)
def world(request: pytest.FixtureRequest) -> World:
    """A site with a world round it."""
    return make(*request.param)


def placed(run: Scatter, row: int) -> F64:
    """World positions of the vertices of one repeat, shape (N, 3)."""
    local = np.concatenate([mesh.points for _, mesh in run.prototypes[run.prototype[row]]]) * run.scales[row]
    c, s = np.cos(run.yaw[row]), np.sin(run.yaw[row])
    return local @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + run.positions[row]


def ground_soup(pieces: Pieces) -> F64:
    """Triangles of the ground without open water, shape (T, 3, 3)."""
    parts = [part for part in solids(pieces) if part.group == "Ground" and not part.name.endswith("OpenWater")]
    return np.concatenate([part.mesh.points[triangles(part.mesh)] for part in parts])


def heights_below(soup: F64, places: F64) -> F64:
    """Heights of the ground at places in plan by brute force; NaN where there is none, shape (N,)."""
    found = np.full(len(places), np.nan)
    low, high = soup[:, :, :2].min(axis=1), soup[:, :, :2].max(axis=1)
    for row, place in enumerate(places):
        a, b, c = np.moveaxis(soup[((low <= place) & (high >= place)).all(axis=1)], 1, 0)
        one, two, away = (b - a).T, (c - a).T, (place - a[:, :2]).T
        area = one[0] * two[1] - one[1] * two[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (away[0] * two[1] - away[1] * two[0]) / area, (one[0] * away[1] - one[1] * away[0]) / area
        under = (np.abs(area) > 1e-12) & (first > -1e-9) & (second > -1e-9) & (first + second < 1 + 1e-9)
        if under.any():
            found[row] = (a[:, 2] + first * one[2] + second * two[2])[under][-1]
    return found


@pytest.mark.parametrize("name", ["lakeside", "hillside"])
def test_cars_keep_to_the_right_of_the_shore_road(name: str) -> None:
    """The middle line of the road lies on the left of every car that drives on it, and so do those parked beside it."""
    _, _, pieces = small_world(name, 7)
    (cars,) = runs(pieces, "_Vehicles")
    line = np.concatenate([part.mesh.points[:, :2] for part in solids(pieces) if "ShoreMarking" in part.name])
    away = line[KDTree(line).query(cars.positions[:, :2])[1]] - cars.positions[:, :2]
    beside = np.cos(cars.yaw) * away[:, 1] - np.sin(cars.yaw) * away[:, 0]
    road = np.linalg.norm(away, axis=1) < 6.0
    assert road.sum() > 8
    assert beside[road].min() > 1.0


@pytest.mark.parametrize("group", ["Ground", "Ways"])
def test_joint_shares_every_vertex(world: World, group: str) -> None:
    """Ground, roads and water of site and world have the very same vertices along the site's border."""
    _, site, pieces = world
    ours, theirs = (
        along_border(site, [part for part in solids(side) if part.group == group and "Marking" not in part.name])
        for side in (site.pieces, pieces)
    )
    assert len(ours) > (120 if group == "Ground" else 12)
    assert ours == theirs


def test_keep_out_is_empty(world: World) -> None:
    """No vertex of the world lies in the strip, below or above ground."""
    _, site, pieces = world
    (box,) = site.keep_out
    for component in solids(pieces):
        assert not box.contains(component.mesh.points, margin=1e-6).any(), component.name
    for run in runs(pieces):
        near = np.flatnonzero(np.hypot(*(run.positions[:, :2] - site.extent.mean(axis=0)).T) < 220.0)
        for row in near:
            assert not box.contains(placed(run, int(row))).any(), run.name


def test_names_kinds_and_ids(world: World) -> None:
    """All is background and of many kinds; names and ids are unique, ids without a gap in the background's range."""
    _, site, pieces = world
    assert {class_of(piece.kind) for piece in pieces} == {"background"}
    assert {piece.kind for piece in pieces} >= KINDS
    ids = [part.instance_id for part in solids(pieces)] + [n for run in runs(pieces) for n in run.instance_ids]
    assert sorted(ids) == list(range(FIRST_BACKGROUND_ID, FIRST_BACKGROUND_ID + len(ids)))
    assert max(ids) <= LAST_ID
    assert all(len(run.instance_ids) in (1, len(run.positions)) for run in runs(pieces))
    names = [piece.name for piece in (*site.pieces, *pieces)]
    assert len(set(names)) == len(names)


def test_open_water_is_level_and_below_its_shore(world: World) -> None:
    """The water has one height, below the crossing's water; ground beside it rises from it and nowhere dips under."""
    _, site, pieces = world
    (water,) = (part for part in solids(pieces) if part.name.endswith("OpenWater"))
    level = water.mesh.points[0, 2]
    assert np.ptp(water.mesh.points[:, 2]) < 1e-9
    if site.land.crossing.kind == "river":
        assert level < site.land.crossing.level - 0.2
    corner = water.mesh.points[triangles(water.mesh)]
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] / 2
    assert flat.min() > 0
    assert flat.sum() > 4e5
    shared = {row.tobytes() for row in np.round(water.mesh.points, 6)}
    soup = ground_soup(pieces)
    at_shore = np.array([row.tobytes() in shared for row in np.round(soup.reshape(-1, 3), 6)]).reshape(-1, 3)
    beside = soup[at_shore.sum(axis=1) == 2]
    assert len(beside) > 60
    inland = beside[~at_shore[at_shore.sum(axis=1) == 2]]
    assert np.quantile(inland[:, 2], 0.02) >= level - 1e-6  # all but the bed of a river that flows in


def test_woods_end_at_the_tree_line(world: World) -> None:
    """No wood grows above the tree line where it is highest; peaks are higher, of rock and of grass."""
    _, _, pieces = world
    (water,) = (part for part in solids(pieces) if part.name.endswith("OpenWater"))
    level, line = water.mesh.points[0, 2], TREE_LINE[0] + 2.0 * 0.58 * TREE_LINE[1]  # its noise is within 0.58
    high = dict.fromkeys(("woodland", "cliff", "grass"), 0.0)  # area above the line
    for part in solids(pieces):
        if part.group == "Ground" and part.role in high:
            corner = part.mesh.points[triangles(part.mesh)]
            if part.role == "woodland":
                assert corner[..., 2].max() - level < line + 2.0, part.name  # a border is moved by up to 1.4 m
            area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
            high[part.role] += 0.5 * float(area[corner[..., 2].min(axis=1) - level > line].sum())
    assert min(high["cliff"], high["grass"]) > 1e7


def test_water_ends_where_the_ground_comes_up_to_it(world: World) -> None:
    """Ground that shares a place of the water's edge is as high as the water, but in the mouth of a river."""
    _, site, pieces = world
    (water,) = (part for part in solids(pieces) if part.name.endswith("OpenWater"))
    edge = {row.tobytes() for row in np.round(water.mesh.points[:, :2], 3)}
    land = np.concatenate([p.mesh.points for p in solids(pieces) if p.group == "Ground" and p is not water])
    land = land[np.array([row.tobytes() in edge for row in np.round(land[:, :2], 3)])]
    assert len(land) > 100
    crossing = site.land.crossing
    apart = crossing.distance(*site.land.layout.alignment.locate(land)) > crossing.half_width + 12.0
    low = land[:, 2] < water.mesh.points[0, 2] - 0.02
    assert not (low & (apart | (crossing.kind != "river"))).any()


def test_a_road_under_the_bridge_ends_before_the_water(world: World) -> None:
    """No stretch of it lies in open water: a dam through the sea is no harbour."""
    _, _, pieces = world
    (water,) = (part for part in solids(pieces) if part.name.endswith("OpenWater"))
    soup = water.mesh.points[triangles(water.mesh)]
    ends = [p for p in solids(pieces) if p.kind in ("road", "rail_bed") and p.name.endswith(("_Left", "_Right"))]
    for part in ends:
        assert np.isnan(heights_below(soup, part.mesh.points[:: max(len(part.mesh.points) // 60, 1), :2])).all()


def test_a_railway_under_the_bridge_ends_at_buffer_stops() -> None:
    """One across each track, over its rails' ends and above them, before the water; no piece is left without a face."""
    _, site, pieces = small_world("lakeside", 3)
    assert [part.name for part in solids(pieces) if not len(part.mesh.face_counts)] == []
    (stops,) = (part for part in solids(pieces) if "BufferStops" in part.name)
    side = stops.name.rpartition("_")[2]
    (rails,) = (part for part in solids(pieces) if part.name == f"Lakeside_Rails_{side}")
    axis, crossing = site.land.layout.alignment, site.land.crossing
    toward = 1.0 if side == "Left" else -1.0
    blocks = stops.mesh.points.reshape(2, 8, 3)
    along = toward * axis.locate(rails.mesh.points)[1]
    for block in blocks:
        station, left = axis.locate(block)
        away = np.ptp(crossing.distance(station, left) * np.sign(station - crossing.center(left)))
        assert away == pytest.approx(2.7, rel=0.1)
        assert (along.max() - 4.0 < toward * left).all()
        assert (toward * left < along.max()).all()
        assert block[:, 2].max() > rails.mesh.points[along > along.max() - 9.0, 2].max() + 1.0
        assert block[:, 2].min() < rails.mesh.points[:, 2].min() - 0.5


def test_ground_has_no_gap_and_no_overlap(world: World) -> None:
    """The plan areas of ground and open water add up to the land less the site; it reaches over four kilometers."""
    _, site, pieces = world
    parts = [part for part in solids(pieces) if part.group == "Ground"]
    corners = np.concatenate([part.mesh.points[triangles(part.mesh)] for part in parts])
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    size = np.ptp(np.stack(site.land.layout.alignment.locate(corners.reshape(-1, 3))), axis=1)
    land = size[0] * size[1] - np.ptp(site.field.stations) * np.ptp(site.field.lefts)
    assert flat.sum() / 2 == pytest.approx(land, rel=1e-3)
    assert size.min() > 8000.0


def test_houses_stand_in_the_ground(world: World) -> None:
    """The foot of every sampled house lies below the ground at its corners, its floor not below the terrace."""
    _, _, pieces = world
    soup = ground_soup(pieces)
    soup = soup[np.abs(soup - soup.mean(axis=1, keepdims=True)).max(axis=(1, 2)) < 300.0]
    for run in runs(pieces, "Walls"):
        for row in range(0, len(run.positions), 53):
            points = placed(run, row)
            foot = points[points[:, 2] < points[:, 2].min() + 0.01]
            ground = heights_below(soup, foot[:, :2])
            assert (foot[:, 2] < ground[~np.isnan(ground)] + 0.3).all(), (run.name, row)
            at = heights_below(soup, run.positions[row : row + 1, :2])
            assert not (run.positions[row, 2] < at - 1.2).any(), (run.name, row)


def test_houses_do_not_overlap(world: World) -> None:
    """No corner of a house lies within another: tried for every pair."""
    _, _, pieces = world
    middles, turns, halves = [], [], []
    for run in runs(pieces, "Walls"):
        size = [np.abs(prototype[0][1].points[:, :2]).max(axis=0) for prototype in run.prototypes]
        middles.append(run.positions[:, :2])
        turns.append(run.yaw)
        halves.append(np.array(size)[run.prototype])
    middle, turn, half = np.concatenate(middles), np.concatenate(turns), np.concatenate(halves)
    assert len(middle) > 150
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)])
    for row in range(len(middle)):
        c, s = np.cos(turn[row]), np.sin(turn[row])
        probes = signs * half[row] @ np.array([[c, s], [-s, c]]) + middle[row]
        near = np.flatnonzero(np.hypot(*(middle - middle[row]).T) < 60.0)
        for other in near[near != row]:
            offset = probes - middle[other]
            c, s = np.cos(turn[other]), np.sin(turn[other])
            inside = (np.abs(offset[:, 0] * c + offset[:, 1] * s) < half[other, 0]) & (
                np.abs(offset[:, 1] * c - offset[:, 0] * s) < half[other, 1]
            )
            assert not inside.any()


def test_boats_float(world: World) -> None:
    """Every vessel floats on open water, clear of the land."""
    _, _, pieces = world
    (water,) = (part for part in solids(pieces) if part.name.endswith("OpenWater"))
    boats = [run for run in runs(pieces) if run.kind == "vessel"]
    assert sum(len(run.positions) for run in boats) > 20
    soup = water.mesh.points[triangles(water.mesh)]
    for run in boats:
        assert np.abs(run.positions[:, 2] - water.mesh.points[0, 2]).max() < 1e-6
        assert not np.isnan(heights_below(soup, run.positions[::7, :2])).any()


def test_shapes_are_sound_and_few(world: World) -> None:
    """No degenerate triangle, unit normals, site and world within 1.5 million instanced triangles."""
    _, site, pieces = world
    total = 0
    for piece in (*site.pieces, *pieces):
        meshes: list[tuple[Mesh, int]] = []
        if isinstance(piece, Component):
            meshes.append((piece.mesh, 1))
        else:
            counts = np.bincount(piece.prototype, minlength=len(piece.prototypes))
            meshes += [(mesh, int(n)) for n, parts in zip(counts, piece.prototypes, strict=True) for _, mesh in parts]
        for mesh, weight in meshes:
            corner = mesh.points[triangles(mesh)]
            normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            assert np.linalg.norm(normal, axis=1).min() > 1e-9, piece.name
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-4)
            total += weight * len(corner)
    assert total <= 1_500_000  # as for whole scenes: see test_worlds.py


def test_nothing_stands_on_a_drive(world: World) -> None:
    """No tree, bush, pole or fence post stands on a yard or drive, which all are outside the keep-out volume."""
    _, site, pieces = world
    corners = yards(pieces)
    assert not any(box.contains(corners.reshape(-1, 3)).any() for box in site.keep_out)
    assert standing_on(corners, pieces) == []


def test_valleys_have_fields_on_even_dry_land(world: World) -> None:
    """Crops cover hectares of a valley's floor; they lie above the open water, on slopes that can be ploughed."""
    _, _, pieces = world
    water = max(part.mesh.points[:, 2].max() for part in solids(pieces) if "OpenWater" in part.name)
    crops = ("Ploughed", "Crop", "RipeCrop", "Hay")
    fields = [part for part in solids(pieces) if part.name.split("_")[1] in crops]
    corner = np.concatenate([part.mesh.points[triangles(part.mesh)] for part in fields])
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area, slope = 0.5 * np.linalg.norm(normal, axis=1), np.hypot(normal[:, 0], normal[:, 1]) / normal[:, 2]
    assert area.sum() > 40_000.0
    assert corner[..., 2].min() > water
    assert float((area * (slope > 1.5 * STEEPEST)).sum() / area.sum()) < 0.03


def test_walls_hold_terraces() -> None:
    """Every terrace of the hillside is level across, and a retaining wall stands at its lower edge."""
    _, _, pieces = small_world("hillside", 3)
    walls = [part for part in solids(pieces) if "TerraceWall" in part.name]
    tops = [part for part in solids(pieces) if "_Terrace_" in part.name]
    assert len(tops) == len(walls) > 12
    for top, wall in zip(tops, walls, strict=True):
        level = top.mesh.normals[:, 2] > 0.9
        corners = top.mesh.points[top.mesh.corners[level]]
        assert wall.mesh.points[:, 2].max() > corners[:, 2].max()
        assert wall.mesh.points[:, 2].min() < corners[:, 2].min() - 1.0


def _overlap(one: F64, other: F64) -> bool:
    """Whether two boxes overlap: no plane that is parallel to faces or edges of them lies between, shape (8, 3)."""
    edges = [np.stack([box[1] - box[0], box[2] - box[0], box[4] - box[0]]) for box in (one, other)]
    between = np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
    axes = np.concatenate([*edges, between[np.linalg.norm(between, axis=1) > 1e-9]])
    first, second = one @ axes.T, other @ axes.T
    return bool(((first.min(axis=0) <= second.max(axis=0)) & (second.min(axis=0) <= first.max(axis=0))).all())


@pytest.mark.parametrize("seed", range(3))
def test_a_crane_is_one_piece(seed: int) -> None:
    """Each of its boxes is joined to the legs through others: nothing stands or hangs in the air."""
    pieces = [mesh.points.reshape(-1, 8, 3) for _, mesh in crane(np.random.default_rng(seed))]
    boxes = list(np.concatenate(pieces))
    reached, front = {0}, [0]
    while front:
        one = boxes[front.pop()]
        found = [row for row, other in enumerate(boxes) if row not in reached and _overlap(one, other)]
        reached.update(found)
        front += found
    loose = [np.round(box.mean(axis=0), 1).tolist() for row, box in enumerate(boxes) if row not in reached]
    assert not loose


@pytest.mark.proof_only
@pytest.mark.parametrize("name", ["lakeside", "hillside"])
def test_a_seed_is_a_world(name: str) -> None:
    """A seed fixes the bytes; another seed makes another world."""
    one, other, again = small_world(name, 3)[2], small_world(name, 9)[2], make(name, OVER[name], 3, FEW)[2]
    for first, second in zip(one, again, strict=True):
        assert first.name == second.name
        if isinstance(first, Component) and isinstance(second, Component):
            assert first.mesh.points.tobytes() == second.mesh.points.tobytes()
            assert first.mesh.normals.tobytes() == second.mesh.normals.tobytes()
        elif isinstance(first, Scatter) and isinstance(second, Scatter):
            assert first.positions.tobytes() == second.positions.tobytes()
            assert first.yaw.tobytes() == second.yaw.tobytes()
    walls, others = (np.concatenate([run.positions for run in runs(side, "Walls")]) for side in (one, other))
    assert len(walls) != len(others) or np.abs(walls - others).max() > 10.0
