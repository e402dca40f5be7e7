"""Car parks of a city: straight kerbs on plots of the site, bays with cars, a drive to a street, nothing else there."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.plan_curve import Element
from authoring.backgrounds.block_lots import block_lots
from authoring.backgrounds.car_parks import AISLE, BAY, DEEP, KERB_HIGH, Lot, bay_lines, bays, rows_of
from authoring.backgrounds.city import CitySettings, Town, draw_town
from authoring.backgrounds.kerbs import joined
from authoring.backgrounds.site_lots import GROUP, PAVED, build_lots, find_lots
from authoring.backgrounds.streets import Block, beside_ways
from authoring.backgrounds.traffic import traffic
from authoring.shapes.component import Component, Scatter, triangles
from authoring.site.crossing import CrossingKind
from authoring.site.fields import LandUse
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream

F64 = NDArray[np.float64]
Pieces = tuple[Component | Scatter, ...]
SMALL = CitySettings(town=230.0, reach=1200.0)
LAYOUTS = {
    "river": Layout(Alignment(7.0), (0.0, 18.0, 40.0), 11.5, 1.9),
    "road": Layout(Alignment(7.0, 0.015, 0.4, skew=0.3), (0.0, 18.0, 40.0), 11.5, 1.9, "road", 8.0, 3.4),
    "rail": Layout(Alignment(8.5, plan=(Element(50.0, 1 / 400.0, 1 / 400.0),)), (0.0, 25.0, 50.0), 11.5, 1.9),
}


@cache
def site_of(kind: CrossingKind) -> Site:
    """A site with fields over one kind of crossing."""
    return draw_site(SiteSettings(crossing=kind, land="fields"), LAYOUTS[kind], stream(7, "site"))


@cache
def town_of(kind: CrossingKind) -> Town:
    """A small town round it."""
    return draw_town(SMALL, site_of(kind), stream(7, "background"))


@cache
def on_site(kind: CrossingKind) -> dict[str, Component | Scatter]:
    """The pieces of its city that lie on the site, by their names."""
    site, town, rng = site_of(kind), town_of(kind), stream(7, "cars")
    lots = build_lots(find_lots(site), town.terrain, town.plan)
    cars = traffic(town.plan, town.terrain, (joined([]), lots.spots), 200, rng)
    parts = [Component(name, kind, role, group, mesh, 0) for name, kind, role, group, mesh in lots.pieces]
    return {piece.name.removeprefix("City_"): piece for piece in (*parts, *cars) if piece.group == GROUP}


def part(kind: CrossingKind, lot: int, name: str) -> F64:
    """Vertices of a part of a lot, shape (N, 3)."""
    piece = on_site(kind)[f"Lot_{lot}_{name}"]
    assert isinstance(piece, Component)
    return piece.mesh.points


def inside(piece: Component, step: float) -> F64:
    """Points spread over the triangles of a piece that face up, shape (N, 3)."""
    corner = piece.mesh.points[triangles(piece.mesh)]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    shares = np.array([(a, b, 1 - a - b) for a in np.arange(0, 1.01, step) for b in np.arange(0, 1.01 - a, step)])
    return (shares @ corner[normal[:, 2] > 0.5 * np.linalg.norm(normal, axis=1)]).reshape(-1, 3)


@cache
def lots_of(kind: CrossingKind) -> dict[int, Lot]:
    """The lots that were built, with their numbers."""
    return {
        number: lot for number, lot in enumerate(find_lots(site_of(kind))) if f"Lot_{number}_Drive" in on_site(kind)
    }


def entered_first(kind: CrossingKind, number: int, lot: Lot) -> bool:
    """Whether the drive of a lot meets it at the low end of its rows."""
    at = lot.local(part(kind, number, "Drive")[:, :2])
    return bool(at[np.abs(at[:, 1] - lot.size[1]).argmin(), 0] < 0.5 * lot.size[0])


@pytest.fixture(params=[pytest.param("river", marks=pytest.mark.proof_only), "road", "rail"])
def kind(request: pytest.FixtureRequest) -> CrossingKind:
    """What the bridge leads over."""
    return request.param


def test_a_site_with_fields_has_car_parks(kind: CrossingKind) -> None:
    """Each site has one or two, on quarters with a plot that is no lawn."""
    assert any(cover in PAVED for cover in site_of(kind).land.plots.covers)  # type: ignore[union-attr]
    assert 1 <= len(lots_of(kind)) <= 2


@pytest.mark.parametrize("land", ["fields", "town"])
def test_lots_lie_on_paved_plots_only(land: LandUse) -> None:
    """Every half meter of each lot lies on a plot whose cover becomes paved; no corner is on a lawn beside it."""
    found = 0
    for seed in range(5):
        settings = SiteSettings(crossing="road", land=land, fine_spacing=2.0, coarse_spacing=8.0)
        site = draw_site(settings, LAYOUTS["road"], stream(seed, "site"))
        plots, crossing = site.land.plots, site.land.crossing
        assert plots is not None
        for lot in find_lots(site):
            steps = (np.linspace(0.0, side, int(2.0 * side) + 1) for side in lot.size)
            places = lot.world(np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2))
            station, left = site.land.layout.alignment.locate(places)
            number = plots.number(station > crossing.center(left), station, left)
            assert {plots.covers[row] for row in np.unique(number)} <= set(PAVED)
            found += 1
    assert found > 4


def test_asphalt_lies_on_the_ground(kind: CrossingKind) -> None:
    """At points all over its triangles it is above the ground, by at most 14 cm; a kerb stands out by 30 cm at most."""
    site = site_of(kind)
    for number in lots_of(kind):
        asphalt = on_site(kind)[f"Lot_{number}_Asphalt"]
        assert isinstance(asphalt, Component)
        points = inside(asphalt, 0.2)
        above = points[:, 2] - site.ground(points[:, :2])
        assert above.min() > 0.02  # 4 cm at points 0.5 m apart; between them the ground bends by less than 2 cm
        assert above.max() < 0.14
        kerbs = part(kind, number, "Kerbs")
        assert (kerbs[:, 2] - site.ground(kerbs[:, :2])).max() < 0.30
        assert (kerbs[:, 2] - site.ground(kerbs[:, :2])).min() < -0.4  # no gap below it


def test_kerbs_are_straight(kind: CrossingKind) -> None:
    """All vertices of kerbs lie on the four sides of a rectangle, or a kerb's width outside, and none in the entry."""
    for number, lot in lots_of(kind).items():
        x, y = lot.local(part(kind, number, "Kerbs")[:, :2]).T
        sides = np.abs(np.stack([x, x - lot.size[0], y, y - lot.size[1]]))
        assert np.minimum(sides, np.abs(sides - 0.15)).min(axis=0).max() < 1e-3  # faces are rounded to 0.1 mm
        asphalt = lot.local(part(kind, number, "Asphalt")[:, :2])
        np.testing.assert_allclose([asphalt.min(axis=0), asphalt.max(axis=0)], [(0.0, 0.0), lot.size], atol=1e-3)


