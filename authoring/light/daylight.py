"""Daylight: the sun from date and place, and a sky, computed or photographed, baked to an OpenEXR texture.

Light units. Radiance is linear and without a physical unit: color * intensity * 2^exposure. The sky's texel times
the DomeLight's intensity (1) is the radiance of that direction. The DistantLight is normalized (UsdLux), so that its
color times intensity is the irradiance E_sun on a surface that faces it. A Lambert surface reflects
albedo * (E_sun * cos / pi * visibility + E_sky / pi). Sun and sky are scaled together so that level open ground
reflects `LightSettings.brightness` times its albedo: at 1, a level card of 18 % gray renders at 0.18 at exposure 0.

Orientation. World: +x east, +y north, +z up. UsdLux DomeLight follows OpenEXR: in the dome's own frame the pole is +y,
the middle of the image looks along +z, and +x lies a quarter of the width from the left edge. The prim carries
`xformOp:rotateX:orientToStageUpAxis` = 90, which rotates the pole to +z: (x, y, z) of the dome is (x, -z, y) of the
world. So the image's top row is the zenith, its middle is south (-y), a quarter from the left is east (+x), its left
and right edges are north.
"""

import re
import tempfile
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux
from pydantic import Field, field_validator

from authoring.light.atmosphere import scattered_sky
from authoring.light.clouds import clouded
from authoring.light.panorama import read_panorama, reduce_panorama, separate_sun, turned
from authoring.light.sky import sky_directions, solid_angles
from authoring.light.sun import LUMINANCE, direction, sun_illuminance, sun_position
from authoring.looks.noise import Floats, snap
from groundwork.files import write_bytes
from groundwork.settings import Settings
from usd_schemas import tokens
from usd_schemas.apis import apply_environment

F64 = NDArray[np.float64]

_SUN_ANGLE = 0.53  # [deg] seen from the earth
_GROUND = np.array([0.100, 0.100, 0.055])  # mean albedo of meadow, fields, soil and woods, for the light from below
_AIR = 1.16e-5  # extinction by air alone at 550 nm, at sea level [1/m]
_AIR_HEIGHT, _HAZE_HEIGHT = 8400.0, 1250.0  # heights over which air and haze decrease to 1/e [m]
_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
_FREE_SUN = 0.5  # cloud cover up to which the sun is in a gap of the clouds


class LightSettings(Settings):
    """Time, place and weather; or a photographed sky."""

    date: datetime = Field(default=datetime(2024, 6, 21, 14, 0), description="Date and time; UTC if it has no offset")
    latitude: float = Field(default=46.0, ge=-89.0, le=89.0, description="Latitude, north positive [deg]")
    longitude: float = Field(default=0.0, ge=-180.0, le=180.0, description="Longitude, east positive [deg]")
    turbidity: float = Field(
        default=3.0, ge=2.0, le=10.0, description="Turbidity of the air: 2 mountain air, 3 clear, 6 hazy, 10 misty [1]"
    )
    cloud_cover: float = Field(
        default=0.35,
        ge=0.0,
        le=1.0,
        description="Share of the sky that is cloudy; above 0.5 the sun becomes weaker, at 1 it casts no shadow [1]",
    )
    brightness: float = Field(
        default=1.0, gt=0.0, le=10.0, description="Radiance of unshaded level ground over its albedo, by day [1]"
    )
    sky_share: float | None = Field(
        default=None,
        gt=0.0,
        lt=1.0,
        description="Share of the sky in the light on level ground [1]; left out: calculated from the sun's height, "
        "turbidity and clouds",
    )
    sky_height: int = Field(
        default=512, ge=64, le=2048, description="Rows of the sky texture; it is twice as wide [px]"
    )
    visibility: float | None = Field(
        default=None,
        ge=100.0,
        le=300_000.0,
        description="Distance at which haze leaves 2 % of the contrast [m]; left out: by turbidity, 44 km at "
        "2, 23 km at 3, 10 km at 6, 5.5 km at 10",
    )
    sky: str = Field(
        default="",
        description="Path of a photographed sky (.exr or .hdr), relative to the scenario. Its sun becomes the scene's "
        "sun; date, latitude, longitude, turbidity, clouds and sky_share then have no effect",
    )
    sky_turn: float = Field(
        default=0.0,
        ge=-360.0,
        le=360.0,
        description="Rotation of the photographed sky, counter-clockwise seen from above; at 0 the middle of the "
        "picture is towards -y [deg]",
    )

    @field_validator("date", mode="before")
    @classmethod
    def _has_an_hour(cls, value: object) -> datetime:
        """Refuse what pydantic would take for a date: numbers as seconds since 1970, and days as their midnight."""
        return read_date(value.isoformat() if isinstance(value, datetime) else str(value))


