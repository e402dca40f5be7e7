"""Further samples along edges: the mean of shifted pictures, in the photograph alone."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.settings import RenderSettings
from render.views.edges import pixels_at_edges
from render.views.passes import Painter
from render.views.prepare import prepare
from tests.render.scenes import CAMERA, SceneBuilder, placed, random_scene
from usd_schemas.flat_scene import Dome, FlatScene, Material
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
GLOW = 0.2  # of the pane [1]


def painter_of(gl: Gl, scene: FlatScene, small: RenderSettings, quality: str, samples: int) -> Painter:
    """A painter without haze."""
    changes = {"quality": quality, "edge_samples": samples, "normals": False, "haze_distance": 1e9}
    return prepare(gl, scene, small.model_copy(update=changes), SILENT).painter(CAMERA, sharp=True)


def scene_of_boxes() -> FlatScene:
    """Forty boxes at random before the sky."""
    return replace(random_scene(5, np.zeros(3)), dome=Dome((0.5, 0.6, 0.7)))


def scene_with_a_pane(opacity: float) -> FlatScene:
    """A tilted bar that glows before a wall that glows less, behind a pane that fills the picture."""
    glows = (("wall", 0.1, {}), ("bar", 0.6, {}), ("pane", GLOW, {"blends": True, "opacity": opacity}))
    materials = [
        Material(name, (0.0, 0.0, 0.0), specular=(0.0, 0.0, 0.0), emissive=(glow, glow, glow), **more)
        for name, glow, more in glows
    ]
    builder = SceneBuilder(materials=materials)
    builder.add_box(placed((0.0, 0.0, 12.0), (40.0, 40.0, 1.0)), 1)
    builder.add_box(placed((0.3, 0.0, 8.0), (1.5, 2.5, 0.1), 0.3), 2, 2, 1)
    builder.add_box(placed((0.0, 0.0, 5.0), (40.0, 40.0, 0.1)), 3, 3, 2)
    return builder.build(np.eye(4)[None])


def lattice(count: int) -> F64:
    """Places of the samples in a pixel, from its corner [1], shape (count, 2): one a column, one a row."""
    side, row = round((count - 1) ** 0.5), np.arange(count)
    across = (0.5 - side * (row + 0.5) / count) % 1.0
    return np.stack([across, (row + 0.5) / count], axis=1)


@pytest.mark.parametrize("count", [5, 17])
def test_samples_are_those_of_shifted_pictures(
    count: int, gl: Gl, small: RenderSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Brute force: the mean of as many single-sample pictures, each shifted by the place of a sample."""
    scene = scene_of_boxes()
    pose = scene.cameras[0].poses[0]
    shown = painter_of(gl, scene, small, "fast", count).draw(pose, 0.1)
    single = painter_of(gl, scene, small, "fast", 0)
    plain, total = single.draw(pose, 0.1), np.zeros(shown.code.shape)
    for across, down in lattice(count):
        monkeypatch.setattr(single, "_camera", replace(CAMERA, cx=CAMERA.cx + 0.5 - across, cy=CAMERA.cy + 0.5 - down))
        total += (single.draw(pose, 0.1).code / 65535.0) ** 2
    wanted = pixels_at_edges(plain.draw, plain.depth, np.zeros(plain.draw.shape, bool)) > 0
    assert 0.05 < wanted.mean() < 0.9
    np.testing.assert_array_equal(shown.code[~wanted], plain.code[~wanted])
    difference = np.abs((shown.code[wanted] / 65535.0) ** 2 - total[wanted] / count)
    # A sample that falls on an edge to the last bit may show either side of it.
    assert (difference.max(axis=1) < 1e-3).mean() > 0.995
    np.testing.assert_array_equal(shown.draw, plain.draw)
    np.testing.assert_array_equal(shown.depth, plain.depth)


