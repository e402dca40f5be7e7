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


class LocalSettings(SurveySettings):
    """A close flight through the free space round a stretch of the bridge, as the paper's local scenario."""

    kind: Literal["local"]
    id: str = Field(default="local", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene")
    safety: float = Field(default=1.0, ge=0.3, le=5.0, description="Least distance to bridge and site [m]")
    speed: float = Field(default=1.0, ge=0.2, le=15.0, description="Flight speed [m/s]")
    station: float | None = Field(
        default=None, description="Middle of the box along the bridge, from its middle [m]; drawn, often at a support"
    )
    at_support: float = Field(default=0.7, ge=0.0, le=1.0, description="Share of the boxes that lie at a support [1]")
    length: float = Field(default=20.0, ge=6.0, le=100.0, description="Length of the box along the bridge [m]")
    beside: float = Field(default=6.0, ge=2.0, le=40.0, description="Box beside the bridge [m]")
    above: float = Field(default=4.0, ge=1.0, le=40.0, description="Box over the bridge [m]")
    cell: float = Field(default=0.5, ge=0.2, le=2.0, description="Edge of the cells that free space is cut into [m]")
    near: float = Field(
        default=3.0, ge=0.5, le=20.0, description="Distance to the bridge that the flight likes best [m]"
    )
    over_ground: float = Field(default=1.0, ge=0.3, le=10.0, description="Least height over ground or water [m]")
    spacing: float = Field(default=0.5, ge=0.1, le=5.0, description="Greatest distance between neighbouring images [m]")
    images: tuple[int, int] = Field(default=(40, 120), description="Least and most images; the paper's mean is 74")
    pitch: Literal["free", "limited"] | None = Field(
        default=None, description="The gimbal looks up freely, or no higher than `pitch_limit`; drawn 50 : 50"
    )
    pitch_limit: float = Field(default=24.0, ge=-90.0, le=90.0, description="Highest pitch of the limited gimbal [deg]")

    @model_validator(mode="after")
    def _images_ascend(self) -> Self:
        low, high = self.images
        if not 2 <= low <= high <= 5000:
            raise ValueError(f"images must be two numbers from 2 to 5000, the smaller first (found {low}, {high})")
        return self


class GridSettings(SurveySettings):
    """The rows that pilots fly along a facade: every side of the bridge at one distance, square to it."""

    kind: Literal["grid"]
    id: str = Field(default="grid", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene")
    sampling: float = Field(default=0.006, ge=0.0005, le=0.1, description="Size of a pixel on the surface [m]")
    overlap: float = Field(default=0.8, ge=0.3, le=0.95, description="Overlap along a row [1]")
    side_overlap: float = Field(default=0.65, ge=0.2, le=0.95, description="Overlap of neighbouring rows [1]")
    over_ground: float = Field(default=1.5, ge=0.3, le=20.0, description="Least height over ground or water [m]")
    deck: bool = Field(default=True, description="Rows over the deck as well, looking down")


AnySurvey = Annotated[GlobalSettings | LocalSettings | GridSettings, Field(discriminator="kind")]
