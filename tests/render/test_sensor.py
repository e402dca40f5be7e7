"""The sensor's statistics, the metering, and the EXIF that a photograph carries."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundwork.errors import InputError
from groundwork.settings import parse_settings
from render.images.exif import Shot, geodetic, insert_exif
from render.images.image_files import encode_jpeg
from render.light.illumination import BRIGHTEST
from render.sensor.sensor import Metering, Sensor, balance, gray_balance, meter
from render.settings import RenderSettings, SensorSettings
from tests.conftest import RecordProof

SHAPE = (240, 320)
GRAY = 0.17
STEADY = SensorSettings(exposure_sigma=0, white_balance_sigma=0, auto_exposure=0, auto_white_balance=0, vignetting=0)


def coded(radiance: float) -> np.ndarray:
    """Code a uniform frame."""
    return np.full((*SHAPE, 3), round(np.sqrt(radiance / BRIGHTEST) * 65535), np.uint16)


def linear(pixels: np.ndarray, ideal: Sensor) -> np.ndarray:
    """Invert the tone curve by searching the ideal sensor's answers to a ramp."""
    ramp = np.linspace(0.001, 2.0, 4096)
    codes = np.sqrt(ramp / BRIGHTEST) * 65535
    image = np.repeat(np.rint(codes).astype(np.uint16)[None, :, None], 3, axis=2)
    answers = ideal.develop(image, ideal.expose(0, image))[0, :, 1]
    assert np.all(np.diff(answers.astype(int)) >= 0), "the tone curve must rise"
    return np.interp(pixels.astype(float), answers, ramp)


@pytest.mark.parametrize("level", [0.05, 0.2, 0.6])
def test_noise_has_the_variance_of_photons_and_amplifier(level: float) -> None:
    """Without blur, variance is signal / full well + (read noise / full well)^2, and the mean is unharmed."""
    settings = STEADY.model_copy(update={"blur_sigma": 0.0, "full_well": 600.0})
    sensor, ideal = (Sensor(s, Metering(1.0), BRIGHTEST, SHAPE, 5) for s in (settings, SensorSettings(noise=False)))
    values = linear(sensor.develop(coded(level), sensor.expose(3, coded(level))), ideal)
    assert values.mean() == pytest.approx(level, rel=0.01)
    assert values.var() == pytest.approx(level / 600 + (4 / 600) ** 2, rel=0.06)


def test_frames_have_noise_of_their_own_and_repeat_exactly() -> None:
    """Another frame or seed gives other noise; the same gives the same bytes; channels are independent."""
    frame = coded(GRAY)

    def shot(seed: int, row: int) -> np.ndarray:
        sensor = Sensor(SensorSettings(vignetting=0), Metering(1.0), BRIGHTEST, SHAPE, seed)
        return sensor.develop(frame, sensor.expose(row, frame)).astype(float)

    np.testing.assert_array_equal(shot(5, 1), shot(5, 1))
    for other in (shot(5, 2), shot(6, 1)):
        assert abs(np.corrcoef(shot(5, 1)[..., 1].ravel(), other[..., 1].ravel())[0, 1]) < 0.02
    assert abs(np.corrcoef(shot(5, 1)[..., 0].ravel(), shot(5, 1)[..., 1].ravel())[0, 1]) < 0.02


def test_the_point_spread_is_the_gaussian_asked_for() -> None:
    """The second moment of a blurred line is sigma squared."""
    settings = STEADY.model_copy(update={"full_well": 1e6, "read_noise": 0.0})
    sensor, ideal = (Sensor(s, Metering(1.0), BRIGHTEST, SHAPE, 5) for s in (settings, SensorSettings(noise=False)))
    frame = coded(0.02)
    frame[:, 160] = coded(0.5)[:, 160]
    profile = linear(sensor.develop(frame, sensor.expose(0, frame)), ideal)[..., 1].mean(axis=0)
    rows = profile[157:164] - profile[:150].mean()
    offsets = np.arange(-3, 4)
    assert np.sum(rows * offsets**2) / np.sum(rows) == pytest.approx(0.36, rel=0.1)


def test_developing_in_bands_leaves_no_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blur, vignette and noise across the bands' borders are those of a frame developed at once."""
    settings = SensorSettings(vignetting=0.4, blur_sigma=1.3)
    frame = np.random.default_rng(3).integers(0, 65536, (*SHAPE, 3), np.uint16)
    pictures = []
    for rows in (64, 37, 10_000):
        monkeypatch.setattr("render.sensor.sensor._BAND", rows)
        sensor = Sensor(settings, Metering(1.0), BRIGHTEST, SHAPE, 5)
        pictures.append(sensor.develop(frame, sensor.expose(0, frame)))
    for banded in pictures[:2]:
        np.testing.assert_array_equal(banded, pictures[2])


