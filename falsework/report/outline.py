"""Points on the true surface of a bridge, shown for a capture without a cloud."""

from typing import TYPE_CHECKING

import numpy as np

from render.capture import Truth

if TYPE_CHECKING:
    from recon.cloud import Cloud

POINTS = 6000


def outline_cloud(truth: Truth) -> "Cloud | None":
    """Sample points evenly on surfaces that are neither background nor unlabeled.

    Args:
        truth: Truth of a capture.

    Returns:
        Points with class and instance, without color and uncertainty; None if there is no such surface.
    """
    from recon.cloud import COLUMNS, MESH, Cloud, without_observations

    corners, ids, labels = truth.surface()
    rows = {row.id: row for row in truth.instances if row.class_name not in ("background", "unlabelled")}
    mine = np.isin(ids, list(rows))
    first, second, third = np.moveaxis(corners[mine], 1, 0)
    area = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    if not area.sum() > 0.0:
        return None
    draw = np.random.default_rng(0)
    pick = draw.choice(len(area), POINTS, p=area / area.sum())
    u, v = draw.random((2, POINTS, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    columns = {
        name: np.zeros((POINTS, kind.width) if kind.width > 1 else POINTS, kind.dtype) for name, kind in COLUMNS.items()
    }
    instance = ids[mine][pick]
    kinds = ["", *sorted({row.component for row in rows.values()} - {""})]
    columns |= {
        "coord": first[pick] + u * (second - first)[pick] + v * (third - first)[pick],
        "segment": labels[mine][pick].astype(np.uint8),
        "instance": instance.astype(np.uint32),
        "component": np.array([kinds.index(rows[int(number)].component) for number in instance], np.uint16),
        "uncertainty": np.full(POINTS, np.nan, np.float32),
    }
    return Cloud(columns, without_observations(POINTS), tuple(kinds), truth.classes, {}, (), {}, MESH)
