"""Vehicles of a town: parked along kerbs and on lots, and driving on streets and through roads."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.backgrounds.kerbs import Spots, joined, kerbside, scatter
from authoring.backgrounds.pavements import KERB
from authoring.backgrounds.streets import Block, TownPlan
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.vehicles import CARS, LENGTHS, vehicle_models
from authoring.shapes.component import Scatter
from authoring.site.covers import to_world

F64 = NDArray[np.float64]


def traffic(plan: TownPlan, terrain: Terrain, lots: list[Block], count: int, rng: np.random.Generator) -> list[Scatter]:
    """Place parked vehicles along kerbs and on lots, and driving ones on streets and through roads.

    Args:
        plan: The town.
        terrain: The terrain.
        lots: Parking lots in grid coordinates.
        count: Largest number of vehicles.
        rng: Random stream.

    Returns:
        A run of parked and one of driving vehicles, each vehicle with a separate id.
    """
    models = vehicle_models()
    kerbs = kerbside(plan, -1.15, 6.3, 12.0, 380.0)
    kerbs = kerbs.only(rng.uniform(size=len(kerbs.yaw)) < 0.55)
    parked = joined([Spots(kerbs.places, kerbs.yaw - np.pi / 2), *(_rows(plan, lot, rng) for lot in lots)])
    driving = joined([_on_streets(plan, rng), *_on_ways(terrain, rng)])
    runs = []
    for name, spots, share, kinds in (
        ("Parked", parked, 0.62, ("saloon", "estate", "van")),
        ("Driving", driving, 0.38, tuple(kind for kind, _ in CARS)),
    ):
        away = plan.land.look(plan.land.away, spots.places[:, :2], 1e4)
        order = np.argsort(away * rng.uniform(0.7, 1.3, len(away)), kind="stable")[: int(share * count)]
        fitting = [number for number, (kind, _) in enumerate(models) if kind in kinds]
        weight = np.array([1.0 if LENGTHS[models[number][0]] < 5.0 else 0.35 for number in fitting])
        which = rng.choice(fitting, len(order), p=weight / weight.sum()).astype(np.float64)
        chosen = Spots(spots.places[order], spots.yaw[order] + rng.normal(0.0, 0.012, len(order)))
        runs += scatter(name, "vehicle", "Vehicles", tuple(model for _, model in models), which, chosen, single=False)
    return runs


def _rows(plan: TownPlan, lot: Block, rng: np.random.Generator) -> Spots:
    """Fill about two thirds of a parking lot's spaces."""
    along = np.arange(lot.low[0] + 2.0, lot.high[0] - 2.0, 2.7)
    rows, turns = [np.zeros((0, 2))], [np.zeros(0)]
    for number, across in enumerate(np.arange(lot.low[1] + 3.2, lot.high[1] - 3.0, 8.4)):
        rows.append(np.column_stack([along, np.full(len(along), across)]))
        turns.append(np.full(len(along), np.pi / 2 * (-1) ** number))
    world = plan.to_world(np.concatenate(rows))
    keep = (rng.uniform(size=len(world)) < 0.65) & (plan.land.room(world) > 3.5)
    level = plan.land.ground(world) + KERB + 0.03
    return Spots(np.column_stack([world, level]), np.concatenate(turns) + plan.heading).only(keep)


def _on_streets(plan: TownPlan, rng: np.random.Generator) -> Spots:
    """Place vehicles to the right of the streets' center lines."""
    rows, turns = [np.zeros((0, 2))], [np.zeros(0)]
    for street in plan.streets:
        for sign in (-1.0, 1.0):
            along = np.cumsum(rng.uniform(16.0, 70.0, int(2 * plan.reach / 43.0))) - plan.reach
            lane = np.full(len(along), street.middle - sign * 0.15 * street.width)
            rows.append(
                np.column_stack([along, lane] if street.axis == 0 else [lane + 0.3 * sign * street.width, along])
            )
            turns.append(np.full(len(along), (0.0 if street.axis == 0 else np.pi / 2) + (np.pi if sign < 0 else 0.0)))
    world = plan.to_world(np.concatenate(rows))
    spots = Spots(np.column_stack([world, plan.land.ground(world)]), np.concatenate(turns) + plan.heading)
    return spots.only((plan.land.room(world) > 7.0) & (plan.land.look(plan.land.away, world, 1e4) < 420.0))


def _on_ways(terrain: Terrain, rng: np.random.Generator) -> list[Spots]:
    """Place vehicles on the approach roads and on a crossing road, outside the site."""
    land, axis, found = terrain.land, terrain.land.layout.alignment, []
    first, last, low, high = terrain.inner
    if land.layout.track is None:
        for approach, border in ((land.approaches[0], first), (land.approaches[1], last)):
            for lane in (-1.0, 1.0):
                station = border + approach.sign * (8.0 + np.cumsum(rng.uniform(18.0, 75.0, 8)))
                left = approach.center(station) - lane * 0.45 * approach.half_width
                level = np.maximum(
                    approach.level(land.layout, terrain.hills, station), terrain.height(station, left) + 0.05
                )
                found.append(_heading(axis, np.column_stack([station, left, level]), approach.center, 0, lane))
    if land.crossing.kind == "road":
        for lane in (-1.0, 1.0):
            for border, sign in ((low, -1.0), (high, 1.0)):
                left = border + sign * (8.0 + np.cumsum(rng.uniform(18.0, 75.0, 7)))
                station = land.crossing.center(left) + lane * 0.45 * land.crossing.half_width
                level = np.maximum(np.full(len(left), land.crossing.level), terrain.height(station, left) + 0.05)
                found.append(_heading(axis, np.column_stack([station, left, level]), land.crossing.center, 1, lane))
    return found


def _heading(axis: Alignment, rows: F64, center: Callable[[F64], F64], along: int, lane: float) -> Spots:
    """Align vehicles with a line that curves about one coordinate."""
    ahead = rows.copy()
    ahead[:, along] += 2.0
    ahead[:, 1 - along] += center(ahead[:, along]) - center(rows[:, along])
    one, other = to_world(axis, rows), to_world(axis, ahead)
    turn = np.arctan2(other[:, 1] - one[:, 1], other[:, 0] - one[:, 0])
    return Spots(one, turn + (np.pi if lane < 0 else 0.0))
