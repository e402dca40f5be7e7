"""Car parks of a city on the plots of a site: straight rectangles, each with a drive to a street of the town."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from authoring.backgrounds.byways import laid, located, resampled
from authoring.backgrounds.car_parks import (
    AISLE,
    BAY,
    DEEP,
    KERB_WIDE,
    MODULE,
    Lot,
    bay_lines,
    bay_spots,
    graded,
    kerb_mesh,
    painted,
    surface_mesh,
)
from authoring.backgrounds.kerbs import Spots, joined
from authoring.backgrounds.quads import quad_mesh
from authoring.backgrounds.streets import TownPlan, beside_ways
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world
from authoring.site.fields import Plots
from authoring.site.grid import HeightField
from authoring.site.land import no_hills
from authoring.site.site import Site

F64 = NDArray[np.float64]
Piece = tuple[str, str, str, str, Mesh]

GROUP = "Lots"  # the only group of a city whose pieces lie on the site
PAVED = ("ploughed", "ripe", "hay", "lot_asphalt", "lot_paved", "lot_gravel")  # plots that may become car parks
MOST = 2  # car parks on a site
DEPTHS = (2 * MODULE + 0.6, MODULE + 0.6, DEEP + AISLE + 0.6)  # of lots [m]
COUNTS = (8, 26)  # fewest and most bays in a row
FLAT = 0.07  # largest slope of the ground under a lot [1]
EDGE = 1.0  # from the border of a plot to a kerb [m]
STEP = 1.5  # spacing of the places at which free ground is looked for [m]
HALF, BESIDE = 2.8, 0.9  # half the width of a drive, and from its edge to the middle of trees and lamps [m]
LANE, MOUTH = 4.6, 13.0  # distances from the site at which a drive turns, and at which it has reached its street [m]
LONGEST = 200.0  # of drives, along the border of the site [m]
CARS_AWAY = 16.0  # of cars from the edge of the deck: drones fly nearer than that, as low as a car is high [m]
PAST = 120.0  # distance past the ends of the site up to which streets are looked for [m]
_BEND = 9  # steps over which the corners of a drive are rounded


@dataclass(frozen=True, eq=False)
class SiteLots:
    """Car parks on a site.

    Attributes:
        pieces: Name, component kind, material recipe, group and mesh of each part.
        spots: The places of cars, in the bays that lie far enough from the deck.
        drives: Places along the middles of drives in plan [m], shape (N, 2), float64.
    """

    pieces: list[Piece]
    spots: Spots
    drives: F64

    def clear(self, run: Scatter) -> Scatter | None:
        """Take away repeats that stand on drives; None where nothing is left.

        Args:
            run: Trees, lamps and the like.
        """
        if not len(self.drives):
            return run
        near, _ = KDTree(self.drives).query(run.positions[:, :2])
        kept = near > HALF + BESIDE
        ids = run.instance_ids[: int(kept.sum())] if len(run.instance_ids) == len(kept) else run.instance_ids
        if kept.all() or not kept.any():
            return run if kept.all() else None
        rows = (run.positions[kept], run.yaw[kept], run.scales[kept])
        return replace(
            run, prototype=run.prototype[kept], positions=rows[0], yaw=rows[1], scales=rows[2], instance_ids=ids
        )


def find_lots(site: Site) -> tuple[Lot, ...]:
    """Find the rectangles for car parks: the largest on the plots of quarters with a cover in `PAVED`.

    The result depends on the site alone, so that `build_city` and `change_site` find the same car parks.

    Args:
        site: The site.

    Returns:
        At most `MOST`, at most one in each quarter: before or behind the crossing, left or right of the bridge.
    """
    plots = site.land.plots
    if plots is None:
        return ()
    found = []
    for quarter in range(4):
        if any(cover in PAVED for cover in plots.covers[2 * quarter : 2 * quarter + 2]):
            lot = _largest(site, plots, behind=quarter >= 2, side=1.0 if quarter % 2 else -1.0)
            found += [] if lot is None else [lot]
    return tuple(sorted(found, key=lambda lot: -lot.size[0] * lot.size[1])[:MOST])


def covered_by(lots: tuple[Lot, ...], places: F64) -> NDArray[np.bool_]:
    """Find which places lie on lots, or between them and the border of the site, where their drives may lie.

    Args:
        lots: The lots.
        places: World positions in plan [m], shape (N, 2), float64.

    Returns:
        Whether they do, shape (N,), bool.
    """
    inside = np.zeros(len(places), bool)
    for lot in lots:
        x, y = lot.local(places).T
        inside |= (x > -1.0) & (x < lot.size[0] + 1.0) & (y > -1.0)
    return inside


def build_lots(lots: tuple[Lot, ...], terrain: Terrain, plan: TownPlan) -> SiteLots:
    """Build the car parks that a drive connects to a street of the town.

    Args:
        lots: The rectangles.
        terrain: The terrain.
        plan: The town.
    """
    pieces: list[Piece] = []
    spots: list[Spots] = []
    drives = [np.zeros((0, 2))]
    centers = _centers(terrain, plan) if lots else _Centers(())

    def ground(places: F64) -> F64:
        return terrain.height(*located(terrain, places))

    for number, whole in enumerate(lots):
        lot, path = _entered(whole, terrain, centers)
        if path is None:
            continue
        surface = graded(lot, ground)

        def level(places: F64, lot: Lot = lot, surface: HeightField = surface) -> F64:
            return surface(*lot.local(places).T)

        start = float(surface(np.linspace(*lot.entry, 4), np.full(4, lot.size[1])).min()) - 0.02
        drive, _ = laid(terrain, path, HALF, start)
        name = f"Lot_{number}"
        pieces += [
            (f"{name}_Asphalt", "road", "asphalt", GROUP, surface_mesh(lot, surface)),
            (f"{name}_Drive", "road", "asphalt", GROUP, drive),
            (f"{name}_Kerbs", "ground", "concrete", GROUP, kerb_mesh(lot, surface, ground)),
            (f"{name}_Marking", "road", "road_marking", GROUP, quad_mesh(painted(lot, bay_lines(lot), level))),
        ]
        cars = bay_spots(lot, level)
        _, left = located(terrain, cars.places[:, :2])
        spots.append(cars.only(np.abs(left) > 0.5 * terrain.land.layout.width + CARS_AWAY))
        drives.append(path)
    return SiteLots(pieces, joined(spots), np.concatenate(drives))


def _largest(site: Site, plots: Plots, *, behind: bool, side: float) -> Lot | None:
    """Find the largest rectangle on plots in `PAVED` of a quarter, its y away from the bridge, near the border."""
    land, axis = site.land, site.land.layout.alignment
    middle = float(land.crossing.center(np.array([side * 40.0]))[0])
    end = float(site.field.stations[-1 if behind else 0])
    station = 0.5 * (middle + end)
    heading = float(axis.heading_at(np.array([station]))[0]) + (0.0 if side > 0.0 else np.pi)
    (corner,) = to_world(axis, np.array([[station, 0.0, 0.0]]))[:, :2]
    reach = abs(end - middle) + 40.0
    probe = Lot((float(corner[0]), float(corner[1])), heading, (0.0, 0.0))
    x, y = np.arange(-reach, reach, STEP), np.arange(0.0, float(np.abs(site.field.lefts).max()), STEP)
    places = probe.world(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2))
    at = site.land.layout.alignment.locate(places)
    free = land.plot_room(*at, no_hills) > EDGE
    free &= (land.steepness(*at, no_hills) < FLAT) & ((at[0] > land.crossing.center(at[1])) == behind)
    free &= (side * at[1] > 0.0) & _paved(plots, behind, *at)
    total = np.pad(np.cumsum(np.cumsum(free.reshape(len(x), len(y)), axis=0), axis=1), ((1, 0), (1, 0)))
    best = None
    for depth in DEPTHS:
        for count in range(COUNTS[1], COUNTS[0] - 1, -1):
            size = (AISLE + BAY * count + 2 * KERB_WIDE, depth)
            place = _place(total, (int(np.ceil(size[0] / STEP)) + 1, int(np.ceil(size[1] / STEP)) + 1))
            if place is not None:
                if best is None or size[0] * size[1] > best[0]:
                    best = (size[0] * size[1], size, place)
                break
    if best is None:
        return None
    _, size, (column, row) = best
    start = probe.world(np.array([x[column] + 0.5 * STEP, y[row] + 0.5 * STEP]))
    return Lot((float(start[0]), float(start[1])), heading, size)


def _paved(plots: Plots, behind: bool, station: F64, left: F64) -> NDArray[np.bool_]:
    """Find places on plots in `PAVED`, `EDGE` away from other plots; between two plots in `PAVED` there is no edge."""
    paved = np.array([cover in PAVED for cover in plots.covers])
    number = plots.number(np.full(len(left), behind), station, left)
    other = paved[number ^ 1]  # the near and the far plot of a quarter have successive numbers
    return paved[number] & (other | (plots.split_room(station, left) > EDGE))


def _place(total: NDArray[np.int64], cells: tuple[int, int]) -> tuple[int, int] | None:
    """Find the window of free cells with the highest y: its first cells, or None."""
    wide, deep = cells
    if wide >= total.shape[0] or deep >= total.shape[1]:
        return None
    inside = total[wide:, deep:] - total[:-wide, deep:] - total[wide:, :-deep] + total[:-wide, :-deep]
    at = np.argwhere(inside == wide * deep)
    if not len(at):
        return None
    column, row = at[np.argmax(at[:, 1], axis=0)]
    return int(column), int(row)


@dataclass(frozen=True, eq=False)
class _Centers:
    """Middle lines of streets near the site: world position in plan [m], station and left [m], shape (N, 4) each."""

    lines: tuple[F64, ...]


def _centers(terrain: Terrain, plan: TownPlan) -> _Centers:
    """List the middle lines of streets in steps of 1 m, as far as drives go."""
    first, last, low, high = terrain.inner
    reach = 0.5 * np.hypot(last - first, high - low) + PAST
    lines = []
    for street in plan.streets:
        row = np.full((int(2.0 * reach), 2), street.middle)
        row[:, street.axis] = np.arange(len(row)) - reach
        if abs(street.middle) < reach:
            world = plan.to_world(row)
            lines.append(np.column_stack([world, *located(terrain, world)]))
    return _Centers(tuple(lines))


def _entered(lot: Lot, terrain: Terrain, centers: _Centers) -> tuple[Lot, F64 | None]:
    """Choose the end of a lot where it is entered, and the path of its drive in plan, shape (N, 2); None without."""
    best: tuple[float, Lot, F64] | None = None
    for first in (True, False):
        turned = replace(lot, first=first)
        for line in centers.lines:
            path = _path(turned, terrain, line)
            length = np.inf if path is None else float(np.hypot(*np.diff(path, axis=0).T).sum())
            if path is not None and length < LONGEST and (best is None or length < best[0]):
                best = (length, turned, path)
    return (lot, None) if best is None else (best[1], best[2])


def _path(lot: Lot, terrain: Terrain, line: F64) -> F64 | None:
    """Draw a drive: out of a lot, along the border of the site, and into a street; None where there is no way."""
    x = float(np.mean(lot.entry))
    door = lot.world(np.array([[x, lot.size[1] - 0.5], [x, lot.size[1] + 1.5]]))
    at, aside = located(terrain, door)
    side = np.sign(aside[0])
    border = terrain.inner[3] if side > 0.0 else -terrain.inner[2]
    away = side * line[:, 3] - border
    inside = (line[:, 2] > terrain.inner[0] - PAST) & (line[:, 2] < terrain.inner[1] + PAST)
    turn, mouth = (line[inside & (np.abs(away - wanted) < 0.9), :3] for wanted in (LANE, MOUTH))
    if not len(turn) or not len(mouth) or np.hypot(*(turn[0] - mouth[0])[:2]) > 2.0 * (MOUTH - LANE):
        return None
    lane = np.column_stack([np.linspace(at[1], turn[0, 2], 24), np.full((24, 2), (side * (border + LANE), 0.0))])
    beside = to_world(terrain.land.layout.alignment, lane)[:, :2]
    path = resampled(np.concatenate([door, beside, turn[:1, :2], mouth[:1, :2]]), 1.0)
    padded = np.pad(path, ((_BEND // 2, _BEND // 2), (0, 0)), mode="edge")
    smooth = np.mean([padded[k : k + len(path)] for k in range(_BEND)], axis=0)
    smooth = np.concatenate([path[:2], smooth[2:-2], path[-2:]])
    return smooth if beside_ways(terrain, *located(terrain, smooth)).min() > HALF else None
