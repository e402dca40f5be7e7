"""Daylight: the almanac's sun, a dome that stands upright, and light that adds up."""

from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdValidation

from authoring.lighting import LightSettings, author_lighting, bake_sky, sky_directions, sun_position

_LUMA = np.array([0.2126, 0.7152, 0.0722])


def _radiance(folder: Path) -> np.ndarray:
    pixels = OpenEXR.File(str(folder / "textures/sky.exr")).channels()["RGB"].pixels
    return np.asarray(pixels, np.float64)


def _solid_angle(rows: int) -> np.ndarray:
    latitude = np.pi / 2 - (np.arange(rows) + 0.5) / rows * np.pi
    return np.repeat(np.cos(latitude)[:, None] * (np.pi / rows) ** 2, 2 * rows, axis=1)


@pytest.mark.parametrize(
    ("date", "latitude", "longitude", "height", "azimuth"),
    [
        # Worked example of Reda and Andreas, Solar position algorithm for solar radiation applications (2003).
        (datetime(2003, 10, 17, 19, 30, 30), 39.742476, -105.1786, 39.888, 194.340),
        # June solstice 2024-06-20 20:51 UT: the declination is the obliquity, seen from near the pole as the height.
        (datetime(2024, 6, 20, 20, 51), 89.0, -132.3, 24.43, 180.0),
        # March equinox 2024-03-20 03:06 UT, equation of time -7.4 min: overhead at 135.36 E, rising at 45.36 E.
        (datetime(2024, 3, 20, 3, 6), 0.0, 45.36, 0.0, 90.0),
    ],
)
def test_sun_stands_where_the_almanac_says(
    date: datetime, latitude: float, longitude: float, height: float, azimuth: float
) -> None:
    """Direction within 0.5 degrees of known values."""
    found_height, found_azimuth = sun_position(date, latitude, longitude)
    assert found_height == pytest.approx(height, abs=0.5)
    level = np.cos(np.radians(height))
    assert level * abs((found_azimuth - azimuth + 180) % 360 - 180) < 0.5


def test_hours_without_an_offset_are_universal_time() -> None:
    """The same moment in two spellings."""
    zone = timezone(timedelta(hours=2))
    assert sun_position(datetime(2024, 6, 21, 14), 46, 0) == sun_position(datetime(2024, 6, 21, 16, tzinfo=zone), 46, 0)
    assert sun_position(datetime(2024, 6, 21, 14), 46, 0) == sun_position(datetime(2024, 6, 21, 14, tzinfo=UTC), 46, 0)


def test_dome_stands_upright_for_whoever_follows_openexr(tmp_path: Path) -> None:
    """OpenEXR's direction of a texel, through the prim's transform, is the direction that was baked there."""
    lighting = bake_sky(LightSettings(sky_height=64), tmp_path, np.random.default_rng(1))
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    author_lighting(stage, lighting)
    dome = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Environment/Sky")).ComputeLocalToWorldTransform(0)
    directions = sky_directions(64)
    for row, column in ((0, 5), (20, 0), (31, 32), (40, 64), (63, 100)):
        latitude, longitude = np.pi / 2 - (row + 0.5) / 64 * np.pi, np.pi - (column + 0.5) / 64 * np.pi
        own = Gf.Vec3d(
            np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude)
        )  # latitude +pi/2 is +y, longitude 0 is +z, longitude pi/2 is +x
        assert np.asarray(dome.TransformDir(own)) == pytest.approx(directions[row, column], abs=1e-9)
    assert directions[0, 0, 2] > 0.99
    sun = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Environment/Sun")).ComputeLocalToWorldTransform(0)
    shining = np.asarray(sun.TransformDir(Gf.Vec3d(0, 0, -1)))
    assert shining == pytest.approx(-np.asarray(lighting.sun_direction), abs=1e-7)


def test_sky_is_brightest_round_the_sun(tmp_path: Path) -> None:
    """The glow of a cloudless sky lies where the DistantLight comes from, within two texels."""
    lighting = bake_sky(LightSettings(cloud_cover=0.0), tmp_path, np.random.default_rng(1))
    sky = _radiance(tmp_path) @ _LUMA
    brightest = sky_directions(256).reshape(-1, 3)[sky.argmax()]
    assert np.degrees(np.arccos(brightest @ lighting.sun_direction)) < 1.5


@pytest.mark.parametrize("cover", [0.0, 0.35, 0.9])
def test_light_adds_up_on_level_ground(tmp_path: Path, cover: float) -> None:
    """Sun and sky together give the asked radiance of open ground, shared as asked, however many clouds."""
    settings = LightSettings(cloud_cover=cover)
    lighting = bake_sky(settings, tmp_path, np.random.default_rng(2))
    up = np.maximum(sky_directions(256)[..., 2], 0)
    sky = float(((_radiance(tmp_path) @ _LUMA) * up * _solid_angle(256)).sum())
    sun = float(np.asarray(lighting.sun_irradiance) @ _LUMA) * lighting.sun_direction[2]
    assert (sky + sun) / np.pi == pytest.approx(settings.brightness, rel=0.01)
    assert sky / (sky + sun) == pytest.approx(settings.sky_share, rel=0.01)


def test_light_from_below_keeps_the_under_deck_out_of_the_black(tmp_path: Path) -> None:
    """A soffit of concrete without any sky above it shows at least 60 of 255."""
    bake_sky(LightSettings(), tmp_path, np.random.default_rng(2))
    down = np.maximum(-sky_directions(256)[..., 2], 0)
    light = 0.35 * ((_radiance(tmp_path) @ _LUMA) * down * _solid_angle(256)).sum() / np.pi
    assert 255 * (1.055 * light ** (1 / 2.4) - 0.055) > 60


def test_night_is_dark_and_finite(tmp_path: Path) -> None:
    """Below the horizon the sun gives nothing that is not a number, and the sky little."""
    lighting = bake_sky(LightSettings(date=datetime(2024, 6, 21, 23)), tmp_path, np.random.default_rng(2))
    assert lighting.sun_irradiance == (0.0, 0.0, 0.0)
    assert 0 < _radiance(tmp_path).max() < 0.2


def test_sky_file_holds_an_image_and_nothing_else(tmp_path: Path) -> None:
    """No date, no host, no software name in the header."""
    bake_sky(LightSettings(sky_height=64), tmp_path, np.random.default_rng(2))
    header = OpenEXR.File(str(tmp_path / "textures/sky.exr")).header()
    assert set(header) == {
        "channels", "compression", "dataWindow", "displayWindow", "lineOrder",
        "pixelAspectRatio", "screenWindowCenter", "screenWindowWidth", "type",
    }  # fmt: skip


def test_lights_validate(tmp_path: Path) -> None:
    """The lighting layer passes UsdValidation and names its texture relative to itself."""
    lighting = bake_sky(LightSettings(sky_height=64), tmp_path, np.random.default_rng(2))
    stage = Usd.Stage.CreateNew(str(tmp_path / "lighting.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    author_lighting(stage, lighting)
    stage.Save()
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Environment/Sky"))
    assert sky.GetTextureFileAttr().Get().path == "./textures/sky.exr"
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [error.GetErrorAsString() for error in errors] == []
