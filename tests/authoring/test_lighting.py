"""Daylight: the almanac's sun, a dome that stands upright, and light that adds up."""

from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdValidation

from authoring.light.atmosphere import scattered_sky
from authoring.light.daylight import LightSettings, author_lighting, bake_light, clear_air_visibility, encode_exr
from authoring.light.panorama import read_panorama, reduce_panorama, separate_sun, turned
from authoring.light.sky import sky_directions, solid_angles
from authoring.light.sun import air_mass, direction, sun_illuminance, sun_position
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.apis import ENVIRONMENT_API, read_visibility

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
    """Direction within 0.05 degrees of known values."""
    found_height, found_azimuth = sun_position(date, latitude, longitude)
    assert found_height == pytest.approx(height, abs=0.05)
    level = np.cos(np.radians(height))
    assert level * abs((found_azimuth - azimuth + 180) % 360 - 180) < 0.05


def test_hours_without_an_offset_are_universal_time() -> None:
    """The same moment in two spellings."""
    zone = timezone(timedelta(hours=2))
    assert sun_position(datetime(2024, 6, 21, 14), 46, 0) == sun_position(datetime(2024, 6, 21, 16, tzinfo=zone), 46, 0)
    assert sun_position(datetime(2024, 6, 21, 14), 46, 0) == sun_position(datetime(2024, 6, 21, 14, tzinfo=UTC), 46, 0)


def test_dome_is_upright_for_readers_of_openexr(tmp_path: Path) -> None:
    """OpenEXR's direction of a texel, through the prim's transform, is the direction that was baked there."""
    lighting = bake_light(LightSettings(sky_height=64), tmp_path, np.random.default_rng(1))
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
    lighting = bake_light(LightSettings(cloud_cover=0.0), tmp_path, np.random.default_rng(1))
    sky = _radiance(tmp_path) @ _LUMA
    brightest = sky_directions(512).reshape(-1, 3)[sky.argmax()]
    assert np.degrees(np.arccos(brightest @ lighting.sun_direction)) < 1.5


def _on_level_ground(settings: LightSettings, folder: Path) -> tuple[float, float]:
    """Bake a light: irradiance of level ground from sky and sun, luminance."""
    lighting = bake_light(settings, folder, np.random.default_rng(2))
    up = np.maximum(sky_directions(settings.sky_height)[..., 2], 0)
    sky = float(((_radiance(folder) @ _LUMA) * up * _solid_angle(settings.sky_height)).sum())
    return sky, float(np.asarray(lighting.sun_irradiance) @ _LUMA) * max(lighting.sun_direction[2], 0.0)


@pytest.mark.parametrize(
    ("turbidity", "cover"),
    [
        (2.0, 0.0),
        (6.0, 0.35),
        (2.0, 0.9),
        (6.0, 1.0),
        *[
            pytest.param(*pair, marks=pytest.mark.proof_only)
            for pair in ((6.0, 0.0), (2.0, 0.35), (6.0, 0.9), (2.0, 1.0))
        ],
    ],
)
def test_light_adds_up_on_level_ground(tmp_path: Path, cover: float, turbidity: float) -> None:
    """Sun and sky together make 18 % gray 0.18, however many clouds; an overcast sky has no sun."""
    sky, sun = _on_level_ground(LightSettings(cloud_cover=cover, turbidity=turbidity, sky_height=128), tmp_path)
    assert 0.18 * (sky + sun) / np.pi == pytest.approx(0.18, rel=0.005)
    assert (sun == 0.0) == (cover == 1.0)


def test_asked_share_and_brightness_are_kept(tmp_path: Path) -> None:
    """`sky_share` and `brightness` win over the weather."""
    settings = LightSettings(sky_share=0.4, brightness=1.25, sky_height=128)
    sky, sun = _on_level_ground(settings, tmp_path)
    assert (sky + sun) / np.pi == pytest.approx(1.25, rel=0.005)
    assert sky / (sky + sun) == pytest.approx(0.4, rel=0.005)


def test_haze_clouds_and_a_low_sun_soften_the_light(tmp_path: Path) -> None:
    """The sky's share grows with turbidity, with clouds beyond a half, and towards evening."""

    def share(**words: object) -> float:
        sky, sun = _on_level_ground(LightSettings.model_validate({"sky_height": 64, **words}), tmp_path)
        return sky / (sky + sun)

    noon = share(cloud_cover=0.0)
    assert 0.1 < noon < 0.4
    assert noon < share(cloud_cover=0.0, turbidity=6.0) < 0.8
    assert noon < share(cloud_cover=0.0, date=datetime(2024, 6, 21, 18))
    assert noon < share(cloud_cover=0.7) < share(cloud_cover=0.9) < 1.0


