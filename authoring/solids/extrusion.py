"""Extruding outlines: many prisms at once, with chamfered ends and grooves."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.shapes.component import F64, I32
from authoring.shapes.nets import twisted_quads
from authoring.shapes.sections import miters
from authoring.solids.sweep import Axis, Surface, closed, missing_rings, placed

GROOVE_DEPTH = 0.010  # [m], of a false joint


@dataclass(frozen=True)
class Prism:
    """An outline that is extruded, with chamfers on the edges of both end faces and V grooves round the sides.

    Attributes:
        outline: Section, counter-clockwise [m], shape (P, 2), float64; its plane as in `sweep`.
        low: Where the solid begins along the axis [m].
        high: Where it ends [m].
        axis: Axis along which the member runs.
        place: Takes bridge coordinates to the world.
        chamfer: Leg of the chamfers [m]; 0 for none.
        grooves: Positions of grooves along the axis [m], rising and well inside the ends; their depth is half their
            width.
    """

    outline: F64
    low: float
    high: float
    axis: Axis
    place: Alignment
    chamfer: float = 0.0
    grooves: tuple[float, ...] = ()

    @property
    def surface(self) -> Surface:
        """Its closed surface, normals outward; for many prisms, `extruded` is faster."""
        return extruded([self])[0]

    def rings(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Compute the positions of its outlines along the axis, rising, and the inset of each [m]."""
        c, g = self.chamfer, GROOVE_DEPTH
        first, last = ((self.low, self.low + c), (self.high - c, self.high)) if c else ((self.low,), (self.high,))
        ends = (c, 0.0) if c else (0.0,)
        along = (*first, *(at + step for at in self.grooves for step in (-g, 0.0, g)), *last)
        depth = (*ends, *(0.0, g, 0.0) * len(self.grooves), *ends[::-1])
        rings = missing_rings(np.array(along), self.place).tolist() if self.axis == "station" else []
        if rings:
            both = sorted([*zip(along, depth, strict=True), *((ring, 0.0) for ring in rings)])
            along, depth = zip(*both, strict=True)
        return along, depth


def extruded(prisms: list[Prism]) -> list[Surface]:
    """Build prisms, all of one kind at once.

    Args:
        prisms: Any number.

    Returns:
        For each its closed surface, normals outward.
    """
    rings = [solid.rings() for solid in prisms]
    makes: dict[tuple[object, ...], list[int]] = defaultdict(list)
    for row, (solid, (_, depth)) in enumerate(zip(prisms, rings, strict=True)):
        full = tuple(inset == 0.0 for inset in depth)
        makes[solid.axis, len(solid.outline), full, solid.place.affine].append(row)
    surfaces: dict[int, Surface] = {}
    for rows in makes.values():
        along, depth = (np.array([rings[row][k] for row in rows]) for k in (0, 1))
        surfaces |= zip(rows, _of_one_make([prisms[row] for row in rows], along, depth), strict=True)
    return [surfaces[row] for row in range(len(prisms))]


def _of_one_make(prisms: list[Prism], along: F64, depth: F64) -> list[Surface]:
    """Build prisms on the same axis, with as many corners, and with insets at the same outlines.

    Args:
        prisms: At least one; all their frames are affine, or none.
        along: Where their outlines lie along the axis [m], shape (N, S), float64.
        depth: How far these are inset [m], shape (N, S), float64.
    """
    outlines = np.stack([solid.outline for solid in prisms])[:, None]
    sections = np.repeat(outlines, depth.shape[1], axis=1)
    if depth.any():
        sections += depth[..., None, None] * miters(outlines)
    axis, affine = prisms[0].axis, prisms[0].place.affine
    points = np.empty((*sections.shape[:3], 3))
    shares: dict[Alignment, list[int]] = defaultdict(list)
    for row, solid in enumerate(prisms):
        shares[solid.place].append(row)
    steps = np.empty((len(prisms), along.shape[1] - 1, 1 if affine or axis != "above" else sections.shape[2]))
    for place, rows in shares.items():
        points[rows] = placed(sections[rows], along[rows][..., None], axis, place)
        steps[rows] = _steps(outlines[rows], along[rows], axis, place)
    run = np.cumsum(np.hypot(steps, np.diff(depth)[..., None]), axis=1)
    lengths = np.concatenate([np.zeros_like(run[:, :1]), run], axis=1)
    # Affine frames keep parallel sides parallel, and therefore faces plane.
    twisted = [b""] * len(prisms) if affine else twisted_quads(points)
    return closed(sections, points, lengths, _girths(depth[0]), twisted, axis)


def _girths(depth: F64) -> I32:
    """Find the outline whose circumference each one's texture uses: a smaller one is next to a full one."""
    last = len(depth) - 1
    full = [k if d == 0.0 else (k + 1 if k < last else k - 1) for k, d in enumerate(depth.tolist())]
    return np.array(full, np.int32)


def _steps(outlines: F64, along: F64, axis: Axis, place: Alignment) -> F64:
    """Measure from outline to outline: upright between planes that may slope corner by corner, else on one line.

    Args:
        outlines: Full sections at one place [m], shape (N, 1, P, 2), float64.
        along: Where they lie along the axis [m], shape (N, S), float64.
        axis: Which way the prisms run.
        place: Takes bridge coordinates to the world.

    Returns:
        Distances [m], shape (N, S - 1, 1) or (N, S - 1, P), float64.
    """
    if place.affine:
        stretch = {"station": np.hypot(1.0, place.grade), "left": np.hypot(1.0, place.fall), "above": 1.0}[axis]
        return stretch * np.diff(along)[..., None]
    if axis == "above":
        corners = placed(np.repeat(outlines, along.shape[1], axis=1), along[..., None], axis, place)
        return np.sqrt(np.sum(np.diff(corners, axis=1) ** 2, axis=3))
    line: list[F64] = [np.zeros(along.shape) for _ in range(3)]
    if axis == "station" and place.plan:
        middle = outlines.mean(axis=2)  # on a curve, the member's own line is used
        line[1:] = [line[1] + middle[..., 0], line[2] + middle[..., 1]]
    line[("station", "left", "above").index(axis)] = along
    return np.linalg.norm(np.diff(place.point(*line), axis=1), axis=2)[..., None]
