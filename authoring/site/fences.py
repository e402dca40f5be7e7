"""Right-of-way fences: timber posts with wires along both approaches, up to the wing walls.

Source: the usual stock fence, its posts 1.2 m high and 2.5 m apart, with a strainer at each corner and end.
"""

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.shapes.component import Mesh
from authoring.site.covers import to_world
from authoring.site.grid import HeightField
from authoring.site.land import no_hills
from authoring.site.shape import FILL_SLOPE, SHOULDER, WING_WALL, Approach, Land
from authoring.site.ways import Line, boxes, merged, tube
from authoring.streams import weighted_choice

F64 = NDArray[np.float64]
Piece = tuple[str, str, str, Mesh]

BESIDE_ROADS = {True: 0.6, False: 0.4}  # weights of roads with fences; railways always have them
HEIGHT = 1.2  # [m] of the posts
WIRES = (0.35, 0.75, 1.12)  # [m] heights above the ground
PITCH = 2.5  # [m] between posts
TOE = 1.5  # [m] from the toe of a fill to the fence
_LEAST = 5.0  # [m] least distance from the shoulder
AT_BORDER = 0.1  # [m] from the strip's border to the posts beside it, on both of its sides
_IN_STRIP = 2.0  # [m] least distance from the side of the strip
_AT_WALL = 1.0  # [m] from a wing wall's end, along and across, or from the rear of an anchor block, to the last post
_STEEPEST = 1.0  # slope from which on no post stands [1]
_POST, _STRAINER = (0.09, 0.09, 1.65), (0.15, 0.15, 1.9)  # [m] along, across, down
_WIRE = 0.0025  # [m] radius
_OVER = 0.06  # [m] that a strainer is higher than a post


def fenced(fences: bool | None, land: Land, rng: np.random.Generator) -> bool:
    """Decide whether right-of-way fences stand along the approaches.

    Args:
        fences: What the user asks for; None: drawn, always along railways, never in towns.
        land: The land.
        rng: Random stream; one number is drawn in every case.
    """
    drawn = weighted_choice(BESIDE_ROADS, rng.random())
    if fences is not None:
        return fences
    return (land.plots is None or land.plots.land != "town") and (drawn or land.layout.track is not None)


def fence_pieces(land: Land, ground: HeightField) -> list[Piece]:
    """Build the fences on both sides of both approaches.

    Args:
        land: The land.
        ground: The strip.

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece; none if the land is not fenced.
    """
    pieces: list[Piece] = []
    for number, side, offset in fence_sides(land):
        posts = _post_places(land, ground, land.approaches[number], offset)
        name = f"Fence_{number}_{side}"
        pieces += fence_meshes(name, land.layout.alignment, np.column_stack([posts, ground(*posts.T)]))
    return pieces


