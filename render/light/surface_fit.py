"""Fit of a light volume to the irradiance of surfaces, so that light does not leak through thin parts.

Between two probes there may be a slab or a flange with one side lit and the other dark. So the irradiance at positions
on the surfaces is ray cast too, and the probes are changed as little as necessary to reproduce it in the shader.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from render.light.daylight import sphere
from render.light.half_axes import COUNT, MEAN, weigh
from render.light.tracing import CHUNK, Hits, LightTracer, joined
from usd_schemas.components import BACKGROUND

if TYPE_CHECKING:
    from scipy.sparse import csr_array

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

AHEAD = 0.25  # distance in front of a surface at which the volume is read [cells]
_SEED = 28  # of positions and of the rotations of their rays
_TURNS = 61  # sets of rays, rotated against each other
_LIFT = 0.004  # [m] rays start off the surface
_TOUCHING = 0.6  # [m] if a ray from a surface hits something this close, the surface may be covered
_COVERED = 0.6  # a position may be covered if at least this share of its rays hits such things or back faces
_WITHIN = 0.08  # it is covered if, besides, this share hits back faces: a slab under its surfacing
# [m] It is covered, too, if the upper side of what lies on it is this close. Such positions are never seen, and would
# darken that upper side. A pier cap and the soffit over it are as close, but seen: without positions they would glow.
_COVER = 0.6
_DARKEST = 0.03  # share of the greatest irradiance below which errors count as absolute, not relative [1]
_TRUST = 0.1  # weight of a probe's cast value, relative to 1 for a position on a surface [1]
_SMOOTH = 0.5  # weight of a difference between the changes of neighboring probes, relative to `_TRUST` [1]
_STEPS = 20  # of conjugate gradients: twice as many change no surface's light by a hundredth
_SHARE = 0.7  # share of the positions that are on labeled objects [1]


@dataclass(frozen=True)
class Places:
    """Positions on surfaces.

    Attributes:
        position: Positions [m], shape (N, 3), float64.
        normal: Unit normals [1], shape (N, 3), float64.
    """

    position: F64
    normal: F64


def spread_places(tracer: LightTracer, low: F64, high: F64, count: int) -> Places:
    """Distribute positions over the surfaces in a box by area, most of them over labeled objects.

    Args:
        tracer: The scene.
        low: Lower corner of the box [m], shape (3,), float64.
        high: Upper corner [m], shape (3,), float64.
        count: Largest number.
    """
    corners = tracer.corners
    inside = np.all((corners.max(axis=1) > low) & (corners.min(axis=1) < high), axis=1)
    labeled = (tracer.scene.draws.label != BACKGROUND)[tracer.draws]
    rng = np.random.default_rng(_SEED)
    found = [
        _spread(tracer, np.flatnonzero(inside & (labeled == wanted)), low, high, round(count * share), rng)
        for wanted, share in ((True, _SHARE), (False, 1 - _SHARE))
    ]
    return Places(*(np.concatenate(part) for part in zip(*found, strict=True)))


def _spread(
    tracer: LightTracer, rows: I64, low: F64, high: F64, count: int, rng: np.random.Generator
) -> tuple[F64, F64]:
    """Spread places over some triangles, and keep those in the box."""
    corners = tracer.corners[rows]
    side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    lower, upper = np.maximum(corners.min(axis=1), low), np.minimum(corners.max(axis=1), high)
    span = corners.max(axis=1) - corners.min(axis=1)
    share = np.clip((upper - lower) / np.maximum(span, 1e-9), 1e-3, 1.0)
    held = np.prod(np.where(span > 1e-6, share, 1.0), axis=1)  # approximate share of it in the box
    area = np.linalg.norm(np.cross(side, other), axis=1) * held
    if not len(rows) or not area.any():
        return np.zeros((0, 3)), np.zeros((0, 3))
    total = np.cumsum(area)
    chosen = np.searchsorted(total, (np.arange(count) + rng.random(count)) / count * total[-1])
    chosen = np.minimum(chosen, len(rows) - 1)
    first, second = rng.random(count), rng.random(count)
    folded = first + second > 1
    first, second = np.where(folded, 1 - first, first), np.where(folded, 1 - second, second)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    points = corners[chosen, 0] + first[:, None] * side[chosen] + second[:, None] * other[chosen]
    kept = np.all(np.abs(points - middle[chosen]) <= half[chosen] + 1e-9, axis=1)
    return points[kept], tracer.normals[rows[chosen[kept]]].astype(np.float64)


def cast_places(tracer: LightTracer, places: Places, rays: int) -> tuple[Places, F32, Hits]:
    """Cast rays from positions, distributed by the cosine to the normal.

    Args:
        tracer: The scene.
        places: Positions on its surfaces.
        rays: Number of rays of each.

    Returns:
        Positions that are not covered; radiance along each ray [1], shape (N * rays, 3), float32; hits of the rays.
    """
    rng = np.random.default_rng(_SEED + 1)
    turns, _ = np.linalg.qr(rng.standard_normal((_TURNS, 3, 3)))
    sets = np.einsum("tij,rj->tri", turns, sphere(rays))
    step, kept, radiance, parts, done = max(1, CHUNK // rays), [], [], [], 0
    for start in range(0, len(places.position), step):
        rows = np.arange(start, min(start + step, len(places.position)))
        aims = places.normal[rows, None] + 0.999 * sets[rows % _TURNS]
        aims = (aims / np.linalg.norm(aims, axis=2, keepdims=True)).reshape(-1, 3)
        starts = np.repeat(places.position[rows] + _LIFT * places.normal[rows], rays, axis=0)
        light, hits = tracer.trace(starts, aims, _TOUCHING)
        behind, hidden = (
            np.bincount(hits.ray[met] // rays, minlength=len(rows)) / rays
            for met in (hits.behind, hits.near | hits.behind)
        )
        under = (behind > _WITHIN) | tracer.topped(places.position[rows], places.normal[rows], _COVER)
        open_rows = (hidden <= _COVERED) | ~under
        number = np.cumsum(open_rows) - 1 + done
        stays = open_rows[hits.ray // rays]
        ray = number[hits.ray // rays] * rays + hits.ray % rays
        parts.append(
            Hits(
                ray[stays],
                hits.position[stays],
                hits.normal[stays],
                hits.albedo[stays],
                hits.near[stays],
                hits.behind[stays],
            )
        )
        radiance.append(light.reshape(-1, rays, 3)[open_rows].reshape(-1, 3))
        kept.append(rows[open_rows])
        done += int(open_rows.sum())
    chosen = np.concatenate(kept)
    return Places(places.position[chosen], places.normal[chosen]), np.concatenate(radiance), joined(parts)


def fit_to_surfaces(
    coefficients: F32, lower: F64, cell: float, places: Places, irradiance: F32, before: F32 | None = None
) -> F32:
    """Change probes as little as needed for the correct irradiance of each surface.

    Solves (A' W A + L) d = A' W (e - A c) for the change d, where A is the shader's look-up in the volume, and W and L
    weigh errors as shares of the irradiance.

    Source: Hestenes and Stiefel, Methods of conjugate gradients for solving linear systems, 1952.

    Args:
        coefficients: Those of every probe, as in `half_axes` [1], shape (Z, Y, X, 7, 3), float32.
        lower: Position of the first probe [m], shape (3,), float64.
        cell: Distance of neighboring probes [m].
        places: Positions on surfaces, N of them.
        irradiance: Their irradiance [1], shape (N, 3), float32.
        before: Coefficients of an earlier fit, whose irradiance errors are related to [1], shape (Z, Y, X, 7, 3),
            float32. A position casts few rays: relative to the light that these few find, light that they miss would
            count more than light that they hit, and the fit would be a fifth too dark below decks. None: there is no
            earlier fit.

    Returns:
        Coefficients [1], shape (Z, Y, X, 7, 3), float32.
    """
    matrix, inside = look_up_matrix(coefficients.shape[2::-1], lower, cell, places)
    wanted = irradiance[inside].astype(np.float64)
    if not len(wanted):
        return coefficients
    table = coefficients.reshape(-1, 3).astype(np.float64)
    # From surfaces and air: if few positions are lit, surfaces alone would give the errors of dark ones too much
    # weight.
    greatest = max(float(np.quantile(light.mean(axis=1), 0.99)) for light in (wanted, table[MEAN::COUNT]))
    level = _DARKEST * max(greatest, 1e-9)
    guess = wanted if before is None else np.maximum(matrix @ before.reshape(-1, 3).astype(np.float64), 0)
    weight = 1 / (guess.mean(axis=1) + level) ** 2
    held = _TRUST / (np.repeat(np.maximum(table[MEAN::COUNT].mean(axis=1), 0), COUNT) + level) ** 2
    weighted = matrix.multiply(weight[:, None]).tocsr()
    scale = 1 / np.sqrt(np.asarray(matrix.multiply(matrix).T @ weight).ravel() + held)

    def applied(change: F64) -> F64:
        moved = scale[:, None] * change
        kept = held[:, None] * moved + _uneven(moved, held, coefficients.shape)
        return scale[:, None] * (weighted.T @ (matrix @ moved) + kept)

    change = _solved(applied, scale[:, None] * (weighted.T @ (wanted - matrix @ table)))
    return (table + scale[:, None] * change).reshape(coefficients.shape).astype(np.float32)


def _uneven(change: F64, held: F64, shape: tuple[int, ...]) -> F64:
    """Weight the differences of the change between neighboring probes, shape (M, 3)."""
    grid = change.reshape(shape)
    weight = _SMOOTH * held.reshape(*shape[:4], 1)
    result = np.zeros(shape)
    for axis in range(3):
        near, far = ((slice(None),) * axis + (slice(first, first + shape[axis] - 1),) for first in (0, 1))
        pull = np.minimum(weight[near], weight[far]) * (grid[near] - grid[far])
        result[near] += pull
        result[far] -= pull
    return result.reshape(change.shape)


def look_up_matrix(
    counts: tuple[int, ...], lower: F64, cell: float, places: Places
) -> "tuple[csr_array, NDArray[np.bool_]]":
    """Express the shader's look-up in a light volume as a matrix.

    Args:
        counts: Probes along x, y and z.
        lower: Position of the first probe [m], shape (3,), float64.
        cell: Distance of neighboring probes [m].
        places: Positions on surfaces.

    Returns:
        Weight of every coefficient, shape (N, 7 * probes), for the positions in the volume; whether each is in it,
        bool.
    """
    from scipy.sparse import csr_array

    shape = np.array(counts)
    at = (places.position - lower) / cell + AHEAD * places.normal
    inside = np.all((at >= 0) & (at < shape - 1), axis=1)
    at = at[inside]
    first = at.astype(np.int64)
    part = at - first
    number, weight = weigh(places.normal[inside])
    columns, values = [], []
    for corner in range(8):
        step = np.array([corner & 1, corner >> 1 & 1, corner >> 2])
        x, y, z = (first + step).T
        share = np.prod(np.where(step, part, 1 - part), axis=1)
        columns.append(COUNT * ((z * shape[1] + y) * shape[0] + x)[:, None] + number)
        values.append(share[:, None] * weight)
    rows = np.arange(len(at) + 1) * 32
    content = (np.hstack(values).ravel(), np.hstack(columns).ravel(), rows)
    return csr_array(content, shape=(len(at), COUNT * int(np.prod(shape)))), inside


def _solved(applied: Callable[[F64], F64], wanted: F64) -> F64:
    """Solve a symmetric system for three right sides at once by conjugate gradients, shape (M, 3)."""
    result = np.zeros_like(wanted)
    rest, way = wanted.copy(), wanted.copy()
    square = np.sum(rest**2, axis=0)
    for _ in range(_STEPS):
        moved = applied(way)
        step = square / np.maximum(np.sum(way * moved, axis=0), 1e-300)
        result += step * way
        rest -= step * moved
        before, square = square, np.sum(rest**2, axis=0)
        way = rest + square / np.maximum(before, 1e-300) * way
    return result
