"""A building's surfaces: a glazed core behind piers and bands, shops, parapets, flat roofs; and its windows."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.quads import WALLS, boxes, placed, ring
from authoring.backgrounds.towers import GROUND_STOREY, Style, Tier, Tower

F64 = NDArray[np.float64]
Faces = dict[str, list[F64]]

NEAR, MIDDLE = 80.0, 240.0  # distances to the site up to which facades have windows, and piers and bands [m]
AROUND = 60.0  # largest distance of cameras beside the site [m]
PARAPET = 1.05  # height of parapets over the roof [m]
SHOP_SILL, SHOP_HEAD = 0.55, 3.55  # of the shops' glazing [m]
_FOOT = -1.6  # walls go down to here [m]
_THICK = 0.35  # of parapets [m]
_UNDER = 0.3  # part of a band below the floor [m]


@dataclass(frozen=True)
class Openings:
    """Windows of one building, each by the middle of its place in the wall.

    Attributes:
        places: World positions [m], shape (N, 3), float64.
        yaw: Direction of the wall to the window's right, seen from outside [rad], shape (N,), float64.
        sizes: Width and height [m], shape (N, 2), float64.
        shop: Whether each is a shop's, shape (N,), bool.
    """

    places: F64
    yaw: F64
    sizes: F64
    shop: NDArray[np.bool_]


def sides_of(tier: Tier) -> list[tuple[F64, F64, float, float]]:
    """List the four walls of a tier in its building's coordinates.

    Args:
        tier: The tier.

    Returns:
        Of each wall its lower left corner seen from outside [m], shape (2,), float64, the unit direction to its right,
        shape (2,), float64, its width [m], and that direction's heading [rad].
    """
    x0, x1, y0, y1 = tier.rim
    starts = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    return [
        (np.array(start), np.array([np.cos(turn), np.sin(turn)]).round(), length, turn)
        for start, turn, length in zip(
            starts, (0.0, np.pi / 2, np.pi, 1.5 * np.pi), (x1 - x0, y1 - y0, x1 - x0, y1 - y0), strict=True
        )
    ]


def bays(width: float, style: Style) -> int:
    """Count the bays of a wall.

    Args:
        width: Of the wall [m].
        style: The facade.
    """
    return max(round(width / style.bay), 1)


def floors(tier: Tier, style: Style) -> F64:
    """List the levels of a tier's floors above its shops [m], shape (N,), float64; the roof is the last."""
    low = GROUND_STOREY if tier.levels[0] == 0.0 else tier.levels[0]
    count = max(round((tier.levels[1] - low) / style.storey), 1)
    return low + (tier.levels[1] - low) * np.arange(count + 1) / count


def tower_faces(tower: Tower) -> Faces:
    """Build a building's surfaces in the world, in a detail that depends on its distance to the site.

    Args:
        tower: The building.

    Returns:
        Faces by material recipe [m], each of shape (F, 4, 3), float64; those of its roofs under `roofing`.
    """
    faces: Faces = {}
    for tier in tower.tiers:
        if tower.away > MIDDLE:
            _add(faces, tower.style.far, boxes(*_ends(tier, _FOOT if tier.levels[0] == 0.0 else None), WALLS))
        else:
            _relief(faces, tower, tier)
        _roof(faces, tower, tier)
    return {role: [placed(np.concatenate(parts), tower.spot, tower.heading)] for role, parts in faces.items()}


def openings(tower: Tower, strip: F64) -> Openings:
    """Find the windows of a near building, in the walls that are visible from the site or above it.

    Args:
        tower: The building.
        strip: Corners of the site in plan [m], shape (4, 2), float64.

    Returns:
        Its windows, including those of the shops.
    """
    style, rows = tower.style, [np.zeros((0, 7))]
    for tier in tower.tiers:
        levels = floors(tier, style)
        spans = [(low + style.band[0] - _UNDER, high - _UNDER, 0.0) for low, high in pairwise(levels.tolist())]
        if tier.levels[0] == 0.0:
            spans.append((SHOP_SILL, SHOP_HEAD, 1.0))
        for start, along, width, turn in sides_of(tier):
            if not _faces(tower, start, along, strip):
                continue
            count = bays(width, style)
            right = width / count * (np.arange(count) + 0.5)
            plan = start + right[:, None] * along
            for low, high, shop in spans:
                size = (width / count - style.pier[0], high - low)
                tail = np.tile([(low + high) / 2, turn, *size, shop], (count, 1))
                rows.append(np.hstack([plan, tail]))
    table = np.concatenate(rows)
    places = placed(table[:, None, :3], tower.spot, tower.heading)[:, 0]
    return Openings(places, table[:, 3] + tower.heading, table[:, 4:6], table[:, 6] > 0.5)


