"""Settings of the bridge in a scenario, and the random draw of everything that they leave open."""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import ValidationInfo, field_validator

from authoring.axis.alignment import Layout
from authoring.families.arch import ArchSettings
from authoring.families.beam import BeamSettings
from authoring.families.cable_stayed import CableStayedSettings
from authoring.families.girder import SteelGirderSettings
from authoring.families.registry import FAMILIES, DrawnBridge
from authoring.families.shared import SharedSettings
from authoring.families.slab import SlabSettings
from authoring.families.suspension import SuspensionSettings
from authoring.parts.drawing import Draws, UnsuitedDeck
from authoring.parts.idle_settings import Use, refuse_idle
from groundwork.errors import InputError
from groundwork.settings import Settings

_OTHER_LANES = (4, 3, 2, 1, 6, 5)  # the widest common road first
FamilyName = Literal["arch", "beam", "cable_stayed", "girder", "slab", "suspension"]


class BridgeSettings(SharedSettings):
    """The section `[bridge]` of a scenario."""

    uses: ClassVar = (*SharedSettings.uses, Use("profile", ("default",), ("cable_stayed.size",)))
    family: FamilyName | dict[FamilyName, float] = "beam"
    """Family of bridges; or a table of weights by which it is drawn, e.g. `{beam = 2.0, arch = 1.0}`."""
    profile: Literal["default", "paper"] = "default"
    """Ranges that omitted parameters are drawn from: those of Falsework, or those of the paper."""
    arch: ArchSettings = ArchSettings()
    beam: BeamSettings = BeamSettings()
    cable_stayed: CableStayedSettings = CableStayedSettings()
    girder: SteelGirderSettings = SteelGirderSettings()
    slab: SlabSettings = SlabSettings()
    suspension: SuspensionSettings = SuspensionSettings()

    @field_validator("family", mode="before")
    @classmethod
    def _known_families(cls, value: object) -> object:
        if not isinstance(value, str | dict):
            raise ValueError("should be a name, or a table of weights such as { beam = 2.0, arch = 1.0 }")
        names = list(value) if isinstance(value, dict) else [value]
        unknown = [name for name in names if name not in FAMILIES]
        if unknown or not names:
            raise ValueError(f"not a family of bridges: {unknown or 'nothing'}; allowed: {', '.join(sorted(FAMILIES))}")
        if isinstance(value, dict):
            for name, weight in value.items():
                if not isinstance(weight, int | float) or isinstance(weight, bool) or not 0.0 <= weight <= 1e9:
                    raise ValueError(f"the weight of {name} is {weight!r}; allowed: numbers from 0 to 1e9")
            if not sum(value.values()) > 0.0:
                raise ValueError("all weights are 0; allowed: at least one above 0")
        return value

    @field_validator(*FAMILIES)
    @classmethod
    def _of_a_drawn_family(cls, section: Settings, info: ValidationInfo) -> Settings:
        """Refuse values for a family that is never drawn: they would have no effect."""
        family, name = info.data.get("family"), info.field_name or ""
        drawn = family is None or name in ([family] if isinstance(family, str) else family)
        if not drawn and section != type(section)():
            told = repr(family) if isinstance(family, str) else "a table without it"
            raise ValueError(
                f"the settings of family {name!r} have no effect, because bridge.family is {told}; "
                f"allowed: this section with family = {name!r}, or with a table of weights that contains it"
            )
        return section


def draw_layout(settings: BridgeSettings, rng: np.random.Generator) -> tuple[Layout, DrawnBridge]:
    """Draw a bridge before its site exists.

    Args:
        settings: Values set by the user.
        rng: Random stream of the bridge.

    Returns:
        Data for the site, and the record that `build_bridge` builds from.
    """
    refuse_idle(settings, settings.family, settings.profile)
    # The family has a separate stream, so that weights only change which family is drawn.
    family = _draw_family(settings.family, rng.spawn(1)[0])
    own, state = getattr(settings, family), deepcopy(rng)
    try:
        layout, record = FAMILIES[family].draw(own, settings, Draws(rng, settings.profile))
    except UnsuitedDeck:
        layout, record = _on_another_deck(settings, family, state)
    return layout, DrawnBridge(family, record)


def _on_another_deck(settings: BridgeSettings, family: str, rng: np.random.Generator) -> tuple[Layout, Any]:
    """Draw a bridge on the first deck that suits what the user set: its lanes or tracks had been drawn.

    Where none suits, the error is that of a deck which only another value rules out, if there is one: to change that
    value then helps.
    """
    other: InputError | None = None
    own, way = getattr(settings, family), settings.roadway
    lanes = () if way.lanes is not None else _OTHER_LANES
    tops: list[dict[str, Any]] = [{"roadway": way.model_copy(update={"lanes": count})} for count in lanes]
    tops += [] if settings.service is not None else [{"service": service} for service in ("rail_double", "rail_single")]
    for top in tops:
        try:
            draws = Draws(deepcopy(rng), settings.profile)
            return FAMILIES[family].draw(own, settings.model_copy(update=top), draws)
        except UnsuitedDeck:
            continue
        except InputError as error:
            other = other or error
    if other is not None:
        raise other
    return FAMILIES[family].draw(own, settings, Draws(rng, settings.profile))


def _draw_family(family: FamilyName | Mapping[FamilyName, float], rng: np.random.Generator) -> str:
    if isinstance(family, str):
        return family
    return Draws(rng).choose({str(name): family[name] for name in sorted(family)})
