"""From the coordinates of a scan to metres with z up."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from learn.predict.settings import UNITS, PredictSettings

F64 = NDArray[np.float64]

# Rows: which axis of the scan becomes x, y and z, and with which sign; each is a rotation.
_TURNS: dict[str, tuple[tuple[int, ...], ...]] = {
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
}

_SAME = 1e-3  # [1] the feet of a survey and of everybody else are one length here


@dataclass(frozen=True, eq=False)
class Frame:
    """How the coordinates of a scan become metres with z up.

    Attributes:
        meters: Length of one unit [m].
        turn: Rotation [1], shape (3, 3), float64.
    """

    meters: float
    turn: F64

    def apply(self, coord: F64) -> F64:
        """Change positions.

        Args:
            coord: Positions [scan units], shape (N, 3), float64.

        Returns:
            Positions [m], z up, shape (N, 3), float64.
        """
        return (coord @ self.turn.T) * self.meters

    def rotate(self, normal: NDArray[np.float32]) -> NDArray[np.float32]:
        """Turn directions.

        Args:
            normal: Unit vectors [1], shape (N, 3), float32.

        Returns:
            Unit vectors [1], shape (N, 3), float32.
        """
        return (normal @ self.turn.T).astype(np.float32)


def choose_frame(said: float | None, settings: PredictSettings, where: object) -> Frame:
    """Find the unit: what the user says counts more than what the scan says, and one of them must.

    Args:
        said: Length of a unit as the scan says [m]; None where it does not, 0 where its coordinates are angles.
        settings: What the user says.
        where: Scan, for the error.

    Raises:
        InputError: The unit is not stated, is stated twice, or the coordinates are angles.
    """
    if settings.unit is not None and settings.scale is not None:
        raise InputError("both a unit and a scale are given", where=where, field="--scale", hint="Give one of them")
    meters = settings.scale if settings.scale is not None else said
    if settings.unit is not None:
        meters = UNITS[settings.unit]
    if meters == 0.0:
        raise InputError(
            "its coordinates are longitudes and latitudes",
            where=where,
            hint="Project it into a system in metres or feet first",
        )
    if meters is None:
        raise InputError(
            "does not say the unit of its coordinates",
            where=where,
            field="--unit",
            allowed=", ".join(UNITS),
            hint="Name it, or give --scale, the metres that one unit of a cloud without scale stands for",
        )
    return Frame(meters, np.array(_TURNS[settings.up], np.float64))


def contradiction(said: float | None, frame: Frame) -> str:
    """Tell that the user says another unit than the scan; empty where both agree or the scan says none.

    Args:
        said: Length of a unit as the scan says [m]; None where it does not.
        frame: Of `choose_frame`.
    """
    if not said or abs(frame.meters / said - 1.0) < _SAME:
        return ""
    return f"the scan says {said:g} m a unit and you say {frame.meters:g} m: what you say counts"
