"""Parts of the facades of houses: windows with surrounds and shutters, doors, balconies, plinths."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.plots import DEEP
from authoring.backgrounds.solids import Frame, box, solid
from authoring.shapes.component import Mesh
from authoring.site.ways import merged

F64 = NDArray[np.float64]

STOREY = 3.0  # [m]
HOME = Frame(0.0, 0.0, 0.0, 0.0)
FACES = 4  # of a house: 0 the front towards -y, 1 towards +x, 2 the back, 3 towards -x


def openings(half: tuple[float, float], storeys: int, rng: np.random.Generator) -> tuple[F64, NDArray[np.int64]]:
    """Place windows on four walls.

    Args:
        half: Half the length and depth of the walls [m].
        storeys: Number of storeys.
        rng: Random stream.

    Returns:
        Middles [m], shape (N, 3), float64; the face of each, shape (N,), int64.
    """
    pitch = float(rng.uniform(2.5, 3.4))
    rows, faces = [], []
    for face in range(FACES):
        reach, width = (half[1], half[0]) if face % 2 == 0 else (half[0], half[1])
        count = max(int((2 * width - 1.2) / pitch), 1)
        if face % 2 and width < 4.2:
            count = 1
        along = (np.arange(count) - (count - 1) / 2) * pitch
        turn = face * np.pi / 2
        for storey in range(storeys):
            x, y = along, np.full(count, -reach)
            place = (x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn))
            rows.append(np.column_stack([*place, np.full(count, storey * STOREY + 1.62)]))
            faces.append(np.full(count, face))
    return np.concatenate(rows), np.concatenate(faces)


def window(shutters: bool, rng: np.random.Generator) -> tuple[Mesh, tuple[Mesh, Mesh | None]]:
    """Model a window, x to its right and y into the wall: panes, and their surround and shutters.

    Args:
        shutters: It has shutters.
        rng: Random stream.
    """
    wide, tall = float(rng.uniform(0.48, 0.7)), float(rng.uniform(0.62, 0.8))
    panes = [box(HOME, (s * 0.5 * wide, 0.02, 0.0), (0.5 * wide - 0.02, 0.05, tall), "y") for s in (-1.0, 1.0)]
    surround = [
        *(box(HOME, (s * (wide + 0.05), -0.02, 0.0), (0.06, 0.08, tall + 0.02), "yxX") for s in (-1.0, 1.0)),
        box(HOME, (0.0, -0.02, tall + 0.06), (wide + 0.11, 0.08, 0.06), "yzZxX"),
        box(HOME, (0.0, -0.05, -tall - 0.05), (wide + 0.18, 0.13, 0.05), "yzZxX"),
    ]  # faces inside the wall are not visible
    leaves = [
        box(HOME, (s * (1.5 * wide + 0.12), -0.03, 0.0), (0.48 * wide, 0.035, tall), "yzZxX") for s in (-1.0, 1.0)
    ]
    return merged(panes), (merged(surround), merged(leaves) if shutters else None)


def sheets(shutters: bool) -> tuple[Mesh, Mesh]:
    """Make a plain window of two faces in front of the wall: its pane, and behind it its surround or open shutters.

    Args:
        shutters: It has shutters.
    """
    return _sheet(0.6, 0.75, 0.08), _sheet(1.12 if shutters else 0.76, 0.78 if shutters else 0.92, 0.03)


def _sheet(wide: float, tall: float, out: float) -> Mesh:
    corners = [(-wide, -out, -tall), (wide, -out, -tall), (wide, -out, tall), (-wide, -out, tall)]
    return solid(HOME, np.array(corners), [[0, 1, 2, 3]])


def door(place: tuple[float, float], wide: float) -> Mesh:
    """Model a door in the front, a step before it.

    Args:
        place: Its middle on the wall [m].
        wide: Half its width [m].
    """
    x, y = place
    leaf = box(HOME, (x, y - 0.02, 1.08), (wide, 0.05, 1.08), "yxXZ")
    return merged([leaf, box(HOME, (x, y - 0.45, -0.35), (wide + 0.3, 0.45, 0.4), "yxXZ")])


def balcony(wide: float, deep: float) -> tuple[Mesh, Mesh]:
    """Model the balcony of a storey along the front: its slab and its railing.

    Args:
        wide: Half its width [m].
        deep: Its depth [m].
    """
    slab = box(HOME, (0.0, 0.1 - deep / 2, 0.0), (wide, deep / 2 + 0.1, 0.09))
    rails = [box(HOME, (0.0, 0.06 - deep, h), (wide, 0.03, 0.03)) for h in (0.55, 1.02)]
    posts = np.linspace(-wide + 0.04, wide - 0.04, max(int(2 * wide / 1.1), 2))
    rails += [box(HOME, (float(p), 0.06 - deep, 0.55), (0.025, 0.025, 0.5)) for p in posts]
    return slab, merged(rails)


def plain_balcony(wide: float, deep: float) -> Mesh:
    """Model a balcony seen from afar: a slab with a solid parapet.

    Args:
        wide: Half its width [m].
        deep: Its depth [m].
    """
    slab = box(HOME, (0.0, -deep / 2, 0.0), (wide, deep / 2, 0.09), "yxXzZ")
    return merged([slab, box(HOME, (0.0, 0.04 - deep, 0.55), (wide, 0.04, 0.5), "yYxXZ")])


def plinth(half: tuple[float, float], wall: str, at: tuple[float, float]) -> Mesh:
    """Model a plinth that projects from the wall, up to 0.3 m above the floor, or to the floor if the wall is of brick.

    Args:
        half: Half the length and depth of the walls [m].
        wall: Material recipe of the walls.
        at: Their middle [m].
    """
    low, high = -DEEP - 0.5, 0.0 if wall == "brick" else 0.3
    out = 0.04 if wall == "brick" else 0.06
    return box(HOME, (*at, (low + high) / 2), (half[0] + out, half[1] + out, (high - low) / 2))