def test_clear_daylight_has_the_strength_that_is_measured() -> None:
    """Kasten's table of air masses; a clear noon gives 80 to 115 klx direct, 6 to 35 klx from the sky."""
    assert [air_mass(height) for height in (90.0, 30.0, 5.0)] == pytest.approx([0.9997, 1.994, 10.306], rel=2e-3)
    sun = direction(60.0, 180.0)
    directions, up = sky_directions(64), np.maximum(sky_directions(64)[..., 2], 0)
    for turbidity in (2.0, 3.0):
        direct = float(sun_illuminance(60.0, turbidity) @ _LUMA)
        sky = float(((scattered_sky(directions, sun, turbidity) @ _LUMA) * up * _solid_angle(64)).sum())
        assert 80.0 < direct < 115.0
        assert 6.0 < sky < 35.0
    low = sun_illuminance(3.0, 3.0)
    assert low[0] > 1.5 * low[1] > 3 * low[2] > 0


def test_light_from_below_keeps_the_under_deck_out_of_the_black(tmp_path: Path) -> None:
    """A soffit of concrete without any sky above it shows at least 50 of 255."""
    bake_light(LightSettings(sky_height=64), tmp_path, np.random.default_rng(2))
    down = np.maximum(-sky_directions(64)[..., 2], 0)
    light = 0.35 * ((_radiance(tmp_path) @ _LUMA) * down * _solid_angle(64)).sum() / np.pi
    assert 255 * (1.055 * light ** (1 / 2.4) - 0.055) > 50


def test_night_is_dark_and_finite(tmp_path: Path) -> None:
    """Below the horizon the sun gives nothing that is not a number, and the sky little."""
    lighting = bake_light(
        LightSettings(date=datetime(2024, 6, 21, 23), sky_height=64), tmp_path, np.random.default_rng(2)
    )
    assert lighting.sun_irradiance == (0.0, 0.0, 0.0)
    assert 0 < _radiance(tmp_path).max() < 0.2


def test_sky_file_holds_an_image_and_nothing_else(tmp_path: Path) -> None:
    """No date, no host, no software name in the header."""
    bake_light(LightSettings(sky_height=64), tmp_path, np.random.default_rng(2))
    header = OpenEXR.File(str(tmp_path / "textures/sky.exr")).header()
    assert set(header) == {
        "channels",
        "compression",
        "dataWindow",
        "displayWindow",
        "lineOrder",
        "pixelAspectRatio",
        "screenWindowCenter",
        "screenWindowWidth",
        "type",
    }


def test_lights_validate(tmp_path: Path) -> None:
    """The lighting layer passes UsdValidation and names its texture relative to itself."""
    lighting = bake_light(LightSettings(sky_height=64), tmp_path, np.random.default_rng(2))
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


def _picture(sun: np.ndarray, strength: float, rows: int = 128) -> tuple[np.ndarray, np.ndarray]:
    """A sky of radiance (0.5, 0.6, 0.8) over a dark ground with a round sun of 1 degree, and where it shines."""
    directions = sky_directions(rows)
    picture = np.where(directions[..., 2:] > 0, np.array([0.5, 0.6, 0.8]), 0.1)
    disc = np.degrees(np.arccos(np.clip(directions @ sun, -1, 1))) < 2.0
    picture[disc] = np.array([1.0, 0.9, 0.7]) * strength
    return picture, disc


def _irradiance(radiance: np.ndarray, normal: np.ndarray) -> np.ndarray:
    rows = len(radiance)
    cosine = np.maximum(sky_directions(rows) @ normal, 0) * solid_angles(rows)
    return np.einsum("rc,rck->k", cosine, radiance)


@pytest.mark.parametrize(("height", "azimuth"), [(50.0, 200.0), (12.0, 359.0), (88.0, 30.0)])
def test_cutting_the_sun_out_keeps_every_bit_of_light(height: float, azimuth: float) -> None:
    """Sky and sun give level, tilted and facing surfaces what the whole picture gave; no disc is left."""
    sun = direction(height, azimuth)
    picture, disc = _picture(sun, 5000.0)
    parted = separate_sun(picture)
    assert np.degrees(np.arccos(min(float(parted.direction @ sun), 1.0))) < 0.7
    np.testing.assert_allclose(parted.sky[disc], np.broadcast_to([0.5, 0.6, 0.8], parted.sky[disc].shape))
    tilted = direction(height, azimuth + 40.0)
    for normal, tolerance in ((np.array([0.0, 0.0, 1.0]), 1e-3), (parted.direction, 1e-9), (tilted, 1e-3)):
        both = _irradiance(parted.sky, normal) + parted.irradiance * float(parted.direction @ normal)
        np.testing.assert_allclose(both, _irradiance(picture, normal), rtol=tolerance)


