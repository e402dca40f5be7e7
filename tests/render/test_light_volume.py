"""The light volume: how much sky and bounced light reaches a place, by closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.light.daylight import irradiance_coefficients, read_daylight, sphere
from render.light.half_axes import COUNT, HALF_AXES, MEAN, project, weigh
from render.light.light_volume import Sampling, cast_light_volume
from render.light.surface_fit import Places, fit_to_surfaces, look_up_matrix, spread_places
from render.light.tracing import LightTracer
from tests.render.scenes import DOWN, WHITE_DOME, SceneBuilder, placed
from usd_schemas.flat_scene import Material, Sun

F64 = NDArray[np.float64]


def test_a_wall_hides_half_the_sky(gl: Gl) -> None:
    """At the foot of a long black wall the light volume holds half the irradiance of the open dome."""
    builder = SceneBuilder(materials=[Material("black", base_color=(0.0, 0.0, 0.0))])
    builder.add_box(placed((0.0, 0.5, 200.0), (800.0, 1.0, 400.0)), 1, label=1)
    builder.add_box(placed((0.0, 0.0, -0.5), (300.0, 300.0, 1.0)), 2, label=1)
    scene = replace(builder.build(DOWN[None]), dome=WHITE_DOME)
    light, _ = read_daylight(scene)
    box = (np.array([-2.0, -2.0, 0.0]), np.array([2.0, 2.0, 2.0]))
    volume = cast_light_volume(scene, light, np.zeros((1, 3)), box, Sampling(3000, 256), SILENT)
    probe, inside = volume.nearest(np.array([[0.0, -0.6, 0.6]]))
    assert inside.all()
    upwards = volume.coefficients.reshape(-1, COUNT, 3)[probe[0], 4]
    np.testing.assert_allclose(upwards, np.pi / 2, rtol=0.1)


def test_a_lit_side_does_not_shine_through_a_thin_slab(gl: Gl) -> None:
    """Under a wide slab of 10 cm, on black ground and under a white dome, it is as dark as rays say; above, as bright.

    As probes were cast, the soffit has twice the light that is allowed here.
    """
    builder = SceneBuilder(materials=[Material("black", base_color=(0.0, 0.0, 0.0))])
    builder.add_box(placed((0.0, 0.0, 1.52), (24.0, 24.0, 0.1)), 1, label=1)
    builder.add_box(placed((0.0, 0.0, -0.5), (300.0, 300.0, 1.0)), 2)
    scene = replace(builder.build(DOWN[None]), dome=WHITE_DOME)
    light, _ = read_daylight(scene)
    box = (np.array([-12.0, -12.0, 1.4]), np.array([12.0, 12.0, 1.6]))
    volume = cast_light_volume(scene, light, np.zeros((1, 3)), box, Sampling(3000, 64), SILENT)
    assert volume.cell > 0.8  # the slab lies between two layers of probes
    side = np.linspace(-8.0, 8.0, 17)
    level = np.column_stack([*(axis.ravel() for axis in np.meshgrid(side, side)), np.zeros(17 * 17)])
    for height, up, expected, slack in ((1.57, 1.0, np.pi, 0.12 * np.pi), (1.47, -1.0, 0.0, 0.06)):
        places = Places(level + np.array([0.0, 0.0, height]), np.tile([0.0, 0.0, up], (len(level), 1)))
        matrix, inside = look_up_matrix(volume.coefficients.shape[2::-1], volume.lower, volume.cell, places)
        assert inside.all()
        found = matrix @ volume.coefficients.reshape(-1, 3).astype(np.float64)
        assert np.abs(found - expected).max() < slack, f"at {height} m"


def test_gaps_and_edges_of_a_thin_slab_have_the_light_that_rays_find(gl: Gl) -> None:
    """On a pier cap 25 cm below a slab, on the soffit over it, at the slab's edges and on top, all black.

    The cap has a hundredth of the open sky's light. Read one cell over it, with no position in the gap, it had nine
    tenths.
    """
    builder = SceneBuilder(materials=[Material("black", base_color=(0.0, 0.0, 0.0))])
    builder.add_box(placed((0.0, 0.0, 3.0), (8.0, 6.0, 0.5)), 1, label=1)
    builder.add_box(placed((0.0, 0.0, 2.0), (1.4, 6.0, 1.0)), 2, label=1)
    builder.add_box(placed((0.0, 0.0, -0.5), (300.0, 300.0, 1.0)), 3)
    scene = replace(builder.build(DOWN[None]), dome=WHITE_DOME)
    light, _ = read_daylight(scene)
    box = (np.array([-4.0, -3.0, 1.5]), np.array([4.0, 3.0, 3.25]))
    volume = cast_light_volume(scene, light, np.zeros((1, 3)), box, Sampling(4000, 64), SILENT)
    tracer, rays = LightTracer(scene, light, np.zeros((1, 3))), sphere(1024)
    for across, height, normal in (
        ((-0.5, 0.5), 2.5, (0.0, 0.0, 1.0)),  # top of the cap
        ((-0.5, 0.5), 2.75, (0.0, 0.0, -1.0)),  # soffit over it
        ((3.7, 3.95), 2.75, (0.0, 0.0, -1.0)),  # soffit at the edge
        ((4.0, 4.0), 3.0, (1.0, 0.0, 0.0)),  # face of the edge
        ((-3.9, 3.9), 3.25, (0.0, 0.0, 1.0)),  # top of the slab
    ):
        x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(*across, 9), np.linspace(-2.0, 2.0, 9)))
        places = Places(np.column_stack([x, y, np.full(81, height)]), np.tile(normal, (81, 1)))
        aims = np.array(normal) + 0.9999 * rays
        aims = np.tile(aims / np.linalg.norm(aims, axis=1, keepdims=True), (81, 1))
        starts = np.repeat(places.position + 0.004 * places.normal, len(rays), axis=0)
        wanted = np.pi * tracer.trace(starts, aims)[0].reshape(81, -1, 3).mean(axis=1)
        matrix, inside = look_up_matrix(volume.coefficients.shape[2::-1], volume.lower, volume.cell, places)
        assert inside.all()
        found = np.maximum(matrix @ volume.coefficients.reshape(-1, 3).astype(np.float64), 0)
        np.testing.assert_allclose(found, wanted, atol=0.05 * np.pi, err_msg=str((across, height)))


@pytest.mark.parametrize(("specular", "mirrored"), [(None, 0.025), ((0.0,) * 3, 0.0), ((0.02, 0.02, 0.02), 0.0125)])
def test_a_soffit_has_the_color_of_the_ground_below(
    specular: tuple[float, float, float] | None, mirrored: float
) -> None:
    """Rays down to sunlit turf bring its albedo times sun over pi, and what its shine adds: nothing if it is matt."""
    albedo, sun = np.array([[0.06, 0.08, 0.036]]), np.array([3.0, 2.5, 2.0])
    builder = SceneBuilder(materials=[Material("turf", specular=specular)])
    builder.add_box(placed((0.0, 0.0, -0.5), (300.0, 300.0, 1.0)), 1)
    scene = replace(builder.build(DOWN[None]), sun=Sun((0.0, 0.0, 1.0), (3.0, 2.5, 2.0)))
    tracer = LightTracer(scene, read_daylight(scene)[0], albedo)
    found, hits = tracer.trace(np.array([[0.0, 0.0, 4.0]]), np.array([[0.0, 0.0, -1.0]]))
    wanted = albedo + mirrored * (1 - albedo)
    np.testing.assert_allclose(hits.albedo, wanted, rtol=1e-5)
    np.testing.assert_allclose(found, wanted * sun / np.pi, rtol=1e-5)


def test_values_by_half_axis_are_exact_for_the_first_bands_of_light() -> None:
    """Radiance of the first two bands: the irradiance is that of spherical harmonics, for normals at all angles."""
    rng = np.random.default_rng(6)
    directions, normals = sphere(20000), sphere(50)
    slope = rng.standard_normal((3, 3))
    radiance = (2.0 + directions @ slope)[None].astype(np.float32)
    c = irradiance_coefficients(directions, radiance)[0]
    number, weight = weigh(normals)
    found = np.einsum("nk,nkc->nc", weight, project(directions, radiance)[0][number])
    np.testing.assert_allclose(found, c[0] + normals @ c[1:], atol=0.01)


def test_opposite_normals_share_only_the_mean() -> None:
    """And along an axis it does not count: light on one side of a slab changes nothing on the other."""
    normals = sphere(50)
    for one, other in zip(weigh(normals)[0], weigh(-normals)[0], strict=True):
        assert set(one) & set(other) == {MEAN}
    for axis in HALF_AXES:
        assert weigh(axis[None])[1][0].tolist()[MEAN // 2] == 0.0


def test_places_are_spread_by_area_whichever_way_surfaces_face() -> None:
    """Of two equal boxes one lies along the axes and one is turned: each face has its share of the places."""
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    builder = SceneBuilder(materials=[Material("plain")])
    for number, way in enumerate((np.eye(3), turn * np.linalg.det(turn))):
        pose = placed((20.0 * number, 0.0, 0.0))
        pose[:3, :3] = way @ np.diag([4.0, 2.0, 1.0])
        builder.add_box(pose, number + 1, label=1)
    scene = replace(builder.build(DOWN[None]), dome=WHITE_DOME)
    tracer = LightTracer(scene, read_daylight(scene)[0], np.zeros((1, 3)))
    places = spread_places(tracer, np.full(3, -9.0), np.full(3, 29.0), 30_000)
    for number, way in enumerate((np.eye(3), turn)):
        mine = (places.position[:, 0] > 10.0) == bool(number)
        share = np.bincount(np.abs(places.normal[mine] @ way).argmax(axis=1), minlength=3) / len(mine)
        np.testing.assert_allclose(share, np.array([1.0, 2.0, 4.0]) / 14.0, atol=0.01)


def test_few_rays_make_no_surface_darker() -> None:
    """Of places whose few rays met either much light or little, the second fit finds the mean, and the first less."""
    rng = np.random.default_rng(5)
    position = rng.uniform(2.0, 6.0, (4000, 3))
    normal = np.tile([0.0, 0.0, -1.0], (len(position), 1))
    irradiance = np.where(rng.random((len(position), 1)) < 0.25, 1.0, 0.1).astype(np.float32) * np.ones(
        (1, 3), np.float32
    )
    places, mean = Places(position, normal), float(irradiance.mean())
    probed = np.full((9, 9, 9, COUNT, 3), mean, np.float32)
    matrix, _ = look_up_matrix((9, 9, 9), np.zeros(3), 1.0, places)
    first = fit_to_surfaces(probed, np.zeros(3), 1.0, places, irradiance)
    second = fit_to_surfaces(probed, np.zeros(3), 1.0, places, irradiance, first)
    found = [float((matrix @ fit.reshape(-1, 3).astype(np.float64)).mean()) for fit in (first, second)]
    assert found[0] < 0.8 * mean
    assert found[1] == pytest.approx(mean, rel=0.05)


def test_coefficients_of_half_a_dome() -> None:
    """A uniform half dome gives pi * (1 + cos) / 2 exactly, in every direction."""
    directions = sphere(20000)
    radiance_up = np.repeat((directions[:, 2] > 0).astype(float)[:, None], 3, axis=1)
    rows = irradiance_coefficients(directions, radiance_up[None])[0]
    np.testing.assert_allclose(rows[0], np.pi / 2, rtol=1e-3)
    np.testing.assert_allclose(rows[3], np.pi / 2, rtol=1e-3)
    np.testing.assert_allclose(rows[1:3], 0, atol=1e-3)


def test_directions_spread_evenly_over_the_sphere() -> None:
    """Unit vectors whose first two moments are those of the sphere."""
    directions = sphere(4096)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(directions.mean(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(directions.T @ directions / len(directions), np.eye(3) / 3.0, atol=1e-3)
