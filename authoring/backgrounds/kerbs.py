"""Places along a town's kerbs and roads, with directions, and runs of models placed there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.pavements import KERB
from authoring.backgrounds.streets import KERB_GAP, TownPlan
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world

F64 = NDArray[np.float64]
Models = tuple[tuple[tuple[str, Mesh], ...], ...]


@dataclass(frozen=True)
class Spots:
    """Places with directions.

    Attributes:
        places: World positions [m], shape (N, 3), float64.
        yaw: Direction of local x, counter-clockwise from +x [rad], shape (N,), float64.
    """

    places: F64
    yaw: F64

    def only(self, chosen: NDArray[np.bool_]) -> "Spots":
        """Keep some of the places.

        Args:
            chosen: Whether each is kept, shape (N,), bool.
        """
        return Spots(self.places[chosen], self.yaw[chosen])


def joined(parts: list[Spots]) -> Spots:
    """Put places into one list.

    Args:
        parts: Lists of places.
    """
    return Spots(
        np.concatenate([np.zeros((0, 3)), *(part.places for part in parts)]),
        np.concatenate([np.zeros(0), *(part.yaw for part in parts)]),
    )


def scatter(
    name: str, kind: str, group: str, models: Models, which: F64 | int, spots: Spots, *, single: bool = True
) -> list[Scatter]:
    """Place models as one run; none if there is no place.

    Args:
        name: Ending of the prim name.
        kind: Component kind.
        group: Name of its parent Xform.
        models: The models.
        which: Number of the model of each place [1], shape (N,), float64, or one for all.
        spots: Places.
        single: Whether the run has one instance id, instead of one for each repeat.

    Returns:
        The run, to be numbered by its caller, or an empty list.
    """
    count = len(spots.places)
    if count == 0:
        return []
    chosen = np.full(count, which, np.int32) if isinstance(which, int) else which.astype(np.int32)
    ids = (0,) if single else tuple(range(count))
    return [Scatter(f"City_{name}", kind, group, models, chosen, spots.places, spots.yaw, np.ones((count, 3)), ids)]


def kerbside(plan: TownPlan, inside: float, step: float, corner: float, within: float) -> Spots:
    """List places along the curbs of all blocks.

    Args:
        plan: The town.
        inside: Distance from the kerb into the block; negative on the street [m].
        step: Distance between places [m].
        corner: Distance to keep from the corners [m].
        within: Largest distance to the site [m].

    Returns:
        Places on the ground, with local x towards the street.
    """
    rows, turns = [np.zeros((0, 2))], [np.zeros(0)]
    for block in plan.blocks:
        for axis, sign in ((0, -1.0), (1, 1.0), (0, 1.0), (1, -1.0)):
            line = np.arange(block.low[axis] + corner, block.high[axis] - corner, step)
            edge = block.low[1 - axis] if sign < 0 else block.high[1 - axis]
            other = np.full(len(line), edge - sign * inside)
            rows.append(np.column_stack([line, other] if axis == 0 else [other, line]))
            outward = sign * (np.pi / 2 if axis == 0 else 0.0) + (np.pi if axis == 1 and sign < 0 else 0.0)
            turns.append(np.full(len(line), outward if axis == 0 else (0.0 if sign > 0 else np.pi)))
    plan_spots = plan.to_world(np.concatenate(rows))
    height = plan.land.ground(plan_spots) + (KERB if inside > 0 else 0.0)
    spots = Spots(np.column_stack([plan_spots, height]), np.concatenate(turns) + plan.heading)
    keep = plan.land.room(plan_spots) > max(inside, 0.6)
    return spots.only(keep & (plan.land.look(plan.land.away, plan_spots, 1e4) < within))


def beside_approaches(plan: TownPlan, terrain: Terrain, gap: float, step: float) -> list[Spots]:
    """List places along both sides of the approach roads where they are level with the town.

    Args:
        plan: The town.
        terrain: The terrain.
        gap: Distance from the asphalt [m].
        step: Distance between places [m].

    Returns:
        Places on the pavement, with local x towards the road.
    """
    land, found = terrain.land, []
    for approach, border in zip(land.approaches, terrain.inner[:2], strict=True):
        for side in (-1.0, 1.0):
            station = border + approach.sign * np.arange(16.0, 330.0, step)
            left = approach.center(station) + side * (approach.half_width + gap) * approach.stretch(station)
            world = to_world(land.layout.alignment, np.column_stack([station, left, np.zeros(len(station))]))
            world[:, 2] = plan.land.ground(world[:, :2]) + KERB
            turn = land.layout.alignment.heading_at(station) - side * np.pi / 2
            room = plan.land.room(world[:, :2])
            found.append(Spots(world, turn).only((room > gap - KERB_GAP - 0.4) & (room < 4.0)))
    return found
