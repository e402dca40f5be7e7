"""Detection of water: smooth, non-metallic materials on level surfaces only. Photographs show its reflections."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from render.gpu.materials import MaterialTable
from usd_schemas.flat_scene import FlatScene

F64 = NDArray[np.float64]

WATER = "WATER"
_LEVEL = 0.01  # largest ratio of the height of a draw's box to its shorter side [1]
_SMALLEST = 3.0  # [m] smallest width of a water surface


def with_waters(table: MaterialTable, scene: FlatScene, lower: F64, upper: F64) -> MaterialTable:
    """Use the shader of water for the materials of water.

    Args:
        table: The materials.
        scene: The scene.
        lower: Lower corner of each draw's box [m], shape (D, 3), float64.
        upper: Upper corner of each draw's box [m], shape (D, 3), float64.
    """
    size = upper - lower
    wide = size[:, :2].min(axis=1)
    level = (wide > _SMALLEST) & (size[:, 2] <= _LEVEL * wide)
    variants = list(table.variants)
    for material in np.unique(scene.draws.material):
        features = variants[material].features
        smooth = "MIRROR" in features and "HAS_METALLIC" not in features and "BLEND" not in features
        if smooth and table.rows[material]["emissive"][3] < 0.5 and level[scene.draws.material == material].all():
            variants[material] = replace(variants[material], features=(*features, WATER))
    return replace(table, variants=tuple(variants))
