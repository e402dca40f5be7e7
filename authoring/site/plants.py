"""Plants made of bark, an opaque core and leaf cards: bushes, crowns, branches."""

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.component import Mesh
from authoring.site.growth import OCTAHEDRON, OCTANTS, faceted
from authoring.site.sprays import cards, crown, spray
from authoring.site.ways import merged

F64 = NDArray[np.float64]
Plant = tuple[tuple[str, Mesh], ...]
_HEART = 0.72  # ratio of the size of a crown's opaque core to that of the crown [1]


def bush(rng: np.random.Generator, count: int, kind: str = "scrub") -> Plant:
    """Make a bush about 1 m high and wide, of four ellipsoids.

    Args:
        rng: Random stream.
        count: Cards.
        kind: A row of `SPRAYS`.

    Returns:
        Its opaque core and its leaves.
    """
    lobes = [[0.0, 0.0, 0.50, 0.36, 0.36, 0.44]]
    for turn in rng.uniform(0.0, 2.0) + np.array([0.0, 2.3, 4.1]):
        reach, wide, high = rng.uniform(0.18, 0.30), rng.uniform(0.22, 0.32), rng.uniform(0.24, 0.36)
        lobes.append([reach * np.cos(turn), reach * np.sin(turn), 0.85 * high, wide, wide, high])
    return foliage(rng, np.array(lobes), count, kind, 2.6)


def foliage(
    rng: np.random.Generator, lobes: F64, count: int, kind: str, cover: float, hearts: int | None = None
) -> Plant:
    """Cover the lobes of a crown with sprays.

    Args:
        rng: Random stream.
        lobes: Middle and half axes of each lobe [m], shape (K, 6), float64.
        count: Cards of the whole crown.
        kind: A row of `SPRAYS`.
        cover: Ratio of the area of all cards to that of the lobes [1].
        hearts: Number of lobes, from the first on, with an opaque core; None for all of them.

    Returns:
        The cores and the leaves.
    """
    area = 4.0 * np.pi * np.cbrt(np.prod(lobes[:, 3:], axis=1)) ** 2
    share = np.maximum(np.round(count * area / area.sum()), 1).astype(int)
    size = np.sqrt(cover * area.sum() / share.sum())
    middle = (lobes[:, :3] * area[:, None]).sum(axis=0) / area.sum()
    whole = np.maximum(np.abs(lobes[:, :3] - middle) + lobes[:, 3:], 1e-3).max(axis=0)
    leaves = []
    for lobe, many in zip(lobes, share.tolist(), strict=True):
        side = min(size, 1.5 * float(lobe[3:].max()))
        leaves.append(crown(rng, lobe[:3], lobe[3:], (middle, whole), many, kind=kind, size=side))
    bodies = [
        faceted(lobe[:3] + _HEART * lobe[3:] * (OCTAHEDRON + rng.uniform(-0.12, 0.12, (6, 3))), OCTANTS, 0.9)
        for lobe in lobes[:hearts]
    ]
    return (("foliage", merged(bodies)), ("leaves", merged(leaves))) if bodies else (("leaves", merged(leaves)),)


def branches(rng: np.random.Generator, height: float, reach: float, tiers: int, spokes: int) -> Mesh:
    """Make the whorls of a spruce: cards along drooping branches, rotated to both sides.

    Args:
        rng: Random stream.
        height: Height of the tree [m].
        reach: Length of the lowest branches [m].
        tiers: Whorls.
        spokes: Branches of the lowest whorl; higher ones have fewer.

    Returns:
        The cards.
    """
    pieces = []
    for tier in range(tiers):
        share = tier / tiers
        many = max(round(spokes * (1.0 - 0.45 * share)), 3)
        turn = 2 * np.pi * (np.arange(many) + 0.5 * (tier % 2) + rng.uniform(-0.25, 0.25, many)) / many
        long = reach * (1.0 - share) ** 0.9 * rng.uniform(0.85, 1.12, many) + 0.05 * reach
        droop = rng.uniform(0.30, 0.55, many) * (1.0 - 1.6 * share)
        out = np.column_stack([np.cos(turn) * np.cos(droop), np.sin(turn) * np.cos(droop), -np.sin(droop)])
        level = np.column_stack([-np.sin(turn), np.cos(turn), np.zeros(many)])
        above = np.cross(out, level)
        roll = rng.choice((-1.0, 1.0), many) * rng.uniform(0.15, 0.75, many)
        wide = np.cos(roll)[:, None] * level + np.sin(roll)[:, None] * above
        foot = np.array([0.0, 0.0, height * (0.10 + 0.84 * share)])
        middle = foot + 0.5 * long[:, None] * out
        broad = (0.5 + 0.25 * share) * long
        stretch = 0.5 * long[:, None] * out
        ends = np.stack([middle - stretch, middle + stretch], axis=1)[:, [0, 0, 1, 1]]
        normals = ends * [1.0, 1.0, 0.0] / max(reach, 1e-6) + [0.0, 0.0, 0.55] + 0.2 * above[:, None]
        normals /= np.linalg.norm(normals, axis=2, keepdims=True)
        pieces.append(cards(middle, broad[:, None] * wide, stretch, spray(rng, "spruce", many), normals))
    tip = np.array([[0.0, 0.0, 0.965 * height]] * 2)
    across = 0.06 * reach * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    up = np.tile([[0.0, 0.0, 0.05 * height]], (2, 1))
    upward = np.tile(np.array([0.0, 0.3, 0.95]) / np.hypot(0.3, 0.95), (2, 4, 1))
    return merged([*pieces, cards(tip, across, up, spray(rng, "spruce", 2), upward)])


def cone(height: float, low: float, radius: float, sides: int) -> Mesh:
    """Make a slim cone: the opaque core of a conifer.

    Args:
        height: Its tip [m].
        low: Its foot [m].
        radius: Radius of the foot [m].
        sides: Corners of the foot.
    """
    turn = 2 * np.pi * np.arange(sides) / sides
    rim = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(sides, low)])
    points = np.vstack([rim, [0.0, 0.0, height], [0.0, 0.0, low]])
    ahead = np.arange(sides)
    behind = (ahead + 1) % sides
    tip, hub = np.full(sides, sides), np.full(sides, sides + 1)
    faces = np.concatenate([np.column_stack([ahead, behind, tip]), np.column_stack([behind, ahead, hub])])
    return faceted(points, faces, 0.5)


def limbs(rng: np.random.Generator, lobes: F64, low: float, radius: float) -> Mesh:
    """Make the branches from a trunk to the lobes of a crown.

    Args:
        rng: Random stream.
        lobes: Middle and half axes of each lobe [m], shape (K, 6), float64.
        low: Height of the lowest fork [m].
        radius: Radius of a branch at the fork [m].

    Returns:
        Three-sided spikes; their feet are open and must be inside the trunk.
    """
    points, faces = [], []
    for number, lobe in enumerate(lobes):
        foot = np.array([0.0, 0.0, rng.uniform(0.8, 1.1) * low])
        along = lobe[:3] - foot
        aside = np.cross(along, [0.3, 0.2, 1.001])
        aside *= radius / np.linalg.norm(aside)
        other = np.cross(along, aside)
        other *= radius / np.linalg.norm(other)
        ring = [foot + np.cos(a) * aside + np.sin(a) * other for a in (0.0, 2.1, 4.2)]
        points += [*ring, lobe[:3]]
        faces.append(4 * number + np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    return faceted(np.array(points), np.concatenate(faces), 0.7)
