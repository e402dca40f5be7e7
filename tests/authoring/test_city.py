"""The city: joins the site without a gap, leaves it empty, keeps to its streets, and holds together."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.plan_curve import Element
from authoring.backgrounds.city import CitySettings, Town, build_city, draw_town
from authoring.backgrounds.facades import MIDDLE, NEAR, openings, sides_of, tower_faces
from authoring.backgrounds.pavements import KERB
from authoring.backgrounds.quads import boxes, placed, prism, quad_mesh, ring
from authoring.backgrounds.registry import BackgroundSettings, build_background
from authoring.backgrounds.site_lots import GROUP as LOTS
from authoring.backgrounds.street_furniture import furniture
from authoring.backgrounds.towers import Tower
from authoring.backgrounds.vehicles import vehicle_models
from authoring.looks.recipes import RECIPES
from authoring.shapes.component import (
    FIRST_BACKGROUND_ID,
    LAST_ID,
    Component,
    Mesh,
    Scatter,
    triangle_corners,
    triangles,
)
from authoring.site.crossing import CrossingKind
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from tests.authoring.world_parts import Pieces, along_border, runs, solids
from usd_schemas.components import class_of

F64 = NDArray[np.float64]
SMALL = CitySettings(town=230.0, trees=150, vehicles=120)
LAYOUTS = {
    "river": Layout(Alignment(7.0), (0.0, 18.0, 40.0), 11.5, 1.9),
    "road": Layout(Alignment(7.0, 0.015, 0.4, skew=0.3), (0.0, 18.0, 40.0), 11.5, 1.9, "road", 8.0, 3.4),
    "rail": Layout(Alignment(8.5, plan=(Element(50.0, 1 / 400.0, 1 / 400.0),)), (0.0, 25.0, 50.0), 11.5, 1.9),
}


@cache
def site_of(kind: CrossingKind, seed: int = 7) -> Site:
    """A site over one kind of crossing."""
    drawn = SiteSettings(crossing=kind, fine_spacing=1.2, coarse_spacing=3.0)
    return draw_site(drawn, LAYOUTS[kind], stream(seed, "site"))


@cache
def town_of(kind: CrossingKind, seed: int = 7) -> Town:
    """A small town round it."""
    return draw_town(SMALL, site_of(kind, seed), stream(seed, "background"))


@cache
def city_of(kind: CrossingKind, seed: int = 7) -> Pieces:
    """Its city."""
    return build_city(SMALL, site_of(kind, seed), stream(seed, "background"))


@pytest.fixture(params=["road", *(pytest.param(kind, marks=pytest.mark.proof_only) for kind in ("rail", "river"))])
def kind(request: pytest.FixtureRequest) -> CrossingKind:
    """What the bridge leads over."""
    return request.param


def vertices(run: Scatter) -> F64:
    """World positions of all vertices of a scatter, shape (N, 3)."""
    found = [np.zeros((0, 3))]
    for which in np.unique(run.prototype):
        rows = run.prototype == which
        local = np.concatenate([mesh.points for _, mesh in run.prototypes[which]]) * run.scales[rows][:, None]
        c, s = np.cos(run.yaw[rows])[:, None], np.sin(run.yaw[rows])[:, None]
        x, y, z = np.moveaxis(local, -1, 0)
        spots = np.stack([x * c - y * s, x * s + y * c, z], axis=-1) + run.positions[rows][:, None]
        found.append(spots.reshape(-1, 3))
    return np.concatenate(found)


def footprint(tower: Tower, grow: float = 0.0) -> F64:
    """Corners of a building in plan, shape (4, 2)."""
    (x, y), (c, s) = np.add(tower.half, grow), (np.cos(tower.heading), np.sin(tower.heading))
    local = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    return local @ np.array([[c, s], [-s, c]]) + np.array(tower.spot[:2])


def apart(one: F64, other: F64) -> bool:
    """Whether two rectangles are separated by one of their sides' directions."""
    for shape in (one, other):
        for side in np.diff(shape[:3], axis=0):
            a, b = one @ side, other @ side
            if a.max() <= b.min() + 1e-9 or b.max() <= a.min() + 1e-9:
                return True
    return False


@pytest.mark.parametrize("group", ["Ground", "Ways"])
def test_joint_shares_every_vertex(kind: CrossingKind, group: str) -> None:
    """Ground, roads, rails and water of site and city have the very same vertices along the border."""
    site = site_of(kind)
    ours, theirs = (
        along_border(site, [part for part in solids(side) if part.group == group and part.role in ROLES[group]])
        for side in (site.pieces, city_of(kind))
    )
    assert len(ours) > (400 if group == "Ground" else 8)
    assert ours == theirs


