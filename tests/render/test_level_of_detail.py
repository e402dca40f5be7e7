"""Simplified for a survey: as few triangles as asked, no farther off than told, the bridge and what is near as is."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from scipy.spatial import KDTree

from groundwork.canonical import folder_digest
from groundwork.progress import SILENT
from render.capture import read_capture, read_truth
from render.detail.level_of_detail import level_of_detail, repeated
from render.detail.mesh_decimation import coarser_levels, deviation
from render.detail.soup import Soup
from render.detail.texel_need import survey_sight
from render.frames import render_scene
from render.gpu.camera import visible_boxes
from render.gpu.context import Gl
from render.gpu.gpu_scene import draw_boxes
from render.settings import RenderSettings
from render.views.prepare import prepare
from tests.render.oracle import Oracle, judge
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.components import class_id
from usd_schemas.flat_scene import Draws, FlatScene, InstanceRow, Product
from usd_schemas.pinhole import Pinhole, look_at

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U32 = NDArray[np.uint32]
CAMERA = Pinhole(320, 240, 280.0, 280.0, 160.0, 120.0)
FINER = 4  # samples along a side of a pixel, where outlines are compared
TREE, BRIDGE, GROUND, TREES = 1, 2, 3, 900


def ball(rings: int = 8, sectors: int = 12) -> F64:
    """A bumpy ball of flat triangles, shape (T, 3, 3)."""
    rng = np.random.default_rng(4)
    polar, turn = np.mgrid[0 : rings + 1, 0:sectors] * np.array([np.pi / rings, 2 * np.pi / sectors])[:, None, None]
    radius = 1.0 + 0.08 * rng.standard_normal(polar.shape)
    radius[[0, -1]] = 1.0
    grid = radius[..., None] * np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=-1
    )
    grid[0], grid[-1] = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
    a, b, c, d = grid[:-1], np.roll(grid[:-1], -1, axis=1), grid[1:], np.roll(grid[1:], -1, axis=1)
    faces = np.concatenate([np.stack([a, c, d], axis=2)[:], np.stack([a, d, b], axis=2)]).reshape(-1, 3, 3)
    return faces[np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1) > 1e-9]


def soup(corners: F64) -> Soup:
    """Flat triangles that carry their own corners in place of texture coordinates."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Soup(corners, np.repeat(normal[:, None], 3, axis=1), np.tile(corners, (1, 1, 3))[..., :7])


