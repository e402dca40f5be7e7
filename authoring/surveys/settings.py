"""Settings of surveys in a scenario."""

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from authoring.parts.drawing import chosen
from authoring.surveys.camera_models import DEFAULT, camera_models
from groundwork.settings import Settings

Sigma = Annotated[float, Field(ge=0.0, le=50.0)]
Turn = Annotated[float, Field(ge=0.0, le=45.0)]
Reach = Annotated[float, Field(ge=0.5, le=100.0)]


def _refuse_idle(settings: Settings, idle: tuple[str, ...], option: str, allowed: str) -> None:
    """Refuse values that another one leaves without effect; defaults pass: a scenario written out in full has them all.

    Args:
        settings: The section.
        idle: Names of the values.
        option: The value that makes them so, as in a scenario.
        allowed: What they need instead.
    """
    for name in idle:
        if getattr(settings, name) != type(settings).model_fields[name].default:
            raise ValueError(f"{name} has no effect with {option}; allowed: only with {allowed}")


class RecordSettings(Settings):
    """Records of every flight, planned by Falsework or not."""

    id: str = Field(
        default="global", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name of the survey, unique in the scene"
    )
    width: int | None = Field(
        default=None, ge=64, le=8192, description="Image width [px]; left out: that of the camera model"
    )
    height: int | None = Field(
        default=None, ge=64, le=8192, description="Image height [px]; left out: that of the camera model"
    )
    speed: float = Field(default=3.0, ge=0.2, le=15.0, description="Flight speed [m/s]")
    gps_sigma: tuple[Sigma, Sigma, Sigma] = Field(
        default=(0.5, 0.5, 0.8), description="Standard deviation of a GPS position along x, y, z [m]"
    )
    gps_drift: float = Field(default=0.3, ge=0.0, le=5.0, description="Standard deviation of the slow GPS bias [m]")
    gps_altitude: float = Field(
        default=0.0,
        ge=0.0,
        le=100.0,
        description="Standard deviation of an altitude error that is constant during a flight, as of barometer and "
        "geoid [m]",
    )
    attitude_sigma: tuple[Turn, Turn, Turn] = Field(
        default=(1.0, 0.3, 0.3),
        description="Standard deviation of the recorded yaw, pitch and roll of the gimbal [deg]",
    )


_TURN, _COARSE = 20.0, 10.0  # [deg], [m]


class CameraSettings(RecordSettings):
    """Records and camera of every planned survey."""

    camera: str = Field(default=DEFAULT, description="Camera model")

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
        default=52, ge=8, le=2000, description="Least number of images; more are taken if `spacing` requires it [1]"
    )
    spacing: float = Field(default=3.5, ge=0.3, le=50.0, description="Largest distance between neighboring images [m]")
    turn: float | None = Field(
        default=None,
        ge=5.0,
        le=180.0,
        description="Largest angle between the viewing directions of neighboring images of a loop [deg]; left out: "
        "20, or any if `spacing` is above 10 m",
    )
    stand_off: tuple[Reach, Reach] = Field(
        default=(6.5, 8.5), description="Range of the distance to the bridge's sides [m]"
    )
    over_deck: tuple[Reach, Reach] = Field(
        default=(2.0, 3.5),
        description="Range of the largest height above parapets, cables and all other parts of the bridge [m]",
    )
    over_ground: float = Field(default=2.0, ge=1.5, le=20.0, description="Least height above ground or water [m]")
    tour: Literal["loop", "rings"] = Field(
        default="loop",
        description="loop: one loop that passes under the deck and crosses over it; rings: the paper's tour of "
        "waypoints on the surface of the extended bounding box, two rings and strips over the top",
    )
    margin: float | None = Field(
        default=None,
        ge=2.0,
        le=100.0,
        description="Extension of the bounding box for rings [m]; left out: 0.35 of its width or height, but 8 to 40 m",
    )
    poi: Literal["axis", "box50"] = Field(
        default="axis",
        description="Where cameras look: at the nearest point of the bridge's axis, or at the paper's box of half the "
        "size",
    )

    @property
    def largest_turn(self) -> float:
        """`turn`, or the default if it is left out [deg]."""
        return self.turn or (_TURN if self.spacing <= _COARSE else 180.0)

    @model_validator(mode="after")
    def _ranges_ascend(self) -> Self:
        for name, (low, high) in (("stand_off", self.stand_off), ("over_deck", self.over_deck)):
            if low > high:
                raise ValueError(f"{name} must be the lower end, then the upper end; allowed: [{high}, {low}]")
        return self

    @model_validator(mode="after")
    def _tour_has_its_own(self) -> Self:
        if self.tour == "rings":
            _refuse_idle(self, ("stand_off", "over_deck", "turn"), 'tour = "rings"', 'tour = "loop"')
        else:
            _refuse_idle(self, ("margin",), 'tour = "loop"', 'tour = "rings"')
        return self