def test_lots_leave_the_bridge_and_the_ways(kind: CrossingKind) -> None:
    """Lots lie 8 m from the deck, 7 m from road, river or railway; drives leave the ways and reach a street."""
    site = site_of(kind)
    land = site.land
    town = town_of(kind)
    for number in lots_of(kind):
        station, left = land.layout.alignment.locate(part(kind, number, "Kerbs"))
        assert np.abs(left).min() > land.layout.width / 2 + 8.0
        assert (land.crossing.distance(station, left) - land.crossing.half_width).min() > 7.0
        drive = part(kind, number, "Drive")
        station, left = land.layout.alignment.locate(drive)
        assert beside_ways(town.terrain, station, left).min() > -0.5
        assert np.abs(left).max() > np.abs(site.field.lefts).max() + 10.0
        out = drive[np.abs(left) > np.abs(left).max() - 2.0, :2]
        grid = (out - town.plan.origin) @ np.array(
            [
                [np.cos(town.plan.heading), -np.sin(town.plan.heading)],
                [np.sin(town.plan.heading), np.cos(town.plan.heading)],
            ]
        )
        off = [
            np.abs(grid[:, 1 - street.axis] - street.middle).max() - street.width / 2 for street in town.plan.streets
        ]
        assert min(off) < 0.0


def test_cars_stand_in_bays(kind: CrossingKind) -> None:
    """Each car on the site stands within a bay of its own, along it, on the asphalt."""
    cars = on_site(kind)["Visiting"]
    assert isinstance(cars, Scatter)
    lots = {number: replace(lot, first=entered_first(kind, number, lot)) for number, lot in lots_of(kind).items()}
    used = set()
    for place, yaw in zip(cars.positions, cars.yaw, strict=True):
        for number, lot in lots.items():
            found = bays(lot)
            off = np.abs(lot.local(place[None, :2]) - found[:, :2]).max(axis=1)
            if off.min() < 0.01:
                used.add((number, int(off.argmin())))
                assert abs(np.sin(yaw - lot.heading)) > 0.99
    assert len(used) == len(cars.positions) > 12
    layout = site_of(kind).land.layout
    _, left = layout.alignment.locate(cars.positions)
    assert np.abs(left).min() > layout.width / 2 + 16.0  # where drones fly low, there are none
    assert np.abs(cars.positions[:, 2] - site_of(kind).ground(cars.positions[:, :2]) - 0.06).max() < 0.08


