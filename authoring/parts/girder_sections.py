"""Sections of concrete girders: I, bulb-T, T, U, box and rectangle, and the faces at diaphragms."""

from dataclasses import dataclass

import numpy as np

from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, mirrored

EMBEDDED = 0.010  # [m] embedment of girders in the slab, and of diaphragms in both
HAUNCH_LEDGE = 0.02  # [m] width of a girder's top outside a haunch
_U_SLOPE = 0.25  # of a U girder's webs, outward for each meter of height


@dataclass(frozen=True)
class Girders:
    """All girders of a bridge have one section.

    Attributes:
        shape: `i`, `bulb_t`, `t`, `u`, `box` or `rectangle`.
        depth: Below slab and haunch [m]; 0 if the girders are left out.
        lines: Distance of every girder line to the left of the axis [m], rising.
        top_width: Overall width at the slab [m].
        bottom_width: Width at the soffit [m].
        web: Thickness of a web [m]; of a T stem or rectangle, its soffit.
        top_thickness: Edge of the top flange, or height of a T's fillet [m].
        bottom_thickness: Edge of the bottom flange, or floor of a U [m]; 0 without one.
        chamfer: Leg of chamfers [m].
        diaphragm: Thickness of diaphragms [m]; 0 for none.
        haunch: Concrete between girder and slab [m].
        end_blocks: The web of an I or bulb-T thickens at its ends.
    """

    shape: str
    depth: float
    lines: tuple[float, ...]
    top_width: float
    bottom_width: float
    web: float
    top_thickness: float
    bottom_thickness: float
    chamfer: float
    diaphragm: float
    haunch: float = 0.0
    end_blocks: bool = True

    @property
    def height(self) -> float:
        """From the slab's soffit between the girders down to theirs [m]."""
        return self.depth + self.haunch


def girder_outline(girders: Girders, thickening: float = 0.0) -> F64:
    """Draw the section of a girder, around its line and above its soffit.

    Args:
        girders: Section.
        thickening: Degree of thickening of an I or bulb-T's web towards an end block, 0 to 1 [1].

    Returns:
        Outline [m], shape (P, 2), float64; the same P for every thickening.
    """
    g, top = girders, girders.depth + EMBEDDED
    right = _outer_side(g, thickening)
    if g.shape in ("i", "bulb_t"):
        legs = [g.chamfer, 0.5 * g.chamfer, 0.0, 0.0, 0.5 * g.chamfer, 0.0]
    elif g.shape == "u":
        # Down the inside of the web from its flange to the floor.
        flange = 2.2 * g.web
        inner_top, floor = 0.5 * g.top_width - flange, g.bottom_thickness
        foot = 0.5 * g.bottom_width + _U_SLOPE * floor - 1.05 * g.web
        right = [
            *right,
            (inner_top, top),
            (inner_top, g.depth - g.top_thickness),
            (foot, floor + 0.10),
            (foot - 0.10, floor),
        ]
        legs = [g.chamfer, 0.0, 0.5 * g.chamfer, *[0.0] * 5]
    else:
        legs = [g.chamfer, *[0.0] * (len(right) - 1)]
    return cut_corners(mirrored(right), np.array(legs + legs[::-1]))


def _outer_side(girders: Girders, thickening: float) -> list[tuple[float, float]]:
    """List the corners of a girder's right side from its soffit up [m]."""
    g, top, bottom = girders, girders.depth + EMBEDDED, 0.5 * girders.bottom_width
    match g.shape:
        case "t":
            return [
                (bottom, 0.0),
                (bottom + 0.02, g.depth - g.top_thickness),
                (0.5 * g.top_width, g.depth - 0.01),
                (0.5 * g.top_width, top),
            ]
        case "i" | "bulb_t":
            block = 0.5 * min(g.top_width, g.bottom_width) - 0.03
            web = 0.5 * g.web + thickening * (block - 0.5 * g.web)
            # The slope of a flange depends on its width: wide ones are flatter.
            under = 0.07 * g.depth if g.shape == "i" else 0.06 + 0.10 * (0.5 * g.top_width - 0.5 * g.web)
            return [
                (bottom, 0.0),
                (bottom, g.bottom_thickness),
                (web, g.bottom_thickness + 0.12 * g.depth),
                (web, g.depth - g.top_thickness - under),
                (0.5 * g.top_width, g.depth - g.top_thickness),
                (0.5 * g.top_width, top),
            ]
        case "u":
            neck = g.depth - g.top_thickness
            return [
                (bottom, 0.0),
                (bottom + _U_SLOPE * neck, neck),
                (0.5 * g.top_width, neck + 0.02),
                (0.5 * g.top_width, top),
            ]
        case _:
            return [(bottom, 0.0), (bottom, top)]


def u_top_width(bottom_width: float, depth: float, top_thickness: float) -> float:
    """Find the overall width of a U girder at the slab [m]: its webs lean outward and end in small flanges.

    Args:
        bottom_width: Width at the soffit [m].
        depth: Depth [m].
        top_thickness: Of the flanges [m].
    """
    return bottom_width + 2.0 * _U_SLOPE * (depth - top_thickness) + 0.12


def diaphragm_heights(girders: Girders) -> tuple[float, float]:
    """Find a diaphragm's bottom and top above the girders' soffit [m].

    Args:
        girders: Section.
    """
    if girders.shape in ("i", "bulb_t"):
        bottom = girders.bottom_thickness + 0.12 * girders.depth
    else:
        bottom = 0.25 * girders.depth
    return bottom, girders.height + EMBEDDED


def diaphragm_outline(girders: Girders, left_line: float, right_line: float, thickening: float = 1.0) -> F64:
    """Draw a diaphragm between two neighboring girders: its sides follow theirs, a little inside them.

    Args:
        girders: Section of both girders.
        left_line: The line with the smaller distance to the left of the axis [m].
        right_line: The other line [m].
        thickening: Of the girders' webs where it stands, 0 to 1 [1].

    Returns:
        Outline, heights above the girders' soffit [m], shape (P, 2), float64.
    """
    side = np.array(_outer_side(girders, thickening))
    low, high = diaphragm_heights(girders)
    heights = np.concatenate([[low], side[(side[:, 1] > low) & (side[:, 1] < girders.depth), 1], [girders.depth]])
    reach = np.interp(heights, side[:, 1], side[:, 0]) - EMBEDDED
    # Beside the haunch it follows the haunch's side into the slab.
    heights = np.append(heights, high)
    reach = np.append(reach, 0.5 * girders.top_width - HAUNCH_LEDGE + girders.haunch)
    rising = np.stack([right_line - reach, heights], axis=1)
    falling = np.stack([left_line + reach, heights], axis=1)[::-1]
    return np.concatenate([rising, falling])
