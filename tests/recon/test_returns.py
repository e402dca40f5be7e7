"""Several returns of one laser pulse against closed forms: what leaves let through, and what nothing lets through."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.canonical import folder_digest
from recon.sampling.echoes import Echoes, Target
from recon.sampling.sample_lidar import PLANTS, WATER
from recon.sampling.sampler_settings import AirborneSettings, MobileSettings, TerrestrialSettings
from recon.sampling.scan_pattern import Rays
from recon.sampling.scene_surface import lay_out, made_of
from recon.sampling.surface_look import SurfaceLook
from tests.recon.scanned_scenes import EXACT, POSE, SQUARE, scanned
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.flat_scene import FlatScene, InstanceRow
from usd_schemas.raycast import RayScene

COUNT = 6000
HEIGHTS = (0.0, 4.0, 6.0, 9.0)  # [m] ground, and three layers of leaves
WEAK = 0.01  # share of the pulses of which a layer left, or got, too little for an echo


def layers(kind: str = "tree") -> FlatScene:
    """Build a level ground and three squares of leaves above it."""
    builder = SceneBuilder()
    kinds = ("ground", kind, kind, kind)
    for number, height in enumerate(HEIGHTS, 1):
        builder.add_mesh(SQUARE, placed((0.0, 0.0, height), (20.0, 20.0, 1.0)), number)
    rows = tuple(InstanceRow(n, f"/P{n}", name, "background", {}, name) for n, name in enumerate(kinds, 1))
    return dataclasses.replace(builder.build(POSE), instances=rows)


def straight_down(scene: FlatScene, **chosen: float) -> Echoes:
    """Send pulses straight down from 100 m, each at a place of its own."""
    surface = lay_out(scene)
    rays = RayScene(surface.corners, surface.instances)
    made = (made_of(scene, surface, kinds) for kinds in (WATER, PLANTS))
    target = Target(surface, SurfaceLook(scene, surface), rays, *made)
    rng = np.random.default_rng(7)
    origins = np.column_stack([rng.uniform(-19.0, 19.0, (COUNT, 2)), np.full(COUNT, 100.0)])
    down = np.tile([0.0, 0.0, -1.0], (COUNT, 1))
    settings = AirborneSettings.model_validate({**EXACT, "range_at_10_percent": 5000.0, "leaf_gap": 0.0, **chosen})
    shots = Rays(origins, down, np.zeros_like(down), np.zeros(COUNT, np.uint16))
    return target.echoes(shots, settings, np.random.default_rng(1))


def at_each_height(found: Echoes) -> list[NDArray[np.bool_]]:
    """Tell which points lie at each of the heights; there are no others, and no pulse has two at one height."""
    z = 100.0 - found.measured
    masks = [np.abs(z - height) < 1e-6 for height in HEIGHTS]
    assert sum(int(mask.sum()) for mask in masks) == len(z)
    assert all(len(np.unique(found.shots[mask])) == mask.sum() for mask in masks)
    return masks


@pytest.mark.parametrize(
    ("returns", "expected"), [(1, (0, 0, 0, 1)), (2, (0, 0, 1, 1)), (3, (0, 1, 1, 1)), (4, (1, 1, 1, 1))]
)
def test_a_pulse_gives_as_many_returns_as_it_may(returns: int, expected: tuple[int, ...]) -> None:
    """Leaves without gaps: every pulse meets the first layers from above, then the ground, which stops all of it."""
    counts = [int(mask.sum()) for mask in at_each_height(straight_down(layers(), returns=returns))]
    np.testing.assert_allclose(counts, [COUNT * share for share in expected], atol=WEAK * COUNT)


def test_gaps_between_leaves_are_as_frequent_as_said() -> None:
    """Each layer, whatever lies above, is met by the same share of the pulses, the ground by all of them."""
    masks = at_each_height(straight_down(layers(), returns=4, leaf_gap=0.3))
    met = [mask.mean() * len(mask) / COUNT for mask in masks]
    np.testing.assert_allclose(met[1:], 0.7, atol=4.0 * np.sqrt(0.21 / COUNT))
    assert met[0] == pytest.approx(1.0, abs=WEAK)


def test_an_echo_is_as_strong_as_what_is_left_of_the_pulse() -> None:
    """Any share is caught alike: of equal surfaces the echoes are a half, a quarter, an eighth, and what remains.

    Those of one pulse sum up to that of open ground.
    """
    found = straight_down(layers(), returns=4)
    means = [found.intensities[mask].mean() for mask in at_each_height(found)]
    whole = straight_down(layers("building"), returns=4).intensities
    assert np.ptp(whole) < 1e-9
    np.testing.assert_allclose(np.array(means[::-1]) / whole[0], [0.5, 0.25, 0.125, 0.125], atol=0.02)
    np.testing.assert_allclose(np.bincount(found.shots, found.intensities), whole[0], rtol=2e-3)


def test_weak_echoes_are_not_measured() -> None:
    """At a distance at which half a pulse is just seen, the first layer is seen by the half that it caught more of."""
    whole = straight_down(layers("building")).intensities[0]
    seen_at = 91.0 * np.sqrt(0.1 / (0.5 * whole))  # range_at_10_percent: half a pulse, 91 m down, is the limit
    found = straight_down(layers(), returns=4, range_at_10_percent=seen_at)
    highest = at_each_height(found)[3]
    assert highest.sum() / COUNT == pytest.approx(0.5, abs=4.0 * np.sqrt(0.25 / COUNT))
    assert found.intensities[highest].min() >= 0.499 * whole


def test_what_is_too_near_behind_a_return_gives_none() -> None:
    """The layer 2 m below one is not told apart from its fellow above; those farther below one are."""
    counts = [int(mask.sum()) for mask in at_each_height(straight_down(layers(), returns=4, return_gap=2.5))]
    np.testing.assert_allclose(counts, [COUNT, 0, COUNT, COUNT], atol=WEAK * COUNT)


@pytest.mark.parametrize("kind", ["building", "vegetation"])
def test_only_trees_and_shrubs_let_a_pulse_through(kind: str) -> None:
    """A roof stops all of it, and so does land that is green."""
    counts = [int(mask.sum()) for mask in at_each_height(straight_down(layers(kind), returns=4))]
    assert counts == [0, 0, 0, COUNT]


def test_a_scan_holds_the_returns_and_follows_the_seed(tmp_path: Path) -> None:
    """Points of the ground below leaves are labeled so; same seed, same bytes; one return unless an aircraft scans."""
    given = {**EXACT, "kind": "airborne", "altitude": 60.0, "line_rate": 60.0, "pulses_per_line": 60, "reach": 1.0}
    digests = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        cloud = scanned(layers(), tmp_path / name, **given, seed=seed)
        assert set(np.unique(cloud.columns["instance"])) == {1, 2, 3, 4}
        under = cloud.columns["instance"] == 1
        assert (np.abs(cloud.columns["coord"][under, 2]) < 0.2).all()
        digests.append(folder_digest(tmp_path / name))
    assert digests[0] == digests[1] != digests[2]
    alone = scanned(layers(), tmp_path / "d", **given, returns=1)
    assert (alone.columns["instance"] == 4).mean() > 0.95
    assert (TerrestrialSettings().returns, MobileSettings().returns, AirborneSettings().returns) == (1, 1, 4)
