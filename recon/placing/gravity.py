"""Where up is, as photographs tell: rows that were held level, and gimbals that wrote down how they stood."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

_STEADY = np.sin(np.radians(1.0))  # what all photographs of a gimbal may share: it is trimmed to about a degree
_LEAST, _GREATEST = np.sin(np.radians([0.5, 6.0]))  # a single photograph: of a good gimbal, of a steady hand
_HELD = 1.4826  # median absolute deviation to standard deviation
_USUAL, _USUAL_SIGMA = np.radians(30.0), 0.6  # a camera is pitched down by that, more or less by about 40 degrees
_KINDS, _USUALLY = 3, 2
_CAUCHY = 2.385  # of 95 % efficiency


@dataclass(frozen=True)
class GravityCues:
    """K directions of a model, and how far each rises above the horizon.

    Attributes:
        directions: In the model's frame, of length 1 or less [1], shape (K, 3), float64.
        heights: Component along up that each should have [1], shape (K,), float64.
        sigmas: Standard deviation of that, were each alone [1], shape (K,), float64.
        kinds: What is told: 0 rows, 1 columns and lines of sight, 2 the usual pitch, shape (K,), int64; those of one
            kind share an error.
        shared: The error that all directions of a kind share [1], shape (3,), float64.
    """

    directions: F64
    heights: F64
    sigmas: F64
    kinds: NDArray[np.int64]
    shared: F64

    def weights(self, ups: F64) -> F64:
        """Weigh each direction, less the farther off it is, and all of a kind no more than their shared error allows.

        Args:
            ups: Up in the model's frame [1], shape (3,), float64.

        Returns:
            Weights [1], shape (K,), float64.
        """
        off = (self.directions @ ups - self.heights) / self.sigmas
        robust = np.where(self.kinds == _USUALLY, 1.0, 1.0 / (1.0 + (off / _CAUCHY) ** 2))
        alone = robust / self.sigmas**2
        return alone * self._credit()[self.kinds]

    def cost(self, ups: F64) -> float:
        """Sum up how far all directions are off, a single one never by much.

        Args:
            ups: Up in the model's frame [1], shape (3,), float64.

        Returns:
            Twice the negative logarithm of the likelihood, up to a constant [1].
        """
        squares = ((self.directions @ ups - self.heights) / self.sigmas) ** 2
        robust = np.where(self.kinds == _USUALLY, squares, _CAUCHY**2 * np.log1p(squares / _CAUCHY**2))
        return float(self._credit()[self.kinds] @ robust)

    def _credit(self) -> F64:
        """Tell how much less a direction counts for the error that it shares with the others of its kind."""
        total = np.bincount(self.kinds, 1.0 / self.sigmas**2, _KINDS)
        return np.asarray(1.0 / (1.0 + total * self.shared**2))


def gravity_cues(rotations: F64, gimbal: F64 | None) -> GravityCues:
    """Tell what photographs say about up.

    Their rows were level, unless a gimbal says otherwise; their pitch is known from the gimbal alone. That a camera
    looks ahead and down rather than up is said once, weakly, for all of them: it tells up from down and no more.

    Args:
        rotations: Camera-to-world rotations in the model's frame, of photographs as they are looked at [1], shape
            (N, 3, 3), float64.
        gimbal: Up in each camera's axes, as its gimbal has it [1], shape (N, 3), float64, NaN where unknown; or None.

    Returns:
        The directions; those of the rows first.
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
    """Estimate how far rows stray from the plane that they should lie in: the one square to their least direction."""
    normal = np.linalg.svd(rows, full_matrices=False)[2][2]
    return float(_HELD * np.median(np.abs(rows @ normal))) * np.sqrt(len(rows) / max(len(rows) - 2, 1))
