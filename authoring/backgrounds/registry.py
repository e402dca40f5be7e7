"""The table of backgrounds: name, settings, and the function that builds it round a site."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from authoring.backgrounds.city import CitySettings, build_city
from authoring.backgrounds.city_ground import change_site
from authoring.backgrounds.countryside import CountrysideSettings, build_countryside
from authoring.backgrounds.hillside import HillsideSettings, build_hillside
from authoring.backgrounds.lakeside import LakesideSettings, build_lakeside
from authoring.backgrounds.site_changes import NO_CHANGES, SiteChanges
from authoring.looks.seasons import SUMMER, Season
from authoring.shapes.component import Component, Scatter
from authoring.site.site import Site
from groundwork.errors import InputError
from groundwork.settings import Settings

Pieces = tuple[Component | Scatter, ...]


class NoneSettings(Settings):
    """The background `none` has nothing to set."""


class BackgroundSettings(Settings):
    """The background that surrounds the site, and the settings of each."""

    name: str = Field(
        default="countryside",
        description="`none`, a procedural world, or the path of an imported world, relative to the scenario",
    )
    season: Season = Field(
        default=SUMMER,
        description="Season of the vegetation, also on the site: colors of leaves, grass and fields. Conifers stay "
        "green, no leaves fall, and the date in `[light]` does not matter",
    )
    none: NoneSettings = Field(default_factory=NoneSettings, description="Settings of `none`")
    city: CitySettings = Field(default_factory=CitySettings, description="Settings of `city`")
    countryside: CountrysideSettings = Field(
        default_factory=CountrysideSettings, description="Settings of `countryside`"
    )
    hillside: HillsideSettings = Field(default_factory=HillsideSettings, description="Settings of `hillside`")
    lakeside: LakesideSettings = Field(default_factory=LakesideSettings, description="Settings of `lakeside`")

    @model_serializer(mode="wrap")
    def _without_summer(self, spell: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Serialize settings of summer as before seasons existed: hashes and keys of results stay the same."""
        values = spell(self)
        return {key: value for key, value in values.items() if (key, value) != ("season", SUMMER)}


def _unchanged(site: Site, rng: np.random.Generator) -> SiteChanges:
    return NO_CHANGES


@dataclass(frozen=True)
class Background:
    """A background.

    Attributes:
        settings: Its settings model.
        build: Builds its pieces from the settings section of all backgrounds, a site and a random stream.
        change: Chooses what it changes on a site, with a random stream.
    """

    settings: type[Settings]
    build: Callable[[BackgroundSettings, Site, np.random.Generator], Pieces]
    change: Callable[[Site, np.random.Generator], SiteChanges] = _unchanged


def _build_none(settings: BackgroundSettings, site: Site, rng: np.random.Generator) -> Pieces:
    return ()


def _build_city(settings: BackgroundSettings, site: Site, rng: np.random.Generator) -> Pieces:
    return build_city(settings.city, site, rng)


def _build_countryside(settings: BackgroundSettings, site: Site, rng: np.random.Generator) -> Pieces:
    return build_countryside(settings.countryside, site, rng)


def _build_hillside(settings: BackgroundSettings, site: Site, rng: np.random.Generator) -> Pieces:
    return build_hillside(settings.hillside, site, rng)


def _build_lakeside(settings: BackgroundSettings, site: Site, rng: np.random.Generator) -> Pieces:
    return build_lakeside(settings.lakeside, site, rng)


BACKGROUNDS = {
    "none": Background(NoneSettings, _build_none),
    "city": Background(CitySettings, _build_city, change_site),
    "countryside": Background(CountrysideSettings, _build_countryside),
    "hillside": Background(HillsideSettings, _build_hillside),
    "lakeside": Background(LakesideSettings, _build_lakeside),
}


def build_background(name: str, settings: BackgroundSettings, site: Site, rng: np.random.Generator) -> Pieces:
    """Build a background that meets a site's edge and leaves its strip empty.

    Args:
        name: A key of `BACKGROUNDS`.
        settings: Settings of all backgrounds.
        site: The site.
        rng: Random stream `background`.

    Returns:
        Components and scatters, ids from `FIRST_BACKGROUND_ID`; none for `none`.

    Raises:
        InputError: There is no such background.
    """
    if name not in BACKGROUNDS:
        raise InputError("unknown background", field="background.name", value=name, allowed=", ".join(BACKGROUNDS))
    return BACKGROUNDS[name].build(settings, site, rng)
