"""Radiance in closed form: Lambert's law, the sun's shadow against a ray caster, the light volume, textures."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.light.daylight import LightSettings, bake_light
from authoring.light.sun import LUMINANCE
from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.light.daylight import read_daylight, sphere
from render.light.illumination import BRIGHTEST, CLEAR_DAY, Illumination, Lamps, haze_distance
from render.light.local_lights import LocalLights
from render.settings import RenderSettings
from render.views.prepare import prepare
from tests.conftest import Count
from tests.render.scenes import CAMERA, DOWN, WHITE_DOME, SceneBuilder, placed
from usd_schemas.flat_scene import Detail, Dome, FlatScene, Material, Sun, Texture, world_triangles
from usd_schemas.pinhole import look_at, unproject
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]

SQUARE = np.array([[[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0]], [[-0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]])


def radiance(gl: Gl, scene: FlatScene, settings: RenderSettings) -> tuple[F64, F64]:
    """Draw the first pose: linear radiance (H, W, 3) and depth (H, W)."""
    prepared = prepare(gl, scene, settings, SILENT)
    view = prepared.painter(CAMERA, sharp=True).draw(scene.cameras[0].poses[0], 0.1)
    return (view.code.astype(np.float64) / 65535) ** 2 * BRIGHTEST, view.depth.astype(np.float64)


def plate(material: Material, size: float = 20.0) -> SceneBuilder:
    """Start a scene with a level plate at z = 0; st runs from 0 to 1 over it."""
    builder = SceneBuilder(materials=[material])
    builder.add_mesh(SQUARE, placed((0, 0, 0), (size, size, 1.0)), 1, st=SQUARE[..., :2] + 0.5)
    return builder


@pytest.mark.parametrize("quality", ["fast", "standard", "fine"])
def test_gray_card_under_a_white_dome(gl: Gl, ideal: RenderSettings, quality: str) -> None:
    """Irradiance of a uniform dome is pi times its radiance: the card's radiance is its albedo."""
    scene = plate(Material("card", base_color=(0.18, 0.36, 0.72), roughness=1.0)).build(DOWN[None])
    scene = replace(scene, dome=WHITE_DOME)
    settings = ideal.model_copy(update={"quality": quality})
    light, _ = radiance(gl, scene, settings)
    # Beyond `fast`, a dielectric mirrors another 4 %, and two bands see a little of the dome below the edge.
    gloss, tolerance = (0.0, 0.002) if quality == "fast" else (0.04, 0.03)
    np.testing.assert_allclose(light[60, 80], np.array([0.18, 0.36, 0.72]) + gloss, rtol=tolerance)


def test_lambert_cosine_of_the_sun(gl: Gl, ideal: RenderSettings) -> None:
    """Radiance is albedo * E_sun * cos / pi for a sun at any height."""
    settings = ideal.model_copy(update={"quality": "fast"})
    for height in (15.0, 40.0, 90.0):
        rise = np.deg2rad(height)
        scene = plate(Material("card", base_color=(0.5, 0.5, 0.5))).build(DOWN[None])
        scene = replace(scene, sun=Sun((float(np.cos(rise)), 0.0, float(np.sin(rise))), (3.0, 2.0, 1.0)))
        light, _ = radiance(gl, scene, settings)
        np.testing.assert_allclose(light[60, 80], 0.5 * np.array([3.0, 2.0, 1.0]) * np.sin(rise) / np.pi, rtol=2e-3)