def test_a_veiled_sun_stays_in_the_picture() -> None:
    """Under 5 % of the light on level ground: no light of its own, and not a texel changed."""
    picture, _ = _picture(direction(50.0, 200.0), 8.0)
    parted = separate_sun(picture)
    assert not parted.irradiance.any()
    assert np.array_equal(parted.sky, picture)


def test_photographed_sky_lights_like_a_computed_one(tmp_path: Path) -> None:
    """Gray is 0.18 under it; its sun turns with it; `.exr` and `.hdr` of one picture agree; the bytes repeat."""
    picture, _ = _picture(direction(40.0, 90.0), 3000.0, 256)
    (tmp_path / "sky.exr").write_bytes(encode_exr(picture.astype(np.float32)))
    cv2.imwrite(str(tmp_path / "sky.hdr"), picture[..., ::-1].astype(np.float32))
    settings = LightSettings(sky="sky.exr", sky_turn=90.0, sky_height=128)
    made = [
        bake_light(settings, tmp_path / name, np.random.default_rng(1), tmp_path / f"sky.{name}")
        for name in ("exr", "hdr")
    ]
    sun = np.asarray(made[0].sun_direction)
    assert np.degrees(np.arccos(sun @ direction(40.0, 0.0))) < 0.5  # from east, a quarter of a turn to the left: north
    up = np.array([0.0, 0.0, 1.0])
    for lighting, name in zip(made, ("exr", "hdr"), strict=True):
        level = _irradiance(_radiance(tmp_path / name), up) + np.asarray(lighting.sun_irradiance) * sun[2]
        assert level @ _LUMA / np.pi == pytest.approx(1.0, rel=0.005)
    np.testing.assert_allclose(made[0].sun_irradiance, made[1].sun_irradiance, rtol=0.02)
    bake_light(settings, tmp_path / "again", np.random.default_rng(9), tmp_path / "sky.exr")
    assert (tmp_path / "again/textures/sky.exr").read_bytes() == (tmp_path / "exr/textures/sky.exr").read_bytes()


def test_unusable_skies_are_told_in_one_line(tmp_path: Path) -> None:
    """Missing, cut off, square, of another kind, without light, with NaN: the file is named, nothing else happens."""
    gray = np.full((32, 64, 3), 0.5, np.float32)
    whole = encode_exr(gray)
    cv2.imwrite(str(tmp_path / "whole.hdr"), gray)
    radiance = (tmp_path / "whole.hdr").read_bytes()
    files = {
        "cut.exr": whole[: len(whole) // 2],
        "words.exr": b"no picture",
        "square.exr": encode_exr(gray[:, :32]),
        "black.exr": encode_exr(0 * gray),
        "nan.exr": encode_exr(np.where(gray > 0, np.nan, 0).astype(np.float32)),
        "words.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\nno size",
        "photo.jpg": b"",
        "huge.hdr": radiance.replace(b"-Y 32 +X 64", b"-Y 60000 +X 120000"),
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    for name in (*files, "gone.exr"):
        with pytest.raises(InputError, match=name) as told:
            read_panorama(tmp_path / name)
        assert "\n" not in str(told.value)
        assert str(tmp_path) not in str(told.value)


def test_reduced_and_turned_panoramas_keep_their_light() -> None:
    """Averaging keeps the sum per area; turning rolls whole texels."""
    picture = np.random.default_rng(3).random((64, 128, 3)).astype(np.float32)
    np.testing.assert_allclose(reduce_panorama(picture, 16).mean(axis=(0, 1)), picture.mean(axis=(0, 1)), rtol=1e-5)
    assert np.array_equal(turned(picture, 90.0), np.roll(picture, -32, axis=1))
    assert np.array_equal(turned(turned(picture, 45.0), -45.0), picture)


@pytest.mark.parametrize("said", [None, 900.0])
def test_visibility_stands_on_the_environment(tmp_path: Path, said: float | None) -> None:
    """What the scenario says, or what the turbidity makes of it; a foreign stage says nothing."""
    settings = LightSettings(sky_height=64, turbidity=6.0, visibility=said)
    stage = Usd.Stage.CreateInMemory()
    author_lighting(stage, bake_light(settings, tmp_path, np.random.default_rng(1)))
    prim = stage.GetPrimAtPath(tokens.ENVIRONMENT)
    assert ENVIRONMENT_API in prim.GetAppliedSchemas()
    assert read_visibility(prim) == (said or clear_air_visibility(6.0))
    assert read_visibility(stage.GetPseudoRoot()) is None


def test_turbid_air_is_less_clear() -> None:
    """Pure air is seen through for 337 km (Koschmieder over Rayleigh), air of turbidity 3 for some 23 km."""
    assert clear_air_visibility(1.0) == pytest.approx(337_000.0, rel=0.01)
    assert clear_air_visibility(3.0) == pytest.approx(23_000.0, rel=0.03)
    assert all(clear_air_visibility(t) > clear_air_visibility(t + 1.0) for t in range(1, 10))
