"""Right-of-way fences: where they stand, what holds their wires, and which sites have them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.road_section import RoadSection
from authoring.backgrounds.registry import BackgroundSettings, build_background
from authoring.families.bridge_settings import draw_layout
from authoring.families.registry import build_bridge
from authoring.settings import AuthoringSettings
from authoring.shapes.component import Component, triangles
from authoring.site.fences import HEIGHT, PITCH, TOE, WIRES, fence_meshes, fence_offsets, fence_sides, fenced
from authoring.site.shape import FILL_SLOPE, SHOULDER, WING_WALL
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from falsework.scenario import scene_seed
from groundwork.settings import parse_settings
from tests.authoring.world_parts import runs, solids
from usd_schemas.components import class_of

F64 = NDArray[np.float64]
TILLED = ("Ploughed", "Crop", "RipeCrop", "Hay")
CORNERS = 8  # vertices of a post
ROAD = Layout(Alignment(7.0, 0.02, 0.4, skew=0.3), (0.0, 30.0), 10.0, 1.9, "road", 8.0, 3.4)
ROAD = replace(ROAD, road=RoadSection(((-3.4, False), (3.4, False)), (2.0, 3.0), 0.15, 4.5, False, 6.5))


@pytest.fixture(scope="module", params=["river", "road"])
def site(request: pytest.FixtureRequest) -> Site:
    """A fenced site of a skewed, rising bridge."""
    settings = SiteSettings(crossing=request.param, fences=True, fine_spacing=1.6, coarse_spacing=5.0)
    return draw_site(settings, ROAD, stream(5, "site"))


def fences(site: Site, what: str) -> list[Component]:
    """Components of the fences that end so."""
    return [part for part in solids(site.pieces) if part.kind == "fence" and part.name.endswith(what)]


def posts(part: Component) -> tuple[F64, F64]:
    """Middles in plan, and lowest and highest points, of all posts, shapes (N, 2)."""
    corners = part.mesh.points.reshape(-1, CORNERS, 3)
    return corners[..., :2].mean(axis=1), np.stack([corners[..., 2].min(axis=1), corners[..., 2].max(axis=1)], axis=1)


def test_posts_stand_in_the_ground(site: Site) -> None:
    """Every post begins below the ground, and ends 1.2 m above it; strainers are a little higher."""
    assert len(fences(site, "_Posts")) == len(fences(site, "_Wires")) == 4
    for part in fences(site, "_Posts"):
        assert class_of(part.kind) == "background"
        middles, ends = posts(part)
        assert len(middles) > 15
        over = ends - site.ground(middles)[:, None]
        assert over[:, 0].max() < -0.3
        np.testing.assert_allclose(over[:, 1], HEIGHT + np.where(over[:, 1] > HEIGHT + 0.03, 0.06, 0.0), atol=0.01)
        assert 2 <= (over[:, 1] > HEIGHT + 0.03).sum() <= 5  # both ends, and the corners


def test_fences_keep_to_the_toes_and_end_at_the_walls(site: Site) -> None:
    """Beyond the wing walls' ends no post is on the fill or the road; the last stands a meter from the wall."""
    land = site.land
    for part in fences(site, "_Posts"):
        middles, _ = posts(part)
        station, left = land.layout.alignment.locate(middles)
        approach = land.approaches["Fence_1" in part.name]
        along, aside = approach.along(station), np.abs(left - approach.center(station))
        assert along.min() == pytest.approx(WING_WALL + 1.0, abs=1e-3)
        assert aside.min() == pytest.approx(land.layout.width / 2 + 1.0, abs=0.05)
        beside = along > WING_WALL + 1.5
        crown = approach.level(land.layout, lambda s, _: np.zeros_like(s), station)
        foot = FILL_SLOPE * np.abs(crown - site.ground(middles)) + land.layout.width / 2 + 0.8 * TOE
        assert beside.sum() > 12
        assert (aside > foot)[beside].all()
        assert np.ptp(aside[beside]) < 1e-3
        crossing = land.crossing
        assert (crossing.distance(station, left) > crossing.half_width + SHOULDER).all()


