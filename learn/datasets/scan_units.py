"""Unit and up axis of a scan's coordinates, as a user states them."""

from typing import Literal, get_args

from pydantic import Field

from groundwork.length_units import METERS
from groundwork.settings import Settings

Up = Literal["x", "-x", "y", "-y", "z", "-z"]
Unit = Literal["m", "cm", "mm", "ft", "us-ft"]
UNITS: dict[str, float] = {name: METERS[name] for name in get_args(Unit)}  # [m]


class ScanUnits(Settings):
    """How the coordinates of a scan are to be read."""

    unit: Unit | None = Field(default=None, description="Unit of the coordinates; left out: as the scan states")
    scale: float | None = Field(
        default=None,
        gt=0.0,
        allow_inf_nan=False,
        description="Length of one unit of the coordinates, if it is not one of `unit` [m]",
    )
    up: Up = Field(default="z", description="Axis of the scan that points up")


AS_STATED = ScanUnits()
