"""Stains by water from a bridge: below its joints, scuppers, bearings and cap ends."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.looks.noise import Floats, ramp
from authoring.shapes.component import Component, Scatter

_CELL = 0.15  # [m]
_NOWHERE = -1e4  # [m], a height below everything
_CAP_END = 0.5  # [m] length of a cap at either end from which water drips

# Kind: spread of the water to each side, length of the stain downwards [m], and its strength [1].
_WET: dict[str, tuple[float, float, float]] = {
    "expansion_joint": (0.75, 6.0, 0.9),
    "scupper": (0.30, 5.0, 1.0),
    "pier_cap": (0.15, 3.0, 0.7),
}
_RUSTY: dict[str, tuple[float, float, float]] = {
    "bearing_pot": (0.30, 1.6, 0.9),
    "bearing_pad": (0.20, 0.9, 0.35),
    "splice_plate": (0.10, 0.7, 0.8),
    "cross_frame": (0.15, 0.9, 0.6),
    "stiffener": (0.08, 0.5, 0.4),
    "cable_clamp": (0.05, 0.3, 0.8),
}


@dataclass(frozen=True)
class Stains:
    """A map in plan of water that drips from above.

    Attributes:
        corner: Lower corner of the map [m], shape (2,), float64.
        height: Height at which the stain begins [m], shape (rows, columns), float32.
        reach: Length downwards [m], shape (rows, columns), float32.
        strength: Its strength [1], shape (rows, columns), float32.
    """

    corner: NDArray[np.float64]
    height: Floats
    reach: Floats
    strength: Floats

    def below(self, place: Floats) -> Floats:
        """Compute the strength of the stain at each position.

        Args:
            place: World positions [m], shape (N, 3), float32.

        Returns:
            0 for none, 1 for the strongest [1], shape (N,), float32.
        """
        rows, columns = self.height.shape
        across = np.clip(((place[:, 0] - self.corner[0]) / _CELL).astype(np.int32), 0, columns - 1)
        up = np.clip(((place[:, 1] - self.corner[1]) / _CELL).astype(np.int32), 0, rows - 1)
        cell = up * columns + across
        amount = np.take(self.strength.ravel(), cell)
        stained = np.flatnonzero(amount)
        here = cell[stained]
        depth = self.height.ravel()[here] - place[stained, 2]
        amount[stained] *= ramp(depth, self.reach.ravel()[here], 0.1) * ramp(depth, -0.30, 0.0)
        return amount


def map_stains(pieces: Iterable[Component | Scatter]) -> tuple[Stains, Stains]:
    """Map dripping dirty water and rust.

    Args:
        pieces: Parts of a bridge, including its scuppers.
    """
    pieces = tuple(pieces)
    plan = [piece.mesh.points if isinstance(piece, Component) else piece.positions for piece in pieces]
    every = np.concatenate([np.zeros((0, 3)), *plan])[:, :2]
    low, high = (every.min(axis=0) - 1, every.max(axis=0) + 1) if len(every) else (np.zeros(2), np.ones(2))
    columns, rows = (int(value) for value in np.ceil((high - low) / _CELL))
    return _map(pieces, _WET, low, (rows, columns)), _map(pieces, _RUSTY, low, (rows, columns))


def _map(
    pieces: tuple[Component | Scatter, ...],
    kinds: dict[str, tuple[float, float, float]],
    corner: NDArray[np.float64],
    shape: tuple[int, int],
) -> Stains:
    import cv2

    height = np.full(shape, _NOWHERE, np.float32)
    reach, strength = np.ones(shape, np.float32), np.zeros(shape, np.float32)
    for kind, (spread, depth, power) in sorted(kinds.items()):
        own = np.full(shape, _NOWHERE, np.float32)
        for piece in pieces:
            if piece.kind == kind:
                for points in _drips(piece):
                    cells = np.round((points[:, :2] - corner) / _CELL - 0.5).astype(np.int32)
                    cv2.fillConvexPoly(own, cv2.convexHull(cells), float(points[:, 2].max()))
        grown = np.asarray(cv2.dilate(own, np.ones((2 * round(spread / _CELL) + 1,) * 2, np.uint8)), np.float32)
        near = ramp(_distance(own), 1 + spread / _CELL, 0.0) * np.float32(power)
        taken = (grown > _NOWHERE) & (near > strength)
        height[taken], reach[taken], strength[taken] = grown[taken], depth, near[taken]
    return Stains(corner, height, reach, strength)


def _distance(own: Floats) -> Floats:
    import cv2

    dry = (own == np.float32(_NOWHERE)).astype(np.uint8)
    if dry.all():
        return np.full(own.shape, 1e6, np.float32)
    return np.asarray(cv2.distanceTransform(dry, cv2.DIST_L2, 3), np.float32)


def _drips(piece: Component | Scatter) -> list[NDArray[np.float64]]:
    """List dripping points: a component's own, those of the ends of a cap, a point below each repeat."""
    if isinstance(piece, Scatter):
        square = np.array([[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0]])
        return [position + square for position in piece.positions]
    points = piece.mesh.points
    if piece.kind != "pier_cap":
        return [points]
    along = (points[:, :2] - points[:, :2].mean(axis=0)) @ np.array(direction(points))
    return [points[along > along.max() - _CAP_END], points[along < along.min() + _CAP_END]]


def direction(points: NDArray[np.float64]) -> tuple[float, float]:
    """Find the longer direction of a member in plan, from the second moments of its vertices.

    Args:
        points: World positions [m], shape (V, 3), float64.

    Returns:
        Unit vector along x and y [1].
    """
    plan = points[:, :2] - points[:, :2].mean(axis=0)
    xx, yy, xy = (plan[:, 0] ** 2).sum(), (plan[:, 1] ** 2).sum(), (plan[:, 0] * plan[:, 1]).sum()
    root = np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    across, along = float(xy), float(root - (xx - yy) / 2)
    length = np.sqrt(across**2 + along**2)
    return (across / length, along / length) if length > 1e-9 * (xx + yy) else (1.0, 0.0)