ROLES = {
    "Ground": ("gravel", "grass", "soil", "meadow", "asphalt", "ballast", "rock", "pavement", "masonry"),
    "Ways": ("asphalt", "water"),
}


def test_keep_out_is_empty(kind: CrossingKind) -> None:
    """No vertex of the city lies in the strip but those of car parks: the ways under the bridge and on it stay free."""
    site = site_of(kind)
    axis = site.land.layout.alignment
    for piece in city_of(kind):
        if piece.group == LOTS:  # tests/authoring/test_car_parks.py
            continue
        points = piece.mesh.points if isinstance(piece, Component) else vertices(piece)
        if axis.square:
            assert not site.keep_out[0].contains(points, margin=1e-6).any(), piece.name
        station, left = axis.locate(points)
        deep = np.minimum(station - site.field.stations[0], site.field.stations[-1] - station)
        deep = np.minimum(deep, np.minimum(left - site.field.lefts[0], site.field.lefts[-1] - left))
        # Half a sleeper lies over the joint; float32 vertices are a quarter of a millimeter apart at 2 km and beyond.
        assert deep.max() < (0.2 if "Sleepers" in piece.name else 1e-3), piece.name


def test_ground_has_no_gap_and_reaches_four_kilometers(kind: CrossingKind) -> None:
    """The plan areas of the ground's covers add up to the land less the site; every triangle faces up."""
    site = site_of(kind)
    corners, _ = triangle_corners(tuple(part for part in solids(city_of(kind)) if part.group == "Ground"))
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert flat[:, 2].min() > 0
    size = np.ptp(np.stack(site.land.layout.alignment.locate(corners.reshape(-1, 3))), axis=1)
    assert size.min() > 8000.0
    if site.land.layout.alignment.square:
        land = size[0] * size[1] - np.ptp(site.field.stations) * np.ptp(site.field.lefts)
        assert flat[:, 2].sum() / 2 == pytest.approx(land, rel=1e-3)


def test_buildings_overlap_neither_each_other_nor_streets(kind: CrossingKind) -> None:
    """Brute force over all pairs, and over all streets; and ways, site and slopes keep their distance."""
    town = town_of(kind)
    plan, shapes = town.plan, [footprint(tower) for tower in town.towers]
    assert len(shapes) > 30
    for number, one in enumerate(shapes):
        for other in shapes[:number]:
            assert apart(one, other)
    c, s = np.cos(plan.heading), np.sin(plan.heading)
    for shape in shapes:
        grid = (shape - plan.origin) @ np.array([[c, -s], [s, c]])
        for street in plan.streets:
            across = grid[:, 1 - street.axis] - street.middle
            assert across.min() > street.width / 2 or across.max() < -street.width / 2
        assert plan.land.room(shape).min() > 1.0


def test_ways_beyond_the_site_stay_free(kind: CrossingKind) -> None:
    """Nothing that stands lies on a through road, a railway or the river; quay railings stand on walls in the water."""
    site = site_of(kind)
    land, axis = site.land, site.land.layout.alignment
    for piece in city_of(kind):
        if isinstance(piece, Component) and piece.group not in ("Buildings", "Streets"):
            continue
        if piece.kind == "vehicle":
            continue
        points = piece.mesh.points if isinstance(piece, Component) else piece.positions
        station, left = axis.locate(points)
        assert (land.crossing.distance(station, left) > land.crossing.half_width - 0.5).all(), piece.name
        for approach in land.approaches:
            aside = np.abs(left - approach.center(station)) / approach.stretch(station)
            assert (aside[approach.along(station) > 0.0] > approach.half_width).all(), piece.name


def test_arms_of_lamps_reach_over_roads_and_promenades() -> None:
    """Lamps on quays turn their arms away from the water, those beside an approach road towards it."""
    site, town = site_of("river"), town_of("river")
    axis, crossing = site.land.layout.alignment, site.land.crossing
    (lamps,) = (run for run in furniture(town.plan, town.terrain, stream(7, "lamps")) if run.name == "City_Lamps")
    arms = lamps.positions + 2.0 * np.column_stack([np.cos(lamps.yaw), np.sin(lamps.yaw), np.zeros(len(lamps.yaw))])
    (station, left), (over, aside) = axis.locate(lamps.positions), axis.locate(arms)
    water = crossing.distance(station, left) - crossing.half_width
    quay = water < 2.0
    assert quay.sum() > 30
    np.testing.assert_allclose((crossing.distance(over, aside) - crossing.half_width - water)[quay], 2.0, atol=0.01)
    for approach in site.land.approaches:
        away, under = (
            np.abs(y - approach.center(x)) - approach.half_width for x, y in ((station, left), (over, aside))
        )
        beside = (approach.along(station) > 0.0) & (away < 3.5) & ~quay
        assert beside.sum() > 4
        assert (under - away)[beside].max() < -1.9


