"""Similarities between point sets, and rotations from cameras and gravity."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

PARAMETERS = 7  # logarithm of the scale, rotation vector [rad], position of a center [m]
_BEHIND = 0.05  # weight of the backward direction of a camera as up, relative to that of its top
_LEVELNESS = 0.001  # least rise of the tops of level photographs above their rows' plane to indicate up


@dataclass(frozen=True)
class Similarity:
    """world = scale * rotation @ local + translation.

    Attributes:
        scale: World meters per unit [m].
        rotation: Rotation [1], shape (3, 3), float64.
        translation: Translation [m], shape (3,), float64.
    """

    scale: float
    rotation: F64
    translation: F64

    def move(self, points: F64) -> F64:
        """Transform points to the world.

        Args:
            points: Local positions [model units], shape (N, 3), float64.

        Returns:
            World positions [m], shape (N, 3), float64.
        """
        return self.scale * points @ self.rotation.T + self.translation

    def move_poses(self, poses: F64) -> F64:
        """Transform camera poses to the world; their rotations remain without scale.

        Args:
            poses: Local camera_to_world [model units], shape (N, 4, 4), float64.

        Returns:
            World camera_to_world [m], shape (N, 4, 4), float64.
        """
        moved = poses.copy()
        moved[:, :3, :3] = self.rotation @ poses[:, :3, :3]
        moved[:, :3, 3] = self.move(poses[:, :3, 3])
        return moved


def fit_similarity(source: F64, goal: F64) -> tuple[F64, F64, F64]:
    """Fit similarities to matching points in the least-squares sense, many sets at once.

    Source: Umeyama, Least-squares estimation of transformation parameters between two point patterns (1991).

    Args:
        source: Points [any unit], shape (..., N, 3), float64.
        goal: Matching points [any unit], shape (..., N, 3), float64.

    Returns:
        Scales, units of `goal` for each of `source` [1], shape (...,); rotations [1], shape (..., 3, 3); translations,
        in the unit of `goal` [any unit], shape (..., 3); all float64.
    """
    source_mean, goal_mean = source.mean(axis=-2), goal.mean(axis=-2)
    source_free, goal_free = source - source_mean[..., None, :], goal - goal_mean[..., None, :]
    left, values, right = np.linalg.svd(np.swapaxes(goal_free, -1, -2) @ source_free)
    sign = np.ones_like(values)
    sign[..., 2] = np.where(np.linalg.det(left) * np.linalg.det(right) < 0.0, -1.0, 1.0)
    rotation = (left * sign[..., None, :]) @ right
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = (values * sign).sum(axis=-1) / (source_free**2).sum(axis=(-1, -2))
        translation = goal_mean - scale[..., None] * np.einsum("...ij,...j->...i", rotation, source_mean)
    return scale, rotation, translation


def derivatives(similarity: Similarity, centered: F64) -> F64:
    """Compute the derivatives of transformed points by the parameters of a similarity.

    Args:
        similarity: The similarity.
        centered: Positions relative to the center whose world position is a parameter [model units], shape (N, 3),
            float64.

    Returns:
        Derivatives by the logarithm of the scale, the rotation vector and the position of the center [m], shape
        (N, 3, 7), float64.
    """
    arm = similarity.scale * centered @ similarity.rotation.T
    found = np.zeros((len(centered), 3, PARAMETERS))
    found[:, :, 0] = arm
    found[:, 0, 2], found[:, 0, 3] = arm[:, 2], -arm[:, 1]
    found[:, 1, 1], found[:, 1, 3] = -arm[:, 2], arm[:, 0]
    found[:, 2, 1], found[:, 2, 2] = arm[:, 1], -arm[:, 0]
    found[:, :, 4:] = np.eye(3)
    return found


def adjusted(similarity: Similarity, center: F64, delta: F64) -> Similarity:
    """Change a similarity by a step of its parameters.

    Args:
        similarity: The similarity.
        center: Position whose world position is a parameter [model units], shape (3,), float64.
        delta: Change of the logarithm of the scale [1], the rotation vector [rad] and the position [m], shape (7,),
            float64.
    """
    scale = similarity.scale * float(np.exp(delta[0]))
    rotation = rotation_by(delta[1:4]) @ similarity.rotation
    middle = similarity.move(center[None])[0] + delta[4:]
    return Similarity(scale, rotation, middle - scale * rotation @ center)


def rotation_by(vector: F64) -> F64:
    """Build the rotation about a vector by its length.

    Source: Rodrigues' formula.

    Args:
        vector: Rotation vector [rad], shape (3,), float64.

    Returns:
        The rotation [1], shape (3, 3), float64.
    """
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / max(angle, 1e-300)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def angles(rotations: F64, reference: F64) -> F64:
    """Measure the angles between rotations and a reference.

    Args:
        rotations: Rotations [1], shape (N, 3, 3), float64.
        reference: Rotation [1], shape (3, 3), float64.

    Returns:
        Angles [deg], shape (N,), float64.
    """
    chord = np.linalg.norm(rotations - reference, axis=(1, 2))  # 2 sqrt 2 sin(angle / 2), precise at small angles
    return np.degrees(2 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0)))


def camera_up(rotations: F64) -> F64:
    """Estimate the up direction from level photographs: their rows are horizontal, their tops point up.

    Of the directions perpendicular to all rows, it is the one nearest to the mean of the tops. The tops of cameras that
    look straight down may point anywhere; their backward direction has a small weight, and decides if the tops cancel.

    Args:
        rotations: Camera-to-world rotations in any frame [1], shape (N, 3, 3), float64.

    Returns:
        Unit vector in that frame [1], shape (3,), float64.
    """
    rows = rotations[:, :, 0]
    tops = (-rotations[:, :, 1] - _BEHIND * rotations[:, :, 2]).mean(axis=0)
    up = np.linalg.solve(rows.T @ rows / len(rows) + _LEVELNESS * np.eye(3), tops)
    return up / np.linalg.norm(up)


def turn_upright(rotations: F64, quarter_turns: NDArray[np.int64]) -> F64:
    """Rotate camera axes about the line of sight so that the photograph is upright.

    Args:
        rotations: Camera-to-world rotations of the stored pictures [1], shape (N, 3, 3), float64.
        quarter_turns: Turns by 90 degrees clockwise that each picture needs, shape (N,), int64.

    Returns:
        Rotations whose columns are right, down and forward of the upright pictures [1], shape (N, 3, 3), float64.
    """
    right, down, forward = (rotations[:, :, column] for column in range(3))
    rights = np.stack([right, -down, -right, down])  # a picture turned clockwise has its former left side on top
    downs = np.stack([down, right, -down, -right])
    each = np.arange(len(rotations))
    return np.stack([rights[quarter_turns, each], downs[quarter_turns, each], forward], axis=2)


def level_rotation(rotations: F64, gimbal: F64 | None = None) -> F64:
    """Find a rotation that makes level photographs upright; the direction of +x is arbitrary.

    Args:
        rotations: Camera-to-world rotations in any frame [1], shape (N, 3, 3), float64.
        gimbal: Up direction in each camera's axes from its gimbal [1], shape (N, 3), float64, NaN where unknown; or
            None. If half of the cameras have it, nothing else is used.

    Returns:
        Rotation from that frame into one with +z up [1], shape (3, 3), float64.
    """
    up = camera_up(rotations)
    told = np.flatnonzero(np.isfinite(gimbal).all(axis=1)) if gimbal is not None else np.zeros(0, np.int64)
    if gimbal is not None and 2 * len(told) >= len(rotations):
        up = np.median(np.einsum("nij,nj->ni", rotations[told], gimbal[told]), axis=0)
        up /= np.linalg.norm(up)
    return _frame(np.cross(np.eye(3)[np.argmin(np.abs(up))], up).astype(np.float64), up).T


def _frame(along: F64, up: F64) -> F64:
    """Build orthonormal axes along, sideways and up, as columns of a rotation, shape (3, 3)."""
    sideways = np.cross(up, along)
    sideways /= np.linalg.norm(sideways)
    ahead = along / np.linalg.norm(along)
    return np.column_stack([ahead, sideways, np.cross(ahead, sideways)])
