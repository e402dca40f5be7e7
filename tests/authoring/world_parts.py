"""Parts of a world, and what all worlds are asked: what lies on the border of the site, and what stands on drives."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.component import Component, Scatter, triangles
from authoring.site.site import Site

F64 = NDArray[np.float64]
Pieces = tuple[Component | Scatter, ...]

_STANDING = ("tree", "shrub", "pole", "fence", "lamp_post")


def solids(pieces: Pieces) -> list[Component]:
    """The components among some pieces."""
    return [piece for piece in pieces if isinstance(piece, Component)]


def runs(pieces: Pieces, ending: str = "") -> list[Scatter]:
    """The scatters among some pieces whose name ends so."""
    return [piece for piece in pieces if isinstance(piece, Scatter) and piece.name.endswith(ending)]


def open_edges(parts: Sequence[Component]) -> F64:
    """Find the middles of the edges that only one triangle has, of several meshes together [m], shape (N, 3)."""
    corners = np.concatenate([part.mesh.points[triangles(part.mesh)] for part in parts])
    _, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    ends = number.reshape(-1, 3)
    edges = np.sort(np.stack([ends, np.roll(ends, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    middles = (0.5 * (corners + np.roll(corners, -1, axis=1))).reshape(-1, 3)
    _, first, count = np.unique(edges, axis=0, return_index=True, return_counts=True)
    assert count.max() == 2
    return middles[first[count == 1]]


def along_border(site: Site, parts: list[Component]) -> set[bytes]:
    """The vertices of some parts that lie on the strip's border, as bytes."""
    points = np.concatenate([part.mesh.points for part in parts])
    station, left = site.land.layout.alignment.locate(points)
    (first, last), (low, high) = site.field.stations[[0, -1]], site.field.lefts[[0, -1]]
    inside = (station > first - 1e-6) & (station < last + 1e-6) & (left > low - 1e-6) & (left < high + 1e-6)
    deep = (station > first + 1e-6) & (station < last - 1e-6) & (left > low + 1e-6) & (left < high - 1e-6)
    return {row.tobytes() for row in points[inside & ~deep]}


def yards(pieces: Pieces) -> F64:
    """Triangles of yards and drives [m], shape (T, 3, 3)."""
    found = [piece for piece in solids(pieces) if piece.group == "Yards"]
    assert len(found) > 12
    return np.concatenate([piece.mesh.points[triangles(piece.mesh)] for piece in found])


def standing_on(corners: F64, pieces: Pieces) -> list[str]:
    """Name the runs of trees, bushes, poles and fence posts that stand on triangles that face up, in plan.

    Args:
        corners: Triangles [m], shape (T, 3, 3).
        pieces: What may stand there.
    """
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    tops = corners[flat > 1e-3][:, :, :2]
    found = []
    for run in (run for run in runs(pieces) if run.kind in _STANDING):
        places = run.positions[np.argsort(run.positions[:, 0]), :2]
        first = np.searchsorted(places[:, 0], tops[..., 0].min(axis=1))
        last = np.searchsorted(places[:, 0], tops[..., 0].max(axis=1), side="right")
        found += [
            f"{run.name} {near[_within(top, near)][0]}"
            for top, start, end in zip(tops, first, last, strict=True)
            if end > start and _within(top, near := places[start:end]).any()
        ]
    return found


def _within(top: F64, places: F64) -> NDArray[np.bool_]:
    """Which places a counter-clockwise triangle in plan holds, shape (N,)."""
    ahead = np.roll(top, -1, axis=0) - top
    offset = places[:, None] - top
    return np.all(ahead[:, 0] * offset[..., 1] - ahead[:, 1] * offset[..., 0] > 0.0, axis=1)
