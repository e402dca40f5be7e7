"""Flights of which only the camera centers, the level of the photographs and noisy positions are simulated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.placing.gps_fit import Fit, fit_to_fixes
from recon.placing.gravity import gravity_cues
from recon.placing.place_errors import PlaceErrors, expected_errors
from recon.placing.similarity import Similarity

F64 = NDArray[np.float64]

KINDS = ("grid", "circle", "facade", "line")
STATED = np.array([2.0, 2.0, 3.0])
"""Standard deviation of a fix, and of what all fixes share, as a receiver states it [m], shape (3,)."""


@dataclass(frozen=True)
class Flight:
    """A flight in the world, the same in model units, and what its receiver measured.

    Attributes:
        kind: One of `KINDS`.
        known: From the model into the world, as it truly is.
        source: Centers in model units, shape (N, 3), float64.
        rotations: Camera-to-world rotations in the model's frame [1], shape (N, 3, 3), float64.
        gps: Measured positions [m], shape (N, 3), float64.
    """

    kind: str
    known: Similarity
    source: F64
    rotations: F64
    gps: F64


def draw_flight(rng: np.random.Generator) -> Flight:
    """Draw a flight of 6 to 80 photographs, 15 to 200 m long; its noise is 0.1 to 1.5 times what is stated.

    In half of the flights the error of a fix repeats half or more of the one before it; in three of ten every
    eighth fix is wrong. The photographs are level to 0.3 to 2 degrees, and all together to one degree.

    Args:
        rng: Draws it.
    """
    kind = str(rng.choice(KINDS))
    centers, headings, pitches = _path(kind, rng)
    count = len(centers)
    noise = rng.uniform(0.3, 3.0) * np.array([1.0, 1.0, 0.0]) + rng.uniform(0.2, 4.0) * np.array([0.0, 0.0, 1.0])
    likeness = float(rng.choice([0.0, 0.0, 0.5, 0.8]))
    errors = rng.normal(size=(count, 3))
    for row in range(1, count):
        errors[row] = likeness * errors[row - 1] + np.sqrt(1.0 - likeness**2) * errors[row]
    gps = centers + errors * noise + rng.normal(0.0, STATED)
    if rng.random() < 0.3 and count >= 10:
        strayed = np.sort(rng.choice(count, count // 8, replace=False))
        gps[strayed] += rng.normal(0.0, 15.0 * noise.max(), (len(strayed), 3))
    rolls = np.radians(rng.normal(0.0, rng.uniform(0.3, 2.0), count) + rng.normal())
    world = _held(headings, pitches, rolls)
    known = Similarity(rng.uniform(0.2, 20.0), _any_rotation(rng), rng.normal(0.0, 50.0, 3))
    source = (centers - known.translation) @ known.rotation / known.scale
    return Flight(kind, known, source, known.rotation.T @ world, gps)


def place_flight(flight: Flight, rng: np.random.Generator) -> tuple[Fit, PlaceErrors] | None:
    """Fit the model of a flight to its fixes.

    Args:
        flight: The flight.
        rng: Draws starts.

    Returns:
        The fit and the limits of its errors; None where the fixes do not fix the frame.
    """
    stated = np.tile(STATED, (len(flight.gps), 1))
    fit = fit_to_fixes(flight.source, flight.gps, stated, gravity_cues(flight.rotations, None), rng)
    errors = None if fit is None else expected_errors(fit, STATED)
    return None if fit is None or errors is None or errors.unfixed() else (fit, errors)


def true_errors(flight: Flight, fit: Fit) -> PlaceErrors:
    """Measure what a fit is truly off by.

    Args:
        flight: The flight.
        fit: Its fit.
    """
    return frame_errors(fit.similarity, flight.known, fit.middle)


def frame_errors(found: Similarity, known: Similarity, middle: F64) -> PlaceErrors:
    """Measure how far two placements of one model are apart.

    Args:
        found: What was found.
        known: What is known.
        middle: Middle of the cameras where the first puts it [m], shape (3,), float64.
    """
    turned = found.rotation @ known.rotation.T
    back = (middle - found.translation) @ found.rotation / found.scale
    heading = np.degrees(np.arctan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1]))
    return PlaceErrors(
        100.0 * abs(found.scale / known.scale - 1.0),
        float(np.degrees(np.arccos(np.clip(turned[2, 2], -1.0, 1.0)))),
        float(abs(heading)),
        float(np.linalg.norm(known.move(back[None])[0] - middle)),
    )


def _path(kind: str, rng: np.random.Generator) -> tuple[F64, F64, F64]:
    """Give centers [m], headings and pitches of the lines of sight [rad]."""
    count, size, height = int(rng.integers(6, 80)), rng.uniform(15.0, 200.0), rng.uniform(5.0, 60.0)
    along = np.linspace(-size / 2, size / 2, count)
    if kind == "grid":
        lanes = int(rng.integers(2, 6))
        lane, part = np.divmod(np.arange(count) * lanes, count)
        part = np.where(lane % 2, 1.0 - part / count, part / count)
        centers = np.column_stack([size * part, 0.8 * size * lane / lanes, height + rng.normal(0.0, 1.0, count)])
        headings = np.where(lane % 2, np.pi, 0.0) if rng.random() < 0.5 else np.zeros(count)
        return centers, headings, np.full(count, -np.pi / 2 + 0.02)
    if kind == "circle":
        angle = np.linspace(0.0, 2 * np.pi * rng.uniform(0.5, 1.0), count)
        ring = size / 2 * np.column_stack([np.cos(angle), np.sin(angle)])
        return np.column_stack([ring, height + rng.normal(0.0, 1.0, count)]), angle + np.pi, np.full(count, -0.5)
    if kind == "facade":
        climb = height / 2 + height / 4 * np.sin(np.arange(count))
        return (
            np.column_stack([along, rng.normal(0.0, 1.0, count), climb]),
            np.full(count, np.pi / 2),
            rng.uniform(-0.5, 0.2, count),
        )
    straight = np.column_stack([along, np.zeros(count), np.full(count, height)])
    return straight, np.pi / 2 + rng.normal(0.0, 0.4, count), rng.uniform(-0.8, 0.1, count)


def _held(headings: F64, pitches: F64, rolls: F64) -> F64:
    """Build camera-to-world rotations, shape (N, 3, 3)."""
    level = np.cos(pitches)
    forward = np.column_stack([np.cos(headings) * level, np.sin(headings) * level, np.sin(pitches)])
    right = np.column_stack([np.sin(headings), -np.cos(headings), np.zeros(len(headings))])
    down = np.cross(forward, right)
    cosine, sine = np.cos(rolls)[:, None], np.sin(rolls)[:, None]
    return np.stack([cosine * right + sine * down, cosine * down - sine * right, forward], axis=2)


def _any_rotation(rng: np.random.Generator) -> F64:
    left, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation = left * np.sign(np.diag(upper))
    return rotation * np.linalg.det(rotation)
