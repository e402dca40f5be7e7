"""Settings of the clouds that are sampled from a stage without images."""

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from groundwork.settings import Settings

Point = tuple[float, float, float]

_ID = r"^[A-Za-z][A-Za-z0-9_-]{0,31}$"


class ScopeSettings(Settings):
    """Which part of a stage ends up in a sampled cloud."""

    scope: Literal["bridge", "near"] = "near"
    """bridge: the bridge alone; near: everything within `reach` of it, like a reconstruction of an inspection
    flight."""
    reach: float = Field(default=10.0, gt=0.0, le=500.0)
    """Distance by which the bridge's bounding box is widened on every side (scope near) [m]."""
    seed: int = Field(default=0, ge=0, lt=2**31)
    """Seed of every random draw."""
    voxel: float = Field(default=0.0, ge=0.0, le=10.0)
    """Edge of the cubes in each of which one point is kept, chosen at random; 0 keeps all [m]."""


class MeshSettings(ScopeSettings):
    """Points spread over the surface, uniformly by area: the paper's baseline."""

    points: int | None = Field(default=None, ge=1, le=20_000_000)
    """Number of points; left out: from `density`."""
    density: float = Field(default=100.0, gt=0.0, le=1e6)
    """Points per square meter, if `points` is left out [1/m²]."""
    min_views: int = Field(default=0, ge=0, le=1000)
    """Number of cameras of the stage's surveys that must see a point; 0 also keeps hidden points, as in the paper."""
    survey: str = ""
    """The survey whose cameras `min_views` counts; empty: all surveys of the stage."""
    normal_noise: float = Field(default=0.0, ge=0.0, le=10.0)
    """Standard deviation of a displacement along the surface's normal [m]."""
    noise: float = Field(default=0.0, ge=0.0, le=10.0)
    """Standard deviation of a displacement along each of x, y and z [m]."""

    @model_validator(mode="after")
    def _survey_counts(self) -> Self:
        if self.survey and not self.min_views:
            allowed = "min_views from 1 on, as of falsework sample mesh --visible"
            raise ValueError(f"survey ({self.survey!r}) has no effect without min_views; allowed: {allowed}")
        return self


class ScannerSettings(ScopeSettings):
    """What all laser scanners share: ranges, noise, and which echoes are lost."""

    min_range: float = Field(default=0.6, ge=0.0, le=50.0)
    """Nearer surfaces give no point [m]."""
    max_range: float = Field(default=120.0, gt=0.0, le=2000.0)
    """Farther surfaces give no point, whatever they reflect [m]."""
    range_at_10_percent: float = Field(default=80.0, gt=0.0, le=5000.0)
    """Largest range at which a surface of 10 % reflectance is detected at normal incidence [m]. The echo is
    proportional to the reflectance and the cosine of the incidence angle, and falls with the square of the distance."""
    max_incidence: float = Field(default=87.0, gt=0.0, le=90.0)
    """Angle between ray and normal beyond which there is no point [deg]."""
    range_noise: float = Field(default=0.002, ge=0.0, le=1.0)
    """Standard deviation of the range [m]."""
    range_noise_ppm: float = Field(default=20.0, ge=0.0, le=10_000.0)
    """Increase of that standard deviation with the range [mm/km]."""
    drop_out: float = Field(default=0.01, ge=0.0, lt=1.0)
    """Share of the echoes that are lost at random [1]."""
    water_echo: float = Field(default=0.02, ge=0.0, le=1.0)
    """Share of the rays on water that return an echo; most are reflected away or absorbed [1]."""
    beam_divergence: float = Field(default=0.0004, ge=0.0, le=0.02)
    """Full angle of the beam's cone; 0 for no mixed pixels [rad]."""
    mixing_gap: float = Field(default=0.5, ge=0.0, le=20.0)
    """If a beam hits two surfaces at an edge, and their ranges differ by less than this, one range between them is
    measured; otherwise that of the beam's middle [m]."""
    returns: int = Field(default=1, ge=1, le=10)
    """Largest number of returns per pulse. Above 1, a pulse partly passes through the leaves of trees and shrubs."""
    leaf_gap: float = Field(default=0.3, ge=0.0, lt=1.0)
    """Share of the leaves that a pulse with several returns passes without loss, because a stage's leaves are larger
    than real ones. The other leaves stop a random share of the pulse [1]."""
    return_gap: float = Field(default=1.0, ge=0.0, le=20.0)
    """Smallest distance between two returns of a pulse [m]."""

    @model_validator(mode="after")
    def _ranges_ascend(self) -> Self:
        if self.min_range >= self.max_range:
            raise ValueError(
                f"min_range ({self.min_range:g} m) leaves no range below max_range ({self.max_range:g} m); allowed: a "
                "smaller min_range"
            )
        return self


