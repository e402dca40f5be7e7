"""RectLights and DiskLights against the integral over their surfaces."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from render.gpu.context import Gl
from render.light.local_lights import choose_local_lights
from render.settings import RenderSettings
from tests.conftest import Count, RecordProof
from tests.render.test_light import DOWN, radiance
from tests.render.test_local_lights import ball, card, drawn_and_points
from usd_schemas.flat_scene import SphereLight

F64 = NDArray[np.float64]
COLOR = np.array([3.0, 2.0, 1.0])


def panel(center: F64, across: F64, up: F64, brightness: float = 1.0) -> SphereLight:
    """Make a panel whose surface has `brightness` times `COLOR` as its radiance."""
    area = brightness * 4 * float(np.linalg.norm(np.cross(across, up)))
    x, y, z = center.tolist()
    red, green, blue = (area * COLOR).tolist()
    (a, b, c), (d, e, f) = across.tolist(), up.tolist()
    return SphereLight((x, y, z), float(np.sqrt(area / brightness / np.pi)), (red, green, blue), ((a, b, c), (d, e, f)))


def integral(points: F64, center: F64, across: F64, up: F64, steps: int = 60) -> F64:
    """Add up what small pieces of a panel give to points of a level plane, shape (..., 3), the slow and obvious way."""
    shines = np.cross(up, across)
    area = 4 * np.linalg.norm(shines)
    total = np.zeros(points.shape[:-1])
    for i in (np.arange(steps) + 0.5) / steps * 2 - 1:
        for j in (np.arange(steps) + 0.5) / steps * 2 - 1:
            reach = center + i * across + j * up - points
            square = np.einsum("...i,...i->...", reach, reach)
            leaves = np.clip(-(reach @ shines) / np.linalg.norm(shines), 0, None) / np.sqrt(square)
            total += np.clip(reach[..., 2], 0, None) / np.sqrt(square) * leaves / square
    return total * area / steps**2


PANELS = {
    "over the plate": ([1.0, -0.5, 2.0], [0.6, 0.0, 0.0], [0.0, 0.3, 0.0]),
    "leaning": ([-1.0, 0.5, 1.5], [0.0, -0.5, 0.0], [0.3, 0.0, 0.3]),
    "far": ([30.0, 10.0, 80.0], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]),
}


@pytest.mark.parametrize("name", PANELS)
def test_irradiance_of_a_panel_on_a_plane(
    name: str, gl: Gl, ideal: RenderSettings, proof_count: Count, record_proof: RecordProof
) -> None:
    """Every pixel of a plate before a panel receives the integral of its surface; every fourth in a quick run."""
    center, across, up = (np.array(row) for row in PANELS[name])
    brightness = 0.25 * float(center @ center)  # so that the steps of the image are small beside the light
    lamp = panel(center, across, up, brightness)
    scene = replace(card().build(DOWN[None]), sphere_lights=(lamp,))
    light, points = drawn_and_points(gl, scene, ideal.model_copy(update={"quality": "fast"}))
    apart = proof_count(4, 1)
    light, points = light[::apart, ::apart], points[::apart, ::apart]
    received = brightness * integral(points, center, across, up)
    lit = received > 0.05 * received.max()
    error = float(np.abs(light[lit] / (0.5 / np.pi * received[lit, None] * COLOR) - 1.0).max())
    assert error < 4e-3
    assert lit.mean() > 0.3
    record_proof(f"render: irradiance of a RectLight, {name}", int(lit.sum()), 0, {"worst_relative_error": error})


def test_a_panel_shines_to_one_side(gl: Gl, ideal: RenderSettings) -> None:
    """Turned over, a panel leaves the plate black, in every quality, and no default day comes in."""
    lamp = panel(np.array([0.0, 0.0, 2.0]), np.array([0.5, 0.0, 0.0]), np.array([0.0, -0.5, 0.0]))
    for quality in ("fast", "standard"):
        settings = ideal.model_copy(update={"quality": quality})
        light, _ = radiance(gl, replace(card().build(DOWN[None]), sphere_lights=(lamp,)), settings)
        assert light[60, 80].max() < 1e-6


def test_a_small_far_panel_is_a_ball(gl: Gl, ideal: RenderSettings) -> None:
    """From far away, a panel straight above shades as a ball of the same intensity does, shine and all."""
    center = np.array([0.0, 0.0, 60.0])
    lamp = panel(center, np.array([0.3, 0.0, 0.0]), np.array([0.0, 0.3, 0.0]))
    round_one = replace(lamp, sides=None)
    scene = card().build(DOWN[None])
    settings = ideal.model_copy(update={"quality": "standard"})
    shown = [radiance(gl, replace(scene, sphere_lights=(one,)), settings)[0] for one in (lamp, round_one)]
    np.testing.assert_allclose(*shown, rtol=0.02, atol=1e-6)


def test_balls_keep_their_shader() -> None:
    """Without a panel nothing more is compiled; with one, balls beside it shine as before."""
    box = (np.full(3, -1.0), np.full(3, 1.0))
    lamp = panel(np.array([0.0, 0.0, 2.0]), np.array([0.5, 0.0, 0.0]), np.array([0.0, 0.5, 0.0]))
    scene = replace(card().build(DOWN[None]), sphere_lights=(ball((0, 0, 3), 0.3, 1.0),))
    assert choose_local_lights(scene, box)[0].features() == ("LOCAL_LIGHTS 1",)
    both = replace(scene, sphere_lights=(*scene.sphere_lights, lamp))
    chosen, _ = choose_local_lights(both, box)
    assert chosen.features() == ("LOCAL_LIGHTS 2", "LOCAL_PANELS")
    assert chosen.sides[0].tolist() == [[0, 0, 0], [0, 0, 0]]


def test_a_ball_beside_a_panel(gl: Gl, ideal: RenderSettings) -> None:
    """The light of both is the sum of each alone."""
    lamp = panel(np.array([1.0, 0.0, 2.0]), np.array([0.5, 0.0, 0.0]), np.array([0.0, 0.5, 0.0]))
    other = ball((-1.0, 0.0, 2.0), 0.3, 1.0)
    scene = card().build(DOWN[None])
    settings = ideal.model_copy(update={"quality": "fast"})
    one, two, both = (
        radiance(gl, replace(scene, sphere_lights=some), settings)[0] for some in ((lamp,), (other,), (lamp, other))
    )
    np.testing.assert_allclose(both, one + two, rtol=3e-3, atol=1e-4)
