"""Assignment of a survey's cameras to squares with sharp shadow maps.

A map is a square perpendicular to the sun's rays. Cameras whose near surroundings are in the same square share it, so
that a flight of hundreds of pictures needs a few maps. The assignment depends only on the flight, not on the worker or
the order of drawing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.pinhole import Pinhole, unproject

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

SHARP_TEXEL = 0.02  # [m] side of a texel of the sharp maps, across the sun's rays
_REACH = 25.0  # [m] everything that a camera sees within it is shadowed sharply
_SHARE = 0.3  # of a map's side: largest distance of sharp shadows for a small map
_MARGIN = 0.5  # [m] a camera moves that far during a readout, and shadows are blurred


@dataclass(frozen=True)
class ShadowSquares:
    """The squares of a survey.

    Attributes:
        centers: Middle of each square along right and up of the sun's view, counted from the anchor [m], shape (S, 2),
            float64.
        of_pose: Square of each pose, shape (N,), int64.
    """

    centers: F64
    of_pose: I64

    def together(self, rows: list[int]) -> list[int]:
        """Order poses by their square, those of one square in their given order.

        Args:
            rows: Some of the poses.
        """
        return sorted(rows, key=lambda row: int(self.of_pose[row]))


def near_reach(size: int) -> float:
    """Return the distance from a camera up to which shadows are sharp [m].

    Args:
        size: Side of the sharp map [px].
    """
    return min(_REACH, _SHARE * SHARP_TEXEL * size)


def share_squares(poses: F64, camera: Pinhole, across: F64, size: int) -> ShadowSquares:
    """Assign each pose to the first square that contains everything that it sees nearby.

    Args:
        poses: camera_to_world [m], shape (N, 4, 4), float64.
        camera: Intrinsics of every view.
        across: World position to right and up of the sun's view, counted from the anchor [m], shape (2, 4), float64.
        size: Side of the sharp map [px].
    """
    side = SHARP_TEXEL * size - 2 * _MARGIN
    boxes: list[tuple[F64, F64]] = []
    of_pose = np.zeros(len(poses), np.int64)
    for row, (low, high) in enumerate(zip(*_near_boxes(poses, camera, across, near_reach(size)), strict=True)):
        grown = [(np.minimum(low, other[0]), np.maximum(high, other[1])) for other in boxes]
        fitting = [number for number, box in enumerate(grown) if np.all(box[1] - box[0] <= side)]
        of_pose[row] = fitting[0] if fitting else len(boxes)
        if fitting:
            boxes[fitting[0]] = grown[fitting[0]]
        else:
            boxes.append((low, high))
    return ShadowSquares(np.array([(low + high) / 2 for low, high in boxes]).reshape(-1, 2), of_pose)


def _near_boxes(poses: F64, camera: Pinhole, across: F64, reach: float) -> tuple[F64, F64]:
    """Bound what each camera sees within reach, in the sun's view: lower and upper corners, each shape (N, 2)."""
    columns, rows = np.meshgrid(np.linspace(0, camera.width, 7), np.linspace(0, camera.height, 5))
    pixels = np.column_stack([columns.ravel(), rows.ravel()])
    rays = unproject(pixels, np.ones(len(pixels)), camera, np.eye(4))
    rim = reach * rays / np.linalg.norm(rays, axis=1, keepdims=True)
    local = np.vstack([np.zeros(3), rim, reach * np.array([0.0, 0.0, 1.0])])
    world = np.einsum("nij,pj->npi", poses[:, :3, :3], local) + poses[:, None, :3, 3]
    flat = world @ across[:, :3].T + across[:, 3]
    return flat.min(axis=1), flat.max(axis=1)
