"""What a worker keeps in memory: textures no finer than anybody sees, each content once, and no library for an hour."""

import subprocess
import sys
import weakref
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from groundwork.errors import InputError
from groundwork.progress import SILENT
from render.detail.surveyed_scene import survey_scene
from render.detail.texel_need import Sight, survey_sight, texel_needs
from render.frames import render_scene
from render.gpu.context import Gl
from render.gpu.gpu_scene import run_commands
from render.gpu.materials import channel_pairs, texture_keys
from render.gpu.textures import TextureKey, load_textures, sufficient_side
from render.images import image_files
from render.light.daylight import read_daylight
from render.light.illumination import BRIGHTEST
from render.light.light_volume import Sampling, cast_light_volume
from render.settings import RenderSettings
from render.views.passes import Painter
from render.views.preparation_child import cast_volume_apart, survey_scene_apart
from render.views.prepare import prepare
from render.views.targets import View
from tests.conftest import RecordProof
from tests.render.scenes import CAMERA, SceneBuilder, placed, random_scene
from usd_schemas.flat_scene import Detail, Dome, FlatScene, Material, Sun, Texture
from usd_schemas.pinhole import look_at
from usd_schemas.reading.choices import AS_AUTHORED
from usd_schemas.reading.scene_cache import load_scene

