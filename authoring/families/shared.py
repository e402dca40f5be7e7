"""What all families of bridges have in common: the settings of the road, its edges and its supports."""

import numpy as np
from pydantic import Field

from authoring.alignment import Alignment, Layout
from authoring.parts.abutments import AbutmentSettings
from authoring.parts.bearings import BearingSettings
from authoring.parts.deck_top import DeckTop, DeckTopSettings
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.piers import PierSettings


class SharedSettings(DeckTopSettings):
    """Parts of a bridge that do not depend on its family; what is left out is drawn."""

    clearance: float | None = drawn(5.0, 7.0, "Least height of the girders' soffit above z = 0 [m]", ge=3.0, le=30.0)
    grade: float | None = drawn(-0.015, 0.015, "Rise of the road per metre [1]", ge=-0.05, le=0.05)
    heading: float = Field(
        default=0.0, ge=-180.0, le=180.0, description="Direction of the axis, counter-clockwise from +x [deg]"
    )
    bearing: BearingSettings = BearingSettings()
    pier: PierSettings = PierSettings()
    abutment: AbutmentSettings = AbutmentSettings()


def draw_layout_of(
    shared: SharedSettings, top: DeckTop, supports: tuple[float, ...], lowest_soffit: float, seat: float, draws: Draws
) -> Layout:
    """Draw the axis of a bridge and gather what the site has to know.

    Args:
        shared: What the user fixed.
        top: What lies on the deck.
        supports: Stations of the bearing lines, abutments first and last [m].
        lowest_soffit: Lowest underside of the superstructure above the finished deck surface, negative [m].
        seat: Top of the abutments' seats above the finished deck surface, negative [m].
        draws: Random stream and profile of the bridge.
    """
    clearance, grade = draw(shared, "clearance", draws), draw(shared, "grade", draws)
    lowest = min(grade * station for station in supports)
    level = round(clearance - lowest_soffit - lowest, 3)
    alignment = Alignment(level, grade, float(np.radians(shared.heading)))
    return Layout(
        alignment, supports, top.width, -seat, top.service, carriageway=top.carriageway, edge_line=top.edge_line
    )
