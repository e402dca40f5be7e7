"""Depth is drawn before anything is shaded: what is hidden costs nothing, and no image shows it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.settings import RenderSettings
from render.views.draw_calls import DrawCalls
from render.views.prepare import prepare
from tests.render.scenes import CAMERA, random_scene
from usd_schemas.flat_scene import Dome


@pytest.mark.parametrize("quality", ["standard", "fine"])
def test_every_pixel_is_shaded_once_and_all_images_stay(
    gl: Gl, small: RenderSettings, monkeypatch: pytest.MonkeyPatch, quality: str
) -> None:
    """Depth first for all, for what is large, for nothing: the same images from ever more samples."""
    scene = replace(random_scene(5, np.zeros(3)), dome=Dome((1.0, 1.0, 1.0)))
    settings = small.model_copy(update={"quality": quality, "normals": False})
    painter = prepare(gl, scene, settings, SILENT).painter(CAMERA, sharp=True)
    counts: list[int] = []
    draw_surfaces = DrawCalls.surfaces

    def counted(self: DrawCalls, *arguments: Any) -> None:
        query = gl.context.query(samples=True)
        with query:
            draw_surfaces(self, *arguments)
        counts.append(query.samples)

    monkeypatch.setattr(DrawCalls, "surfaces", counted)
    shaded, images = [], []
    for large in (0.0, 30.0, np.inf):
        monkeypatch.setattr("render.views.draw_calls._LARGE", large)
        counts.clear()
        images.append([painter.draw(pose, 0.1) for pose in scene.cameras[0].poses])
        shaded.append(sum(counts))
    for views in images[1:]:
        for one, other in zip(images[0], views, strict=True):
            for name in ("code", "draw", "depth"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    assert shaded[0] <= shaded[1] <= shaded[2]
    assert shaded[0] < 0.9 * shaded[2]
    if quality == "standard":
        assert shaded[0] == sum(int((view.draw > 0).sum()) for view in images[0])
