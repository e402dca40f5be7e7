"""A laser scanner in an aircraft: parallel strips over an area, and the scan lines of each."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from recon.sampling.sampler_settings import AirborneSettings
from recon.sampling.scan_pattern import CHUNK, Rays, smooth_noise

F64 = NDArray[np.float64]


def strips_over(box: F64, level: float, settings: AirborneSettings, rng: np.random.Generator) -> F64:
    """Plan level parallel strips, flown in alternating directions, whose swaths cover a box.

    Args:
        box: Lower and upper corner of the area to cover [m], shape (2, 3), float64.
        level: Reference height of `altitude`: there the swaths overlap as set, below it more [m].
        settings: Altitude, angles, overlap and heading.
        rng: Source of the heading where none is given.

    Returns:
        First and last position of the aircraft on each strip [m], shape (S, 2, 3), float64.
    """
    drawn = rng.uniform(0.0, np.pi)
    heading = drawn if settings.heading is None else np.deg2rad(settings.heading)
    ahead = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-ahead[1], ahead[0]])
    middle = box[:, :2].mean(axis=0)
    half = 0.5 * (box[1, :2] - box[0, :2])
    along, across = float(np.abs(ahead) @ half), float(np.abs(left) @ half)
    swath = swath_width(settings)
    count = max(1, int(np.ceil((2.0 * across - swath) / (swath * (1.0 - settings.overlap)) - 1e-9)) + 1)
    sides = (np.arange(count) - 0.5 * (count - 1)) * swath * (1.0 - settings.overlap)
    ends = np.array([-along, along])
    plan = middle + ends[None, :, None] * ahead + sides[:, None, None] * left
    strips = np.concatenate([plan, np.full((count, 2, 1), level + settings.altitude)], axis=2)
    strips[1::2] = strips[1::2, ::-1]
    return strips


def swath_width(settings: AirborneSettings) -> float:
    """Compute the width of one swath, `altitude` below the aircraft [m].

    Args:
        settings: Altitude and field of view.
    """
    return 2.0 * settings.altitude * float(np.tan(0.5 * np.deg2rad(settings.field_of_view)))


def pulses_on(strips: F64, settings: AirborneSettings) -> int:
    """Count the pulses of some strips.

    Args:
        strips: First and last position on each [m], shape (S, 2, 3), float64.
        settings: Speed and rates.
    """
    return sum(_lines(strip, settings) for strip in strips) * settings.pulses_per_line


def airborne_rays(strips: F64, settings: AirborneSettings, rng: np.random.Generator) -> Iterator[Rays]:
    """Scan while flying: a rotating polygon mirror sends scan lines across the path, all from the same side.

    Neighboring pulses of a line differ by one angular step; each has its own position on the path, so lines are
    slightly oblique.

    Args:
        strips: First and last position of the aircraft on each strip [m], shape (S, 2, 3), float64.
        settings: Speed, rates, angles and errors.
        rng: Source of the error of the measured path.

    Yields:
        At most about `CHUNK` rays at a time; their `station` is the number of the strip.
    """
    per_line = settings.pulses_per_line
    angles = np.deg2rad(settings.field_of_view) * ((np.arange(per_line) + 0.5) / per_line - 0.5)
    together = max(1, CHUNK // per_line)
    for number, (start, end) in enumerate(strips):
        ahead = (end - start) / np.linalg.norm(end - start)
        left = np.cross([0.0, 0.0, 1.0], ahead)
        fan = np.sin(angles)[:, None] * left - np.cos(angles)[:, None] * [0.0, 0.0, 1.0]
        lines = _lines(np.stack([start, end]), settings)
        length = lines / settings.line_rate * settings.speed
        knots = settings.path_noise * rng.standard_normal((int(length / settings.path_noise_length) + 2, 3))
        for first in range(0, lines, together):
            line = np.arange(first, min(first + together, lines))
            pulse = (line[:, None] * per_line + np.arange(per_line)).ravel()
            way = pulse / (per_line * settings.line_rate) * settings.speed
            yield Rays(
                start + way[:, None] * ahead,
                np.tile(fan, (len(line), 1)),
                smooth_noise(way / settings.path_noise_length, knots),
                np.full(len(pulse), number, np.uint16),
            )


def _lines(strip: F64, settings: AirborneSettings) -> int:
    """Count the lines of a strip, both ends included."""
    return int(np.linalg.norm(strip[1] - strip[0]) / settings.speed * settings.line_rate) + 1