def park() -> FlatScene:
    """A wood on a plain around a bridge that wears the same mesh as the trees, seen by three cameras."""
    rng = np.random.default_rng(9)
    builder = SceneBuilder()
    builder.add_mesh(ball(), placed((0, 6, 2), (2.0, 2.0, 2.0)), TREE, label=0)
    plain = np.array([[[-1.0, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]])
    builder.add_mesh(plain, placed((0, 0, 0), (600.0, 600.0, 1.0)), GROUND, label=0)
    eyes = [(-22.0, 0.0, 9.0), (-20.0, -8.0, 12.0), (-9.0, 7.0, 5.0)]
    poses = np.array([look_at(np.array(eye), np.array([30.0, 3.0, 2.0])) for eye in eyes])
    scene = builder.build(poses, CAMERA)
    places = np.column_stack([rng.uniform(-10, 300, TREES), rng.uniform(-120, 120, TREES), np.full(TREES, 2.0)])
    sizes = rng.uniform(0.8, 3.0, TREES)
    sizes[:3], places[:3] = 0.02, [[250, 0, 9], [260, 4, 9], [270, 8, 9]]  # smaller than a pixel from everywhere
    trees = np.array([placed((x, y, z), (s, s, 1.4 * s), x) for (x, y, z), s in zip(places, sizes, strict=True)])
    bridge = np.array([placed((x, 20.0, 4.0), (1.0, 1.0, 3.0)) for x in (100.0, 150.0, 200.0)])
    ids = [*range(10, 10 + TREES), BRIDGE, BRIDGE, BRIDGE + 2]
    more = len(ids)
    draws = scene.draws
    rows = [
        InstanceRow(number, f"/World/Park/Trees_{number}", "tree", "background", {}, "background")
        for number in [TREE, *range(10, 10 + TREES)]
    ]
    rows += [
        InstanceRow(BRIDGE, "/World/Bridge/Pier", "column", "column", {}, "column"),
        InstanceRow(BRIDGE + 1, "/World/Ground", "ground", "background", {}, "background"),
        InstanceRow(BRIDGE + 2, "/World/Bridge/Pier/Pole", "pole", "background", {}, "background"),
    ]
    return replace(
        scene,
        instances=tuple(sorted(rows, key=lambda row: row.id)),
        products=(Product("test", 0, 320, 240),),
        draws=Draws(
            np.concatenate([draws.part, np.zeros(more, np.int32)]),
            np.concatenate([draws.transform, trees, bridge]),
            np.concatenate([draws.material, np.zeros(more, np.int32)]),
            np.concatenate([draws.instance, np.array(ids, np.uint32)]),
            np.concatenate(
                [
                    draws.label,
                    np.zeros(TREES, np.uint8),
                    np.full(2, class_id("column"), np.uint8),
                    np.zeros(1, np.uint8),
                ]
            ),
        ),
    )


def simplified(scene: FlatScene, budget: int) -> FlatScene:
    """Simplify for the scene's own survey."""
    track = scene.cameras[0]
    return level_of_detail(scene, track, CAMERA, survey_sight(track, CAMERA), budget)


def by_place(scene: FlatScene) -> dict[tuple[int, tuple[float, ...]], int]:
    """Find the part of each draw by its instance and its origin."""
    draws = scene.draws
    return {
        (int(number), tuple(transform[:3, 3].tolist())): int(part)
        for number, transform, part in zip(draws.instance, draws.transform, draws.part, strict=True)
    }


def in_view(scene: FlatScene) -> list[int]:
    """Count the triangles of each view."""
    lower, upper = draw_boxes(scene)
    counts = scene.geometry.part_count[scene.draws.part].astype(int)
    return [int(counts[visible_boxes(lower, upper, CAMERA, pose)].sum()) for pose in scene.cameras[0].poses]


def test_levels_are_ever_coarser_and_as_near_as_they_say() -> None:
    """Distances held against a dense sampling of both surfaces; normals stay those of the flat triangles."""
    source = soup(ball())
    levels = list(coarser_levels(source))
    sizes = [len(source), *map(len, levels)]
    assert all(2 <= fewer < more for more, fewer in pairwise(sizes))
    assert sizes[-1] < 12
    weights = np.random.default_rng(0).dirichlet(np.ones(3), 30)
    for level in levels[2:]:
        normal = np.cross(level.corners[:, 1] - level.corners[:, 0], level.corners[:, 2] - level.corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        np.testing.assert_allclose(level.normals, np.repeat(normal[:, None], 3, axis=1), atol=1e-9)
        one, other = (np.einsum("sk,tki->tsi", weights, part.corners).reshape(-1, 3) for part in (source, level))
        sampled = max(KDTree(one).query(other)[0].max(), KDTree(other).query(one)[0].max())
        gap = 0.5 * np.linalg.norm(level.corners - level.corners.mean(axis=1, keepdims=True), axis=2).max()
        assert sampled - gap < deviation(source, level) < sampled + 0.1
    assert deviation(source, source) == pytest.approx(0.0, abs=1e-12)
    moved = soup(source.corners + np.array([0.0, 0.0, 0.37]))
    assert 0.2 < deviation(source, moved) <= 0.37 + 1e-12


def test_no_view_holds_more_than_the_budget() -> None:
    """From half of what there is down to a tenth; nothing happens where the budget is kept, or none is set."""
    scene = park()
    most = max(in_view(scene))
    for share in (0.8, 0.5, 0.25):
        found = simplified(scene, int(share * most))
        assert max(in_view(found)) <= share * most, share
        assert found.warnings == scene.warnings
    assert simplified(scene, most) is scene
    assert simplified(scene, 0) is scene
    (line,) = simplified(scene, 10).warnings[len(scene.warnings) :]
    assert "triangle_budget" in line


def test_the_bridge_the_ground_and_what_is_near_stay() -> None:
    """Whatever the bridge wears keeps its triangles; trees beside the camera too; specks far away go."""
    scene = park()
    found = simplified(scene, int(0.7 * max(in_view(scene))))
    first, parts = by_place(scene), by_place(found)
    assert not np.isin(scene.draws.instance[repeated(scene)], [BRIDGE, BRIDGE + 1, BRIDGE + 2, GROUND]).any()
    eyes = scene.cameras[0].poses[:, :3, 3]
    near = changed = 0
    for key, part in first.items():
        away = np.linalg.norm(eyes - np.array(key[1]), axis=1).min()
        if key[0] in (BRIDGE, BRIDGE + 1, BRIDGE + 2, GROUND) or away < 14.0:
            assert parts[key] == part, key
            near += key[0] >= 10
        changed += parts.get(key) != part
    assert near >= 2
    assert changed > TREES / 2
    assert not {10, 11, 12} & {number for number, _ in parts}


def test_outlines_move_by_less_than_a_pixel(gl: Gl, small: RenderSettings) -> None:
    """Where half a pixel is enough for the budget: every tree that stands alone, at four samples a pixel."""
    scene = park()
    found = simplified(scene, max(in_view(scene)) - 1)
    assert len(found.geometry.part_first) > len(scene.geometry.part_first)
    fine = Pinhole(320 * FINER, 240 * FINER, 280.0 * FINER, 280.0 * FINER, 160.0 * FINER, 120.0 * FINER)
    images = []
    for shown in (scene, found):
        prepared = prepare(gl, shown, small.model_copy(update={"quality": "fast"}), SILENT)
        ids = np.concatenate([[0], shown.draws.instance])
        painter = prepared.painter(fine, sharp=True)
        images.append([ids[painter.draw(pose, 0.1).draw] >= 10 for pose in scene.cameras[0].poses])
    differ = 0
    disc = np.hypot(*np.mgrid[-FINER : FINER + 1, -FINER : FINER + 1]) <= FINER
    for before, after in zip(*images, strict=True):
        differ += int((before != after).sum())
        for one, other in ((before, after), (after, before)):
            wider = np.asarray(binary_dilation(other, disc), bool)
            assert not (one & ~wider).any()
    assert differ > 0


def test_every_view_and_the_truth_see_the_same(tmp_path: Path, ideal: RenderSettings) -> None:
    """Ray caster, views against each other, shared frames against those of one process."""
    scene, settings = park(), ideal.model_copy(update={"quality": "fast"})
    settings = settings.model_copy(update={"triangle_budget": int(0.4 * max(in_view(scene)))})
    whole, shared = tmp_path / "whole", tmp_path / "shared"
    for folder in (whole, shared):
        folder.mkdir()
    render_scene(scene, whole, settings, 3, SILENT)
    for share in ((0, 2), (1, 2), (0, 1)):
        render_scene(scene, shared, settings, 3, SILENT, share)
    assert folder_digest(whole) == folder_digest(shared)
    truth = read_truth(read_capture(whole))
    assert truth is not None
    corners, ids, _ = truth.surface()
    assert len(corners) < 0.6 * scene.geometry.part_count[scene.draws.part].sum()
    oracle = Oracle(corners, ids)
    for row in range(3):
        depth, expected, _ = oracle.look(truth, row)
        verdict = judge(truth.instance(row), truth.depth(row), expected, depth)
        assert verdict.equal >= 0.9995, verdict
        assert verdict.stray <= 1e-5, verdict
        assert verdict.tail < 5e-6, verdict
    assert _agreement(truth.depth(0), truth.instance(0), truth.depth(1), truth.instance(1), truth.poses) > 0.99


def _agreement(depth: F32, ids: U32, other: F32, found: U32, poses: F64) -> float:
    """Share of the trees' pixels that another view shows at the same depth and calls the same."""
    v, u = np.nonzero(np.isfinite(depth) & (ids >= 10))
    z = depth[v, u].astype(float)
    local = np.column_stack([(u + 0.5 - 160) / 280 * z, (v + 0.5 - 120) / 280 * z, z])
    there = (local @ poses[0, :3, :3].T + poses[0, :3, 3] - poses[1, :3, 3]) @ poses[1, :3, :3]
    column, row = (np.floor(there[:, axis] / there[:, 2] * 280 + (160, 120)[axis]).astype(int) for axis in (0, 1))
    inside = (column >= 0) & (column < 320) & (row >= 0) & (row < 240) & (there[:, 2] > 0)
    column, row, there, v, u = column[inside], row[inside], there[inside], v[inside], u[inside]
    same = np.abs(other[row, column] - there[:, 2]) < 0.003 * there[:, 2]
    assert same.sum() > 1000
    return float((found[row, column] == ids[v, u])[same].mean())
