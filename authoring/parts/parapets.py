"""Concrete parapets with a coping along both edges of a deck."""

from dataclasses import dataclass

import numpy as np

from authoring.alignment import Alignment
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.part import FURNITURE, Part
from authoring.sections import cut_corners
from authoring.sweep import prism
from groundwork.settings import Settings

LEDGE = 0.03  # [m] of slab that shows outside a parapet
EMBEDDED = 0.010  # [m] parapet into slab, coping onto parapet


class ParapetSettings(Settings):
    """Solid concrete parapets; what is left out is drawn."""

    thickness: float | None = drawn(0.25, 0.40, "Thickness at the foot [m]", ge=0.20, le=0.60)
    height: float | None = drawn(0.85, 1.10, "Top of the coping above the asphalt [m]", ge=0.60, le=1.50)
    batter: float | None = drawn(0.0, 0.08, "How much thinner the parapet is below its coping [m]", ge=0.0, le=0.15)
    coping_height: float | None = drawn(0.10, 0.16, "Height of the coping [m]", ge=0.05, le=0.30)
    coping_overhang: float | None = drawn(0.03, 0.06, "Coping over the parapet's faces [m]", ge=0.02, le=0.10)
    joint_pitch: float | None = drawn(3.0, 6.0, "Distance between false joints [m]", ge=1.0, le=30.0)
    chamfer: float | None = drawn(0.015, 0.030, "Leg of chamfers [m]", ge=0.0, le=0.05)


@dataclass(frozen=True)
class Parapets:
    """Section of both parapets.

    Attributes:
        thickness: At the foot [m].
        height: Top of the coping above the asphalt [m].
        batter: How much thinner the parapet is below its coping [m].
        coping_height: Height of the coping [m].
        coping_overhang: Coping over the parapet's faces [m].
        joint_pitch: Largest distance between false joints [m].
        chamfer: Leg of chamfers [m].
    """

    thickness: float
    height: float
    batter: float
    coping_height: float
    coping_overhang: float
    joint_pitch: float
    chamfer: float


def draw_parapets(settings: ParapetSettings, draws: Draws) -> Parapets:
    """Draw the section of the parapets.

    Args:
        settings: What the user fixed.
        draws: Random stream and profile of the bridge.
    """
    return Parapets(
        thickness=draw(settings, "thickness", draws),
        height=draw(settings, "height", draws),
        batter=draw(settings, "batter", draws),
        coping_height=draw(settings, "coping_height", draws),
        coping_overhang=draw(settings, "coping_overhang", draws),
        joint_pitch=draw(settings, "joint_pitch", draws),
        chamfer=draw(settings, "chamfer", draws),
    )


def parapet_parts(
    parapets: Parapets, foot: float, slab_top: float, name: str, low: float, high: float, place: Alignment
) -> list[Part]:
    """Build parapet and coping of both sides over one run.

    Args:
        parapets: Section.
        foot: From the axis to the inner foot of the parapet [m].
        slab_top: Height of the slab's top [m].
        name: Ending of the names, e.g. `000`.
        low: Station where they begin [m].
        high: Station where they end [m].
        place: Axis of the bridge.
    """
    p = parapets
    under, outer = p.height - p.coping_height, foot + p.thickness
    wall = np.array(
        [(foot, slab_top - EMBEDDED), (outer, slab_top - EMBEDDED), (outer, under + EMBEDDED),
         (foot + p.batter, under + EMBEDDED)]
    )  # fmt: skip
    crown = np.array(
        [(foot + p.batter - p.coping_overhang, under), (outer + p.coping_overhang, under),
         (outer + p.coping_overhang, p.height - 0.02), (foot + p.batter - p.coping_overhang, p.height)]
    )  # fmt: skip
    crown = cut_corners(crown, p.chamfer)
    fields = int(np.ceil((high - low) / p.joint_pitch))
    joints = tuple(float(joint) for joint in np.linspace(low, high, fields + 1)[1:-1])
    parts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for label, kind, outline in (("Parapet", "parapet", wall), ("Coping", "parapet_coping", crown)):
            sided = outline if sign > 0.0 else (outline * (-1.0, 1.0))[::-1]
            surface = prism(sided, low, high, "station", place, p.chamfer, joints)
            size: dict[str, object] = {"length": high - low, "height": p.height, "thickness": p.thickness}
            parts.append(Part(f"{label}_{name}_{side}", kind, "Role_ParapetConcrete", FURNITURE, surface, size))
    return parts
