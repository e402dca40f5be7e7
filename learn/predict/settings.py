"""Settings of a prediction."""

from typing import Literal

from pydantic import Field

from groundwork.settings import Settings
from learn.instance_defaults import FEWEST, LINK

Up = Literal["x", "-x", "y", "-y", "z", "-z"]
Unit = Literal["m", "cm", "mm", "ft", "us-ft"]
UNITS: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "us-ft": 1200.0 / 3937.0}  # [m]


class PredictSettings(Settings):
    """How a scan is labeled."""

    unit: Unit | None = Field(default=None, description="Unit of the coordinates; left out: as the scan states")
    scale: float | None = Field(
        default=None,
        gt=0.0,
        allow_inf_nan=False,
        description="Length of one unit of the coordinates, if it is not one of `unit` [m]",
    )
    up: Up = Field(default="z", description="Axis of the scan that points up")
    table: str = Field(default="", description="Table of classes of the result; empty: that of the model")
    classes: tuple[str, ...] = Field(default=(), description="Classes to keep; others become 255; empty: all")
    min_confidence: float = Field(
        default=0.0, ge=0.0, le=1.0, description="Least confidence; other points become 255 [1]"
    )
    link: float = Field(
        default=LINK,
        gt=0.0,
        le=100.0,
        description="Side of the cubes by which instances are found: points of a class in touching cubes are "
        "connected [m]",
    )
    fewest: int = Field(default=FEWEST, ge=1, description="Least number of thinned points of an instance [1]")
    batch: int = Field(default=8, ge=1, le=1024, description="Number of samples that the model gets at once [1]")
    chunk: int = Field(default=2_000_000, ge=1, description="Number of points of the scan in memory at once [1]")