@pytest.mark.parametrize("height", [2.0, 30.0, 90.0])
def test_a_matt_surface_mirrors_nothing(gl: Gl, ideal: RenderSettings, height: float) -> None:
    """From any height, also towards a low sun, it has the radiance of Lambert's law: all qualities agree with it.

    With the shine of a dielectric, turf seen at 2 degrees towards the sun is several times as bright.
    """
    albedo, sun = np.array([0.06, 0.08, 0.036]), np.array([3.0, 2.0, 1.0])
    material = Material("turf", base_color=(0.06, 0.08, 0.036), roughness=0.9, specular=(0.0, 0.0, 0.0))
    rise = np.deg2rad(height)
    eye = 8.0 * np.array([-np.cos(rise), 0.0, np.sin(rise)])
    scene = plate(material, 400.0).build(look_at(eye, np.zeros(3), np.array([0.0, 1.0, 0.1]))[None])
    scene = replace(scene, sun=Sun((0.94, 0.0, 0.342), (3.0, 2.0, 1.0)), dome=Dome((0.0, 0.0, 0.0)))
    expected = albedo * sun * 0.342 / np.hypot(0.94, 0.342) / np.pi
    for quality in ("fast", "standard"):
        light, _ = radiance(gl, scene, ideal.model_copy(update={"quality": quality}))
        np.testing.assert_allclose(light[60, 80], expected, rtol=5e-3)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (5.0e5, 4.6e6, 30.0)])
@pytest.mark.parametrize(("quality", "tolerance"), [("fast", 0.02), ("standard", 0.1)])
def test_shadows_fall_where_the_ray_caster_says(
    gl: Gl, ideal: RenderSettings, offset: tuple[float, float, float], quality: str, tolerance: float
) -> None:
    """Lit and shaded pixels agree with rays towards the sun: no acne, no shadow torn off its object."""
    builder = SceneBuilder(materials=[Material("card", base_color=(0.1, 0.1, 0.1), roughness=1.0)])
    builder.add_box(placed((offset[0], offset[1], offset[2] - 0.5), (40, 40, 1)), 1)
    builder.add_box(placed((offset[0], offset[1], offset[2] + 1), (1, 1, 2), 0.4), 2)
    builder.add_box(placed((offset[0] - 2, offset[1] + 1, offset[2] + 2), (-3, 0.3, 0.2)), 3)
    pose = look_at(np.array([4.0, -5.0, 6.0]) + offset, np.array(offset))
    sun = np.array([-0.5, -0.4, 0.6]) / np.linalg.norm([-0.5, -0.4, 0.6])
    scene = replace(builder.build(pose[None]), sun=Sun((sun[0], sun[1], sun[2]), (15.0, 15.0, 15.0)))
    settings = ideal.model_copy(update={"shadow_size": 4096, "quality": quality})
    light, depth = radiance(gl, scene, settings)
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width] + 0.5
    seen = np.isfinite(depth)
    points = unproject(np.column_stack([u[seen], v[seen]]), depth[seen], CAMERA, pose)
    corners, ids, rows = world_triangles(scene)
    tracer = RayScene(corners, ids)
    _, triangle = tracer.distance(points)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[triangle]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.where(np.linalg.det(scene.draws.transform[:, :3, :3])[rows[triangle]] < 0, -1, 1)[:, None]
    free, _, _ = tracer.cast(points + 1e-3 * normal, np.broadcast_to(sun, points.shape))
    lit = np.zeros(depth.shape, bool)
    lit[seen] = np.isinf(free) & (normal @ sun > 0)
    sure = seen.copy()
    for shift in (-2, -1, 1, 2):
        for axis in (0, 1):
            sure &= np.roll(lit, shift, axis) == lit
    expected = np.zeros(depth.shape)
    expected[seen] = 0.1 * 15.0 / np.pi * np.maximum(normal @ sun, 0)
    error = np.abs(light[..., 1] - expected * lit)
    assert 0.05 < lit[seen].mean() < 0.98
    assert np.mean(error[sure] < tolerance) > 0.999


def test_a_stage_without_light_gets_a_day(gl: Gl, ideal: RenderSettings) -> None:
    """Neither black nor silent."""
    scene = plate(Material("card")).build(DOWN[None])
    prepared = prepare(gl, scene, ideal, SILENT)
    assert any("default sun and sky" in line for line in prepared.warnings)
    light, _ = radiance(gl, scene, ideal)
    assert 0.1 < light[60, 80, 1] < 2.0


