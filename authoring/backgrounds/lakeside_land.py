"""The land of the background `lakeside`: a lake between mountains, a level shore with the roads, slopes behind."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.erosion import draw_gullies, eroded
from authoring.backgrounds.terrain import Cell, distance_beyond
from authoring.backgrounds.waters import Basin, water_level, with_shore
from authoring.site.land import FIRST_STEP
from authoring.site.relief import draw_relief, smoothstep
from authoring.site.shape import Hills, Land

F64 = NDArray[np.float64]

FOOT = 112.0  # distance from the axis at which the inland slopes begin [m]
SHORES = (205.0, 270.0)  # distance of the near shore from the axis, if the site reaches 80 m to the left [m]
QUAY = 300.0  # length of the quay on each side of the bridge's middle [m]


def draw_lake(land: Land, inner: Cell, width: float, rng: np.random.Generator) -> Basin:
    """Draw a lake on one side of the axis.

    Args:
        land: The land.
        inner: Lowest and highest station, lowest and highest left of the site [m].
        width: From shore to shore [m].
        rng: Random stream.

    Returns:
        The lake: narrow and long, closed by capes at both ends.
    """
    side = float(rng.choice((-1.0, 1.0)))
    shore = float(rng.uniform(*SHORES)) + inner[3] - 80.0
    bays, coast = draw_relief(((430.0, 26.0), (140.0, 7.0)), rng), draw_relief(((900.0, 260.0), (300.0, 90.0)), rng)
    middle = (inner[0] + inner[1]) / 2
    ends = middle + np.array([-1.0, 1.0]) * (rng.uniform(1500.0, 2600.0, 2) + 0.5 * (inner[1] - inner[0]))

    def near(station: F64) -> F64:
        calm = smoothstep(QUAY - 60.0, QUAY + 300.0, np.abs(station - middle))
        return shore + calm * (bays(station, 0.0 * station) + 0.05 * np.maximum(np.abs(station - middle) - QUAY, 0.0))

    def inside(station: F64, left: F64) -> F64:
        out = side * left
        far = shore + width + coast(station, 0.3 * out) - out
        end = np.minimum(station - ends[0], ends[1] - station) + 0.8 * coast(out, 0.2 * station)
        return np.minimum(np.minimum(out - near(station), far), 0.8 * end)

    return Basin(side, water_level(land), shore, inside, near)


def lakeside_hills(land: Land, inner: Cell, lake: Basin, height: float, rng: np.random.Generator) -> Hills:
    """Draw the large-scale relief around a lake.

    Args:
        land: The land.
        inner: Lowest and highest station, lowest and highest left of the site [m].
        lake: The lake.
        height: Typical height of the mountains [m].
        rng: Random stream.

    Returns:
        Large-scale height of the land at any position [m].
    """
    broad, ridge = draw_relief(((900.0, 1.0), (380.0, 0.4)), rng), draw_crests(rng)
    rough = draw_relief(((170.0, 7.0), (62.0, 2.0)), rng)
    gullies, spurs = draw_gullies(rng), draw_spurs(rng)
    grade = float(rng.uniform(0.17, 0.24))
    middle = (inner[0] + inner[1]) / 2

    def mountains(station: F64, left: F64) -> F64:
        out = lake.side * left
        up = np.maximum(-out - FOOT, 0.0)
        far = np.minimum(np.maximum(-lake.inside(station, left), 0.0), np.maximum(out - lake.near(station), 0.0))
        far = np.where(np.abs(station - middle) > 700.0, far, np.where(out > lake.shore + 200.0, far, 0.0))
        crest = ridge(station, left)
        gentle = grade * 700.0 * (1.0 - np.exp(-up / 700.0)) * (0.8 + 0.35 * broad(station, left))
        tall = height * smoothstep(420.0, 2300.0, up) * (0.45 + 0.8 * crest)
        steep = 1.25 * height * (1.0 - np.exp(-far / 520.0)) * (0.38 + 0.8 * crest)
        return gentle + tall + steep

    def high(station: F64, left: F64) -> F64:
        return smoothstep(70.0, 300.0, mountains(station, left))

    worn = eroded(mountains, gullies, high)

    def dry(station: F64, left: F64) -> F64:
        away = distance_beyond(inner, station, left)
        rise = worn(station, left)
        rise = rise + rough(station, left) * smoothstep(4.0, 60.0, rise)
        aside = land.crossing.distance(station, left) - land.crossing.half_width
        reach = 1.0 + (spurs(station, left) - 1.0) * smoothstep(120.0, 500.0, away)
        valley = smoothstep(0.0, 1.0, reach * (aside - 22.0) / (218.0 + 0.1 * away))
        return smoothstep(FIRST_STEP + 4.0, 90.0, away) * valley * rise

    def slope(station: F64, left: F64) -> F64:
        near = np.where(np.abs(station - middle) < QUAY, 0.2, 0.1)
        return near + 0.8 * smoothstep(150.0, 420.0, lake.side * left - lake.near(station))

    return with_shore(land, lake, dry, lake.shore - 130.0, slope)


def draw_crests(rng: np.random.Generator) -> Hills:
    """Draw mountain crests between 0 and 1: the zero lines of reliefs, the smaller ones weighted by the larger.

    Source: F. K. Musgrave, Procedural fractal terrains, in Texturing and Modeling, 1994 (ridged multifractal).

    Args:
        rng: Random stream.
    """
    one, two = draw_relief(((1300.0, 1.0),), rng), draw_relief(((520.0, 1.0), (230.0, 0.45)), rng)
    more = rng.spawn(1)[0]  # a separate stream, so that later draws do not depend on it
    three = draw_relief(((260.0, 1.0),), more)
    bends = [draw_relief(((560.0, 150.0),), more) for _ in range(2)]

    def crest(station: F64, left: F64) -> F64:
        x, y = station + bends[0](station, left), left + bends[1](station, left)  # no crest is straight
        first, second, third = (1.0 - np.abs(relief(x, y)) for relief in (one, two, three))
        high = first * np.sqrt(np.maximum(first, 0.0))
        return 0.62 * high + 0.28 * second * (0.45 + 0.55 * high) + 0.1 * third * high

    return crest


def draw_spurs(rng: np.random.Generator) -> Hills:
    """Draw how far the spurs of the mountains reach into the valley of the crossing.

    Args:
        rng: Random stream, whose state stays as it is.

    Returns:
        Factor of the distance from the crossing, about 1; above it a spur, below it the mouth of a side valley [1].
    """
    reaches = draw_relief(((560.0, 0.38), (230.0, 0.16)), rng.spawn(1)[0])

    def spurs(station: F64, left: F64) -> F64:
        return 1.0 + reaches(station, left)

    return spurs
