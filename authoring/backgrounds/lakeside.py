"""The background `lakeside`: a lake between mountains, a quay with town houses, villas and cypresses on slopes."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from authoring.backgrounds.boats import fleet
from authoring.backgrounds.byways import lane_byways, road_byways
from authoring.backgrounds.drives import draw_drives, drive_circles, drive_gates, drive_pieces
from authoring.backgrounds.dwellings import Style, draw_designs, dwelling_runs, halves
from authoring.backgrounds.lakeside_land import QUAY, draw_lake, lakeside_hills
from authoring.backgrounds.lanes import Lane, along_lanes, draw_lanes, lane_pieces, lane_room, street_gap
from authoring.backgrounds.lowland import valley_fields
from authoring.backgrounds.plots import Candidates, Plots, chosen, downhill, joined, place_plots
from authoring.backgrounds.roadside import plant_hedges, plant_poles
from authoring.backgrounds.shore_quay import SETBACK, quay_pieces, quay_places, quay_reaches, quay_runs
from authoring.backgrounds.shore_town import Town, Waterside, anchored, beside_roads, land_room, street_cars
from authoring.backgrounds.slope_plants import Woods, draw_stands, green_runs, mountain_covers
from authoring.backgrounds.terrain import Terrain, grow_terrain
from authoring.backgrounds.waters import Basin, level_shore, shore_pieces, ways_to_water
from authoring.backgrounds.woods import CYPRESS, LIME, OAK, PALM
from authoring.shapes.component import FIRST_BACKGROUND_ID, Component, Scatter
from authoring.site.site import Site
from groundwork.settings import Settings

F64 = NDArray[np.float64]
PREFIX = "Lakeside"
LANES = (142.0, 205.0, 275.0, 360.0, 460.0, 580.0)  # distances of the lanes on the slope from the axis [m]
STREET = 112.0  # distance of a street behind the town from the axis [m]
WIDEST = 66.0  # largest spacing of the terrain's grid lines [m]
HEDGES = 140  # most bushes between fields [1]
CLOSE = 50.0  # distance from the site within which buildings stand in detail [m]
_PLASTERS = ("plaster", "plaster_white", "plaster_rose", "plaster_ochre", "plaster_white")
VILLA = Style((10.0, 16.5), (8.5, 12.0), (2, 3), ("hip", "hip", "gable"), _PLASTERS, 0.45, 0.8, wings=0.6)
TOWN = Style((15.0, 25.0), (12.0, 15.0), (3, 5), ("hip", "hip", "flat"), _PLASTERS, 0.7, 0.7)


class LakesideSettings(Settings):
    """Appearance of the lakeside."""

    reach: float = Field(
        default=4200.0, ge=2500.0, le=6000.0, description="Distance that the terrain reaches beyond the site [m]"
    )
    mountains: float = Field(default=620.0, ge=150.0, le=1200.0, description="Typical height of the mountains [m]")
    lake_width: float = Field(
        default=1100.0, ge=400.0, le=2500.0, description="Width of the lake from shore to shore [m]"
    )
    villas: int = Field(
        default=190, ge=0, le=600, description="Number of villas on the slopes; fewer where there is no room [1]"
    )
    town_houses: int = Field(
        default=44, ge=0, le=120, description="Number of town houses behind the quay; fewer where there is no room [1]"
    )
    trees: int = Field(default=4200, ge=0, le=30000, description="Number of trees; fewer where there is no room [1]")
    boats: int = Field(default=70, ge=0, le=300, description="Number of boats; fewer where there is no room [1]")


def build_lakeside(settings: LakesideSettings, site: Site, rng: np.random.Generator) -> tuple[Component | Scatter, ...]:
    """Build a lakeside round a site.

    Args:
        settings: What it looks like.
        site: The site; its strip stays empty.
        rng: Random stream `background`.

    Returns:
        Components and scatters, ids from `FIRST_BACKGROUND_ID`.
    """
    own = site.field
    inner = (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
    lake = draw_lake(site.land, inner, settings.lake_width, rng)
    hills = lakeside_hills(site.land, inner, lake, settings.mountains, rng)
    terrain = level_shore(grow_terrain(site, hills, settings.reach, WIDEST), lake)
    reaches = quay_reaches(terrain, QUAY - 40.0 + (inner[1] - inner[0]) / 2)
    designs = (*draw_designs(TOWN, 7, rng), *draw_designs(VILLA, 12, rng))
    lanes = draw_lanes(terrain, -lake.side, LANES, 720.0, 2.4, rng)
    streets = draw_lanes(terrain, lake.side, (STREET,), 430.0, 3.2, rng, gap=street_gap(terrain))
    plots = _settlement(terrain, lake, (*lanes, *streets), settings, halves(designs), rng)
    ways, quays = ways_to_water(terrain, lake), quay_pieces(terrain, lake, reaches)
    roads = road_byways(terrain, [*ways, *((prim, kind, role, mesh) for prim, kind, role, _, mesh in quays)], 0.0)
    byways = [*roads, *lane_byways(terrain, lanes, False), *lane_byways(terrain, streets, False)]
    drives, reached = draw_drives(terrain, byways, plots, np.ones(len(plots.which), bool), [])
    plots = chosen(plots, reached)
    place, town = Waterside(terrain, lake, reaches, PREFIX), Town(designs, plots, (*lanes, *streets))
    town = replace(town, drives=drive_circles(terrain, drives))
    woods = Woods(draw_stands(rng), (220.0, 1000.0), (OAK, LIME, OAK, CYPRESS, PALM), 480.0, 0.4, 4.0, settings.trees)
    parcels, crops = valley_fields(terrain, lake, town.taken(), town.lanes, rng)
    covers = (*mountain_covers(terrain, lake, plots, woods, rng), *crops)
    pieces = shore_pieces(terrain, lake, covers) + quays
    pieces += lane_pieces(terrain, lanes, gates=drive_gates(terrain, drives)) + lane_pieces(
        terrain, streets, ("Street", "road", "asphalt"), None
    )
    pieces += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in ways]
    pieces += drive_pieces(terrain, drives, rng)
    components = [
        Component(f"{PREFIX}_{prim}", kind, role, group, mesh, FIRST_BACKGROUND_ID + number)
        for number, (prim, kind, role, group, mesh) in enumerate(pieces)
    ]
    runs: list[Scatter] = []

    def ahead() -> int:
        return FIRST_BACKGROUND_ID + len(components) + sum(len(run.instance_ids) for run in runs)

    runs += dwelling_runs(terrain, PREFIX, designs, plots, CLOSE, ahead())
    runs += quay_runs(terrain, lake, reaches, PREFIX, ahead())
    runs += _boats(place, settings.boats, rng, ahead())
    runs += street_cars(place, town.lanes, rng, ahead())
    promenade = quay_places(terrain, lake, reaches, 7.0, 9.0)
    runs += green_runs(place, town, woods, promenade, rng, ahead())
    hedges = plant_hedges(terrain, parcels, town.taken(), HEDGES, rng, ahead())
    runs += [replace(run, name=f"{PREFIX}_FieldHedges") for run in hedges]
    runs += [replace(run, name=f"{PREFIX}_Poles") for run in plant_poles(terrain, ahead(), rng, town.drives)]
    return (*components, *runs)


def _settlement(
    terrain: Terrain,
    lake: Basin,
    lanes: tuple[Lane, ...],
    settings: LakesideSettings,
    half: F64,
    rng: np.random.Generator,
) -> Plots:
    """Choose places for town houses behind the quay, and for villas on the slopes and across the lake."""
    towns = np.flatnonzero(np.arange(len(half)) < 7)
    middle = (terrain.inner[0] + terrain.inner[1]) / 2
    reach = QUAY - 30.0 + (terrain.inner[1] - terrain.inner[0]) / 2
    rows = []
    for back in (SETBACK + 14.5, SETBACK + 47.0):
        at = np.arange(middle - reach, middle + reach, 5.0)
        left = lake.side * (lake.near(at) - back - rng.uniform(-0.8, 0.8, len(at)))
        turn = np.full(len(at), np.pi if lake.side > 0 else 0.0)
        rows.append(np.column_stack([at, left, turn, rng.choice(towns, len(at)).astype(np.float64)]))
    wanted = np.concatenate(rows)
    wanted = wanted[rng.permutation(len(wanted))]
    candidates = Candidates(wanted, half, land_room(terrain, lake, wanted))
    first = place_plots(terrain, candidates, settings.town_houses, gap=5.0)
    across = along_lanes(lanes, np.array([-12.5, 11.5, 13.0, 15.0, 17.0]), 9.0, rng)[:, :2]
    far = middle + rng.uniform(-1500.0, 1500.0, 6 * settings.villas)
    shore = lake.near(far) + settings.lake_width + rng.uniform(-200.0, 350.0, len(far))
    roads = beside_roads(terrain, (24.0, 34.0), rng)
    places = np.concatenate([across, np.column_stack([far, lake.side * shore]), roads])
    places = places[rng.permutation(len(places))]
    count, station, across = len(places), places[:, 0], places[:, 1]
    down, _ = downhill(terrain, station, across)
    turn = down + np.pi / 2 + rng.normal(0.0, 0.12, count)
    design = rng.integers(7, len(half), count).astype(np.float64)
    wanted = np.column_stack([station, across, turn, design])
    room = np.minimum(land_room(terrain, lake, wanted), lane_room(lanes, station, across) + 3.0)
    second = place_plots(terrain, Candidates(wanted, half, room), settings.villas, gap=9.0, standing=first)
    return joined((first, second))


def _boats(place: Waterside, count: int, rng: np.random.Generator, first_id: int) -> list[Scatter]:
    """Place boats at the jetties, at buoys, and a few sailing."""
    terrain, lake = place.terrain, place.basin
    jetties = quay_places(terrain, lake, place.reaches, -11.0, 55.0)
    rows = [
        np.column_stack(
            [
                jetties[:, 0] + side * 3.1,
                jetties[:, 1] + lake.side * rng.uniform(-3.0, 4.0, len(jetties)),
                np.pi / 2 + rng.normal(0.0, 0.05, len(jetties)),
                rng.integers(0, 6, len(jetties)).astype(np.float64),
            ]
        )
        for side in (-1.0, 1.0)
    ]
    middle = (terrain.inner[0] + terrain.inner[1]) / 2
    station = middle + rng.normal(0.0, 260.0, 6 * count)
    off = lake.near(station) + 26.0 + rng.exponential(75.0, 6 * count)
    wind = float(rng.uniform(0.0, 2 * np.pi))
    which = np.where(rng.random(6 * count) < 0.06, 8.0, rng.integers(0, 8, 6 * count).astype(np.float64))
    rows.append(np.column_stack([station, lake.side * off, wind + rng.normal(0.0, 0.25, 6 * count), which]))
    wanted = np.concatenate(rows)
    clear = lake.inside(wanted[:, 0], wanted[:, 1]) > np.where(wanted[:, 3] == 8, 60.0, 2.0)
    ground = terrain.height(wanted[:, 0], wanted[:, 1])
    clear &= ground < lake.level - 0.25
    clear &= terrain.land.crossing.distance(wanted[:, 0], wanted[:, 1]) > terrain.land.crossing.half_width + 12.0
    wanted = wanted[clear]
    fleet_half = np.array([[4.5, 1.8]] * 6 + [[2.6, 1.1]] * 2 + [[20.0, 5.0]])
    return anchored(place, wanted, fleet(rng), fleet_half, count, first_id)
