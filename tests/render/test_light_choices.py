"""What light is chosen and fitted before anything is drawn: lamps by what they give, haze that is nowhere black."""

from dataclasses import replace

import numpy as np

from render.light.daylight import _fit_haze, glow
from render.light.local_lights import MOST, choose_local_lights
from tests.render.scenes import DOWN, SceneBuilder
from usd_schemas.flat_scene import SphereLight


def test_lamps_are_ranked_by_what_the_box_gets_of_them() -> None:
    """Strength over the square of distance and half diagonal: a weaker lamp in the middle beats one 9 m away."""
    box = (np.array([-6.0, -8.0, 0.0]), np.array([6.0, 8.0, 0.0]))  # 10 m from the middle to a corner
    strong = [SphereLight((1.0 + 0.1 * row, 0.0, 0.0), 0.1, (3.0, 3.0, 3.0)) for row in range(MOST - 1)]
    weak, near = SphereLight((9.0, 0.0, 0.0), 0.1, (0.5, 0.5, 0.5)), SphereLight((0.0, 0.0, 0.0), 0.1, (0.4, 0.3, 0.3))
    builder = SceneBuilder()
    builder.add_mesh(np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]), np.eye(4), 1)
    scene = replace(builder.build(DOWN[None]), sphere_lights=(weak, *strong, near))
    lights, said = choose_local_lights(scene, box)
    assert len(lights.positions) == MOST
    np.testing.assert_array_equal(lights.positions[-1], near.position)
    assert (lights.positions[:, 0] < 9.0).all()
    assert len(said) == 1
    assert said[0].startswith("1 of ")


def test_haze_is_a_fifth_of_its_mean_where_it_is_darkest() -> None:
    """A fit that would be darker, or negative, opposite the sun is drawn towards the mean, each color for itself."""
    azimuth = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    around = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(64)])
    sun = np.array([0.98, 0.0, np.sqrt(1.0 - 0.98**2)])
    bright = np.maximum(around[:, 0], 0.0)[:, None] ** np.array([1.0, 2.0, 8.0]) + np.array([0.0, 0.1, 0.0])
    fitted = _fit_haze(around, bright, sun)
    ends = np.linspace(-1.0, 1.0, 41)
    found = np.column_stack([np.ones(41), ends, glow(ends)]) @ fitted
    mean = bright.mean(axis=0)
    plain = np.linalg.lstsq(np.column_stack([np.ones(64), around @ sun, glow(around @ sun)]), bright, rcond=None)[0]
    darkest = (np.column_stack([np.ones(41), ends, glow(ends)]) @ plain).min(axis=0)
    assert (darkest < 0.2 * mean).any()
    np.testing.assert_allclose(found.min(axis=0), np.maximum(darkest, 0.2 * mean), rtol=1e-9)
