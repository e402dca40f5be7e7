"""Diagonals between the struts of two ribs: the K of a wind bracing."""

from itertools import pairwise

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.arch_axis import Rib
from authoring.parts.arches import EMBEDDED, RibSection, facetted, rib_direction
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.shapes.sections import rectangle
from authoring.solids.sweep import sweep

_APART = 0.02  # [m] from the axis to either diagonal's end at a strut
_INTO_STRUT = 0.06  # [m]


def diagonal_parts(
    rib: Rib, section: RibSection, stations: list[float], strut: tuple[float, float], place: Alignment
) -> list[Part]:
    """Build two diagonals in every field: from the ribs at one strut to the middle of the strut nearer the crown.

    Args:
        rib: Axis and depths.
        section: Lines and width of both ribs.
        stations: Of the struts, rising [m].
        strut: Along the arch and square to it [m].
        place: Level frame at mid-span.
    """
    size = 0.55 * min(strut)
    reach = section.lines[-1] - 0.5 * section.width + EMBEDDED + (0.05 if section.form == "steel" else 0.0)
    parts = []
    for number, (first, second) in enumerate(pairwise(stations)):
        outward, inward = (first, second) if second <= rib.middle + 1e-6 else (second, first)
        way = 1.0 if inward > outward else -1.0
        run = abs(inward - outward) - strut[0]
        # The slanting bar is cut by planes along the bridge: its length along the station grows with the slant.
        slant = size * float(np.hypot(1.0, run / reach))
        begin = _at(rib, outward + way * (0.5 * strut[0] + 0.5 * slant + 0.05))
        end = _at(rib, inward - way * (0.5 * strut[0] + 0.5 * slant - _INTO_STRUT))
        outline = rectangle((-0.5 * slant, -0.5 * size), (0.5 * slant, 0.5 * size))
        for side, sign in (("L", 1.0), ("R", -1.0)):
            places = [(sign * _APART, end), (sign * reach, begin)]
            places.sort(key=lambda item: item[0])
            rings = np.stack([outline + where for _, where in places])
            surface = facetted(sweep(rings, np.array([left for left, _ in places]), "left", place))
            facts: dict[str, object] = {"width": size, "depth": size, "length": float(np.hypot(run, reach))}
            name = f"Arch_Diagonal_{number:02d}_{side}"
            parts.append(Part(name, "arch_brace", section.role, SUPERSTRUCTURE, surface, facts))
    return parts


def _at(rib: Rib, station: float) -> np.ndarray:
    return rib_direction(rib, station)[0]
