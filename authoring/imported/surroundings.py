"""An imported world round a site: its relief meets the site's edge, and its buildings keep a distance from it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates

from authoring.backgrounds.far_ways import far_ways
from authoring.backgrounds.forests import WOOD
from authoring.backgrounds.parcels import crop_fields, draw_parcels, open_land
from authoring.backgrounds.terrain import Terrain, distance_beyond, grow_terrain, rolling_hills
from authoring.backgrounds.vegetation import plant_trees
from authoring.imported.asset import city_components, textured_components
from authoring.imported.facade_windows import window_runs
from authoring.imported.ground import CityGround, city_ground
from authoring.imported.model import Building, CityModel
from authoring.imported.place import CELL, BuiltMap, CityPlace, built_map, choose_place
from authoring.imported.textured_place import Clearance, place_textured
from authoring.shapes.component import FIRST_BACKGROUND_ID, Component, Scatter
from authoring.site.covers import Cover, chunked, covered, drape, to_world
from authoring.site.land import FIRST_STEP
from authoring.site.relief import draw_relief, smoothstep
from authoring.site.shape import Hills
from authoring.site.site import Site

F64 = NDArray[np.float64]

REACH = 2200.0  # [m] of terrain beyond the site
HILLS = 42.0  # [m], typical height of the hills beyond the world
PAVED = 14.0  # [m] around a building
CLEAR = 2.5  # [m] distance of buildings from roads, water and the site
JOIN = 45.0  # [m] from the site over which the world's relief is blended in
SUNK = 0.6  # [m] depth of the terrain below the lowest photographed ground nearby
TREES = 260
_OUTSKIRTS = 22.0  # [m] from the paving to fields and woods
_WOODS = 180.0  # [m] from the site to woods
_FIELDS = (1000.0, 900.0)  # [m] extent of fields along the axis and to its sides
_STEP = 2.0  # [m] between the points at which a building is checked
_FOOT = 0.5  # [m] depth of walls in the ground
_PAVING = Cover("paved", "Paving", "ground", "asphalt")


def build_city_world(model: CityModel, site: Site, rng: np.random.Generator) -> tuple[Component | Scatter, ...]:
    """Put a site at a random valid place of an imported world, and build its surroundings.

    Args:
        model: The world.
        site: The site; its strip stays empty.
        rng: Random stream `background`.

    Returns:
        Components and scatters, ids from `FIRST_BACKGROUND_ID`.

    Raises:
        InputError: No valid place.
    """
    place = choose_place(model, site, rng)
    ground = city_ground(model)
    datum = float(np.median(ground.height(place.to_city(site.edge[:, :2]))))
    clearance = Clearance.of(site) if model.textured else None
    terrain = grow_terrain(site, _relief(site, place, ground, datum, clearance, rng), REACH)
    kept = _placed_buildings(model, terrain, place, ground)
    axis = site.land.layout.alignment
    # A photograph contains its own pavements; where it is cut away there is grass, as on the site.
    outskirts = rng.spawn(1)[0]  # a separate stream: covers do not change the trees
    paved = () if clearance is not None else _land_covers(terrain, place, built_map(model), outskirts)
    pieces = [
        (name, cover.kind, cover.role, "Ground", drape(chunk, axis, terrain.atlas(chunk)))
        for cover, soup in covered(terrain.soup(paved))
        for name, chunk in chunked(cover.prim, soup)
    ]
    pieces += [(prim, kind, role, "Ways", mesh) for prim, kind, role, mesh in far_ways(terrain)]
    components = [
        Component(f"City_{prim}", kind, role, group, mesh, FIRST_BACKGROUND_ID + number)
        for number, (prim, kind, role, group, mesh) in enumerate(pieces)
    ]
    scene_model = CityModel(kept, np.zeros((0, 3, 3)), model.attribution)
    components += city_components(scene_model, "City", FIRST_BACKGROUND_ID + len(components))
    if clearance is not None:
        textured = place_textured(model, terrain, place, ground, clearance, datum)
        whole = CityModel((), scene_model.terrain, {}, textured, model.skins)
        components += textured_components(whole, "City", FIRST_BACKGROUND_ID + len(components))
    first_id = FIRST_BACKGROUND_ID + len(components)
    windows = window_runs(kept, np.asarray(place.middle), first_id)
    trees = plant_trees(terrain, (), _circles(kept, terrain), TREES, rng, first_id + len(windows))
    if clearance is not None:  # a photograph contains its own trees
        trees = tuple(_only(run, ground.beyond_at(place.to_city(run.positions[:, :2])) > 0.0) for run in trees)
    return (*components, *windows, *(run for run in trees if len(run.positions)))


def _only(run: Scatter, kept: NDArray[np.bool_]) -> Scatter:
    ids = run.instance_ids if len(run.instance_ids) == 1 else tuple(np.array(run.instance_ids)[kept].tolist())
    return replace(
        run,
        prototype=run.prototype[kept],
        positions=run.positions[kept],
        yaw=run.yaw[kept],
        scales=run.scales[kept],
        instance_ids=ids,
    )


def _relief(
    site: Site,
    place: CityPlace,
    ground: CityGround,
    datum: float,
    clearance: Clearance | None,
    rng: np.random.Generator,
) -> Hills:
    """Blend in the world's terrain beside the site, level with the site there, and add hills at the world's end.

    The relief stays below photographed ground.
    """
    own, axis = site.field, site.land.layout.alignment
    inner = (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
    far = rolling_hills(site.land, inner, HILLS, rng)

    def hills(station: F64, left: F64) -> F64:
        flat = np.stack([station.ravel(), left.ravel(), np.zeros(station.size)], axis=1)
        spot = place.to_city(to_world(axis, flat)[:, :2])
        share = ground.share(spot).reshape(station.shape)
        height = (ground.height(spot) - datum).reshape(station.shape)
        if clearance is not None:
            hidden = clearance.rigid(station, left, ground.beyond_at(spot).reshape(station.shape))
            floor = (ground.floor(spot) - datum).reshape(station.shape) - SUNK
            height = height + hidden * (floor - height)
        away = distance_beyond(inner, station, left)
        return smoothstep(FIRST_STEP + 4.0, JOIN, away) * share * height + (1.0 - share) * far(station, left)

    return hills


def _placed_buildings(model: CityModel, terrain: Terrain, place: CityPlace, ground: CityGround) -> tuple[Building, ...]:
    """Place every building that is away from site, roads and water on the terrain."""
    return tuple(
        _set_down(building, terrain, place, ground) for building in model.buildings if _clear(building, terrain, place)
    )


def _clear(building: Building, terrain: Terrain, place: CityPlace) -> bool:
    station, left = terrain.land.layout.alignment.locate(place.to_scene(_plan_spots(building)))
    land = terrain.land
    free = np.minimum(terrain.beyond(station, left) - CLEAR, terrain.clear(station, left) - 0.5)
    free = np.minimum(free, land.crossing.distance(station, left) - land.crossing.half_width - CLEAR)
    for approach in land.approaches:
        aside = np.abs(left - approach.center(station)) - approach.half_width - CLEAR
        free = np.minimum(free, np.where(approach.along(station) > -20.0, aside, CLEAR))
    return bool(free.min() > 0.0)


def _plan_spots(building: Building) -> F64:
    """Distribute points over a building's plan, at most one step apart [m], shape (N, 2), float64."""
    triangles = np.concatenate([building.roofs, building.walls])[:, :, :2]
    longest = float(np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max())
    count = max(2, int(np.ceil(longest / _STEP)) + 1)
    a, b = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count)))
    inside = a + b <= 1.0 + 1e-9
    weights = np.stack([1.0 - a - b, a, b], axis=1)[inside]
    return np.unique(np.round((weights @ triangles).reshape(-1, 2), 2), axis=0)


