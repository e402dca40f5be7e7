"""The family `arch`: deck, through, half-through and tied arches, and masonry arches with filled spandrels.

Source: proportions as listed in Shi, Kim, Narazaki (rise 1/3 to 1/8 of the span, ring depth 1/45 to 1/70, spandrel
columns at 1/8 to 1/14); profile `paper` follows the Random Bridge Generator's arch (span 100 m, rise 25 m, ring 10 m
wide and 2 m deep, columns every 10 m, box deck 3 m deep).
"""

from dataclasses import dataclass

from authoring.axis.alignment import Layout
from authoring.families.arch_deck import DrawnDeckArch, build_deck_arch, draw_deck_arch
from authoring.families.arch_masonry import DrawnMasonry, build_masonry, draw_masonry
from authoring.families.arch_settings import ArchSettings as ArchSettings
from authoring.families.arch_settings import draw_choice
from authoring.families.arch_through import DrawnThroughArch, build_through_arch, draw_through_arch
from authoring.families.shared import SharedSettings
from authoring.parts.drawing import Draws
from authoring.parts.part import Part
from authoring.parts.piers import Ground


@dataclass(frozen=True)
class DrawnArch:
    """Every drawn parameter of an arch bridge.

    Attributes:
        arrangement: `deck`, `through`, `half_through`, `tied` or `masonry`.
        arch: Record of the arrangement.
    """

    arrangement: str
    arch: DrawnDeckArch | DrawnThroughArch | DrawnMasonry


def draw_arch(settings: ArchSettings, shared: SharedSettings, draws: Draws) -> tuple[Layout, DrawnArch]:
    """Draw the values that the user did not set.

    Args:
        settings: Settings of the family.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.

    Returns:
        Layout for the site, and the record that `build_arch` builds from.
    """
    choice = draw_choice(settings, draws)
    if choice.arrangement == "deck":
        layout, arch = draw_deck_arch(choice, shared, draws)
    elif choice.arrangement == "masonry":
        layout, arch = draw_masonry(settings, choice.springing, shared, draws)
    else:
        layout, arch = draw_through_arch(settings, choice, shared, draws)
    return layout, DrawnArch(choice.arrangement, arch)


def build_arch(layout: Layout, drawn: DrawnArch, ground: Ground) -> list[Part]:
    """Build every member of an arch bridge.

    Args:
        layout: Axis and supports.
        drawn: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Parts in a fixed order.
    """
    if isinstance(drawn.arch, DrawnDeckArch):
        return build_deck_arch(layout, drawn.arch, ground)
    if isinstance(drawn.arch, DrawnMasonry):
        return build_masonry(layout, drawn.arch, ground)
    return build_through_arch(layout, drawn.arch, ground)
