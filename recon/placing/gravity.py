"""The up direction, estimated from photographs: image rows are assumed level, and gimbals state their angles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

_STEADY = np.sin(np.radians(1.0))  # error shared by all photographs of a gimbal, which is adjusted to about a degree
_LEAST, _GREATEST = np.sin(np.radians([0.5, 6.0]))  # error of a single photograph: with a good gimbal, and held in hand
_HELD = 1.4826  # median absolute deviation to standard deviation
_USUAL, _USUAL_SIGMA = np.radians(30.0), 0.6  # usual pitch of a camera; its standard deviation is about 40 degrees
_KINDS, _USUALLY = 3, 2
_CAUCHY = 2.385  # of 95 % efficiency


@dataclass(frozen=True)
class GravityCues:
    """K directions of a model with the height of each above the horizon.

    Attributes:
        directions: In the model's frame, of length 1 or less [1], shape (K, 3), float64.
        heights: Expected component of each along up [1], shape (K,), float64.
        sigmas: Standard deviation of each by itself [1], shape (K,), float64.
        kinds: Kind of cue: 0 rows, 1 columns and lines of sight, 2 the usual pitch, shape (K,), int64; those of one
            kind share an error.
        shared: The error that all directions of a kind share [1], shape (3,), float64.
    """

    directions: F64
    heights: F64
    sigmas: F64
    kinds: NDArray[np.int64]
    shared: F64

    def weights(self, ups: F64) -> F64:
        """Weight each direction: a larger residual reduces its weight, and the shared error limits that of its kind.

        Args:
            ups: Up in the model's frame [1], shape (3,), float64.

        Returns:
            Weights [1], shape (K,), float64.
        """
        off = (self.directions @ ups - self.heights) / self.sigmas
        robust = np.where(self.kinds == _USUALLY, 1.0, 1.0 / (1.0 + (off / _CAUCHY) ** 2))
        alone = robust / self.sigmas**2
        return alone * self._credit()[self.kinds]

    def derivatives(self, rotation: F64) -> F64:
        """Compute the derivatives of the components along up by a rotation of the model.

        Args:
            rotation: From the model's frame into the world [1], shape (3, 3), float64.

        Returns:
            Derivatives by the rotation vector [1/rad], shape (K, 3), float64.
        """
        turned = self.directions @ rotation.T
        return np.column_stack([turned[:, 1], -turned[:, 0], np.zeros(len(turned))])

    def cost(self, ups: F64) -> float:
        """Sum the robust costs of the residuals of all directions.

        Args:
            ups: Up in the model's frame [1], shape (3,), float64.

        Returns:
            Twice the negative logarithm of the likelihood, up to a constant [1].
        """
        squares = ((self.directions @ ups - self.heights) / self.sigmas) ** 2
        robust = np.where(self.kinds == _USUALLY, squares, _CAUCHY**2 * np.log1p(squares / _CAUCHY**2))
        return float(self._credit()[self.kinds] @ robust)

    def _credit(self) -> F64:
        """Return the factor that accounts for the error that a direction shares with the others of its kind."""
        total = np.bincount(self.kinds, 1.0 / self.sigmas**2, _KINDS)
        return np.asarray(1.0 / (1.0 + total * self.shared**2))


def gravity_cues(rotations: F64, gimbal: F64 | None) -> GravityCues:
    """Collect the cues of photographs for the up direction.

    Rows are assumed level unless a gimbal states otherwise; the pitch is known only from a gimbal. One cue of low
    weight states that all cameras together look ahead and down rather than up: it only decides which way is up.

    Args:
        rotations: Camera-to-world rotations in the model's frame, of upright photographs [1], shape (N, 3, 3), float64.
        gimbal: Up direction in each camera's axes from its gimbal [1], shape (N, 3), float64, NaN where unknown; or
            None.

    Returns:
        The cues; those of the rows first.
    """
    rows, forward = rotations[:, :, 0], rotations[:, :, 2]
    told = np.zeros(len(rows), bool) if gimbal is None else np.isfinite(gimbal).all(axis=1)
    ups = np.zeros((len(rows), 3)) if gimbal is None else np.nan_to_num(gimbal)
    usual = -np.cos(_USUAL) * rotations[:, :, 1] - np.sin(_USUAL) * forward
    directions = np.concatenate([rows, rotations[told, :, 1], forward[told], usual.mean(axis=0)[None]])
    heights = np.concatenate([ups[:, 0], ups[told, 1], ups[told, 2], [0.8]])
    kinds = np.repeat([0, 1, _USUALLY], [len(rows), 2 * int(told.sum()), 1])
    roll = float(np.clip(_roll_scatter(rows), _LEAST, _GREATEST))
    sigmas = np.array([roll, _STEADY, _USUAL_SIGMA])[kinds]
    return GravityCues(directions, heights, sigmas, kinds, np.array([max(_STEADY, roll / 3.0), _STEADY, 0.0]))


def _roll_scatter(rows: F64) -> float:
    """Estimate the deviation of rows from the plane perpendicular to their least principal direction."""
    normal = np.linalg.svd(rows, full_matrices=False)[2][2]
    return float(_HELD * np.median(np.abs(rows @ normal))) * np.sqrt(len(rows) / max(len(rows) - 2, 1))
