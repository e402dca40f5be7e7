"""Stains of a macro texture: drawn as exporters bake them, and as sharp as the grain."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from authoring.exchange.bake_lookup import TextureLookup
from authoring.exchange.bake_stains import detail_factors
from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.light.illumination import BRIGHTEST
from render.settings import RenderSettings
from render.views.prepare import prepare
from tests.conftest import Count, RecordProof
from tests.render.scenes import CAMERA, DOWN, WHITE_DOME, SceneBuilder, placed
from usd_schemas.flat_scene import Detail, Material

SIDE, AWAY = 20.0, 8.0  # [m]
MATT = (0.0, 0.0, 0.0)  # what it mirrors: nothing
FEW = 0.02  # share of the macro texture that the plate shows: 20 of its texels
PERIODS, AMPLITUDES = (0.5, 0.26, 0.19), (0.5, 0.45, 0.4)
SQUARE = np.array([[[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0]], [[-0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]])


def draw(folder: Path, gl: Gl, settings: RenderSettings) -> np.ndarray:
    """Draw a plate with `detail.png` and `macro.png` of a folder, from above; linear, shape (H, W, 3)."""
    detail = Detail(str(folder / "detail.png"), PERIODS, AMPLITUDES, str(folder / "macro.png"))
    builder = SceneBuilder(materials=[Material("card", (0.3, 0.3, 0.3), roughness=1.0, specular=MATT, detail=detail)])
    builder.add_mesh(SQUARE, placed((0, 0, 0), (SIDE, SIDE, 1.0)), 1, st=SQUARE[..., :2] + 0.5)
    scene = replace(builder.build(DOWN[None]), dome=WHITE_DOME)
    st1 = (0.4 + FEW * scene.geometry.st).astype(np.float32)
    prepared = prepare(gl, replace(scene, geometry=replace(scene.geometry, st1=st1)), settings, SILENT)
    view = prepared.painter(CAMERA, sharp=True).draw(DOWN, 0.1)
    return (view.code.astype(np.float64) / 65535) ** 2 * BRIGHTEST


def baked(folder: Path, follows: bool = True) -> np.ndarray:
    """Compute the same from the sums of the exporters; without `follows`, with the macro texture as it is painted."""
    down, across = np.indices((CAMERA.height, CAMERA.width)).reshape(2, -1) + 0.5
    x, y = (across - CAMERA.cx) / CAMERA.fx * AWAY, (CAMERA.cy - down) / CAMERA.fy * AWAY
    st = (np.stack([x, y], axis=1) / SIDE + 0.5).astype(np.float32)
    textures = TextureLookup()
    octaves = [
        np.float32(amplitude) * (2 * textures.levels(str(folder / "detail.png"), st / np.float32(period), 0.0) - 1)
        for period, amplitude in zip(PERIODS, AMPLITUDES, strict=True)
    ]

    def macro(shift: np.ndarray) -> np.ndarray:
        return textures.colors(str(folder / "macro.png"), np.float32(0.4) + np.float32(FEW) * st + shift, 0.0, False)

    factors = detail_factors(octaves, macro if follows else None)
    factors = factors if follows else factors * 2 * macro(np.zeros(2, np.float32))
    return np.minimum(0.3 * factors, 0.95).reshape(CAMERA.height, CAMERA.width, 3)


@pytest.mark.parametrize("quality", ["fast", "standard"])
def test_stains_are_drawn_as_they_are_baked(
    gl: Gl, ideal: RenderSettings, tmp_path: Path, quality: str, proof_count: Count, record_proof: RecordProof
) -> None:
    """Pixel by pixel the renderer's detail and stains, dark, bright and rusty, are those of the exporters."""
    if quality == "standard" and proof_count(0, 1) == 0:
        pytest.skip("runs with --proof only")
    rng = np.random.default_rng(3)
    grain = cv2.GaussianBlur(rng.normal(size=(32, 32)), (0, 0), 1.0, borderType=cv2.BORDER_REFLECT)
    cv2.imwrite(str(tmp_path / "detail.png"), np.clip(128 + 220 * grain, 0, 255).astype(np.uint8))
    cv2.imwrite(str(tmp_path / "macro.png"), rng.integers(40, 190, (1024, 1024, 3), np.uint8))
    drawn = draw(tmp_path, gl, ideal.model_copy(update={"quality": quality}))
    expected = baked(tmp_path)
    off, painted = np.abs(drawn - expected), np.abs(drawn - baked(tmp_path, follows=False))
    assert np.quantile(off, 0.99) < 0.015  # 8 bits of a filter's weights
    assert np.median(painted) > 5 * np.median(off)
    record_proof(f"looks/stains are drawn as baked: {quality}", drawn.size, 3, {"median_off": float(np.median(off))})


@pytest.mark.parametrize(
    ("macro", "gray", "strength"), [(100, 96, 1.487), (100, 255, 0.0), (100, 0, 2.318), (64, 96, 1.003), (200, 96, 1.0)]
)
def test_dark_stains_keep_to_dark_pores(macro: int, gray: int, strength: float) -> None:
    """A stain is stronger where detail is dark, up to full cover; one that is full or bright is as painted."""
    octave = np.full((1, 1), 0.3 * (2 * gray / 255 - 1), np.float32)
    level = np.full((1, 3), macro / 255, np.float32)
    expected = (1 + octave) ** 2 * (1 + strength * (2 * level - 1))
    np.testing.assert_allclose(detail_factors([octave, octave], lambda _: level), expected, rtol=1e-3)
    np.testing.assert_allclose(detail_factors([], lambda _: level), 2 * level, rtol=1e-6)
    np.testing.assert_allclose(detail_factors([octave], None), 1 + octave, rtol=1e-6)