def _faces(tower: Tower, start: F64, along: F64, strip: F64) -> bool:
    """Check whether any part of the site, or its close surroundings, lies in front of a wall."""
    corner = placed(np.array([[[*start, 0.0]]]), tower.spot, tower.heading)[0, 0, :2]
    turn = np.arctan2(along[1], along[0]) + tower.heading
    return float(((strip - corner) @ np.array([np.sin(turn), -np.cos(turn)])).max()) > -AROUND


def _relief(faces: Faces, tower: Tower, tier: Tier) -> None:
    """Place piers and bands in front of a glazed core."""
    style, rim = tower.style, np.array(tier.rim)
    ground = tier.levels[0] == 0.0
    foot, top = (_FOOT if ground else tier.levels[0] - 0.4), tier.levels[1]
    _add(faces, style.glass, boxes(*_ends(tier, foot), WALLS))
    width, deep = style.pier
    for start, along, length, _ in sides_of(tier):
        count = bays(length, style)
        outward = np.array([along[1], -along[0]])
        right = start + length / count * np.arange(1, count)[:, None] * along
        one, other = right - width / 2 * along, right + width / 2 * along + deep * outward
        low = np.column_stack([np.minimum(one, other), np.full(count - 1, foot)])
        high = np.column_stack([np.maximum(one, other), np.full(count - 1, top)])
        _add(faces, tower.wall, boxes(low, high, _showing(outward)))
    corners = np.array([[rim[i], rim[j]] for i in (0, 1) for j in (2, 3)])
    inward = np.array([[1 if i == 0 else -1, 1 if j == 2 else -1] for i in (0, 1) for j in (2, 3)])
    ends = np.stack([corners - (deep + 0.03) * inward, corners + max(0.7 * width, 0.35) * inward])
    low = np.column_stack([ends.min(axis=0), np.full(4, foot)])
    high = np.column_stack([ends.max(axis=0), np.full(4, top)])
    _add(faces, tower.wall, boxes(low, high, WALLS))
    tall, out = style.band
    for level in floors(tier, style)[:-1]:
        if ground and level == GROUND_STOREY:
            continue
        _add(faces, tower.band, ring(rim, _wider(rim, out), (level - _UNDER, level - _UNDER + tall)))
    if ground:
        _shop_storey(faces, tower, rim)


def _shop_storey(faces: Faces, tower: Tower, rim: F64) -> None:
    out = tower.style.pier[1]
    _add(faces, tower.wall, ring(rim, _wider(rim, 0.75 * out), (_FOOT, SHOP_SILL), "ou"))
    top = GROUND_STOREY - _UNDER + tower.style.band[0]
    _add(faces, tower.wall, ring(rim, _wider(rim, out + 0.07), (SHOP_HEAD, GROUND_STOREY - 0.1)))
    _add(faces, "metal_panel", ring(rim, _wider(rim, out + 0.22), (GROUND_STOREY - 0.1, GROUND_STOREY + 0.1)))
    _add(faces, tower.band, ring(rim, _wider(rim, tower.style.band[1]), (GROUND_STOREY + 0.1, top), "ou"))


def _roof(faces: Faces, tower: Tower, tier: Tier) -> None:
    """Close a tier by a roof within a parapet."""
    rim, top = np.array(tier.rim), tier.levels[1]
    near = tower.away <= MIDDLE
    out = max(tower.style.pier[1], tower.style.band[1]) + 0.10 if near else 0.0
    role = tower.wall if near else tower.style.far
    outer, inner = _wider(rim, out), _wider(rim, -_THICK)
    _add(
        faces,
        role,
        ring(rim, outer, (top - 0.45, top + PARAPET), "od") if near else ring(rim, outer, (top, top + PARAPET), "o"),
    )
    _add(faces, role, ring(inner, outer, (top, top + PARAPET), "ui"))
    _add(faces, "roofing", np.array([[[inner[i], inner[j], top] for i, j in ((0, 2), (1, 2), (1, 3), (0, 3))]]))


def _ends(tier: Tier, foot: float | None) -> tuple[F64, F64]:
    x0, x1, y0, y1 = tier.rim
    return np.array([x0, y0, tier.levels[0] if foot is None else foot]), np.array([x1, y1, tier.levels[1]])


def _wider(rim: F64, by: float) -> F64:
    return rim + by * np.array([-1.0, 1.0, -1.0, 1.0])


def _showing(outward: F64) -> str:
    """Name the sides of a pier that are visible: its front and its sides."""
    if outward[0] == 0.0:
        return "xX" + ("Y" if outward[1] > 0 else "y")
    return "yY" + ("X" if outward[0] > 0 else "x")


def _add(faces: Faces, role: str, part: F64) -> None:
    if len(part):
        faces.setdefault(role, []).append(part)