def test_windows_lie_in_walls() -> None:
    """Every window of every style lies within a wall of a tier, bays apart, between floor and roof, facing outwards."""
    towers = [tower for tower in town_of("river").towers if tower.away < NEAR]
    assert len({tower.style.name for tower in towers}) >= 3
    around = np.array([[-1e4, -1e4], [1e4, -1e4], [1e4, 1e4], [-1e4, 1e4]])
    for tower in towers:
        found = openings(tower, around)
        c, s = np.cos(tower.heading), np.sin(tower.heading)
        local = (found.places[:, :2] - tower.spot[:2]) @ np.array([[c, -s], [s, c]])
        high = found.places[:, 2] - tower.spot[2]
        hit = np.zeros(len(local), int)
        for tier in tower.tiers:
            for start, along, width, turn in sides_of(tier):
                right, depth = (local - start) @ along, (local - start) @ np.array([along[1], -along[0]])
                half = found.sizes / 2
                inside = (np.abs(depth) < 1e-6) & (right > half[:, 0]) & (right < width - half[:, 0])
                inside &= (high - half[:, 1] > tier.levels[0]) & (high + half[:, 1] < tier.levels[1])
                inside &= np.abs(np.angle(np.exp(1j * (found.yaw - tower.heading - turn)))) < 1e-9
                hit += inside
        assert (hit == 1).all()
        turned = np.array([[c, s], [-s, c]])
        before = openings(tower, tower.spot[:2] + np.array([[0.0, -200.0], [1.0, -200.0]]) @ turned)
        assert 0 < len(before.yaw) < len(found.yaw)  # from before the front no window of the back is visible
        assert np.abs(np.cos(before.yaw - tower.heading) + 1.0).min() > 0.5


def test_facades_have_depth() -> None:
    """Near facades stand out before their glass by what the style says; far ones are plain boxes of few faces."""
    tower = next(tower for tower in town_of("river").towers if tower.away < NEAR and tower.style.name == "piers")
    near, far = tower_faces(tower), tower_faces(replace(tower, away=MIDDLE + 1.0))
    reach = {role: np.ptp(np.concatenate(parts).reshape(-1, 3)[:, :2], axis=0).max() for role, parts in near.items()}
    assert reach[tower.wall] > reach["window"] + 2 * 0.5
    assert sum(len(part) for parts in far.values() for part in parts) <= 20 * len(tower.tiers)
    assert sum(len(part) for parts in near.values() for part in parts) > 200


def volume(mesh: Mesh) -> float:
    """The volume that faces enclose, positive when they face outwards."""
    corner = mesh.points[triangles(mesh)]
    return float(np.einsum("ti,ti->t", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum() / 6)


def test_solids_are_closed_with_outward_faces() -> None:
    """Boxes, bands and prisms enclose exactly their volume, however turned, with unit normals that fit their faces."""
    outline = np.array([[0.0, 0.0], [2.0, 0.0], [2.5, 1.0], [2.0, 2.0], [0.0, 2.0], [-0.5, 1.0]])
    shapes = (
        (boxes([1.0, 2.0, 3.0], [2.0, 4.0, 6.0]), 6.0),
        (
            ring(np.array([-2.0, 2.0, -3.0, 3.0]), np.array([-2.5, 2.5, -3.5, 3.5]), (1.0, 3.0), "oudi"),
            2 * (35.0 - 24.0),
        ),
        (prism(outline, -1.0, 2.0), 3.0 * 5.0),
    )
    for faces, expected in shapes:
        mesh = quad_mesh(placed(faces, (5.0, -2.0, 1.0), 0.7))
        assert volume(mesh) == pytest.approx(expected, rel=1e-3)
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)
        edges = np.stack([mesh.corners.reshape(-1, 4), np.roll(mesh.corners.reshape(-1, 4), -1, 1)], -1).reshape(-1, 2)
        assert {tuple(edge) for edge in edges.tolist()} == {tuple(edge[::-1]) for edge in edges.tolist()}