def test_the_default_day_is_bright_at_its_horizon() -> None:
    """Blue overhead, pale at the horizon, dark below it, down to the nadir itself."""
    day, _ = read_daylight(plate(Material("card")).build(DOWN[None]))
    height = np.array([1.0, 0.5, 0.2, 0.02, -0.02, -0.5, -1.0])
    seen = day.radiance(np.stack([np.sqrt(1.0 - height**2), 0.0 * height, height], axis=1))
    zenith, horizon, ground = (0.16, 0.28, 0.55), (0.55, 0.66, 0.80), (0.13, 0.13, 0.11)
    np.testing.assert_allclose(seen[0], zenith, atol=0.01)
    np.testing.assert_allclose(seen[3], horizon, rtol=0.1)
    assert (np.diff(seen[:4], axis=0) > 0.0).all()
    np.testing.assert_allclose(seen[4:], np.tile(ground, (3, 1)), rtol=1e-6)


def test_a_picture_as_dome_is_decoded_from_srgb(tmp_path: Path) -> None:
    """Codes 5, 10, 11 and 188 are the radiance of IEC 61966-2-1, all around; in 8 or 16 bits, gray or color."""
    scene, file = plate(Material("card")).build(DOWN[None]), tmp_path / "sky.png"
    for code, linear in ((5, 0.001517635), (10, 0.003035270), (11, 0.003346536), (188, 0.502886458)):
        for pixels in (np.full((8, 16, 3), code, np.uint8), np.full((8, 16, 4), code * 257, np.uint16)):
            for told in (pixels, pixels[..., 0]):
                cv2.imwrite(str(file), told)
                day, warnings = read_daylight(replace(scene, dome=Dome((1.0, 1.0, 1.0), str(file))))
                assert warnings == []
                np.testing.assert_allclose(day.radiance(sphere(64)), linear, rtol=1e-4)


def test_every_texel_of_a_dome_is_seen_in_its_own_direction(tmp_path: Path) -> None:
    """Latitude and longitude: +y is the first row, +z the middle column, +x a quarter before it; large ones shrink."""
    rows, columns = 6, 12
    theta = (np.arange(rows) + 0.5) / rows * np.pi
    phi = np.pi - (np.arange(columns) + 0.5) / columns * 2.0 * np.pi
    polar, around = np.meshgrid(theta, phi, indexing="ij")
    own = np.stack([np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], axis=-1)
    texels = np.random.default_rng(0).integers(20, 255, (rows, columns, 3)).astype(np.uint8)
    linear = ((texels[..., ::-1] / 255 + 0.055) / 1.055) ** 2.4
    file = tmp_path / "sky.png"
    for times in (1, 100):  # 600 rows are more than the 512 that are kept
        cv2.imwrite(str(file), np.kron(texels, np.ones((times, times, 1), np.uint8)))
        scene = replace(plate(Material("card")).build(DOWN[None]), dome=Dome((1.0, 1.0, 1.0), str(file)))
        day, warnings = read_daylight(scene)
        assert warnings == []
        assert day.panorama.shape == ((6, 12, 3) if times == 1 else (512, 1024, 3))
        seen = day.radiance(own.reshape(-1, 3) @ day.dome_from_world)
        np.testing.assert_allclose(seen, linear.reshape(-1, 3), rtol=1e-4)


def test_a_bright_texel_of_a_dome_stays_finite(gl: Gl) -> None:
    """9e4 is more than a half float holds: the texel and what the smaller levels make of it are finite."""
    day, _ = read_daylight(replace(plate(Material("card")).build(DOWN[None]), dome=WHITE_DOME))
    panorama = np.ones((8, 16, 3), np.float32)
    panorama[3, 3] = 9.0e4
    none = LocalLights(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 2, 3)))
    lamps = Lamps(gl.context, Illumination(replace(day, panorama=panorama), None, None, CLEAR_DAY, none), np.zeros(3))
    levels = [np.frombuffer(lamps._panorama.read(level=level), np.float16) for level in range(4)]
    assert all(np.isfinite(level).all() for level in levels)


def test_a_dome_without_its_file_is_told_and_drawn_plain(tmp_path: Path) -> None:
    """One warning that names the file; the sky has the dome's own radiance everywhere."""
    dome = Dome((0.5, 1.0, 2.0), str(tmp_path / "gone.exr"))
    day, warnings = read_daylight(replace(plate(Material("card")).build(DOWN[None]), dome=dome))
    assert len(warnings) == 1
    assert "gone.exr" in warnings[0]
    np.testing.assert_allclose(day.radiance(sphere(64)), np.tile(dome.radiance, (64, 1)))


