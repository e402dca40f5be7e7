"""The families of bridges that can be built, and the one door to them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from authoring.alignment import Layout
from authoring.component import Component, Scatter
from authoring.families.beam import BeamSettings, build_beam, draw_beam
from authoring.parts.part import Part, number_parts
from authoring.parts.piers import Ground
from groundwork.settings import Settings


@dataclass(frozen=True)
class Family:
    """One family of bridges.

    Attributes:
        settings: Its own settings.
        draw: (its settings, shared settings, draws) to the layout and the family's record of what was drawn.
        build: (layout, that record, ground) to parts.
    """

    settings: type[Settings]
    draw: Callable[..., tuple[Layout, Any]]
    build: Callable[[Layout, Any, Ground], list[Part]]


FAMILIES: dict[str, Family] = {"beam": Family(BeamSettings, draw_beam, build_beam)}


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
        drawn: What was drawn together with it.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Closed components in world space, ids from FIRST_BRIDGE_ID on.
    """
    return number_parts(FAMILIES[drawn.family].build(layout, drawn.record, ground))
