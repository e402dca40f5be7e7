"""Settings of rendering."""

from typing import Literal

from pydantic import Field, field_validator

from groundwork.settings import Settings
from usd_schemas.reading.choices import MOST_REFINEMENTS

_NORTHMOST = 89.0  # [deg] nearer to a pole a few meters to the east are many degrees


class SensorSettings(Settings):
    """The sensor model: affects only photographs, never depth or labels."""

    noise: bool = Field(default=True, description="Apply exposure jitter, blur and noise; false gives the ideal image.")
    exposure_sigma: float = Field(
        default=0.04, ge=0, le=2, description="Standard deviation of the exposure from frame to frame [EV]."
    )
    metering: Literal["auto", "surfaces", "light"] = Field(
        default="auto",
        description="surfaces: the middle tone of the picture becomes a middle gray; light: as for a gray card, so "
        "that dark things stay dark; auto: surfaces for a survey of Falsework, light for any other camera.",
    )
    exposure: float | None = Field(
        default=None, ge=-30, le=30, description="Fixed exposure of the survey, a gain of 2^EV [EV]; left out: metered."
    )
    auto_exposure: float = Field(
        default=0.5,
        ge=0,
        le=1,
        description="Auto exposure: share of the difference between a frame and the whole survey by which the frame's "
        "exposure is corrected. Metered on everything but the sky; at most 2 EV [1].",
    )
    white_balance: float = Field(
        default=0.75,
        ge=0,
        le=1,
        description="Share of the daylight's color cast on level ground that the camera removes [1].",
    )
    auto_white_balance: float = Field(
        default=0.5,
        ge=0,
        le=1,
        description="Auto white balance: share of the cast left on the gray surfaces of each frame by which its red "
        "and blue are corrected, as of concrete in the shade, which only the blue sky lights; at most 15 %; none with "
        "`noise = false` [1].",
    )
    white_balance_sigma: float = Field(
        default=0.008, ge=0, le=0.2, description="Standard deviation of the red and blue gains from frame to frame [1]."
    )
    blur_sigma: float = Field(
        default=0.6, ge=0, le=5, description="Standard deviation of the Gaussian point spread of lens and pixel [px]."
    )
    full_well: float = Field(
        default=9000.0,
        ge=100,
        le=1e6,
        description="Full-well capacity: electrons of a white pixel; determines the shot noise [electrons].",
    )
    read_noise: float = Field(
        default=4.0, ge=0, le=200, description="Standard deviation of the read noise [electrons]."
    )
    vignetting: float = Field(
        default=0.12, ge=0, le=0.9, description="Vignetting: loss of light in the image's corners [1]."
    )
    rolling_shutter: bool = Field(
        default=True, description="Expose rows one after the other, if the camera has a readout time."
    )
    shutter_bands: int = Field(
        default=24, ge=16, le=512, description="Number of bands of rows, each with its own pose [1]."
    )
    tremble_speed: float = Field(
        default=0.05,
        ge=0,
        le=10,
        description="Standard deviation of the camera's speed from its path during a readout [m/s].",
    )
    tremble_rate: float = Field(
        default=1.0, ge=0, le=90, description="Standard deviation of the camera's rotation during a readout [deg/s]."
    )
    image_format: Literal["jpg", "png"] = Field(
        default="jpg", description="Photographs as JPEG (4:4:4, with EXIF) or as PNG."
    )
    jpeg_quality: int = Field(default=95, ge=1, le=100, description="JPEG quality [1].")
    focal_error: float = Field(
        default=0.01, ge=0, le=0.2, description="Largest relative error of the focal length in the prior [1]."
    )


class ShadingSettings(Settings):
    """Rendering of the ideal image: the section `[render]` of a scenario."""

    quality: Literal["fast", "standard", "fine"] = Field(
        default="standard",
        description="fast: simple light; standard: light volume and soft shadows; fine: as standard, with 2x2 samples "
        "per pixel.",
    )
    edge_samples: Literal[0, 5, 10, 17, 26, 37] | None = Field(
        default=None,
        description="Samples of the photograph in each pixel in which surfaces meet; left out: 17 in `fine`, else 0. "
        "5 take three times the processor time of drawing a `standard` photograph, 17 six times [1].",
    )
    device: str = Field(default="auto", description="auto, gpu, software, osmesa, or the number of an EGL device.")
    normals: bool = Field(default=False, description="Write surface normals to truth/normal.")
    shadow_size: int = Field(
        default=4096,
        ge=256,
        le=5120,
        description="Side of each of the three sun shadow maps [px]; the sharpest one has 2 cm per texel.",
    )
    volume_probes: int = Field(
        default=60000, ge=1000, le=1_000_000, description="Largest number of probes in the light volume [1]."
    )
    volume_rays: int = Field(default=64, ge=16, le=1024, description="Number of rays per probe [1].")
    texture_side: int = Field(
        default=2048, ge=64, le=8192, description="Larger textures are reduced to this side [px]."
    )
    triangle_budget: int = Field(
        default=450_000,
        ge=0,
        description="Number of triangles in view above which small objects of the background, such as trees and cars, "
        "are simplified, once per survey; 0: never [1].",
    )
    subdivision: int = Field(
        default=1,
        ge=0,
        le=MOST_REFINEMENTS,
        description="Number of refinements of subdivision surfaces; 0 draws their control meshes [1].",
    )
    haze_distance: float | None = Field(
        default=None,
        gt=0,
        description="Distance at which haze removes 63 % of the contrast [m]; left out: as the stage says (its "
        "visibility / 3.912), else 6000.",
    )
    encoders: int = Field(
        default=2, ge=1, le=64, description="Number of threads that process and encode finished frames [1]."
    )
    workers: int = Field(
        default=1,
        ge=1,
        le=64,
        description="Number of processes that render one survey; the result does not depend on it [1].",
    )

    @property
    def samples_on_edges(self) -> int:
        """Samples of the photograph in each pixel in which surfaces meet [1]."""
        return (17 if self.quality == "fine" else 0) if self.edge_samples is None else self.edge_samples


class RenderSettings(ShadingSettings):
    """All settings of the renderer."""

    geodetic_origin: tuple[float, float, float] = Field(
        default=(46.0, 0.0, 0.0),
        description="Latitude [deg], longitude [deg] and height [m] of the scene's origin, for EXIF.",
    )
    sensor: SensorSettings = Field(default_factory=SensorSettings, description="The sensor of the camera.")

    @field_validator("geodetic_origin")
    @classmethod
    def _is_on_earth(cls, origin: tuple[float, float, float]) -> tuple[float, float, float]:
        latitude, longitude, height = origin
        if abs(latitude) > _NORTHMOST or abs(longitude) > 180.0 or not -12_000.0 <= height <= 100_000.0:
            raise ValueError(
                "should be latitude, longitude and height; allowed: -89 to 89 deg, -180 to 180 deg, -12000 to 100000 m"
            )
        return origin