class LocalSettings(SurveySettings):
    """A close flight through the free space round a stretch of the bridge, as the paper's local scenario."""

    kind: Literal["local"]
    id: str = Field(
        default="local", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name of the survey, unique in the scene"
    )
    safety: float = Field(default=1.0, ge=0.3, le=5.0, description="Least distance to bridge and site [m]")
    speed: float = Field(default=1.0, ge=0.2, le=15.0, description="Flight speed [m/s]")
    station: float | None = Field(
        default=None,
        description="Position of the box along the bridge, from the bridge's middle [m]; left out: drawn, at a "
        "support as often as `at_support` says",
    )
    target: int | None = Field(
        default=None,
        ge=1,
        description="Instance id of a component that the flight must come near; the box lies around it, or at "
        "`station` if that is set",
    )
    at_support: float = Field(default=0.7, ge=0.0, le=1.0, description="Probability that the box lies at a support [1]")
    length: float = Field(default=20.0, ge=6.0, le=100.0, description="Length of the box along the bridge [m]")
    beside: float = Field(
        default=6.0, ge=2.0, le=40.0, description="Width of the box beside each side of the bridge [m]"
    )
    above: float = Field(default=4.0, ge=1.0, le=40.0, description="Height of the box above the bridge [m]")
    cell: float = Field(
        default=0.5, ge=0.2, le=2.0, description="Edge of the cells that free space is divided into [m]"
    )
    near: float = Field(default=3.0, ge=0.5, le=20.0, description="Preferred distance to the bridge [m]")
    over_ground: float = Field(default=1.0, ge=0.3, le=10.0, description="Least height above ground or water [m]")
    spacing: float = Field(default=0.5, ge=0.1, le=5.0, description="Largest distance between neighboring images [m]")
    images: tuple[int, int] = Field(
        default=(40, 120), description="Least and largest number of images; the paper's mean is 74 [1]"
    )
    pitch: Literal["free", "limited"] | None = chosen(
        {"limited": 0.5, "free": 0.5}, "free: the gimbal may look up; limited: no higher than `pitch_limit`"
    )
    pitch_limit: float = Field(default=24.0, ge=-90.0, le=90.0, description="Highest pitch of the limited gimbal [deg]")

    @model_validator(mode="after")
    def _images_ascend(self) -> Self:
        low, high = self.images
        if not 2 <= low <= high <= 5000:
            raise ValueError(f"images must be two numbers from 2 to 5000, the smaller first (found {low}, {high})")
        return self

    @model_validator(mode="after")
    def _choices_have_an_effect(self) -> Self:
        if self.pitch == "free":
            _refuse_idle(self, ("pitch_limit",), 'pitch = "free"', 'pitch = "limited"')
        for name in ("station", "target"):
            if getattr(self, name) is not None:
                _refuse_idle(self, ("at_support",), name, "a drawn position")
        return self


class GridSettings(SurveySettings):
    """Rows as along a facade: every side of the bridge at one distance, square to it."""

    kind: Literal["grid"]
    id: str = Field(
        default="grid", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name of the survey, unique in the scene"
    )
    sampling: float | None = Field(
        default=None,
        ge=0.0005,
        le=0.1,
        description="Size of a pixel on the surface [m]; left out: its size at a distance of 10 m",
    )
    overlap: float = Field(default=0.75, ge=0.3, le=0.95, description="Overlap of neighboring images in a row [1]")
    side_overlap: float = Field(default=0.6, ge=0.2, le=0.95, description="Overlap of neighboring rows [1]")
    over_ground: float = Field(default=1.5, ge=0.3, le=20.0, description="Least height above ground or water [m]")
    deck: bool = Field(default=True, description="Add rows above the deck that look down")
    oblique: int = Field(
        default=3,
        ge=0,
        le=8,
        description="Number of oblique rows that connect each side with the deck [1]",
    )
    least_bridge: float = Field(
        default=0.1,
        ge=0.0,
        le=1.0,
        description="Least share of an image that the bridge must fill; other images are not taken [1]",
    )

    @model_validator(mode="after")
    def _oblique_rows_lead_to_the_deck(self) -> Self:
        if not self.deck:
            _refuse_idle(self, ("oblique",), "deck = false", "deck = true")
        return self


