"""Data of a road bridge that its approaches need: its lines, and where its parapets end."""

from dataclasses import dataclass

ABUTMENT_BACK = 1.2  # [m] from the bearing line to the abutment's back face: where the approach begins
UNDERLAY = 0.07  # [m] from the finished surface of a road down to the ground under it


@dataclass(frozen=True)
class RoadSection:
    """Cross-section of a road at the bridge's ends, the same on both sides.

    Attributes:
        lines: From the axis to the left to the middle of each painted line [m], rising, and whether it is dashed.
        dash: Length of a dash, and of the gap behind it [m].
        line_width: Width of the lines [m].
        parapet: From the axis to the foot of the parapets [m].
        footway: Whether a footway lies between the carriageway and the parapets.
        walls: Length of the wing walls behind the abutments' back faces, on which the parapets end [m].
    """

    lines: tuple[tuple[float, bool], ...]
    dash: tuple[float, float]
    line_width: float
    parapet: float
    footway: bool
    walls: float
