"""Curves with a width as tubes, and points with a width as spheres."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from usd_schemas.reading.traversal import UnreadableMeshError, numbers_of, table_of

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

STRANDS = ("BasisCurves", "Points")
_FINENESS = (
    (12, 12),
    (8, 6),
    (6, 3),
    (4, 2),
    (3, 1),
)  # sides of a tube, steps of a segment: the first within the limit below
_MOST_CORNERS = 4_000_000
_BALLS = ((3, 200), (2, 2_000), (1, 20_000), (0, 200_000))  # refinements of an octahedron, up to which number of points
_SHORT = 1e-12  # [stage units] shorter vectors have no direction


@dataclass(frozen=True)
class Strands:
    """A polygon mesh, with values at its points.

    Attributes:
        points: Positions [stage units], shape (V, 3), float64.
        normals: Unit normals [1], shape (V, 3), float64.
        colors: Linear colors [1], shape (V, 3), float64, or None.
        counts: Corners of each face, shape (F,), int64.
        corners: Point of each corner, counter-clockwise from outside, shape (C,), int64.
    """

    points: F64
    normals: F64
    colors: F64 | None
    counts: I64
    corners: I64


@dataclass(frozen=True)
class _Run:
    """Curves with equally many points.

    Attributes:
        curves: Their numbers, shape (M,), int64.
        points: Number of each of their points, shape (M, N), int64.
        ends: Number of each of their segments' ends, shape (M, K), int64.
        vertex: Weights of points at each sample, shape (S, N), float64.
        varying: Weights of what changes evenly from segment to segment, shape (S, K), float64.
        closed: The last sample is the first.
    """

    curves: I64
    points: I64
    ends: I64
    vertex: F64
    varying: F64
    closed: bool


def has_width(prim: Usd.Prim) -> bool:
    """Tell whether curves or points have a width.

    Args:
        prim: A prim of a type in `STRANDS`.
    """
    return any(prim.GetAttribute(name).HasAuthoredValue() for name in ("widths", "primvars:widths"))


def read_strands(prim: Usd.Prim, time: Usd.TimeCode, color_name: str, notes: list[str]) -> Strands:
    """Read curves or points with a width.

    Args:
        prim: A prim of a type in `STRANDS`.
        time: Time code at which they are read.
        color_name: Primvar of their colors.
        notes: Receives a line for each thing that is not drawn as authored.

    Raises:
        UnreadableMeshError: Arrays of other types, or that contradict each other.
    """
    points = table_of(prim.GetAttribute("points").Get(time), 3)
    if points is None or not np.isfinite(points).all():
        raise UnreadableMeshError("its points are not finite, or have a wrong type")
    colored = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(color_name)
    colors = table_of(colored.ComputeFlattened(time), 3) if colored and colored.HasValue() else None
    colors = None if colors is None or not len(colors) else colors
    told = str(colored.GetInterpolation()) if colored else ""
    widths, held = _widths(prim, time)
    if prim.GetTypeName() == "Points":
        return _balls(points, widths, colors, notes)
    runs, sizes, sides = _runs(prim, len(points), time, notes)
    pieces = []
    for run in runs:
        radius = _at_samples(widths, held, run, sizes) / 2
        color = None if colors is None else _at_samples(colors, told, run, sizes)
        pieces.append(_tubes(np.einsum("sn,mnw->msw", run.vertex, points[run.points]), radius, color, run, sides))
    return _joined(pieces, colors is not None)


def _widths(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[F64, str]:
    """Read widths, shape (K, 1), and their interpolation."""
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("widths")
    if primvar and primvar.HasAuthoredValue():
        value, told = primvar.ComputeFlattened(time), str(primvar.GetInterpolation())
    else:
        value = prim.GetAttribute("widths").Get(time)
        own = UsdGeom.Curves(prim) or UsdGeom.Points(prim)
        told = str(own.GetWidthsInterpolation())
    widths = _numbers(value)
    if widths is None or not len(widths) or not np.isfinite(widths).all():
        raise UnreadableMeshError("its widths are not finite, or have a wrong type")
    return np.abs(widths)[:, None], told


def _numbers(value: Any) -> F64 | None:
    try:
        rows = np.array(value, np.float64).reshape(-1)
    except (ValueError, TypeError):
        return None
    return rows if len(rows) == np.size(value) else None


def _runs(prim: Usd.Prim, count: int, time: Usd.TimeCode, notes: list[str]) -> tuple[list[_Run], dict[str, int], int]:
    """Group curves by number of points; also, number of values of each interpolation, and sides of a tube."""
    counts = numbers_of(prim.GetAttribute("curveVertexCounts").Get(time))
    if counts is None or counts.min(initial=0) < 0 or counts.sum() != count:
        raise UnreadableMeshError("curveVertexCounts and points do not fit together")
    kind, basis, wrap = (str(prim.GetAttribute(name).Get()) for name in ("type", "basis", "wrap"))
    sides, steps = _fineness(count, kind == "linear")
    weights = {
        number: _linear(number, wrap) if kind == "linear" else _cubic(number, basis, wrap, steps)
        for number in np.unique(counts).tolist()
    }
    ends = np.array([0 if (found := weights[number]) is None else found[1].shape[1] for number in counts.tolist()])
    first, first_end, runs = np.cumsum(counts) - counts, np.cumsum(ends) - ends, []
    for number, found in weights.items():
        curves = np.flatnonzero(counts == number)
        if found is not None:
            places = first[curves, None] + np.arange(number), first_end[curves, None] + np.arange(found[1].shape[1])
            runs.append(_Run(curves, *places, *found, wrap == "periodic"))
    short = len(counts) - sum(len(run.curves) for run in runs)
    if short:
        notes.append(f"{short} of {len(counts)} curves have too few points: left out")
    tokens = UsdGeom.Tokens
    return runs, {tokens.vertex: count, tokens.varying: int(ends.sum()), tokens.uniform: len(counts)}, sides


def _fineness(points: int, straight: bool) -> tuple[int, int]:
    for sides, steps in _FINENESS:
        if points * (1 if straight else steps) * sides * 4 <= _MOST_CORNERS:
            return sides, steps
    raise UnreadableMeshError("more curves than can be drawn")


def _linear(count: int, wrap: str) -> tuple[F64, F64] | None:
    if count < 2:
        return None
    weights = np.eye(count)
    weights = np.concatenate([weights, weights[:1]]) if wrap == "periodic" else weights
    return weights, weights


def _cubic(count: int, basis: str, wrap: str, steps: int) -> tuple[F64, F64] | None:
    """Compute weights of the points of a cubic curve at its samples, and of its segments' ends."""
    cage = np.eye(count)
    if wrap == "pinned" and basis != "bezier" and count >= 2:  # a point beyond each end
        cage = np.concatenate([[2 * cage[0] - cage[1]], cage, [2 * cage[-1] - cage[-2]]])
    stride = 3 if basis == "bezier" else 1
    closed = wrap == "periodic"
    segments = count // stride if closed else (len(cage) - 4) // stride + 1
    if count < (stride if closed else 4 - len(cage) + count) or segments < 1:
        return None
    at = np.linspace(0.0, segments, segments * steps + 1)
    segment = np.minimum(at.astype(np.int64), segments - 1)
    part = _basis(at - segment, basis)
    vertex = np.zeros((len(at), count))
    for corner in range(4):
        vertex += part[:, corner, None] * cage[(segment * stride + corner) % len(cage)]
    ends = segments if closed else segments + 1
    varying = np.zeros((len(at), ends))
    rows, share = np.arange(len(at)), at - segment
    np.add.at(varying, (rows, segment % ends), 1.0 - share)
    np.add.at(varying, (rows, (segment + 1) % ends), share)
    return vertex, varying


