"""The background `countryside`: rolling fields, hedges, woods and a hamlet; river and roads continue."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from authoring.backgrounds.byways import Byway, located, road_byways
from authoring.backgrounds.far_ways import far_ways
from authoring.backgrounds.farm_lanes import draw_farm_lanes
from authoring.backgrounds.forests import draw_forests
from authoring.backgrounds.groves import draw_groves, garden_trees
from authoring.backgrounds.hamlet import draw_hamlet, hamlet_components, kept_off, occupied
from authoring.backgrounds.homesteads import Homestead
from authoring.backgrounds.parcels import Parcel, crop_fields, draw_parcels
from authoring.backgrounds.roadside import plant_hedges, plant_poles
from authoring.backgrounds.terrain import Terrain, grow_terrain, rolling_hills
from authoring.backgrounds.vegetation import tree_runs
from authoring.backgrounds.wayside import approach_fences, build_fences, drive_cars, plant_fences
from authoring.backgrounds.yards import garden_runs, yard_components
from authoring.shapes.component import FIRST_BACKGROUND_ID, Component, Scatter
from authoring.site.covers import Cover, chunked, covered, drape
from authoring.site.site import Site
from groundwork.settings import Settings

F64 = NDArray[np.float64]
FIELDS = (1500.0, 1400.0)  # extent of fields along the axis and to its sides [m]
VERGE = 10.5  # distance from the edge of a road to the gardens beside it [m]
BESIDE = 4.0  # distance of crops from gardens and lanes [m]
POST_ROOM = 0.6  # radius of the room of a fence's post, without trees and hedges [m]
LANES = 3  # lanes of the hamlet
FORESTS = 330.0  # distance of the nearest forest from the site [m]


class CountrysideSettings(Settings):
    """Appearance of the countryside."""

    reach: float = Field(
        default=2000.0, ge=400.0, le=5000.0, description="Distance that the terrain reaches beyond the site [m]"
    )
    hills: float = Field(default=42.0, ge=0.0, le=150.0, description="Typical height of the far hills [m]")
    buildings: int = Field(default=26, ge=0, le=60, description="Number of buildings; fewer where there is no room [1]")
    hedge_bushes: int = Field(default=170, ge=0, le=3000, description="Largest number of bushes in hedges [1]")
    vehicles: int = Field(default=14, ge=0, le=200, description="Number of vehicles on the approach roads [1]")
    trees: int = Field(
        default=520,
        ge=0,
        le=2000,
        description="Number of trees outside gardens; fewer where there is no room [1]",
    )


def build_countryside(
    settings: CountrysideSettings, site: Site, rng: np.random.Generator
) -> tuple[Component | Scatter, ...]:
    """Build the countryside round a site.

    Args:
        settings: Appearance of the countryside.
        site: The site; its strip stays empty.
        rng: Random stream `background`.

    Returns:
        Components and scatters, ids from `FIRST_BACKGROUND_ID`.
    """
    axis, own = site.land.layout.alignment, site.field
    inner = (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
    forests = draw_forests(site.land, inner, FORESTS, rng)
    hills = forests.over(rolling_hills(site.land, inner, settings.hills, rng))
    terrain = grow_terrain(site, hills, settings.reach)
    ways = far_ways(terrain)
    roads = road_byways(terrain, ways, VERGE)
    laid = draw_farm_lanes(terrain, roads, LANES, rng)
    lanes = [lane for _, lane in laid]
    homes = draw_hamlet(terrain, roads, lanes, settings.buildings, rng)
    taken = occupied(terrain, homes, lanes)
    parcels, crops = _fields(terrain, homes, lanes, rng)
    pieces = [
        (name, cover.kind, cover.role, "Ground", drape(chunk, axis, terrain.atlas(chunk)))
        for cover, soup in covered(terrain.soup((forests.cover(terrain), *crops)))
        for name, chunk in chunked(cover.prim, soup)
    ]
    pieces += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in ways]
    fences = approach_fences(terrain, taken)
    pieces += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in build_fences(axis, fences)]
    posts = [np.column_stack([line[:, :2], np.full(len(line), POST_ROOM)]) for line in fences.values()]
    unfenced, taken = taken, np.concatenate([taken, *posts])
    paving = str(rng.choice(("asphalt", "gravel")))
    pieces += [(f"Lane_{number}", "road", paving, "Ways", mesh) for number, (mesh, _) in enumerate(laid)]
    components = [
        Component(f"Countryside_{prim}", kind, role, group, mesh, FIRST_BACKGROUND_ID + number)
        for number, (prim, kind, role, group, mesh) in enumerate(pieces)
    ]
    components += hamlet_components(terrain, homes, rng, FIRST_BACKGROUND_ID + len(components))
    components += yard_components(terrain, "Countryside", homes, FIRST_BACKGROUND_ID + len(components))
    things: list[Scatter] = []

    def ahead() -> int:
        return FIRST_BACKGROUND_ID + len(components) + len(things)

    groves = draw_groves(terrain, parcels, lanes, taken, settings.trees, rng, outside=forests.field)
    trees = np.concatenate([groves, garden_trees(terrain, homes, rng)])
    things += tree_runs(terrain, trees, rng, ahead())
    things += plant_hedges(terrain, parcels, taken, settings.hedge_bushes, rng, ahead())
    things += garden_runs(terrain, "Countryside", homes, rng, ahead())
    things += plant_poles(terrain, ahead(), rng, unfenced)
    things += plant_fences(terrain, taken, rng, ahead())
    things += drive_cars(terrain, settings.vehicles, rng, ahead())
    return (*components, *things)


def _fields(
    terrain: Terrain, homes: tuple[Homestead, ...], lanes: list[Byway], rng: np.random.Generator
) -> tuple[tuple[Parcel, ...], tuple[tuple[Cover, F64], ...]]:
    """Draw fields, and the extents of their crops: none on lots and lanes, nor on a field with several lots."""
    drawn = draw_parcels(terrain, rng, FIELDS)
    middles = np.array([(*located(terrain, home.row()[None, :2]),) for home in homes]).reshape(-1, 2)
    lots = [int((parcel.inside(*middles.T) > 0.0).sum()) for parcel in drawn]
    parcels = tuple(replace(parcel, crop="") if many > 2 else parcel for parcel, many in zip(drawn, lots, strict=True))
    free = kept_off(terrain, homes, lanes, BESIDE)
    return parcels, tuple((cover, np.minimum(values, free)) for cover, values in crop_fields(terrain, parcels))