def test_corners_lose_the_light_that_was_asked_for() -> None:
    """The very corner loses the stated share, half way to it a quarter of that, the middle nothing."""
    settings = STEADY.model_copy(update={"vignetting": 0.4, "blur_sigma": 0.0, "full_well": 1e6, "read_noise": 0.0})
    sensor, ideal = (Sensor(s, Metering(1.0), BRIGHTEST, SHAPE, 5) for s in (settings, SensorSettings(noise=False)))
    values = linear(sensor.develop(coded(0.3), sensor.expose(0, coded(0.3))), ideal)[..., 1] / 0.3
    for row, column, expected in ((0, 0, 0.6), (60, 80, 0.9), (120, 160, 1.0), (239, 319, 0.6)):
        patch = values[max(row - 3, 0) : row + 4, max(column - 3, 0) : column + 4]
        assert patch.mean() == pytest.approx(expected, abs=0.02)


def test_vignetting_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sensor holds its shares of light: frames are developed without computing them again."""
    settings = STEADY.model_copy(update={"vignetting": 0.4})
    sensor, fresh = (Sensor(settings, Metering(1.0), BRIGHTEST, SHAPE, 5) for _ in range(2))
    frame = coded(0.3)
    expected = fresh.develop(frame, fresh.expose(0, frame))
    monkeypatch.setattr("render.sensor.sensor._vignette", None)
    for _ in range(2):
        np.testing.assert_array_equal(sensor.develop(frame, sensor.expose(0, frame)), expected)


def test_without_noise_the_tone_curve_alone_is_left() -> None:
    """A gray stays one value; sensor white and middle gray come where a camera puts them."""
    sensor = Sensor(SensorSettings(noise=False), Metering(1.0), BRIGHTEST, SHAPE, 5)
    for level, low, high in ((0.0, 0, 0), (GRAY, 110, 140), (1.0, 200, 235), (6.0, 245, 255)):
        pixels = sensor.develop(coded(level), sensor.expose(0, coded(level)))
        assert pixels.min() == pixels.max()
        assert low <= pixels[0, 0, 0] <= high


def test_metering_brings_the_middle_tone_to_gray_and_keeps_highlights() -> None:
    """A survey twice as bright is exposed half as long; a few bright walls hold the exposure back."""
    rng = np.random.default_rng(1)
    light = rng.uniform(0.05, 0.15, 5000).astype(np.float32)
    assert meter(light) * np.median(light) == pytest.approx(GRAY, rel=0.01)
    assert meter(2 * light) == pytest.approx(meter(light) / 2)
    light[:400] = 3.0
    assert meter(light) * 3.0 < 2.0
    assert meter(np.zeros(0, np.float32)) == 1.0
    sky = np.full(4000, 8.0, np.float32)
    assert meter(light, None, sky) * 8.0 == pytest.approx(1.3)


def test_white_is_balanced_by_the_share_that_is_told() -> None:
    """Gray comes out gray with a share of 1, untouched with 0, half way in stops with a half."""
    day = np.array([2.0, 1.5, 0.9])
    for share in (0.0, 0.5, 1.0):
        red, blue = balance(day, share)
        assert np.log2([red, blue]) == pytest.approx(share * np.log2([1.5 / 2.0, 1.5 / 0.9]))
    assert balance(np.zeros(3), 1.0) == (1.0, 1.0)
    sensor = Sensor(SensorSettings(noise=False), Metering(0.1, white=balance(day, 1.0)), BRIGHTEST, SHAPE, 5)
    frame = np.tile(np.rint(np.sqrt(day / BRIGHTEST) * 65535).astype(np.uint16), (*SHAPE, 1))
    assert np.ptp(sensor.develop(frame, sensor.expose(0, frame))[0, 0].astype(int)) <= 1


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_auto_white_balance_takes_its_share_of_a_cast_on_gray_surfaces(share: float) -> None:
    """Concrete in blue shade beside grass: the cast of the concrete counts, by its share in stops, grass does not."""
    concrete, grass = np.array([0.093, 0.100, 0.110]), np.array([0.060, 0.090, 0.030])
    light = np.vstack([np.tile(concrete, (100, 1)), np.tile(grass, (900, 1))])
    code = np.rint(np.sqrt(light / BRIGHTEST) * 65535).astype(np.uint16)
    red, blue = gray_balance(code, (1.0, 1.0), share)
    assert [red, blue] == pytest.approx([(0.100 / 0.093) ** share, (0.100 / 0.110) ** share], rel=2e-3)
    assert gray_balance(code[100:], (1.1, 0.9), share) == (1.1, 0.9)
    assert gray_balance(code[90:], (1.1, 0.9), share) == (1.1, 0.9)  # ten gray pixels of 910 tell nothing
    assert gray_balance(np.zeros((9, 3), np.uint16), (1.1, 0.9), share) == (1.1, 0.9)
    frame = np.tile(code[0], (*SHAPE, 1))
    settings = STEADY.model_copy(update={"auto_white_balance": share})
    told = Sensor(settings, Metering(1.0), BRIGHTEST, SHAPE, 5).expose(0, frame)
    assert [told.red, told.blue] == pytest.approx([red, blue])
    strong, red_paint = (np.tile(np.array([level, 1000, 1000], np.uint16), (9, 1)) for level in (925, 1300))
    assert gray_balance(strong, (1.0, 1.0), 1.0) == (1.15, 1.0)
    assert gray_balance(red_paint, (1.0, 1.0), 1.0) == (1.0, 1.0)


@pytest.mark.parametrize("light", [(1.0, 1.0, 1.0), (0.92, 1.0, 1.09)])
def test_colored_stone_and_grass_do_not_pass_for_gray(light: tuple[float, float, float]) -> None:
    """In sun and in light shade, sandstone, brick and grass leave the white alone; concrete alone is heeded."""
    colors = {
        "concrete": (0.345, 0.335, 0.310),
        "sandstone": (0.345, 0.225, 0.155),
        "pale sandstone": (0.310, 0.245, 0.185),
        "brick": (0.205, 0.105, 0.072),
        "grass": (0.060, 0.090, 0.030),
        "dry grass": (0.300, 0.250, 0.150),
    }
    lit = {name: np.tile(0.3 * np.array(color) * light, (200, 1)) for name, color in colors.items()}
    code = {name: np.rint(np.sqrt(one / BRIGHTEST) * 65535).astype(np.uint16) for name, one in lit.items()}
    concrete = gray_balance(code["concrete"], (1.0, 1.0), 0.5)
    assert concrete != (1.0, 1.0)
    without = np.concatenate([one for name, one in code.items() if name != "concrete"])
    assert gray_balance(without, (1.0, 1.0), 0.5) == (1.0, 1.0)
    assert gray_balance(np.concatenate([*code.values()]), (1.0, 1.0), 0.5) == pytest.approx(concrete, rel=1e-3)


@pytest.mark.parametrize(("level", "share"), [(0.1, 1.0), (0.1, 0.5), (0.4, 0.5), (0.2, 1.0), (0.001, 1.0), (0.1, 0.0)])
def test_a_frame_follows_its_own_light_as_far_as_it_is_told(level: float, share: float) -> None:
    """The gain moves by the stated share of the stops between the frame's middle tone and gray, two at most.

    A sky that fills most of the frame is held at 1.9 times white, however dark the ground.
    """
    settings = STEADY.model_copy(update={"auto_exposure": share})
    sensor = Sensor(settings, Metering(1.5), BRIGHTEST, SHAPE, 5)
    asked = share * np.log2(GRAY / (1.5 * level))
    expected = 1.5 * 2.0 ** np.clip(asked, -2.0, 2.0)
    assert sensor.expose(0, coded(level)).gain == pytest.approx(expected, rel=1e-3)
    under_the_sky, surfaces = coded(level), np.zeros(SHAPE, bool)
    under_the_sky[:200], surfaces[200:] = coded(3.0)[:200], True
    held = max(min(expected, 1.9 / 3.0), 1.5 / 4) if share else expected
    assert sensor.expose(0, under_the_sky, surfaces).gain == pytest.approx(held, rel=1e-3)
    assert sensor.expose(0, coded(level), np.zeros(SHAPE, bool)).gain == pytest.approx(expected, rel=1e-3)


def read_tags(tiff: bytes, offset: int) -> dict[int, object]:
    """Read one EXIF directory of a little-endian TIFF structure."""
    tags: dict[int, object] = {}
    for row in range(struct.unpack_from("<H", tiff, offset)[0]):
        tag, kind, count = struct.unpack_from("<HHI", tiff, offset + 2 + 12 * row)
        size = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1}[kind] * count
        place = offset + 10 + 12 * row
        data = (
            tiff[place : place + size]
            if size <= 4
            else tiff[(at := struct.unpack_from("<I", tiff, place)[0]) : at + size]
        )
        if kind == 2:
            tags[tag] = data[:-1].decode()
        elif kind == 5:
            parts = struct.unpack(f"<{2 * count}I", data)
            tags[tag] = [a / b for a, b in zip(parts[::2], parts[1::2], strict=True)]
        elif kind in (3, 4):
            tags[tag] = struct.unpack(f"<{count}{'H' if kind == 3 else 'I'}", data)[0]
        else:
            tags[tag] = data
    return tags


def test_exif_is_read_back() -> None:
    """Make, focal lengths, size and GPS come back from the bytes; the picture is unharmed."""
    jpeg = encode_jpeg(np.zeros((48, 64, 3), np.uint8), 95)
    origin = (46.0, -8.5, 400.0)
    shot = Shot(0.0244, 0.036, 1 / 640, 12.0, (120.0, -250.0, 33.5), origin)
    tagged = insert_exif(jpeg, shot, 64, 48)
    assert tagged[:4] == b"\xff\xd8\xff\xe1"
    assert tagged.endswith(jpeg[20:])
    tiff = tagged[12 : 4 + struct.unpack(">H", tagged[4:6])[0]]
    root = read_tags(tiff, 8)
    assert root[0x010F] == root[0x0110] == "Falsework"
    named = replace(shot, make="Maker", model="Model 7")
    renamed = read_tags(insert_exif(jpeg, named, 64, 48)[12:], 8)
    assert (renamed[0x010F], renamed[0x0110]) == ("Maker", "Model 7")
    assert root[0x0132] == "2024:06:21 12:00:12"
    photo, gps = read_tags(tiff, int(str(root[0x8769]))), read_tags(tiff, int(str(root[0x8825])))
    assert photo[0x920A] == [pytest.approx(24.4)]
    assert (photo[0xA405], photo[0xA002], photo[0xA003]) == (24, 64, 48)
    assert (gps[1], gps[3]) == ("N", "W")
    latitude, longitude, height = geodetic((120.0, -250.0, 33.5), origin)
    for tag, value in ((2, latitude), (4, -longitude)):
        degrees = np.array(gps[tag]) @ [1, 1 / 60, 1 / 3600]
        assert degrees == pytest.approx(value, abs=1e-9)
    assert gps[6] == [pytest.approx(height)]
    assert (latitude - 46.0) * 111_140 == pytest.approx(-250.0, rel=2e-3)
    assert geodetic((300.0, 0.0, 0.0), (0.0, 179.999, 0.0))[1] == pytest.approx(-179.998305, abs=1e-6)  # date line


@pytest.mark.parametrize("origin", [(90.0, 0.0, 0.0), (46.0, 181.0, 0.0), (4_600_000.0, 700_000.0, 30.0)])
def test_an_origin_that_is_not_on_earth_is_refused(origin: tuple[float, float, float]) -> None:
    """A pole, and map coordinates in meters in the place of degrees."""
    with pytest.raises(InputError, match=r"x\.toml: geodetic_origin: should be latitude, .*allowed: -89 to 89 deg"):
        parse_settings(RenderSettings, {"geodetic_origin": origin}, "x.toml")
    assert parse_settings(RenderSettings, {"geodetic_origin": [-89, 180, 0]}, "").geodetic_origin[0] == -89.0


@settings(deadline=None, max_examples=200)
@given(
    st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 4),
    st.one_of(st.none(), st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 3)),
    st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 3),
)
def test_no_number_keeps_a_photograph_from_its_exif(
    told: tuple[float, float, float, float],
    gps: tuple[float, float, float] | None,
    origin: tuple[float, float, float],
) -> None:
    """Whatever a stage makes of lens, sensor, shutter, time and place, the file has tags that can be read."""
    jpeg = encode_jpeg(np.zeros((8, 8, 3), np.uint8), 90)
    tagged = insert_exif(jpeg, Shot(*told, gps, origin), 8, 8)
    tags = read_tags(tagged[12:], 8)
    assert tags[0x010F] == "Falsework"


def test_a_lens_of_meters_is_noted_as_far_as_exif_goes(record_proof: RecordProof) -> None:
    """A focal length of 5 m (50 tenths of a unit of 1 m) stands in the file to a tenth of a micrometer."""
    jpeg = encode_jpeg(np.zeros((8, 8, 3), np.uint8), 90)
    tagged = insert_exif(jpeg, Shot(5.0, 2.0955, 0.001, 0.0, None, (0.0, 0.0, 0.0)), 8, 8)
    tiff = tagged[12:]
    photo = read_tags(tiff, int(str(read_tags(tiff, 8)[0x8769])))
    assert photo[0x920A] == [pytest.approx(5000.0, rel=1e-7)]
    assert photo[0xA405] == round(5.0 / 2.0955 * 36)
    (noted,) = np.array(photo[0x920A])
    record_proof("exif: a lens of 5 m", 1, 0, {"focal_length_mm": float(noted)})
