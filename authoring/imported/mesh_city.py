"""Conversion of triangles to a world: ground, buildings, and textured pieces."""

import numpy as np
from numpy.typing import NDArray

from authoring.imported.mesh_ground import ground_triangles, objects_of
from authoring.imported.mesh_soup import MeshSoup
from authoring.imported.model import (
    Building,
    CityModel,
    Textured,
    face_normals,
    sound_triangles,
    split_faces,
)
from usd_schemas.guard.layer_walk import Warn

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

MOST_OBJECTS = 4000  # separate objects; if there are more, the smallest ones become one
SMALLEST = 1.5  # [m], height and breadth below which small objects become one object
MOST_UNDER = 0.35  # largest share of flat low faces that face down; above it, the orientation of faces is ignored [1]
LOOSE = "small things"


def city_of(soup: MeshSoup, warn: Warn) -> CityModel:
    """Distinguish ground and buildings.

    Everything above the ground counts as built: photographs do not distinguish trees and houses.

    Args:
        soup: Triangles [m], z up.
        warn: Called with one line for each unusual thing.

    Returns:
        The world. An object with a color or an image keeps its own faces; one without gets walls and a roof.
    """
    sound = np.linalg.norm(face_normals(soup.triangles), axis=1) > 0.5
    triangles, st, skin = soup.triangles[sound], soup.st[sound], soup.skin[sound]
    ground = ground_triangles(triangles)
    rise = _rise(triangles)
    if rise[ground].sum() < 0.0:
        warn("faces point inwards: all are reversed")
        triangles, st, rise = triangles[:, ::-1], st[:, ::-1], -rise
    under = ground & (rise < 0.0)
    if -rise[under].sum() < MOST_UNDER * np.abs(rise[ground]).sum():
        ground &= ~under  # floors of closed houses; not if the orientation of faces is inconsistent
    if not ground.any():
        warn("no ground found: it is estimated from the bases of the buildings")
    owner = np.where(ground, -1, 0).astype(np.int32)
    owner[~ground] = _owners(triangles[~ground])
    bare = skin < 0
    terrain = triangles[ground & bare]
    buildings = [_building(number, triangles[bare & (owner == number)]) for number in np.unique(owner[~ground & bare])]
    textured = _textured(triangles, st, skin, owner)
    kept = tuple(building for building in buildings if len(building.corners))
    return CityModel(kept, terrain, dict(soup.facts), textured, soup.skins)


def object_name(number: int) -> str:
    """Name an object; small ones, and the excess of too many, share one name.

    Args:
        number: Its number, -1 for the ground.
    """
    return "ground" if number < 0 else LOOSE if number >= MOST_OBJECTS else f"object {number:05d}"


def _owners(triangles: F64) -> I32:
    number = objects_of(triangles)
    if not len(number):
        return number
    count = int(number.max()) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, number, triangles.min(axis=1))
    np.maximum.at(high, number, triangles.max(axis=1))
    size = high - low
    worth = np.where(
        (size[:, 2] < SMALLEST) & (size[:, :2].max(axis=1) < SMALLEST), 0.0, size.prod(axis=1) + size.sum(1)
    )
    kept = np.sort(np.argsort(-worth, kind="stable")[:MOST_OBJECTS])
    kept = kept[worth[kept] > 0.0]
    table = np.full(count, MOST_OBJECTS, np.int32)
    table[kept] = np.arange(len(kept), dtype=np.int32)
    return table[number]


def _building(number: int, triangles: F64) -> Building:
    walls, roofs, _ = split_faces(sound_triangles(triangles))
    return Building(object_name(int(number)), walls, roofs)


def _textured(triangles: F64, st: F64, skin: I32, owner: I32) -> tuple[Textured, ...]:
    painted = np.flatnonzero(skin >= 0)
    order = painted[np.lexsort((skin[painted], owner[painted]))]
    keys = np.stack([owner[order], skin[order]], axis=1)
    starts = np.flatnonzero(np.r_[True, (np.diff(keys, axis=0) != 0).any(axis=1)]) if len(order) else np.zeros(0, int)
    return tuple(
        Textured(object_name(int(owner[run[0]])), bool(owner[run[0]] < 0), triangles[run], st[run], int(skin[run[0]]))
        for run in np.split(order, starts[1:])
        if len(run)
    )


def _rise(triangles: F64) -> F64:
    """Compute the plan area of triangles, negative if they face down [m2], shape (T,), float64."""
    edges = (triangles[:, 1:] - triangles[:, :1])[..., :2]
    return 0.5 * (edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
