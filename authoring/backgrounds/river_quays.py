"""Quay walls with promenades where the river of a site continues through a town."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.quads import quad_mesh
from authoring.backgrounds.streets import QUAY
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh
from authoring.site.covers import to_world
from authoring.site.roads import spread
from authoring.site.shape import Land
from authoring.site.ways import Line, merged, ribbon

F64 = NDArray[np.float64]

START = 2.5  # from the site's border to a quay's end [m]
_STEP = 6.0  # between cross-sections [m]
_IN_WATER = 0.4  # distance of the wall's face from the water's edge, on the water's side [m]
_COPING = 0.5  # width of the coping [m]
_BROOK = 5.0  # largest half width of a brook [m]
_PAVED = 0.16  # height of the promenade over the land [m]


def has_quays(land: Land) -> bool:
    """Check whether the crossing is a river, not a brook at the bottom of a valley.

    Args:
        land: The land, on a site or beyond it.
    """
    return land.crossing.kind == "river" and (land.valley is None or land.crossing.half_width > _BROOK)


def quays(terrain: Terrain, reach: float) -> list[tuple[str, str, str, Mesh]]:
    """Build the quays on both sides of the site and both banks.

    Args:
        terrain: The terrain.
        reach: Distance from the site at which the quays end [m].

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece.
    """
    if not has_quays(terrain.land):
        return []
    walls, paths = [], []
    low, high = terrain.inner[2:]
    for start, stop in ((low - START, low - reach), (high + START, high + reach)):
        lefts = spread(start, stop, _STEP)
        for bank in (-1.0, 1.0):
            wall, path = _quay(terrain, lefts, bank)
            walls.append(wall)
            paths.append(path)
    return [
        ("QuayWall", "wall_retaining", "masonry", merged(walls)),
        ("Promenade", "ground", "pavement", merged(paths)),
    ]


def quay_line(terrain: Terrain, lefts: F64, bank: float, back: float) -> F64:
    """Find places on a promenade.

    Args:
        terrain: The terrain.
        lefts: Distances to the left of the axis [m], shape (N,), float64.
        bank: -1 for the bank before the river, 1 for the one behind it [1].
        back: Distance behind the wall's face [m].

    Returns:
        World positions on the promenade [m], shape (N, 3), float64.
    """
    crossing = terrain.land.crossing
    away = crossing.half_width - _IN_WATER + back
    station = crossing.center(lefts) + bank * away * crossing.stretch(lefts)
    level = np.full(len(lefts), _PAVED)
    return to_world(terrain.land.layout.alignment, np.column_stack([station, lefts, level]))


def _quay(terrain: Terrain, lefts: F64, bank: float) -> tuple[Mesh, Mesh]:
    """Sweep one wall and its promenade; rows run from the line's left to its right."""
    crossing, axis = terrain.land.crossing, terrain.land.layout.alignment
    aside = -np.sign(lefts[-1] - lefts[0]) * crossing.stretch(lefts)
    line = Line(crossing.center(lefts), lefts, np.column_stack([aside, np.zeros(len(lefts))]))
    leftward = bank * np.sign(aside[0])
    foot, face = crossing.level - crossing.depth - 0.6, crossing.half_width - _IN_WATER
    back = crossing.half_width + QUAY
    wall = [
        (face, foot),
        (face, _PAVED - 0.1),
        (face - 0.1, _PAVED - 0.1),
        (face - 0.1, _PAVED + 0.12),
        (face + _COPING, _PAVED + 0.12),
        (face + _COPING, _PAVED),
    ]
    path = [(face + _COPING, _PAVED), (back, _PAVED), (back, -0.6)]
    meshes = []
    for profile in (wall, path):
        rows = [np.column_stack([line.offset(leftward * out), np.full(len(lefts), level)]) for out, level in profile]
        across = np.concatenate([[0.0], np.cumsum([np.hypot(*np.subtract(b, a)) for a, b in pairwise(profile)])])
        order = slice(None, None, -1) if leftward > 0 else slice(None)
        meshes.append(ribbon(axis, rows[order], line.length(), tuple(across[order].tolist())))
    ends = []
    for row, flip in ((0, False), (len(lefts) - 1, True)):
        corners = [
            [*(np.array([line.station[row], line.left[row]]) + leftward * out * line.across[row]), level]
            for out, level in ((face, foot), (back, foot), (back, _PAVED), (face, _PAVED))
        ]
        quad = to_world(axis, np.array(corners, np.float64))[None]
        ends.append(quad[:, ::-1] if flip == (leftward > 0) else quad)
    return merged([meshes[0], quad_mesh(np.concatenate(ends))]), meshes[1]
