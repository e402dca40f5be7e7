"""The buildings of a town: lots, heights that decrease from a core, set-back tiers and facade styles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.pavements import KERB
from authoring.backgrounds.streets import Block, TownPlan

F64 = NDArray[np.float64]

GROUND_STOREY = 4.6  # height of the ground storey with its shops [m]
WALK = 3.6  # width of the pavement before the buildings [m]
CLEAR = 2.0  # distance of buildings to land that must stay empty [m]
LOWEST, TALLEST = 9.0, 180.0  # heights of buildings [m]
INSET = 0.6  # distance of walls from the border of their lot, within which piers and cornices may project [m]
CORE = 300.0  # distance from the town's core over which heights decrease [m]


@dataclass(frozen=True)
class Style:
    """A kind of facade: piers and bands in front of a glazed wall.

    Attributes:
        name: Its name.
        bay: Distance between piers [m].
        storey: Height of a storey [m].
        pier: Width of a pier and its projection [m].
        band: Height of the band at every floor and its projection [m].
        walls: Material recipes that piers and bands may have.
        bands: Material recipes of bands that are unlike the piers; empty for the piers' own.
        glass: Material recipe of the glazed wall.
        far: Material recipe of the whole facade seen from a distance.
        window: Number of the window prototype.
        heights: Least and largest height of buildings that have it [m].
    """

    name: str
    bay: float
    storey: float
    pier: tuple[float, float]
    band: tuple[float, float]
    walls: tuple[str, ...]
    bands: tuple[str, ...]
    glass: str
    far: str
    window: int
    heights: tuple[float, float]


STYLES = (
    Style(
        "punched",
        2.9,
        3.2,
        (1.45, 0.24),
        (1.5, 0.20),
        ("brick", "brick", "plaster", "brick_buff"),
        (),
        "window",
        "facade_brick",
        0,
        (0.0, 48.0),
    ),
    Style(
        "piers",
        3.4,
        3.5,
        (0.95, 0.55),
        (1.25, 0.22),
        ("limestone", "limestone", "concrete", "brick_buff"),
        ("metal_panel", ""),
        "window",
        "facade_stone",
        0,
        (22.0, 140.0),
    ),
    Style(
        "ribbon",
        4.4,
        3.5,
        (0.34, 0.10),
        (1.55, 0.26),
        ("concrete", "limestone", "metal_panel", "metal_silver"),
        (),
        "glass_facade",
        "facade_ribbon",
        1,
        (14.0, 110.0),
    ),
    Style(
        "curtain",
        3.0,
        3.7,
        (0.14, 0.16),
        (0.95, 0.05),
        ("metal_panel", "metal_silver", "metal_silver"),
        ("glass_spandrel", "glass_spandrel", "metal_silver"),
        "glass_facade",
        "facade_glass",
        2,
        (45.0, 400.0),
    ),
)


@dataclass(frozen=True)
class Tier:
    """A box of a building, in its own coordinates.

    Attributes:
        rim: Low x, high x, low y and high y [m].
        levels: Its foot and its roof above the pavement [m].
    """

    rim: tuple[float, float, float, float]
    levels: tuple[float, float]


@dataclass(frozen=True)
class Tower:
    """A building.

    Attributes:
        spot: World position of the middle of its footprint, on the pavement [m].
        heading: Direction of its own x, counter-clockwise from +x [rad].
        half: Half its footprint [m].
        tiers: Its boxes from the ground up.
        style: Its facade.
        wall: Material recipe of its piers.
        band: Material recipe of its bands.
        away: Distance to the site [m].
        block: Number of its block.
    """

    spot: tuple[float, float, float]
    heading: float
    half: tuple[float, float]
    tiers: tuple[Tier, ...]
    style: Style
    wall: str
    band: str
    away: float
    block: int

    @property
    def height(self) -> float:
        """Height of its highest roof [m]."""
        return self.tiers[-1].levels[1]


def draw_towers(
    plan: TownPlan, uses: tuple[str, ...], density: float, tallest: float, rng: np.random.Generator
) -> tuple[tuple[Tower, ...], tuple[Block, ...]]:
    """Fill the built blocks with buildings.

    Args:
        plan: The town.
        uses: Use of each block: `built`, `park` or `parking`.
        density: Share of the lots that are built on [1].
        tallest: Typical height of the towers in the town's core [m].
        rng: Random stream.

    Returns:
        Buildings that keep a distance from each other, streets and land that must stay empty; and the vacant lots.
    """
    core = rng.uniform(-1.0, 1.0, 2) * 0.4 * plan.reach
    towers, vacant = [], []
    for number, (block, use) in enumerate(zip(plan.blocks, uses, strict=True)):
        lots = _lots(block, rng) if use == "built" else []
        middle = np.array([block.low, block.high]).mean(axis=0)
        level = tallest * (0.14 + 0.86 * float(np.exp(-(np.hypot(*(middle - core)) ** 2) / CORE**2)))
        for lot in lots:
            height = level * float(np.exp(rng.normal(0.0, 0.42)))
            place = _fitted(plan, lot) if rng.uniform() < density else None
            if place is None:
                vacant.append(lot)
            else:
                towers.append(_tower(plan, place, float(np.clip(height, LOWEST, TALLEST)), number, rng))
    return tuple(towers), tuple(vacant)


def _fitted(plan: TownPlan, lot: Block) -> Block | None:
    """Find the largest part of a lot, out of a few, away from land that must stay empty."""
    (u0, v0), (u1, v1) = lot.low, lot.high
    u, v = (u0 + u1) / 2, (v0 + v1) / 2
    halves = [Block((u0, v0), (u1, v)), Block((u0, v), (u1, v1)), Block((u0, v0), (u, v1)), Block((u, v0), (u1, v1))]
    quarters = [Block((a, b), (a + u - u0, b + v - v0)) for a in (u0, u) for b in (v0, v)]
    for part in (lot, *halves, *quarters):
        roomy = min(np.subtract(part.high, part.low)) >= 9.0
        if roomy and plan.land.room(plan.to_world(part.spots(3.0))).min() >= CLEAR:
            return part
    return None


def _lots(block: Block, rng: np.random.Generator) -> list[Block]:
    """Divide a block into two rows of lots back to back."""
    (u0, v0), (u1, v1) = ((np.array(end) + sign * WALK).tolist() for end, sign in ((block.low, 1), (block.high, -1)))
    split = v0 + (v1 - v0) * float(rng.uniform(0.42, 0.58))
    lots = []
    for low, high in ((v0, split - 2.0), (split + 2.0, v1)):
        at = u0
        while u1 - at > 11.0:
            wide = float(rng.uniform(15.0, 40.0))
            end = u1 if u1 - at - wide < 15.0 else at + wide
            gap = float(rng.choice((0.7, 0.7, 1.2, 4.0)))
            if high - low > 11.0 and end - at - gap > 9.0:
                lots.append(Block((at + 0.7, low + 0.7), (end - gap, high - 0.7)))
            at = end
    return lots


def _tower(plan: TownPlan, lot: Block, height: float, number: int, rng: np.random.Generator) -> Tower:
    half = (np.array(lot.high) - np.array(lot.low)) / 2
    narrow = float(half.min()) * 2
    height = min(height, 5.5 * narrow)
    fitting = [style for style in STYLES if style.heights[0] <= height <= style.heights[1]]
    style = fitting[int(rng.integers(0, len(fitting)))]
    wall = style.walls[int(rng.integers(0, len(style.walls)))]
    band = style.bands[int(rng.integers(0, len(style.bands)))] if style.bands else ""
    storeys = max(round((height - GROUND_STOREY) / style.storey), 1)
    tiers = _tiers(half, storeys, style, rng)
    world = plan.to_world(lot.spots(3.0))
    spot = plan.to_world(np.array([lot.low, lot.high]).mean(axis=0))
    level = round(float(plan.land.ground(world).mean()) + KERB, 3)
    away = float(plan.land.look(plan.land.away, spot[None], 1e4)[0])
    place = (round(float(spot[0]), 3), round(float(spot[1]), 3), level)
    return Tower(place, plan.heading, (float(half[0]), float(half[1])), tiers, style, wall, band or wall, away, number)


def _tiers(half: F64, storeys: int, style: Style, rng: np.random.Generator) -> tuple[Tier, ...]:
    """Stack a building: one box, a tower on a podium, or steps that narrow upwards."""
    rim = (np.repeat(half, 2) - INSET) * np.array([-1.0, 1.0, -1.0, 1.0])
    drawn = rng.uniform(size=6)
    shares = [1.0]
    if storeys >= 9 and drawn[0] < 0.75:
        shares = [float(np.clip(0.12 + 0.3 * drawn[1], 2.0 / storeys, 0.5)), 1.0]
        if storeys >= 18 and drawn[2] < 0.5:
            shares = [shares[0], 0.62 + 0.24 * drawn[3], 1.0]
    tiers, foot, below = [], 0.0, 0
    for share in shares:
        top = max(round(share * storeys), below + 1)
        roof = round(GROUND_STOREY + top * style.storey, 3)
        tiers.append(Tier((float(rim[0]), float(rim[1]), float(rim[2]), float(rim[3])), (foot, roof)))
        foot, below = roof, top
        least = np.minimum(np.array([rim[1] - rim[0], rim[3] - rim[2]]) * 0.12 * (0.6 + drawn[4]), 7.0)
        shrink = np.array([least[0], -least[0], least[1], -least[1]])
        rim = np.round(rim + shrink * (1.0 if drawn[5] < 0.7 else np.array([0.2, 1.5, 1.0, 1.0])), 3)
    return tuple(tiers)
