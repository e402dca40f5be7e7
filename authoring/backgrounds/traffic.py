"""Vehicles of a town: parked along kerbs and on lots, and driving on streets and through roads."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.backgrounds.kerbs import Spots, joined, kerbside, scatter
from authoring.backgrounds.site_lots import GROUP as LOTS
from authoring.backgrounds.streets import TownPlan
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.vehicles import CARS, LENGTHS, vehicle_models
from authoring.shapes.component import Scatter
from authoring.site.covers import to_world

F64 = NDArray[np.float64]
FULL = (0.6, 0.45)  # shares of the bays with a car, in the town and on the site [1]


def traffic(
    plan: TownPlan, terrain: Terrain, bays: tuple[Spots, Spots], count: int, rng: np.random.Generator
) -> list[Scatter]:
    """Place parked vehicles along kerbs and in bays, and driving ones on streets and through roads.

    Args:
        plan: The town.
        terrain: The terrain.
        bays: Bays of car parks in the town, and of those on the site.
        count: Largest number of vehicles.
        rng: Random stream.

    Returns:
        Runs of parked and of driving vehicles, each vehicle with a separate id; those on the site have their own group.
    """
    models = vehicle_models()
    kerbs = kerbside(plan, -1.15, 6.3, 12.0, 380.0)
    kerbs = kerbs.only(rng.uniform(size=len(kerbs.yaw)) < 0.55)
    inner, outer = (
        spots.only(rng.uniform(size=len(spots.yaw)) < share) for spots, share in zip(bays, FULL, strict=True)
    )
    parked = joined([Spots(kerbs.places, kerbs.yaw - np.pi / 2), inner])
    driving = joined([_on_streets(plan, rng), *_on_ways(terrain, rng)])
    runs = []
    for name, group, spots, share, kinds in (
        ("Parked", "Vehicles", parked, 0.47, ("saloon", "estate", "van")),
        ("Driving", "Vehicles", driving, 0.33, tuple(kind for kind, _ in CARS)),
        ("Visiting", LOTS, outer, 0.2, ("saloon", "estate")),
    ):
        away = plan.land.look(plan.land.away, spots.places[:, :2], 1e4)
        order = np.argsort((away + 1.0) * rng.uniform(0.7, 1.3, len(away)), kind="stable")[: int(share * count)]
        fitting = [number for number, (kind, _) in enumerate(models) if kind in kinds]
        weight = np.array([1.0 if LENGTHS[models[number][0]] < 5.0 else 0.35 for number in fitting])
        which = rng.choice(fitting, len(order), p=weight / weight.sum()).astype(np.float64)
        chosen = Spots(spots.places[order], spots.yaw[order] + rng.normal(0.0, 0.012, len(order)))
        runs += scatter(name, "vehicle", group, tuple(model for _, model in models), which, chosen, single=False)
    return runs


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
    """Align vehicles with a line along one coordinate, whose other coordinate is a function of it."""
    ahead = rows.copy()
    ahead[:, along] += 2.0
    ahead[:, 1 - along] += center(ahead[:, along]) - center(rows[:, along])
    one, other = to_world(axis, rows), to_world(axis, ahead)
    turn = np.arctan2(other[:, 1] - one[:, 1], other[:, 0] - one[:, 0])
    return Spots(one, turn + (np.pi if lane < 0 else 0.0))
