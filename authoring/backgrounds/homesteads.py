"""Plans of homesteads: house or farm, drive, yard and garden as rectangles of a lot beside a road."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.buildings import House, draw_house
from authoring.backgrounds.byways import ground, located, resampled
from authoring.backgrounds.terrain import Terrain

F64 = NDArray[np.float64]
Box = tuple[float, float, float, float]

PANEL = 3.0  # length of a fence's panel; lots are multiples of it [m]
DRIVE = 1.3  # half the width of a drive, within one panel [m]
STEEPEST = 1.6  # largest height difference under a building [m]
LOT = 5.5  # largest height difference within a lot [m]
GRADE = 0.18  # largest grade of a drive [1]
SHED = (1.9, 3.1)  # half the width and length of a garage [m]


@dataclass(frozen=True)
class Plan:
    """A homestead in its own frame: x along the road, y away from it, the origin in the middle of the lot's front.

    Attributes:
        size: Width along the road and depth of the lot [m].
        drive: x of the drive's middle, y of its end [m].
        houses: Buildings with x, y of their middle [m] and the turn of their ridge [rad].
        sheds: x and y of garages [m], their doors towards the road.
        yards: Lowest and highest x, lowest and highest y of yards [m], with their material recipe.
        trees: x and y of garden trees [m].
        hedged: It has a hedge around it, not a fence.
        surface: Material recipe of drive and yard.
    """

    size: tuple[float, float]
    drive: tuple[float, float]
    houses: tuple[tuple[House, float, float, float], ...]
    sheds: tuple[tuple[float, float], ...]
    yards: tuple[tuple[Box, str], ...]
    trees: tuple[tuple[float, float], ...]
    hedged: bool
    surface: str


@dataclass(frozen=True, eq=False)
class Homestead:
    """A homestead on the land.

    Attributes:
        plan: Its plan.
        origin: World position of the middle of the lot's front [m], shape (2,), float64.
        turn: Direction of its x axis [rad].
        joint: World position of the road's edge where the drive begins [m], shape (3,), float64.
        houses: Its buildings, in bridge coordinates.
    """

    plan: Plan
    origin: F64
    turn: float
    joint: F64
    houses: tuple[House, ...]

    def world(self, local: F64) -> F64:
        """Place local positions in the world.

        Args:
            local: Local x and y [m], shape (N, 2), float64.

        Returns:
            World positions in plan [m], shape (N, 2), float64.
        """
        cosine, sine = np.cos(self.turn), np.sin(self.turn)
        return self.origin + local @ np.array([[cosine, sine], [-sine, cosine]])

    def local(self, world: F64) -> F64:
        """Convert world positions to local ones.

        Args:
            world: World positions in plan [m], shape (N, 2), float64.

        Returns:
            Local x and y [m], shape (N, 2), float64.
        """
        cosine, sine = np.cos(self.turn), np.sin(self.turn)
        return (world - self.origin) @ np.array([[cosine, -sine], [sine, cosine]])

    def row(self, margin: float = 0.0) -> F64:
        """Return the lot as a rectangle.

        Args:
            margin: Added on every side [m].

        Returns:
            Middle [m], turn [rad] and half sizes [m], shape (5,), float64.
        """
        wide, deep = self.plan.size
        middle = self.world(np.array([[0.0, deep / 2]]))[0]
        return np.array([*middle, self.turn, wide / 2 + margin, deep / 2 + margin])

    def inside(self, world: F64) -> F64:
        """Compute the depth of positions within the lot.

        Args:
            world: World positions in plan [m], shape (N, 2), float64.

        Returns:
            Distances to its border, negative outside [m], shape (N,), float64.
        """
        wide, deep = self.plan.size
        x, y = self.local(world).T
        return np.minimum(wide / 2 - np.abs(x), deep / 2 - np.abs(y - deep / 2))

    def driveway(self) -> F64:
        """Return the ends of the drive's middle line in plan, from the road's edge on [m], shape (2, 2), float64."""
        return np.concatenate([self.joint[None, :2], self.world(np.array([self.plan.drive]))])


def draw_cottage(rng: np.random.Generator) -> Plan:
    """Draw a house in a garden: a drive along one side to a garage, a yard between, a patio behind the house.

    Args:
        rng: Random stream.

    Returns:
        The plan.
    """
    wide, deep = PANEL * rng.integers(8, 11), PANEL * rng.integers(10, 13)
    side = float(rng.choice((-1.0, 1.0)))
    house = draw_house(False, rng)
    across = rng.random() < 0.35  # its gable faces the road
    hx, hy = (house.width / 2, house.length / 2) if across else (house.length / 2, house.width / 2)
    x, y = -1.75 * side, rng.uniform(5.0, 7.0) + hy
    drive = side * (wide / 2 - 1.5 * PANEL)
    garage = min(y + hy + rng.uniform(0.0, 3.0) + SHED[1], deep - SHED[1] - 1.5)
    inner, outer = sorted((x + side * (hx + 0.3), drive + side * DRIVE))
    surface = str(rng.choice(("gravel", "gravel", "asphalt", "pavement")))
    yards = [((inner, outer, y - hy - 1.4, garage - SHED[1]), surface)]
    yards.append(((x - 2.6, x + 2.6, y + hy + 0.3, y + hy + rng.uniform(3.2, 4.4)), "pavement"))
    back = np.column_stack([rng.uniform(-wide / 2 + 3.0, wide / 2 - 3.0, 9), rng.uniform(y + hy + 6.5, deep - 2.5, 9)])
    back = back[np.hypot(back[:, 0] - drive, back[:, 1] - garage) > 6.5]
    trees = [*_apart(back, 5.0)[: int(rng.integers(2, 5))], np.array([-side * (wide / 2 - 2.6), 2.8])]
    return Plan(
        (float(wide), float(deep)),
        (float(drive), float(garage - SHED[1])),
        ((house, float(x), float(y), np.pi / 2 if across else 0.0),),
        ((float(drive), float(garage)),),
        tuple(yards),
        tuple((float(a), float(b)) for a, b in trees),
        bool(rng.random() < 0.62),
        surface,
    )


def draw_farm(rng: np.random.Generator) -> Plan:
    """Draw a farm: house and barn on both sides of a yard, an orchard in rows behind the house.

    Args:
        rng: Random stream.

    Returns:
        The plan.
    """
    wide, deep = PANEL * (2 * rng.integers(7, 9) + 1), PANEL * rng.integers(14, 17)
    side = float(rng.choice((-1.0, 1.0)))
    house, barn = draw_house(False, rng), draw_house(True, rng)
    hx, hy = house.width / 2, house.length / 2
    x, y = -side * (wide / 2 - 4.5 - hx), rng.uniform(6.0, 8.0) + hy
    bx, by = side * (wide / 2 - 3.5 - barn.width / 2), rng.uniform(7.0, 9.0) + barn.length / 2
    surface = str(rng.choice(("gravel", "gravel", "asphalt")))
    inner, outer = sorted((x + side * (hx + 0.3), bx - side * (barn.width / 2 + 0.2)))
    end = by + barn.length / 2 + 2.0
    shed = (bx + side * 1.5, end + SHED[1] + 1.5)
    yards = [((inner, outer, 5.0, end), surface)]
    yards.append(((x - hx, x + hx, y + hy + 0.3, y + hy + 3.6), "pavement"))
    columns = x + side * (3.0 - 6.5 * np.arange(3.0))
    rows = np.arange(y + hy + 8.0, deep - 2.5, 6.5)
    trees = [(float(a), float(b)) for b in rows for a in columns if abs(a) < wide / 2 - 2.5]
    return Plan(
        (float(wide), float(deep)),
        (0.0, float(min(end - 2.0, deep - 6.0))),
        ((house, float(x), float(y), np.pi / 2), (barn, float(bx), float(by), np.pi / 2)),
        ((float(shed[0]), float(min(shed[1], deep - SHED[1] - 1.0))),),
        tuple(yards),
        tuple(trees),
        bool(rng.random() < 0.35),
        surface,
    )


def facing(plan: Plan, front: F64, verge: float) -> Homestead:
    """Turn a plan towards a road, so that its drive meets the road at a right angle; its houses have no place yet.

    Args:
        plan: The plan.
        front: Position of the road's edge [m] and unit vector away from it [1], shape (5,), float64.
        verge: Distance from that edge to the lot [m].

    Returns:
        The homestead.
    """
    out = front[3:]
    ahead = np.array([out[1], -out[0]])  # so that y points away from the road
    origin = front[:2] + verge * out - plan.drive[0] * ahead
    return Homestead(plan, origin, float(np.arctan2(ahead[1], ahead[0])), front[:3], ())


def settle(terrain: Terrain, home: Homestead) -> Homestead | None:
    """Find the places of the houses of a homestead.

    Args:
        terrain: The terrain.
        home: The homestead, turned towards its road.

    Returns:
        The homestead, or None where the ground is too steep.
    """
    wide, deep = home.plan.size
    grid = np.stack(np.meshgrid(np.linspace(-wide / 2, wide / 2, 4), np.linspace(0.0, deep, 4)), -1).reshape(-1, 2)
    drive = resampled(home.driveway(), 2.0)
    height = ground(terrain, np.concatenate([home.world(grid), drive]))
    if np.ptp(height[: len(grid)]) > LOT or np.abs(np.gradient(height[len(grid) :])).max() > 2.0 * GRADE:
        return None
    houses = [_standing(terrain, home, *row) for row in home.plan.houses]
    kept = tuple(house for house in houses if house is not None)
    return replace(home, houses=kept) if len(kept) == len(houses) else None


def _standing(terrain: Terrain, found: Homestead, house: House, x: float, y: float, turn: float) -> House | None:
    """Find the place of a building in bridge coordinates and the heights of its floor and foot."""
    cosine, sine = np.cos(turn), np.sin(turn)
    rim = np.array([[a * house.length / 2, b * house.width / 2] for a in (-1, 0, 1) for b in (-1, 0, 1)])
    local = np.array([x, y]) + rim @ np.array([[cosine, sine], [-sine, cosine]])
    height = ground(terrain, found.world(local))
    if np.ptp(height) > STEEPEST:
        return None
    station, left = (float(value[0]) for value in located(terrain, found.world(np.array([[x, y]]))))
    heading = found.turn + turn - terrain.land.layout.alignment.frame_at(station, left).heading
    floor, foot = np.round([height.mean() + 0.15, height.min() - 0.4], 3).tolist()
    return replace(house, station=station, left=left, heading=float(heading), floor=floor, foot=foot)


def _apart(places: F64, gap: float) -> list[F64]:
    """Keep the places that are no closer to an earlier one than a gap."""
    kept: list[F64] = []
    for place in places:
        if all(np.hypot(*(place - other)) > gap for other in kept):
            kept.append(place)
    return kept
