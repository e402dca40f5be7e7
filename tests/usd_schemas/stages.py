"""Stages written by hand, and what their triangles come to."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]

Z_UP = 'upAxis = "Z"\n metersPerUnit = 1'

# A square of 2 x 2 about the origin, facing up, and nothing else.
SQUARE = """
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
"""


def write_stage(folder: Path, body: str, header: str = Z_UP, name: str = "stage.usda") -> Path:
    """Write a text stage.

    Args:
        folder: Where to write.
        body: Its prims.
        header: Its layer metadata.
        name: File name.
    """
    path = folder / name
    path.write_text(f"#usda 1.0\n(\n {header}\n)\n{body}\n", encoding="utf-8")
    return path


def read_body(folder: Path, body: str, header: str = Z_UP, subdivision: int = 1) -> FlatScene:
    """Write a text stage and read it flat.

    Args:
        folder: Where to write.
        body: Its prims.
        header: Its layer metadata.
        subdivision: How many times subdivision surfaces are refined.
    """
    return read_stage(write_stage(folder, body, header), choices=StageChoices(subdivision=subdivision))


def area_vectors(scene: FlatScene) -> F64:
    """Find the outward area vector of every drawn triangle in world space [m2], shape (T, 3), float64."""
    corners, _, rows = world_triangles(scene)
    outward = np.sign(np.linalg.det(scene.draws.transform[:, :3, :3]))[rows]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2 * outward[:, None]


def area(scene: FlatScene) -> float:
    """Find the total drawn area [m2]."""
    return float(np.linalg.norm(area_vectors(scene), axis=1).sum())


def volume(scene: FlatScene) -> float:
    """Find the volume that the drawn triangles enclose [m3], over 0 where they are wound outwards."""
    corners, _, _ = world_triangles(scene)
    return float(np.einsum("ti,ti->t", corners[:, 0], area_vectors(scene)).sum() / 3)


def bounds(scene: FlatScene) -> F64:
    """Find lower and upper corner of what is drawn [m], shape (2, 3), float64."""
    corners, _, _ = world_triangles(scene)
    return np.stack([corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)])
