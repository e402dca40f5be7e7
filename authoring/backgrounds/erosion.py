"""Gullies that rain cuts into slopes: they run downhill, meet, and branch; without sines, equal on every platform."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.site.relief import LATTICE, smoothstep
from authoring.site.shape import Hills

F64 = NDArray[np.float64]

BRANCHES = ((430.0, 62.0), (190.0, 30.0), (84.0, 11.0))  # spacing of gullies, and their depth on steep slopes [m]
FLAT, STEEP = 0.06, 0.55  # slopes between which gullies deepen from zero to their full depth [1]
FOLLOW = 0.75  # degree to which smaller gullies follow the slopes of the larger ones, so that they join them [1]
SPAN = 9.0  # half the distance over which the slope of the land is measured [m]
_REACH = 1.3  # radius within which a wave counts, in spacings [1]
_JITTER = 0.3  # largest offset of a wave's center from that of its cell [1]


@dataclass(frozen=True)
class Gullies:
    """Waves whose crests run down the slope, one round each node of a jittered lattice, blended together.

    Attributes:
        spacing: From gully to gully [m].
        depth: From a crest to a gully's floor on steep slopes [m].
        nodes: Offsets of the waves' middles in parts of a cell [1], shape (LATTICE, LATTICE, 2), float64.
    """

    spacing: float
    depth: float
    nodes: F64

    def __call__(self, place: tuple[F64, F64], slope: tuple[F64, F64]) -> tuple[F64, F64, F64]:
        """Evaluate the waves.

        Args:
            place: Station and left [m], each shape (N,), float64.
            slope: Slope of the land along each [1], each shape (N,), float64.

        Returns:
            Height from -1 in a gully to 1 on a crest [1], and its change per spacing along station and left [1], each
            shape (N,), float64.
        """
        steep = np.sqrt(slope[0] * slope[0] + slope[1] * slope[1]) + 1e-9
        across, along = -slope[1] / steep, slope[0] / steep  # unit vector along a contour line
        x, y = place[0] / self.spacing, place[1] / self.spacing
        column, row = np.floor(x), np.floor(y)
        height, change, total = np.zeros_like(x), np.zeros_like(x), np.full_like(x, 1e-9)
        for i in (-1.0, 0.0, 1.0):
            for j in (-1.0, 0.0, 1.0):
                node = self.nodes[(column + i).astype(np.int64) % LATTICE, (row + j).astype(np.int64) % LATTICE]
                east, north = x - column - i - 0.5 - node[:, 0], y - row - j - 0.5 - node[:, 1]
                near = np.maximum(1.0 - (east * east + north * north) / (_REACH * _REACH), 0.0)
                weight = near * near * near
                phase = east * across + north * along
                height += weight * _wave(phase + 0.25)
                change -= weight * _wave(phase)
                total += weight
        rate = 2 * np.pi * change / total
        return height / total, rate * across, rate * along


def draw_gullies(rng: np.random.Generator) -> tuple[Gullies, ...]:
    """Draw gullies of every size, the widest first.

    Args:
        rng: Random stream.
    """
    return tuple(
        Gullies(spacing, depth, rng.uniform(-_JITTER, _JITTER, (LATTICE, LATTICE, 2))) for spacing, depth in BRANCHES
    )


def eroded(hills: Hills, gullies: tuple[Gullies, ...], spared: Hills) -> Hills:
    """Cut gullies into hills.

    Source: John, Eroded terrain noise, Shadertoy 2020: waves across the slope, octave by octave, each of which adds to
    the slope that the next one follows.

    Args:
        hills: Heights of the land [m].
        gullies: From the widest to the narrowest.
        spared: Share of their depth at a position, 0 where the land is unchanged [1].

    Returns:
        Heights of the eroded land [m]: nowhere above the hills.
    """

    def cut(station: F64, left: F64) -> F64:
        whole = np.asarray(hills(station, left), np.float64)
        height, share = whole.ravel().copy(), np.broadcast_to(spared(station, left), whole.shape).ravel()
        chosen = np.flatnonzero(share > 0.0)
        if not len(chosen):
            return whole
        x, y = (np.broadcast_to(values, whole.shape).ravel()[chosen] for values in (station, left))
        slope = (
            (hills(x + SPAN, y) - hills(x - SPAN, y)) / (2 * SPAN),
            (hills(x, y + SPAN) - hills(x, y - SPAN)) / (2 * SPAN),
        )
        depth = smoothstep(FLAT, STEEP, np.sqrt(slope[0] * slope[0] + slope[1] * slope[1])) * share[chosen]
        for octave in gullies:
            wave, along, aside = octave((x, y), slope)
            half = 0.5 * octave.depth * depth
            height[chosen] += half * (wave - 1.0)
            rate = FOLLOW * half / octave.spacing
            slope = (slope[0] + rate * along, slope[1] + rate * aside)
        return height.reshape(whole.shape)

    return cut


def _wave(turns: F64) -> F64:
    """Approximate the sine of an angle in turns, by parabolas: the same on every platform, shape (N,), float64."""
    part = turns - np.floor(turns + 0.5)
    return 8.0 * part * (1.0 - 2.0 * np.abs(part))
