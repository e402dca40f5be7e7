"""Yards of homesteads: drives, yards and patios on the ground, garages, woodpiles, hedges and fences with a gate."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.byways import UNDER, ground, laid, paved, resampled
from authoring.backgrounds.homesteads import DRIVE, PANEL, SHED, Homestead
from authoring.backgrounds.solids import Frame, box, gabled_walls, roof_slab
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.wayside import fence_panel
from authoring.shapes.component import Component, Mesh, Scatter
from authoring.site.plants import bush
from authoring.site.ways import merged

F64 = NDArray[np.float64]
HEDGE_STEP = 1.9  # distance between the bushes of a garden's hedge [m]
CLOSE = 45.0  # distance from the site up to which they are detailed [m]
WAY = 0.9  # between a gate's edge and the middle of the next bush [m]
LOW, HIGH = 1.15, 1.55  # smallest and largest height of a hedge [m]


def yard_components(terrain: Terrain, prefix: str, homesteads: tuple[Homestead, ...], first_id: int) -> list[Component]:
    """Build drives, yards, patios, garages and woodpiles.

    Args:
        terrain: The terrain.
        prefix: Put before the names of the components.
        homesteads: The homesteads.
        first_id: Instance id of the first component.

    Returns:
        Components: for each homestead one of each surface, and of its garage's walls, roof and door, and its woodpile.
    """
    components: list[Component] = []
    for number, home in enumerate(homesteads):
        paths: dict[str, list[Mesh]] = {home.plan.surface: [_drive(terrain, home)]}
        for area, role in home.plan.yards:
            paths.setdefault(role, []).append(paved(terrain, (*home.origin.tolist(), home.turn), area))
        pieces = [(f"Yard_{role}", "ground", role, "Yards", merged(meshes)) for role, meshes in paths.items()]
        for shed in home.plan.sheds:
            pieces += _garage(terrain, home, shed)
        for name, kind, role, group, mesh in pieces:
            prim = f"{prefix}_Home_{number:02d}_{name}"
            components.append(Component(prim, kind, role, group, mesh, first_id + len(components)))
    return components


def garden_runs(
    terrain: Terrain, prefix: str, homesteads: tuple[Homestead, ...], rng: np.random.Generator, first_id: int
) -> list[Scatter]:
    """Enclose gardens with hedges or fences, open where the drive enters.

    Args:
        terrain: The terrain.
        prefix: Put before the names of the runs.
        homesteads: The homesteads.
        rng: Random stream.
        first_id: Instance id of the first run.

    Returns:
        A run of bushes and one of panels, as far as there are any.
    """
    bushes, panels = [np.zeros((0, 4))], [np.zeros((0, 4))]
    for home in homesteads:
        height = rng.uniform(LOW, HIGH)
        line = boundary(home, HEDGE_STEP if home.plan.hedged else PANEL)
        turned = np.column_stack([home.world(line[:, :2]), line[:, 2] + home.turn, np.full(len(line), height)])
        (bushes if home.plan.hedged else panels).append(turned)
    runs: list[Scatter] = []
    rows = np.concatenate(bushes)
    if len(rows):
        places = np.column_stack([rows[:, :2], ground(terrain, rows[:, :2]) - 0.06])
        away = terrain.beyond(*terrain.land.layout.alignment.locate(places))
        which = rng.integers(0, 3, len(rows)) + np.where(away > CLOSE, 3, 0)
        shapes = tuple(bush(rng, leaves) for leaves in (26, 26, 26, 9, 9, 9))
        scales = np.column_stack([np.full(len(rows), 2.5), np.full(len(rows), 1.35), rows[:, 3] * 1.15])
        scales = scales * rng.uniform(0.92, 1.08, (len(rows), 3))
        half_turns = rows[:, 2] + np.pi * rng.integers(0, 2, len(rows))
        name, ids = f"{prefix}_GardenHedges", (first_id,)
        runs.append(Scatter(name, "shrub", "Plants", shapes, which.astype(np.int32), places, half_turns, scales, ids))
    rows = np.concatenate(panels)
    if len(rows):
        places = np.column_stack([rows[:, :2], ground(terrain, rows[:, :2])])
        which, scales = np.zeros(len(rows), np.int32), np.ones((len(rows), 3))
        name, ids = f"{prefix}_GardenFences", (first_id + len(runs),)
        runs.append(Scatter(name, "fence", "Plants", (fence_panel(0.0),), which, places, rows[:, 2], scales, ids))
    return runs


def boundary(home: Homestead, step: float) -> F64:
    """List places along the border of a lot, without those of its gate.

    Args:
        home: The homestead.
        step: Distance between places [m]; one of `PANEL` gives the first ends of panels, a shorter one middles.

    Returns:
        Local x and y [m], and direction of the border [rad], shape (N, 3), float64.
    """
    wide, deep = home.plan.size
    corners = np.array([[-wide / 2, 0.0], [wide / 2, 0.0], [wide / 2, deep], [-wide / 2, deep], [-wide / 2, 0.0]])
    rows = []
    for number, (start, stop) in enumerate(pairwise(corners)):
        length = float(np.hypot(*(stop - start)))
        at = np.arange(round(length / step)) * step + (0.0 if step == PANEL else 0.5 * step)
        heading = number * np.pi / 2
        place = start + at[:, None] * np.array([np.cos(heading), np.sin(heading)])
        if number == 0:
            middle = place[:, 0] + (PANEL / 2 if step == PANEL else 0.0)
            shut = np.abs(middle - home.plan.drive[0]) > (PANEL / 2 if step == PANEL else DRIVE + WAY)
            place = place[shut]
        rows.append(np.column_stack([place, np.full(len(place), heading)]))
    return np.concatenate(rows)


def _drive(terrain: Terrain, home: Homestead) -> Mesh:
    """Lay the drive, its first end under the road's edge."""
    start, stop = home.driveway()
    ahead = (stop - start) / np.hypot(*(stop - start))
    path = resampled(np.stack([start - UNDER * ahead, stop + 0.4 * ahead]))
    return laid(terrain, path, DRIVE, float(home.joint[2]) - 0.03, 0.9)[0]


