"""Conversion of a scan's coordinates to meters with z up."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from learn.datasets.scan_units import UNITS, ScanUnits

F64 = NDArray[np.float64]

# Rows: the axis of the scan that becomes x, y and z, with its sign; each is a rotation.
_TURNS: dict[str, tuple[tuple[int, ...], ...]] = {
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
}

_SAME = 1e-3  # [1] tolerance: the US survey foot and the international foot count as equal


@dataclass(frozen=True, eq=False)
class Frame:
    """Conversion of a scan's coordinates to meters with z up.

    Attributes:
        meters: Length of one unit [m].
        turn: Rotation [1], shape (3, 3), float64.
    """

    meters: float
    turn: F64

    def apply(self, coord: F64) -> F64:
        """Convert positions.

        Args:
            coord: Positions [scan units], shape (N, 3), float64.

        Returns:
            Positions [m], z up, shape (N, 3), float64.
        """
        return (coord @ self.turn.T) * self.meters

    def rotate(self, normal: NDArray[np.float32]) -> NDArray[np.float32]:
        """Rotate directions.

        Args:
            normal: Unit vectors [1], shape (N, 3), float32.

        Returns:
            Unit vectors [1], shape (N, 3), float32.
        """
        return (normal @ self.turn.T).astype(np.float32)


def choose_frame(unit: float | None, settings: ScanUnits, where: object) -> Frame:
    """Choose the unit: the user's setting takes precedence over the scan's record; one of them is required.

    Args:
        unit: Length of a unit as the scan states [m]; None if it does not, 0 if its coordinates are angles.
        settings: The user's settings.
        where: Scan, for the error.

    Raises:
        InputError: The unit is not stated, is stated twice, or the coordinates are angles.
    """
    if settings.unit is not None and settings.scale is not None:
        raise InputError("both a unit and a scale are given", where=where, field="--scale", hint="Give one of them")
    meters = settings.scale if settings.scale is not None else unit
    if settings.unit is not None:
        meters = UNITS[settings.unit]
    if meters == 0.0:
        raise InputError(
            "its coordinates are longitudes and latitudes",
            where=where,
            hint="Project them into a coordinate system in meters or feet first",
        )
    if meters is None:
        raise InputError(
            "does not state the unit of its coordinates",
            where=where,
            field="--unit",
            allowed=", ".join(UNITS),
            hint="Give --unit, or --scale with the length of one unit [m]",
        )
    return Frame(meters, np.array(_TURNS[settings.up], np.float64))


def check_heights(unit: float | None, height: float | None, settings: ScanUnits, where: object) -> None:
    """Refuse a scan whose heights have another unit than its other coordinates, unless the user gives one for all.

    Args:
        unit: Length of a unit as the scan states [m]; None if it does not, 0 if its coordinates are angles.
        height: Length of a unit of its heights, where it states one for them alone [m].
        settings: The user's settings.
        where: Scan, for the error.

    Raises:
        InputError: The units differ.
    """
    if not unit or not height or settings.unit is not None or settings.scale is not None:
        return
    if abs(height / unit - 1.0) > _SAME:
        raise InputError(
            "its heights have another unit than its other coordinates",
            where=where,
            value=f"{height:g} m and {unit:g} m",
            hint="Convert the heights first, or give --unit if all three have one unit in truth",
        )


def contradiction(unit: float | None, frame: Frame) -> str:
    """Describe a difference between the user's unit and the scan's; empty if both agree or the scan states none.

    Args:
        unit: Length of a unit as the scan states [m]; None if it does not.
        frame: Of `choose_frame`.
    """
    if not unit or abs(frame.meters / unit - 1.0) < _SAME:
        return ""
    return f"the scan states a unit of {unit:g} m, and you gave {frame.meters:g} m: yours is used"
