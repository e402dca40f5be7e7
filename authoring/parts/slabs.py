"""Slabs without girders: solid, voided and PK sections, and their bearing lines."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from authoring.axis.alignment import Alignment
from authoring.parts.bearings import Bearings
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.idle_settings import LEFT_OUT, Use
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, mirrored
from authoring.solids.extrusion import Prism
from groundwork.settings import Settings

LEAST_DEPTH = 0.25  # [m]
SIMPLE, CONTINUOUS = 22.0, 25.0  # span over depth [1] of road slabs
RAIL_SIMPLE, RAIL_CONTINUOUS = 15.0, 17.0  # of railway slabs, which have several times the load
SLENDERNESS = (0.6, 1.4)  # of the usual span over depth, that a user may set [1]
_PAPER_DEPTH = 1.0  # [m]
_TIP = 0.22  # [m] thickness of a cantilever at its edge
_CLOSEST_LINES, _WIDEST_LINES = 1.4, 4.5  # [m] between bearings
_BULGE = 0.30  # [m] of a hexagon at half its depth beyond its top
_DRIP = 0.02  # [m] chamfer under an edge

Section = Literal["solid", "voided", "pk", "hexagon"]


class SlabSectionSettings(Settings):
    """Section of a slab; omitted values are drawn at random."""

    uses: ClassVar[tuple[Use, ...]] = (
        Use("section", ("voided", "pk", "hexagon"), ("cantilever",)),
        Use("depth", LEFT_OUT, ("slenderness",)),
    )
    section: Section | None = chosen(
        {"solid": 40, "voided": 25, "pk": 35},
        "solid: solid slab with vertical sides; voided: outline of a box with short cantilevers; pk: trapezoid with "
        "cantilevers; hexagon: the paper's section",
        paper={"hexagon": 1, "pk": 1, "voided": 1},
    )
    slenderness: float | None = drawn(
        0.85,
        1.15,
        "Longest span over depth, as a share of 22 for simple and 25 for continuous spans, or of 15 and 17 under "
        "rails [1]",
        ge=SLENDERNESS[0],
        le=SLENDERNESS[1],
    )
    depth: float | None = Field(
        default=None, ge=LEAST_DEPTH, le=1.5, description="Depth of the slab [m]; drawn by `slenderness`"
    )
    cantilever: float | None = drawn(
        0.125, 0.25, "Length of a cantilever, as a share of the deck's width [1]", ge=0.05, le=0.30
    )
    bearings: int | None = Field(
        default=None,
        ge=2,
        le=5,
        description="Number of bearings at each support [1]; drawn from 2 to 5, mostly 1.4 to 4.5 m apart",
    )


def usual_slenderness(service: str, *, continuous: bool) -> float:
    """Look up the usual span over depth [1].

    Args:
        service: `road` or `rail`.
        continuous: One slab over all spans.
    """
    if service == "rail":
        return RAIL_CONTINUOUS if continuous else RAIL_SIMPLE
    return CONTINUOUS if continuous else SIMPLE


@dataclass(frozen=True)
class Slab:
    """Section of a slab.

    Attributes:
        section: `solid`, `voided`, `pk` or `hexagon`.
        depth: At its thickest [m].
        width: At its top [m].
        soffit_width: At its underside [m].
        lines: Distance of every bearing line to the left of the axis [m], rising.
        plain: Without chamfers.
    """

    section: str
    depth: float
    width: float
    soffit_width: float
    lines: tuple[float, ...]
    plain: bool


def draw_section(settings: SlabSectionSettings, draws: Draws) -> str:
    """Draw the kind of a slab's section, before its spans: voids are economical for longer ones.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
    """
    return draw_option(settings, "section", draws)


@dataclass(frozen=True)
class SlabNeeds:
    """Requirements of a bridge for its slab.

    Attributes:
        width: Overall deck width [m].
        longest: Longest span [m].
        ratio: Usual span over depth [1].
    """

    width: float
    longest: float
    ratio: float


def draw_slab_section(
    settings: SlabSectionSettings, section: str, needs: SlabNeeds, bearings: Bearings, draws: Draws
) -> Slab:
    """Draw the section of a slab.

    Args:
        settings: Values set by the user.
        section: Result of `draw_section`.
        needs: Deck width, longest span, and the usual depth for it.
        bearings: Bearings under it.
        draws: Random stream and profile of the bridge.
    """
    width = needs.width
    paper = draws.profile == "paper"
    share, cantilever = draw(settings, "slenderness", draws), draw(settings, "cantilever", draws)
    count_share = draws.random()
    depth = (
        _PAPER_DEPTH
        if paper and settings.slenderness is None
        else max(round(needs.longest / (needs.ratio * share), 2), LEAST_DEPTH)
    )
    depth = settings.depth or depth
    inset = {"solid": 0.0, "hexagon": 0.5 * cantilever, "voided": 0.8 * cantilever}.get(section, cantilever) * width
    soffit = round(width - 2.0 * inset, 3)
    reach = soffit - bearings.plinth_width - 0.30
    least, most = (int(np.clip(1 + edge, 2, 5)) for edge in (np.ceil(reach / _WIDEST_LINES), reach / _CLOSEST_LINES))
    count = settings.bearings or least + int(count_share * (max(most, least) - least + 1))
    lines = tuple(round(float(line), 3) for line in np.linspace(-0.5 * reach, 0.5 * reach, count))
    return Slab(section, depth, width, soffit, lines, paper)


def slab_outline(slab: Slab, top: float) -> F64:
    """Draw the section of a slab.

    Args:
        slab: Dimensions.
        top: Height of its top [m].

    Returns:
        Outline (left, above) [m], shape (P, 2), float64.
    """
    half, foot, bottom = 0.5 * slab.width, 0.5 * slab.soffit_width, top - slab.depth
    cut = 0.0 if slab.plain else _DRIP
    if slab.section == "solid":
        return cut_corners(mirrored([(half, bottom), (half, top)]), np.array([cut, 0.0, 0.0, cut]))
    if slab.section == "hexagon":
        return mirrored([(foot, bottom), (half + _BULGE, top - 0.5 * slab.depth), (half, top)])
    tip = min(_TIP, 0.6 * slab.depth)
    root = min(tip + 0.08, 0.8 * slab.depth)  # cantilevers become thicker towards the webs
    # A PK section's sides lean 31 degrees from the vertical at most, so that the cantilevers keep their length.
    lean = 0.0 if slab.section == "voided" else min(0.6 * (half - foot), 0.6 * (slab.depth - root))
    corners = [(foot, bottom), (foot + lean, top - root), (half, top - tip), (half, top)]
    legs = np.array([cut, 0.0, cut, 0.0])
    return cut_corners(mirrored(corners), np.concatenate([legs, legs[::-1]]))


def slab_parts(slab: Slab, spans: Spans, levels: Levels, place: Alignment) -> list[Part]:
    """Build one slab for each piece of deck.

    Args:
        slab: Section.
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    parts = []
    outline = slab_outline(slab, -levels.surfacing)
    for number, (low, high) in enumerate(spans.pieces):
        surface = Prism(outline, low, high, "station", place)
        size: dict[str, object] = {
            "length": high - low,
            "width": slab.width,
            "thickness": slab.depth,
            "section": slab.section,
            "spans": spans.count if spans.continuous else 1,
        }
        parts.append(Part(f"Deck_{number:03d}", "deck_slab", "Role_DeckConcrete", SUPERSTRUCTURE, surface, size))
    return parts
