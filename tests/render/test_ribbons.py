"""Members thinner than a pixel: even along their length, as strong as many samples make them, and truth untouched."""

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
from tests.conftest import Count, RecordProof
from tests.render.scenes import SceneBuilder, box_corners, placed
from usd_schemas.flat_scene import Dome, FlatScene, Material, Sun
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]

CAMERA = Pinhole(96, 96, 640.0, 640.0, 48.0, 48.0)
AWAY = 100.0  # [m]
POSE = np.eye(4)  # looks along +z, x to the right, y down


def tube(start: F64, end: F64, radius: float, sides: int = 12) -> F64:
    """A straight tube without caps, shape (2 sides, 3, 3), counter-clockwise from outside."""
    along = (end - start) / np.linalg.norm(end - start)
    one = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [1.0, 0.0, 0.0])
    one /= np.linalg.norm(one)
    other = np.cross(along, one)
    angle = np.arange(sides + 1) / sides * 2 * np.pi
    rim = radius * (np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * other)
    low, high = start + rim, end + rim
    return np.concatenate(
        [np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)]
    )


def hanging(angle: float, shift: float, radius: float = 0.015) -> FlatScene:
    """A tube 100 m away across the image at an angle, before a wall that shines."""
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    middle = np.array([-way[1] * shift, way[0] * shift, AWAY])
    builder = SceneBuilder(
        materials=[Material("dark", (0.05, 0.05, 0.05)), Material("wall", (0.0, 0.0, 0.0), emissive=(0.4, 0.4, 0.4))]
    )
    builder.add_mesh(tube(middle - 30 * way, middle + 30 * way, radius), np.eye(4), 1)
    builder.add_box(placed((0.0, 0.0, AWAY + 20), (80.0, 80.0, 1.0)), 2, 2, 1)
    scene = builder.build(POSE[None], CAMERA)
    return replace(scene, dome=Dome((0.5, 0.5, 0.5)), sun=Sun((0.48, -0.6, -0.64), (2.0, 2.0, 2.0)))


def linear(painter: Painter) -> F64:
    """The green light of a view, shape (H, W)."""
    return (painter.draw(POSE, 0.1).code[..., 1] / 65535.0) ** 2


def supersampled(painter: Painter, monkeypatch: pytest.MonkeyPatch, count: int) -> F64:
    """The light that `count` x `count` samples a pixel show, each shaded as the one sample is, shape (H, W)."""
    monkeypatch.setattr(painter, "_coverage_layer", None)
    total = np.zeros((CAMERA.height, CAMERA.width))
    for row in range(count):
        for column in range(count):
            x, y = ((place + 0.5) / count - 0.5 for place in (column, row))
            monkeypatch.setattr(painter, "_camera", replace(CAMERA, cx=CAMERA.cx - x, cy=CAMERA.cy - y))
            total += linear(painter)
    return total / count**2


@pytest.fixture
def plain(small: RenderSettings) -> RenderSettings:
    """Standard quality without haze."""
    return small.model_copy(update={"normals": False, "haze_distance": 1e9})


def test_a_thin_hanger_is_even_and_as_strong_as_its_samples(
    gl: Gl, plain: RenderSettings, monkeypatch: pytest.MonkeyPatch, proof_count: Count, record_proof: RecordProof
) -> None:
    """3 cm at 100 m, 0.19 px: contrast along it varies by under 15 %, its integral is within 10 % of 8x8 samples."""
    unevenness, losses, rng = [], [], np.random.default_rng(5)
    for angle in np.linspace(0.03, np.pi + 0.03, proof_count(3, 24), endpoint=False):
        scene = hanging(float(angle), float(rng.uniform(-0.08, 0.08)))
        painter = prepare(gl, scene, plain, SILENT).painter(CAMERA, sharp=True)
        images = [linear(painter), supersampled(painter, monkeypatch, 8)]
        if abs(np.cos(angle)) > abs(np.sin(angle)):
            images = [image.T for image in images]
        shown, truth = ((np.median(image, axis=1, keepdims=True) - image)[20:76].sum(axis=1) for image in images)
        unevenness.append(float(shown.std() / shown.mean()))
        losses.append(abs(float(shown.sum() / truth.sum() - 1)))
    assert max(unevenness) < 0.15
    assert max(losses) < 0.10
    record_proof(
        "render/thin members",
        len(losses),
        3,
        {"most_uneven_share": round(max(unevenness), 3), "worst_integral": round(max(losses), 3)},
    )


