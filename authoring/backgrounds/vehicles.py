"""Vehicles at full scale: cars, vans, buses and trucks in several colors, x forward, wheels on the ground."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.quads import ALL, boxes, prism, quad_mesh, ring
from authoring.shapes.component import Mesh
from authoring.site.ways import merged

F64 = NDArray[np.float64]
Model = tuple[tuple[str, Mesh], ...]

COLORS = 8  # stripes of the recipe `paint_colours`, one meter each
WHITE, SILVER, GRAY, BLACK, RED, BLUE, YELLOW, GREEN = range(COLORS)
CARS = (
    ("saloon", (WHITE, SILVER, BLACK, RED, BLUE)),
    ("estate", (GRAY, SILVER, WHITE, GREEN)),
    ("van", (WHITE, WHITE, YELLOW)),
    ("bus", (RED, BLUE)),
    ("truck", (WHITE, BLUE)),
)
LENGTHS = {"saloon": 4.5, "estate": 4.7, "van": 5.6, "bus": 12.0, "truck": 8.6}  # [m]
_PALE, _TAIL = WHITE, RED


def shade(color: int) -> float:
    """Find a color's place on the palette [m]."""
    return color + 0.5


def vehicle_models() -> tuple[tuple[str, Model], ...]:
    """Model every vehicle in every color.

    Returns:
        Type and model of each.
    """
    build = {"saloon": _saloon, "estate": _estate, "van": _van, "bus": _bus, "truck": _truck}
    return tuple((kind, build[kind](color)) for kind, colors in CARS for color in dict.fromkeys(colors))


def _saloon(color: int) -> Model:
    body = prism(
        np.array([(-2.2, 0.24), (2.2, 0.24), (2.26, 0.55), (2.05, 0.74), (-2.12, 0.92), (-2.24, 0.6)]), -0.88, 0.88
    )
    cabin = _cabin([(-1.9, 0.86), (1.1, 0.78), (0.3, 1.38), (-1.2, 1.41)], 0.80, 0.60)
    top = _cabin([(-1.24, 1.385), (0.34, 1.355), (0.28, 1.43), (-1.15, 1.46)], 0.62, 0.57)
    return _car(color, np.concatenate([body, top]), cabin, (-1.36, 1.36), 2.24)


def _estate(color: int) -> Model:
    body = prism(
        np.array([(-2.3, 0.28), (2.28, 0.28), (2.34, 0.62), (2.1, 0.86), (-2.28, 1.02), (-2.36, 0.6)]), -0.92, 0.92
    )
    cabin = _cabin([(-2.22, 0.98), (1.0, 0.9), (0.35, 1.55), (-2.02, 1.58)], 0.85, 0.68)
    top = _cabin([(-2.05, 1.55), (0.38, 1.52), (0.3, 1.61), (-1.98, 1.65)], 0.70, 0.66)
    return _car(color, np.concatenate([body, top]), cabin, (-1.42, 1.42), 2.33)


def _van(color: int) -> Model:
    outline = np.array([(-2.75, 0.36), (2.68, 0.36), (2.75, 0.95), (1.8, 2.2), (-2.7, 2.26), (-2.78, 1.2)])
    body = prism(outline, -0.97, 0.97)
    slope = np.array([(2.60, 1.17), (2.66, 1.19), (1.90, 2.17), (1.84, 2.15)])
    glass = np.concatenate([prism(slope, -0.86, 0.86), boxes([0.75, -0.985, 1.25], [1.75, 0.985, 1.95], "xXyYzZ")])
    return _car(color, body, glass, (-1.75, 1.8), 2.74)


