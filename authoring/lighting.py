"""Daylight: the sun from date and place, and a clear sky with clouds baked to a latitude-longitude OpenEXR texture.

Light units. Radiance is linear and without a physical unit: colour * intensity * 2^exposure. The sky's texel times
the DomeLight's intensity (1) is the radiance of that direction. The DistantLight's colour times intensity is the
irradiance E_sun on a surface that faces it. A Lambert surface sends out
albedo * (E_sun * cos / pi * visibility + E_sky / pi). Sun and sky are scaled together so that level open ground sends
out `LightSettings.brightness` times its albedo.

Orientation. World: +x east, +y north, +z up. UsdLux DomeLight follows OpenEXR: in the dome's own frame the pole is +y,
the middle of the image looks along +z, and +x lies a quarter of the width from the left edge. The prim carries
`xformOp:rotateX:orientToStageUpAxis` = 90, which turns the pole to +z: (x, y, z) of the dome is (x, -z, y) of the
world. So the image's top row is the zenith, its middle is south (-y), a quarter from the left is east (+x), its left
and right edges are north.
"""

import tempfile
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux
from pydantic import Field

from authoring.looks.noise import Floats, snap
from groundwork.files import write_bytes
from groundwork.settings import Settings
from usd_schemas import tokens

F64 = NDArray[np.float64]

_SUN_ANGLE = 0.53  # [deg] seen from the earth
_GROUND = np.array([0.150, 0.150, 0.110])  # mean albedo of meadow and soil, for the light from below
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class LightSettings(Settings):
    """Time, place and weather."""

    date: datetime = Field(
        default=datetime(2024, 6, 21, 14, 0), description="Date and hour; without an offset it is Universal Time"
    )
    latitude: float = Field(default=46.0, ge=-89.0, le=89.0, description="Latitude, north positive [deg]")
    longitude: float = Field(default=0.0, ge=-180.0, le=180.0, description="Longitude, east positive [deg]")
    cloud_cover: float = Field(default=0.35, ge=0.0, le=1.0, description="Share of the sky behind clouds [1]")
    brightness: float = Field(
        default=1.25, gt=0.0, le=10.0, description="Radiance of level open ground over its albedo [1]"
    )
    sky_share: float = Field(
        default=0.40, gt=0.0, lt=1.0, description="Share of the sky in the light on level ground [1]"
    )
    sky_height: int = Field(
        default=256, ge=64, le=2048, description="Rows of the sky texture; it is twice as wide [px]"
    )


@dataclass(frozen=True)
class Lighting:
    """A sun and a sky.

    Attributes:
        sun_direction: Unit vector from the scene towards the sun [1], world axes.
        sun_irradiance: Linear irradiance on a surface that faces the sun [1].
        sky_file: Latitude-longitude texture, relative to the layer.
    """

    sun_direction: tuple[float, float, float]
    sun_irradiance: tuple[float, float, float]
    sky_file: str


