"""Instances without a network: the connected parts of a class, with a box around each."""

import numpy as np
from numpy.typing import NDArray

from usd_schemas.components import UNLABELED

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_BITS = 21
# Half of the 26 neighbors of a cell: the other half is symmetric.
_STEPS = tuple((x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0))


def connected_parts(coord: F64, classes: NDArray[np.uint8], link: float, fewest: int, without: tuple[int, ...]) -> I64:
    """Number the connected parts of every class.

    Points of a class are connected if their cubes are the same or touch, even at a corner.

    Args:
        coord: Positions [m], shape (N, 3), float64.
        classes: Class ids, shape (N,), uint8; 255 has no parts.
        link: Side of a cube [m].
        fewest: Least number of points of a part.
        without: Classes that have no parts.

    Returns:
        Number of the part of each point, from 1, ordered by class and then by position; 0 for none, shape (N,), int64.
    """
    found = np.zeros(len(coord), np.int64)
    number = 0
    cell = np.floor((coord - coord.min(axis=0)) / link).astype(np.int64) + 1 if len(coord) else found.reshape(-1, 3)
    key = (cell[:, 0] << 2 * _BITS) | (cell[:, 1] << _BITS) | cell[:, 2]
    for label in np.unique(classes):
        if label == UNLABELED or int(label) in without:
            continue
        rows = np.flatnonzero(classes == label)
        cells, inverse = np.unique(key[rows], return_inverse=True)
        inverse = inverse.reshape(-1)
        part = _components(cells)[inverse]
        count = np.bincount(part)
        large = count >= fewest
        order = np.cumsum(large) * large  # parts are numbered in the order of their first cubes
        found[rows] = np.where(order[part] > 0, order[part] + number, 0)
        number += int(large.sum())
    return found


def _components(cells: I64) -> I64:
    """Component of each cell, in the order of their first cells, shape (C,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = []
    for x, y, z in _STEPS:
        step = (x << 2 * _BITS) + (y << _BITS) + z
        at = np.searchsorted(cells, cells + step)
        at[at == len(cells)] = 0
        near = np.flatnonzero(cells[at] == cells + step)
        links.append(np.column_stack([near, at[near]]))
    pairs = np.concatenate(links)
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    _, part = connected_components(graph, directed=False)
    _, first, again = np.unique(part, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[again.reshape(-1)]


class Boxes:
    """Boxes, numbers of points and mean confidences of instances, accumulated in chunks."""

    def __init__(self, count: int) -> None:
        """Initialize without points.

        Args:
            count: Highest instance id.
        """
        self.low = np.full((count + 1, 3), np.inf)
        self.high = np.full((count + 1, 3), -np.inf)
        self.points = np.zeros(count + 1, np.int64)
        self.sure = np.zeros(count + 1)
        self.label = np.full(count + 1, UNLABELED, np.int64)

    def add(
        self, coord: F64, instance: NDArray[np.integer], classes: NDArray[np.uint8], confidence: NDArray[np.float32]
    ) -> None:
        """Add some points.

        Args:
            coord: Positions [scan units], shape (N, 3), float64.
            instance: Instance ids, shape (N,), any integer type.
            classes: Class ids, shape (N,), uint8.
            confidence: Confidences [1], shape (N,), float32.
        """
        np.minimum.at(self.low, instance, coord)
        np.maximum.at(self.high, instance, coord)
        self.points += np.bincount(instance, minlength=len(self.points))
        # Integer millionths, so that the sum does not depend on the chunks.
        whole = np.rint(confidence.astype(np.float64) * 1e6)
        self.sure += np.bincount(instance, whole, minlength=len(self.points))
        self.label[instance] = classes

    def rows(self, names: dict[int, str], meters: float) -> list[dict[str, object]]:
        """Return the instances as JSON.

        Args:
            names: Class names by id.
            meters: Length of one unit of the scan [m].
        """
        return [
            {
                "id": i,
                "class_id": int(self.label[i]),
                "class": names[int(self.label[i])],
                "points": int(self.points[i]),
                "confidence": round(float(self.sure[i] / self.points[i]) / 1e6, 6),
                "low": self.low[i].tolist(),
                "high": self.high[i].tolist(),
                "size_m": ((self.high[i] - self.low[i]) * meters).tolist(),
            }
            for i in range(1, len(self.points))
            if self.points[i]
        ]
