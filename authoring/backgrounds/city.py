"""The background `city`: a grid of streets, towers and mid-rises, quays along the river, and street furniture."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from authoring.backgrounds.block_lots import block_lots, block_spots
from authoring.backgrounds.city_ground import city_surfaces
from authoring.backgrounds.facades import MIDDLE, tower_faces
from authoring.backgrounds.far_ways import far_ways
from authoring.backgrounds.forests import Forests, draw_forests
from authoring.backgrounds.pavements import KERB, plate, street_paint
from authoring.backgrounds.quads import quad_mesh
from authoring.backgrounds.river_quays import quays
from authoring.backgrounds.site_lots import build_lots, find_lots
from authoring.backgrounds.street_furniture import furniture
from authoring.backgrounds.street_trees import street_trees
from authoring.backgrounds.streets import STRIP, Block, TownPlan, draw_plan
from authoring.backgrounds.terrain import Cell, Terrain, distance_beyond, grow_terrain, rolling_hills
from authoring.backgrounds.tower_fittings import roof_runs, window_runs
from authoring.backgrounds.towers import WALK, Tower, draw_towers
from authoring.backgrounds.traffic import traffic
from authoring.shapes.component import FIRST_BACKGROUND_ID, Component, Mesh, Scatter
from authoring.site.covers import Cover, chunked, covered, drape
from authoring.site.land import FIRST_STEP
from authoring.site.relief import Relief, smoothstep
from authoring.site.shape import Hills, Land
from authoring.site.site import Site
from groundwork.settings import Settings

F64 = NDArray[np.float64]
Piece = tuple[str, str, str, str, Mesh]

CALM = 34.0  # distance from the site over which the site's relief fades out [m]
_ASPHALT = Cover("paved", "Asphalt", "road", "asphalt")
_GLAZED = ("window", "glass_facade")


class CitySettings(Settings):
    """Appearance of the city."""

    reach: float = Field(
        default=2000.0, ge=1200.0, le=5000.0, description="Distance that the terrain reaches beyond the site [m]"
    )
    town: float = Field(default=640.0, ge=150.0, le=900.0, description="Distance that streets and buildings reach [m]")
    tower_height: float = Field(
        default=95.0, ge=10.0, le=180.0, description="Typical height of the buildings in the city's core [m]"
    )
    density: float = Field(default=0.92, ge=0.1, le=1.0, description="Share of the lots that are built on [1]")
    parks: float = Field(default=0.08, ge=0.0, le=1.0, description="Share of the blocks that are parks [1]")
    parking: float = Field(default=0.07, ge=0.0, le=1.0, description="Share of the blocks that are parking lots [1]")
    turned: float = Field(
        default=0.45, ge=0.0, le=0.78, description="Largest angle between the streets and the bridge's axis [rad]"
    )
    hills: float = Field(default=24.0, ge=0.0, le=150.0, description="Typical height of the hills around the city [m]")
    trees: int = Field(default=420, ge=0, le=900, description="Largest number of trees in the city [1]")
    vehicles: int = Field(default=300, ge=0, le=600, description="Largest number of vehicles [1]")


@dataclass(frozen=True)
class CalmRelief(Relief):
    """The site's relief, which fades out beyond it: a town's ground is level.

    Attributes:
        inner: Lowest and highest station, lowest and highest left of the site [m].
    """

    inner: Cell

    def __call__(self, x: F64, y: F64) -> F64:
        """Evaluate the relief at stations and lefts [m]: heights [m] of the same shape, float64."""
        away = distance_beyond(self.inner, x, y)
        return super().__call__(x, y) * (1.0 - smoothstep(FIRST_STEP + 4.0, CALM, away))


@dataclass(frozen=True)
class Town:
    """A town before it is built.

    Attributes:
        terrain: The land.
        plan: Streets and blocks.
        uses: Use of each block.
        towers: Buildings.
        vacant: Lots without one.
        forests: Forests on the hills beyond.
    """

    terrain: Terrain
    plan: TownPlan
    uses: tuple[str, ...]
    towers: tuple[Tower, ...]
    vacant: tuple[Block, ...]
    forests: Forests


def draw_town(settings: CitySettings, site: Site, rng: np.random.Generator) -> Town:
    """Draw where streets, blocks and buildings lie.

    Args:
        settings: Appearance of the city.
        site: The site.
        rng: Random stream.

    Returns:
        The town.
    """
    own = site.field
    inner = (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
    land = replace(site.land, relief=CalmRelief(site.land.relief.octaves, inner))
    forests = draw_forests(land, inner, settings.town + 180.0, rng)
    hills = forests.over(_hills(land, inner, settings, rng))
    terrain = grow_terrain(replace(site, land=land), hills, settings.reach)
    plan = draw_plan(terrain, settings.town, settings.turned, rng)
    drawn = rng.uniform(size=len(plan.blocks))
    limits = (settings.parks, settings.parks + settings.parking)
    uses = tuple("park" if share < limits[0] else "parking" if share < limits[1] else "built" for share in drawn)
    towers, vacant = draw_towers(plan, uses, settings.density, settings.tower_height, rng)
    return Town(terrain, plan, uses, towers, vacant, forests)


def build_city(settings: CitySettings, site: Site, rng: np.random.Generator) -> tuple[Component | Scatter, ...]:
    """Build the city round a site.

    Args:
        settings: Appearance of the city.
        site: The site; its strip stays empty.
        rng: Random stream `background`.

    Returns:
        Components and scatters, ids from `FIRST_BACKGROUND_ID`.
    """
    town = draw_town(settings, site, rng)
    terrain, plan = town.terrain, town.plan
    axis = site.land.layout.alignment
    surfaces = city_surfaces(site.land)
    pieces: list[Piece] = [
        (name, cover.kind, surfaces.get(cover.name, cover.role), "Ground", drape(chunk, axis, terrain.atlas(chunk)))
        for cover, soup in covered(terrain.soup(((_ASPHALT, _paved(town)), town.forests.cover(terrain))))
        for name, chunk in chunked(cover.prim, soup)
    ]
    pieces += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in far_ways(terrain)]
    pieces += [(prim, kind, role, "Quays", mesh) for prim, kind, role, mesh in quays(terrain, 1.2 * settings.town)]
    blocks, lawns, lots = _blocks(town)
    on_site = build_lots(find_lots(site), terrain, plan)
    pieces += blocks + _buildings(town) + on_site.pieces
    runs = window_runs(town.towers, site.extent, rng) + roof_runs(town.towers, rng) + furniture(plan, terrain, rng)
    runs += street_trees(plan, terrain, lawns, settings.trees, rng)
    runs = [run for run in map(on_site.clear, runs) if run is not None]
    runs += traffic(plan, terrain, (block_spots(plan, lots), on_site.spots), settings.vehicles, rng)
    components = [
        Component(f"City_{prim}", kind, role, group, mesh, FIRST_BACKGROUND_ID + number)
        for number, (prim, kind, role, group, mesh) in enumerate(pieces)
    ]
    return (*components, *_numbered(runs, FIRST_BACKGROUND_ID + len(components)))


def _hills(land: Land, inner: Cell, settings: CitySettings, rng: np.random.Generator) -> Hills:
    """Keep the town level, with hills beyond it."""
    far = rolling_hills(land, inner, settings.hills, rng)

    def hills(station: F64, left: F64) -> F64:
        away = distance_beyond(inner, station, left)
        return smoothstep(settings.town + 60.0, settings.town + 520.0, away) * far(station, left)

    return hills


def _paved(town: Town) -> F64:
    """Compute the distance of terrain nodes to the edge of the asphalt, positive inside [m], shape (S, L), float64."""
    terrain, plan = town.terrain, town.plan
    station, left = terrain.nodes()
    world = terrain.land.layout.alignment.point(station.ravel(), left.ravel(), np.zeros(station.size))[:, :2]
    within = plan.reach - np.hypot(*(world - plan.origin).T)
    away = terrain.beyond(station, left).ravel() - (STRIP - 1.0)
    return np.minimum(within, away).reshape(station.shape)


def _blocks(town: Town) -> tuple[list[Piece], list[Block], list[Block]]:
    """Pave the blocks; returns their pieces, and lawns and parking lots in grid coordinates."""
    plan, pieces, lawns, lots = town.plan, [], [], []
    for number, paint in enumerate(street_paint(plan)):
        pieces.append((f"StreetMarking_{number}", "road", "road_marking", "Streets", paint))
    for number, (block, use) in enumerate(zip(plan.blocks, town.uses, strict=True)):
        base = plate(plan, block)
        if base is None:
            continue
        pieces.append((f"Pavement_{number:03d}", "ground", "pavement", "Streets", base))
        inner = Block((block.low[0] + WALK, block.low[1] + WALK), (block.high[0] - WALK, block.high[1] - WALK))
        if use == "park":
            lawns.append(inner)
        elif use == "parking":
            lots.append(inner)
    lawns += town.vacant
    for name, kind, role, rise, areas in (
        ("Lawn", "ground", "grass", 0.06, lawns),
        ("ParkingLot", "road", "asphalt", 0.03, lots),
    ):
        for number, area in enumerate(areas):
            top = plate(plan, area, KERB + rise, WALK - 1.5)
            if top is not None:
                pieces.append((f"{name}_{number:03d}", kind, role, "Streets", top))
    pieces += block_lots(plan, lots)
    return pieces, lawns, lots


def _buildings(town: Town) -> list[Piece]:
    """Build every near building as separate pieces, and far ones block by block."""
    gathered: dict[tuple[str, str], list[F64]] = {}
    for number, tower in enumerate(town.towers):
        name = f"Block_{tower.block:03d}" if tower.away > MIDDLE else f"Tower_{number:03d}"
        for role, parts in tower_faces(tower).items():
            gathered.setdefault((name, role), []).extend(parts)
    pieces = []
    for (name, role), parts in gathered.items():
        kind = "roof" if role == "roofing" else "window" if role in _GLAZED else "building"
        word = "".join(part.capitalize() for part in role.split("_"))
        pieces.append((f"{name}_{word}", kind, role, "Buildings", quad_mesh(np.concatenate(parts))))
    return pieces


def _numbered(runs: list[Scatter], first_id: int) -> list[Scatter]:
    """Assign ids to runs: one each, or one for every repeat if they have as many ids."""
    numbered = []
    for run in runs:
        count = len(run.instance_ids)
        numbered.append(replace(run, instance_ids=tuple(range(first_id, first_id + count))))
        first_id += count
    return numbered