def sun_position(date: datetime, latitude: float, longitude: float) -> tuple[float, float]:
    """Find the sun; good to a few hundredths of a degree, refraction left out.

    Source: Meeus, Astronomical algorithms, 2nd edition, chapters 12, 13 and 25 (low accuracy), which the solar
    calculator of NOAA's Global Monitoring Laboratory follows too.

    Args:
        date: Date and hour; without an offset it is Universal Time.
        latitude: Latitude, north positive [deg].
        longitude: Longitude, east positive [deg].

    Returns:
        Height above the horizon [deg] and azimuth clockwise from north [deg].
    """
    moment = date.replace(tzinfo=UTC) if date.tzinfo is None else date.astimezone(UTC)
    days = (moment - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() / 86_400
    centuries = days / 36_525
    mean_longitude = 280.46646 + 36_000.76983 * centuries
    anomaly = np.radians(357.52911 + 35_999.05029 * centuries)
    centre = (1.914602 - 0.004817 * centuries) * np.sin(anomaly)
    centre += (0.019993 - 0.000101 * centuries) * np.sin(2 * anomaly) + 0.000289 * np.sin(3 * anomaly)
    ecliptic = np.radians(mean_longitude + centre - 0.00569)
    obliquity = np.radians(23.439291 - 0.0130042 * centuries)
    ascension = np.arctan2(np.cos(obliquity) * np.sin(ecliptic), np.cos(ecliptic))
    declination = np.arcsin(np.sin(obliquity) * np.sin(ecliptic))
    hour = np.radians(280.46061837 + 360.98564736629 * days + longitude) - ascension
    north = np.radians(latitude)
    height = np.arcsin(np.sin(north) * np.sin(declination) + np.cos(north) * np.cos(declination) * np.cos(hour))
    across = -np.cos(declination) * np.sin(hour)
    along = np.sin(declination) * np.cos(north) - np.cos(declination) * np.sin(north) * np.cos(hour)
    return float(np.degrees(height)), float(np.degrees(np.arctan2(across, along)) % 360)


def bake_sky(settings: LightSettings, folder: Path, rng: np.random.Generator) -> Lighting:
    """Write `textures/sky.exr` (half floats, no sun disc: the DistantLight carries it), and weigh sun against sky.

    Args:
        settings: Time, place and weather.
        folder: Folder of the lighting layer; receives `textures/`.
        rng: Random stream of the light.
    """
    height, azimuth = sun_position(settings.date, settings.latitude, settings.longitude)
    sun = _direction(height, azimuth)
    directions = sky_directions(settings.sky_height)
    radiance = _sky_radiance(directions, sun, settings.cloud_cover, rng)
    above = np.maximum(directions[..., 2], 0) * _solid_angles(settings.sky_height)
    light = float(np.sum(radiance * above[..., None], axis=(0, 1)) @ _LUMINANCE)
    day = np.clip((height + 4) / 8, 0.02, 1)
    level = np.pi * settings.brightness * day
    cosine = max(float(sun[2]), 0.0)
    share = settings.sky_share if cosine > 0 else 1.0
    radiance = radiance * (share * level / light)
    tint = _sun_tint(height)
    irradiance = tint * ((1 - share) * level / max(cosine, 0.05) / float(tint @ _LUMINANCE))
    falling = np.sum(radiance * above[..., None], axis=(0, 1)) + irradiance * cosine
    below = _GROUND * falling / np.pi
    mix = np.clip((-directions[..., 2] - 0.01) / 0.10, 0, 1)[..., None]
    radiance = radiance * (1 - mix) + below * mix
    textures = folder / "textures"
    textures.mkdir(parents=True, exist_ok=True)
    write_bytes(textures / "sky.exr", encode_exr(snap(radiance)))
    return Lighting(
        (float(sun[0]), float(sun[1]), float(sun[2])),
        (float(irradiance[0]), float(irradiance[1]), float(irradiance[2])),
        "./textures/sky.exr",
    )


def author_lighting(stage: Usd.Stage, lighting: Lighting, environment: str = tokens.ENVIRONMENT) -> None:
    """Define `Sun` and `Sky`.

    Args:
        stage: Stage whose edit target receives them; that layer must lie beside the sky's `textures` folder.
        lighting: Sun and sky.
        environment: Path of the Scope that holds them.
    """
    UsdGeom.Scope.Define(stage, environment)
    sun = UsdLux.DistantLight.Define(stage, f"{environment}/Sun")
    irradiance = np.asarray(lighting.sun_irradiance)
    intensity = float(irradiance.max())
    sun.CreateIntensityAttr(round(intensity, 6))
    sun.CreateColorAttr(Gf.Vec3f(*(float(value) for value in np.round(irradiance / max(intensity, 1e-9), 6))))
    sun.CreateAngleAttr(_SUN_ANGLE)
    turn = Gf.Rotation(Gf.Vec3d(0, 0, 1), Gf.Vec3d(*lighting.sun_direction)).GetQuat()
    parts = [round(part, 9) for part in (turn.GetReal(), *turn.GetImaginary())]
    sun.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(*parts))
    sky = UsdLux.DomeLight.Define(stage, f"{environment}/Sky")
    sky.CreateIntensityAttr(1.0)
    sky.CreateTextureFileAttr(Sdf.AssetPath(lighting.sky_file))
    sky.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    sky.AddRotateXOp(opSuffix=UsdLux.Tokens.orientToStageUpAxis).Set(90.0)


def sky_directions(rows: int) -> F64:
    """List the world direction of every texel of the sky texture.

    Args:
        rows: Rows of the texture; it is twice as wide.

    Returns:
        Unit vectors, world axes [1], shape (rows, 2 * rows, 3), float64.
    """
    latitude = (np.pi / 2 - (np.arange(rows) + 0.5) / rows * np.pi)[:, None]
    longitude = (np.pi - (np.arange(2 * rows) + 0.5) / rows * np.pi)[None, :]
    level = np.cos(latitude)
    x, y, z = np.broadcast_arrays(level * np.sin(longitude), np.sin(latitude), level * np.cos(longitude))
    return np.stack([x, -z, y], axis=-1)


def encode_exr(radiance: Floats) -> bytes:
    """Write an image as OpenEXR: half floats, ZIP, nothing in the header but the image's shape.

    Args:
        radiance: Linear colours [1], shape (H, W, 3), float32.
    """
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sky.exr"
        OpenEXR.File(header, {"RGB": np.ascontiguousarray(radiance.astype(np.float16))}).write(str(path))
        return path.read_bytes()


