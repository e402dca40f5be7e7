"""Sleepers in ballast, seen from far away: an even band, as many samples show it, and truth untouched."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.gpu.bars import find_bars
from render.gpu.context import Gl
from render.settings import RenderSettings
from render.views.passes import Painter
from render.views.prepare import prepare
from tests.render.scenes import SceneBuilder, box_corners, placed
from usd_schemas.flat_scene import Dome, FlatScene, Material, Sun
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]

CAMERA = Pinhole(96, 96, 640.0, 640.0, 48.0, -72.0)
POSE = np.eye(4)  # looks along +z, x to the right, y down
BELOW = 12.0  # [m] from the camera down to the ballast
PITCH, COUNT = 0.6, 180  # of sleepers, from 12 m on
SLEEPER = np.array([2.6, 0.2, 0.26])  # [m]


def track(proud: float = 0.045) -> FlatScene:
    """A row of pale sleepers across the view in dark ballast, as one mesh; then a dark rail that stands on them."""
    builder = SceneBuilder(
        materials=[
            Material("ballast", (0.1, 0.1, 0.1)),
            Material("sleepers", (0.6, 0.6, 0.6)),
            Material("rail", (0.0, 0.0, 0.0)),
        ]
    )
    middles = np.zeros((COUNT, 3))
    middles[:, 1], middles[:, 2] = BELOW - proud + SLEEPER[1] / 2, 12.0 + PITCH * np.arange(COUNT)
    row = (box_corners() * SLEEPER)[None] + middles[:, None, None]
    builder.add_box(placed((0.0, BELOW + 0.5, 70.0), (6.0, 1.0, 140.0)), 1)
    builder.add_mesh(row.reshape(-1, 3, 3), np.eye(4), 2, 2, 1)
    rail = box_corners() * [0.07, 0.17, 130.0] + np.array([0.7, BELOW - proud - 0.08, 70.0])
    builder.add_mesh(rail, np.eye(4), 3, 3, 2)
    scene = builder.build(POSE[None], CAMERA)
    return replace(scene, dome=Dome((0.5, 0.5, 0.5)), sun=Sun((0.3, -0.9, -0.3), (1.0, 1.0, 1.0)))


def linear(painter: Painter) -> F64:
    """The green light of a view, shape (H, W)."""
    return (painter.draw(POSE, 0.1).code[..., 1] / 65535.0) ** 2


@pytest.fixture
def plain(small: RenderSettings) -> RenderSettings:
    """Standard quality without haze."""
    return small.model_copy(update={"normals": False, "haze_distance": 1e9})


def test_sleepers_are_a_quiet_band_as_bright_as_their_samples(
    gl: Gl, plain: RenderSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 0.5 to 1.7 px a sleeper, an error a third of that of single samples, 8x8 of them being the reference.

    Several share a pixel, each of which covers what the others left: the band is up to 15 % darker than the reference.
    """
    painter = prepare(gl, track(), plain, SILENT).painter(CAMERA, sharp=True)
    shown = linear(painter)
    monkeypatch.setattr(painter, "_coverage_layer", None)
    sampled, truth = linear(painter), np.zeros(shown.shape)
    for row in range(8):
        for column in range(8):
            x, y = ((place + 0.5) / 8 - 0.5 for place in (column, row))
            monkeypatch.setattr(painter, "_camera", replace(CAMERA, cx=CAMERA.cx - x, cy=CAMERA.cy - y))
            truth += linear(painter) / 64
    band = slice(0, 96), slice(41, 51)  # from 106 to 46 m, left of the rail
    left = [np.sqrt(((image - truth)[band] ** 2).mean()) for image in (shown, sampled)]
    assert left[0] < left[1] / 3
    far = slice(0, 40), slice(41, 51)  # from 69 m on
    assert shown[far].std() < min(1.2 * truth[far].std(), sampled[far].std() / 3)
    assert shown[far].mean() == pytest.approx(truth[far].mean(), rel=0.15)


@pytest.mark.parametrize("quality", ["standard", "fine"])
def test_truth_knows_nothing_of_embedded_bars(
    gl: Gl, plain: RenderSettings, monkeypatch: pytest.MonkeyPatch, quality: str
) -> None:
    """With and without their ribbons: the same ids and depth; the photograph alone changes."""
    settings = plain.model_copy(update={"quality": quality})
    painter = prepare(gl, track(), settings, SILENT).painter(CAMERA, sharp=True)
    drawn = painter.draw(POSE, 0.1)
    monkeypatch.setattr(painter, "_coverage_layer", None)
    monkeypatch.setattr(painter, "_edge_samples", None)
    plainly = painter.draw(POSE, 0.1)
    assert set(np.unique(drawn.draw)) == {0, 1, 2, 3}
    np.testing.assert_array_equal(drawn.draw, plainly.draw)
    np.testing.assert_array_equal(drawn.depth, plainly.depth)
    assert (drawn.code != plainly.code).any()


def test_a_rail_stays_on_top_of_its_sleepers(gl: Gl, plain: RenderSettings) -> None:
    """Its ribbon covers theirs, although its draw comes first: it takes away the light of its top and its side."""
    scene = track()
    order = np.array([2, 1, 0])
    draws = replace(scene.draws, **{name: rows[order] for name, rows in vars(scene.draws).items()})
    shown = linear(prepare(gl, replace(scene, draws=draws), plain, SILENT).painter(CAMERA, sharp=True))
    rows = np.arange(96)
    away = CAMERA.fy * BELOW / (rows + 0.5 - CAMERA.cy)
    rail = np.floor(CAMERA.cx + CAMERA.fx * 0.7 / away).astype(int)
    beside = shown[:, 41:49].mean(axis=1)
    lost = sum(1 - shown[rows, rail + shift] / beside for shift in (-2, -1, 0, 1, 2))
    assert np.mean(lost) > 1.25 * np.mean(CAMERA.fx * 0.07 / away)


def test_only_low_blocks_in_a_surface_are_embedded() -> None:
    """Every sleeper 4.5 cm above its ballast, by what stands out of it; none 16 cm above it, and none that floats."""
    bars = find_bars(track())
    assert bars.embedded.tolist() == [True] * COUNT + [False] * (len(bars.part) - COUNT)
    order = np.argsort(bars.ends[:COUNT, 0, 2])
    ends, first, second = bars.ends[order], bars.first[order], bars.second[order]
    np.testing.assert_allclose(np.sort(ends[:, :, 0], axis=1), np.tile([-1.3, 1.3], (COUNT, 1)), atol=1e-5)
    np.testing.assert_allclose(ends[:, :, 1], BELOW - 0.0225, atol=1e-4)
    np.testing.assert_allclose(ends[:, :, 2], np.repeat(12.0 + PITCH * np.arange(COUNT), 2).reshape(-1, 2), atol=1e-5)
    np.testing.assert_allclose(np.abs(first), np.broadcast_to([0.0, 0.0, 0.13], first.shape), atol=1e-5)
    np.testing.assert_allclose(second, np.broadcast_to([0.0, -0.0225, 0.0], second.shape), atol=1e-4)
    assert len(bars.vertices) == len(np.unique(bars.vertices))
    for proud in (0.16, 0.3):
        assert not find_bars(track(proud)).embedded.any()
