"""Settings of a prediction."""

from pydantic import Field

from learn.datasets.scan_units import ScanUnits
from learn.instance_defaults import FEWEST


class PredictSettings(ScanUnits):
    """How a scan is labeled."""

    table: str = Field(default="", description="Table of classes of the result; empty: that of the model")
    classes: tuple[str, ...] = Field(default=(), description="Classes to keep; others become 255; empty: all")
    min_confidence: float = Field(
        default=0.0, ge=0.0, le=1.0, description="Least confidence; other points become 255 [1]"
    )
    link: float | None = Field(
        default=None,
        gt=0.0,
        le=100.0,
        description="Side of the cubes by which instances are found: points of a class in touching cubes are "
        "connected [m]; left out: 0.3, or twice the model's voxel if that is more",
    )
    fewest: int = Field(default=FEWEST, ge=1, description="Least number of thinned points of an instance [1]")
    batch: int = Field(default=8, ge=1, le=1024, description="Number of samples that the model gets at once [1]")
    chunk: int = Field(default=2_000_000, ge=1, description="Number of points of the scan in memory at once [1]")
