"""What a scenario may say about surveys."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from groundwork.settings import Settings

Sigma = Annotated[float, Field(ge=0.0, le=50.0)]
Reach = Annotated[float, Field(ge=0.5, le=100.0)]


class SurveySettings(Settings):
    """What every kind of survey understands."""

    id: str = Field(default="global", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene")
    camera: Literal["default_24mm"] = Field(default="default_24mm", description="Camera model")
    width: int = Field(default=960, ge=64, le=8192, description="Image width [px]")
    height: int = Field(default=720, ge=64, le=8192, description="Image height [px]")
    speed: float = Field(default=3.0, ge=0.5, le=15.0, description="Flight speed [m/s]")
    safety: float = Field(default=1.5, ge=0.3, le=10.0, description="Least distance to bridge and site [m]")
    gps_sigma: tuple[Sigma, Sigma, Sigma] = Field(
        default=(0.5, 0.5, 0.8), description="Noise of a GPS position along x, y, z [m]"
    )
    gps_drift: float = Field(default=0.3, ge=0.0, le=5.0, description="Standard deviation of the slow GPS bias [m]")


class GlobalSettings(SurveySettings):
    """One loop round the whole bridge, waving between under the deck and over it."""

    kind: Literal["global"] = "global"
    images: int = Field(
        default=52, ge=8, le=2000, description="Number of images; more are taken where the spacing needs them"
    )
    spacing: float = Field(
        default=3.5, ge=0.3, le=50.0, description="Greatest distance between neighbouring images [m]"
    )
    stand_off: tuple[Reach, Reach] = Field(
        default=(6.5, 8.5), description="Range of the distance to the bridge's sides [m]"
    )
    over_deck: tuple[Reach, Reach] = Field(
        default=(2.0, 3.5), description="Range of the greatest height over parapets and all else [m]"
    )
    over_ground: float = Field(default=2.0, ge=1.5, le=20.0, description="Least height over ground or water [m]")
    poi: Literal["axis", "box50"] = Field(
        default="axis", description="Cameras look at the axis beside them, or at the paper's box of half the size"
    )

    @model_validator(mode="after")
    def _ranges_ascend(self) -> Self:
        for name, (low, high) in (("stand_off", self.stand_off), ("over_deck", self.over_deck)):
            if low > high:
                raise ValueError(f"{name} must name its lower end first; allowed: [{high}, {low}]")
        return self


AnySurvey = GlobalSettings  # a union by `kind` as soon as there is a second kind