def write_quadrants(path: Path) -> None:
    """Write red over green on the left, blue over white on the right."""
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32, :32], pixels[32:, :32], pixels[:32, 32:], pixels[32:, 32:] = (
        (255, 0, 0),
        (0, 255, 0),
        (0, 0, 255),
        (255, 255, 255),
    )
    cv2.imwrite(str(path), pixels[..., ::-1])


def test_textures_stand_upright(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """(0, 1) of USD's st is the upper left corner of the picture; placements follow UsdTransform2d."""
    write_quadrants(tmp_path / "q.png")
    red, green, blue = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    settings = ideal.model_copy(update={"quality": "fast"})
    for texture, upper_left, lower_left, upper_right in (
        (Texture(str(tmp_path / "q.png"), True), red, green, blue),
        (Texture(str(tmp_path / "q.png"), True, rotation=90.0), green, (1, 1, 1), red),
        (Texture(str(tmp_path / "q.png"), True, translation=(0.5, 0.0)), blue, (1, 1, 1), red),
        (Texture(str(tmp_path / "q.png"), True, scale=(-1.0, 1.0)), blue, (1, 1, 1), red),
    ):
        scene = plate(Material("card", base_texture=texture), 6.0).build(DOWN[None])
        light, _ = radiance(gl, replace(scene, dome=WHITE_DOME), settings)
        for row, column, expected in ((40, 60, upper_left), (80, 60, lower_left), (40, 100, upper_right)):
            np.testing.assert_allclose(light[row, column] / 0.95, expected, atol=0.06)


def test_colors_detail_and_macro_are_the_documented_factors(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """SRGB 188 is half of white; detail multiplies by 1 + a (2 g - 1) per octave; macro by 2 g."""
    for name, value in (("half", 188), ("detail", 255), ("macro", 64)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((16, 16, 3), value, np.uint8))
    detail = Detail(str(tmp_path / "detail.png"), (1.0, 0.3), (0.2, 0.1), str(tmp_path / "macro.png"))
    base = Texture(str(tmp_path / "half.png"), True)
    scene = plate(Material("card", base_texture=base, detail=detail)).build(DOWN[None])
    light, _ = radiance(gl, replace(scene, dome=WHITE_DOME), ideal.model_copy(update={"quality": "fast"}))
    np.testing.assert_allclose(light[60, 80], 0.5 * 1.2 * 1.1 * 128 / 255, rtol=0.02)


def test_raw_colors_channels_and_gains_of_textures(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """A linear picture is not decoded; a gain and a bias act on linear values."""
    cv2.imwrite(str(tmp_path / "tint.png"), np.full((16, 16, 3), (51, 102, 204), np.uint8)[..., ::-1])
    told = np.array([51, 102, 204]) / 255
    decoded = ((told + 0.055) / 1.055) ** 2.4
    for texture, expected in (
        (Texture(str(tmp_path / "tint.png"), False), told),
        (Texture(str(tmp_path / "tint.png"), True), decoded),
        (
            Texture(str(tmp_path / "tint.png"), True, gain=(1.0, 0.5, 0.25), bias=(0.1, 0.0, 0.2)),
            decoded * [1.0, 0.5, 0.25] + [0.1, 0.0, 0.2],
        ),
    ):
        scene = plate(Material("card", base_texture=texture)).build(DOWN[None])
        light, _ = radiance(gl, replace(scene, dome=WHITE_DOME), ideal.model_copy(update={"quality": "fast"}))
        np.testing.assert_allclose(light[60, 80], expected, rtol=0.02)


@pytest.mark.parametrize("quality", ["fast", "standard", "fine"])
def test_metallic_is_looked_up_where_the_texture_says(
    gl: Gl, ideal: RenderSettings, tmp_path: Path, quality: str
) -> None:
    """Under a white dome a metal mirrors its own color and has no gloss beside it; a dielectric has 4 % more.

    Left half metal, right half paint, in the blue channel of a picture whose red and green say the opposite. `fast`
    takes the mean, in which half of the diffuse light is lost.
    """
    pixels = np.full((64, 64, 3), 255, np.uint8)
    pixels[:, :32, :2], pixels[:, 32:, 2] = 0, 0
    cv2.imwrite(str(tmp_path / "orm.png"), pixels[..., ::-1])
    metal = Texture(str(tmp_path / "orm.png"), False, channel=2)
    card = Material("card", base_color=(0.2, 0.4, 0.6), roughness=1.0, metallic_texture=metal)
    light, _ = radiance(
        gl, replace(plate(card).build(DOWN[None]), dome=WHITE_DOME), ideal.model_copy(update={"quality": quality})
    )
    color = np.array([0.2, 0.4, 0.6])
    left, right = (color / 2, color / 2) if quality == "fast" else (color, color + 0.04)
    np.testing.assert_allclose(light[60, 60], left, rtol=0.04)
    np.testing.assert_allclose(light[60, 100], right, rtol=0.04)


def test_edges_of_triangles_are_as_sharp_as_their_middle(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """A plate of 800 triangles looks like one of two: no pixel beside an edge takes a coarser level of a texture."""
    cv2.imwrite(str(tmp_path / "halves.png"), np.repeat(np.array([[30] * 128 + [220] * 128], np.uint8), 256, axis=0))
    cv2.imwrite(str(tmp_path / "grain.png"), np.random.default_rng(5).integers(0, 255, (64, 64)).astype(np.uint8))
    detail = Detail(str(tmp_path / "grain.png"), (0.25,), (0.8,))
    for uv_set in (0, 1):
        base = Texture(str(tmp_path / "halves.png"), True, uv_set=uv_set)
        material = Material("card", base_texture=base, detail=detail)
        shown = []
        for pieces in (1, 20):
            low = np.stack(np.meshgrid(np.arange(pieces), np.arange(pieces)), -1).reshape(-1, 1, 1, 2)
            st = ((SQUARE[..., :2] + 0.5)[None] + low).reshape(-1, 3, 2) / pieces
            builder = SceneBuilder(materials=[material])
            builder.add_mesh(np.dstack([st - 0.5, np.zeros(st.shape[:2])]), placed((0, 0, 0), (9, 9, 1.0)), 1, st=st)
            scene = builder.build(DOWN[None])
            geometry = replace(scene.geometry, st1=scene.geometry.st)
            scene = replace(scene, geometry=geometry, dome=WHITE_DOME)
            shown.append(radiance(gl, scene, ideal.model_copy(update={"quality": "fast"}))[0])
        assert shown[0].std() > 0.1
        np.testing.assert_allclose(shown[0], shown[1], atol=0.01)


def test_a_missing_texture_is_told_and_drawn_gray(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """One warning that names the file; the constant color stays."""
    texture = Texture(str(tmp_path / "gone.png"), True)
    scene = plate(Material("card", base_color=(0.4, 0.4, 0.4), base_texture=texture)).build(DOWN[None])
    scene = replace(scene, dome=WHITE_DOME)
    assert [line for line in prepare(gl, scene, ideal, SILENT).warnings if "gone.png" in line]
    light, _ = radiance(gl, scene, ideal.model_copy(update={"quality": "fast"}))
    np.testing.assert_allclose(light[60, 80], 0.4, rtol=0.01)


def test_cut_outs_open_color_depth_and_shadow(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """Where the texture is transparent, the plate behind is seen, measured and lit."""
    pixels = np.zeros((64, 64, 4), np.uint8)  # black: it throws nothing back on what is below it
    pixels[:, 32:, 3] = 255
    cv2.imwrite(str(tmp_path / "leaf.png"), pixels)
    leaf = Material("leaf", base_texture=Texture(str(tmp_path / "leaf.png"), True), opacity_threshold=0.5)
    for quality in ("standard", "fine"):
        builder = plate(Material("ground", base_color=(0.5, 0.5, 0.5), roughness=1.0))
        builder.materials.append(leaf)
        builder.add_mesh(SQUARE, placed((0, 0, 2), (4, 4, 1)), 2, material=1, st=SQUARE[..., :2] + 0.5)
        scene = replace(builder.build(DOWN[None]), sun=Sun((0.0, 0.0, 1.0), (3.0, 3.0, 3.0)))
        light, depth = radiance(gl, scene, ideal.model_copy(update={"quality": quality}))
        assert depth[60, 60] == pytest.approx(8.0, rel=1e-6)
        assert depth[60, 100] == pytest.approx(6.0, rel=1e-6)
        np.testing.assert_allclose(light[60, 60], 0.5 * 3 / np.pi, rtol=0.15)


@pytest.mark.parametrize("cover", [0.0, 1.0])
def test_gray_card_under_our_own_day(
    gl: Gl, ideal: RenderSettings, tmp_path: Path, cover: float, proof_count: Count
) -> None:
    """A level card of 18 % gray has radiance 0.18 under the light that a scene gets, clear or overcast."""
    settings = LightSettings(cloud_cover=cover, sky_height=proof_count(128, 512))
    lighting = bake_light(settings, tmp_path, np.random.default_rng(4))
    upright = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
    dome = Dome((1.0, 1.0, 1.0), str(tmp_path / lighting.sky_file), upright)
    scene = plate(Material("card", base_color=(0.18, 0.18, 0.18), roughness=1.0)).build(DOWN[None])
    scene = replace(scene, dome=dome, sun=Sun(lighting.sun_direction, lighting.sun_irradiance))
    light, _ = radiance(gl, scene, ideal.model_copy(update={"quality": "fast"}))
    assert light[60, 80] @ LUMINANCE == pytest.approx(0.18, rel=0.03)


def test_haze_follows_the_visibility_of_the_stage(gl: Gl, ideal: RenderSettings) -> None:
    """At the visibility 2 % of the contrast is left, at half of it the root; what the settings say goes before."""
    settings = ideal.model_copy(update={"quality": "fast", "haze_distance": None})
    scene = replace(plate(Material("black", base_color=(0.0, 0.0, 0.0)), 4.0).build(DOWN[None]), dome=WHITE_DOME)
    for visibility, share in ((8.0, 0.02), (16.0, 0.02**0.5)):
        light, depth = radiance(gl, replace(scene, visibility=visibility), settings)
        assert depth[60, 80] == pytest.approx(8.0, rel=1e-3)
        np.testing.assert_allclose(light[60, 80, 1], 1.0 - share, rtol=3e-3)
        assert light[60, 80, 0] < light[60, 80, 1] < light[60, 80, 2]  # air holds back blue more than red
    assert haze_distance(scene, settings) == CLEAR_DAY
    assert haze_distance(replace(scene, visibility=100.0), ideal) == ideal.haze_distance


@pytest.mark.parametrize("height", [1.5, 3.0, 5.0, 8.0])
@pytest.mark.parametrize("quality", ["fast", "standard"])
def test_a_plane_that_rays_graze_has_no_stripes(height: float, quality: str, gl: Gl, ideal: RenderSettings) -> None:
    """Open ground under a sun near the horizon is lit evenly: it does not shade itself."""
    low = np.deg2rad(height)
    scene = plate(Material("card", base_color=(0.5, 0.5, 0.5), roughness=1.0)).build(DOWN[None])
    # Turned off the axes of the map, where every texel lies elsewhere on the plane.
    direction = (float(np.cos(low) * np.cos(0.4)), float(np.cos(low) * np.sin(0.4)), float(np.sin(low)))
    scene = replace(scene, sun=Sun(direction, (9.0, 9.0, 9.0)))
    settings = ideal.model_copy(update={"quality": "fast", "shadow_size": 512} | {"quality": quality})
    light, depth = radiance(gl, scene, settings)
    inner = light[20:100, 30:130, 0][np.isfinite(depth[20:100, 30:130])]
    assert inner.min() > 0.95 * inner.max()
    assert inner.mean() > 0.9 * 0.5 / np.pi * 9.0 * np.sin(low)
