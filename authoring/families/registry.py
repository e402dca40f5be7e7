"""The families of bridges, and the functions that draw and build one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from authoring.axis.alignment import Layout
from authoring.families.arch import ArchSettings, build_arch, draw_arch
from authoring.families.beam import BeamSettings, build_beam, draw_beam
from authoring.families.cable_stayed import CableStayedSettings, build_cable_stayed, draw_cable_stayed
from authoring.families.girder import SteelGirderSettings, build_girder, draw_girder
from authoring.families.shared import check_ground
from authoring.families.slab import SlabSettings, build_slab, draw_slab
from authoring.families.suspension import SuspensionSettings, build_suspension, draw_suspension
from authoring.parts.part import Part, number_parts
from authoring.parts.piers import Ground
from authoring.shapes.component import Component, Scatter
from groundwork.settings import Settings


@dataclass(frozen=True)
class Family:
    """One family of bridges.

    Attributes:
        settings: Its own settings.
        draw: (its settings, shared settings, draws) to the layout and the family's drawn record.
        build: (layout, that record, ground) to parts.
    """

    settings: type[Settings]
    draw: Callable[..., tuple[Layout, Any]]
    build: Callable[[Layout, Any, Ground], list[Part]]


FAMILIES: dict[str, Family] = {
    "arch": Family(ArchSettings, draw_arch, build_arch),
    "beam": Family(BeamSettings, draw_beam, build_beam),
    "cable_stayed": Family(CableStayedSettings, draw_cable_stayed, build_cable_stayed),
    "girder": Family(SteelGirderSettings, draw_girder, build_girder),
    "slab": Family(SlabSettings, draw_slab, build_slab),
    "suspension": Family(SuspensionSettings, draw_suspension, build_suspension),
}


@dataclass(frozen=True)
class DrawnBridge:
    """Everything that was drawn for one bridge; `dataclasses.asdict` turns it into plain values.

    Attributes:
        family: A key of FAMILIES.
        record: The family's frozen record, e.g. `DrawnBeam`.
    """

    family: str
    record: Any


def build_bridge(layout: Layout, drawn: DrawnBridge, ground: Ground) -> tuple[Component | Scatter, ...]:
    """Build a bridge on the ground.

    Args:
        layout: Axis, supports and deck of the bridge.
        drawn: The record drawn together with it.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Closed components in world space, ids from FIRST_BRIDGE_ID on.

    Raises:
        InputError: The ground lies above the deck.
    """
    check_ground(layout, ground)
    return number_parts(FAMILIES[drawn.family].build(layout, drawn.record, ground))
