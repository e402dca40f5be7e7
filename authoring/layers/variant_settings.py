"""The section `[variants]` of a scenario: looks, backgrounds and lights whose product is made from one bridge."""

from itertools import product
from typing import Any, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from authoring.light.daylight import LightSettings
from authoring.looks.roles import LOOKS
from groundwork.settings import Settings

BASE_LIGHT = "default"
NAME = r"^[A-Za-z][A-Za-z0-9_]*$"

Selections = dict[str, str]


class LightVariant(LightSettings):
    """Another light; omitted values are those of `[light]`."""

    name: str = Field(pattern=NAME, max_length=40, description="Name of the light variant")

    @model_serializer(mode="wrap")
    def _as_said(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave omitted values out: read again from a run or by a child, they must still be those of `[light]`."""
        return {name: value for name, value in dump(self).items() if name in self.model_fields_set}


class VariantSettings(Settings):
    """Variants of one scene: the product of these lists."""

    look: tuple[str, ...] = Field(default=(), description="Looks of the bridge; empty: only that of `[look]`")
    background: tuple[str, ...] = Field(
        default=(), description="Backgrounds, or paths of imported worlds; empty: only that of `[background]`"
    )
    light: tuple[LightVariant, ...] = Field(
        default=(), description="Lights, each a table with a name; empty: only that of `[light]`, with the name default"
    )

    @model_validator(mode="after")
    def _names_are_known_and_differ(self) -> Self:
        for name in self.look:
            if name not in LOOKS:
                raise ValueError(f"unknown look {name!r}; allowed: {', '.join(LOOKS)}")
        if any(light.name == BASE_LIGHT and light.model_fields_set != {"name"} for light in self.light):
            raise ValueError(f"{BASE_LIGHT!r} is the light of [light]: give a light of its own another name")
        for axis, names in self.names().items():
            if len({name.lower() for name in names}) < len(names):  # some disks do not tell cases apart
                raise ValueError(f"{axis} has one variant twice; allowed: each name once, found {', '.join(names)}")
        axes = [names for names in self.names().values() if names]
        joined = ["_".join(names).lower() for names in product(*axes)] if axes else []
        if twice := [name for name in joined if joined.count(name) > 1]:
            raise ValueError(f"two variants would have the name {twice[0]}: rename a look, a background or a light")
        return self

    def names(self) -> dict[str, tuple[str, ...]]:
        """List the names of each axis, `look`, `background` and `light`."""
        lights = tuple(light.name for light in self.light)
        return {"look": self.look, "background": self.background, "light": lights}

    def combinations(self) -> dict[str, Selections]:
        """List the variants: each name, such as `clean_none`, and its selection on each varied axis."""
        axes = {axis: names for axis, names in self.names().items() if names}
        chosen = [dict(zip(axes, names, strict=True)) for names in product(*axes.values())] if axes else []
        return {"_".join(selection.values()): selection for selection in chosen}

    def lights(self, base: LightSettings) -> dict[str, LightSettings]:
        """List every light of the scene, including the base light.

        Args:
            base: The section `[light]`.
        """
        lights = {BASE_LIGHT: base}
        for light in self.light:
            said = {name: getattr(light, name) for name in light.model_fields_set - {"name"}}
            lights[light.name] = base.model_copy(update=said)
        return lights
