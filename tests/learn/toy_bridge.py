"""A toy bridge whose every point is labeled by a formula: deck, piers and a wavy ground."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.cloud import COLUMNS, Cloud, without_observations, write_cloud
from usd_schemas.components import class_id, class_rows

COMPONENTS = ("", "deck_slab", "column", "ground", "pier_cap")
DECK_HEIGHT, WIDTH, LENGTH = 8.0, 9.0, 40.0


def toy_cloud(seed: int = 0, count: int = 12_000, bridge: str = "b0", **changed: NDArray[Any]) -> Cloud:
    """Make a bridge along x, 40 m by 9 m, on a map far from the origin.

    Args:
        seed: Seed of the points.
        count: Number of points.
        bridge: Its hash.
        changed: Columns to put in place of the toy's own.
    """
    rng = np.random.default_rng(seed)
    kind = rng.choice([1, 2, 3, 4], count, p=[0.4, 0.15, 0.4, 0.05])
    coord = np.empty((count, 3))
    coord[:, 0] = rng.uniform(0.0, LENGTH, count)
    coord[:, 1] = rng.uniform(-0.5 * WIDTH, 0.5 * WIDTH, count)
    coord[:, 2] = DECK_HEIGHT + rng.uniform(-0.2, 0.2, count)
    piers = np.isin(kind, (2, 4))
    coord[piers, 0] = rng.choice([10.0, 20.0, 30.0], piers.sum()) + rng.uniform(-0.5, 0.5, piers.sum())
    coord[piers, 1] *= 0.3
    coord[kind == 2, 2] = rng.uniform(0.0, 7.0, (kind == 2).sum())
    coord[kind == 4, 2] = rng.uniform(7.0, 7.8, (kind == 4).sum())
    ground = kind == 3
    coord[ground, 1] = rng.uniform(-15.0, 15.0, ground.sum())
    coord[ground, 2] = 0.2 * np.sin(coord[ground, 0])
    columns = {
        name: np.zeros((count, row.width) if row.width > 1 else count, row.dtype) for name, row in COLUMNS.items()
    }
    ids = np.array([255, *(class_id(name) for name in ("deck", "column", "background", "pier_cap"))], np.uint8)
    uncertainty = rng.exponential(0.06, count).astype(np.float32)
    columns |= {
        "coord": coord + np.array([4e5, 5e6, 30.0]),
        "color": rng.integers(0, 256, (count, 3)).astype(np.uint8),
        "component": kind.astype(np.uint16),
        "segment": ids[kind],
        "instance": kind.astype(np.uint32),
        "uncertainty": uncertainty,
        "n_views": rng.integers(1, 9, count).astype(np.uint16),
        "confidence": rng.random(count).astype(np.float32),
        "label_margin_px": rng.random(count).astype(np.float32),
    }
    columns["normal"][:, 2] = 1.0
    columns |= changed
    return Cloud(columns, without_observations(count), COMPONENTS, class_rows(), {}, (), {}, "mesh", bridge)


def write_toy(folder: Path, seed: int = 0, count: int = 12_000, bridge: str = "b0", **changed: NDArray[Any]) -> Path:
    """Write the toy as a cloud of ours.

    Args:
        folder: Folder to make.
        seed: Seed of the points.
        count: Number of points.
        bridge: Its hash.
        changed: Columns to put in place of the toy's own.
    """
    folder.mkdir(parents=True)
    write_cloud(folder, toy_cloud(seed, count, bridge, **changed))
    return folder
