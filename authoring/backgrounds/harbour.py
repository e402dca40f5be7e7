"""A harbour on flat land: sheds with shallow roofs, portal cranes on the quay, stacks of containers."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.dwellings import Design, Parts, repeated
from authoring.backgrounds.plots import DEEP
from authoring.backgrounds.solids import Frame, box, gabled_walls, roof_slab
from authoring.shapes.component import Mesh
from authoring.site.ways import merged

F64 = NDArray[np.float64]
HOME = Frame(0.0, 0.0, 0.0, 0.0)
CONTAINER = (6.06, 2.44, 2.59)  # length, width, height [m]
PAINTS = ("painted_steel", "painted_steel_clean", "brick", "painted_metal", "white_paint")


def draw_sheds(count: int, rng: np.random.Generator) -> tuple[Design, ...]:
    """Draw warehouses, with doors along both long sides and a band of windows under the eaves.

    Args:
        count: How many.
        rng: Random stream.

    Returns:
        The designs.
    """
    return tuple(_shed(rng) for _ in range(count))


def crane(rng: np.random.Generator) -> Parts:
    """Model a portal crane, its rails along x, its boom out over -y, about its middle on the quay.

    Args:
        rng: Random stream.

    Returns:
        Steel, machine house and windows of the cab.
    """
    tall, span, gauge = float(rng.uniform(24.0, 30.0)), 7.0, 8.0
    steel = [_bar((x, y, 0.0), (x * 0.8, y * 0.75, tall), 0.45) for x in (-span, span) for y in (-gauge, gauge)]
    steel += [_bar((-span, y, 7.0), (span, y, 7.0), 0.4) for y in (-gauge, gauge)]
    steel += [_bar((x, -gauge, 9.0), (x, gauge, 9.0), 0.4) for x in (-span * 0.95, span * 0.95)]
    steel += [box(HOME, (x * 0.55, -9.0, tall + 0.8), (0.5, 30.0, 0.8)) for x in (-span * 0.5, span * 0.5)]
    # Beams join the legs' tops and carry the booms; others between the booms carry mast and stays.
    beam = 0.8 * span + 0.6
    steel += [_bar((-beam, y, tall), (beam, y, tall), 0.6) for y in (-0.75 * gauge, 0.75 * gauge)]
    steel += [_bar((-2.0, y, tall + 1.2), (2.0, y, tall + 1.2), 0.45) for y in (-36.0, -18.0, 3.0, 19.0)]
    steel += [_bar((0.0, 3.0, tall + 1.2), (0.0, 2.0, tall + 13.0), 0.5)]
    steel += [_bar((0.0, 2.0, tall + 12.5), (0.0, end, tall + 1.6), 0.16) for end in (-36.0, -18.0, 19.0)]
    steel += [_bar((x, -22.0, tall), (x * 0.6, -22.0, 8.7), 0.05) for x in (-1.6, 1.6)]
    steel += [box(HOME, (0.0, -22.0, 8.6), (1.2, 3.0, 0.25))]
    house = box(HOME, (0.0, 14.0, tall + 3.3), (3.0, 5.0, 2.0))
    cab = box(HOME, (0.0, -12.0, tall - 1.2), (1.6, 1.5, 1.3))
    return ((PAINTS[int(rng.integers(0, 2))], merged(steel)), ("white_paint", house), ("window", cab))


def container_stacks(rng: np.random.Generator, shapes: int) -> tuple[Parts, ...]:
    """Model blocks of containers, four long, three wide and up to four high, and one more at an end.

    Args:
        rng: Random stream.
        shapes: How many different blocks.

    Returns:
        The blocks.
    """
    length, width, height = CONTAINER
    body = box(HOME, (0.0, 0.0, height / 2), (length / 2, width / 2, height / 2))
    blocks = []
    for _ in range(shapes):
        spots: dict[str, list[tuple[float, float, float]]] = {}
        for bay in (-1.5, -0.5, 0.5, 1.5):
            for row in (-1.0, 0.0, 1.0):
                for tier in range(int(rng.integers(0, 5))):
                    paint = PAINTS[int(rng.integers(0, len(PAINTS)))]
                    spots.setdefault(paint, []).append(
                        (bay * (length + 0.3), row * (width + 0.15), tier * (height + 0.01))
                    )
        spots.setdefault("brick", []).append((0.5 * (length + 0.3) * 5, 0.0, 0.0))
        blocks.append(
            tuple((paint, repeated(body, np.array(rows), np.zeros(len(rows)))) for paint, rows in sorted(spots.items()))
        )
    return tuple(blocks)


def _shed(rng: np.random.Generator) -> Design:
    x, y = (round(float(v), 3) for v in (rng.uniform(16.0, 30.0), rng.uniform(9.0, 13.0)))
    eaves, pitch = round(float(rng.uniform(6.5, 9.5)), 3), 0.16
    wall = ("painted_metal", "white_paint", "painted_steel", "brick")[int(rng.integers(0, 4))]
    ridge = eaves + y * pitch
    body = gabled_walls(HOME, (x, y), (-DEEP, eaves, ridge))
    roof = roof_slab(HOME, (x + 0.4, y + 0.5), eaves - 0.5 * pitch, ridge, 0.25)
    vents = merged(
        [box(HOME, (float(at), 0.0, ridge + 0.35), (0.9, 0.7, 0.5)) for at in np.arange(-x + 4.0, x - 3.0, 9.0)]
    )
    doors = [
        box(HOME, (float(at), side * y, 2.3), (2.2, 0.09, 2.3))
        for at in np.arange(-x + 5.0, x - 3.0, 8.5)
        for side in (-1.0, 1.0)
    ]
    base = box(HOME, (0.0, 0.0, (0.8 - DEEP) / 2), (x + 0.07, y + 0.07, (0.8 + DEEP) / 2))
    band = [box(HOME, (0.0, side * y, eaves - 1.1), (x - 0.8, 0.07, 0.55)) for side in (-1.0, 1.0)]
    panes = (("window", merged(band)),)
    tiles = ("galvanised_steel", "painted_metal")[int(rng.integers(0, 2))]
    whole = ((wall, body), ("concrete", base), ("galvanised_steel", merged(doors)))
    return Design(
        (x, y), eaves, (whole, ((wall, body),)), (((tiles, merged([roof, vents])),), ((tiles, roof),)), (panes, panes)
    )


def _bar(start: tuple[float, float, float], stop: tuple[float, float, float], half: float) -> Mesh:
    """Make a straight bar of square section."""
    a, b = np.array(start), np.array(stop)
    run = b - a
    length = float(np.linalg.norm(run))
    way = run / length
    side = np.cross(way, [0.0, 0.0, 1.0] if abs(way[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    turn = np.stack([way, side, np.cross(way, side)])
    bar = box(HOME, (length / 2, 0.0, 0.0), (length / 2, half, half))
    return Mesh(
        bar.points @ turn + a,
        bar.face_counts,
        bar.corners,
        (bar.normals.astype(np.float64) @ turn).astype(np.float32),
        bar.st,
    )