@pytest.mark.parametrize("size", [(30.0, 12.0), (41.0, 17.0), (60.0, 32.6), (76.0, 55.0)])
@pytest.mark.parametrize("first", [True, False])
def test_bays_and_aisles_share_the_room(size: tuple[float, float], first: bool) -> None:
    """Bays lie within the lot, apart from each other and the entry; in front of each is an aisle; lines bound each."""
    lot = Lot((3.0, -2.0), 0.7, size, first)
    found, lines = bays(lot), bay_lines(lot)
    low, high = found[:, :2] - (BAY / 2, DEEP / 2), found[:, :2] + (BAY / 2, DEEP / 2)
    assert len(found) >= 8
    assert low.min() > -1e-9
    assert (high.max(axis=0) < np.array(size) + 1e-9).all()
    over = (np.minimum(high[:, None], high) - np.maximum(low[:, None], low)).min(axis=2)
    assert over[~np.eye(len(found), dtype=bool)].max() < 1e-9
    assert (np.minimum(high[:, 0], lot.entry[1]) - np.maximum(low[:, 0], lot.entry[0])).max() < 1e-9
    front = found[:, 1] - found[:, 2] * (DEEP / 2 + AISLE / 2)  # cars head away from the aisle
    assert front.min() > AISLE / 2 - 1e-9
    assert front.max() < size[1] - AISLE / 2 + 1e-9
    assert (np.abs(front[:, None] - found[:, 1]) > (AISLE + DEEP) / 2 - 1e-9).all()
    for x, y, _ in found:
        for edge in (x - BAY / 2, x + BAY / 2):
            beside = lines[(np.abs(lines[:, 0] - edge) < 1e-9) & (np.abs(lines[:, 1] - y) < DEEP / 2)]
            assert beside[:, 3].sum() * 2 == pytest.approx(DEEP)
    assert len(rows_of(10.9)) == 0
    assert KERB_HIGH < 0.15
    np.testing.assert_allclose(lot.local(lot.world(found[:, :2])), found[:, :2], atol=1e-12)


def test_nothing_stands_on_a_drive() -> None:
    """Of trees along two drives and beside them, those on a drive are taken away, with their ids, and no others."""
    site, town = site_of("rail"), town_of("rail")
    lots = build_lots(find_lots(site), town.terrain, town.plan)
    places = np.concatenate(
        [lots.drives[::7] + offset for offset in np.random.default_rng(3).uniform(-9.0, 9.0, (8, 1, 2))]
    )
    count = len(places)
    upright = np.column_stack([places, np.zeros(count)])
    run = Scatter(
        "T",
        "tree",
        "G",
        ((),),
        np.arange(count, dtype=np.int32),
        upright,
        np.zeros(count),
        np.ones((count, 3)),
        tuple(range(count)),
    )
    left = lots.clear(run)
    assert left is not None
    apart = np.linalg.norm(places[:, None] - lots.drives[None], axis=2).min(axis=1)
    np.testing.assert_array_equal(left.prototype, np.flatnonzero(apart > 3.7))
    assert 0 < len(left.instance_ids) == len(left.positions) < count


def test_an_entry_over_the_pavement_faces_outwards() -> None:
    """The sides of the ramp from the street face away from its middle, its top faces up."""
    plan = town_of("road").plan
    blocks = [Block((u, v), (u + 40.0, v + 34.0)) for u in (60.0, 120.0) for v in (60.0, 120.0)]
    entries = [mesh for name, *_, mesh in block_lots(plan, blocks) if name.startswith("ParkingEntry")]
    assert entries
    for mesh in entries:
        corner = mesh.points[triangles(mesh)]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        up = normal[:, 2] > 0.5 * np.linalg.norm(normal, axis=1)
        assert up.sum() == 4
        outwards = np.einsum("fk,fk->f", normal, corner.mean(axis=1) - mesh.points.mean(axis=0))
        assert (outwards[~up] > 0).all()