def read_date(text: str) -> datetime:
    """Read a date with its hour.

    Args:
        text: Such as `2024-06-21T14:00`; seconds and an offset from UTC may follow.

    Raises:
        ValueError: It is something else, without an hour, or not of the years 1900 to 2100.
    """
    try:
        date = datetime.fromisoformat(text) if _DATE.match(text) else None
    except ValueError:
        date = None
    if date is None:
        raise ValueError("should be a date and hour, such as 2024-06-21T14:00")
    if not 1900 <= date.year <= 2100:
        raise ValueError("the year should be 1900 to 2100")
    return date


@dataclass(frozen=True)
class Lighting:
    """A sun and a sky.

    Attributes:
        sun_direction: Unit vector from the scene towards the sun [1], world axes.
        sun_irradiance: Linear irradiance on a surface that faces the sun [1]; zeros without a sun.
        sky_file: Latitude-longitude texture, relative to the layer.
        visibility: Distance at which haze leaves 2 % of the contrast [m].
    """

    sun_direction: tuple[float, float, float]
    sun_irradiance: tuple[float, float, float]
    sky_file: str
    visibility: float


def bake_light(
    settings: LightSettings, folder: Path, rng: np.random.Generator, picture: Path | None = None
) -> Lighting:
    """Write `textures/sky.exr` (half floats, without the sun, which is the DistantLight), and balance sun and sky.

    Args:
        settings: Time, place and weather.
        folder: Folder of the lighting layer; receives `textures/`.
        rng: Random stream of the light.
        picture: Photographed sky to use instead of a computed one.

    Raises:
        InputError: The image is missing or is not a sky.
    """
    make = _computed(settings, rng) if picture is None else _photographed(settings, picture)
    radiance, sun, irradiance = make
    textures = folder / "textures"
    textures.mkdir(parents=True, exist_ok=True)
    write_bytes(textures / "sky.exr", encode_exr(snap(radiance)))
    return Lighting(
        (float(sun[0]), float(sun[1]), float(sun[2])),
        (float(irradiance[0]), float(irradiance[1]), float(irradiance[2])),
        "./textures/sky.exr",
        settings.visibility if settings.visibility is not None else clear_air_visibility(settings.turbidity),
    )


def clear_air_visibility(turbidity: float) -> float:
    """Compute the visibility at sea level for a turbidity [m], in whole hundreds.

    Turbidity is the optical thickness of air with haze divided by that of air alone; both decrease with height, haze
    faster.
    Source: McCartney, Optics of the Atmosphere, 1976; Koschmieder 1924 for the 2 % of contrast.

    Args:
        turbidity: Haze of the air [1].
    """
    extinction = _AIR * (1.0 + (turbidity - 1.0) * _AIR_HEIGHT / _HAZE_HEIGHT)
    return float(np.round(-np.log(0.02) / extinction, -2))