def test_wires_run_from_post_to_post(site: Site) -> None:
    """At each post three wires pass inside it, at their heights above the ground."""
    for part, wires in zip(fences(site, "_Posts"), fences(site, "_Wires"), strict=True):
        assert wires.name.removesuffix("Wires") == part.name.removesuffix("Posts")
        middles, _ = posts(part)
        points = wires.mesh.points
        for middle in middles:
            near = points[np.linalg.norm(points[:, :2] - middle, axis=1) < 0.01]
            away = np.abs(near[:, 2, None] - site.ground(middle[None]) - WIRES)
            assert away.min(axis=1).max() < 0.01  # every vertex belongs to a wire
            assert away.min(axis=0).max() < 0.01  # every wire is there
        ends = points[triangles(wires.mesh)]
        assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max() < 2.0 * PITCH + 1.0


def test_wires_leave_gaps_and_lone_posts_nothing() -> None:
    """Between posts further apart than two spacings is no wire, and a post without neighbors is left out."""
    axis = Alignment(7.0)
    station = np.array([0.0, 2.5, 5.0, 20.0, 22.5, 60.0])
    posts, wires = (part[3] for part in fence_meshes("A", axis, np.column_stack([station, 0 * station, 0 * station])))
    assert len(posts.points) == 5 * CORNERS
    assert len(wires.points) == 5 * 4 * len(WIRES)  # four corners of the section: the fourth side ends at the first
    edges = np.sort(np.stack([wires.corners, np.roll(wires.corners.reshape(-1, 4), -1, axis=1).reshape(-1)]), axis=0)
    assert set(np.unique(edges, axis=1, return_counts=True)[1]) == {1, 2}
    assert set(np.unique(np.round(wires.points[:, 0], 1))) == {0.0, 2.5, 5.0, 20.0, 22.5}
    spans = np.ptp(wires.points[triangles(wires)][..., 0], axis=1)
    assert spans.max() == pytest.approx(2.5)
    assert fence_meshes("A", axis, np.zeros((1, 3))) == []
    assert fence_meshes("A", axis, np.zeros((0, 3))) == []


def test_which_sites_are_fenced() -> None:
    """A user's word holds; railways always are, towns never, and 0.6 of the roads."""
    site = draw_site(SiteSettings(crossing="river", fences=False), ROAD, stream(5, "site"))
    assert not fences(site, "")
    land = replace(site.land, plots=None)
    rails = replace(land, layout=replace(ROAD, track=object()))
    assert site.land.plots is not None
    town = replace(rails, plots=replace(site.land.plots, land="town"))

    def share(land: object) -> float:
        rng = np.random.default_rng(1)
        return float(np.mean([fenced(None, land, rng) for _ in range(2000)]))  # pyright: ignore[reportArgumentType]

    assert share(land) == pytest.approx(0.6, abs=0.04)
    assert share(rails) == 1.0
    assert share(town) == 0.0
    assert fenced(True, town, np.random.default_rng(1))
    assert not fenced(False, rails, np.random.default_rng(1))


