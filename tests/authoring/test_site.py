"""The site: one watertight ground that roads, water, fills and plants agree with."""

import hashlib

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.shapes.component import (
    FIRST_BACKGROUND_ID,
    FIRST_SITE_ID,
    Component,
    Scatter,
    triangle_corners,
    triangles,
)
from authoring.site.photo import surface_of
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from groundwork.errors import InputError
from tests.authoring.world_parts import open_edges
from usd_schemas.components import class_of

F64 = NDArray[np.float64]
RECIPES = {"grass", "meadow", "soil", "gravel", "rock", "asphalt", "road_marking", "water", "foliage", "leaves"}
RECIPES |= {"furrows", "crop", "ripe_crop", "hay", "pavement", "timber", "galvanised_steel"}
LAYOUTS = {
    "river": Layout(Alignment(7.0), (0.0, 18.0, 40.0), 11.5, 1.9),
    "road": Layout(Alignment(7.0, 0.015, 0.4), (0.0, 18.0, 40.0), 11.5, 1.9, "road", 8.0, 3.4),
}


@pytest.fixture(scope="module", params=sorted(LAYOUTS))
def site(request: pytest.FixtureRequest) -> Site:
    """A site with a river on a level axis, and one with a road on a turned and rising axis."""
    return draw_site(SiteSettings(crossing=request.param), LAYOUTS[request.param], stream(7, "site"))


def ground_parts(site: Site) -> tuple[Component, ...]:
    """The components that make up the ground."""
    return tuple(piece for piece in site.pieces if isinstance(piece, Component) and piece.group == "Ground")


def named(site: Site, name: str) -> Component:
    """The component of one name."""
    return next(piece for piece in site.pieces if isinstance(piece, Component) and piece.name == name)


def inside_strip(site: Site, count: int, seed: int) -> tuple[F64, F64, F64]:
    """Random stations, lefts and plan positions on the strip."""
    rng = np.random.default_rng(seed)
    station = rng.uniform(site.field.stations[0], site.field.stations[-1], count)
    left = rng.uniform(site.field.lefts[0], site.field.lefts[-1], count)
    return station, left, site.land.layout.alignment.point(station, left, np.zeros(count))[:, :2]


def heights_under(corners: F64, xy: F64) -> list[F64]:
    """Heights of all triangles over each plan position, by brute force."""
    a, b, c = (corners[:, i, :2] for i in range(3))
    area = np.cross(b - a, c - a)
    found = []
    for p in xy:
        v, w = np.cross(p - a, c - a) / area, np.cross(b - a, p - a) / area
        hit = (v >= -1e-9) & (w >= -1e-9) & (v + w <= 1 + 1e-9)
        z = corners[hit, :, 2]
        found.append(z[:, 0] + v[hit] * (z[:, 1] - z[:, 0]) + w[hit] * (z[:, 2] - z[:, 0]))
    return found


@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors")
def test_ground_function_is_the_mesh(site: Site) -> None:
    """Every place lies under exactly one triangle of the covers, at the height that `ground` says."""
    corners, _ = triangle_corners(ground_parts(site))
    _, _, xy = inside_strip(site, 400, 1)
    found = heights_under(corners, xy)
    assert [len(heights) for heights in found] == [1] * len(xy)
    np.testing.assert_allclose([heights[0] for heights in found], site.ground(xy), atol=1e-9)


def test_ground_is_fine_near_the_bridge(site: Site) -> None:
    """Within 15 m of the bridge's outline no two grid lines are farther apart than 0.75 m."""
    stations, lefts, half = site.field.stations, site.field.lefts, site.land.layout.width / 2
    near = (stations[1:] > -15.0) & (stations[:-1] < 55.0)
    beside = (np.maximum(np.abs(lefts[1:]), np.abs(lefts[:-1])) - half) < 15.0
    assert np.diff(stations)[near].max() <= 0.75
    assert np.diff(lefts)[beside].max() <= 0.75
    assert (stations[0], stations[-1]) == pytest.approx((-61.2, 101.2))
    assert (lefts[0], lefts[-1]) == (-80.0, 80.0)


