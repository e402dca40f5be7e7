"""Settings of rendering."""

from typing import Literal

from pydantic import Field

from groundwork.settings import Settings


class SensorSettings(Settings):
    """The sensor model: affects only photographs, never depth or labels."""

    noise: bool = Field(default=True, description="Apply exposure jitter, blur and noise; off gives the ideal image.")
    exposure_sigma: float = Field(default=0.04, ge=0, le=2, description="Frame-to-frame spread of the exposure [EV].")
    metering: Literal["auto", "surfaces", "light"] = Field(
        default="auto",
        description="surfaces: the middle tone becomes a middle grey; light: what a grey card would show, so that dark "
        "things stay dark; auto: surfaces on a survey of ours, light on any other camera.",
    )
    exposure: float | None = Field(
        default=None, ge=-30, le=30, description="Fixed exposure of the survey [EV]: gain 2^EV; empty: metered."
    )
    auto_exposure: float = Field(
        default=0.5,
        ge=0,
        le=1,
        description="Share of a frame's difference from the survey that its exposure follows: metered on all but sky, "
        "2 EV at most [1].",
    )
    white_balance: float = Field(
        default=0.75,
        ge=0,
        le=1,
        description="Share of the daylight's cast on level ground that the camera takes away; 0: none [1].",
    )
    white_balance_sigma: float = Field(
        default=0.008, ge=0, le=0.2, description="Frame-to-frame spread of the red and blue gains [1]."
    )
    blur_sigma: float = Field(
        default=0.6, ge=0, le=5, description="Point spread of lens and pixel, Gaussian sigma [px]."
    )
    full_well: float = Field(
        default=9000.0, ge=100, le=1e6, description="Electrons at sensor white; sets the shot noise [1]."
    )
    read_noise: float = Field(default=4.0, ge=0, le=200, description="Noise of an unlit pixel [electrons].")
    vignetting: float = Field(
        default=0.12, ge=0, le=0.9, description="Light that the image's corners lose to its middle [1]."
    )
    rolling_shutter: bool = Field(
        default=True, description="Read rows out one after the other where the camera has a readout time."
    )
    shutter_bands: int = Field(default=24, ge=16, le=512, description="Bands of rows with a pose each [1].")
    tremble_speed: float = Field(
        default=0.05, ge=0, le=10, description="Spread of the camera's speed about its flight during a readout [m/s]."
    )
    tremble_rate: float = Field(
        default=1.0, ge=0, le=90, description="Spread of the camera's turning during a readout [deg/s]."
    )
    image_format: Literal["jpg", "png"] = Field(
        default="jpg", description="Photographs as JPEG 4:4:4 with EXIF, or as PNG."
    )
    jpeg_quality: int = Field(default=95, ge=1, le=100, description="JPEG quality [1].")
    focal_error: float = Field(
        default=0.01, ge=0, le=0.2, description="Largest error of the focal length in the prior [1]."
    )


class ShadingSettings(Settings):
    """Rendering of the ideal image: the section `[render]` of a scenario."""

    quality: Literal["fast", "standard", "fine"] = Field(
        default="standard",
        description="fast: simple light; standard: light volume, soft shadows; fine: 2x2 samples a pixel too.",
    )
    device: str = Field(default="auto", description="auto, gpu, software, osmesa, or the number of an EGL device.")
    normals: bool = Field(default=False, description="Write surface normals to truth/normal.")
    shadow_size: int = Field(
        default=4096,
        ge=256,
        le=5120,
        description="Side of each of the three sun shadow maps [px]; the sharp one has 2 cm a texel.",
    )
    volume_probes: int = Field(default=60000, ge=1000, le=1_000_000, description="Most probes in the light volume [1].")
    volume_rays: int = Field(default=64, ge=16, le=1024, description="Rays per probe [1].")
    texture_side: int = Field(
        default=2048, ge=64, le=8192, description="Larger textures are reduced to this side [px]."
    )
    triangle_budget: int = Field(
        default=450_000,
        ge=0,
        description="Triangles in view above which trees, cars and the like of the background are simplified, once per "
        "survey; 0: never [1].",
    )
    subdivision: int = Field(
        default=1,
        ge=0,
        le=4,
        description="Times that subdivision surfaces of a stage are refined; 0 draws their cages [1].",
    )
    haze_distance: float | None = Field(
        default=None,
        gt=0,
        description="Distance at which haze takes 63 % of the contrast [m]; empty: as the stage says (its visibility / "
        "3.912), else 6000.",
    )
    encoders: int = Field(default=2, ge=1, le=64, description="Threads that develop and encode finished frames [1].")
    workers: int = Field(
        default=1, ge=1, le=64, description="Processes that draw one survey; its bytes do not depend on them [1]."
    )


class RenderSettings(ShadingSettings):
    """All settings of the renderer."""

    geodetic_origin: tuple[float, float, float] = Field(
        default=(46.0, 0.0, 0.0), description="Latitude [deg], longitude [deg], height [m] of the local zero, for EXIF."
    )
    sensor: SensorSettings = Field(default_factory=SensorSettings, description="The camera behind the lens.")