SQUARE = np.array([[[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0]], [[-0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]])
SIDE, BLOTCH, PLATE = 1024, 64, 20.0  # [px], [px], [m]
STAGE = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Cube "Box"
{
}
def Camera "Drone"
{
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def sheet(path: Path, seed: int = 0) -> str:
    """Write a picture of blotches."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(40, 220, (SIDE // BLOTCH, SIDE // BLOTCH, 3), np.uint8)
    cv2.imwrite(str(path), cv2.resize(coarse, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC))
    return str(path)


def plate_from(height: float, material: Material, tiles: float = 1.0) -> FlatScene:
    """A level plate whose UV runs from 0 to `tiles`, seen straight from above."""
    builder = SceneBuilder(materials=[material])
    builder.add_mesh(SQUARE, placed((0, 0, 0), (PLATE, PLATE, 1.0)), 1, st=(SQUARE[..., :2] + 0.5) * tiles)
    pose = look_at(np.array([0.0, 0.0, height]), np.zeros(3), np.array([0.0, 1.0, 0.0]))
    return replace(builder.build(pose[None]), dome=Dome((1.0, 1.0, 1.0)))


@pytest.mark.parametrize("tiles", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("scale", [(1.0, 1.0), (2.0, 4.0)])
@pytest.mark.parametrize("height", [5.0, 40.0])
def test_need_is_that_of_the_nearest_pixel(tiles: float, scale: tuple[float, float], height: float) -> None:
    """In closed form: a pixel covers height / focal meters, of which the UV map makes its share of the sheet."""
    texture = Texture("sheet.png", True, scale=scale)
    needs = texel_needs(plate_from(height, Material("m", base_texture=texture), tiles), _sight(height))
    (need,) = needs.values()
    expected = np.sqrt(2.0) * min(scale) * tiles / PLATE * height / CAMERA.fx  # the slant of the corners aside
    assert 0.6 * expected < need <= expected


def test_detail_and_macro_have_needs_of_their_own() -> None:
    """The largest period counts, and the second set of coordinates."""
    detail = Detail("fine.png", (0.5, 4.0), (0.1, 0.1), "macro.png")
    needs = texel_needs(plate_from(10.0, Material("m", detail=detail)), _sight(10.0))
    width = {Path(key.file).name: need for key, need in needs.items()}
    assert width["fine.png"] == pytest.approx(np.sqrt(2) / 4.0 / PLATE * 10.0 / CAMERA.fx, rel=0.4)
    assert np.isinf(width["macro.png"])  # the mesh has no second coordinates: one texel does


def test_sides_are_halved_as_long_as_pixels_are_wider() -> None:
    """Never where a camera is near, and never to nothing."""
    assert sufficient_side(2048, 0.0) == 2048
    assert sufficient_side(2048, 1.99 / 2048) == 2048
    assert sufficient_side(2048, 2.01 / 2048) == 1024
    assert sufficient_side(2048, 1.0) == 1
    assert sufficient_side(1, np.inf) == 1


@pytest.mark.parametrize("quality", ["standard", "fine"])
def test_far_textures_take_less_and_look_the_same(
    gl: Gl, ideal: RenderSettings, tmp_path: Path, quality: str, record_proof: RecordProof
) -> None:
    """From high above a sheet is kept at a fraction of its side; pictures hardly differ."""
    material = Material("m", base_texture=Texture(sheet(tmp_path / "sheet.png"), True), roughness=1.0)
    scene = plate_from(60.0, material, 2.0)
    settings = ideal.model_copy(update={"quality": quality, "normals": False})
    pictures, sides = [], []
    for sight in (None, survey_sight(scene.cameras[0], CAMERA)):
        needs = texel_needs(scene, sight) if sight is not None else {}
        prepared = prepare(gl, scene, settings, SILENT, needs=needs)
        view = prepared.painter(CAMERA, sharp=True).draw(scene.cameras[0].poses[0], 0.1)
        pictures.append(view.code.astype(float) / 257)
        sides += [sufficient_side(SIDE, need) for need in needs.values() or (0.0,)]
    difference = np.abs(pictures[0] - pictures[1])
    assert sides[0] == SIDE
    assert sides[1] <= SIDE // 4
    assert pictures[0].std() > 0.5  # there is something to see

    assert difference.max() < 15.0
    assert difference.mean() < 0.25
    figures = {"side": sides[1], "largest": float(difference.max()), "mean": float(difference.mean())}
    record_proof(f"render: textures as fine as seen, {quality}, of 255", 2, 0, figures)


def test_near_textures_stay_whole(tmp_path: Path) -> None:
    """One camera near by is enough, however many are far."""
    material = Material("m", base_texture=Texture(sheet(tmp_path / "sheet.png"), True))
    scene = plate_from(60.0, material)
    near = Sight(np.array([[0.0, 0.0, 300.0], [3.0, 3.0, 1.5]]), 1 / CAMERA.fx, 0.1)
    ((_, need),) = texel_needs(scene, near).items()
    assert sufficient_side(SIDE, need) == SIDE


def test_equal_content_is_loaded_once(gl: Gl, tmp_path: Path) -> None:
    """Under however many names; read in another way, or with another content, it is another texture."""
    first, other = sheet(tmp_path / "a.png"), sheet(tmp_path / "c.png", 1)
    (tmp_path / "b.png").write_bytes(Path(first).read_bytes())
    same = [TextureKey(first, True), TextureKey(str(tmp_path / "b.png"), True)]
    keys = [*same, TextureKey(first, False, "vector"), TextureKey(other, True)]
    needs = {same[0]: 256, same[1]: 512}
    slots, warnings = load_textures(gl, keys, [], SIDE, 1.0, enough=lambda key, _: needs.get(key, SIDE))
    assert not warnings
    assert slots[same[0]] == slots[same[1]]
    assert slots[same[0]].side == 512  # the finer of two needs
    assert len({(id(slot.array), slot.layer) for slot in slots.values()}) == 3


def test_roughness_in_a_colors_opacity_looks_the_same(
    gl: Gl, ideal: RenderSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit by bit as from a layer of its own; and it counts, for another roughness gives another picture."""
    gray = str(tmp_path / "grey.png")
    cv2.imwrite(gray, image_files.decode(Path(sheet(tmp_path / "other.png", 1)))[..., 1] // 3)
    color = Texture(sheet(tmp_path / "sheet.png"), True)
    rough = Material("m", base_texture=color, roughness_texture=Texture(gray, False))
    settings = ideal.model_copy(update={"quality": "fine", "normals": False})
    pictures, features = [], []
    for material, apart in ((rough, False), (rough, True), (Material("m", base_texture=color, roughness=0.9), False)):
        scene = replace(plate_from(20.0, material), sun=Sun((0.1, 0.1, 1.0), (3.0, 3.0, 3.0)))
        if apart:
            monkeypatch.setattr("render.views.prepare.channel_pairs", lambda _: [])
        prepared = prepare(gl, scene, settings, SILENT)
        pictures.append(prepared.painter(CAMERA, sharp=True).draw(scene.cameras[0].poses[0], 0.1).code)
        features.append(set(prepared.gpu.variants[0].features) & {"HAS_ROUGHNESS", "ROUGHNESS_IN_ALBEDO"})
    assert features == [{"ROUGHNESS_IN_ALBEDO"}, {"HAS_ROUGHNESS"}, set()]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert np.abs(pictures[0].astype(int) - pictures[2]).max() > 1000


@pytest.mark.parametrize(
    ("change", "channel"),
    [
        ({}, 3),
        ({"opacity_threshold": 0.5}, 0),
        ({"roughness_texture": Texture("grey.png", False, scale=(2.0, 2.0))}, 0),
        ({"metallic_texture": Texture("grey.png", False)}, 0),
        ({"detail": Detail("grey.png", (1.0,), (0.1,))}, 0),
        ({"base_texture": Texture("other.png", True)}, 0),
        ({"base_texture": None}, 0),
        ({"roughness_texture": Texture("other.png", False)}, 0),
    ],
)
def test_roughness_shares_a_layer_only_where_one_look_up_finds_both(
    gl: Gl, tmp_path: Path, change: dict[str, Any], channel: int
) -> None:
    """Another material that uses either of the two in another way keeps them apart, and so does another size."""
    files = {name: sheet(tmp_path / name, seed) for seed, name in enumerate(("sheet.png", "grey.png", "other.png"))}

    def on_disk(value: object) -> object:
        found = isinstance(value, Texture | Detail) and files.get(value.file)
        return replace(value, file=found) if found else value  # pyright: ignore[reportArgumentType]

    first = Material(
        "m", base_texture=Texture(files["sheet.png"], True), roughness_texture=Texture(files["grey.png"], False)
    )
    materials = (first, replace(first, **{name: on_disk(value) for name, value in change.items()}))
    keys, averaged = texture_keys(materials, "fine")
    number, color = TextureKey(files["grey.png"], False, "number"), TextureKey(files["sheet.png"], True)
    for smaller in (False, True):
        enough = {number: SIDE // 2 if smaller else SIDE}
        slots, warnings = load_textures(
            gl,
            keys,
            averaged,
            SIDE,
            1.0,
            enough=lambda key, _, enough=enough: enough.get(key, SIDE),
            packable=channel_pairs(materials),
        )
        assert not warnings
        assert slots[number].channel == (0 if smaller else channel)
        assert (slots[number].array is slots[color].array) == (slots[number].channel == 3)


@pytest.mark.parametrize("quality", ["standard", "fine"])
def test_no_pixel_depends_on_how_much_waits_for_the_driver(
    gl: Gl, small: RenderSettings, monkeypatch: pytest.MonkeyPatch, quality: str
) -> None:
    """Triangles one by one, some, or all at once; rows of finer samples likewise."""
    scene = replace(random_scene(5, np.zeros(3)), dome=Dome((1.0, 1.0, 1.0)))
    settings = small.model_copy(update={"quality": quality})
    images = []
    for waiting, resolved in ((30_000, 64), (1, 7), (50, 1000)):
        monkeypatch.setattr("render.gpu.gpu_scene._WAITING", waiting)
        monkeypatch.setattr("render.views.targets._RESOLVED", resolved)
        painter = prepare(gl, scene, settings, SILENT).painter(CAMERA, sharp=True)
        view = painter.draw(scene.cameras[0].poses[0], 0.1)
        images.append((view.code, view.draw, view.depth, view.normal))
    for other in images[1:]:
        for ours, theirs in zip(images[0], other, strict=True):
            assert ours is not None
            assert theirs is not None
            np.testing.assert_array_equal(ours, theirs)


def test_commands_wait_for_the_driver_until_they_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is run once, in order; the driver begins at every multiple of the limit."""
    monkeypatch.setattr("render.gpu.gpu_scene._WAITING", 10)
    triangles, log, waiting = np.array([4, 4, 4, 25, 1, 1, 9, 1]), [], 0
    vertices = SimpleNamespace(render_indirect=lambda _, __, count, *, first: log.append((first, count)))
    for start, end in ((0, 2), (2, 3), (3, 8)):
        part = triangles[start:end]
        waiting = run_commands(lambda: log.append("flush"), vertices, None, part, start, waiting)  # pyright: ignore
    assert log == [(0, 2), (2, 1), "flush", (3, 1), "flush", (4, 3), "flush", (7, 1)]
    assert waiting == 49 % 10


@pytest.mark.parametrize("encoders", [1, 2])
def test_no_more_frames_are_held_than_there_are_encoders(
    small: RenderSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, encoders: int
) -> None:
    """One of them is the frame that is being drawn."""
    held, most = weakref.WeakSet[View](), [0]
    draw = Painter.draw_bands

    def counted(self: Painter, *arguments: Any) -> View:
        sharp = self._camera.width == CAMERA.width
        if sharp:
            most.append(len(held))
        view = draw(self, *arguments)
        if sharp:
            held.add(view)
        return view

    monkeypatch.setattr(Painter, "draw_bands", counted)
    monkeypatch.setattr(View, "__hash__", object.__hash__)
    monkeypatch.setattr("render.frames._METER_WIDTH", CAMERA.width // 2)
    scene = random_scene(5, np.zeros(3))
    render_scene(scene, tmp_path, small.model_copy(update={"quality": "fast", "encoders": encoders}), 1, SILENT)
    assert len(most) > len(scene.cameras[0].poses) > 1
    assert max(most) <= encoders - 1


def test_a_volume_cast_apart_is_the_same(tmp_path: Path) -> None:
    """Bit by bit."""
    scene = plate_from(10.0, Material("grey"))
    light, _ = read_daylight(scene)
    box = (np.array([-3.0, -3.0, 0.0]), np.array([3.0, 3.0, 2.0]))
    work = (scene, light, np.full((1, 3), 0.5), box, Sampling(1000, 16))
    here, apart = cast_light_volume(*work, SILENT), cast_volume_apart(*work, SILENT)
    np.testing.assert_array_equal(apart.coefficients, here.coefficients)
    np.testing.assert_array_equal(apart.lower, here.lower)
    assert here.coefficients.max() < BRIGHTEST


def test_a_worker_loads_nothing_that_drawing_does_not_need(tmp_path: Path) -> None:
    """USD, the ray caster and scipy take memory; the scene that comes from apart is the one read here."""
    stage = tmp_path / "scene.usda"
    stage.write_text(STAGE)
    unwanted = "{'pxr', 'open3d', 'torch', 'scipy', 'numba'}"
    answer = subprocess.run(
        [sys.executable, "-c", f"import sys, render.frames; print(sorted({unwanted} & set(sys.modules)))"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert answer.stdout.strip() == "[]"
    apart, here = survey_scene_apart(stage, "Drone", 0, AS_AUTHORED, SILENT), survey_scene(load_scene(stage), 0)
    assert (apart.camera, apart.needs, apart.scene.origin) == (here.camera, here.needs, here.scene.origin)
    np.testing.assert_array_equal(apart.scene.geometry.positions, here.scene.geometry.positions)
    np.testing.assert_array_equal(apart.track.poses, here.track.poses)


def test_a_stage_without_a_survey_is_refused() -> None:
    """In one line."""
    with pytest.raises(InputError, match="no RenderProduct"):
        survey_scene(replace(plate_from(10.0, Material("m")), products=()), 0)


def _sight(height: float) -> Sight:
    return survey_sight(plate_from(height, Material("m")).cameras[0], CAMERA)