def test_triangles_are_sound(site: Site) -> None:
    """No triangle is degenerate, normals are unit vectors on the face's side, the atlas fills 0 to 1."""
    for piece in site.pieces:
        meshes = [piece.mesh] if isinstance(piece, Component) else [m for p in piece.prototypes for _, m in p]
        for mesh in meshes:
            corner = mesh.points[triangles(mesh)]
            normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            assert np.linalg.norm(normal, axis=1).min() > 1e-7, piece.name
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)
            assert len(mesh.st) == len(mesh.normals) == len(mesh.corners) == mesh.face_counts.sum()
    for part in ground_parts(site):
        corner = part.mesh.points[triangles(part.mesh)]
        assert np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2].min() > 0
        assert part.mesh.normals[:, 2].min() > 0
    atlas = np.concatenate([part.mesh.st1 for part in ground_parts(site)])
    np.testing.assert_allclose([atlas.min(axis=0), atlas.max(axis=0)], [[0, 0], [1, 1]], atol=1e-6)


@pytest.mark.parametrize("end", [0, 1])
def test_fill_meets_the_road_behind_and_the_land_in_front(site: Site, end: int) -> None:
    """Behind the back face the fill lies just under the deck's level; the wall's front stands free below its seat."""
    layout = site.land.layout
    axis, sign = layout.alignment, (-1.0, 1.0)[end]
    bearing = layout.supports[-end]
    across = np.linspace(-3.9, 3.9, 40)
    for behind in (0.0, 0.5, 3.0, 8.0):
        station = np.full(40, bearing + sign * (ABUTMENT_BACK + behind))
        below = axis.point(station, across, np.zeros(40))[:, 2] - site.ground(
            axis.point(station, across, across)[:, :2]
        )
        assert below.min() > 0.05
        assert below.max() < 0.30
    whole = np.linspace(-layout.width / 2, layout.width / 2, 60)
    for front in (0.7, 1.5, 3.0):
        foot = axis.point(np.full(60, bearing - sign * front), whole, np.full(60, -layout.depth))
        assert (foot[:, 2] - site.ground(foot[:, :2])).min() > 1.5
    station = np.linspace(8.0, 50.0, 30) * sign + bearing
    for side in (-1.0, 1.0):
        outer = np.full(30, side * (layout.width / 2 + 4.0))
        inner = np.full(30, side * (layout.width / 2 + 1.0))
        drop = np.diff([site.ground(axis.point(station, left, left)[:, :2]) for left in (outer, inner)], axis=0)
        assert drop.max() == pytest.approx(3.0 / 1.75, abs=0.1)


def test_roads_lie_on_the_ground(site: Site) -> None:
    """Road surfaces lie 5 to 30 cm over the ground and start at the deck's level."""
    layout = site.land.layout
    for piece in site.pieces:
        if isinstance(piece, Component) and piece.role == "asphalt":
            corner = piece.mesh.points[triangles(piece.mesh)]
            up = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] > 1e-6
            share = np.random.default_rng(2).dirichlet((1, 1, 1), (up.sum(), 8))
            places = np.einsum("tki,tij->tkj", share, corner[up]).reshape(-1, 3)
            above = places[:, 2] - site.ground(places[:, :2])
            assert above.min() > 0.049, piece.name
            assert above.max() < 0.30, piece.name
    road = named(site, "Site_ApproachRoad_0").mesh.points
    assert road[:, 2].max() == pytest.approx(layout.alignment.level - layout.alignment.grade * ABUTMENT_BACK, abs=1e-9)


def test_crossing_passes_under_the_longest_span(site: Site) -> None:
    """Water or road stays between the supports under the deck, far enough below the girders."""
    layout, crossing = site.land.layout, site.land.crossing
    left = np.linspace(-layout.width / 2, layout.width / 2, 21)
    reach = crossing.half_width * crossing.stretch(left)
    assert (crossing.center(left) - reach).min() > 18.0 + 1.5
    assert (crossing.center(left) + reach).max() < 40.0 - 1.5
    seat = layout.alignment.level + layout.alignment.grade * 29.0 - layout.depth
    assert seat - crossing.level > 4.5
    if crossing.kind == "river":
        water = named(site, "Site_Water").mesh
        assert np.ptp(water.points[:, 2]) == 0.0
        station, across = layout.alignment.locate(water.points)
        rim = crossing.distance(station, across) > crossing.half_width + 1.0
        assert (site.ground(water.points[rim, :2]) - crossing.level).min() > 0.25
        middle = np.linspace(-79.0, 79.0, 300)
        wet = layout.alignment.point(crossing.center(middle), middle, middle)
        assert site.ground(wet[:, :2]).max() < crossing.level - 0.3


