"""Settings of the scene in a scenario: one section for each layer."""

from typing import Literal, Self

from pydantic import Field, model_validator

from authoring.backgrounds.registry import BackgroundSettings
from authoring.families.bridge_settings import BridgeSettings
from authoring.layers.variant_settings import VariantSettings
from authoring.light.daylight import LightSettings
from authoring.looks.bake import LookSettings
from authoring.looks.roles import LOOKS
from authoring.site.site import SiteSettings
from authoring.surveys.settings import AnySurvey, GlobalSettings
from groundwork.settings import Settings


class LabelSettings(Settings):
    """How the scene's parts are classed."""

    taxonomy: Literal[
        "falsework", "kim2020", "kim2023", "semanticbridge", "randla_bridgenet", "hgcnn", "ifc43", "asprs"
    ] = Field(default="falsework", description="Table that maps components to the classes of label images and clouds")
    replicator: bool = Field(
        default=False, description="Write the labels also in the older SemanticsAPI, to compat_replicator.usda"
    )


class AuthoringSettings(Settings):
    """Everything that `author_scene` understands; what is left out is drawn from the seed."""

    bridge: BridgeSettings = Field(default_factory=BridgeSettings, description="The bridge and its alignment")
    site: SiteSettings = Field(default_factory=SiteSettings, description="The ground below and beside the bridge")
    background: BackgroundSettings = Field(default_factory=BackgroundSettings, description="The world around the site")
    look: LookSettings = Field(default_factory=LookSettings, description="Materials of the bridge")
    labels: LabelSettings = Field(default_factory=LabelSettings, description="Classes of the parts")
    light: LightSettings = Field(default_factory=LightSettings, description="Sun and sky")
    survey: tuple[AnySurvey, ...] = Field(
        default=(GlobalSettings(),),
        description="Flights; with `[[sample]]` and without `[[survey]]`, nothing is flown or rendered",
    )
    variants: VariantSettings = Field(
        default_factory=VariantSettings, description="Other looks, backgrounds and lights of the same bridge"
    )

    @model_validator(mode="after")
    def _look_is_known(self) -> Self:
        if self.look.name not in LOOKS:
            raise ValueError(f"unknown look {self.look.name!r}; allowed: {', '.join(LOOKS)}")
        return self

    @model_validator(mode="after")
    def _survey_ids_differ(self) -> Self:
        ids = [survey.id for survey in self.survey]
        if len({name.lower() for name in ids}) < len(ids):  # some disks do not tell cases apart
            raise ValueError(f"two surveys have the same id; allowed: a different id each, found {', '.join(ids)}")
        return self

    @model_validator(mode="after")
    def _turned_skies_are_there(self) -> Self:
        lights = self.variants.lights(self.light)
        turned = {f"variants.light {light.name}": light.name for light in self.variants.light if light.sky_turn}
        idle = [place for place, name in turned.items() if not lights[name].sky]
        if self.light.sky_turn and not any(light.sky for light in lights.values()):
            idle.insert(0, "light")
        if idle:
            raise ValueError(f"{idle[0]}: sky_turn has no effect without a photographed sky; allowed: only with sky")
        return self
