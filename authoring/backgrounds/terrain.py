"""Terrain beyond the site: grid lines of the site's strip continue outwards, so that both share every border vertex."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.terrain_lines import Demands, Middle, interpolated_heights, outer_triangles, thin_out
from authoring.site.covers import COVERS, Cover, Soup, soup_of
from authoring.site.extent import Box
from authoring.site.grid import HeightField, growing_steps, surface_normals
from authoring.site.land import FIRST_STEP
from authoring.site.relief import Relief, draw_relief, smoothstep
from authoring.site.shape import Hills, Land
from authoring.site.site import Site

F64 = NDArray[np.float64]
WIDEST_STEP = 55.0  # largest spacing of grid lines [m]
INVERSIONS = 8  # iterations to find the grid coordinates of a place; each reduces the error to about a third
APRON = 16_000.0  # empty margin beyond roads and fields: seen from 100 m above, its end is at the horizon [m]
FIRST_TILE, TILE_GROWTH = 130.0, 1.3  # size of the atlas tiles beside the site [m], and their growth outwards [1]
FADE = 400.0  # distance over which the curves of the grid lines fade out [m]
SLACK = (0.015, 0.0012, 2.0)  # height error of the mesh: beside the site [m], its growth with distance [1], limit [m]
WAY_SLACK, BESIDE = 0.03, 9.0  # the same beside roads and water, and the width of that strip [m]
Cell = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Terrain:
    """Ground all around a site, on a tensor grid whose outer lines bend with the river and the roads.

    Attributes:
        land: The land.
        hills: Large-scale height of the land.
        field: Heights over grid coordinates; in its middle lies the site.
        inner: Lowest and highest station, lowest and highest left of the site [m].
        kept: Whether each node is part of the mesh, shape (S, L), bool: more and more lines end outwards.
        keep_out: Volumes that must stay empty; they reach beyond the site where the axis is skewed or curved.
    """

    land: Land
    hills: Hills
    field: HeightField
    inner: Cell
    kept: NDArray[np.bool_]
    keep_out: tuple[Box, ...] = ()

    def with_heights(self, heights: F64) -> "Terrain":
        """Return the same terrain with other heights at its nodes.

        Args:
            heights: Heights of the nodes [m], shape (S, L), float64.
        """
        field = self.field
        level = interpolated_heights(heights, field, _middle(field, self.inner), self.kept)
        return replace(self, field=HeightField(field.stations, field.lefts, level))

    def height(self, station: F64, left: F64) -> F64:
        """Find ground heights: exact on the site and along river and roads, to a few centimeters elsewhere.

        Args:
            station: Distance along the axis [m], shape (N,), float64.
            left: Distance to the left of the axis [m], shape (N,), float64.

        Returns:
            World heights [m], shape (N,), float64.
        """
        return self.field(*self._unbent(station, left))

    def beyond(self, station: F64, left: F64) -> F64:
        """Measure the distance to the site.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.

        Returns:
            Distances, 0 inside it [m], the same shape (...), float64.
        """
        return distance_beyond(self.inner, station, left)

    def clear(self, station: F64, left: F64) -> F64:
        """Measure the distance to the keep-out volumes in plan.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.

        Returns:
            Distances, 0 inside them [m], the same shape (...), float64.
        """
        plan = self.land.layout.alignment.point(station, left, np.zeros(np.shape(station)))[..., :2]
        free = np.full(np.shape(station), np.inf)
        for box in self.keep_out:
            offset, cosine, sine = plan - np.asarray(box.center[:2]), np.cos(box.heading), np.sin(box.heading)
            along = np.abs(offset[..., 0] * cosine + offset[..., 1] * sine) - box.half[0]
            aside = np.abs(offset[..., 1] * cosine - offset[..., 0] * sine) - box.half[1]
            free = np.minimum(free, np.hypot(np.maximum(along, 0.0), np.maximum(aside, 0.0)))
        return free

    def soup(self, extra: tuple[tuple[Cover, F64], ...], over: tuple[tuple[Cover, F64], ...] = ()) -> Soup:
        """Gather the triangles outside the site.

        Args:
            extra: Further covers, below the site's own in priority, with their fields at the nodes [m], shape (S, L).
            over: Further covers, above the site's own in priority, with their fields at the nodes [m], shape (S, L).

        Returns:
            The triangles with their covers.
        """
        station, left = self.nodes()
        nodes = np.stack([station, left, self.field.heights], axis=-1).reshape(-1, 3)
        faces = self.field.triangles()
        normals = surface_normals(nodes, faces)
        shape = self.land.shape(station, left, self.hills)
        shape.covers["patch"] = shape.covers["patch"] - 0.2 * self.beyond(station, left)  # too small for distant cells
        own = tuple(cover for cover in COVERS if cover.name in shape.covers)
        shape.covers.update({cover.name: values for cover, values in (*over, *extra)})
        covers = (*(cover for cover, _ in over), *own[:-1], *(cover for cover, _ in extra), own[-1])
        outer = outer_triangles(_middle(self.field, self.inner), self.kept)
        return soup_of(nodes, normals, outer, shape, covers, self.land.layout.alignment)

    def atlas(self, soup: Soup) -> F64:
        """Map the land to tiles from 0 to 1, larger outwards; rotations and mirroring make neighboring tiles differ.

        A macro texture that is neutral along its border is continuous over every tile's border, and over the site's.

        Args:
            soup: Triangles outside the site; none crosses a tile's border.

        Returns:
            `st1` at each corner of each triangle [1], shape (3 * T, 2), float64.
        """
        corner = soup.rows[soup.faces.reshape(-1), :2]
        place = np.stack(self._unbent(corner[:, 0], corner[:, 1]), axis=1)
        middle = np.repeat(place.reshape(-1, 3, 2).mean(axis=1), 3, axis=0)
        tile, share = np.zeros(place.shape, np.int64), np.zeros(place.shape)
        for axis, lines in enumerate((self.field.stations, self.field.lefts)):
            borders = _tile_borders(lines, self.inner[2 * axis], self.inner[2 * axis + 1])
            tile[:, axis] = np.clip(np.searchsorted(borders, middle[:, axis]) - 1, 0, len(borders) - 2)
            start, size = borders[tile[:, axis]], np.diff(borders)[tile[:, axis]]
            share[:, axis] = np.clip((place[:, axis] - start) / size, 0.0, 1.0)
        code = 3 * tile[:, 0] + 5 * tile[:, 1] + tile[:, 0] * tile[:, 1]
        share[:, 0] = np.where(code & 1, 1.0 - share[:, 0], share[:, 0])
        share[:, 1] = np.where(code & 2, 1.0 - share[:, 1], share[:, 1])
        return np.where((code & 4)[:, None] > 0, share[:, ::-1], share)

    def _unbent(self, station: F64, left: F64) -> tuple[F64, F64]:
        """Find the grid coordinates of places."""
        column, row = station, left
        for _ in range(INVERSIONS):
            shift, aside = _bends(self.land, self.inner, column, row)
            column, row = station - shift, left - aside
        return column, row

    def nodes(self) -> tuple[F64, F64]:
        """Find the stations and lefts of the nodes [m], each of shape (S, L), float64."""
        return _bent_nodes(self.land, self.inner, self.field.stations, self.field.lefts)


def grow_terrain(site: Site, hills: Hills, reach: float, widest: float = WIDEST_STEP) -> Terrain:
    """Extend the site's grid outwards.

    Args:
        site: The site.
        hills: Large-scale height of the land; 0 within `FIRST_STEP` of the site.
        reach: Distance of the terrain's border from the site's [m].
        widest: Largest spacing of grid lines [m].

    Returns:
        The terrain.
    """
    own, around = site.field, replace(site.land, plots=None)
    stations, lefts = (_outward(line, reach, widest) for line in (own.stations, own.lefts))
    inner = (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
    station, left = _bent_nodes(around, inner, stations, lefts)
    heights = np.round(around.shape(station, left, hills).height, 4)
    column, row = np.searchsorted(stations, inner[0]), np.searchsorted(lefts, inner[2])
    heights[column : column + len(own.stations), row : row + len(own.lefts)] = own.heights
    field = HeightField(stations, lefts, heights)
    kept = _coarser(around, hills, field, inner)
    return Terrain(around, hills, field, inner, kept, site.keep_out).with_heights(heights)


def rolling_hills(land: Land, inner: Cell, height: float, rng: np.random.Generator) -> Hills:
    """Draw hills outside the site and the river's valley, and lower along the roads.

    Args:
        land: The land.
        inner: Lowest and highest station, lowest and highest left of the site [m].
        height: Typical height of the far hills [m].
        rng: Random stream.

    Returns:
        Large-scale height of the land at any position [m].
    """
    broad: Relief = draw_relief(((620.0, 1.0), (270.0, 0.33)), rng)
    small: Relief = draw_relief(((120.0, 1.6), (45.0, 0.5)), rng)

    def hills(station: F64, left: F64) -> F64:
        away = distance_beyond(inner, station, left)
        stream = np.abs(station - land.crossing.center(left)) - max(land.crossing.half_width - 30.0, 0.0)
        low, high = (45.0, 260.0) if land.crossing.kind == "river" else (30.0, 220.0)
        floor = 0.0 if land.crossing.kind == "river" else 0.2
        valley = floor + (1.0 - floor) * smoothstep(low, high, stream)
        for approach in land.approaches:
            aside = np.abs(left - approach.center(station))
            along = smoothstep(-80.0, 0.0, approach.along(station))
            valley = valley * (1.0 - 0.8 * along * (1.0 - smoothstep(25.0, 220.0, aside)))
        tall = height * (0.45 + 0.9 * broad(station, left)) * (0.35 + 0.65 * smoothstep(150.0, 800.0, away))
        tall = tall + 1.1 * height * smoothstep(900.0, 2000.0, away)  # distant hills that hide the end of the land
        rise = 0.5 * (tall + np.sqrt(tall * tall + 40.0)) + small(station, left)
        return smoothstep(FIRST_STEP + 4.0, 170.0, away) * valley * rise

    return hills


def distance_beyond(inner: Cell, station: F64, left: F64) -> F64:
    """Measure the distance of places to a rectangle.

    Args:
        inner: Lowest and highest station, lowest and highest left of the rectangle [m].
        station: Distance along the axis [m], shape (...), float64.
        left: Distance to the left of the axis [m], the same shape (...), float64.

    Returns:
        Distances, 0 inside [m], the same shape (...), float64.
    """
    first, last, low, high = inner
    return np.hypot(
        np.maximum(np.maximum(first - station, station - last), 0.0),
        np.maximum(np.maximum(low - left, left - high), 0.0),
    )


def _outward(line: F64, reach: float, widest: float) -> F64:
    steps = np.concatenate([[0.0], growing_steps(reach - FIRST_STEP, FIRST_STEP, widest, 1.19)]) + FIRST_STEP
    steps = np.append(steps, steps[-1] + APRON)
    return np.concatenate([line[0] - steps[::-1], line, line[-1] + steps])


def _middle(field: HeightField, inner: Cell) -> Middle:
    first, last = (int(row) for row in np.searchsorted(field.stations, inner[:2]))
    low, high = (int(row) for row in np.searchsorted(field.lefts, inner[2:]))
    return Middle((first, last), (low, high))


def _coarser(land: Land, hills: Hills, field: HeightField, inner: Cell) -> NDArray[np.bool_]:
    """Choose the nodes of the mesh, shape (S, L), bool: beside roads and water all nodes are kept."""
    station, left = _bent_nodes(land, inner, field.stations, field.lefts)
    away = distance_beyond(inner, station, left)
    slack = np.minimum(SLACK[0] + SLACK[1] * away, SLACK[2])
    beside = land.crossing.distance(station, left) - land.crossing.half_width
    for approach in land.approaches:
        aside = np.abs(left - approach.center(station)) - approach.half_width
        beside = np.minimum(beside, np.where(approach.along(station) > 0.0, aside, np.inf))
    slack = np.where(beside < BESIDE, np.minimum(slack, WAY_SLACK), slack)
    covers = land.shape(station, left, hills).covers
    borders = tuple(values for name, values in covers.items() if name != "patch")
    tiles = (_tile_borders(field.stations, *inner[:2]), _tile_borders(field.lefts, *inner[2:]))
    wanted = (np.searchsorted(field.stations, tiles[0]), np.searchsorted(field.lefts, tiles[1]))
    demands = Demands(field.heights, slack, borders, 0.10 + 0.004 * away)
    return thin_out(field, _middle(field, inner), demands, wanted)


def _tile_borders(lines: F64, low: float, high: float) -> F64:
    """Choose grid lines that bound atlas tiles: the site's borders, and lines at increasing distances outwards."""
    sides = []
    for outward, border in ((lines[lines > high], high), (-lines[lines < low][::-1], -low)):
        chosen, size = [border], FIRST_TILE
        for line in outward:
            if line - chosen[-1] >= size or line == outward[-1]:
                chosen.append(float(line))
                size *= TILE_GROWTH
        sides.append(np.array(chosen))
    return np.concatenate([-sides[1][::-1], sides[0]])


def _bent_nodes(land: Land, inner: Cell, stations: F64, lefts: F64) -> tuple[F64, F64]:
    column, row = np.meshgrid(stations, lefts, indexing="ij")
    shift, aside = _bends(land, inner, column, row)
    return column + shift, row + aside


def _bends(land: Land, inner: Cell, column: F64, row: F64) -> tuple[F64, F64]:
    """Find how far grid lines are shifted, so that the river stays on its columns and the roads on their rows."""
    first, last, low, high = inner
    crossing = land.crossing
    near = 1.0 - smoothstep(0.0, FADE, np.maximum(np.maximum(first - column, column - last), 0.0))
    shift = near * (crossing.center(row) - crossing.center(np.clip(row, low, high)))
    near = 1.0 - smoothstep(0.0, FADE, np.maximum(np.maximum(low - row, row - high), 0.0))
    before, behind = land.approaches
    return shift, near * (before.center(column) + behind.center(column))
