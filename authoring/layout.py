"""What a scenario says about its bridge, and the draw of everything that it leaves open."""

from typing import Literal

import numpy as np

from authoring.alignment import Layout
from authoring.families.beam import BeamSettings
from authoring.families.registry import FAMILIES, DrawnBridge
from authoring.families.shared import SharedSettings
from authoring.parts.drawing import Draws


class BridgeSettings(SharedSettings):
    """The section `[bridge]` of a scenario."""

    family: Literal["beam"] = "beam"
    """Family of bridges, a key of the registry."""
    profile: Literal["default", "paper"] = "default"
    """Ranges that open parameters are drawn from."""
    beam: BeamSettings = BeamSettings()


def draw_layout(settings: BridgeSettings, rng: np.random.Generator) -> tuple[Layout, DrawnBridge]:
    """Draw a bridge before its site exists.

    Args:
        settings: What the user fixed.
        rng: Random stream of the bridge.

    Returns:
        What the site has to know, and the record that `build_bridge` builds from.
    """
    own = getattr(settings, settings.family)
    layout, record = FAMILIES[settings.family].draw(own, settings, Draws(rng, settings.profile))
    return layout, DrawnBridge(settings.family, record)
