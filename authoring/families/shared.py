"""What all families of bridges have in common: the settings of the road, its edges and its supports."""

from pydantic import Field

from authoring.parts.abutments import AbutmentSettings
from authoring.parts.bearings import BearingSettings
from authoring.parts.drawing import drawn
from authoring.parts.parapets import ParapetSettings
from authoring.parts.piers import PierSettings
from authoring.parts.roadway import RoadwaySettings
from groundwork.settings import Settings


class SharedSettings(Settings):
    """Parts of a bridge that do not depend on its family; what is left out is drawn."""

    clearance: float | None = drawn(5.0, 7.0, "Least height of the girders' soffit above z = 0 [m]", ge=3.0, le=30.0)
    grade: float | None = drawn(-0.015, 0.015, "Rise of the road per metre [1]", ge=-0.05, le=0.05)
    heading: float = Field(
        default=0.0, ge=-180.0, le=180.0, description="Direction of the axis, counter-clockwise from +x [deg]"
    )
    roadway: RoadwaySettings = RoadwaySettings()
    parapet: ParapetSettings = ParapetSettings()
    bearing: BearingSettings = BearingSettings()
    pier: PierSettings = PierSettings()
    abutment: AbutmentSettings = AbutmentSettings()
