"""The background `hillside`: houses on terraces above blocks, a harbour and the sea in front, mountains behind."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from authoring.backgrounds.boats import ferry, freighter, motor_boat
from authoring.backgrounds.byways import lane_byways, road_byways
from authoring.backgrounds.drives import Drive, draw_drives, drive_circles, drive_gates, drive_pieces
from authoring.backgrounds.dwellings import Style, draw_designs, dwelling_runs, halves
from authoring.backgrounds.harbour import container_stacks, crane, draw_sheds
from authoring.backgrounds.hillside_land import BUILT, FOOT, QUAY, draw_sea, hillside_hills
from authoring.backgrounds.lanes import Lane, along_lanes, draw_lanes, lane_pieces, lane_room, street_gap
from authoring.backgrounds.lowland import valley_fields
from authoring.backgrounds.plots import Candidates, Plots, chosen, downhill, joined, place_plots
from authoring.backgrounds.roadside import plant_hedges, plant_poles
from authoring.backgrounds.shore_quay import quay_pieces, quay_places, quay_reaches, quay_runs
from authoring.backgrounds.shore_town import Town, Waterside, anchored, beside_roads, land_room, street_cars
from authoring.backgrounds.slope_plants import Woods, draw_stands, green_runs, mountain_covers
from authoring.backgrounds.terrain import Terrain, grow_terrain
from authoring.backgrounds.waters import Basin, level_shore, shore_pieces, ways_to_water
from authoring.backgrounds.woods import LIME, OAK, SPRUCE
from authoring.shapes.component import FIRST_BACKGROUND_ID, Component, Scatter
from authoring.site.covers import Cover, to_world
from authoring.site.relief import Relief, draw_relief
from authoring.site.roads import Piece
from authoring.site.site import Site
from groundwork.settings import Settings

F64 = NDArray[np.float64]
PREFIX = "Hillside"
WIDEST = 66.0  # largest spacing of the terrain's grid lines [m]
HEDGES = 140  # most bushes between fields [1]
CLOSE = 50.0  # distance from the site within which buildings stand in detail [m]
STREETS = (112.0, 168.0)  # distances of the streets on the lower land from the axis [m]
PITCH = 33.0  # from a lane to the next one above [m]
TERRACE = 6.6  # half the depth of a terrace [m]
_PLASTERS = ("plaster", "plaster_white", "plaster_ochre", "plaster_rose", "plaster_white")
WARM = Style((8.5, 12.5), (7.0, 10.0), (2, 3), ("hip", "gable", "gable"), _PLASTERS, 0.4, 0.5, wings=0.75)
HOUSE = Style(
    (8.5, 12.5),
    (7.0, 10.0),
    (2, 3),
    ("hip", "gable", "gable", "flat"),
    ("plaster_white", "plaster", "plaster_white", "brick_buff"),
    0.5,
    0.3,
    "roof_grey",
    wings=0.75,
)
BLOCK = Style(
    (16.0, 30.0),
    (11.0, 15.0),
    (4, 9),
    ("flat", "flat", "hip"),
    ("plaster_white", "plaster", "plaster_ochre", "brick_buff", "concrete"),
    0.75,
    0.2,
    wings=0.5,
    towers=0.6,
)
SHEDS, BLOCKS, HOUSES, WARMER = 5, 10, 22, 13  # designs of each; of the houses, those in warm colors
YARD = Cover("yard", "Yard", "ground", "asphalt")
TOWN = Cover("town", "Town", "ground", "gravel")


class HillsideSettings(Settings):
    """Appearance of the hillside."""

    reach: float = Field(
        default=4200.0, ge=2500.0, le=6000.0, description="Distance that the terrain reaches beyond the site [m]"
    )
    mountains: float = Field(default=520.0, ge=150.0, le=1200.0, description="Typical height of the mountains [m]")
    grade: float | None = Field(
        default=None, ge=0.08, le=0.25, description="Slope of the terraces; left out: drawn [1]"
    )
    houses: int = Field(
        default=620, ge=0, le=2500, description="Number of houses on the terraces; fewer where there is no room [1]"
    )
    blocks: int = Field(
        default=70,
        ge=0,
        le=300,
        description="Number of blocks of flats on the lower land; fewer where there is no room [1]",
    )
    sheds: int = Field(
        default=24, ge=0, le=80, description="Number of sheds in the harbour; fewer where there is no room [1]"
    )
    cranes: int = Field(
        default=7, ge=0, le=30, description="Number of cranes on the quay; fewer where there is no room [1]"
    )
    trees: int = Field(default=2600, ge=0, le=30000, description="Number of trees; fewer where there is no room [1]")


def build_hillside(settings: HillsideSettings, site: Site, rng: np.random.Generator) -> tuple[Component | Scatter, ...]:
    """Build a hillside round a site.

    Args:
        settings: What it looks like.
        site: The site; its strip stays empty.
        rng: Random stream `background`.

    Returns:
        Components and scatters, ids from `FIRST_BACKGROUND_ID`.
    """
    own = site.field
    inner = (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
    sea = draw_sea(site.land, inner, rng)
    drawn = float(rng.uniform(0.11, 0.22))
    shape = (drawn if settings.grade is None else settings.grade, settings.mountains)
    terrain = level_shore(
        grow_terrain(site, hillside_hills(site.land, inner, sea, shape, rng), settings.reach, WIDEST), sea
    )
    reaches = quay_reaches(terrain, QUAY - 60.0 + (inner[1] - inner[0]) / 2)
    lanes, terraces = _terraces(terrain, sea, rng)
    streets = draw_lanes(terrain, sea.side, STREETS, 560.0, 3.4, rng, gap=street_gap(terrain))
    designs = (
        *draw_sheds(SHEDS, rng),
        *draw_designs(BLOCK, BLOCKS, rng),
        *draw_designs(HOUSE, HOUSES - WARMER, rng),
        *draw_designs(WARM, WARMER, rng),
    )
    place = Waterside(terrain, sea, reaches, PREFIX)
    plots = _plots(place, (*lanes, *streets), terraces, settings, halves(designs), rng)
    ways, quays = ways_to_water(terrain, sea), quay_pieces(terrain, sea, reaches)
    drives, plots = _drives(
        terrain, [*ways, *((*piece[:3], piece[4]) for piece in quays)], (lanes, streets, terraces), plots
    )
    town = Town(designs, plots, (*lanes, *streets), terraces, drive_circles(terrain, drives))
    woods = Woods(
        draw_stands(rng), (BUILT - 60.0, BUILT + 140.0), (OAK, LIME, SPRUCE), 480.0, 0.0, 165.0, settings.trees
    )
    parcels, crops = valley_fields(terrain, sea, town.taken(), (*lanes, *terraces, *streets), rng)
    covers = (
        *mountain_covers(terrain, sea, plots, woods, rng),
        *_town_covers(terrain, sea, draw_relief(((34.0, 1.0), (13.0, 0.6)), rng)),
        *crops,
    )
    pieces = (
        shore_pieces(terrain, sea, covers) + quays + lane_pieces(terrain, lanes, gates=drive_gates(terrain, drives))
    )
    pieces += lane_pieces(terrain, terraces, ("Terrace", "ground", "grass"), "concrete")
    pieces += lane_pieces(terrain, streets, ("Street", "road", "asphalt"), None)
    pieces += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in ways]
    pieces += drive_pieces(terrain, drives, rng)
    components = [
        Component(f"{PREFIX}_{prim}", kind, role, group, mesh, FIRST_BACKGROUND_ID + number)
        for number, (prim, kind, role, group, mesh) in enumerate(pieces)
    ]
    first_id = FIRST_BACKGROUND_ID + len(components)
    runs = _repeats(place, town, woods, settings, rng, first_id)
    first_id += sum(len(run.instance_ids) for run in runs)
    hedges = plant_hedges(terrain, parcels, town.taken(), HEDGES, rng, first_id)
    return (*components, *runs, *(replace(run, name=f"{PREFIX}_FieldHedges") for run in hedges))


def _drives(
    terrain: Terrain, ways: list[Piece], lanes: tuple[tuple[Lane, ...], ...], plots: Plots
) -> tuple[tuple[Drive, ...], Plots]:
    """Lead drives to the blocks from roads, lanes and streets, not over terraces; leave out blocks without one."""
    slope, streets, terraces = (lane_byways(terrain, some, False) for some in lanes)
    byways = [*road_byways(terrain, ways, 0.0), *slope, *streets]
    blocks = (plots.which >= SHEDS) & (plots.which < SHEDS + BLOCKS)
    drives, reached = draw_drives(terrain, byways, plots, blocks, terraces)
    return drives, chosen(plots, reached)


def _repeats(
    place: Waterside,
    town: Town,
    woods: Woods,
    settings: HillsideSettings,
    rng: np.random.Generator,
    first_id: int,
) -> list[Scatter]:
    """Repeat buildings, objects in the harbor, vehicles and plants."""
    terrain, sea, reaches = place.terrain, place.basin, place.reaches
    runs: list[Scatter] = []

    def ahead() -> int:
        return first_id + sum(len(run.instance_ids) for run in runs)

    runs += dwelling_runs(terrain, PREFIX, town.designs, town.plots, CLOSE, ahead())
    runs += [run for run in quay_runs(terrain, sea, reaches, PREFIX, ahead()) if "Jetties" not in run.name]
    runs += _harbour(place, town.plots, settings.cranes, rng, ahead())
    runs += _ships(place, rng, ahead())
    runs += street_cars(place, town.lanes, rng, ahead())
    promenade = quay_places(terrain, sea, reaches, 10.5, 30.0)[:0]
    runs += green_runs(place, town, woods, promenade, rng, ahead())
    runs += [replace(run, name=f"{PREFIX}_Poles") for run in plant_poles(terrain, ahead(), rng, town.drives)]
    return runs


def _terraces(terrain: Terrain, sea: Basin, rng: np.random.Generator) -> tuple[tuple[Lane, ...], tuple[Lane, ...]]:
    """Divide the slope into alternating lanes and terraces for houses."""
    ups = np.arange(FOOT + 30.0, BUILT - 40.0, PITCH)
    lanes: list[Lane] = []
    terraces: list[Lane] = []
    for up in ups:
        state = int(rng.integers(0, 2**32))  # lane and terrace have the same curves
        reach = float(rng.uniform(430.0, 640.0))
        lanes += draw_lanes(terrain, -sea.side, (float(up),), reach, 2.3, np.random.default_rng(state))
        above = (float(up) + 2.9 + TERRACE + 0.6,)
        terraces += draw_lanes(terrain, -sea.side, above, reach, TERRACE, np.random.default_rng(state))
    return tuple(lanes), tuple(terraces)


def _plots(
    place: Waterside,
    lanes: tuple[Lane, ...],
    terraces: tuple[Lane, ...],
    settings: HillsideSettings,
    half: F64,
    rng: np.random.Generator,
) -> Plots:
    """Choose places: sheds behind the quay, blocks on lower land, by roads and below the slope, houses on terraces."""
    terrain, sea = place.terrain, place.basin
    middle = (terrain.inner[0] + terrain.inner[1]) / 2
    front = np.pi if sea.side > 0 else 0.0
    rows = []
    for back in (84.0, 116.0):
        at = np.arange(middle - QUAY, middle + QUAY, 9.0)
        left = sea.side * (sea.near(at) - back)
        rows.append(
            np.column_stack([at, left, np.full(len(at), front), rng.integers(0, SHEDS, len(at)).astype(np.float64)])
        )
    wanted = rng.permutation(np.concatenate(rows))
    sheds = place_plots(terrain, Candidates(wanted, half, land_room(terrain, sea, wanted)), settings.sheds, gap=9.0)
    roads = beside_roads(terrain, (27.0, 60.0), rng)
    spots = np.concatenate([street + np.array([-14.5, 14.5]) for street in STREETS])
    low = np.column_stack([middle + rng.uniform(-540.0, 540.0, 900), sea.side * rng.choice(spots, 900)])
    foot = np.column_stack([middle + rng.uniform(-560.0, 560.0, 700), -sea.side * rng.uniform(92.0, 128.0, 700)])
    places = rng.permutation(np.concatenate([roads, low, foot]))
    turn = rng.choice((0.0, np.pi), len(places))
    wanted = np.column_stack([places, turn, rng.integers(SHEDS, SHEDS + BLOCKS, len(places)).astype(np.float64)])
    room = np.minimum(land_room(terrain, sea, wanted), lane_room((*lanes, *terraces), *places.T) + 6.0)
    blocks = place_plots(terrain, Candidates(wanted, half, room), settings.blocks, gap=7.0, standing=sheds)
    return joined((sheds, blocks, _houses(terrain, sea, terraces, settings.houses, half, rng)))


def _houses(
    terrain: Terrain, sea: Basin, terraces: tuple[Lane, ...], count: int, half: F64, rng: np.random.Generator
) -> Plots:
    """Choose places for houses on terraces, side by side, their fronts down the slope."""
    spots = along_lanes(terraces, np.array([0.0]), 3.0, rng)
    spots = rng.permutation(spots)
    down, _ = downhill(terrain, spots[:, 0], spots[:, 1], 20.0)
    square = np.where(sea.side > 0, np.pi / 2, -np.pi / 2)
    aside = np.clip((down - square + np.pi) % (2 * np.pi) - np.pi, -0.12, 0.12)
    design = rng.integers(SHEDS + BLOCKS, len(half), len(spots)).astype(np.float64)
    wanted = np.column_stack([spots[:, :2], square + aside + np.pi / 2, design])
    room = land_room(terrain, sea, wanted) + 6.0
    close = terrain.beyond(spots[:, 0], spots[:, 1])
    order = np.argsort(close * rng.uniform(0.5, 1.0, len(close)), kind="stable")
    candidates = Candidates(wanted[order], half, room[order], spots[order, 2])
    return place_plots(terrain, candidates, count, gap=2.2, deepest=1e3)


def _town_covers(terrain: Terrain, sea: Basin, patches: Relief) -> tuple[tuple[Cover, F64], ...]:
    """Pave the harbor, and put gravel between the houses: signed fields at the nodes [m], shape (S, L)."""
    station, left = terrain.nodes()
    out, middle = sea.side * left, (terrain.inner[0] + terrain.inner[1]) / 2
    beside = QUAY + 30.0 - np.abs(station - middle)
    wanted = np.stack([station.ravel(), left.ravel()], axis=1)
    free = land_room(terrain, sea, wanted).reshape(station.shape) - 4.0
    yard = np.minimum(np.minimum(out - sea.near(station) + 150.0, beside), free + 14.0)
    town = np.minimum(np.minimum(free, BUILT - 30.0 + out), 640.0 - np.abs(station - middle))
    town = np.minimum(np.minimum(town, -out - FOOT), 9.0 * patches(station, left))
    return (YARD, np.clip(yard, -9.0, 9.0)), (TOWN, np.clip(town, -9.0, 9.0))


def _harbour(place: Waterside, plots: Plots, count: int, rng: np.random.Generator, first_id: int) -> list[Scatter]:
    """Place cranes on the quay, and stacks of containers behind it."""
    terrain, sea, reaches = place.terrain, place.basin, place.reaches
    axis = terrain.land.layout.alignment
    front = np.pi if sea.side > 0 else 0.0
    runs: list[Scatter] = []
    spots = quay_places(terrain, sea, reaches, 10.6, 48.0)
    spots = np.sort(rng.permutation(len(spots))[:count])
    rail = quay_places(terrain, sea, reaches, 10.6, 48.0)[spots]
    middle = (terrain.inner[0] + terrain.inner[1]) / 2
    at = np.tile(np.arange(middle - QUAY + 20.0, middle + QUAY - 20.0, 32.0), 2)
    back = np.repeat((37.0, 52.0), len(at) // 2)
    block = rng.integers(0, 4, len(at)).astype(np.float64)
    wanted = np.column_stack([at, sea.side * (sea.near(at) - back), np.zeros(len(at)), block])
    half = np.full((4, 2), (14.5, 4.2))
    room = np.where(rng.random(len(at)) < 0.75, land_room(terrain, sea, wanted), 0.0)
    stacks = place_plots(terrain, Candidates(wanted, half, room), 60, gap=2.0, standing=plots)
    cranes = np.column_stack([rail, np.full(len(rail), front), np.zeros(len(rail))])
    blocks = np.column_stack([stacks.places, stacks.heading, stacks.which.astype(np.float64)])
    blocks[:, 2] -= 0.12
    shapes = (("Cranes", (crane(rng),), cranes), ("Containers", container_stacks(rng, 4), blocks))
    for name, prototypes, rows in shapes:
        if len(rows):
            number = first_id + sum(len(run.instance_ids) for run in runs)
            where = (to_world(axis, rows[:, :3]), rows[:, 3] + axis.heading_at(rows[:, 0]), np.ones((len(rows), 3)))
            ids = tuple(range(number, number + len(rows)))
            which = rows[:, 4].astype(np.int32)
            runs.append(Scatter(f"{PREFIX}_{name}", "building", "Shore", prototypes, which, *where, ids))
    return runs


def _ships(place: Waterside, rng: np.random.Generator, first_id: int) -> list[Scatter]:
    """Place freighters at the quay, and passing ships and boats."""
    terrain, sea = place.terrain, place.basin
    shapes = (freighter(rng), freighter(rng), ferry(rng), ferry(rng), motor_boat(rng), motor_boat(rng))
    half = np.array([[62.0, 10.0]] * 2 + [[21.0, 5.0]] * 2 + [[5.0, 2.0]] * 2)
    middle = (terrain.inner[0] + terrain.inner[1]) / 2
    berths = middle + rng.permutation(np.array([-290.0, -150.0, 150.0, 290.0]) + rng.uniform(-20.0, 20.0, 4))
    rows = [
        (at, sea.side * (sea.near(np.array(at)) + 13.0), np.pi * (at > middle), rng.integers(0, 4)) for at in berths
    ]
    station = middle + rng.normal(0.0, 700.0, 160)
    off = sea.near(station) + 45.0 + rng.exponential(420.0, 160)
    kind = np.where(off > sea.shore + 250.0, rng.integers(0, 6, 160), rng.integers(2, 6, 160))
    away = np.column_stack([station, sea.side * off, rng.uniform(0.0, 2 * np.pi, 160), kind])
    wanted = np.concatenate([np.array(rows, np.float64), away])
    deep = terrain.height(wanted[:, 0], wanted[:, 1]) < sea.level - 1.0
    land = terrain.land
    deep &= land.crossing.distance(wanted[:, 0], wanted[:, 1]) > land.crossing.half_width + 75.0
    return anchored(place, wanted[deep], shapes, half, 46, first_id)
