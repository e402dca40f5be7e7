"""Edges where ids are finer than pixels: every pixel is mixed by the area that its finer pixels show."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.settings import RenderSettings
from render.views.finer_edges import mixed_pixels, smooth_finer_edges
from render.views.passes import Painter, ViewOptions
from render.views.prepare import prepare
from tests.render.scenes import CAMERA, random_scene
from usd_schemas.flat_scene import Dome

U16 = NDArray[np.uint16]
U32 = NDArray[np.uint32]

HEIGHT, WIDTH = 12, 16


def half_planes(finer: int, slope: float) -> tuple[U16, U32, U32]:
    """Light and middles of pixels, and finer ids, of two surfaces that a straight edge divides: 1 above it, 2 below."""

    def seen(count: int) -> U32:
        row, column = np.mgrid[0 : count * HEIGHT, 0 : count * WIDTH] + 0.5
        return np.where(row / count > 3.3 + slope * column / count, 2, 1).astype(np.uint32)

    middle = seen(1)
    code = np.where(middle == 1, 10_000, 50_000).astype(np.uint16)[..., None].repeat(3, axis=2)
    return code, middle, seen(finer)


@pytest.mark.parametrize("finer", [2, 3, 4, 5])
@pytest.mark.parametrize("slope", [0.0, 0.13, 0.7])
def test_a_pixel_is_mixed_by_the_area_of_what_it_shows(finer: int, slope: float) -> None:
    """The mean of linear light, weighted by the counted share, to half a code; elsewhere nothing changes."""
    code, middle, draw = half_planes(finer, slope)
    share = (draw == 2).reshape(HEIGHT, finer, WIDTH, finer).mean(axis=(1, 3))
    goal = np.sqrt((1 - share) * 10_000.0**2 + share * 50_000.0**2)
    assert ((share > 0) & (share < 1)).any()
    smooth_finer_edges(code, middle, draw)
    assert np.abs(code - goal[..., None]).max() <= 0.51


def test_what_no_middle_shows_does_not_count() -> None:
    """A speck between the middles has no known light: its pixel stays as it is."""
    code, middle, draw = half_planes(5, 0.0)
    draw[5 * 8 + 1, 5 * 4] = 3
    before = code.copy()
    smooth_finer_edges(code, middle, draw)
    np.testing.assert_array_equal(code[8, 4], before[8, 4])


def test_pixels_with_several_parts_get_samples() -> None:
    """Those whose finer pixels differ; of solid parts also the eight around, of leaves none beside."""
    draw = np.ones((20, 24), np.uint32)
    draw[9, 13] = 2
    solid, leaves = np.zeros(3, bool), np.array([False, False, True])
    alone = np.zeros((5, 6), np.uint8)
    alone[2, 3] = 1
    np.testing.assert_array_equal(mixed_pixels(draw, 4, leaves), alone)
    around = np.zeros((5, 6), np.uint8)
    around[1:4, 2:5] = 1
    np.testing.assert_array_equal(mixed_pixels(draw, 4, solid), around)


@pytest.mark.parametrize(("samples", "most"), [(0, 0.65), (17, 0.35)])
def test_views_for_a_lens_that_distorts_have_smooth_edges(
    samples: int, most: float, gl: Gl, small: RenderSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """RMS difference from 8x8 samples over pixels that show several parts, as a share of that of one sample."""
    scene = replace(random_scene(5, np.zeros(3)), dome=Dome((0.5, 0.6, 0.7)))
    ready = prepare(gl, scene, small.model_copy(update={"normals": False, "haze_distance": 1e9}), SILENT)
    pose = scene.cameras[0].poses[0]
    options = ViewOptions("standard", "TRIANGLES", 4, edge_samples=samples)
    shown = Painter(gl, ready.programs, ready.gpu, ready.lamps, CAMERA, options).draw(pose, 0.1)
    painter = ready.painter(CAMERA, sharp=True)
    monkeypatch.setattr(painter, "_coverage_layer", None)
    single, total = painter.draw(pose, 0.1), np.zeros(shown.code.shape)
    mixed = np.zeros(single.draw.shape, bool)
    for place in np.ndindex(8, 8):
        down, across = (np.array(place) + 0.5) / 8 - 0.5
        monkeypatch.setattr(painter, "_camera", replace(CAMERA, cx=CAMERA.cx - across, cy=CAMERA.cy - down))
        view = painter.draw(pose, 0.1)
        total += (view.code / 65535.0) ** 2 / 64
        mixed |= view.draw != single.draw
    left = [np.sqrt(np.mean(((view.code / 65535.0) ** 2 - total)[mixed] ** 2)) for view in (shown, single)]
    assert left[0] < most * left[1]
