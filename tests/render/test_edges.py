"""Edges of the photograph: slanted ones become as smooth as their coverage, corners stay, one color stays."""

import numpy as np
import pytest
from numpy.typing import NDArray

from render.views.edges import smooth_edges
from tests.conftest import Count, RecordProof

F64 = NDArray[np.float64]
U16 = NDArray[np.uint16]
U32 = NDArray[np.uint32]

_SIDE = 64
_BRIGHT, _DARK = 0.5, 0.05


def _coded(light: F64) -> U16:
    return np.repeat(np.rint(np.sqrt(light) * 65535).astype(np.uint16)[..., None], 3, axis=2)


def _half_plane(angle: float, shift: float, count: int) -> F64:
    """Share of each pixel on one side of a line, from count x count samples, shape (64, 64)."""
    places = (np.arange(_SIDE * count) + 0.5) / count - _SIDE / 2
    side = np.cos(angle) * places[None, :] + np.sin(angle) * places[:, None] > shift
    return side.reshape(_SIDE, count, _SIDE, count).mean(axis=(1, 3))


def _smoothed(inside: NDArray[np.bool_]) -> tuple[F64, U32]:
    draw = inside.astype(np.uint32) + 1
    code = _coded(np.where(inside, _BRIGHT, _DARK))
    smooth_edges(code, draw, np.full(draw.shape, 30.0, np.float32))
    return (code[..., 0] / 65535.0) ** 2, draw


def test_a_straight_edge_shows_its_coverage(proof_count: Count, record_proof: RecordProof) -> None:
    """Lines at any angle: the error against 16 x 16 samples is under 0.4 of what one sample leaves."""
    rng = np.random.default_rng(3)
    before, after = [], []
    for _ in range(proof_count(30, 1000)):
        angle, shift = rng.uniform(0, 2 * np.pi), rng.uniform(-10, 10)
        truth = _DARK + (_BRIGHT - _DARK) * _half_plane(angle, shift, 16)
        inside = _half_plane(angle, shift, 1) > 0.5
        shown, _ = _smoothed(inside)
        before.append(((np.where(inside, _BRIGHT, _DARK) - truth)[8:-8, 8:-8] ** 2).mean())
        after.append(((shown - truth)[8:-8, 8:-8] ** 2).mean())
    ratio = float(np.sqrt(np.mean(after) / np.mean(before)))
    assert ratio < 0.4
    record_proof("render/straight edges", len(after), 30, {"error_left": round(ratio, 3)})


def _banded(
    angle: float, lines: tuple[float, ...], lights: tuple[float, ...], draws: tuple[int, ...]
) -> tuple[F64, ...]:
    """Bands between lines: light smoothed, of single samples and of 16 x 16 of them, each of shape (48, 48)."""
    sides = [_half_plane(angle, line, 16) for line in lines]
    hits = np.sum([_half_plane(angle, line, 1) > 0.5 for line in lines], axis=0)
    truth = lights[0] + sum((lights[n + 1] - lights[n]) * side for n, side in enumerate(sides))
    sampled = np.array(lights)[hits]
    code = _coded(sampled)
    smooth_edges(code, np.array(draws, np.uint32)[hits], np.full(hits.shape, 30.0, np.float32))
    inner = slice(8, -8), slice(8, -8)
    return ((code[..., 0] / 65535.0) ** 2)[inner], sampled[inner], np.asarray(truth)[inner]


@pytest.mark.parametrize("behind", [1, 3])
@pytest.mark.parametrize("steep", [-0.3, 0.05, 0.13, 0.3])
def test_a_strip_one_pixel_thick_has_smooth_edges(steep: float, behind: int) -> None:
    """A joint or a coping 1.1 px thick, bright between dark: the steps of its two edges touch, and are smoothed."""
    left = []
    for shift in np.linspace(-3, 3, 7):
        angle, lines = np.pi / 2 - steep, (float(shift), float(shift) + 1.1)
        shown, sampled, truth = _banded(angle, lines, (_DARK, _BRIGHT, _DARK), (1, 2, behind))
        left.append(np.sqrt(((shown - truth) ** 2).mean() / ((sampled - truth) ** 2).mean()))
    assert np.mean(left) < 0.35, left


def test_a_faint_crease_does_not_break_the_outline_beside_it() -> None:
    """A dark web, its little brighter flange of half a pixel, the sky: the outline is as smooth as without a crease."""
    left = []
    for creased in (2, 1):
        errors = []
        for shift in np.linspace(-3, 3, 7):
            lines = float(shift), float(shift) + 0.5
            shown, sampled, truth = _banded(np.pi / 2 - 0.13, lines, (0.02, 0.03, 0.7), (1, creased, 3))
            errors.append(np.sqrt(((shown - truth) ** 2).mean() / ((sampled - truth) ** 2).mean()))
        left.append(np.mean(errors))
    assert left[0] < 1.1 * left[1]
    assert left[0] < 0.3


@pytest.mark.parametrize(("height", "width"), [(2, 9), (9, 2), (12, 20), (3, 3)])
def test_corners_stay(height: int, width: int) -> None:
    """A window whose sides lie along rows and columns keeps every pixel."""
    inside = np.zeros((_SIDE, _SIDE), bool)
    inside[20 : 20 + height, 30 : 30 + width] = True
    shown, _ = _smoothed(inside)
    np.testing.assert_allclose(shown, np.where(inside, _BRIGHT, _DARK), atol=1e-4)


def test_a_corner_of_the_picture_does_not_change_its_first_row() -> None:
    """An edge that reaches the top of the picture is as smooth with a strong edge in the corner as without it."""
    inside = _half_plane(0.13, 0.0, 1) > 0.5
    codes = []
    for corner in (_DARK, 1.0):
        light = np.where(inside, 1.5 * _DARK, _DARK)
        draw = inside.astype(np.uint32)
        light[0, 0], draw[0, 0] = corner, 7
        code = _coded(light)
        smooth_edges(code, draw, np.full((_SIDE, _SIDE), 20.0, np.float32))
        codes.append(code[:, 4:])
    np.testing.assert_array_equal(*codes)


def test_one_surface_before_itself_has_an_edge_and_a_slope_has_none() -> None:
    """The same id twice: a step of depth is an edge, a plane that runs away is none."""
    across = np.arange(_SIDE, dtype=np.float32)[None, :] + np.zeros((_SIDE, 1), np.float32)
    inside = _half_plane(1.3, 0.0, 1) > 0.5
    light = np.where(inside, _BRIGHT, _DARK)
    draw = np.ones((_SIDE, _SIDE), np.uint32)
    for depth, smooth in ((np.where(inside, 30.0, 60.0), True), (1 / (0.001 + 0.0005 * across), False)):
        code = _coded(light)
        smooth_edges(code, draw, depth.astype(np.float32))
        assert (code != _coded(light)).any() == smooth


def test_sky_and_turned_pictures() -> None:
    """Infinite depth is no fault, and a picture turned by a quarter is smoothed into the same picture turned."""
    inside = _half_plane(0.4, 3.0, 1) > 0.5
    depth = np.where(inside, 20.0, np.inf).astype(np.float32)
    draw, light = inside.astype(np.uint32), np.where(inside, _BRIGHT, _DARK)
    code, turned = _coded(light), _coded(light.T)
    smooth_edges(code, draw, depth)
    smooth_edges(turned, np.ascontiguousarray(draw.T), np.ascontiguousarray(depth.T))
    assert np.abs(code.astype(int) - turned.transpose(1, 0, 2)).max() <= 1
    assert (code != _coded(light)).any()