@pytest.mark.parametrize("quality", ["standard", "fine"])
@pytest.mark.parametrize("width", [0.45, 0.7])
def test_a_nearly_level_bar_has_no_gaps_where_edges_have_samples(
    width: float, quality: str, gl: Gl, plain: RenderSettings
) -> None:
    """Between two rows of middles no id shows it for some 30 pixels: its ribbon says where samples are needed."""
    settings = plain.model_copy(update={"quality": quality, "edge_samples": 17})
    scene = hanging(0.012, 0.02, width * AWAY / CAMERA.fx / 2)
    image = linear(prepare(gl, scene, settings, SILENT).painter(CAMERA, sharp=True)).T
    shown = (np.median(image, axis=1, keepdims=True) - image)[20:76].sum(axis=1)
    assert shown.std() < 0.15 * shown.mean()


def test_no_ribbon_of_a_former_view_stays(gl: Gl, plain: RenderSettings) -> None:
    """Rows read out one after the other, after a view of another place: as from a painter that drew nothing before."""
    ready = prepare(gl, hanging(0.4, 0.02), plain, SILENT)
    aside = POSE.copy()
    aside[1, 3] = 2.0
    bands = [(row, row + 4) for row in range(0, CAMERA.height, 4)]
    used, fresh = (ready.painter(CAMERA, sharp=True) for _ in range(2))
    used.draw(aside, 0.1)
    poses = np.repeat(POSE[None], len(bands), axis=0)
    views = [painter.draw_bands(poses, bands, 0.1) for painter in (used, fresh)]
    np.testing.assert_array_equal(views[0].code, views[1].code)