def _basis(u: F64, name: str) -> F64:
    """Compute weights of a segment's four points, shape (S, 4). Source: UsdGeomBasisCurves."""
    v = 1.0 - u
    if name == "bezier":
        rows = [v**3, 3 * u * v**2, 3 * u**2 * v, u**3]
    elif name == "catmullRom":
        rows = [-(u**3) + 2 * u**2 - u, 3 * u**3 - 5 * u**2 + 2, -3 * u**3 + 4 * u**2 + u, u**3 - u**2]
        rows = [row / 2 for row in rows]
    else:
        rows = [v**3 / 6, (3 * u**3 - 6 * u**2 + 4) / 6, (-3 * u**3 + 3 * u**2 + 3 * u + 1) / 6, u**3 / 6]
    return np.stack(rows, axis=1)


def _at_samples(values: F64, told: str, run: _Run, sizes: dict[str, int]) -> F64:
    """Compute values at the samples of a run, shape (M, S, W); the first for all, if the number does not fit."""
    if sizes.get(told) != len(values):  # an invalid interpolation is inferred from the number of values
        told = next((name for name, size in sizes.items() if size == len(values)), UsdGeom.Tokens.constant)
    if told == UsdGeom.Tokens.vertex:
        return np.einsum("sn,mnw->msw", run.vertex, values[run.points])
    if told == UsdGeom.Tokens.varying:
        return np.einsum("sk,mkw->msw", run.varying, values[run.ends])
    one = values[run.curves][:, None] if told == UsdGeom.Tokens.uniform else values[0]
    return np.broadcast_to(one, (len(run.curves), len(run.vertex), values.shape[1]))


