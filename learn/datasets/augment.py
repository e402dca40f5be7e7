"""Augmentation of a training sample: mirroring, rotation about the vertical, scaling."""

import numpy as np
from numpy.typing import NDArray

from learn.datasets.settings import AugmentSettings

F32 = NDArray[np.float32]


def draw_change(settings: AugmentSettings, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw a mirroring, a rotation about z and a uniform scale.

    Args:
        settings: Which changes are allowed.
        rng: Source of randomness.

    Returns:
        Matrix for column vectors [1], shape (3, 3), float64: a multiple of a rotation or reflection.
    """
    side = -1.0 if settings.flip and rng.random() < 0.5 else 1.0
    angle = rng.uniform(0.0, 2.0 * np.pi) if settings.rotate else 0.0
    factor = rng.uniform(*settings.scale)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return factor * turn @ np.diag([1.0, side, 1.0])


def apply_change(change: NDArray[np.float64], coord: F32, normal: F32 | None) -> tuple[F32, F32 | None]:
    """Change positions and normals together.

    Args:
        change: Matrix of `draw_change` [1], shape (3, 3), float64.
        coord: Positions [m], shape (N, 3), float32.
        normal: Unit normals [1], shape (N, 3), float32, or None.

    Returns:
        Positions [m] and normals, changed, shape (N, 3), float32 each; normals stay unit vectors.
    """
    moved = (coord @ change.T).astype(np.float32)
    if normal is None:
        return moved, None
    rigid = change / abs(np.linalg.det(change)) ** (1 / 3)
    return moved, (normal @ rigid.T).astype(np.float32)