class InspectionSettings(SurveySettings):
    """Views chosen so that every member and its surface is seen often enough, below the deck and at bearings too."""

    kind: Literal["inspection"]
    id: str = Field(
        default="inspection",
        pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$",
        description="Name of the survey, unique in the scene",
    )
    safety: float = Field(default=1.0, ge=0.3, le=5.0, description="Least distance to bridge and site [m]")
    speed: float = Field(default=1.0, ge=0.2, le=15.0, description="Flight speed [m/s]")
    views: int = Field(
        default=3,
        ge=1,
        le=12,
        description="Number of views that every surface or member needs, from different positions [1]",
    )
    pixels: float = Field(
        default=50.0,
        ge=1.0,
        le=1e6,
        description="Number of pixels that a member must have in an image to count as seen [px]",
    )
    members: tuple[int, ...] = Field(default=(), description="Instance ids of the members to inspect; empty: all")
    cover: Literal["surface", "members"] = Field(
        default="surface",
        description="surface: all of every member's surface, at steep angles; members: enough views of each member",
    )
    stretch: float = Field(
        default=6.0, ge=1.0, le=50.0, description="Edge of the cubes that divide members into pieces [m]"
    )
    worth: int = Field(
        default=6, ge=1, le=1000, description="Number of views of pieces that an image must add to be chosen [1]"
    )
    near: float = Field(default=3.0, ge=0.5, le=20.0, description="Distance of the flight to the bridge [m]")
    reach: float = Field(
        default=10.0, ge=2.0, le=60.0, description="Largest distance at which a surface counts as seen [m]"
    )
    cell: float = Field(
        default=0.5, ge=0.2, le=2.0, description="Edge of the cells that free space is divided into [m]"
    )
    over_ground: float = Field(default=1.0, ge=0.3, le=10.0, description="Least height above ground or water [m]")
    spacing: float = Field(
        default=2.0, ge=0.1, le=10.0, description="Largest distance between neighboring images of a leg [m]"
    )
    images: int = Field(
        default=2000,
        ge=1,
        le=10_000,
        description="Largest number of chosen views; the legs between them add more images [1]",
    )
    pitch_limit: float = Field(default=90.0, ge=-90.0, le=90.0, description="Highest pitch of the gimbal [deg]")

    @model_validator(mode="after")
    def _members_have_no_pieces(self) -> Self:
        if self.cover == "members":
            _refuse_idle(self, ("stretch", "worth"), 'cover = "members"', 'cover = "surface"')
        return self


LegSettings = Annotated[GlobalSettings | LocalSettings | GridSettings | InspectionSettings, Field(discriminator="kind")]


class MixSettings(CameraSettings):
    """Several flights one after the other with one camera: one capture."""

    kind: Literal["mix"]
    id: str = Field(
        default="mix", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name of the survey, unique in the scene"
    )
    legs: tuple[LegSettings, ...] = Field(
        default=(GlobalSettings(), InspectionSettings(kind="inspection")),
        min_length=1,
        max_length=50,
        description="The flights, in order; an inspection adds only views that earlier flights lack",
    )

    @model_validator(mode="after")
    def _record_is_shared(self) -> Self:
        for number, leg in enumerate(self.legs):
            fields = type(leg).model_fields
            twice = [  # a scenario written out in full contains every default
                name
                for name in sorted(leg.model_fields_set & set(CameraSettings.model_fields))
                if getattr(leg, name) != fields[name].default
            ]
            if twice:
                raise ValueError(
                    f"legs[{number}].{twice[0]} applies to the whole flight: move it from the leg to the mix"
                )
        return self


class StageSettings(RecordSettings):
    """An existing camera of the stage, animated in a DCC: used unchanged, with a record added."""

    kind: Literal["stage"]
    id: str = Field(
        default="stage", pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$", description="Name of the survey, unique in the scene"
    )
    prim: str = Field(default="", description="Path or name of the camera; may be left out if there is only one")


AnySurvey = Annotated[
    GlobalSettings | LocalSettings | GridSettings | InspectionSettings | MixSettings | StageSettings,
    Field(discriminator="kind"),
]