@pytest.mark.parametrize("width", [2.2, 3.1, 5.3, 8.0])
def test_both_sides_of_a_square_bar_are_even(
    width: float, gl: Gl, plain: RenderSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a bar 2 to 8 px wide the sun lights one side, a fifth as wide: no string of pearls, as 8x8 samples show."""
    away, turn, angle = 15.0, np.radians(12.0), 0.07
    thick = width * away / CAMERA.fx / (np.cos(turn) + np.sin(turn))
    along = np.array([np.sin(angle), np.cos(angle), 0.0])
    aside = np.array([np.cos(angle), -np.sin(angle), 0.0]) * np.cos(turn) + np.array([0.0, 0.0, np.sin(turn)])
    sides = np.stack([thick * aside, 4.0 * along, thick * np.cross(aside, along)])
    builder = SceneBuilder(materials=[Material("bar", (0.5, 0.5, 0.5))])
    builder.add_mesh(box_corners() @ sides + np.array([0.0, 0.0, away]), np.eye(4), 1)
    scene = replace(
        builder.build(POSE[None], CAMERA), dome=Dome((0.2, 0.2, 0.2)), sun=Sun((-0.95, 0.0, 0.1), (4.0, 4.0, 4.0))
    )
    painter = prepare(gl, scene, plain, SILENT).painter(CAMERA, sharp=True)
    shown, truth = linear(painter), supersampled(painter, monkeypatch, 8)
    sampled = linear(painter)  # without ribbons and smooth edges
    left = [np.sqrt(((image - truth)[20:76] ** 2).mean()) for image in (shown, sampled)]
    assert left[0] < 0.1 * left[1]


@pytest.mark.parametrize("quality", ["standard", "fine"])
@pytest.mark.parametrize("radius", [0.015, 0.1])
def test_ids_and_depth_know_nothing_of_ribbons(
    gl: Gl, plain: RenderSettings, monkeypatch: pytest.MonkeyPatch, quality: str, radius: float
) -> None:
    """With and without ribbons: the same bytes of ids and depth; the photograph alone changes where a tube is thin."""
    settings = plain.model_copy(update={"quality": quality})
    scene = hanging(0.4, 0.02, radius)
    painter = prepare(gl, scene, settings, SILENT).painter(CAMERA, sharp=True)
    drawn = painter.draw(POSE, 0.1)
    monkeypatch.setattr(painter, "_coverage_layer", None)
    monkeypatch.setattr(painter, "_edge_samples", None)
    plainly = painter.draw(POSE, 0.1)
    assert {0, 1, 2} >= set(np.unique(drawn.draw)) > {2}
    np.testing.assert_array_equal(drawn.draw, plainly.draw)
    np.testing.assert_array_equal(drawn.depth, plainly.depth)
    assert (drawn.code != plainly.code).any()


def test_what_is_behind_hides_no_ribbon_and_what_is_before_does(gl: Gl, plain: RenderSettings) -> None:
    """A tube half behind a box is drawn beside the box, and not on it."""
    scene = hanging(0.5, 0.0)
    builder = SceneBuilder(materials=list(scene.materials))
    way = np.array([1.0, 0.0, 0.0])
    builder.add_mesh(tube(-30 * way + [0, 0, AWAY], 30 * way + [0, 0, AWAY], 0.015), np.eye(4), 1)
    builder.add_box(placed((0.0, 0.0, AWAY + 20), (80.0, 80.0, 1.0)), 2, 2, 1)
    builder.add_box(placed((8.0, 0.0, AWAY - 5), (16.0, 4.0, 1.0)), 3, 3, 1)
    boxed = replace(builder.build(POSE[None], CAMERA), dome=scene.dome)
    shown = linear(prepare(gl, boxed, plain, SILENT).painter(CAMERA, sharp=True))
    lost = np.median(shown, axis=0) - shown[46:50].mean(axis=0)
    assert (lost[4:44] > 0.5 * lost[4:44].mean()).all()
    assert lost[4:44].mean() > 0.01 * np.median(shown)
    assert np.abs(lost[52:]).max() < 0.1 * lost[4:44].mean()


@pytest.mark.parametrize("behind", [False, True])
def test_a_rail_running_past_the_camera_stays_behind_what_hides_it(behind: bool, gl: Gl, plain: RenderSettings) -> None:
    """A dark rail of one segment, from beside the camera to 150 m, is seen before a wall as long and not behind it."""
    builder = SceneBuilder(
        materials=[Material("dark", (0.0, 0.0, 0.0)), Material("light", (0.0, 0.0, 0.0), emissive=(0.4, 0.4, 0.4))]
    )
    aside = -3.2 if behind else -2.0
    builder.add_mesh(tube(np.array([aside, 0.0, -10.0]), np.array([aside, 0.0, 150.0]), 0.04, 4), np.eye(4), 1)
    builder.add_box(placed((-2.6, 0.0, 75.0), (0.1, 4.0, 180.0)), 2, 2, 1)
    shown = linear(prepare(gl, builder.build(POSE[None], CAMERA), plain, SILENT).painter(CAMERA, sharp=True))
    column = shown[40:56, 4:28]
    assert (column.min() < 0.9 * column.max()) != behind


def test_a_rail_wide_near_by_and_thin_far_away_is_no_veil(gl: Gl, plain: RenderSettings) -> None:
    """A dark pole of one segment from behind the camera to 200 m: where it is 4 px wide, no light shines through."""
    builder = SceneBuilder(
        materials=[
            Material("dark", (0.0, 0.0, 0.0), roughness=1.0),
            Material("wall", (0.0, 0.0, 0.0), emissive=(0.4, 0.4, 0.4)),
        ]
    )
    builder.add_mesh(tube(np.array([0.3, 0.58, -4.0]), np.array([-6.0, -13.9, 200.0]), 0.1), np.eye(4), 1)
    builder.add_box(placed((0.0, 0.0, 230.0), (180.0, 180.0, 1.0)), 2, 2, 1)
    shown = linear(prepare(gl, builder.build(POSE[None], CAMERA), plain, SILENT).painter(CAMERA, sharp=True))
    wide = (shown < 0.5 * shown.max()).sum(axis=1)
    assert ((wide >= 4) & (wide < 8)).sum() >= 4
    assert shown.min(axis=1)[wide >= 4].max() < 0.075 * shown.max()


def test_a_bar_running_past_the_camera_keeps_its_place(gl: Gl, plain: RenderSettings) -> None:
    """A rail from behind the camera to 300 m ahead: its far end is thin and straight, nothing is drawn astray."""
    builder = SceneBuilder(
        materials=[Material("dark", (0.02, 0.02, 0.02)), Material("wall", (0.0, 0.0, 0.0), emissive=(0.4, 0.4, 0.4))]
    )
    builder.add_mesh(tube(np.array([0.5, 1.5, -30.0]), np.array([0.5, 1.5, 300.0]), 0.03), np.eye(4), 1)
    builder.add_box(placed((0.0, 0.0, 320.0), (300.0, 300.0, 1.0)), 2, 2, 1)
    scene = replace(builder.build(POSE[None], CAMERA), dome=Dome((0.5, 0.5, 0.5)))
    shown = linear(prepare(gl, scene, plain, SILENT).painter(CAMERA, sharp=True))
    dark = shown < 0.995 * np.median(shown)
    rows, columns = np.nonzero(dark)
    depth = 1.5 * CAMERA.fy / np.maximum(rows + 0.5 - CAMERA.cy, 0.1)
    assert len(rows) > 40
    # The rail lies on a straight line of the image through the middle of the view, three times as steep as wide.
    away = np.abs((columns + 0.5 - CAMERA.cx) - (rows + 0.5 - CAMERA.cy) / 3)
    assert (away < 2.0 + 0.03 * CAMERA.fx / np.minimum(depth, 300.0)).all()


def test_bars_have_the_axes_that_were_drawn() -> None:
    """A tube, a post and a strip, turned and stretched: middles and half axes; a cube and a ball have none."""
    builder = SceneBuilder()
    builder.add_mesh(tube(np.array([1.0, 2.0, 3.0]), np.array([2.0, 5.0, 4.0]), 0.05), np.eye(4), 1)
    post = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]) * [0.08, 0.06, 1.0]
    ring = [(post[k], post[(k + 1) % 4], post[(k + 1) % 4] + [0, 0, 2.0], post[k] + [0, 0, 2.0]) for k in range(4)]
    builder.add_mesh(np.array([face for a, b, c, d in ring for face in ((a, b, c), (a, c, d))]), np.eye(4), 2)
    strip = np.array([[0, -0.075, 0], [4, -0.075, 0], [4, 0.075, 0], [0, 0.075, 0.0]])
    builder.add_mesh(strip[[[0, 1, 2], [0, 2, 3]]], np.eye(4), 3)
    builder.add_box(np.eye(4), 4)
    blade = np.array([[[0.0, 0, 0], [0.02, 0, 0], [0.01, 0, 1.0]], [[0.0, 0, 0], [0.01, 0, 1.0], [0.02, 0, 0]]])
    builder.add_mesh(blade, np.eye(4), 5)
    bars = find_bars(builder.build(POSE[None], CAMERA))
    assert bars.part.tolist() == [0, 1, 2, 4]
    assert sorted(np.linalg.norm(bars.first[3], axis=-1)) == pytest.approx(
        [0.0001, 0.01]
    )  # a direction at the tip, too
    bars = replace(bars, ends=bars.ends[:3], first=bars.first[:3], second=bars.second[:3], round=bars.round[:3])
    assert bars.round.tolist() == [True, False, False]
    ends = {tuple(np.round(end, 6)) for end in bars.ends.reshape(-1, 3)}
    assert ends == {(1, 2, 3), (2, 5, 4), (0, 0, 0), (0, 0, 2), (0, 0, 0), (4, 0, 0)}
    first, second = np.linalg.norm(bars.first, axis=-1), np.linalg.norm(bars.second, axis=-1)
    assert first[0] == pytest.approx(0.05, rel=0.03)
    assert second[0] == pytest.approx(0.05, rel=0.03)
    assert first[1] == pytest.approx(0.04)
    assert second[1] == pytest.approx(0.03)
    assert first[2] == pytest.approx(0.075)
    assert second[2] == pytest.approx(0.0)
    assert np.abs(np.einsum("sek,sk->se", bars.first, bars.ends[:, 1] - bars.ends[:, 0])).max() < 1e-6


def between_panes(opacity: float, radius: float, panes: bool) -> FlatScene:
    """A tube across the image, on the left behind a pane and on the right before one; all of them only glow."""
    black = (0.0, 0.0, 0.0)
    glows = (("hanger", 0.05, {}), ("wall", 0.4, {}), ("pane", 0.2, {"blends": True, "opacity": opacity}))
    builder = SceneBuilder(
        materials=[
            Material(name, black, roughness=1.0, emissive=(glow, glow, glow), specular=black, **more)
            for name, glow, more in glows
        ]
    )
    way, middle = np.array([1.0, 0.2, 0.0]), np.array([0.0, 0.0, AWAY])
    builder.add_mesh(tube(middle - 20 * way, middle + 20 * way, radius), np.eye(4), 1)
    builder.add_box(placed((0.0, 0.0, AWAY + 20), (80.0, 80.0, 1.0)), 2, 2, 1)
    for instance, (x, z) in enumerate(((-4.0, AWAY - 5), (4.0, AWAY + 5)) if panes else (), 3):
        square = np.array([[x - 3, -4, z], [x - 3, 4, z], [x + 3, 4, z], [x + 3, -4, z]])
        builder.add_mesh(square[[[0, 1, 2], [0, 2, 3]]], np.eye(4), instance, 1, 2)
    return replace(builder.build(POSE[None], CAMERA), dome=Dome((0.5, 0.5, 0.5)))


@pytest.mark.parametrize("quality", ["standard", "fine"])
@pytest.mark.parametrize("opacity", [0.3, 0.7])
@pytest.mark.parametrize("radius", [0.015, 0.3])
def test_panes_before_and_behind_a_thin_member(
    gl: Gl, plain: RenderSettings, quality: str, opacity: float, radius: float
) -> None:
    """A pane dims the hanger behind it, and shows beside the one before it; in the truth it is solid from 0.5 on.

    Of light L behind a pane that glows with G, opacity * G + (1 - opacity) * L is seen. What the hanger covers comes
    from the same view without panes: 0.2 px of 3 cm by ribbons alone, 4 px of 60 cm by samples.
    """
    settings = plain.model_copy(update={"quality": quality})
    scenes = [between_panes(opacity, radius, panes) for panes in (False, True)]
    views = [prepare(gl, scene, settings, SILENT).painter(CAMERA, sharp=True).draw(POSE, 0.1) for scene in scenes]
    bare, shown = ((view.code[..., 1] / 65535.0) ** 2 for view in views)
    bare, shown = bare * 0.4 / bare[0, 0], shown * 0.4 / shown[0, 0]
    covered = (0.4 - bare) / 0.35
    assert 0.1 < covered.max() < 0.3 if radius < 0.1 else covered.max() > 0.99
    rows, before, behind = slice(26, 70), slice(6, 39), slice(58, 85)  # well inside the panes
    dimmed = opacity * 0.2 + (1 - opacity) * bare
    if opacity >= 0.5 and radius > 0.1:  # ids show no edge behind what is solid in the truth
        sampled = np.isclose(bare, 0.4, atol=2e-4) | np.isclose(bare, 0.05, atol=2e-4)
        shown[:, before], dimmed[:, before] = (image[:, before] * sampled[:, before] for image in (shown, dimmed))
    np.testing.assert_allclose(shown[rows, before], dimmed[rows, before], atol=4e-4)  # half floats
    beside = 0.05 * covered + (1 - covered) * (opacity * 0.2 + (1 - opacity) * 0.4)
    np.testing.assert_allclose(shown[rows, behind], beside[rows, behind], atol=4e-4)
    plainly, ids = (np.append(0, scene.draws.instance)[view.draw] for scene, view in zip(scenes, views, strict=True))
    assert (plainly[rows] == 1).any()
    solid = opacity >= 0.5
    np.testing.assert_array_equal(ids[rows, before], 3 if solid else plainly[rows, before])
    np.testing.assert_array_equal(ids[rows, behind], np.where((plainly == 1) | (not solid), plainly, 4)[rows, behind])
    assert views[1].depth[rows, before] == pytest.approx(AWAY - 5 if solid else views[0].depth[rows, before])
