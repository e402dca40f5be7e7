"""Water mirrors what stands by it, on the photograph alone."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.light.illumination import BRIGHTEST
from render.settings import RenderSettings
from render.views.prepare import prepare
from tests.render.scenes import CAMERA, SceneBuilder, placed
from usd_schemas.flat_scene import Detail, Dome, FlatScene, Material
from usd_schemas.pinhole import look_at

POSE = look_at(np.array([0.0, -20.0, 3.0]), np.array([0.0, 0.0, 0.5]))


def by_the_water(roughness: float) -> FlatScene:
    """Place a glowing red wall, 4 m high and 10 m wide, behind 60 m of dark level ground."""
    materials = [
        Material("sheet", base_color=(0.0, 0.0, 0.0), roughness=roughness),
        Material("wall", base_color=(0.0, 0.0, 0.0), roughness=1.0, emissive=(1.0, 0.0, 0.0)),
    ]
    builder = SceneBuilder(materials=materials)
    corners = np.array([[[-30, -30, 0], [30, -30, 0], [30, 30, 0]], [[-30, -30, 0], [30, 30, 0], [-30, 30, 0]]], float)
    builder.add_mesh(corners, placed((0, 0, 0)), 1)
    builder.add_box(placed((0.0, 5.0, 2.0), (10.0, 0.5, 4.0)), 2, material=1)
    return replace(builder.build(POSE[None]), dome=Dome((0.05, 0.05, 0.05)))


def test_water_mirrors_a_wall_behind_it_and_leaves_the_truth_alone(gl: Gl, ideal: RenderSettings) -> None:
    """Under the wall the water glows red, beside its image it does not; ids and depth are those of rough ground."""
    shown = []
    for roughness in (0.1, 0.9):
        prepared = prepare(gl, by_the_water(roughness), ideal, SILENT)
        shown.append(prepared.painter(CAMERA, sharp=True).draw(POSE, 0.1))
    water, ground = shown
    np.testing.assert_array_equal(water.draw, ground.draw)
    np.testing.assert_array_equal(water.depth, ground.depth)
    light = (water.code.astype(np.float64) / 65535) ** 2 * BRIGHTEST
    middle = CAMERA.width // 2
    foot = int(np.flatnonzero(water.draw[:, middle] == 2).max())  # the lowest row of the wall
    image, beside = light[foot + 3 : foot + 8, middle].mean(axis=0), light[foot + 3 : foot + 8, 4].mean(axis=0)
    assert image[0] > 0.05
    assert image[0] > 5 * image[1]
    assert beside[0] < 1.5 * beside[1]


def test_water_shows_its_bed_by_a_picture_on_the_second_coordinates(
    gl: Gl, ideal: RenderSettings, tmp_path: Path
) -> None:
    """What water scatters is multiplied by the picture, what it mirrors is not; the truth stays as it is."""
    shown = []
    down = look_at(np.array([0.0, -8.0, 6.0]), np.array([0.0, -8.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    for factor in (0.5, 1.0, 1.5):
        file = tmp_path / f"{factor}.png"
        cv2.imwrite(str(file), np.full((16, 16, 3), round(127.5 * factor), np.uint8))
        scene = by_the_water(0.1)
        water = replace(scene.materials[0], base_color=(0.1, 0.1, 0.1), detail=Detail(macro_file=str(file)))
        scene = replace(scene, materials=(water, *scene.materials[1:]))
        view = prepare(gl, scene, ideal, SILENT).painter(CAMERA, sharp=True).draw(down, 0.1)
        shown.append((view, ((view.code.astype(np.float64) / 65535) ** 2 * BRIGHTEST).mean()))
    (dark, low), (plain, mid), (light, high) = shown
    assert high - mid > 0.2 * mid
    np.testing.assert_allclose(high - mid, mid - low, rtol=0.05)
    for other in (dark, light):
        np.testing.assert_array_equal(other.depth, plain.depth)
        np.testing.assert_array_equal(other.draw, plain.draw)
