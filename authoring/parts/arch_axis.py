"""The line of an arch: parabola, circle or catenary, and the polygon of a rib along it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from authoring.shapes.component import F64

NODE_PITCH = 1.0  # [m] along the axis, at most


@dataclass(frozen=True)
class ArchAxis:
    """The axis of an arch in elevation; x counts from the first springing, y from its height.

    Attributes:
        shape: `parabola`, `circle` or `catenary`.
        span: Springing to springing [m].
        rise: Crown above the springings [m].
    """

    shape: str
    span: float
    rise: float

    def height(self, x: F64) -> F64:
        """Find heights above the springings.

        Args:
            x: Distance from the first springing [m], shape (...), float64.

        Returns:
            Heights [m], the same shape (...), float64.
        """
        off = np.asarray(x, dtype=np.float64) - 0.5 * self.span
        if self.shape == "parabola":
            return self.rise * (1.0 - (2.0 * off / self.span) ** 2)
        if self.shape == "circle":
            return np.sqrt(np.maximum(self.radius**2 - off**2, 0.0)) - (self.radius - self.rise)
        return self.rise - self.constant * (np.cosh(off / self.constant) - 1.0)

    @property
    def radius(self) -> float:
        """Radius of the circle through springings and crown [m]."""
        return (0.25 * self.span**2 + self.rise**2) / (2.0 * self.rise)

    @cached_property
    def constant(self) -> float:
        """Radius of curvature at the crown of the catenary through springings and crown [m], by bisection."""
        low, high = 0.02 * self.span, 0.25 * self.span**2 / self.rise
        for _ in range(200):
            middle = 0.5 * (low + high)
            sag = middle * (np.cosh(0.5 * self.span / middle) - 1.0)
            low, high = (middle, high) if sag > self.rise else (low, middle)
        return 0.5 * (low + high)

    def tangent(self, x: F64) -> F64:
        """Find unit tangents towards rising x.

        Args:
            x: Distance from the first springing [m], shape (N,), float64.

        Returns:
            Directions (x, y) [1], shape (N, 2), float64.
        """
        off = np.asarray(x, dtype=np.float64) - 0.5 * self.span
        if self.shape == "circle":
            return np.stack([np.sqrt(np.maximum(self.radius**2 - off**2, 0.0)), -off], axis=-1) / self.radius
        parabola = self.shape == "parabola"
        slope = -8.0 * self.rise * off / self.span**2 if parabola else -np.sinh(off / self.constant)
        return np.stack([np.ones_like(slope), slope], axis=-1) / np.sqrt(1.0 + slope**2)[..., None]

    def nodes(self, pitch: float = NODE_PITCH) -> F64:
        """Divide the axis into equal lengths; every node lies on it.

        Args:
            pitch: Largest length between two nodes [m].

        Returns:
            Distances from the first springing, symmetric about mid-span [m], shape (N,), float64.
        """
        # Cosine spacing makes the table dense at the springings, where the axis is steepest.
        table = 0.5 * self.span * (1.0 - np.cos(np.linspace(0.0, np.pi, 2001)))
        steps = np.hypot(np.diff(table), np.diff(self.height(table)))
        length = np.concatenate([[0.0], np.cumsum(steps)])
        count = 2 * max(4, int(np.ceil(0.5 * length[-1] / pitch)))
        x = np.interp(np.linspace(0.0, length[-1], count + 1), length, table)
        return 0.5 * (x + (self.span - x[::-1]))


@dataclass(frozen=True)
class Rib:
    """An arch axis with a depth, along the bridge's axis; heights count from the finished surface at mid-span.

    Attributes:
        axis: The line of its section's centers.
        start: Station of the first springing [m].
        base: Height of the springings at mid-span [m].
        slope: Rise of the line between the springings per meter of station [1]; on a road with a grade, the arch is
            sheared and stays symmetric about the road.
        depth: At the crown, perpendicular to the axis [m].
        springing_depth: At the springings [m].
        level_feet: The ends are cut level, not perpendicular to the axis.
    """

    axis: ArchAxis
    start: float
    base: float
    slope: float
    depth: float
    springing_depth: float
    level_feet: bool = False

    @property
    def middle(self) -> float:
        """Station of mid-span [m]."""
        return self.start + 0.5 * self.axis.span

    @cached_property
    def polygon(self) -> tuple[F64, F64, F64]:
        """Return the axis as straight pieces.

        The cut bisects the angle between two neighboring sides, so that every side is a straight piece; a point at the
        distance n from the axis is at node + n * way.

        Returns:
            Nodes (station, height) [m], shape (N, 2); the direction of the cut through each [1], shape (N, 2); and the
            depths [m], shape (N,); all float64.
        """
        x = self.axis.nodes()
        if self.level_feet:
            room = self.springing_depth
            x = np.concatenate([x[:1], x[(x > room) & (x < self.axis.span - room)], x[-1:]])
        away = np.abs(2.0 * x / self.axis.span - 1.0)
        depth = self.depth + (self.springing_depth - self.depth) * away**2
        lift = self.slope * (x - 0.5 * self.axis.span)
        nodes = np.stack([self.start + x, self.base + self.axis.height(x) + lift], axis=1)
        sides = np.diff(nodes, axis=0)
        sides /= np.linalg.norm(sides, axis=1, keepdims=True)
        normals = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
        ways = np.empty_like(nodes)
        ways[1:-1] = normals[:-1] + normals[1:]
        if self.level_feet:
            ways[0], ways[-1] = (-1.0, -self.slope), (1.0, self.slope)
        else:
            ends = self.axis.tangent(x[[0, -1]])
            ends[:, 1] += self.slope * ends[:, 0]
            ways[[0, -1]] = np.stack([-ends[:, 1], ends[:, 0]], axis=1)
        of_side = np.concatenate([normals, normals[-1:]])
        return nodes, ways / np.sum(ways * of_side, axis=1, keepdims=True), depth

    def edge(self, side: float) -> F64:
        """Find the line of its back or of its soffit.

        Args:
            side: 1 for the extrados, -1 for the intrados, 0 for the axis [1].

        Returns:
            Corners (station, height) [m], shape (N, 2), float64.
        """
        nodes, ways, depth = self.polygon
        return nodes + 0.5 * side * depth[:, None] * ways

    def extrados(self, station: F64) -> F64:
        """Find heights of its back.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Heights [m], the same shape (...), float64.
        """
        return np.interp(station, *self.edge(1.0).T)

    def intrados(self, station: F64) -> F64:
        """Find heights of its soffit.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Heights [m], the same shape (...), float64.
        """
        return np.interp(station, *self.edge(-1.0).T)
