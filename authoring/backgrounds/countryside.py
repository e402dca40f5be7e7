"""The background `countryside`: rolling fields, hedges, woods and a hamlet; river and roads continue."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from authoring.backgrounds.far_ways import far_ways
from authoring.backgrounds.forests import draw_forests
from authoring.backgrounds.hamlet import RADIUS, draw_hamlet, hamlet_components
from authoring.backgrounds.parcels import crop_fields, draw_parcels, uncropped
from authoring.backgrounds.roadside import plant_hedges, plant_poles
from authoring.backgrounds.terrain import grow_terrain, rolling_hills
from authoring.backgrounds.vegetation import plant_trees
from authoring.backgrounds.wayside import drive_cars, plant_fences
from authoring.shapes.component import FIRST_BACKGROUND_ID, Component, Scatter
from authoring.site.covers import chunked, covered, drape
from authoring.site.site import Site
from groundwork.settings import Settings

F64 = NDArray[np.float64]
FIELDS = (1500.0, 1400.0)  # extent of fields along the axis and to its sides [m]
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
    trees: int = Field(default=380, ge=0, le=2000, description="Number of trees; fewer where there is no room [1]")


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
    houses = draw_hamlet(terrain, settings.buildings, rng)
    taken = np.array([(house.station, house.left, RADIUS - 3.0) for house in houses]).reshape(-1, 3)
    parcels = uncropped(draw_parcels(terrain, rng, FIELDS), taken)
    pieces = [
        (name, cover.kind, cover.role, "Ground", drape(chunk, axis, terrain.atlas(chunk)))
        for cover, soup in covered(terrain.soup((forests.cover(terrain), *crop_fields(terrain, parcels))))
        for name, chunk in chunked(cover.prim, soup)
    ]
    pieces += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in far_ways(terrain)]
    components = [
        Component(f"Countryside_{prim}", kind, role, group, mesh, FIRST_BACKGROUND_ID + number)
        for number, (prim, kind, role, group, mesh) in enumerate(pieces)
    ]
    components += hamlet_components(terrain, houses, rng, FIRST_BACKGROUND_ID + len(components))
    number = FIRST_BACKGROUND_ID + len(components)
    plants = list(plant_trees(terrain, parcels, taken, settings.trees, rng, number, outside=forests.field))
    plants += plant_hedges(terrain, parcels, taken, settings.hedge_bushes, rng, number + len(plants))
    things = [*plants, *plant_poles(terrain, FIRST_BACKGROUND_ID + len(components) + len(plants), rng)]
    things += plant_fences(terrain, rng, FIRST_BACKGROUND_ID + len(components) + len(things))
    things += drive_cars(terrain, settings.vehicles, rng, FIRST_BACKGROUND_ID + len(components) + len(things))
    return (*components, *things)
