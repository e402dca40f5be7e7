"""Open water beside a site: a lake or a sea, level, cut out of the land along its shore, and rivers that end in it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.far_ways import far_ways, with_faces, without
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh
from authoring.site.covers import Cover, Soup, chunked, covered, drape
from authoring.site.rails import buffer_stops
from authoring.site.relief import smoothstep
from authoring.site.roads import Piece
from authoring.site.shape import SHOULDER, Hills, Land
from authoring.site.ways import Line

F64 = NDArray[np.float64]
GroundPiece = tuple[str, str, str, str, Mesh]

SNAP = 0.06  # ground this close to the water's level is moved to it, so that the shore passes through vertices [m]
ROAD_END = 9.0  # distance from the shore at which the road under the bridge ends [m]
STOP = 1.5  # distance from the rails' end at which a buffer stop stands [m]
MOUTH = 12.0  # length of open water in a river's channel [m]
BANKS = 1.5  # distance from a river's edge up to which land may lie below the open water's level [m]
BEACH = 0.6  # height up to which the shore has no plants [m]
WATER = Cover("open_water", "OpenWater", "water", "open_water")
SHORE = Cover("beach", "Beach", "riverbank", "gravel")


@dataclass(frozen=True, eq=False)
class Basin:
    """A lake or a sea.

    Attributes:
        side: 1 where it lies to the left of the axis, -1 to the right [1].
        level: Height of its surface [m].
        shore: Distance of its near shore from the axis, on the average [m].
        inside: Distance of a place to its shore, negative on land [m], from station and left, same shape, float64.
        near: Distance of its near shore from the axis at stations [m], same shape, float64.
    """

    side: float
    level: float
    shore: float
    inside: Callable[[F64, F64], F64]
    near: Callable[[F64], F64]


def water_level(land: Land) -> float:
    """Choose a level below the river's, so that it flows in; below dry land if there is no river [m].

    Args:
        land: The land.
    """
    crossing = land.crossing
    return crossing.level - 0.45 * min(crossing.depth, 1.3) if crossing.kind == "river" else -2.3


def causeway_share(land: Land, station: F64, left: F64) -> F64:
    """Find where land below the water's level carries the crossing.

    Args:
        land: The land.
        station: Distance along the axis [m], shape (...), float64.
        left: Distance to the left of the axis [m], the same shape (...), float64.

    Returns:
        1 under it, 0 beside it and for rivers [1], the same shape (...), float64.
    """
    if land.crossing.kind == "river":
        return np.zeros(np.broadcast(station, left).shape)
    half = land.crossing.half_width + SHOULDER
    return 1.0 - smoothstep(half + 1.5, half + 6.0, land.crossing.distance(station, left))


def with_shore(land: Land, basin: Basin, dry: Hills, foreshore: float, slope: Hills) -> Hills:
    """Lower the surrounding land to a shore and below the water; a crossing road is extended to the shore.

    Args:
        land: The land.
        basin: The water.
        dry: Height of the land at large away from the water.
        foreshore: Width of the strip over which the land beyond it falls to the shore [m].
        slope: Least slope of the shore [1], from station and left.

    Returns:
        Large-scale height of the land at any position [m].
    """

    def hills(station: F64, left: F64) -> F64:
        inside, out = basin.inside(station, left), basin.side * left - basin.near(station)
        shore = smoothstep(-0.55 * foreshore, -8.0, inside)
        fall = smoothstep(-foreshore, -18.0, inside)
        high = 0.0
        if land.valley is not None:
            high = land.valley(station, land.crossing.center(left) - land.crossing.station)
        own = dry(station, left) - fall * high - shore * land.relief(station, left)
        ashore = basin.level + slope(station, left) * np.maximum(-inside, 0.0)
        overlap = np.maximum(1.2 - np.abs(ashore - own), 0.0) / 1.2
        ashore = np.minimum(ashore, own) - 0.3 * overlap * overlap
        bed = basin.level - np.minimum(0.3 * np.maximum(inside, 0.0), 9.0)
        wet = np.where(inside > 0.0, bed, ashore)
        carried = causeway_share(land, station, left) * (1.0 - smoothstep(-ROAD_END, -0.3 * ROAD_END, out))
        return np.where(basin.side * left > 0.0, wet + carried * np.maximum(-wet, 0.0), own)

    return hills


def level_shore(terrain: Terrain, basin: Basin) -> Terrain:
    """Move ground close to the water's level to that level, and raise land below it.

    So the water ends exactly where the ground comes up to it; only a river's channel continues below its level.

    Args:
        terrain: The terrain.
        basin: The water.

    Returns:
        The terrain; the site's own ground is unchanged.
    """
    heights = terrain.field.heights.copy()
    station, left = terrain.nodes()
    near = (np.abs(heights - basin.level) < SNAP) & (terrain.beyond(station, left) > 1.0)
    low = (heights < basin.level) & (basin.inside(station, left) <= 0.0) & ~_channel(terrain.land, station, left)
    heights[near | (low & (terrain.beyond(station, left) > 1.0))] = basin.level
    return terrain.with_heights(heights)


def _channel(land: Land, station: F64, left: F64) -> NDArray[np.bool_]:
    """Find where a river runs through the land, with its banks, same shape, bool."""
    crossing = land.crossing
    if crossing.kind != "river":
        return np.zeros(np.broadcast(station, left).shape, bool)
    return crossing.distance(station, left) < crossing.half_width + BANKS


def shore_pieces(terrain: Terrain, basin: Basin, extra: tuple[tuple[Cover, F64], ...]) -> list[GroundPiece]:
    """Cut ground and open water along the shore.

    Args:
        terrain: The terrain.
        basin: The water.
        extra: Further covers of the ground, with their fields at the nodes [m], shape (S, L).

    Returns:
        Name, component kind, material recipe, group and mesh of each piece.
    """
    station, left = terrain.nodes()
    inside = basin.inside(station, left)
    heights = terrain.field.heights
    wet = np.where(
        _channel(terrain.land, station, left), np.minimum(basin.level - heights, inside + MOUTH), basin.level - heights
    )
    beach = np.minimum(basin.level + BEACH - heights, inside + 30.0)
    pieces = []
    axis = terrain.land.layout.alignment
    for cover, soup in covered(terrain.soup(extra, ((WATER, wet), (SHORE, beach)))):
        for name, chunk in chunked(cover.prim, soup) if cover is not WATER else [(cover.prim, soup)]:
            atlas = terrain.atlas(chunk)
            level = _leveled(chunk, basin.level) if cover is WATER else chunk
            pieces.append((name, cover.kind, cover.role, "Ground", drape(level, axis, atlas)))
    return pieces


def _leveled(soup: Soup, level: float) -> Soup:
    rows = soup.rows.copy()
    rows[:, 2], rows[:, 3:6] = level, (0.0, 0.0, 1.0)
    return replace(soup, rows=rows)


def ways_to_water(terrain: Terrain, basin: Basin) -> list[Piece]:
    """Continue the approach roads to the terrain's border, and the crossing: a river ends in the open water.

    Args:
        terrain: The terrain.
        basin: The water.

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece.
    """
    pieces = []
    for prim, kind, role, mesh in far_ways(terrain):
        if kind == "water":
            left = terrain.land.layout.alignment.locate(mesh.points)[1]
            crossing = terrain.land.crossing
            sink = crossing.level - basin.level + 0.12
            inside = np.where(
                basin.side * left > 0.0, basin.inside(crossing.center(left), left), -1e3
            )  # of the middle, so that cross-sections stay level
            points = mesh.points.copy()
            points[:, 2] -= np.round(
                sink * smoothstep(-80.0, 2.0, inside), 4
            )  # exactly 0 at the site, so that the border's vertices stay equal
            mesh = Mesh(points, mesh.face_counts, mesh.corners, mesh.normals, mesh.st)
        elif prim.endswith(("_Left", "_Right")):  # a road or railway under the bridge ends on the quay
            station, left = terrain.land.layout.alignment.locate(mesh.points)
            mesh = without(mesh, basin.side * left - basin.near(station) > -ROAD_END)
        pieces.append((prim, kind, role, mesh))
    pieces = with_faces(pieces)
    return [*pieces, *_track_end(terrain, basin, pieces)]


def _track_end(terrain: Terrain, basin: Basin, pieces: list[Piece]) -> list[Piece]:
    """End a railway under the bridge at buffer stops, before the water."""
    suffix, land = "_Left" if basin.side > 0.0 else "_Right", terrain.land
    rails = [mesh.points for prim, _, _, mesh in pieces if prim == f"Rails{suffix}"]
    if not rails:
        return []
    end = float(np.max(basin.side * land.layout.alignment.locate(rails[0])[1]))
    left = basin.side * np.array([end - STOP, end - STOP - 5.0])
    station = land.crossing.center(left)
    aside = -basin.side * land.crossing.stretch(left)
    line = Line(station, left, np.column_stack([aside, np.zeros(2)]))
    crown = land.crossing.level + terrain.hills(station, left)
    return [(f"BufferStops{suffix}", "rail_bed", "deck_concrete", buffer_stops(land, line, crown))]