def test_plants_keep_clear(site: Site) -> None:
    """Nothing is strewn on roads, in the water or under the bridge; all of it stands on the ground."""
    layout, crossing = site.land.layout, site.land.crossing
    runs = [piece for piece in site.pieces if isinstance(piece, Scatter)]
    assert {"Site_Stones", "Site_Shrubs", "Site_Tufts"} <= {run.name for run in runs}
    for run in runs:
        station, left = layout.alignment.locate(run.positions)
        assert (crossing.distance(station, left) > crossing.half_width).all()
        under = (station > -ABUTMENT_BACK) & (station < 40.0 + ABUTMENT_BACK) & (np.abs(left) < layout.width / 2)
        assert not under.any()
        approach = ((station < -ABUTMENT_BACK) | (station > 40.0 + ABUTMENT_BACK)) & (np.abs(left) < 4.0)
        assert not approach.any()
        np.testing.assert_allclose(run.positions[:, 2], site.ground(run.positions[:, :2]), atol=1e-9)
        near = np.abs(left) < 30.0
        assert near.sum() > 0.45 * len(left) or run.name in ("Site_Reeds", "Site_Hedges")


def test_pieces_carry_known_names_and_ids(site: Site) -> None:
    """Kinds are in the component table, recipes in the agreed list, names and ids unique."""
    components = [piece for piece in site.pieces if isinstance(piece, Component)]
    runs = [piece for piece in site.pieces if isinstance(piece, Scatter)]
    assert {class_of(piece.kind) for piece in site.pieces} == {"background"}
    roles = {piece.role for piece in components} | {role for run in runs for p in run.prototypes for role, _ in p}
    assert {surface_of(role)[0] for role in roles} <= RECIPES
    ids = [piece.instance_id for piece in components] + [number for run in runs for number in run.instance_ids]
    assert sorted(ids) == list(range(FIRST_SITE_ID, FIRST_SITE_ID + len(site.pieces)))
    assert ids[-1] < FIRST_BACKGROUND_ID
    assert len({piece.name for piece in site.pieces}) == len(site.pieces)


def test_extent_edge_and_keep_out_agree(site: Site) -> None:
    """The border nodes run round the outline on the ground, and the keep-out box holds the strip and the air above."""
    shoelace = np.cross(np.c_[site.extent, [0] * 4], np.c_[np.roll(site.extent, -1, axis=0), [0] * 4])[:, 2].sum() / 2
    assert shoelace == pytest.approx(160.0 * 162.4)
    np.testing.assert_allclose(site.edge[:, 2], site.ground(site.edge[:, :2]), atol=1e-9)
    steps = np.linalg.norm(np.roll(site.edge, -1, axis=0) - site.edge, axis=1)
    assert steps.min() > 0.0
    assert steps.max() < 4.0
    _, _, xy = inside_strip(site, 50, 4)
    (box,) = site.keep_out
    assert box.contains(np.c_[xy, site.ground(xy)]).all()
    assert box.contains(np.c_[xy, np.full(50, 100.0)]).all()
    assert not box.contains(np.c_[3.0 * site.extent, [0.0] * 4]).any()


def fingerprint(pieces: tuple[Component | Scatter, ...]) -> str:
    """Hash every array and name of some pieces."""
    digest = hashlib.sha256()
    for piece in pieces:
        meshes = [piece.mesh] if isinstance(piece, Component) else [m for p in piece.prototypes for _, m in p]
        arrays = [array for mesh in meshes for array in (mesh.points, mesh.corners, mesh.normals, mesh.st, mesh.st1)]
        if isinstance(piece, Scatter):
            arrays += [piece.positions, piece.yaw, piece.scales, piece.prototype]
        digest.update(piece.name.encode())
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def test_a_seed_is_a_site() -> None:
    """The same seed gives the same bytes, another seed other ones."""
    draws = [draw_site(SiteSettings(), LAYOUTS["river"], stream(seed, "site")) for seed in (3, 3, 4)]
    first, again, other = (fingerprint(site.pieces) for site in draws)
    assert first == again != other


def test_a_road_needs_a_span() -> None:
    """A span too short for the crossing road is named in one line."""
    with pytest.raises(InputError, match=r"site\.crossing: no room"):
        draw_site(SiteSettings(crossing="road"), Layout(Alignment(5.0), (0.0, 6.0), 8.0, 1.0), stream(1, "site"))


def test_ground_is_closed(site: Site) -> None:
    """Every edge inside the strip belongs to two triangles: no cover's border ends on an edge of another cover."""
    rim = open_edges(ground_parts(site))
    station, left = site.land.layout.alignment.locate(rim)
    field = site.field
    away = [station - field.stations[0], field.stations[-1] - station, left - field.lefts[0], field.lefts[-1] - left]
    assert len(rim) > 100
    assert np.min(away, axis=0).max() < 1e-6