@pytest.mark.parametrize("quality", ["standard", "fine"])
def test_bands_and_windows_have_the_samples_of_the_whole(quality: str, gl: Gl, small: RenderSettings) -> None:
    """Rows read one after the other from one place, or alone, are those of the whole view."""
    scene = scene_of_boxes()
    pose = scene.cameras[0].poses[0]
    painter = painter_of(gl, scene, small, quality, 5)
    whole, cut = painter.draw(pose, 0.1), CAMERA.height // 3
    bands = painter.draw_bands(np.stack([pose, pose]), [(0, cut), (cut, CAMERA.height)], 0.1)
    np.testing.assert_allclose(bands.code.astype(int), whole.code, atol=3)  # places are rounded otherwise
    window = painter.draw_window(pose, (cut, cut + 20), 0.1)
    np.testing.assert_array_equal(window.draw, whole.draw[cut : cut + 20])
    inner = slice(3, 17)  # the choice of pixels looks at two rows around
    np.testing.assert_allclose(window.code[inner].astype(int), whole.code[cut : cut + 20][inner], atol=3)


def test_an_image_in_strips_has_the_samples_of_the_whole(
    gl: Gl, small: RenderSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Strips of five rows, the last one shorter: but for samples on an edge to the last bit, the same."""
    scene = scene_with_a_pane(0.3)
    whole = painter_of(gl, scene, small, "standard", 17).draw(np.eye(4), 0.1)
    monkeypatch.setattr("render.views.edge_samples._TEXELS", 17 * 5 * (CAMERA.width + 4 * 5) + 10)
    painter = painter_of(gl, scene, small, "standard", 17)
    assert painter._edge_samples is not None
    assert painter._edge_samples.rows in (4, 5)
    for _ in range(2):  # nothing is left of the former view
        strips = painter.draw(np.eye(4), 0.1)
        near = np.abs(strips.code.astype(int) - whole.code).max(axis=2) <= 3
        assert near.mean() > 0.999
        np.testing.assert_array_equal(strips.draw, whole.draw)


@pytest.mark.parametrize("size", [(24, 1024), (1500, 8)])
def test_long_and_narrow_images_fit_into_a_texture(size: tuple[int, int], gl: Gl, small: RenderSettings) -> None:
    """Many rows of samples for few columns would be higher than a driver allows, or take much memory."""
    width, height = size
    camera = Pinhole(width, height, 100.0, 100.0, width / 2, height / 2)
    scene = scene_of_boxes()
    ready = prepare(gl, scene, small.model_copy(update={"edge_samples": 37, "normals": False}), SILENT)
    assert ready.painter(camera, sharp=True).draw(scene.cameras[0].poses[0], 0.1).code.shape == (height, width, 3)


def test_transparent_surfaces_have_samples_too(gl: Gl, small: RenderSettings) -> None:
    """Behind the two sides of a pane that glows, edges are mixed as without it.

    Of light L behind a side that glows with G, opacity * G + (1 - opacity) * L is seen.
    """
    scenes = [scene_with_a_pane(opacity) for opacity in (0.3, 0.0)]
    shown, bare = (
        (painter_of(gl, scene, small, "fast", 17).draw(np.eye(4), 0.1).code / 65535.0) ** 2 for scene in scenes
    )
    shown, bare = shown * 0.1 / bare[0, 0], bare * 0.1 / bare[0, 0]  # in the unit of the wall
    assert len(np.unique(bare[..., 0].round(4))) > 8  # edges are mixed
    np.testing.assert_allclose(shown, 0.51 * GLOW + 0.49 * bare, atol=1e-3)  # 0.51 = 1 - 0.7 * 0.7


def test_leaves_have_samples_on_their_outline_alone() -> None:
    """Depth steps between leaves of one crown are everywhere: they get none. Steps of a solid part do."""
    draw, depth = np.ones((9, 20), np.uint32), np.full((9, 20), 10.0, np.float32)
    depth[:, 10:] = 20.0
    leaves = np.ones(draw.shape, bool)
    assert not pixels_at_edges(draw, depth, leaves).any()
    solid = pixels_at_edges(draw, depth, ~leaves)
    np.testing.assert_array_equal(np.flatnonzero(solid[4]), np.arange(7, 13))
    draw[:, 10:] = 2
    np.testing.assert_array_equal(np.flatnonzero(pixels_at_edges(draw, depth, leaves)[4]), [9, 10])