def _direction(height: float, azimuth: float) -> F64:
    level = np.cos(np.radians(height))
    return np.array(
        [level * np.sin(np.radians(azimuth)), level * np.cos(np.radians(azimuth)), np.sin(np.radians(height))]
    )


def _solid_angles(rows: int) -> F64:
    edges = np.sin(np.pi / 2 - np.arange(rows + 1) / rows * np.pi)
    return ((edges[:-1] - edges[1:]) * (np.pi / rows))[:, None]


def _sun_tint(height: float) -> F64:
    """Colour of the sun after the air on its way: Rayleigh and haze extinction of a clear day."""
    rise = np.sin(np.radians(max(height, 0.5)))
    air = 1 / (rise + 0.15 * (max(height, 0.5) + 3.885) ** -1.253)
    return np.exp(-np.array([0.060, 0.115, 0.265]) * air - 0.05 * air)


def _sky_radiance(directions: F64, sun: F64, cover: float, rng: np.random.Generator) -> F64:
    """Clear sky by the CIE standard, tinted blue away from sun and horizon, with two layers of clouds.

    Source: CIE S 011/E:2003, sky type 12 (clear, low turbidity): gradation a = -1.0, b = -0.32; indicatrix c = 10,
    d = -3.0, e = 0.45.
    """
    up = np.maximum(directions[..., 2], 0.02)
    cosine = np.clip(directions @ sun, -1, 1)
    angle = np.arccos(cosine)
    gradation = 1 - np.exp(-0.32 / up)
    halo = 1 + 10 * (np.exp(-3 * angle) - np.exp(-3 * np.pi / 2)) + 0.45 * cosine**2
    luminance = gradation * halo
    haze = np.exp(-6.0 * up)[..., None]
    glow = np.exp(-5.0 * angle)[..., None]
    blue, pale, warm = np.array([0.30, 0.56, 1.10]), np.array([0.82, 0.95, 1.08]), np.array([1.05, 1.0, 0.92])
    tint = blue * (1 - haze) + pale * haze
    tint = tint * (1 - 0.7 * glow) + warm * (0.7 * glow)
    sky = luminance[..., None] * tint / (tint @ _LUMINANCE)[..., None]
    opacity, lit = _clouds(directions, sun, cover, rng)
    white = 0.9 * np.median(luminance) * (1.2 + 1.5 * lit + 1.2 * np.exp(-2.5 * angle))
    cloud = white[..., None] * (np.array([0.93, 0.97, 1.04]) * (1 - lit[..., None]) + lit[..., None])
    mask = opacity[..., None] * (1 - 0.8 * haze)
    return sky * (1 - mask) + cloud * mask


def _clouds(directions: F64, sun: F64, cover: float, rng: np.random.Generator) -> tuple[F64, F64]:
    """Clouds on a level sheet: their opacity, and how much of the sun reaches each of them (0 grey, 1 white)."""
    plane = directions[..., :2] / (np.abs(directions[..., 2:]) + 0.10)
    lattices = rng.integers(0, 1 << 16, (7, 64, 64)) / 65_536
    drift = rng.integers(0, 1 << 16, 2) / 1024
    field = _heap(lattices, plane + drift)
    towards = _heap(lattices, plane + drift + 0.10 * sun[:2] / max(float(np.hypot(sun[0], sun[1])), 0.1))
    spread = float(field.std())
    edge = float(np.quantile(field[: len(field) // 2], 1 - cover)) if cover > 0 else np.inf
    depth = np.clip((field - edge) / (1.1 * spread), 0, 1)
    lit = np.clip(0.62 + 0.9 * (field - towards) / spread - 0.30 * depth, 0, 1)
    return 0.92 * depth * (2 - depth), lit


def _heap(lattices: F64, place: F64) -> F64:
    field = np.zeros(place.shape[:2])
    for octave, lattice in enumerate(lattices):
        field += (_lattice_noise(lattice, place * 1.1 * 2.03**octave + 7.3 * octave) - 0.5) * 0.57**octave
    return field


def _lattice_noise(lattice: F64, place: F64) -> F64:
    cell = np.floor(place).astype(int)
    part = place - cell
    part = part * part * (3 - 2 * part)
    column, row = cell[..., 0] % 64, cell[..., 1] % 64
    right, down = (column + 1) % 64, (row + 1) % 64
    u, v = part[..., 0], part[..., 1]
    top = lattice[row, column] * (1 - u) + lattice[row, right] * u
    bottom = lattice[down, column] * (1 - u) + lattice[down, right] * u
    return top * (1 - v) + bottom * v
