"""Statistics of photographs against closed forms."""

import numpy as np
import pytest

from benchmarks.render.photo_statistics import MEASURES, spectrum_slope, statistics_of


@pytest.mark.parametrize("exponent", [-1.5, -2.0, -3.0])
def test_the_slope_of_a_spectrum_is_found(exponent: float) -> None:
    """Noise whose power falls with a known exponent."""
    rng = np.random.default_rng(4)
    radius = np.hypot(np.fft.fftfreq(384)[:, None], np.fft.rfftfreq(512)[None])
    radius[0, 0] = 1.0
    noise = np.fft.rfft2(rng.normal(size=(384, 512))) * radius ** (exponent / 2)
    assert spectrum_slope(np.fft.irfft2(noise).astype(np.float32)) == pytest.approx(exponent, abs=0.1)


def test_a_ramp_has_its_gradient_and_its_saturation() -> None:
    """Two codes a pixel to the right in gray; a red of saturation 0.75 has no gradient."""
    ramp = np.repeat((2 * np.arange(100, dtype=np.uint8))[None, :, None], 40, axis=0).repeat(3, axis=2)
    found = dict(zip((measure.name for measure in MEASURES), statistics_of(ramp), strict=True))
    assert found["gradient, median [codes/px]"] == pytest.approx(2.0)
    assert found["saturation, 90 in 100"] == 0.0
    red = np.full((40, 100, 3), (50, 50, 200), np.uint8)
    found = dict(zip((measure.name for measure in MEASURES), statistics_of(red), strict=True))
    assert found["gradient, 99 in 100"] == 0.0
    assert found["saturation, median"] == pytest.approx(0.75)