def _bus(color: int) -> Model:
    low, high = np.array([-6.0, -1.26, 0.34]), np.array([6.0, 1.26, 3.0])
    body = boxes(low, high)
    rim = np.array([-6.0, 6.0, -1.26, 1.26])
    glass = ring(rim, rim + 0.02 * np.array([-1, 1, -1, 1]), (1.25, 2.4))
    posts = [boxes([x - 0.06, -1.29, 1.25], [x + 0.06, 1.29, 2.4], "xXyY") for x in np.arange(-4.6, 5.0, 1.53)]
    plant = boxes([[-4.5, -0.8, 3.0], [1.0, -0.7, 3.0]], [[-1.8, 0.8, 3.25], [2.6, 0.7, 3.2]])
    dark = np.concatenate([*posts, boxes([6.0, -0.9, 2.5], [6.03, 0.9, 2.85])])
    return _finish(color, np.concatenate([body, plant]), glass, _wheels((-3.4, 3.6), 1.26, 0.48), dark, (6.0, 1.0))


def _truck(color: int) -> Model:
    cab = prism(np.array([(2.3, 0.5), (4.15, 0.5), (4.25, 1.3), (4.05, 2.55), (2.5, 2.65), (2.3, 2.6)]), -1.15, 1.15)
    slope = np.array([(4.22, 1.42), (4.28, 1.43), (4.12, 2.36), (4.06, 2.35)])
    glass = np.concatenate([prism(slope, -1.02, 1.02), boxes([2.95, -1.165, 1.45], [3.8, 1.165, 2.25], "xXyYzZ")])
    load = boxes([-4.3, -1.24, 0.95], [2.15, 1.24, 3.45])
    chassis = boxes([-4.25, -0.5, 0.5], [2.4, 0.5, 0.95], ALL)
    model = _finish(color, cab, glass, _wheels((-2.9, -1.8, 3.25), 1.15, 0.48), chassis, (4.2, 0.75))
    return (*model, ("paint_colours", quad_mesh(load, shade(SILVER))))


def _car(color: int, body: F64, glass: F64, axles: tuple[float, ...], nose: float) -> Model:
    half = float(np.abs(body[..., 1]).max())
    dark = np.concatenate(
        [boxes([sign * nose - 0.03, -0.7, 0.32], [sign * nose + 0.03, 0.7, 0.44]) for sign in (-1, 1)]
    )
    return _finish(color, body, glass, _wheels(axles, half, 0.32), dark, (nose - 0.02, 0.56))


def _finish(color: int, body: F64, glass: F64, wheels: F64, dark: F64, lamps: tuple[float, float]) -> Model:
    """Assign materials to a vehicle, and add lamps at its ends: their position forward and height [m]."""
    nose, high = lamps
    back = -nose if nose < 5.0 else -6.0
    half = float(np.abs(body[..., 1]).max())
    pairs = [
        np.concatenate(
            [
                boxes([x - 0.05, side * (half - 0.3) - 0.16, high], [x + 0.05, side * (half - 0.3) + 0.16, high + 0.13])
                for side in (-1.0, 1.0)
            ]
        )
        for x in (nose, float(min(body[..., 0].min() + 0.02, back + 0.06)))
    ]
    paint = [quad_mesh(body, shade(color)), quad_mesh(pairs[0], shade(_PALE)), quad_mesh(pairs[1], shade(_TAIL))]
    return (
        ("paint_colours", merged(paint)),
        ("window", quad_mesh(glass)),
        ("rubber", quad_mesh(np.concatenate([wheels, dark]))),
    )


def _cabin(outline: list[tuple[float, float]], below: float, above: float) -> F64:
    """Make a cabin whose sides lean inwards, with given half widths at its foot and at its top [m]."""
    faces = prism(np.array(outline), -1.0, 1.0)
    low, high = min(z for _, z in outline), max(z for _, z in outline)
    faces[..., 1] *= below + (above - below) * (faces[..., 2] - low) / (high - low)
    return faces


def _wheels(axles: tuple[float, ...], half: float, radius: float) -> F64:
    turn = 2.0 * np.pi * (np.arange(8) + 0.5) / 8
    rim = np.column_stack([radius * np.cos(turn), radius * np.sin(turn) + radius * np.cos(np.pi / 8)])
    wheels = [
        prism(rim + np.array([x, 0.0]), *sorted((side * (half + 0.01), side * (half - 0.22))))
        for x in axles
        for side in (-1.0, 1.0)
    ]
    return np.concatenate(wheels)
