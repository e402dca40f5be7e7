"""SphereLights against closed forms: the square of the distance, the cosine, and the horizon that cuts a near ball."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.light.light_level import dimmed
from render.light.local_lights import MOST, choose_local_lights
from render.settings import RenderSettings
from render.views.prepare import prepare
from tests.conftest import RecordProof
from tests.render.scenes import CAMERA, SceneBuilder
from tests.render.test_light import DOWN, plate, radiance
from usd_schemas.flat_scene import Dome, FlatScene, Material, SphereLight, Sun, Texture
from usd_schemas.pinhole import look_at, unproject

F64 = NDArray[np.float64]
COLOR = np.array([3.0, 2.0, 1.0])


def ball(position: tuple[float, float, float], radius: float, brightness: float) -> SphereLight:
    """Make a SphereLight whose surface has `brightness` times `COLOR` as its radiance."""
    red, green, blue = (float(value) for value in brightness * COLOR * np.pi * radius**2)
    return SphereLight(position, radius, (red, green, blue))


def card(albedo: float = 0.5) -> SceneBuilder:
    """Start a scene with a level matt plate."""
    return plate(Material("card", base_color=(albedo, albedo, albedo), roughness=1.0))


def drawn_and_points(gl: Gl, scene: FlatScene, settings: RenderSettings) -> tuple[F64, F64]:
    """Draw the first pose: radiance and world position of each pixel on the plate, each of shape (H, W, 3)."""
    light, depth = radiance(gl, scene, settings)
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width] + 0.5
    points = unproject(np.column_stack([u.ravel(), v.ravel()]), depth.ravel(), CAMERA, scene.cameras[0].poses[0])
    return light, points.reshape(*depth.shape, 3)


def test_irradiance_of_a_ball_on_a_plane(gl: Gl, ideal: RenderSettings, record_proof: RecordProof) -> None:
    """E = pi L (r / d)^2 cos: at every pixel of a plate that a ball of light stands over, the sun adding its own."""
    position, radius, sun = (1.0, -0.5, 2.0), 0.3, (0.6, 0.5, 0.4)
    lamp = ball(position, radius, 1.0)
    scene = replace(card().build(DOWN[None]), sphere_lights=(lamp,), sun=Sun((0.0, 0.0, 1.0), sun))
    light, points = drawn_and_points(gl, scene, ideal.model_copy(update={"quality": "fast"}))
    reach = np.array(position) - points
    distance = np.linalg.norm(reach, axis=-1, keepdims=True)
    received = np.pi * COLOR * (radius / distance) ** 2 * (reach[..., 2:] / distance) + np.array(sun)
    error = float(np.abs(light / (0.5 / np.pi * received) - 1.0).max())
    assert error < 3e-3
    record_proof("render: irradiance of a SphereLight", light[..., 0].size, 0, {"worst_relative_error": error})


def test_a_ball_that_the_horizon_cuts(gl: Gl, ideal: RenderSettings) -> None:
    """Near a ball that is half sunk in the plane, the irradiance is the integral over the part that is seen."""
    scene = replace(card().build(DOWN[None]), sphere_lights=(ball((0.0, 0.0, 0.1), 0.6, 1.0),))
    light, points = drawn_and_points(gl, scene, ideal.model_copy(update={"quality": "fast"}))
    z = 1 - (np.arange(400_000) + 0.5) / 400_000  # upper half sphere of directions, evenly
    turn = np.arange(400_000) * np.pi * (3 - np.sqrt(5))
    aims = np.column_stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z])
    for row, column in ((60, 95), (60, 105), (80, 110), (30, 80)):
        reach = np.array([0.0, 0.0, 0.1]) - points[row, column]
        along = aims @ reach
        hit = (along > 0) & (reach @ reach - along**2 < 0.6**2)
        expected = 2 * np.pi * np.mean(hit * z) * COLOR
        np.testing.assert_allclose(light[row, column], 0.5 / np.pi * expected, rtol=0.01)


def test_below_the_plane_nothing_arrives(gl: Gl, ideal: RenderSettings) -> None:
    """A ball under the plate leaves its upper side black, without a default day coming in."""
    scene = replace(card().build(DOWN[None]), sphere_lights=(ball((0.0, 0.0, -2.0), 0.3, 50.0),))
    for quality in ("fast", "standard"):
        light, _ = radiance(gl, scene, ideal.model_copy(update={"quality": quality}))
        assert light[60, 80].max() < 1e-6
    assert not any("default sun" in line for line in prepare(gl, scene, ideal, SILENT).warnings)


@pytest.mark.parametrize("quality", ["standard", "fine"])
def test_a_far_ball_shades_as_a_sun(gl: Gl, ideal: RenderSettings, quality: str) -> None:
    """Diffuse and shine of a small far ball equal those of a DistantLight from there, on paint and on metal."""
    settings = ideal.model_copy(update={"quality": quality})
    for metallic, roughness in ((0.0, 0.4), (1.0, 0.5)):
        material = Material("card", base_color=(0.5, 0.4, 0.3), roughness=roughness, metallic=metallic)
        pose = look_at(np.array([0.0, -5.0, 4.0]), np.zeros(3))
        scene = plate(material).build(pose[None])
        to_sun = np.array([0.0, 0.6, 0.8])
        x, y, z = (to_sun * 3000.0).tolist()
        near = replace(scene, sphere_lights=(SphereLight((x, y, z), 1.0, (9e6, 9e6, 9e6)),))
        far = replace(scene, sun=Sun((0.0, 0.6, 0.8), (1.0, 1.0, 1.0)))
        by_ball, by_sun = (radiance(gl, lit, settings)[0][30:100, 40:120] for lit in (near, far))
        bare = 0.5 * 0.8 / np.pi
        assert by_sun[..., 0].max() > 1.5 * bare  # there is a highlight
        # The sun also lights what the light volume gathers; a lamp does not.
        np.testing.assert_allclose(by_ball, by_sun, rtol=0.03, atol=0.01)


@pytest.mark.parametrize(("times", "pictured"), [(-12, False), (11, True)])
def test_light_has_no_unit(gl: Gl, ideal: RenderSettings, times: int, pictured: bool, tmp_path: Path) -> None:
    """A dome of 2,000 or of a quarter of a thousandth gives the picture that one of 1 gives, and one line says so."""
    cv2.imwrite(str(tmp_path / "white.png"), np.full((16, 16), 255, np.uint8))
    glow = Texture(str(tmp_path / "white.png"), True, gain=(0.0, 0.1, 0.0)) if pictured else None
    glowing = Material(
        "card", base_color=(0.2, 0.3, 0.4), roughness=1.0, emissive=(0.0, 0.1, 0.0), emissive_texture=glow
    )
    scene = replace(plate(glowing).build(DOWN[None]), dome=Dome((1.0, 0.9, 0.8)))
    scene = replace(scene, sun=Sun((0.0, 0.6, 0.8), (1.0, 1.0, 1.0)), sphere_lights=(ball((0, 0, 3), 0.3, 1.0),))
    bright = dimmed(scene, -times)
    assert bright.dome
    assert bright.dome.radiance[0] == 2.0**times
    assert [one.gain[1] for one in bright.materials[0].textures()] == [0.1 * 2.0**times] * pictured
    assert not any("no unit" in line for line in prepare(gl, scene, ideal, SILENT).warnings)
    (line,) = (line for line in prepare(gl, bright, ideal, SILENT).warnings if "no unit" in line)
    shown, expected = (radiance(gl, one, ideal)[0] for one in (bright, scene))
    factor = float(line.partition("2^")[2].partition(" ")[0]) + times
    assert abs(factor) <= 2
    np.testing.assert_allclose(shown, expected * 2.0**factor, rtol=2e-3)
    assert expected[60, 80, 1] > 0.3


def test_the_strongest_are_kept_with_one_warning(gl: Gl, ideal: RenderSettings) -> None:
    """Of ten the eight that give most light to the scene shine, and one line says so; none at all compile nothing."""
    places = [(float(x), 0.0, 2.0) for x in (-4, -3, -2, -1, 0, 1, 2, 3, 4, 400)]
    strengths = [1.0, 1.0, 1.0, 0.01, 1.0, 1.0, 1.0, 1.0, 1.0, 5.0]
    lights = tuple(ball(place, 0.2, strength) for place, strength in zip(places, strengths, strict=True))
    scene = card().build(DOWN[None])
    box = (np.array([-10.0, -10, 0]), np.array([10.0, 10, 0]))
    chosen, said = choose_local_lights(replace(scene, sphere_lights=lights), box)
    assert chosen.positions[:, 0].tolist() == [-4, -3, -2, 0, 1, 2, 3, 4]
    assert said == [f"2 of 10 SphereLights are left out: only the {MOST} brightest are drawn"]
    kept = tuple(light for light in lights if light.position[0] not in (-1.0, 400.0))
    settings = ideal.model_copy(update={"quality": "fast"})
    shown = [radiance(gl, replace(scene, sphere_lights=some), settings)[0] for some in (lights, kept)]
    np.testing.assert_array_equal(shown[0], shown[1])
    # Where the scene is as wide as the lamps are far, the nearer of two no longer wins by its square.
    ten = tuple(ball((100.0 + x, 0.0, 0.0), 0.2, power) for x, power in [(0.0, 1.0)] + 8 * [(30.0, 1.5)])
    for wide, dark in ((1.0, 130.0), (200.0, 100.0)):
        ends = np.array([100.0 - wide, 0.0, 0.0]), np.array([100.0 + wide, 0.0, 0.0])
        shining, _ = choose_local_lights(replace(scene, sphere_lights=ten), ends)
        assert (shining.positions[:, 0] == dark).sum() == (7 if dark == 130.0 else 0)
    none, silent = choose_local_lights(scene, box)
    assert (none.features(), none.uniforms(np.zeros(3)), silent) == ((), {}, [])