def _garage(terrain: Terrain, home: Homestead, shed: tuple[float, float]) -> list[tuple[str, str, str, str, Mesh]]:
    """Build a garage with its door towards the road, and a stack of wood behind it."""
    half = np.array([[a * SHED[0], b * SHED[1]] for a in (-1, 1) for b in (-1, 1)])
    height = ground(terrain, home.world(np.array([shed]) + half))
    x, y = home.world(np.array([shed]))[0]
    floor, foot = float(height.max()) + 0.08, float(height.min()) - 0.4
    frame = Frame(float(x), float(y), floor, home.turn + np.pi / 2)  # its ridge points away from the road
    walls = gabled_walls(frame, (SHED[1], SHED[0]), (foot - floor, 2.4, 3.3))
    roof = roof_slab(frame, (SHED[1] + 0.2, SHED[0] + 0.25), 2.4 - 0.25 * 0.9 / SHED[0], 3.3, 0.12)
    door = box(frame, (-SHED[1], 0.0, 1.05), (0.05, 1.25, 1.05))
    role = "timber" if home.plan.surface == "gravel" else "plaster"
    pile = box(frame, (SHED[1] + 0.45, 0.0, 0.45 * (foot - floor) + 0.6), (0.38, 1.5, 0.7 - 0.5 * (foot - floor)))
    shapes = (
        ("ShedWalls", "building", role, walls),
        ("ShedRoof", "roof", "roof_tile", roof),
        ("ShedDoor", "building", "painted_metal", door),
        ("Woodpile", "building", "timber", pile),
    )
    return [(name, kind, role, "Buildings", mesh) for name, kind, role, mesh in shapes]