def _set_down(building: Building, terrain: Terrain, place: CityPlace, ground: CityGround) -> Building:
    """Move a building to the scene with its ground; its walls are extended down into the terrain."""
    corners = building.corners
    bottom = float(corners[:, 2].min())
    feet = corners[corners[:, 2] < bottom + 0.5, :2]
    here = terrain.height(*terrain.land.layout.alignment.locate(place.to_scene(feet)))
    shift = float(np.median(here - ground.height(feet)))
    lowest = min(float(here.min()) - _FOOT, bottom + shift)

    def moved(triangles: F64) -> F64:
        placed = np.concatenate([place.to_scene(triangles[..., :2]), triangles[..., 2:] + shift], axis=-1)
        placed[..., 2] = np.where(triangles[..., 2] < bottom + 0.02, lowest, placed[..., 2])
        return np.round(placed, 3)

    return Building(building.name, moved(building.walls), moved(building.roofs))


def _land_covers(
    terrain: Terrain, place: CityPlace, built: BuiltMap, rng: np.random.Generator
) -> tuple[tuple[Cover, F64], ...]:
    """Pave the ground around buildings; farther away, and beyond the world's edge, place fields and woods.

    Returns:
        Each cover with its signed field at the terrain's nodes [m], shape (S, L), float64.
    """
    paving = _paving(terrain, place, built)
    open_ = -paving - _OUTSKIRTS
    station, left = terrain.nodes()
    stands = draw_relief(((300.0, 1.0), (110.0, 0.45)), rng)(station, left) - 0.45
    far = np.minimum(open_, terrain.beyond(station, left) - _WOODS)
    wood = np.minimum(40.0 * stands, np.minimum(far, open_land(terrain, station, left)))
    fields = crop_fields(terrain, draw_parcels(terrain, rng, _FIELDS))
    return (
        (_PAVING, paving),
        (WOOD, np.clip(wood, -9.0, 9.0)),
        *((cover, np.minimum(values, open_)) for cover, values in fields),
    )


def _paving(terrain: Terrain, place: CityPlace, built: BuiltMap) -> F64:
    """Measure how far nodes lie within the paved surroundings of buildings [m], shape (S, L), float64."""
    station, left = terrain.nodes()
    flat = np.stack([station.ravel(), left.ravel(), np.zeros(station.size)], axis=1)
    spot = place.to_city(to_world(terrain.land.layout.alignment, flat)[:, :2])
    away = np.asarray(distance_transform_edt(~built.built, sampling=CELL), np.float64)
    column, row = np.moveaxis((spot - built.corner) / CELL - 0.5, -1, 0)
    distance = map_coordinates(away, [row, column], order=1, mode="constant", cval=1e3)
    return np.clip(PAVED - distance.reshape(station.shape), -30.0, PAVED)


def _circles(buildings: tuple[Building, ...], terrain: Terrain) -> F64:
    """Bound buildings by circles: station, left and radius [m], shape (K, 3), float64."""
    rows = []
    for building in buildings:
        plan = building.corners[:, :2]
        middle = 0.5 * (plan.min(axis=0) + plan.max(axis=0))
        station, left = terrain.land.layout.alignment.locate(middle[None])
        rows.append((station[0], left[0], float(np.linalg.norm(plan - middle, axis=1).max())))
    return np.array(rows).reshape(-1, 3)
