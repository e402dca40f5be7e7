"""The land of the background `hillside`: a harbour on flat land before the sea, a built slope, mountains behind."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.erosion import draw_gullies, eroded
from authoring.backgrounds.lakeside_land import draw_crests, draw_spurs
from authoring.backgrounds.terrain import Cell, distance_beyond
from authoring.backgrounds.waters import Basin, water_level, with_shore
from authoring.site.land import FIRST_STEP
from authoring.site.relief import draw_relief, smoothstep
from authoring.site.shape import Hills, Land

F64 = NDArray[np.float64]

FOOT = 96.0  # distance from the axis at which the slope begins [m]
SHORES = (275.0, 340.0)  # distance of the quay from the axis, if the site reaches 80 m to the left [m]
QUAY = 420.0  # length of the quay on each side of the bridge's middle [m]
BUILT = 560.0  # distance from the axis up to which the slope is even enough to build on [m]


def draw_sea(land: Land, inner: Cell, rng: np.random.Generator) -> Basin:
    """Draw a sea on one side of the axis.

    Args:
        land: The land.
        inner: Lowest and highest station, lowest and highest left of the site [m].
        rng: Random stream.

    Returns:
        The sea, without a far shore.
    """
    side = float(rng.choice((-1.0, 1.0)))
    shore = float(rng.uniform(*SHORES)) + inner[3] - 80.0
    bays = draw_relief(((700.0, 70.0), (210.0, 16.0)), rng)
    middle = (inner[0] + inner[1]) / 2

    def near(station: F64) -> F64:
        calm = smoothstep(QUAY - 40.0, QUAY + 500.0, np.abs(station - middle))
        return shore + calm * bays(station, 0.0 * station)

    def inside(station: F64, left: F64) -> F64:
        return side * left - near(station)

    return Basin(side, water_level(land), shore, inside, near)


def hillside_hills(land: Land, inner: Cell, sea: Basin, shape: tuple[float, float], rng: np.random.Generator) -> Hills:
    """Draw the large-scale relief between the sea and the mountains.

    Args:
        land: The land.
        inner: Lowest and highest station, lowest and highest left of the site [m].
        sea: The sea.
        shape: Grade of the built slope [1] and typical height of the mountains [m].
        rng: Random stream.

    Returns:
        Large-scale height of the land at any position [m].
    """
    broad, crest = draw_relief(((520.0, 1.0), (240.0, 0.4)), rng), draw_crests(rng)
    gullies, spurs = draw_gullies(rng), draw_spurs(rng)
    grade, height = shape
    middle = (inner[0] + inner[1]) / 2

    def mountains(station: F64, left: F64) -> F64:
        up = np.maximum(-sea.side * left - FOOT, 0.0)
        gentle = grade * np.minimum(up, 900.0) * (0.95 + 0.28 * broad(station, left))
        return gentle + height * smoothstep(BUILT - FOOT, 2100.0, up) * (0.42 + 0.85 * crest(station, left))

    def high(station: F64, left: F64) -> F64:
        return smoothstep(BUILT - FOOT, 760.0, np.maximum(-sea.side * left - FOOT, 0.0))

    worn = eroded(mountains, gullies, high)

    def dry(station: F64, left: F64) -> F64:
        away = distance_beyond(inner, station, left)
        rise = worn(station, left)
        aside = land.crossing.distance(station, left) - land.crossing.half_width
        reach = 1.0 + (spurs(station, left) - 1.0) * smoothstep(BUILT - 60.0, BUILT + 300.0, away)
        valley = smoothstep(0.0, 1.0, reach * (aside - 22.0) / (148.0 + 0.1 * away))
        return smoothstep(FIRST_STEP + 4.0, 70.0, away) * valley * rise

    def slope(station: F64, left: F64) -> F64:
        return np.where(np.abs(station - middle) < QUAY, 0.2, 0.12) + 0.0 * left

    return with_shore(land, sea, dry, sea.shore - 130.0, slope)
