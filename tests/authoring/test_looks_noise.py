"""Noise: periodic, band-limited, and what brute force finds."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from scipy import fft

from authoring.looks.grain import grain_texture
from authoring.looks.noise import Tile, cells, draw, fractal, joints, ramp, spots
from authoring.looks.roles import SUITS
from authoring.looks.walls import washed_concrete


def _tile(pixels: int = 128, meters: float = 4.0, seed: int = 1) -> Tile:
    return Tile(pixels, meters, np.random.default_rng(seed))


@pytest.mark.parametrize(("longest", "shortest"), [(2.0, 0.25), (1.0, 0.1), (0.5, 0.125)])
def test_fractal_keeps_to_its_band(longest: float, shortest: float) -> None:
    """Nearly all power lies between the two wavelengths, with mean 0 and standard deviation 1."""
    field = fractal(_tile(256), longest, shortest)
    assert abs(field.mean()) < 1e-4
    assert field.std() == pytest.approx(1, abs=1e-4)
    power = np.abs(np.asarray(fft.fft2(field.astype(np.float64)))) ** 2
    cycles = np.hypot(*np.meshgrid(fft.fftfreq(256, 1 / 256), fft.fftfreq(256, 1 / 256)))
    inside = (cycles >= 0.6 * 4.0 / longest) & (cycles <= 1.4 * 4.0 / shortest)
    assert power[inside].sum() > 0.97 * power.sum()


def test_fractal_is_drawn_out_along_the_stretched_axis() -> None:
    """Neighbors along u are more alike than neighbors along v when u is stretched."""
    field = fractal(_tile(256), 0.5, 0.05, stretch=(8.0, 1.0))
    assert np.abs(np.diff(field, axis=1)).mean() < 0.3 * np.abs(np.diff(field, axis=0)).mean()


def test_grain_has_no_dots() -> None:
    """No peaks on a quiet ground (a fourth moment of 7.6 was leopard spots), and four octaves about as loud."""
    grain = grain_texture().astype(np.float32)
    grain = (grain - grain.mean()) / grain.std()
    assert (grain**4).mean() < 5.5
    blurred = [cv2.GaussianBlur(grain, (0, 0), 0.8 * 2.0**octave) for octave in range(5)]
    octaves = [float((fine - coarse).std()) for fine, coarse in pairwise(blurred)]
    assert max(octaves) < 1.5 * min(octaves)


def test_cells_equal_brute_force() -> None:
    """The two nearest seeds of the periodic plane, found by comparing with all of them."""
    parts = cells(_tile(48, 2.0, 5), 0.25, stretch=1.6)
    rows, columns = 8, 5
    offset_v, offset_u = 0.5 + (draw(np.random.default_rng(5), (2, rows, columns)) - 0.5) * 0.8
    v, u = np.arange(rows)[:, None] + offset_v, np.arange(columns)[None, :] + offset_u
    steps = (np.arange(48) + 0.5) / 48
    down, across = steps[:, None, None, None] * rows - v, steps[None, :, None, None] * columns - u
    down, across = down - rows * np.round(down / rows), across - columns * np.round(across / columns)
    far = np.sqrt(down**2 + across**2).reshape(48, 48, -1)
    order = np.sort(far, axis=-1)
    assert np.allclose(parts.near, order[..., 0], atol=1e-5)
    assert np.array_equal(parts.seed, far.argmin(axis=-1))
    close = order[..., 1] < 1.0  # a second seed further off may stand outside the nine squares
    assert np.allclose(parts.second[close], order[..., 1][close], atol=1e-5)


def test_spots_cover_the_area_that_their_number_gives() -> None:
    """Share of covered texels = places * share * mean disc area, within sampling noise."""
    share = spots(_tile(512), 0.1, 0.03, 0.3).mean()
    radii = 0.03 * (0.4 + 0.6 * np.linspace(0, 1, 1001))
    assert share == pytest.approx(0.3 * np.pi * (radii**2).mean() / 0.1**2, rel=0.12)


def test_joints_divide_the_tile_evenly() -> None:
    """A pitch that does not divide the tile is adjusted to one that does, and lines have their width."""
    line = joints(_tile(1000, 5.0), 1.2, 0.05, "v")[0]
    inked = (line > 0.5).astype(int)
    starts = np.flatnonzero(inked - np.roll(inked, 1) == 1)
    assert len(starts) == 4
    assert np.ptp(np.diff(starts)) <= 1
    assert line.sum() * 5.0 / 1000 == pytest.approx(4 * 0.05, rel=0.1)


def test_ramp_rises_and_falls() -> None:
    """Smoothstep between two values in either order."""
    field = np.array([-1, 0, 0.5, 1, 2], np.float32)
    assert ramp(field, 0, 1).tolist() == [0, 0, 0.5, 1, 1]
    assert ramp(field, 1, 0).tolist() == [1, 1, 0.5, 0, 0]


@pytest.mark.parametrize("age", [0.0, 0.5, 1.0])
def test_washed_concrete_has_no_dots(age: float) -> None:
    """Its pebbles are small and of nearly one tone: the contrast of blocks of 16 mm is below 10 %; it had been 17 %."""
    tone = washed_concrete(Tile(512, 2.0, np.random.default_rng(3)), age).albedo.astype(np.float64).mean(axis=2)
    blocks = tone.reshape(128, 4, 128, 4).mean(axis=(1, 3))
    assert 0.03 < blocks.std() / blocks.mean() < 0.10
    assert "washed_concrete" not in SUITS["Role_PierConcrete"]
