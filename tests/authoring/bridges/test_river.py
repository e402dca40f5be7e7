"""Bridges over water: how far their piers, towers and footings keep from it, where it lies on the site's ground."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.spatial import cKDTree

from authoring.families.bridge_settings import draw_layout
from authoring.families.registry import FAMILIES
from authoring.shapes.component import F64, Component, triangles
from authoring.site.crossing import CrossingKind
from authoring.site.roads import water_half
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from groundwork.errors import InputError
from tests.authoring.bridges.built import Bridge, build_on, settings_of
from tests.authoring.bridges.conftest import FIXED, profile_of
from tests.conftest import Count, RecordProof

KINDS: tuple[CrossingKind, ...] = ("river", "harbour", "valley")
STEP = 0.25  # of the grid on which water is looked for, and of the outlines of what stands in it [m]
ASIDE = 12.0  # beside the deck that the grid reaches [m]


def _over_water(family: str, seed: int) -> Iterator[tuple[Bridge, Site]]:
    """Draw a bridge, and build it over each water that suits it; another ground has other piers."""
    layout, drawn = draw_layout(settings_of(family, profile=profile_of(seed)), stream(seed, "bridge"))
    for kind in KINDS:
        try:
            site = draw_site(SiteSettings(crossing=kind), layout, stream(seed, "site"))
        except InputError:  # no room for it under this bridge
            continue
        if site.land.crossing.kind == "river":  # a road may run along a valley
            yield build_on(family, seed, layout, drawn, site.ground), site


def _water(site: Site, half_deck: float) -> F64:
    """Places round the bridge that water covers: plan [m], shape (N, 2), float64."""
    crossing, field = site.land.crossing, site.field
    lefts = np.arange(-half_deck - ASIDE, half_deck + ASIDE, STEP)
    reach = 1.5 * water_half(crossing) / float(np.cos(site.land.layout.alignment.skew)) + 3.0
    station, left = np.meshgrid(np.arange(-reach, reach, STEP), lefts)
    station = station + crossing.center(left)
    wet = field(station.ravel(), left.ravel()).reshape(station.shape) < crossing.level
    wet &= crossing.distance(station, left) < water_half(crossing)
    place = site.land.layout.alignment.point(station[wet], left[wet], np.zeros(int(wet.sum())))
    return place[:, :2]


def _outline(member: Component, level: float) -> F64:
    """Points along a member's outline on a level, and along all its edges below: positions [m], shape (N, 3)."""
    corners = member.mesh.points[triangles(member.mesh)]
    edges = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)  # of each triangle, shape (T, 3, 2, 3)
    above = edges[..., 2] > level
    one, two = edges[above[..., 0] != above[..., 1]].swapaxes(0, 1)  # two of each triangle that the level cuts
    share = (level - one[:, 2]) / (two[:, 2] - one[:, 2])
    cut = (one + share[:, None] * (two - one)).reshape(-1, 2, 3)
    lines = np.concatenate([cut, edges[~above.any(axis=-1)]])
    count = int(np.ceil(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).max(initial=0.0) / STEP)) + 1
    return np.concatenate([lines[:, 0] + part * (lines[:, 1] - lines[:, 0]) for part in np.linspace(0.0, 1.0, count)])


@pytest.mark.parametrize("family", FAMILIES)
def test_nothing_stands_in_the_current(family: str, proof_count: Count, record_proof: RecordProof) -> None:
    """All of a bridge that is as low as the water, in the ground too, keeps from the water that lies on the ground."""
    count = proof_count(2, 60)
    bridges, low, wrong, least = 0, 0, [], np.inf
    for seed in range(FIXED, FIXED + count):
        for bridge, site in _over_water(family, seed):
            bridges += 1
            crossing = site.land.crossing
            tree = cKDTree(_water(site, 0.5 * bridge.layout.width))
            for member in bridge.members:
                points = _outline(member, crossing.level)
                if len(points):
                    low += 1
                    away = float(tree.query(points[:, :2])[0].min())
                    least = min(least, away)
                    if away < 2.0 * STEP:
                        wrong.append(f"{family} {seed} {crossing.half_width:.1f} m {member.name}: {away:.2f} m")
    figures = {"members_below_water": low, "least_distance_to_water_m": round(least, 2)}
    record_proof(f"bridges/{family}/nothing stands in the current", bridges, FIXED, figures)
    assert bridges > 0
    assert not wrong, "\n".join(wrong[:20])
