"""Identity of a bridge: a hash of its shape, which does not depend on look, surroundings, light or flight."""

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from usd_schemas import tokens
from usd_schemas.components import BACKGROUND, component_classes
from usd_schemas.flat_scene import InstanceRow

_STEP = 0.001  # [m] corners of boxes are rounded to this: far above the rounding of doubles, far below any part


def bridge_digest(
    corners: NDArray[np.float64],
    ids: NDArray[np.uint32],
    labels: NDArray[np.uint8],
    instances: Sequence[InstanceRow],
) -> str:
    """Hash the parts of the bridge: for each, its number of triangles and its box; neither order nor ids count.

    Args:
        corners: Corners of every triangle of the stage [m], shape (T, 3, 3), float64.
        ids: Instance id of each, shape (T,), uint32.
        labels: Class id of each, shape (T,), uint8.
        instances: Meaning of each instance id.

    Returns:
        SHA-256 in 64 hexadecimal digits; empty where there is no surface.
    """
    rows = np.flatnonzero(_of_bridge(ids, labels, instances))
    if not len(rows):
        return ""
    rows = rows[np.argsort(ids[rows], kind="stable")]
    first = np.flatnonzero(np.diff(ids[rows].astype(np.int64), prepend=-1))
    count = np.diff(np.append(first, len(rows)))
    low = np.minimum.reduceat(corners[rows].min(axis=1), first)
    high = np.maximum.reduceat(corners[rows].max(axis=1), first)
    table = np.column_stack([count, np.rint(low / _STEP), np.rint(high / _STEP)]).astype("<i8")
    return hashlib.sha256(table[np.lexsort(table.T)].tobytes()).hexdigest()


def _of_bridge(
    ids: NDArray[np.uint32], labels: NDArray[np.uint8], instances: Sequence[InstanceRow]
) -> NDArray[np.bool_]:
    """Select the triangles of the stage's bridge prim; else of components of a bridge or of any class; else all."""
    classes = component_classes()
    below = [row.id for row in instances if row.path.startswith(f"{tokens.BRIDGE}/")]
    parts = [row.id for row in instances if classes.get(row.component, "background") != "background"]
    for known in (below, parts):
        chosen = np.isin(ids, np.array(known, np.uint32))
        if chosen.any():
            return chosen
    return labels != BACKGROUND if (labels != BACKGROUND).any() else np.ones(len(ids), bool)
