"""Car parks that fill a block of a town: painted bays, and an entry over the pavement from the street."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.car_parks import Lot, bay_lines, bay_spots, painted
from authoring.backgrounds.kerbs import Spots, joined
from authoring.backgrounds.pavements import KERB
from authoring.backgrounds.quads import quad_mesh
from authoring.backgrounds.streets import Block, TownPlan
from authoring.backgrounds.towers import WALK
from authoring.shapes.component import Mesh

F64 = NDArray[np.float64]
Piece = tuple[str, str, str, str, Mesh]

ABOVE = 0.03  # height of the asphalt over the pavement round it [m]
ROOM = 3.5  # distance of a bay's middle to land that must stay empty, where it has lines and a car [m]
_NEAR = 420.0  # distance from the site within which bays are painted [m]
_RAMP = 0.9  # length of the ramp over the kerb [m]


def block_lots(plan: TownPlan, blocks: list[Block]) -> list[Piece]:
    """Paint the bays of car parks near the site, and build their entries.

    Args:
        plan: The town.
        blocks: Car parks in grid coordinates.

    Returns:
        Name, component kind, material recipe, group and mesh of each part.
    """
    pieces: list[Piece] = []
    for number, block in enumerate(blocks):
        lot = _lot(plan, block)
        lines = bay_lines(lot)
        world = lot.world(lines[:, :2])
        lines = lines[(plan.land.room(world) > ROOM) & (plan.land.look(plan.land.away, world, 1e4) < _NEAR)]
        if not len(lines):
            continue
        marks = painted(lot, lines, lambda places: plan.land.ground(places) + KERB + ABOVE)
        pieces.append((f"ParkingMarking_{number:03d}", "road", "road_marking", "Streets", quad_mesh(marks)))
        entry = _entry(plan, lot)
        if entry is not None:
            pieces.append((f"ParkingEntry_{number:03d}", "road", "asphalt", "Streets", quad_mesh(entry)))
    return pieces


def block_spots(plan: TownPlan, blocks: list[Block]) -> Spots:
    """List the places of cars in the bays of car parks.

    Args:
        plan: The town.
        blocks: Car parks in grid coordinates.
    """
    spots = joined(
        [bay_spots(_lot(plan, block), lambda places: plan.land.ground(places) + KERB + ABOVE) for block in blocks]
    )
    return spots.only(plan.land.room(spots.places[:, :2]) > ROOM)


def _lot(plan: TownPlan, block: Block) -> Lot:
    """Take a block as a lot whose entry is at its highest v."""
    corner = plan.to_world(np.asarray(block.low))
    return Lot(
        (float(corner[0]), float(corner[1])), plan.heading, (block.high[0] - block.low[0], block.high[1] - block.low[1])
    )


def _entry(plan: TownPlan, lot: Lot) -> F64 | None:
    """Build an entry from the street over the pavement; None where that is not free. Shape (F, 4, 3), float64."""
    (low, high), depth = lot.entry, lot.size[1]
    at = np.array([depth - 0.2, depth + WALK - 0.3, depth + WALK + _RAMP])
    above = np.array([KERB + ABOVE + 0.01, KERB + ABOVE + 0.01, 0.02])
    nodes = np.stack(np.meshgrid([low + 0.2, high - 0.2], at, indexing="ij"), axis=-1)
    world = lot.world(nodes)
    flat = world.reshape(-1, 2)
    if plan.land.room(flat).min() < 1.0:
        return None
    points = np.concatenate([world, (plan.land.ground(flat).reshape(2, 3) + above)[..., None]], axis=-1)
    tops = [(points[0, k], points[1, k], points[1, k + 1], points[0, k + 1]) for k in range(2)]
    down = np.array([0.0, 0.0, KERB + 0.3])
    sides = [
        (points[side, end] - down, points[side, start] - down, points[side, start], points[side, end])
        for k in range(2)
        for side, start, end in ((0, k, k + 1), (1, k + 1, k))  # both face outwards
    ]
    return np.array([*tops, *sides])