def _check_elevations(lowest: float, highest: float) -> None:
    if lowest > highest:
        raise ValueError(
            f"lowest ({lowest:g} deg) is above highest ({highest:g} deg); allowed: the smaller one as lowest"
        )


class TerrestrialSettings(ScannerSettings):
    """A scanner on a tripod, at stations on the ground and on the deck."""

    kind: Literal["terrestrial"] = "terrestrial"
    """Scanner on a tripod."""
    stations: int = Field(default=6, ge=1, le=100)
    """Largest number of stations. Each is placed where it sees most of what the others do not; fewer if that
    suffices."""
    positions: tuple[Point, ...] = ()
    """Positions of the scanner's mirror [m]; empty: chosen automatically."""
    height: float = Field(default=1.8, gt=0.0, le=20.0)
    """Height of the mirror above the ground of an automatic station [m]."""
    angular_step: float = Field(default=0.25, ge=0.005, le=10.0)
    """Angle between neighboring rays [deg]."""
    lowest: float = Field(default=-60.0, ge=-90.0, le=90.0)
    """Lowest elevation of the rays; the tripod is below [deg]."""
    highest: float = Field(default=90.0, ge=-90.0, le=90.0)
    """Highest elevation of the rays [deg]."""

    @model_validator(mode="after")
    def _elevations_ascend(self) -> Self:
        _check_elevations(self.lowest, self.highest)
        return self


class MobileSettings(ScannerSettings):
    """A rotating scanner with many beams, carried along the deck or along the path of a survey."""

    kind: Literal["mobile"] = "mobile"
    """Scanner on a vehicle or a drone."""
    path: str = "deck"
    """`deck`: a drive over the bridge; or the id of a survey whose cameras give the path."""
    height: float = Field(default=2.2, gt=0.0, le=20.0)
    """Height of the scanner above the deck [m]."""
    run_up: float = Field(default=10.0, ge=0.0, le=500.0)
    """Length of the straight run before and behind the deck [m]."""
    speed: float = Field(default=5.0, gt=0.0, le=60.0)
    """Speed along the path [m/s]."""
    rate: float = Field(default=10.0, gt=0.0, le=200.0)
    """Revolutions of the scanner per second [1/s]."""
    beams: int = Field(default=32, ge=1, le=1024)
    """Number of beams, evenly spaced from `lowest` to `highest`."""
    angular_step: float = Field(default=0.2, ge=0.005, le=10.0)
    """Angle between the pulses of one beam [deg]."""
    lowest: float = Field(default=-30.0, ge=-90.0, le=90.0)
    """Elevation of the lowest beam above the plane of rotation [deg]."""
    highest: float = Field(default=30.0, ge=-90.0, le=90.0)
    """Elevation of the highest beam [deg]."""
    tilt: float = Field(default=30.0, ge=-90.0, le=90.0)
    """Angle by which the axis of rotation leans back from the vertical, against the direction of travel [deg]."""
    path_noise: float = Field(default=0.02, ge=0.0, le=5.0)
    """Standard deviation of the error of the measured path, along each axis [m]."""
    path_noise_length: float = Field(default=20.0, gt=0.0, le=10_000.0)
    """Length along the path over which that error changes [m]."""
    range_noise: float = Field(default=0.01, ge=0.0, le=1.0)
    """Standard deviation of the range [m]."""
    beam_divergence: float = Field(default=0.002, ge=0.0, le=0.02)
    """Full angle of the beam's cone; 0 for no mixed pixels [rad]."""

    @model_validator(mode="after")
    def _elevations_ascend(self) -> Self:
        _check_elevations(self.lowest, self.highest)
        return self


