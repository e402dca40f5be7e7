"""Street furniture, windows and roof equipment as prototypes at full scale."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.quads import boxes, prism, quad_mesh
from authoring.backgrounds.vehicles import BLACK, BLUE, GREEN, RED, WHITE, YELLOW, shade
from authoring.shapes.component import Mesh
from authoring.shapes.topology import y_up_to_z_up
from authoring.site.ways import merged

F64 = NDArray[np.float64]
Model = tuple[tuple[str, Mesh], ...]

PANEL = 2.4  # length of a fence panel [m]
_SIGNS = (RED, BLUE, YELLOW, GREEN)


def window_models() -> tuple[Model, ...]:
    """Model windows one meter wide and high about their middle, x to the right and y into the wall.

    They are scaled to their openings. Returns four for each kind of facade: sash, ribbon, curtain wall, shop;
    the four differ in the position of their blinds. Then as many simple ones, without a frame.
    """
    models, plain = [], []
    for frame, bars, role, blinds, cloth in (
        (0.045, ((0.0, 0.5),), "painted_metal", (0.0, 0.0, 0.35, 0.7), "plaster"),
        (0.02, ((-0.17, 1.0), (0.17, 1.0)), "painted_metal", (0.0, 0.0, 0.25, 0.6), "metal_silver"),
        (0.02, ((0.0, 1.0),), "metal_panel", (0.0, 0.0, 0.0, 0.3), "painted_metal"),
        (0.025, ((-0.2, 1.0), (0.2, 1.0)), "metal_panel", (0.0, 0.0, 0.0, 0.0), "plaster"),
    ):
        models += [_window(frame, bars, role, (blind, cloth)) for blind in blinds]
        plain += [_window(0.0, tuple((at, 1.0) for at, _ in bars), role, (blind, cloth)) for blind in blinds]
    return (*models, *plain)


def shop_fronts() -> tuple[Model, ...]:
    """Model name boards and awnings of shops, one meter wide about the middle of the shop's window, at the fascia."""
    models: list[Model] = []
    letters = boxes(
        [[x, -0.13, 1.85] for x in (-0.32, -0.18, 0.0, 0.16)],
        [[x + 0.1, -0.11, 2.15] for x in (-0.32, -0.18, 0.0, 0.16)],
        "y",
    )
    for color in (RED, BLUE, GREEN, BLACK, YELLOW):
        board = quad_mesh(boxes([-0.46, -0.11, 1.7], [0.46, 0.0, 2.3], "xXyzZ"), shade(color))
        models.append(
            (("paint_colours", merged([board, quad_mesh(letters, shade(BLACK if color == YELLOW else WHITE))])),)
        )
    for color in (RED, GREEN, WHITE):
        slope = prism(np.array([(-1.15, 0.85), (0.0, 1.3), (0.0, 1.42), (-1.15, 0.97)]), -0.5, 0.5)
        turned = np.stack([-slope[..., 1], slope[..., 0], slope[..., 2]], axis=-1)
        models.append((("paint_colours", quad_mesh(turned, shade(color))),))
    return tuple(models)


def lamp() -> Model:
    """Model a street lamp, its arm along x over the street."""
    pole = _column(0.09, 8.2, 0.55)
    arm = boxes([-0.05, -0.04, 8.1], [1.9, 0.04, 8.2])
    base = _column(0.17, 0.9, 1.0)
    head = boxes([1.3, -0.16, 8.0], [2.1, 0.16, 8.1])
    return (("galvanised_steel", quad_mesh(np.concatenate([pole, base, arm, head]))),)


def traffic_light() -> Model:
    """Model a traffic light on a pole."""
    steel = quad_mesh(np.concatenate([_column(0.07, 3.6, 0.9)]))
    case = quad_mesh(boxes([0.08, -0.18, 2.6], [0.34, 0.18, 3.6]))
    lights = [
        quad_mesh(boxes([0.34, -0.1, z], [0.36, 0.1, z + 0.2]), shade(color))
        for z, color in ((3.3, RED), (3.0, YELLOW), (2.7, GREEN))
    ]
    return ("galvanised_steel", steel), ("rubber", case), ("paint_colours", merged(lights))


def signs() -> tuple[Model, ...]:
    """Model traffic signs: plates of several colors on posts, facing x."""
    models: list[Model] = []
    for number, color in enumerate(_SIGNS):
        half = (0.3, 0.3) if number % 2 == 0 else (0.28, 0.42)
        plate = boxes([0.05, -half[0], 2.5 - half[1]], [0.08, half[0], 2.5 + half[1]])
        rim = boxes([0.08, -0.7 * half[0], 2.5 - 0.35 * half[1]], [0.09, 0.7 * half[0], 2.5 + 0.1 * half[1]])
        post = ("galvanised_steel", quad_mesh(_column(0.04, 2.95, 1.0)))
        models.append((post, ("paint_colours", merged([quad_mesh(plate, shade(color)), quad_mesh(rim, shade(WHITE))]))))
    return tuple(models)


