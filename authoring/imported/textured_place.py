"""The photographed pieces of an imported world at a site: cut out at site, roads and rivers, and placed on the ground.

Near the site and its roads and rivers, and near the world's own border, a piece follows the joining terrain: each
corner keeps its height above the world's ground, and the upper part of a small object is not deformed. Deep inside the
world nothing is deformed. The joining terrain is below it: by `LIFT` at the site's edge, and increasingly lower away
from it, where it uses the lowest ground nearby instead.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.terrain import Cell, Terrain, distance_beyond
from authoring.imported.ground import CityGround
from authoring.imported.mesh_city import LOOSE
from authoring.imported.model import CityModel, Textured
from authoring.imported.place import CityPlace
from authoring.imported.triangle_cuts import cut_free, split_long
from authoring.site.land import no_hills
from authoring.site.relief import smoothstep
from authoring.site.shape import Land
from authoring.site.site import Site

F64 = NDArray[np.float64]

LIFT, MOST_LIFT, LIFT_SLOPE = 0.05, 0.4, 0.01  # [m], [m], [1]: height of a piece above the terrain
CLEAR = 2.5  # [m] distance of pieces from roads, water and the site
EDGE = 1.0  # [m] distance of pieces from the keep-out volume
BENT, BENDING = 45.0, 60.0  # [m] from site, roads and border within which a piece is deformed, and over which that ends
WHOLE = 80.0  # [m]: an object up to this size is left out as a whole if any part of it is in the way
STIFF = 3.0  # [m] above the ground from which on a small object is not deformed
_ROAD_START = -20.0  # [m] along an approach


@dataclass(frozen=True, eq=False)
class Clearance:
    """Distance of a position in the scene to everything that must stay free.

    Attributes:
        site: The site.
        inner: Lowest and highest station, lowest and highest left of its strip [m].
    """

    site: Site
    inner: Cell

    @staticmethod
    def of(site: Site) -> "Clearance":
        """Create it for a site.

        Args:
            site: The site.
        """
        own = site.field
        return Clearance(
            site, (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
        )

    def free(self, xy: F64) -> F64:
        """Compute the distance of positions to strip, keep-out volume, crossing and approach roads.

        Args:
            xy: Plan positions in the scene [m], shape (N, 2), float64.

        Returns:
            Distances, negative inside [m], shape (N,), float64.
        """
        station, left = self.site.land.layout.alignment.locate(xy)
        first, last, low, high = self.inner
        strip = _outside(np.maximum(first - station, station - last), np.maximum(low - left, left - high))
        away = np.minimum(strip, self.ways(station, left)) - CLEAR
        for box in self.site.keep_out:
            offset = xy - np.asarray(box.center[:2])
            cosine, sine = np.cos(box.heading), np.sin(box.heading)
            along, aside = offset[:, 0] * cosine + offset[:, 1] * sine, offset[:, 1] * cosine - offset[:, 0] * sine
            away = np.minimum(away, _outside(np.abs(along) - box.half[0], np.abs(aside) - box.half[1]) - EDGE)
        return away

    def ways(self, station: F64, left: F64) -> F64:
        """Compute the distance of positions to the crossing and the approach roads.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.

        Returns:
            Distances, negative on them [m], the same shape (...), float64.
        """
        land: Land = self.site.land
        free = land.crossing.distance(station, left) - land.crossing.half_width
        for approach in land.approaches:
            aside = np.abs(left - approach.center(station)) - approach.half_width
            before = _ROAD_START - approach.along(station)
            free = np.minimum(free, _outside(before, aside))
        return free

    def rigid(self, station: F64, left: F64, beyond: F64) -> F64:
        """Compute the share of its shape that a piece keeps: 0 if it follows the terrain, 1 if unchanged.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.
            beyond: Distance to the world's border, negative inside [m], the same shape (...), float64.

        Returns:
            Shares [1], the same shape (...), float64.
        """
        deep = np.minimum(distance_beyond(self.inner, station, left), np.minimum(self.ways(station, left), -beyond))
        return smoothstep(BENT, BENT + BENDING, deep)


def place_textured(
    model: CityModel, terrain: Terrain, place: CityPlace, ground: CityGround, clearance: Clearance, datum: float
) -> tuple[Textured, ...]:
    """Move the textured pieces of a world into the scene.

    Args:
        model: The world.
        terrain: The joining terrain.
        place: Place of the site in the world.
        ground: The world's relief.
        clearance: Distance to everything that must stay free.
        datum: Height of the world's ground that is placed at 0 [m].

    Returns:
        The remaining pieces, in world space.
    """
    blocked, small = _objects(model, place, clearance)
    cut = []
    for piece in model.textured:
        if piece.owner not in blocked:
            corners = np.concatenate(
                [place.to_scene(piece.triangles[..., :2]), piece.triangles[..., 2:], piece.st], axis=2
            )
            corners = split_long(corners, clearance.free)
            corners = cut_free(corners, clearance.free(corners[..., :2].reshape(-1, 2)).reshape(-1, 3))
            if len(corners):
                cut.append((piece, corners))
    if not cut:
        return ()
    every = np.concatenate([corners for _, corners in cut])
    shift, over = _shifts(every, terrain, place, ground, clearance, datum)
    ends = np.cumsum([len(corners) for _, corners in cut])[:-1]
    runs = list(zip(cut, np.split(shift, ends), np.split(over, ends), strict=True))
    own: dict[str, list[F64]] = {}
    for (piece, _), shifts, _ in runs:
        own.setdefault(piece.owner, []).append(shifts.ravel())
    placed = []
    for (piece, corners), shifts, height in runs:
        moved = corners[..., 2] + shifts
        if piece.owner in small:  # its foot follows the ground, its roof stays level
            level = float(np.median(np.concatenate(own[piece.owner])))
            moved = moved + smoothstep(0.3, STIFF, height) * (level - shifts)
        corners[..., 2] = moved
        placed.append(
            Textured(piece.owner, piece.is_ground, np.round(corners[..., :3], 4), corners[..., 3:], piece.skin)
        )
    return tuple(placed)


def _outside(along: F64, aside: F64) -> F64:
    """Combine signed distances to two pairs of sides into that to a rectangle, negative inside [m], float64."""
    return np.hypot(np.maximum(along, 0.0), np.maximum(aside, 0.0)) + np.minimum(np.maximum(along, aside), 0.0)


def _objects(model: CityModel, place: CityPlace, clearance: Clearance) -> tuple[set[str], set[str]]:
    """Name the objects that are in the way and small enough to be removed as a whole, and the other small ones."""
    owners: dict[str, list[F64]] = {}
    for piece in model.textured:
        if not piece.is_ground and piece.owner != LOOSE:
            owners.setdefault(piece.owner, []).append(piece.triangles.reshape(-1, 3)[:, :2])
    blocked, small = set(), set()
    for owner, parts in owners.items():
        plan = np.concatenate(parts)
        low, high = plan.min(axis=0), plan.max(axis=0)
        spots = np.stack(np.meshgrid(*(np.linspace(low[k], high[k], 5) for k in (0, 1))), axis=-1).reshape(-1, 2)
        if (high - low).max() <= WHOLE:
            inside = clearance.free(place.to_scene(np.concatenate([plan, spots]))).min() <= 0.0
            (blocked if inside else small).add(owner)
    return blocked, small


def _shifts(
    corners: F64, terrain: Terrain, place: CityPlace, ground: CityGround, clearance: Clearance, datum: float
) -> tuple[F64, F64]:
    """Find how far each corner is raised, and its height over the world's ground [m], both of shape (T, 3), float64."""
    flat = corners[..., :2].reshape(-1, 2)
    _, first, number = np.unique(flat[:, 0] + 1j * flat[:, 1], return_index=True, return_inverse=True)
    plan = flat[first]
    station, left = terrain.land.layout.alignment.locate(plan)
    spot = place.to_city(plan)
    own = ground.height(spot)
    base = terrain.land.shape(station, left, no_hills).height
    rigid = clearance.rigid(station, left, ground.beyond_at(spot))
    away = distance_beyond(clearance.inner, station, left)
    lift = np.clip(LIFT + LIFT_SLOPE * away, LIFT, MOST_LIFT)
    shift = rigid * (base - datum) + (1.0 - rigid) * (terrain.height(station, left) - own) + lift
    place_of, shape = number.reshape(-1), corners.shape[:2]
    return shift[place_of].reshape(shape), corners[..., 2] - own[place_of].reshape(shape)
