"""Ends of parapets on the approaches: a block to which guardrails are bolted."""

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.parapets import EMBEDDED, Parapets
from authoring.parts.part import FURNITURE, Part
from authoring.shapes.sections import cut_corners, rectangle
from authoring.solids.extrusion import Prism

LENGTH = 1.0  # [m] of a block along the road: room for the bolts of a guardrail
_HIGHER = 0.05  # [m] higher than the parapet
_PROUD = 0.007  # [m] projection of its faces in front of those of the parapet


def terminal_parts(
    parapets: Parapets,
    foot: float,
    slab_top: float,
    block: tuple[str, float, float],
    place: Alignment,
    *,
    way: float,
) -> list[Part]:
    """Build the blocks in which the parapets of both sides end.

    Args:
        parapets: Their section.
        foot: From the axis to the inner foot of the parapets [m].
        slab_top: Height of the surface under them [m].
        block: Ending of the names, e.g. `Approach_0`, and lower and higher station of the blocks [m].
        place: Axis of the bridge.
        way: Height of the road or walkway beside them [m].
    """
    name, begin, end = block
    bottom, top = slab_top - EMBEDDED, way + parapets.height + _HIGHER
    outline = rectangle((foot - _PROUD, bottom), (foot + parapets.thickness + _PROUD, top))
    outline = cut_corners(outline, np.array([0.0, 0.0, 0.03, 0.03]))
    size: dict[str, object] = {"length": end - begin, "height": top - bottom, "thickness": parapets.thickness}
    return [
        Part(
            f"Terminal_{name}_{side}",
            "parapet",
            "Role_ParapetConcrete",
            FURNITURE,
            Prism(outline if sign > 0.0 else (outline * (-1.0, 1.0))[::-1], begin, end, "station", place, 0.03),
            dict(size),
        )
        for side, sign in (("L", 1.0), ("R", -1.0))
    ]
