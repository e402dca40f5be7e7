"""Settings of surveys in a scenario."""

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from authoring.parts.drawing import chosen
from authoring.surveys.camera_models import DEFAULT, camera_models
from groundwork.settings import Settings

Sigma = Annotated[float, Field(ge=0.0, le=50.0)]
Turn = Annotated[float, Field(ge=0.0, le=45.0)]
Reach = Annotated[float, Field(ge=0.5, le=100.0)]


class RecordSettings(Settings):
    """Records of every flight, planned by Falsework or not."""

    id: str = Field(default="global", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene")
    width: int | None = Field(
        default=None, ge=64, le=8192, description="Image width [px]; the camera's own when left out"
    )
    height: int | None = Field(
        default=None, ge=64, le=8192, description="Image height [px]; the camera's own when left out"
    )
    speed: float = Field(default=3.0, ge=0.2, le=15.0, description="Flight speed [m/s]")
    gps_sigma: tuple[Sigma, Sigma, Sigma] = Field(
        default=(0.5, 0.5, 0.8), description="Noise of a GPS position along x, y, z [m]"
    )
    gps_drift: float = Field(default=0.3, ge=0.0, le=5.0, description="Standard deviation of the slow GPS bias [m]")
    gps_altitude: float = Field(
        default=0.0,
        ge=0.0,
        le=100.0,
        description="Standard deviation of the one error that all altitudes of a flight share: barometer, geoid [m]",
    )
    attitude_sigma: tuple[Turn, Turn, Turn] = Field(
        default=(1.0, 0.3, 0.3), description="Noise of the gimbal's yaw, pitch and roll as written down [deg]"
    )


_TURN, _COARSE = 20.0, 10.0  # [deg], [m]


class CameraSettings(RecordSettings):
    """Records and camera of every planned survey."""

    camera: str = Field(default=DEFAULT, description="Camera model, a name of authoring/surveys/cameras.toml")

    @field_validator("camera")
    @classmethod
    def _camera_is_known(cls, name: str) -> str:
        if name not in camera_models():
            raise ValueError(f"no such camera; allowed: {', '.join(camera_models())}")
        return name


class SurveySettings(CameraSettings):
    """Settings of every kind of planned survey."""

    safety: float = Field(default=1.5, ge=0.3, le=10.0, description="Least distance to bridge and site [m]")


class GlobalSettings(SurveySettings):
    """A flight around the whole bridge: a loop of our own, or the paper's tour."""

    kind: Literal["global"] = "global"
    images: int = Field(
        default=52, ge=8, le=2000, description="Number of images; more are taken where the spacing needs them"
    )
    spacing: float = Field(
        default=3.5, ge=0.3, le=50.0, description="Greatest distance between neighbouring images [m]"
    )
    turn: float | None = Field(
        default=None,
        ge=5.0,
        le=180.0,
        description="Greatest angle between the viewing directions of neighbouring images of a loop [deg]; when left "
        "out, 20 if spacing is at most 10 m, else any: such a flight is too coarse to be reconstructed",
    )
    stand_off: tuple[Reach, Reach] = Field(
        default=(6.5, 8.5), description="Range of the distance to the bridge's sides [m]"
    )
    over_deck: tuple[Reach, Reach] = Field(
        default=(2.0, 3.5), description="Range of the greatest height over parapets and all else [m]"
    )
    over_ground: float = Field(default=2.0, ge=1.5, le=20.0, description="Least height over ground or water [m]")
    tour: Literal["loop", "rings"] = Field(
        default="loop",
        description="One loop that dives under the deck and crosses over it, or the paper's tour of waypoints on the "
        "surface of the extended box: two rings and strips over the top",
    )
    margin: float | None = Field(
        default=None,
        ge=2.0,
        le=100.0,
        description="Extension of the box for rings [m]; 0.35 of its width or height, 8 to 40 m, when left out",
    )
    poi: Literal["axis", "box50"] = Field(
        default="axis", description="Cameras look at the axis beside them, or at the paper's box of half the size"
    )

    @property
    def largest_turn(self) -> float:
        """`turn`, or what holds where it is left out [deg]."""
        return self.turn or (_TURN if self.spacing <= _COARSE else 180.0)

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
        default=None,
        description="Middle of the box along the bridge, from its middle [m]; drawn, at a support by `at_support`",
    )
    target: int | None = Field(
        default=None,
        ge=1,
        description="Instance id of a component that the flight must come near; the box lies round it",
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
    pitch: Literal["free", "limited"] | None = chosen(
        {"limited": 0.5, "free": 0.5}, "The gimbal looks up freely, or no higher than `pitch_limit`"
    )
    pitch_limit: float = Field(default=24.0, ge=-90.0, le=90.0, description="Highest pitch of the limited gimbal [deg]")

    @model_validator(mode="after")
    def _images_ascend(self) -> Self:
        low, high = self.images
        if not 2 <= low <= high <= 5000:
            raise ValueError(f"images must be two numbers from 2 to 5000, the smaller first (found {low}, {high})")
        return self


class GridSettings(SurveySettings):
    """Rows as along a facade: every side of the bridge at one distance, square to it."""

    kind: Literal["grid"]
    id: str = Field(default="grid", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene")
    sampling: float | None = Field(
        default=None, ge=0.0005, le=0.1, description="Size of a pixel on the surface [m]; that at 10 m when left out"
    )
    overlap: float = Field(default=0.75, ge=0.3, le=0.95, description="Overlap along a row [1]")
    side_overlap: float = Field(default=0.6, ge=0.2, le=0.95, description="Overlap of neighbouring rows [1]")
    over_ground: float = Field(default=1.5, ge=0.3, le=20.0, description="Least height over ground or water [m]")
    deck: bool = Field(default=True, description="Rows over the deck as well, looking down")
    oblique: int = Field(
        default=3,
        ge=0,
        le=8,
        description="Rows aslant between each side and the deck that tie them together",
    )
    least_bridge: float = Field(
        default=0.1, ge=0.0, le=1.0, description="Share of an image that the bridge must fill for it to be taken [1]"
    )


class InspectionSettings(SurveySettings):
    """Views chosen so that every member and its surface is seen often enough, below the deck and at bearings too."""

    kind: Literal["inspection"]
    id: str = Field(
        default="inspection", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene"
    )
    safety: float = Field(default=1.0, ge=0.3, le=5.0, description="Least distance to bridge and site [m]")
    speed: float = Field(default=1.0, ge=0.2, le=15.0, description="Flight speed [m/s]")
    views: int = Field(default=3, ge=1, le=12, description="Views that everything needs, from as many places")
    pixels: float = Field(
        default=50.0,
        ge=1.0,
        le=1e6,
        description="Pixels of a member in an image that counts as a view of it [px]",
    )
    members: tuple[int, ...] = Field(default=(), description="Instance ids of the members to see; all when empty")
    cover: Literal["surface", "members"] = Field(
        default="surface",
        description="See all of every member's surface squarely, or be content with enough views of each member",
    )
    stretch: float = Field(
        default=6.0, ge=1.0, le=50.0, description="Edge of the cubes that cut members into stretches [m]"
    )
    worth: int = Field(
        default=6, ge=1, le=1000, description="Views of stretches that an image must add to be taken; 1 leaves none out"
    )
    near: float = Field(default=3.0, ge=0.5, le=20.0, description="Distance to the bridge that is flown at [m]")
    reach: float = Field(
        default=10.0, ge=2.0, le=60.0, description="Distance at which a surface still counts as seen [m]"
    )
    cell: float = Field(default=0.5, ge=0.2, le=2.0, description="Edge of the cells that free space is cut into [m]")
    over_ground: float = Field(default=1.0, ge=0.3, le=10.0, description="Least height over ground or water [m]")
    spacing: float = Field(
        default=2.0, ge=0.1, le=10.0, description="Greatest distance between neighbouring images of a leg [m]"
    )
    images: int = Field(default=2000, ge=1, le=10_000, description="Greatest number of chosen views; legs take more")
    pitch_limit: float = Field(default=90.0, ge=-90.0, le=90.0, description="Highest pitch of the gimbal [deg]")


LegSettings = Annotated[GlobalSettings | LocalSettings | GridSettings | InspectionSettings, Field(discriminator="kind")]


class MixSettings(CameraSettings):
    """Several flights one after the other with one camera: one capture."""

    kind: Literal["mix"]
    id: str = Field(default="mix", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene")
    legs: tuple[LegSettings, ...] = Field(
        default=(GlobalSettings(), InspectionSettings(kind="inspection")),
        min_length=1,
        max_length=50,
        description="The flights, in order; an inspection adds only what those before it leave to be seen",
    )

    @model_validator(mode="after")
    def _record_is_shared(self) -> Self:
        for number, leg in enumerate(self.legs):
            fields = type(leg).model_fields
            twice = [  # a scenario that was written out in full names every default
                name
                for name in sorted(leg.model_fields_set & set(CameraSettings.model_fields))
                if getattr(leg, name) != fields[name].default
            ]
            if twice:
                raise ValueError(f"legs[{number}].{twice[0]} belongs to the whole flight: give it to the mix")
        return self


class StageSettings(RecordSettings):
    """An existing camera of the stage, animated in a DCC: used unchanged, with a record added."""

    kind: Literal["stage"]
    id: str = Field(default="stage", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name, unique in the scene")
    prim: str = Field(default="", description="Path or name of the camera; may be left out where there is only one")


AnySurvey = Annotated[
    GlobalSettings | LocalSettings | GridSettings | InspectionSettings | MixSettings | StageSettings,
    Field(discriminator="kind"),
]
