"""Arrays of many meshes as a layer stores them: rounded, centered and indexed, all meshes at once."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.component import F32, F64, I32, Mesh

GRID = 1e-6  # [m], [1]: values are rounded to it before they are written, so that every CPU writes the same


@dataclass(frozen=True)
class IndexedUV:
    """A UV set whose equal pairs are stored once.

    Attributes:
        values: Different pairs [1], shape (N, 2), float32.
        indices: Pair of each face corner, shape (C,), int32.
    """

    values: F32
    indices: I32


@dataclass(frozen=True)
class MeshArrays:
    """The stored arrays of one mesh.

    Attributes:
        origin: Origin of its points [m], shape (3,), float64.
        points: Positions relative to it [m], shape (V, 3), float32.
        extent: Least and largest position [m], shape (2, 3), float32.
        normals: Unit normal at each corner [1], shape (C, 3), float32.
        st: First UV set [m].
        st1: Second UV set [1], or None.
    """

    origin: F64
    points: F32
    extent: F32
    normals: F32
    st: IndexedUV
    st1: IndexedUV | None


def mesh_arrays(meshes: list[Mesh], centered: list[bool]) -> list[MeshArrays]:
    """Prepare meshes for a layer.

    Args:
        meshes: Any number.
        centered: For each, whether its points are relative to its middle, rounded to 1 mm: a usable pivot, and float32
            with micrometer precision; else relative to the world's origin.
    """
    if not meshes:
        return []
    starts, points = _piled([mesh.points for mesh in meshes])
    low, high = _bounds(points, starts)
    origins = np.where(np.array(centered)[:, None], np.round((low + high) / 2, 3), 0.0)
    points = snapped(points - np.repeat(origins, np.diff(starts, append=len(points)), axis=0))
    extents = np.stack(_bounds(points, starts), axis=1)
    own_normals, normals = _piled([mesh.normals for mesh in meshes])
    st = _indexed([mesh.st for mesh in meshes])
    with_atlas = [row for row, mesh in enumerate(meshes) if len(mesh.st1)]
    st1 = dict(zip(with_atlas, _indexed([meshes[row].st1 for row in with_atlas]), strict=True))
    split = zip(origins, _split(points, starts), extents, _split(snapped(normals), own_normals), st, strict=True)
    return [MeshArrays(*arrays, st1.get(row)) for row, arrays in enumerate(split)]


def snapped(values: NDArray[np.floating]) -> F32:
    """Round values to the grid; equal values get equal bytes.

    Args:
        values: Values [any unit], shape (...), float.

    Returns:
        Values [any unit], the same shape (...), float32.
    """
    steps = np.divide(values, GRID, dtype=np.float64)
    np.rint(steps, out=steps)
    steps *= GRID
    steps += 0.0  # converts -0.0 to 0.0
    return steps.astype(np.float32, order="C")


def _indexed(sets: list[F32]) -> list[IndexedUV]:
    """Store equal pairs of each set once, in the order of their bits."""
    if not sets:
        return []
    starts, pile = _piled(sets)
    pairs = snapped(pile)
    keys = pairs.view(np.uint64).ravel()  # a pair of values as one number
    ends = np.append(starts[1:], len(keys))
    order = np.concatenate([keys[low:high].argsort() + low for low, high in zip(starts, ends, strict=True)])
    ranked = keys.take(order)
    new = np.concatenate([[True], ranked[1:] != ranked[:-1]])
    new[starts] = True
    rank = np.cumsum(new) - 1
    firsts = rank[starts]
    indices = np.empty(len(keys), np.int32)
    indices[order] = rank - np.repeat(firsts, ends - starts)
    values = _split(pairs.take(order[new], axis=0), firsts)
    return [IndexedUV(*both) for both in zip(values, _split(indices, starts), strict=True)]


def _bounds(points: NDArray[np.floating], starts: NDArray[np.int64]) -> tuple[NDArray[Any], NDArray[Any]]:
    rows = np.ascontiguousarray(points.T)
    return np.minimum.reduceat(rows, starts, axis=1).T, np.maximum.reduceat(rows, starts, axis=1).T


def _piled(arrays: list[NDArray[Any]]) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """Concatenate arrays: the first row of each, and the concatenation."""
    counts = np.array([len(array) for array in arrays])
    return np.cumsum(counts) - counts, np.concatenate(arrays)


def _split(pile: NDArray[Any], starts: NDArray[np.int64]) -> list[NDArray[Any]]:
    ends = [*starts[1:].tolist(), len(pile)]
    return [pile[low:high] for low, high in zip(starts.tolist(), ends, strict=True)]
