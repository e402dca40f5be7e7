"""What the numbers of a texture mean, once for photographs, scans and exports."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.house.house import ROOMS, ROOT
from usd_schemas.flat_scene import Texture
from usd_schemas.texels import linear_to_srgb, one_channel, opacity, placed, rotation, srgb_to_linear

PLAIN = Texture("a.png", srgb=True)


def test_srgb_is_the_standard_s_and_goes_both_ways() -> None:
    """Anchors of IEC 61966-2-1; every 8-bit code comes back; the type of numbers is kept."""
    assert srgb_to_linear(np.array([0.0, 0.04045, 0.5, 1.0])) == pytest.approx([0, 0.0031308, 0.2140411, 1], abs=1e-7)
    assert linear_to_srgb(np.array([-0.1, 0.0031308, 0.5, 1.0])) == pytest.approx(
        [-1.292, 0.04045, 0.7353569, 1], abs=1e-6
    )
    for kind in (np.float32, np.float64):
        codes = np.arange(256, dtype=kind) / 255
        assert srgb_to_linear(codes).dtype == linear_to_srgb(codes).dtype == kind
        assert np.array_equal(np.rint(255 * linear_to_srgb(srgb_to_linear(codes))), np.arange(256))


@given(st.floats(-360, 360), st.floats(0.1, 8), st.floats(0.1, 8), st.floats(-2, 2), st.floats(-2, 2))
def test_places_are_scaled_then_turned_then_moved(turn: float, wide: float, high: float, s: float, t: float) -> None:
    """As UsdTransform2d: (s, t) times scale, counter-clockwise by degrees, plus translation."""
    texture = replace(PLAIN, scale=(wide, high), rotation=turn, translation=(s, t))
    corner = np.array([[1.0, 2.0]])
    spun = Rotation.from_euler("z", turn, degrees=True).apply([[wide, 2 * high, 0.0]])[:, :2]
    assert placed(texture, corner) == pytest.approx(spun + np.array([s, t]))
    assert rotation(texture) @ rotation(texture).T == pytest.approx(np.eye(2))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize(
    ("channels", "asked", "taken"),
    [(1, 0, 0), (1, 2, 0), (1, 3, None), (3, 1, 1), (3, 3, None), (4, 2, 2), (4, 3, 3)],
)
def test_opacity_is_a_channel_with_scale_and_bias(channels: int, asked: int, taken: int | None, kind: type) -> None:
    """A gray picture has one value for all colors; where a picture has no opacity, it is opaque."""
    pixels = np.random.default_rng(0).integers(0, np.iinfo(kind).max, (4, 5, channels), endpoint=True).astype(kind)
    share = np.ones((4, 5)) if taken is None else pixels[..., taken] / np.iinfo(kind).max
    assert one_channel(pixels, asked).dtype == kind
    found = opacity(replace(PLAIN, alpha_channel=asked, alpha_gain=-2.0, alpha_bias=1.5), pixels)
    assert found.dtype == np.float32
    assert found == pytest.approx(1.5 - 2.0 * share, abs=1e-6)


def test_a_picture_of_floating_point_numbers_needs_no_division() -> None:
    """1.0 is opaque in it, as 255 is in a byte."""
    assert opacity(replace(PLAIN, alpha_channel=0), np.full((2, 3), 0.25, np.float32)).tolist() == [0.25, 0.25]


def test_the_curve_of_srgb_stands_in_one_place() -> None:
    """Besides, only in the module whose bytes are part of the key of cached textures, and in shaders."""
    stand = {
        path.relative_to(ROOT).as_posix()
        for room in ROOMS
        for path in (ROOT / room).rglob("*.py")
        if any(number in path.read_text(encoding="utf-8") for number in ("0.04045", "0.0031308"))
    }
    assert stand == {"usd_schemas/texels.py", "authoring/looks/encode.py"}