def _tubes(way: F64, radius: F64, colors: F64 | None, run: _Run, sides: int) -> Strands:
    """Make rings perpendicular to the curves, shape (M, S, 3), in frames that do not rotate about the curves."""
    along = np.gradient(way, axis=1)
    if run.closed:
        along[:, 0] = along[:, -1] = way[:, 1] - way[:, -2]
    along = _unit(along)
    side = _square_to(along[:, 0])
    rings, angle = [], 2 * np.pi * np.arange(sides) / sides
    for step in range(way.shape[1]):
        carried = side - along[:, step] * np.einsum("mi,mi->m", side, along[:, step])[:, None]
        short = np.linalg.norm(carried, axis=1) < _SHORT
        carried[short] = _square_to(along[short, step])
        side = _unit(carried)
        other = np.cross(along[:, step], side)
        rings.append(np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * other[:, None])
    outward = np.stack(rings, axis=1)  # (M, S, sides, 3)
    points = way[:, :, None] + radius[:, :, None] * outward
    many, steps = way.shape[:2]
    number = np.arange(many * steps * sides).reshape(many, steps, sides)
    turned = np.roll(number, -1, axis=2)
    quads = np.stack([number[:, :-1], turned[:, :-1], turned[:, 1:], number[:, 1:]], axis=-1).reshape(-1)
    counts = [np.full(len(quads) // 4, 4, np.int64)]
    corners, normals, places = [quads], [outward.reshape(-1, 3)], [points.reshape(-1, 3)]
    shades = None if colors is None else [np.repeat(colors, sides, axis=1).reshape(-1, 3)]
    for end, sign in () if run.closed else ((0, -1.0), (steps - 1, 1.0)):
        cap = sum(map(len, places)) + np.arange(many * sides).reshape(many, sides)
        places.append(points[:, end].reshape(-1, 3))
        normals.append(np.repeat(sign * along[:, end], sides, axis=0))
        corners.append((cap if sign > 0 else cap[:, ::-1]).reshape(-1))
        counts.append(np.full(many, sides, np.int64))
        if shades is not None and colors is not None:
            shades.append(np.repeat(colors[:, end], sides, axis=0))
    return Strands(
        np.concatenate(places),
        np.concatenate(normals),
        None if shades is None else np.concatenate(shades),
        np.concatenate(counts),
        np.concatenate(corners),
    )


def _square_to(along: F64) -> F64:
    least = np.eye(3)[np.abs(along).argmin(axis=1)]
    return _unit(np.cross(along, least))


def _unit(vectors: F64) -> F64:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    up = np.zeros_like(vectors)
    up[..., 2] = 1.0
    return np.divide(vectors, length, out=up, where=length > _SHORT)


def _balls(points: F64, widths: F64, colors: F64 | None, notes: list[str]) -> Strands:
    """Make a sphere about each point."""
    chosen = np.arange(len(points))
    if len(points) > _BALLS[-1][1]:
        chosen = chosen[:: -(-len(points) // _BALLS[-1][1])]
        notes.append(f"{len(chosen)} of {len(points)} points are drawn")
    times = next(level for level, most in _BALLS if len(chosen) <= most)
    directions, triangles = _ball(times)
    radius = (widths if len(widths) == len(points) else np.broadcast_to(widths[:1], (len(points), 1)))[chosen] / 2
    placed = points[chosen, None] + radius[:, None] * directions
    shift = (np.arange(len(chosen)) * len(directions))[:, None, None]
    shades = None
    if colors is not None and len(colors):
        each = colors if len(colors) == len(points) else np.broadcast_to(colors[:1], (len(points), 3))
        shades = np.repeat(each[chosen], len(directions), axis=0)
    return Strands(
        placed.reshape(-1, 3),
        np.tile(directions, (len(chosen), 1)),
        shades,
        np.full(len(chosen) * len(triangles), 3, np.int64),
        (triangles + shift).reshape(-1),
    )


def _ball(times: int) -> tuple[F64, I64]:
    """Refine an octahedron towards its sphere: directions, shape (V, 3), and triangles, shape (T, 3)."""
    points = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(times):
        edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
        ends, middle = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
        m = middle.reshape(-1, 3) + len(points)
        points = np.concatenate([points, _unit(points[ends].sum(axis=1))])
        a, b, c = faces.T
        ab, bc, ca = m.T
        faces = np.concatenate(
            [np.stack(rows, axis=1) for rows in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return points, faces


def _joined(pieces: list[Strands], colored: bool) -> Strands:
    if not pieces:
        raise UnreadableMeshError("no curve has enough points")
    starts = np.cumsum([0, *(len(piece.points) for piece in pieces)])
    return Strands(
        np.concatenate([piece.points for piece in pieces]),
        np.concatenate([piece.normals for piece in pieces]),
        np.concatenate([piece.colors for piece in pieces if piece.colors is not None]) if colored else None,
        np.concatenate([piece.counts for piece in pieces]),
        np.concatenate([piece.corners + start for piece, start in zip(pieces, starts, strict=False)]),
    )