def test_the_countryside_carries_the_fences_on(site: Site) -> None:
    """Beyond the strip each fence goes on at its own distance, from its last post; unfenced land has none."""
    pieces = build_background("countryside", BackgroundSettings(), site, stream(5, "background"))
    far = [part for part in solids(pieces) if "_Fence_" in part.name and part.name.endswith("_Posts")]
    assert len(far) >= 3
    offsets = {(number, side): offset for number, side, offset in fence_sides(site.land)}
    for part in far:
        number, side = int(part.name.split("_")[2]), part.name.split("_")[3]
        approach, offset = site.land.approaches[number], offsets[number, side]
        middles, ends = posts(part)
        station, left = site.land.layout.alignment.locate(middles)
        np.testing.assert_allclose(left - approach.center(station), offset, atol=0.05)
        assert (ends[:, 1] - ends[:, 0] > 1.6).all()
    (kept,) = site.keep_out  # larger than the strip of a skewed bridge, and left empty
    first = np.concatenate([part.mesh.points for part in far])
    assert not kept.contains(first).any()
    assert kept.contains(first, margin=-PITCH).any()
    standing = np.concatenate([posts(part)[0] for part in far])
    trees = np.concatenate([run.positions[:, :2] for run in runs(pieces) if run.kind in ("tree", "shrub")])
    assert np.linalg.norm(trees[:, None] - standing, axis=2).min() > 0.6
    crops = [part for part in solids(pieces) if part.group == "Ground" and part.name.split("_")[1] in TILLED]
    assert crops
    middles = np.concatenate([part.mesh.points[triangles(part.mesh)].mean(axis=1) for part in crops])
    station, left = site.land.layout.alignment.locate(middles)
    for number, side, offset in fence_sides(site.land):
        approach, way = site.land.approaches[number], 1.0 if side == "L" else -1.0
        beside = (approach.along(station) > 0.0) & (way * (left - approach.center(station)) > 0.0)
        assert (way * (left - approach.center(station)))[beside].min() > abs(offset)  # between road and fence is grass
    bare = draw_site(SiteSettings(crossing="river", fences=False), ROAD, stream(5, "site"))
    none = build_background("countryside", BackgroundSettings(), bare, stream(5, "background"))
    assert not [part for part in solids(none) if "_Fence_" in part.name]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_no_fence_stands_in_an_anchor_block(seed: int) -> None:
    """Beside suspension bridges the fences end behind the blocks, which stand where the wing walls are."""
    settings = parse_settings(AuthoringSettings, {"bridge": {"family": "suspension"}, "site": {"fences": True}}, "test")
    own = scene_seed(seed, 0)
    layout, drawn = draw_layout(settings.bridge, stream(own, "bridge"))
    site = draw_site(settings.site, layout, stream(own, "site"))
    blocks = [part for part in solids(build_bridge(layout, drawn, site.ground)) if part.kind == "anchor_block"]
    assert len(blocks) == 4
    posted = np.concatenate([part.mesh.points for part in fences(site, "")])
    station, left = layout.alignment.locate(posted)
    for block in blocks:
        along, aside = layout.alignment.locate(block.mesh.points)
        inside = (station > along.min() - 0.5) & (station < along.max() + 0.5)
        assert not (inside & (left > aside.min() - 0.5) & (left < aside.max() + 0.5)).any()


def test_no_fence_where_a_fill_is_wider_than_the_strip() -> None:
    """A high, wide road on a narrow strip has no fence: it would stand on the fill."""
    high = Layout(Alignment(20.0), (0.0, 30.0), 30.0, 1.9, "road", 28.0, 3.4)
    settings = SiteSettings(crossing="river", fences=True, half_width=40.0, fine_spacing=1.6, coarse_spacing=5.0)
    site = draw_site(settings, high, stream(5, "site"))
    assert site.land.fences == fence_offsets(replace(site.land, plots=None), (60.0, 40.0)) == ((0.0, 0.0), (0.0, 0.0))
    assert not fences(site, "")


def test_fields_of_the_site_lie_behind_the_fences() -> None:
    """No post stands in a field, yard or lot of the site."""
    settings = SiteSettings(crossing="river", land="fields", fences=True, run_out=120.0)
    for seed in range(3):
        site = draw_site(settings, ROAD, stream(seed, "site"))
        land = site.land
        for part in fences(site, "_Posts"):
            station, left = land.layout.alignment.locate(posts(part)[0])
            assert land.plot_room(station, left, lambda s, _: np.zeros_like(s)).max() < 0.0