def fence_offsets(land: Land, reach: tuple[float, float]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Find the distances of the fences from the center lines of both approaches: beyond their fills' toes everywhere.

    Args:
        land: The land, without plots.
        reach: Distance that the site reaches beyond the abutments' back faces and to each side of the axis [m].

    Returns:
        As `Land.fences`; 0 where the fill reaches to the strip's border [m].
    """
    first, last = (
        (_offset(land, approach, reach, 1.0), _offset(land, approach, reach, -1.0)) for approach in land.approaches
    )
    return first, last


def _offset(land: Land, approach: Approach, reach: tuple[float, float], side: float) -> float:
    """Find the distance of one fence [m]."""
    station = (approach.back + approach.sign * np.arange(0.0, reach[0], PITCH))[:, None]
    across = np.arange(approach.half_width + SHOULDER + _LEAST, reach[1] - _IN_STRIP, 0.5)[None]
    left = approach.center(station) + side * across
    station = np.broadcast_to(station, left.shape)
    height = land.shape(station, left, no_hills).height
    room = across - land.layout.width / 2 - TOE
    room = room - FILL_SLOPE * np.abs(approach.level(land.layout, no_hills, station) - height)
    free = np.flatnonzero((room > 0.0).all(axis=0))
    return float(across[0, free[0]]) if len(free) else 0.0


def fence_sides(land: Land) -> list[tuple[int, str, float]]:
    """List the fences: number of the approach, side, and distance to the left of its center line [m].

    Args:
        land: The land.
    """
    sides = [
        (number, side, way * far)
        for number, pair in enumerate(land.fences)
        for side, way, far in zip("LR", (1.0, -1.0), pair, strict=True)
    ]
    return [fence for fence in sides if fence[2]]


def fence_meshes(name: str, axis: Alignment, posts: F64, least: int = 2) -> list[Piece]:
    """Build posts, and wires between neighbors no more than two spacings apart.

    Args:
        name: Begin of the leaf prim names.
        axis: Axis of the bridge.
        posts: Station, left and world height of the ground at the posts, in order [m], shape (N, 3), float64.
        least: Posts of the shortest stretch that is built, 2 or more [1].

    Returns:
        Leaf prim name, component kind, material recipe and mesh of the posts and of the wires; none for lone posts.
    """
    gaps = np.flatnonzero(np.linalg.norm(np.diff(posts[:, :2], axis=0), axis=1) > 2.0 * PITCH) + 1
    runs = [run for run in np.split(posts, gaps) if len(run) >= least]
    if not runs:
        return []
    timber = merged([mesh for run in runs for mesh in _posts(axis, run)])
    steel = merged([_wire(axis, run, height) for run in runs for height in WIRES])
    return [(f"{name}_Posts", "fence", "timber", timber), (f"{name}_Wires", "fence", "galvanised_steel", steel)]


def _post_places(land: Land, ground: HeightField, approach: Approach, offset: float) -> F64:
    """Place the posts from the strip's border along the approach and then to the wing wall, shape (N, 2).

    Beside anchor blocks, which stand there, the fence ends behind them.
    """
    anchorages = land.layout.anchorages
    corner = approach.back + approach.sign * (max(WING_WALL, anchorages) + _AT_WALL)
    end = ground.stations[0] if approach.sign < 0 else ground.stations[-1]
    reach = np.arange(abs(end - corner) - AT_BORDER, 0.5 * PITCH, -PITCH)
    station = corner + approach.sign * np.append(reach, 0.0)
    places = np.column_stack([station, approach.center(station) + offset])
    if not anchorages:
        wall = land.layout.width / 2 + _AT_WALL
        across = np.append(np.arange(abs(offset) - PITCH, wall + 0.5 * PITCH, -PITCH), wall)
        left = np.sign(offset) * across + approach.center(np.array(corner))
        places = np.concatenate([places, np.column_stack([np.full(len(left), corner), left])])
    station, left = places.T
    crossing = land.crossing
    free = crossing.distance(station, left) > crossing.half_width + SHOULDER + TOE
    free &= land.steepness(station, left, no_hills) < _STEEPEST
    return places[free]


def _posts(axis: Alignment, run: F64) -> list[Mesh]:
    """Make the posts of a run, a strainer at its ends and corners."""
    tops = to_world(axis, run) + np.array([0.0, 0.0, HEIGHT])
    ahead = _headings(tops)
    steps = np.diff(tops[:, :2], axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    straight = np.concatenate([[0.0], (steps[:-1] * steps[1:]).sum(axis=1), [0.0]]) > 0.9
    up = np.tile([0.0, 0.0, 1.0], (len(run), 1))
    meshes = []
    for which, size, over in ((straight, _POST, 0.0), (~straight, _STRAINER, _OVER)):
        if which.any():
            top = tops[which] + np.array([0.0, 0.0, over])
            meshes.append(boxes(top, ahead[which], np.cross(up, ahead)[which], up[which], size))
    return meshes


def _headings(places: F64) -> F64:
    """Compute horizontal unit vectors along a polyline at its points, shape (N, 3)."""
    ahead = np.asarray(np.gradient(places, axis=0), np.float64)
    ahead[:, 2] = 0.0
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def _wire(axis: Alignment, run: F64, height: float) -> Mesh:
    """Make a wire of square section through the posts; its open ends lie in the strainers."""
    ahead = _headings(np.column_stack([run[:, :2], np.zeros(len(run))]))
    line = Line(run[:, 0], run[:, 1], np.column_stack([-ahead[:, 1], ahead[:, 0]]))
    ring = ((_WIRE, 0.0), (0.0, _WIRE), (-_WIRE, 0.0), (0.0, -_WIRE))
    rows = [np.column_stack([line.offset(left), run[:, 2] + height + up]) for left, up in ring]
    girth = tuple(float(_WIRE * np.sqrt(2.0) * number) for number in range(len(ring) + 1))
    return tube(axis, rows, line.length(), girth)
