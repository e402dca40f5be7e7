"""Draw the land that a bridge stands in: relief, crossing and approaches."""

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Layout
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.site.covers import Soup, soup_of
from authoring.site.crossing import CrossingKind, choose_crossing, draw_crossing
from authoring.site.grid import HeightField, graded_lines, surface_normals
from authoring.site.relief import draw_relief
from authoring.site.shape import SHOULDER, WALL_STEP, Approach, Land, Shape

F64 = NDArray[np.float64]
RELIEF = ((95.0, 0.42), (31.0, 0.16), (9.0, 0.07), (3.1, 0.025))
RAGGED = ((6.3, 0.55), (2.1, 0.35))
PATCHES = ((23.0, 3.2), (6.0, 1.4))
FOOT = 0.55  # height of an approach road above the land where it has reached it [m]
FIRST_STEP = 3.0  # distance from the strip's border to the first grid line of a background [m]


def no_hills(station: F64, left: F64) -> F64:
    """Return height 0 everywhere: the site's default relief.

    Args:
        station: Distance along the axis [m], shape (...), float64.
        left: Distance to the left of the axis [m], the same shape (...), float64.

    Returns:
        Heights, all 0 [m], the same shape (...), float64.
    """
    return np.zeros(np.broadcast(station, left).shape)


def draw_land(
    kind: CrossingKind | None,
    relief: float,
    layout: Layout,
    reach: float,
    rng: np.random.Generator,
    river_piers: bool | None = None,
) -> Land:
    """Draw the land.

    Args:
        kind: What the bridge crosses; None: chosen to fit it.
        relief: Scale of the natural relief [1].
        layout: The bridge.
        reach: Distance that the site reaches beyond the abutments [m]; the approach roads are straight 10 m farther.
        rng: Random stream.
        river_piers: Whether piers stand in a river where there is room; None: by chance.

    Returns:
        The land.
    """
    kinds, sides = rng.spawn(2)  # separate streams: values set by the user change nothing else
    widths = kinds.spawn(1)[0]
    chosen = choose_crossing(layout, kinds)
    heights = draw_relief(tuple((length, height * relief) for length, height in RELIEF), rng)
    ragged, patches = draw_relief(RAGGED, rng), draw_relief(PATCHES, rng)
    crossing, valley = draw_crossing(kind or chosen, layout, rng, (sides, widths), river_piers)
    half_road = layout.carriageway / 2 if layout.carriageway > 0 else max(layout.width / 2 - 1.1, 1.5)
    bends = rng.uniform(18.0, 32.0, 2) * rng.choice((-1.0, 1.0), 2)
    rims = (0.0, 0.0) if valley is None else valley.ends
    backs = (layout.supports[0] - ABUTMENT_BACK, layout.supports[-1] + ABUTMENT_BACK)
    first, last = (
        Approach(back, sign, reach + 10.0, float(bend), FOOT + rim, half_road, layout.alignment)
        for back, sign, bend, rim in zip(backs, (-1, 1), bends, rims, strict=True)
    )
    return Land(layout, crossing, (first, last), heights, ragged, patches, valley)


def strip_lines(land: Land, run_out: float, half_width: float, fine: tuple[float, float, float]) -> tuple[F64, F64]:
    """Place the grid lines of the strip so that walls and road edges fall on lines.

    Args:
        land: The land.
        run_out: Reach beyond the abutments' back faces [m].
        half_width: Reach to either side of the axis [m].
        fine: Reach of the fine mesh round the bridge, spacing there, and largest spacing anywhere [m].

    Returns:
        Stations [m] and lefts [m], rising, shapes (S,) and (L,), float64.
    """
    reach, spacing, coarse = fine
    (first, last), half = (approach.back for approach in land.approaches), land.layout.width / 2
    walls = [first + step for step in WALL_STEP] + [last - step for step in WALL_STEP]
    stations = graded_lines((first - run_out, *walls, last + run_out), (first - reach, last + reach), spacing, coarse)
    road = land.approaches[0].half_width
    sides = (half - WALL_STEP[1], half - WALL_STEP[0], half, road, road + SHOULDER)
    lefts = graded_lines(
        (-half_width, 0.0, half_width, *sides, *(-side for side in sides)),
        (-half - reach, half + reach),
        spacing,
        coarse,
    )
    return stations, lefts


def strip_ground(land: Land, stations: F64, lefts: F64) -> tuple[HeightField, Soup]:
    """Shape the site's ground on grid lines; heights are multiples of 0.1 mm.

    A further line all around, `FIRST_STEP` outside, is used for the normals, so that shading is continuous to the
    background.

    Args:
        land: The land.
        stations: Grid lines along the axis [m], shape (S,), float64.
        lefts: Grid lines to its left [m], shape (L,), float64.

    Returns:
        The ground, and its triangles with their covers.
    """
    wide = [np.concatenate([[line[0] - FIRST_STEP], line, [line[-1] + FIRST_STEP]]) for line in (stations, lefts)]
    station, left = np.meshgrid(*wide, indexing="ij")
    shape = land.shape(station, left, no_hills)
    outer = HeightField(wide[0], wide[1], np.round(shape.height, 4))
    normals = surface_normals(outer.nodes(), outer.triangles()).reshape(*station.shape, 3)
    ground = HeightField(stations, lefts, outer.heights[1:-1, 1:-1])
    covers = {name: values[1:-1, 1:-1] for name, values in shape.covers.items()}
    inner = normals[1:-1, 1:-1].reshape(-1, 3)
    return ground, soup_of(
        ground.nodes(), inner, ground.triangles(), Shape(ground.heights, covers), axis=land.layout.alignment
    )
