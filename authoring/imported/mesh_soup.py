"""Triangles from a file: corners, images, and the position of the whole."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.imported.skin import Skin
from groundwork.errors import InputError
from usd_schemas.guard.layer_walk import Warn

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

MOST_TRIANGLES = 2_000_000
FARTHEST = 20_000.0  # [m] from the middle: largest tile
_EARTH = (6_378_137.0, 6_356_752.314245)  # half axes of the WGS 84 ellipsoid [m]
_SHELL = 30_000.0  # [m] heights above the ellipsoid at which coordinates are taken as geocentric
_OFF_EQUATOR = 20_000.0  # [m]: a projected northing may be as large as the earth's radius, a height may not


@dataclass(frozen=True, eq=False)
class MeshSoup:
    """Triangles of a world.

    Attributes:
        triangles: Corners [m], z up, shape (T, 3, 3), float64.
        st: Texture coordinates of the corners, v upwards [1], shape (T, 3, 2), float64.
        skin: Number of each triangle's image, -1 for none, shape (T,), int32.
        skins: The images.
        facts: Metadata of the file: `author`, `license`, `title` ...
    """

    triangles: F64
    st: F64
    skin: I32
    skins: tuple[Skin, ...]
    facts: dict[str, str]


def joined_soup(parts: list[MeshSoup], facts: dict[str, str]) -> MeshSoup:
    """Concatenate soups; an image that several of them use is stored once.

    Args:
        parts: Soups.
        facts: Metadata of the file.
    """
    skins = {skin.role: skin for part in parts for skin in part.skins}
    number = {role: k for k, role in enumerate(skins)}
    turned = []
    for part in parts:
        table = np.array([number[skin.role] for skin in part.skins] + [-1], np.int32)
        turned.append(table[part.skin])
    none = MeshSoup(np.zeros((0, 3, 3)), np.zeros((0, 3, 2)), np.zeros(0, np.int32), (), {})
    every = [none, *parts]
    return MeshSoup(
        np.concatenate([part.triangles for part in every]),
        np.concatenate([part.st for part in every]),
        np.concatenate([none.skin, *turned]),
        tuple(skins.values()),
        facts,
    )


def check_count(count: int, where: object) -> None:
    """Refuse a file that is too large, before it is read.

    Args:
        count: Stated number of triangles.
        where: The file.

    Raises:
        InputError: Too many.
    """
    if count > MOST_TRIANGLES:
        raise InputError(
            f"holds {count} triangles",
            where=where,
            allowed=f"at most {MOST_TRIANGLES}",
            hint="Cut out a smaller tile, or decimate it",
        )


def centered(soup: MeshSoup, where: object, warn: Warn) -> MeshSoup:
    """Move a world to its own origin: the middle of its plan, whole meters, its lowest point at 0.

    Geocentric coordinates (as in 3D tiles) are rotated so that z is up at the middle.

    Args:
        soup: Triangles [m], z up.
        where: The file, for errors.
        warn: Called when geocentric coordinates were rotated.

    Returns:
        The same triangles; `origin` in its facts is their former position.

    Raises:
        InputError: No triangle, a number that is not finite, or a world larger than a tile.
    """
    if not len(soup.triangles):
        raise InputError("holds no triangles", where=where, hint="Export a mesh; points and lines cannot be imported")
    for what, values in (("position", soup.triangles), ("texture coordinate", soup.st)):
        if not np.isfinite(values).all():
            raise InputError(f"holds a {what} that is not finite", where=where, hint="Repair the mesh")
    points = soup.triangles.reshape(-1, 3)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    triangles, facts = soup.triangles - middle, dict(soup.facts)
    if _is_geocentric(middle):
        warn("geocentric coordinates: rotated so that z is up at the middle")
        triangles, facts["crs"] = triangles @ _local_frame(middle).T, "geocentric"
    reach = float(np.abs(triangles).max())
    if reach > FARTHEST:
        raise InputError(
            f"extends {reach / 1e3:.0f} km from its middle",
            where=where,
            allowed=f"up to {FARTHEST / 1e3:g} km",
            hint="Cut out a smaller tile, or correct its unit with --scale",
        )
    # Whole meters in plan, so that a position can be found in maps again; not for geocentric ones.
    rest = np.zeros(3) if facts.get("crs") == "geocentric" else middle - np.round(middle)
    rest[2] = -float(triangles[..., 2].min())
    origin = middle if facts.get("crs") == "geocentric" else middle - rest
    facts["origin"] = " ".join(f"{value:.3f}" for value in origin)
    return MeshSoup(triangles + rest, soup.st, soup.skin, soup.skins, facts)


def _is_geocentric(middle: F64) -> bool:
    a, b = _EARTH
    distance = float(np.linalg.norm(middle))
    return b - _SHELL < distance < a + _SHELL and abs(float(middle[2])) > _OFF_EQUATOR


def _local_frame(middle: F64) -> F64:
    """Find east, north and up at a geocentric position, shape (3, 3), float64."""
    a, b = _EARTH
    up = middle / np.array([a * a, a * a, b * b])
    up /= np.linalg.norm(up)
    east = np.array([-middle[1], middle[0], 0.0])
    east /= np.linalg.norm(east)
    return np.stack([east, np.cross(up, east), up])
