"""Crowns of leaf cards with fewer triangles: one sheet for two that take the same light, then fewer cards."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import KDTree

from groundwork.progress import SILENT
from render.detail.leaf_cards import cards_of, single_sheets
from render.detail.mesh_decimation import coarser_levels, deviation
from render.detail.soup import Soup
from render.gpu.context import Gl
from render.light.daylight import read_daylight
from render.light.tracing import LightTracer
from render.settings import RenderSettings
from render.views.prepare import prepare
from tests.render.scenes import CAMERA, SceneBuilder, placed
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import ALIKE, Dome, FlatScene, Sun
from usd_schemas.pinhole import look_at

F64 = NDArray[np.float64]
GAP = 0.003  # [m] of a sheet from the middle of its card


def leaf_cards(count: int) -> F64:
    """Cards of two sheets on a ball, like those of a crown, shape (4 count, 3, 3)."""
    rng = np.random.default_rng(6)
    pieces = []
    for _ in range(count):
        out = rng.normal(size=3)
        out /= np.linalg.norm(out)
        side = np.cross(out, rng.normal(size=3))
        side *= 0.3 / np.linalg.norm(side)
        up = np.cross(out, side)
        front, back = (
            [2.0 * out + shift * out + i * side + j * up for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            for shift in (GAP, -GAP)
        )
        for a, b, c, d in (front, back[::-1]):
            pieces += [np.array([a, b, c]), np.array([a, c, d])]
    return np.array(pieces)


def crown(count: int) -> Soup:
    """Cards whose corners have one normal and one texture coordinate on both sheets, as our plants have them."""
    corners = leaf_cards(count)
    middle = np.repeat(corners.reshape(-1, 4, 3, 3).mean(axis=(1, 2)), 12, axis=0).reshape(-1, 3, 3)
    normals = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    flat = corners - np.einsum("tci,tci->tc", corners - middle, middle)[..., None] * middle / 4.0
    normals = flat / np.linalg.norm(flat, axis=2, keepdims=True)
    return Soup(corners, normals, np.concatenate([np.round(flat, 6), np.ones((len(corners), 3, 4))], axis=2))


def test_a_crown_loses_cards_and_keeps_its_cover() -> None:
    """Whole cards stay, both sheets of each, where they were; the area is kept until cards are twice as large."""
    full = replace(crown(40), normals=np.zeros((160, 3, 3)), carried=np.arange(160 * 3 * 7.0).reshape(160, 3, 7))
    card = cards_of(full)
    assert np.array_equal(np.bincount(card), np.full(40, 4))
    levels = list(coarser_levels(full))
    assert [len(level) // 4 for level in levels] == [28, 19, 13, 9, 6, 4]
    area = areas(full.corners).sum()
    for level in levels:
        grown = np.sqrt(areas(level.corners) / areas(full.corners)[0])
        assert np.ptp(grown) < 1e-9
        assert 1.0 < grown[0] <= 2.0 + 1e-9
        assert areas(level.corners).sum() == pytest.approx(min(area, 4.0 * area * len(level) / len(full)))
        rows = [
            np.flatnonzero((np.abs(full.carried - carried) < 1e-12).all(axis=(1, 2)))[0] for carried in level.carried
        ]
        assert np.array_equal(np.bincount(card[rows], minlength=40) % 4, np.zeros(40))
    gap = [KDTree(level.corners.mean(axis=1)).query(full.corners.mean(axis=1))[0].max() for level in levels]
    assert gap[0] < 1.0  # those that stay lie apart: nothing of the crown is left bare


def test_two_sheets_become_one_between_them() -> None:
    """Half the triangles, each card where it was, its normals and texture coordinates too; then cards become fewer."""
    full = crown(40)
    first, *others = coarser_levels(full)
    assert first.alike
    assert [len(level) // 2 for level in (first, *others)] == [40, 28, 19, 13, 9, 6, 4]
    assert all(level.alike for level in others)
    assert deviation(full, first) == pytest.approx(GAP, rel=1e-6)
    assert areas(first.corners).sum() == pytest.approx(areas(full.corners).sum() / 2)
    away, near = KDTree(full.corners.reshape(-1, 3)).query(first.corners.reshape(-1, 3))
    np.testing.assert_allclose(away, GAP, rtol=1e-6)
    count = 3 * len(first)
    for name in ("normals", "carried"):
        one, two = (getattr(part, name).reshape(rows, -1) for part, rows in ((first, count), (full, 2 * count)))
        np.testing.assert_allclose(one, two[near])
    out = np.cross(first.corners[:, 1] - first.corners[:, 0], first.corners[:, 2] - first.corners[:, 0])
    assert (np.einsum("ti,ti->t", out, first.corners.mean(axis=1)) > 0).all()  # the sheet that came first stays


@pytest.mark.parametrize("change", ["normals", "carried", "missing", "same side", "apart"])
def test_sheets_that_differ_stay_two(change: str) -> None:
    """Another light, another picture, a sheet that is missing or lies the same way round, or is too far off."""
    full = crown(12)
    back = np.tile([False, False, True, True], 12)
    if change == "missing":
        kept = np.arange(48) < 46
        full = Soup(full.corners[kept], full.normals[kept], full.carried[kept])
    elif change == "same side":
        turned = np.where(back[:, None, None], full.corners[:, ::-1], full.corners)
        full = Soup(turned, full.normals, full.carried)
    elif change == "apart":
        full = replace(full, corners=np.where(back[:, None, None], 0.9 * full.corners, full.corners))
    else:
        full = replace(full, **{change: np.where(back[:, None, None], -1.0, 1.0) * getattr(full, change)})
    card = cards_of(full)
    assert not len(card) or single_sheets(full, card) is None


def sheets(alike: int | None) -> FlatScene:
    """A leaning card before the sun, seen from both sides: of two sheets with one normal, or of one."""
    builder = SceneBuilder()
    a, b, c, d = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    lift = np.array([0.0, 0.0, GAP])
    front, back = np.array([[a, b, c], [a, c, d]]), np.array([[a, c, b], [a, d, c]])
    corners = np.concatenate([front + lift, back - lift]) if alike is None else front
    lean = placed((0.0, 0.0, 0.0))
    lean[:3, :3] = [[1, 0, 0], [0, np.cos(0.5), -np.sin(0.5)], [0, np.sin(0.5), np.cos(0.5)]]
    builder.add_mesh(corners, lean, 1)
    poses = np.array([look_at(np.array([0.3, -1.0, z]), np.zeros(3), np.array([0.0, 1.0, 0.0])) for z in (5.0, -5.0)])
    scene = builder.build(poses)
    geometry = scene.geometry
    normals = np.tile(np.array([[0.0, 0.0, 1.0]], np.float32), (len(geometry.normals), 1))
    sides = np.full(1, 1 if alike is None else alike, np.uint8)
    lit = Sun((0.1, 0.2, 1.0), (3.0, 3.0, 3.0))
    geometry = replace(geometry, normals=normals, part_double_sided=sides)
    return replace(scene, geometry=geometry, dome=Dome((0.4, 0.5, 0.6)), sun=lit)


@pytest.mark.parametrize("quality", ["fast", "standard", "fine"])
def test_one_sheet_takes_the_light_of_two(gl: Gl, ideal: RenderSettings, quality: str) -> None:
    """From both sides, normals too; a sheet of another kind is dark from behind. Nothing else of a mesh changes."""
    settings = ideal.model_copy(update={"quality": quality, "volume_probes": 200})
    code, normals, ids = {}, {}, {}
    for alike in (None, ALIKE, 1):
        scene = sheets(alike)
        painter = prepare(gl, scene, settings, SILENT).painter(CAMERA, sharp=True)
        views = [painter.draw(pose, 0.1) for pose in scene.cameras[0].poses]
        middle = (slice(50, 70), slice(70, 90))
        code[alike] = [view.code[middle].mean(axis=(0, 1)) / 65535 for view in views]
        normals[alike] = [view.normal[middle].mean(axis=(0, 1)) for view in views if view.normal is not None]
        ids[alike] = [view.draw for view in views]
    for side in (0, 1):
        np.testing.assert_allclose(code[ALIKE][side], code[None][side], rtol=0.02)
        np.testing.assert_allclose(normals[ALIKE][side], normals[None][side], atol=2e-3)
        assert (ids[ALIKE][side] != ids[None][side]).mean() < 0.01
    assert normals[1][1][2] == pytest.approx(-normals[ALIKE][1][2], abs=2e-3)
    assert code[1][1].mean() < 0.9 * code[ALIKE][1].mean()


def test_a_bent_lens_sees_the_same_normals(gl: Gl, ideal: RenderSettings) -> None:
    """From both sides."""
    scene = sheets(ALIKE)
    bent = Distortion(k1=-0.05)
    lens, painter = prepare(gl, scene, ideal, SILENT).lens(scene, CAMERA, bent)
    for pose in scene.cameras[0].poses:
        window = lens.window((0, CAMERA.height))
        view = lens.look([painter.draw_window(pose, window, 0.1)], pose[None], ((0, CAMERA.height),), 0.1)
        assert view.normal is not None
        seen = view.draw > 0
        assert seen.mean() > 0.1
        np.testing.assert_allclose(view.normal[seen].mean(axis=0), [0.0, -np.sin(0.5), np.cos(0.5)], atol=2e-3)


def test_rays_meet_no_back_of_a_sheet_that_is_alike() -> None:
    """A probe among leaves does not stand inside anything."""
    for alike, expected in ((ALIKE, False), (1, True)):
        scene = sheets(alike)
        tracer = LightTracer(scene, read_daylight(scene)[0], np.full((1, 3), 0.5))
        _, hits = tracer.trace(np.array([[0.0, 0.0, -3.0]]), np.array([[0.0, 0.0, 1.0]]))
        assert hits.behind.tolist() == [expected]
        assert hits.normal[0, 2] < 0


def areas(corners: F64) -> F64:
    """Area of each triangle, shape (T,)."""
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