class AirborneSettings(ScannerSettings):
    """A scanner in an aircraft that looks down, in parallel strips over the whole place: as countries are surveyed."""

    kind: Literal["airborne"] = "airborne"
    """Scanner in an aircraft."""
    altitude: float = Field(default=400.0, gt=0.0, le=1900.0)
    """Height of the aircraft above the highest point of the bridge [m]."""
    speed: float = Field(default=60.0, gt=0.0, le=300.0)
    """Speed over the ground [m/s]."""
    heading: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Direction of the first strip, from x towards y [deg]; left out: drawn."""
    field_of_view: float = Field(default=40.0, gt=0.0, le=120.0)
    """Full angle of the swath across the direction of flight [deg]."""
    overlap: float = Field(default=0.3, ge=0.0, le=0.9)
    """Share of a swath that the next one covers at the height of the bridge's highest point; more lower down [1]."""
    line_rate: float = Field(default=200.0, gt=0.0, le=2000.0)
    """Scan lines per second [1/s]; their distance is `speed` / `line_rate`."""
    pulses_per_line: int = Field(default=800, ge=2, le=100_000)
    """Number of pulses per line, at equal angles over the swath. Straight below the aircraft their distance is
    `altitude` · `field_of_view` [rad] / `pulses_per_line`."""
    path_noise: float = Field(default=0.03, ge=0.0, le=5.0)
    """Standard deviation of the error of the measured path, along each axis and for each strip [m]."""
    path_noise_length: float = Field(default=200.0, gt=0.0, le=10_000.0)
    """Length along the path over which that error changes [m]."""
    reach: float = Field(default=100.0, gt=0.0, le=500.0)
    """Distance by which the bridge's bounding box is widened on every side (scope near) [m]."""
    min_range: float = Field(default=5.0, ge=0.0, le=50.0)
    """Nearer surfaces give no point [m]."""
    max_range: float = Field(default=2000.0, gt=0.0, le=5000.0)
    """Farther surfaces give no point, whatever they reflect [m]."""
    range_at_10_percent: float = Field(default=1500.0, gt=0.0, le=5000.0)
    """Largest range at which a surface of 10 % reflectance is detected at normal incidence [m]. The echo is
    proportional to the reflectance and the cosine of the incidence angle, and falls with the square of the distance."""
    range_noise: float = Field(default=0.02, ge=0.0, le=1.0)
    """Standard deviation of the range [m]."""
    beam_divergence: float = Field(default=0.0005, ge=0.0, le=0.02)
    """Full angle of the beam's cone; 0 for no mixed pixels [rad]."""
    returns: int = Field(default=4, ge=1, le=10)
    """Largest number of returns per pulse. Above 1, a pulse partly passes through the leaves of trees and shrubs."""

    @model_validator(mode="after")
    def _ground_is_in_range(self) -> Self:
        if self.altitude >= self.max_range:
            raise ValueError(
                f"altitude ({self.altitude:g} m) is not below max_range ({self.max_range:g} m): no pulse would return"
            )
        return self


class MeshSample(MeshSettings):
    """A `[[sample]]` of a scenario: points spread over the surface."""

    kind: Literal["mesh"] = "mesh"
    """Points spread over the surface."""
    id: str = Field(default="mesh", pattern=_ID)
    """Name of the cloud, different from those of the scenario's other samples and surveys."""


class TerrestrialSample(TerrestrialSettings):
    """A `[[sample]]` of a scenario: a scanner on a tripod."""

    id: str = Field(default="terrestrial", pattern=_ID)
    """Name of the cloud, different from those of the scenario's other samples and surveys."""


class MobileSample(MobileSettings):
    """A `[[sample]]` of a scenario: a scanner on a vehicle or a drone."""

    id: str = Field(default="mobile", pattern=_ID)
    """Name of the cloud, different from those of the scenario's other samples and surveys."""


class AirborneSample(AirborneSettings):
    """A `[[sample]]` of a scenario: a scanner in an aircraft."""

    id: str = Field(default="airborne", pattern=_ID)
    """Name of the cloud, different from those of the scenario's other samples and surveys."""


AnyScanner = TerrestrialSettings | MobileSettings | AirborneSettings
SCANNERS: Mapping[str, type[AnyScanner]] = {
    "terrestrial": TerrestrialSettings,
    "mobile": MobileSettings,
    "airborne": AirborneSettings,
}
AnySample = Annotated[MeshSample | TerrestrialSample | MobileSample | AirborneSample, Field(discriminator="kind")]