def fence_panels() -> tuple[Model, Model]:
    """Model a panel of a railing along x from its first post, in detail and plain: top and bottom rail, pickets."""
    return _fence_panel("xXyYzZ", "xXyY"), _fence_panel("yYZ", "yY")


def _fence_panel(all_round: str, upright: str) -> Model:
    rails = boxes([[0.0, -0.03, 1.0], [0.0, -0.025, 0.14]], [[PANEL, 0.03, 1.07], [PANEL, 0.025, 0.19]], all_round)
    at = np.arange(1, 10) * PANEL / 10
    pickets = boxes(
        np.column_stack([at - 0.012, np.full(9, -0.012), np.full(9, 0.19)]),
        np.column_stack([at + 0.012, np.full(9, 0.012), np.full(9, 1.0)]),
        upright,
    )
    post = boxes([-0.04, -0.04, -0.3], [0.04, 0.04, 1.12], upright + "Z")
    return (("galvanised_steel", quad_mesh(np.concatenate([rails, pickets, post]))),)


def roof_plant() -> tuple[Model, ...]:
    """Model roof equipment: an air handler, a stair head, a water tank on legs, a mast."""
    unit = np.concatenate([boxes([-1.3, -0.9, 0.15], [1.3, 0.9, 1.55]), boxes([-0.8, -0.5, 1.55], [0.9, 0.5, 1.8])])
    head = np.concatenate([boxes([-2.2, -1.7, 0.0], [2.2, 1.7, 2.7]), boxes([-2.35, -1.85, 2.7], [2.35, 1.85, 2.85])])
    door = boxes([2.2, -0.5, 0.1], [2.23, 0.5, 2.1])
    turn = 2.0 * np.pi * np.arange(8) / 8
    round_ = np.column_stack([1.7 * np.cos(turn), 1.7 * np.sin(turn)])
    tank = y_up_to_z_up(prism(round_, 2.4, 5.6))
    cone = y_up_to_z_up(prism(round_, 5.6, 7.0))
    cone[..., :2] *= np.where(cone[..., 2:] > 6.0, 0.12, 1.06)
    legs = boxes(
        [[x - 0.1, y - 0.1, 0.0] for x in (-1, 1) for y in (-1, 1)],
        [[x + 0.1, y + 0.1, 2.4] for x in (-1, 1) for y in (-1, 1)],
        "xXyY",
    )
    mast = np.concatenate([_column(0.22, 9.0, 0.6), _column(0.1, 18.0, 0.4), boxes([-0.9, -0.9, 0.0], [0.9, 0.9, 1.2])])
    return (
        (("painted_metal", quad_mesh(unit)),),
        (("concrete", quad_mesh(head)), ("metal_panel", quad_mesh(door))),
        (("bark", quad_mesh(tank)), ("metal_panel", quad_mesh(np.concatenate([legs, cone])))),
        (("galvanised_steel", quad_mesh(mast)),),
    )


def _window(frame: float, bars: tuple[tuple[float, float], ...], role: str, blind: tuple[float, str]) -> Model:
    glass = np.array([[[-0.5, -0.02, -0.5], [0.5, -0.02, -0.5], [0.5, -0.02, 0.5], [-0.5, -0.02, 0.5]]])
    edges = [
        ([-0.5, -0.09, -0.5], [-0.5 + frame, -0.02, 0.5]),
        ([0.5 - frame, -0.09, -0.5], [0.5, -0.02, 0.5]),
        ([-0.5, -0.09, 0.5 - frame], [0.5, -0.02, 0.5]),
        ([-0.5, -0.13, -0.5], [0.5, -0.02, -0.5 + max(frame, 0.03)]),
    ]
    parts = [boxes(*edges[3], "y")]
    if frame > 0.0:
        parts = [boxes(low, high, sides) for (low, high), sides in zip(edges, ("y", "y", "y", "Zy"), strict=True)]
    for at, width in bars:
        half = 0.4 * frame if frame > 0.0 else 0.012
        parts.append(boxes([at - half, -0.07, -0.5], [at + half, -0.02, 0.5], "y"))
        if width < 1.0:
            parts.append(boxes([-0.5, -0.06, -half], [0.5, -0.02, half], "y"))
    pieces = [("window", quad_mesh(glass)), (role, quad_mesh(np.concatenate(parts)))]
    if blind[0] > 0.0:
        sheet = glass + np.array([0.0, -0.012, 0.0])
        sheet[..., 2] = np.where(sheet[..., 2] < 0.0, 0.5 - blind[0], 0.5)
        pieces.append((blind[1], quad_mesh(sheet)))
    return tuple(pieces)


def _column(radius: float, height: float, taper: float) -> F64:
    """Make an upright six-sided column, narrower at its top."""
    turn = 2.0 * np.pi * np.arange(6) / 6
    faces = y_up_to_z_up(prism(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]), -0.3, height))
    faces[..., :2] *= np.where(faces[..., 2:] > 0.5 * height, taper, 1.0)
    return faces
