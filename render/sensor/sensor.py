"""Sensor model: from linear radiance to a photograph, with the imperfections of a real sensor, seeded per frame.

Order: exposure and white balance, vignetting, blur, shot and read noise, tone curve. Depth and labels are not affected.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from render.settings import SensorSettings
from usd_schemas.texels import linear_to_srgb

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]
U16 = NDArray[np.uint16]

_BAND = 64  # rows developed at once
_TILE = 128  # the noise tile is larger than a frame by this, so that every frame uses another part of it [px]
_STEPS = 4096  # entries of the tone table
_WHITEST = 6.0  # exposed radiance at the table's end; the curve is flat there
# Exposed values of the middle tone, which becomes code 116, and of the brightest 2 % of a survey.
_EXPOSED_GRAY, _LATITUDE = 0.17, 1.7
_LIT = 0.1  # share of the brightest gray card's luminance from which on a card counts as lit [1]
_METER_STEP = 8  # [px]
_BALANCES = (0.4, 2.5)  # least and most gain of a channel over that of green [1]
# [EV] of red and blue beside green, up to which a surface passes for gray in a tinted light: concrete in the shade of a
# deck is within 0.21, pale sandstone beyond 0.28 but in such a shade.
_GRAY_WITHIN = 0.25
_FEWEST_GRAY = 0.02  # share of the metered pixels, below which nothing is known of the light [1]
_MOST_CORRECTED = 1.15  # largest gain of auto white balance, and 1 over the smallest [1]
_MOST_FOLLOWED = 2.0  # [EV] largest increase of the exposure, as under a deck
_BRIGHT_SHARE = 0.9  # share of a frame's pixels, including sky, that an exposure must not clip
_WHITE_KEPT, _WHITE_BURNT = 1.3, 1.9  # their largest exposed values: in a survey, in a frame with its own exposure


@dataclass(frozen=True)
class Exposure:
    """Sensor values of one frame.

    Attributes:
        gain: Factor from scene radiance to exposed radiance, which is 1 for diffuse white [1].
        red: Gain of the red channel [1].
        blue: Gain of the blue channel [1].
        noise_row: First row of the noise tile [px].
        noise_column: First column of the noise tile [px].
    """

    gain: float
    red: float
    blue: float
    noise_row: int
    noise_column: int


@dataclass(frozen=True)
class Metering:
    """Metered values of a survey.

    Attributes:
        gain: Exposure [1].
        follows: Whether each frame's exposure depends on its surfaces.
        white: Gains of the red and blue channels that balance the survey's daylight [1].
    """

    gain: float
    follows: bool = True
    white: tuple[float, float] = (1.0, 1.0)


class Sensor:
    """Develops the frames of one survey."""

    def __init__(
        self,
        settings: SensorSettings,
        metering: Metering,
        brightest: float,
        shape: tuple[int, int],
        seed: int,
    ) -> None:
        """Draw the noise tile and the tone table.

        Args:
            settings: Properties of the sensor.
            metering: Metered values of the survey.
            brightest: Radiance of the largest pixel code [1].
            shape: Height and width of a frame [px].
            seed: Seed of the survey's sensor.
        """
        self._settings, self._gain, self._seed, self._white = settings, metering.gain, seed, metering.white
        self._auto_exposure = settings.auto_exposure if metering.follows else 0.0
        self._scale = brightest / 65535.0**2
        self._curve = _tone_table()
        self._tile: F32 | None = None
        if settings.noise:
            rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
            self._tile = rng.standard_normal((shape[0] + _TILE, shape[1] + _TILE, 3), np.float32)
        self._shares: F32 | None = None
        if settings.noise and settings.vignetting > 0:
            bands = [slice(first, first + _BAND) for first in range(0, shape[0], _BAND)]  # little memory at a time
            self._shares = np.concatenate([_vignette(shape, settings.vignetting, band) for band in bands])
            self._shares.setflags(write=False)

    def expose(self, frame: int, code: U16, surfaces: NDArray[np.bool_] | None = None) -> Exposure:
        """Meter one frame and draw the sensor's random errors; frames do not depend on each other.

        Args:
            frame: Number of the frame.
            code: Square root of radiance over the brightest one [65535], shape (H, W, 3), uint16.
            surfaces: Pixels that the light is metered on, as a pilot meters the bridge and not the sky, shape (H, W),
                bool; None for the whole frame.
        """
        settings = self._settings
        if not settings.noise:
            return Exposure(self._gain, *self._white, 0, 0)
        colors = code[::_METER_STEP, ::_METER_STEP].reshape(-1, 3)
        chosen = colors[surfaces[::_METER_STEP, ::_METER_STEP].ravel()] if surfaces is not None else colors
        chosen = chosen if len(chosen) else colors
        metered = colors[:, 1]
        green = float(np.median(chosen[:, 1])) ** 2 * self._scale * self._gain
        follow = self._auto_exposure * float(np.log2(_EXPOSED_GRAY / max(green, 1e-3)))
        bright = float(np.quantile(metered, _BRIGHT_SHARE)) ** 2 * self._scale * self._gain
        most = float(np.log2(_WHITE_BURNT / max(bright, 1e-3))) if self._auto_exposure else np.inf
        follow = max(min(follow, _MOST_FOLLOWED, most), -_MOST_FOLLOWED)
        rng = np.random.default_rng(np.random.SeedSequence([self._seed, 1, frame]))
        stops, red, blue = rng.standard_normal(3) * (
            settings.exposure_sigma,
            settings.white_balance_sigma,
            settings.white_balance_sigma,
        )
        row, column = rng.integers(0, _TILE, 2)
        gain = self._gain * float(2.0 ** (stops + follow))
        white = gray_balance(chosen, self._white, settings.auto_white_balance)
        red, blue = white[0] * (1.0 + float(red)), white[1] * (1.0 + float(blue))
        return Exposure(gain, red, blue, int(row), int(column))

    def develop(self, code: U16, exposure: Exposure) -> U8:
        """Turn a rendered frame into a photograph.

        Args:
            code: Square root of radiance over the brightest one [65535], shape (H, W, 3), uint16.
            exposure: Sensor values of this frame.

        Returns:
            sRGB colors [0 to 255], shape (H, W, 3), uint8.
        """
        gains = np.array([exposure.red, 1.0, exposure.blue], np.float32) * np.float32(exposure.gain * self._scale)
        gains = np.tile(gains, code.shape[1])  # takes a third of the time of a broadcast over three numbers
        pixels = np.empty(code.shape, np.uint8)
        for first in range(0, len(code), _BAND):
            band = slice(first, min(first + _BAND, len(code)))
            pixels[band] = self._develop_band(code, band, gains, exposure)
        return pixels

    def _develop_band(self, code: U16, band: slice, gains: F32, exposure: Exposure) -> U8:
        """Develop some rows, few enough for every step to fit the processor's cache; shape (rows, W, 3)."""
        halo = self._reach if self._tile is not None else 0
        top, bottom = min(halo, band.start), min(halo, len(code) - band.stop)
        wide = slice(band.start - top, band.stop + bottom)
        light = code[wide].astype(np.float32)
        light *= light
        rows = light.reshape(len(light), -1)
        rows *= gains
        if self._tile is not None:
            light = self._disturb(light, wide, top, bottom, exposure, self._tile)
        np.clip(light, 0.0, _WHITEST, out=light)
        steps = cv2.sqrt(light)
        steps *= np.float32((_STEPS - 1) / np.sqrt(_WHITEST))
        return np.take(self._curve, np.rint(steps, out=steps).astype(np.uint16), mode="clip")

    @property
    def _reach(self) -> int:
        """Number of rows beyond a pixel that contribute to its blur [px]."""
        return int(np.ceil(3 * self._settings.blur_sigma))

    def _disturb(self, light: F32, wide: slice, top: int, bottom: int, exposure: Exposure, tile: F32) -> F32:
        """Vignette and blur rows, the first `top` and last `bottom` of which only contribute light; then add noise."""
        settings = self._settings
        if self._shares is not None:
            light *= cv2.merge([self._shares[wide]] * 3)
        if settings.blur_sigma > 0:
            side = 2 * self._reach + 1
            light = cv2.GaussianBlur(light, (side, side), settings.blur_sigma, borderType=cv2.BORDER_REFLECT).astype(
                np.float32, copy=False
            )
        light = light[top : len(light) - bottom]
        height, width = light.shape[:2]
        spread = light * np.float32(1.0 / settings.full_well)
        spread += np.float32((settings.read_noise / settings.full_well) ** 2)
        spread = cv2.sqrt(spread)
        first, left = exposure.noise_row + wide.start + top, exposure.noise_column
        spread *= tile[first : first + height, left : left + width]
        light += spread
        return light