def test_vehicles_stand_on_their_wheels() -> None:
    """Every model touches the ground, has a believable size, paint, glass and tyres."""
    for name, model in vehicle_models():
        points = np.concatenate([mesh.points for _, mesh in model])
        length, width, height = np.ptp(points, axis=0)
        assert abs(points[:, 2].min()) < 0.03, name
        assert 4.2 < length < 12.6, name
        assert 1.6 < width < 2.7, name
        assert 1.3 < height < 3.6, name
        assert {role for role, _ in model} == {"paint_colours", "window", "rubber"}


def test_pieces_carry_known_kinds_recipes_and_ids(kind: CrossingKind) -> None:
    """Kinds are background, ids and names unique and in range, recipes known; what a city needs is there."""
    site, pieces = site_of(kind), city_of(kind)
    assert {class_of(piece.kind) for piece in pieces} == {"background"}
    wanted = {"building", "roof", "window", "vehicle", "lamp_post", "fence", "tree", "road", "ground", "traffic_sign"}
    assert {piece.kind for piece in pieces} >= (wanted if kind != "road" else wanted - {"fence"})
    ids = [part.instance_id for part in solids(pieces)] + [n for run in runs(pieces) for n in run.instance_ids]
    assert sorted(ids) == list(range(FIRST_BACKGROUND_ID, FIRST_BACKGROUND_ID + len(ids)))
    assert max(ids) <= LAST_ID
    names = [piece.name for piece in (*site.pieces, *pieces)]
    assert len(set(names)) == len(names)
    roles = {part.role for part in solids(pieces)}
    roles |= {role for run in runs(pieces) for prototype in run.prototypes for role, _ in prototype}
    assert roles <= set(RECIPES)
    for run in runs(pieces):
        assert len(run.instance_ids) in (1, len(run.positions))


def meshes(pieces: Pieces) -> Iterator[tuple[str, Mesh, int]]:
    """Every mesh with the number of times that it stands in the world."""
    for piece in pieces:
        if isinstance(piece, Component):
            yield piece.name, piece.mesh, 1
        else:
            counts = np.bincount(piece.prototype, minlength=len(piece.prototypes))
            for count, prototype in zip(counts, piece.prototypes, strict=True):
                for _, mesh in prototype:
                    yield piece.name, mesh, int(count)


def test_triangles_are_sound(kind: CrossingKind) -> None:
    """No degenerate triangle, and unit normals on the faces' own side."""
    for name, mesh, _ in meshes(city_of(kind)):
        corner = mesh.points[triangles(mesh)]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        assert np.linalg.norm(normal, axis=1).min() > 1e-7, name
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)


def test_a_square_kilometer_is_light() -> None:
    """The default city covers over 1 km2; with its site it keeps to 1.4 million triangles."""
    site = site_of("river")
    pieces = build_background("city", BackgroundSettings(), site, stream(7, "background"))
    paved = [part for part in solids(pieces) if "Pavement" in part.name]
    plan = np.concatenate([part.mesh.points[:, :2] for part in paved])
    assert np.prod(np.ptp(plan, axis=0)) > 1e6
    assert sum(count * len(triangles(mesh)) for _, mesh, count in meshes((*site.pieces, *pieces))) < 1_400_000


def test_vehicles_stand_on_the_ground() -> None:
    """Vehicles stand on the ground, on a lot a kerb above it, or on a through road."""
    town, pieces = town_of("river"), city_of("river")
    for run in runs(pieces):
        if run.kind == "vehicle":
            spots = run.positions
            station, left = town.terrain.land.layout.alignment.locate(spots)
            above = spots[:, 2] - town.terrain.height(station, left)
            assert above.min() > -0.12, run.name
            assert above.max() < KERB + 0.75, run.name


@pytest.mark.proof_only
def test_a_seed_is_a_city() -> None:
    """A seed fixes every byte; another one differs in streets and buildings."""
    again = build_city(SMALL, site_of("river"), stream(7, "background"))
    for one, other in zip(city_of("river"), again, strict=True):
        assert (one.name, one.kind) == (other.name, other.kind)
        if isinstance(one, Component) and isinstance(other, Component):
            assert one.mesh.points.tobytes() == other.mesh.points.tobytes()
            assert one.mesh.normals.tobytes() == other.mesh.normals.tobytes()
        elif isinstance(one, Scatter) and isinstance(other, Scatter):
            assert one.positions.tobytes() == other.positions.tobytes()
            assert one.prototype.tobytes() == other.prototype.tobytes()
    spots = [{tower.spot for tower in town_of("river", seed).towers} for seed in (7, 8)]
    assert not spots[0] & spots[1]
