"""Boats and ships about the middle of their waterline, the bow towards +x."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.solids import Frame, box
from authoring.shapes.component import Mesh
from authoring.site.growth import faceted
from authoring.site.ways import merged

F64 = NDArray[np.float64]
Vessel = tuple[tuple[str, Mesh], ...]
HOME = Frame(0.0, 0.0, 0.0, 0.0)


def hull(length: float, beam: float, freeboard: float, draught: float) -> Mesh:
    """Loft a hull over five frames, closed by a deck and a transom.

    Args:
        length: Overall [m].
        beam: Largest width [m].
        freeboard: Height of the deck above the water [m].
        draught: Depth of the keel below it [m].

    Returns:
        A closed mesh.
    """
    shape = ((-0.5, 0.78, 1.0), (-0.2, 1.0, 0.95), (0.15, 0.92, 1.0), (0.36, 0.55, 1.15), (0.5, 0.02, 1.35))
    rings = []
    for along, wide, high in shape:
        half, top = 0.5 * beam * wide, freeboard * high
        rings.append(
            [
                (along * length, side * half * part, level)
                for side, part, level in (
                    (-1.0, 1.0, top),
                    (-1.0, 0.8, -0.3 * draught),
                    (1.0, 0.0, -draught * min(wide + 0.2, 1.0)),
                    (1.0, 0.8, -0.3 * draught),
                    (1.0, 1.0, top),
                )
            ]
        )
    points = np.array(rings).reshape(-1, 3)
    faces = []
    for ring in range(4):
        low, high = 5 * ring, 5 * ring + 5
        for k in range(5):
            ahead = (k + 1) % 5
            faces += [(low + k, low + ahead, high + ahead), (low + k, high + ahead, high + k)]
    faces += [(0, 3, 1), (1, 3, 2), (0, 4, 3), (20, 21, 23), (21, 22, 23), (20, 23, 24)]
    return faceted(points, np.array(faces), 0.0)


def motor_boat(rng: np.random.Generator) -> Vessel:
    """Model a motor boat with a cabin and its windscreen.

    Args:
        rng: Random stream.
    """
    length = float(rng.uniform(6.0, 10.0))
    beam = 0.34 * length
    cabin = box(HOME, (0.05 * length, 0.0, 1.25), (0.16 * length, 0.32 * beam, 0.55))
    pane = box(HOME, (0.05 * length, 0.0, 1.42), (0.163 * length, 0.325 * beam, 0.22))
    rail = box(HOME, (-0.35 * length, 0.0, 0.95), (0.1 * length, 0.4 * beam, 0.16))
    return ("white_paint", merged([hull(length, beam, 0.75, 0.5), cabin])), ("window", pane), ("timber", rail)


def sailing_boat(rng: np.random.Generator) -> Vessel:
    """Model a sailing boat at its mooring, the sail furled.

    Args:
        rng: Random stream.
    """
    length = float(rng.uniform(6.5, 11.0))
    mast, boom = 1.25 * length, 0.38 * length
    spars = [
        box(HOME, (0.06 * length, 0.0, 0.5 * mast), (0.06, 0.06, 0.5 * mast)),
        box(HOME, (0.06 * length - 0.5 * boom, 0.0, 1.55), (0.5 * boom, 0.05, 0.05)),
        box(HOME, (0.06 * length, 0.0, 0.6 * mast), (0.03, 0.09 * length, 0.03)),
    ]
    sail = box(HOME, (0.06 * length - 0.5 * boom, 0.0, 1.72), (0.48 * boom, 0.13, 0.13))
    cabin = box(HOME, (0.02 * length, 0.0, 0.85), (0.17 * length, 0.1 * length, 0.28))
    return (
        ("white_paint", merged([hull(length, 0.31 * length, 0.7, 0.7), cabin])),
        ("galvanised_steel", merged(spars)),
        ("painted_steel", sail),
    )


def rowing_boat(rng: np.random.Generator) -> Vessel:
    """Model a rowing boat with two thwarts.

    Args:
        rng: Random stream.
    """
    length = float(rng.uniform(3.8, 4.8))
    seats = [box(HOME, (at * length, 0.0, 0.43), (0.14, 0.16 * length, 0.03)) for at in (-0.22, 0.1)]
    return ("timber", merged([hull(length, 0.36 * length, 0.38, 0.25), *seats])), (
        "painted_steel",
        box(HOME, (-0.02 * length, 0.0, 0.40), (0.30 * length, 0.13 * length, 0.012)),
    )


def ferry(rng: np.random.Generator) -> Vessel:
    """Model a passenger ship of two decks.

    Args:
        rng: Random stream.
    """
    length = float(rng.uniform(28.0, 40.0))
    wide = 0.09 * length
    decks = [
        box(HOME, (-0.04 * length, 0.0, 2.9), (0.36 * length, wide, 1.25)),
        box(HOME, (-0.08 * length, 0.0, 5.2), (0.26 * length, 0.8 * wide, 1.1)),
        box(HOME, (0.14 * length, 0.0, 7.2), (0.06 * length, 0.5 * wide, 0.95)),
        box(HOME, (-0.2 * length, 0.0, 7.4), (0.03 * length, 0.25 * wide, 1.2)),
        box(HOME, (-0.04 * length, 0.0, 4.2), (0.38 * length, 1.05 * wide, 0.08)),
        box(HOME, (-0.08 * length, 0.0, 6.35), (0.28 * length, 0.85 * wide, 0.08)),
    ]
    panes = [
        box(HOME, (-0.04 * length, 0.0, 3.1), (0.35 * length, wide + 0.03, 0.5)),
        box(HOME, (-0.08 * length, 0.0, 5.4), (0.25 * length, 0.8 * wide + 0.03, 0.45)),
        box(HOME, (0.15 * length, 0.0, 7.4), (0.055 * length, 0.5 * wide + 0.03, 0.4)),
    ]
    return ("white_paint", merged([hull(length, 2.3 * wide, 1.7, 1.5), *decks])), ("window", merged(panes))


def freighter(rng: np.random.Generator) -> Vessel:
    """Model a small container ship.

    Args:
        rng: Random stream.
    """
    length = float(rng.uniform(80.0, 120.0))
    wide = 0.075 * length
    bridge = [
        box(HOME, (-0.4 * length, 0.0, 11.5), (0.05 * length, 0.85 * wide, 6.5)),
        box(HOME, (-0.42 * length, 0.0, 19.5), (0.015 * length, 0.2 * wide, 2.0)),
        box(HOME, (-0.39 * length, 0.0, 17.2), (0.03 * length, 1.0 * wide, 0.9)),
    ]
    pane = box(HOME, (-0.388 * length, 0.0, 17.4), (0.03 * length, 0.95 * wide, 0.5))
    stacks: dict[str, list[Mesh]] = {"painted_steel": [], "brick": [], "painted_metal": []}
    roles = tuple(stacks)
    for bay in np.arange(-0.32, 0.3, 14.0 / length):
        for row in (-0.75, -0.25, 0.25, 0.75):
            tiers = int(rng.integers(1, 4))
            middle = (float(bay * length), row * 0.85 * wide, 4.6 + 1.3 * tiers)
            stacks[roles[int(rng.integers(0, 3))]].append(box(HOME, middle, (6.1, 0.2 * wide, 1.3 * tiers)))
    loads = tuple((role, merged(boxes)) for role, boxes in stacks.items() if boxes)
    return (
        ("painted_steel_clean", hull(length, 2.2 * wide, 4.8, 3.0)),
        ("white_paint", merged(bridge)),
        ("window", pane),
        *loads,
    )


def fleet(rng: np.random.Generator) -> tuple[Vessel, ...]:
    """Model three motor boats, three sailing boats, two rowing boats and a ferry.

    Args:
        rng: Random stream.
    """
    return (
        *(motor_boat(rng) for _ in range(3)),
        *(sailing_boat(rng) for _ in range(3)),
        *(rowing_boat(rng) for _ in range(2)),
        ferry(rng),
    )