def meter(luminance: F32, card: F32 | None = None, sky: F32 | None = None) -> float:
    """Choose one exposure for a survey: its middle tone becomes middle gray, unless highlights would be clipped.

    Args:
        luminance: Linear luminance of surfaces in some frames [1], shape (N,), float32.
        card: That of gray cards in their place [1], shape (N,), float32; the median of the lit ones is then used.
        sky: Linear luminance of the sky in the same frames [1], shape (M,), float32.

    Returns:
        Gain [1].
    """
    if not len(luminance):
        return 1.0
    median, bright = (max(float(value), 1e-4) for value in np.quantile(luminance, [0.5, 0.98]))
    if card is not None:
        lit = card[card > _LIT * np.quantile(card, 0.98)]
        median = max(float(np.median(lit)), 1e-4) if len(lit) else median
    gain = min(_EXPOSED_GRAY / median, _LATITUDE / bright)
    if sky is None or not len(sky):
        return gain
    whole = float(np.quantile(np.concatenate([luminance, sky]), _BRIGHT_SHARE))
    return min(gain, _WHITE_KEPT / max(whole, 1e-4))


def balance(light: NDArray[np.float64], share: float) -> tuple[float, float]:
    """Compute the white balance of a survey from the daylight; warm light remains slightly warm.

    Args:
        light: Irradiance of level open ground by sun and sky [1], shape (3,), float64.
        share: Share of its color cast that is removed [1].

    Returns:
        Gains of the red and the blue channel [1].
    """
    if not (light > 0).all():
        return 1.0, 1.0
    red, blue = np.clip((light[1] / light[[0, 2]]) ** share, *_BALANCES)
    return float(red), float(blue)