def _computed(settings: LightSettings, rng: np.random.Generator) -> tuple[F64, F64, F64]:
    """Compute a sky and the sun's direction and irradiance."""
    height, azimuth = sun_position(settings.date, settings.latitude, settings.longitude)
    sun = direction(height, azimuth)
    directions = sky_directions(settings.sky_height)
    radiance = scattered_sky(directions, sun, settings.turbidity)
    radiance = clouded(radiance, directions, sun, settings.cloud_cover, rng)
    above = (np.maximum(directions[..., 2], 0) * solid_angles(settings.sky_height))[..., None]
    light = float(np.sum(radiance * above, axis=(0, 1)) @ LUMINANCE)
    cosine = max(float(sun[2]), 0.0)
    veil = np.clip((1 - settings.cloud_cover) / (1 - _FREE_SUN), 0, 1)
    irradiance = sun_illuminance(height, settings.turbidity) * (veil if cosine > 0 else 0.0)
    direct = float(irradiance @ LUMINANCE) * cosine
    day = np.clip((height + 4) / 8, 0.02, 1)
    level = np.pi * settings.brightness * day
    share = light / (light + direct)
    if settings.sky_share is not None and direct > 0:
        share = settings.sky_share
    radiance = radiance * (share * level / light)
    irradiance = irradiance * ((1 - share) * level / direct if direct > 0 else 0.0)
    falling = np.sum(radiance * above, axis=(0, 1)) + irradiance * cosine
    below = _GROUND * falling / np.pi
    mix = np.clip((-directions[..., 2] - 0.01) / 0.10, 0, 1)[..., None]
    return radiance * (1 - mix) + below * mix, sun, irradiance


def _photographed(settings: LightSettings, picture: Path) -> tuple[F64, F64, F64]:
    """Separate the sun from an image of the sky, and scale both."""
    whole = reduce_panorama(turned(read_panorama(picture), settings.sky_turn), 2 * settings.sky_height)
    parted = separate_sun(whole.astype(np.float64))
    sky = reduce_panorama(parted.sky.astype(np.float32), settings.sky_height).astype(np.float64)
    above = np.maximum(sky_directions(len(sky))[..., 2], 0) * solid_angles(len(sky))
    light = float(np.sum(sky * above[..., None], axis=(0, 1)) @ LUMINANCE)
    light += float(parted.irradiance @ LUMINANCE) * float(parted.direction[2])
    scale = np.pi * settings.brightness / light
    return sky * scale, parted.direction, parted.irradiance * scale


def author_lighting(stage: Usd.Stage, lighting: Lighting, environment: str = tokens.ENVIRONMENT) -> None:
    """Define `Sun` and `Sky`, and write the visibility.

    Args:
        stage: Stage whose edit target receives them; that layer must lie beside the sky's `textures` folder.
        lighting: Sun and sky.
        environment: Path of the Scope that holds them.
    """
    apply_environment(UsdGeom.Scope.Define(stage, environment).GetPrim(), lighting.visibility)
    sun = UsdLux.DistantLight.Define(stage, f"{environment}/Sun")
    irradiance = np.asarray(lighting.sun_irradiance)
    intensity = float(irradiance.max())
    sun.CreateIntensityAttr(round(intensity, 6))
    sun.CreateColorAttr(Gf.Vec3f(*(float(value) for value in np.round(irradiance / max(intensity, 1e-9), 6))))
    sun.CreateAngleAttr(_SUN_ANGLE)
    sun.CreateNormalizeAttr(True)  # intensity is irradiance, independent of the angle
    turn = Gf.Rotation(Gf.Vec3d(0, 0, 1), Gf.Vec3d(*lighting.sun_direction)).GetQuat()
    parts = [round(part, 9) for part in (turn.GetReal(), *turn.GetImaginary())]
    sun.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(*parts))
    sky = UsdLux.DomeLight.Define(stage, f"{environment}/Sky")
    sky.CreateIntensityAttr(1.0)
    sky.CreateTextureFileAttr(Sdf.AssetPath(lighting.sky_file))
    sky.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    sky.AddRotateXOp(opSuffix=UsdLux.Tokens.orientToStageUpAxis).Set(90.0)


def encode_exr(radiance: Floats) -> bytes:
    """Write an image as OpenEXR: half floats, ZIP, nothing in the header but the image's shape.

    Args:
        radiance: Linear colors [1], shape (H, W, 3), float32.
    """
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sky.exr"
        OpenEXR.File(header, {"RGB": np.ascontiguousarray(radiance.astype(np.float16))}).write(str(path))
        return path.read_bytes()
