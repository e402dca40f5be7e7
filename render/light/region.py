"""The region of interest of a scene, which has the finest resolution of light and shadow."""

import numpy as np
from numpy.typing import NDArray

from usd_schemas.components import BACKGROUND, UNLABELED, class_rows
from usd_schemas.flat_scene import FlatScene

F64 = NDArray[np.float64]

_NEAR_CAMERA = 40.0  # [m] without labels, objects closer to a camera than this belong to the region
_LARGEST = 400.0  # [m] a longer box is reduced to its middle


def region_of_interest(scene: FlatScene, lower: F64, upper: F64) -> tuple[F64, F64]:
    """Compute the box of the labeled draws; without labels, of objects near cameras; without cameras, of everything.

    Args:
        scene: A scene.
        lower: Lower corner of each draw's box [m], shape (D, 3), float64.
        upper: Upper corner of each draw's box [m], shape (D, 3), float64.

    Returns:
        Lower and upper corner [m], each of shape (3,), float64.
    """
    chosen = _labeled(scene)
    eyes = np.concatenate([track.poses[:, :3, 3] for track in scene.cameras] or [np.zeros((0, 3))])
    if not chosen.any() and len(eyes):
        gap = np.maximum(np.maximum(lower - eyes.max(axis=0), eyes.min(axis=0) - upper), 0.0)
        chosen = np.linalg.norm(gap, axis=1) < _NEAR_CAMERA
    if not chosen.any():
        chosen = np.ones(len(lower), bool)
    low, high = lower[chosen].min(axis=0), upper[chosen].max(axis=0)
    center = (low + high) / 2
    half = np.minimum((high - low) / 2, _LARGEST / 2)
    return center - half, center + half


def _labeled(scene: FlatScene) -> NDArray[np.bool_]:
    """Mark the draws that are not background, shape (D,); by the base table, for the same light in every table."""
    background = class_rows()[BACKGROUND].name
    known = {row.id: row.base_class != background for row in scene.instances if row.base_class}
    other = (scene.draws.label != BACKGROUND) & (scene.draws.label != UNLABELED)
    pairs = zip(scene.draws.instance.tolist(), other.tolist(), strict=True)
    return np.array([known.get(number, label) for number, label in pairs], bool)
