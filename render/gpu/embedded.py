"""Detection of bars that are embedded in a surface: sleepers in ballast, whose sides are mostly hidden.

Such a bar is drawn as what stands out of the surface: its exposed face, and a low edge of its sides.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import FlatScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SLENDER = 6.0  # least ratio of length to width; as in bars.py
_WIDEST = 0.40  # [m] widest bar: a sleeper is 0.20 to 0.30 m wide
_LENGTHS = (1.2, 7.0)  # [m] shortest and longest bar: from sleepers of narrow gauges to those of a switch
_CORNERS = (8, 64)  # fewest and most corners of a body with the shape of a block
_FILLED = 0.5  # corners lie at least this far from the axis along both half axes of the cross-section [1]
_PROUD = 0.16  # [m] largest height above the surface around it: its sides are then narrower than its top
_LEAST = 0.25  # of its height is hidden at least [1]
_ASIDE = 0.01  # [m] from the bar's sides and top to where the rays run
_PLACES = (-0.35, 0.0, 0.35)  # where the surface is measured, from the middle, as a share of the length
_CELL = 8.0  # [m] side of the cells that triangles are sorted into


@dataclass(frozen=True)
class Faces:
    """Exposed faces of embedded bars and what stands out of the surface below them, in mesh-local axes.

    Attributes:
        ends: Middles of the two ends of what stands out [stage units], shape (N, 2, 3), float64.
        aside: Half its width [stage units], shape (N, 3), float64.
        up: Half its height [stage units], shape (N, 3), float64.
        corner: A corner of the body at each of these ends, shape (N, 2), int64.
        face: Face of each corner of a body, -1 without one, shape (P,), int64.
        end: Which end of the face the corner belongs to, shape (P,), int64.
    """

    ends: F64
    aside: F64
    up: F64
    corner: I64
    face: I64
    end: I64


@dataclass(frozen=True)
class _Blocks:
    """Slender blocks: middle and half axes (along, and the two across) [stage units], and a draw of each.

    `number` is the block of each corner, -1 without one, and `place` the corner's coordinates along the half axes [1].
    """

    middle: F64
    half: F64
    draw: I64
    number: I64
    place: F64


def embedded_faces(scene: FlatScene, positions: F64, part: I64, body: I64) -> Faces:
    """Find the slender blocks whose long sides are hidden in the surface around them, but for a low edge.

    Args:
        scene: A scene.
        positions: Corners of bodies [stage units], shape (P, 3), float64.
        part: Part of each corner, shape (P,), int64.
        body: Body of each corner, shape (P,), int64.
    """
    blocks = _blocks(scene, positions, part, body)
    axis, sign, shown = _exposed_axes(scene, blocks)
    chosen = np.flatnonzero(sign)
    row = np.full(len(sign) + 1, -1)
    row[chosen] = np.arange(len(chosen))
    face = row[blocks.number]  # the last one, of no block, is -1
    axis, sign, shown = axis[chosen], sign[chosen], shown[chosen]
    middle, half, rows = blocks.middle[chosen], blocks.half[chosen], np.arange(len(chosen))
    own = np.flatnonzero(face >= 0)
    height = blocks.place[own, axis[face[own]]] * sign[face[own]]
    above = own[height > 0]
    width = np.abs(blocks.place[above, 3 - axis[face[above]]])
    width = np.bincount(face[above], width, len(chosen)) / np.maximum(
        np.bincount(face[above], minlength=len(chosen)), 1
    )
    end = (blocks.place[:, 0] > 0).astype(np.int64)
    corner = np.zeros((len(chosen), 2), np.int64)
    lowest_first = own[np.argsort(height, kind="stable")]
    corner[face[lowest_first], end[lowest_first]] = lowest_first  # the last one stays
    up = half[rows, axis] * sign[:, None]
    center = middle + up * (1 - shown)[:, None]
    ends = np.stack([center - half[:, 0], center + half[:, 0]], axis=1)
    return Faces(ends, half[rows, 3 - axis] * width[:, None], up * shown[:, None], corner, face, end)


def _blocks(scene: FlatScene, positions: F64, part: I64, body: I64) -> _Blocks:
    """Find the bodies whose corners lie near the long edges of a slender box."""
    draw_of = np.full(len(scene.geometry.part_first), -1)
    draw_of[scene.draws.part[::-1]] = np.arange(len(scene.draws.part))[::-1]
    scale = np.zeros(len(draw_of))
    scale[draw_of >= 0] = np.linalg.norm(scene.draws.transform[draw_of[draw_of >= 0], :3, 0], axis=1)
    count = np.bincount(body)
    some = np.zeros(len(count), np.int64)
    some[body] = part  # a body lies in one part
    low, high = np.full((len(count), 3), np.inf), np.full((len(count), 3), -np.inf)
    np.minimum.at(low, body, positions)
    np.maximum.at(high, body, positions)
    length = np.linalg.norm(high - low, axis=1) * scale[some]
    fit = (count >= _CORNERS[0]) & (count <= _CORNERS[1]) & (length >= _LENGTHS[0]) & (length <= _LENGTHS[1])
    number = np.full(len(count), -1)
    number[fit] = np.arange(np.count_nonzero(fit))
    number, total = number[body], int(np.count_nonzero(fit))
    own = np.flatnonzero(number >= 0)
    axes, middle, half = _boxes(positions[own], number[own], total)
    place = np.zeros(positions.shape)
    place[own] = np.einsum("pij,pj->pi", axes[number[own]], positions[own] - middle[number[own]])
    place[own] /= np.maximum(half[number[own]], 1e-9)
    hollow = np.zeros(total, bool)
    hollow[number[own[(np.abs(place[own, 1:]) < _FILLED).any(axis=1)]]] = True
    size = 2 * half * scale[some[fit], None]
    good = ~hollow & (size[:, 1] <= _WIDEST) & (size[:, 2] > 0) & (size[:, 0] >= _SLENDER * size[:, 1])
    row = np.full(total + 1, -1)
    row[:-1][good] = np.arange(np.count_nonzero(good))
    return _Blocks(middle[good], (axes * half[..., None])[good], draw_of[some[fit]][good], row[number], place)


def _boxes(positions: F64, number: I64, total: int) -> tuple[F64, F64, F64]:
    """Fit a box to each body: its axes, longest first, shape (N, 3, 3); middle and half size, each shape (N, 3)."""
    count = np.maximum(np.bincount(number, minlength=total), 1)[:, None]
    mean = np.stack([np.bincount(number, positions[:, k], total) for k in range(3)], axis=1) / count
    spokes = positions - mean[number]
    spread = np.zeros((total, 3, 3))
    for row in range(3):
        for column in range(3):
            spread[:, row, column] = np.bincount(number, spokes[:, row] * spokes[:, column], total)
    axes = np.linalg.eigh(spread)[1].transpose(0, 2, 1)[:, ::-1]
    along = np.einsum("pij,pj->pi", axes[number], spokes)
    low, high = np.full((total, 3), np.inf), np.full((total, 3), -np.inf)
    np.minimum.at(low, number, along)
    np.maximum.at(high, number, along)
    low, high = np.minimum(low, high), np.maximum(low, high)
    middle = mean + np.einsum("nij,ni->nj", axes, (low + high) / 2)
    return axes, middle, (high - low) / 2


def _exposed_axes(scene: FlatScene, blocks: _Blocks) -> tuple[I64, I64, F64]:
    """Find which half axis leads to the exposed face, 1 or 2; in which sense, 1, -1 or 0; share of the height shown."""
    axes, signs, shown = *np.zeros((2, len(blocks.draw)), np.int64), np.zeros(len(blocks.draw))
    if not len(axes):
        return axes, signs, shown
    from usd_schemas.raycast import RayScene  # its memory is not needed for drawing

    place = scene.draws.transform[blocks.draw]
    middle = np.einsum("nij,nj->ni", place[:, :3, :3], blocks.middle) + place[:, :3, 3]
    half = np.einsum("nij,nkj->nki", place[:, :3, :3], blocks.half)
    corners = _near_triangles(scene, middle)
    rays = RayScene(corners, np.zeros(len(corners), np.uint32))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for axis in (1, 2):
        size = np.linalg.norm(half[:, [axis, 3 - axis]], axis=2, keepdims=True)
        up, across = half[:, axis] / size[:, 0], half[:, 3 - axis] / size[:, 1]
        for sign in (1, -1):
            embedded, total = signs == 0, np.zeros(len(axes))
            for side in (-1, 1):
                for share in _PLACES:
                    start = middle + 2 * share * half[:, 0] + side * (size[:, 1] + _ASIDE) * across
                    start += sign * (size[:, 0] + _ASIDE) * up
                    height, triangle, _ = rays.cast(start, -sign * up)
                    height, faces_up = height - _ASIDE, np.sum(normals[triangle] * sign * up, axis=1) > 0
                    limit = np.minimum(_PROUD, 2 * (1 - _LEAST) * size[:, 0, 0])
                    embedded &= faces_up & (height > 0) & (height <= limit)
                    total += np.where(embedded, height, 0.0)
            mean = total / (2 * len(_PLACES))
            axes[embedded], signs[embedded] = axis, sign
            shown[embedded] = (mean / (2 * size[:, 0, 0]))[embedded]
    return axes, signs, shown


def _near_triangles(scene: FlatScene, places: F64) -> F64:
    """Collect the triangles that may lie beside some places: large ones, and those in their cells, shape (T, 3, 3).

    Their corners run counter-clockwise, seen from outside.
    """
    low, high = places.min(axis=0) - _CELL, places.max(axis=0) + _CELL
    around = np.stack(np.meshgrid(*3 * [np.arange(-1, 2)], indexing="ij"), axis=-1).reshape(-1, 3)
    wanted = np.unique(np.floor(places / _CELL).astype(np.int64), axis=0)
    wanted = np.unique(_keys((wanted[:, None] + around).reshape(-1, 3)))
    geometry, draws, found = scene.geometry, scene.draws, [np.zeros((0, 3, 3))]
    for part, transform in zip(draws.part.tolist(), draws.transform, strict=True):
        first = geometry.part_first[part]
        rows = geometry.triangles[first : first + geometry.part_count[part]]
        corners = geometry.positions[rows].astype(np.float64) @ transform[:3, :3].T + transform[:3, 3]
        corners = corners[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else corners
        least, most = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        if (least <= high).all() and (most >= low).all():
            found.append(corners)
    corners = np.concatenate(found)
    least, most = corners.min(axis=1), corners.max(axis=1)
    large = (most - least > _CELL).any(axis=1)
    inside = np.isin(_keys(np.floor((least + most) / 2 / _CELL).astype(np.int64)), wanted)
    return corners[large | inside]


def _keys(cells: I64) -> I64:
    return (cells[:, 0] * 1_000_003 + cells[:, 1]) * 1_000_003 + cells[:, 2]
