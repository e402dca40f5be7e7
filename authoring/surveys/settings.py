"""What a scenario may say about surveys."""

from typing import Literal

from pydantic import Field

from groundwork.settings import Settings


class SurveySettings(Settings):
    """What every kind of survey understands."""

    id: str = Field("global", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene")
    camera: Literal["default_24mm"] = Field("default_24mm", description="Camera model")
    width: int = Field(960, ge=64, le=8192, description="Image width [px]")
    height: int = Field(720, ge=64, le=8192, description="Image height [px]")
    speed: float = Field(3.0, ge=0.5, le=15.0, description="Flight speed [m/s]")
    safety: float = Field(1.5, ge=0.3, le=10.0, description="Least distance to bridge and site [m]")
    gps_sigma: tuple[float, float, float] = Field((0.5, 0.5, 0.8), description="Noise of a GPS position along x, y, z [m]")
    gps_drift: float = Field(0.3, ge=0.0, le=5.0, description="Standard deviation of the slow GPS bias [m]")


class GlobalSettings(SurveySettings):
    """One loop around the whole bridge, waving between under the deck and over it."""

    kind: Literal["global"] = "global"
    images: int = Field(52, ge=8, le=2000, description="Number of images; more are taken where the spacing needs them")
    spacing: float = Field(3.5, ge=0.3, le=20.0, description="Greatest distance between neighbouring images [m]")
    stand_off: tuple[float, float] = Field((6.5, 8.5), description="Range of the distance to the bridge's sides [m]")
    over_deck: tuple[float, float] = Field((2.0, 3.5), description="Range of the greatest height over parapets and all else [m]")
    over_ground: float = Field(2.0, ge=1.5, le=20.0, description="Least height over ground or water [m]")
    poi: Literal["axis", "box50"] = Field("axis", description="Where cameras look: paper's box of half size, or the axis")


AnySurvey = GlobalSettings