def gray_balance(code: U16, white: tuple[float, float], share: float) -> tuple[float, float]:
    """Correct the white balance of a frame by its gray surfaces, as auto white balance does; grass is none of them.

    Args:
        code: Pixels of surfaces: square root of radiance over the brightest one [65535], shape (N, 3), uint16.
        white: Gains of the red and the blue channel for the survey's daylight [1].
        share: Share of the cast left on gray surfaces that is removed [1].

    Returns:
        Gains of the red and the blue channel [1].
    """
    light = code[(code > 0).all(axis=1)].astype(np.float64) ** 2 * (white[0], 1.0, white[1])
    gray = light[(np.abs(np.log2(light[:, [0, 2]] / light[:, 1:2])) < _GRAY_WITHIN).all(axis=1)]
    if not share or len(gray) < max(_FEWEST_GRAY * len(code), 1):
        return white
    red, green, blue = gray.sum(axis=0)
    gains = np.clip((green / np.array([red, blue])) ** share, 1 / _MOST_CORRECTED, _MOST_CORRECTED)
    return white[0] * float(gains[0]), white[1] * float(gains[1])


def _vignette(shape: tuple[int, int], loss: float, rows: slice) -> F32:
    """Compute the share of light at each pixel; it falls with the squared distance from the middle, (rows, W)."""
    height, width = shape
    down = (np.arange(height)[rows, None] + 0.5) / height * 2 - 1
    across = (np.arange(width) + 0.5) / width * 2 - 1
    square = (down * height) ** 2 + (across * width) ** 2
    return (1.0 - loss * (square / (height**2 + width**2))).astype(np.float32)


def _tone_table() -> U8:
    """Tabulate sRGB by the square root of exposed radiance: a filmic shoulder, and shadows as bright as a camera's.

    Source: the rational form of Narkowicz, ACES filmic tone mapping curve, 2016, with a flatter toe; sRGB of
    IEC 61966-2-1.
    """
    light = (np.arange(_STEPS) / (_STEPS - 1)) ** 2 * _WHITEST * 0.65
    curve = np.clip(light * (2.51 * light + 0.10) / (light * (2.43 * light + 0.65) + 0.14), 0, 1)
    return np.rint(linear_to_srgb(curve) * 255).astype(np.uint8)
