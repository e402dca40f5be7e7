"""Bridges over water: which piers stand in it and how, and how far all else keeps from it, on the site's ground."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial import KDTree

from authoring.families.bridge_settings import draw_layout
from authoring.families.registry import FAMILIES
from authoring.shapes.component import F64, Component, triangles
from authoring.site.crossing import CrossingKind
from authoring.site.grid import HeightField
from authoring.site.land import draw_land, strip_ground, strip_lines
from authoring.site.roads import water_half
from authoring.site.shape import Land
from authoring.site.site import LONG, SiteSettings
from authoring.streams import stream
from groundwork.errors import InputError
from tests.authoring.boxes import box
from tests.authoring.bridges.built import Bridge, build_on, settings_of
from tests.authoring.bridges.conftest import FIXED, profile_of
from tests.conftest import Count, RecordProof

KINDS: tuple[CrossingKind, ...] = ("river", "harbour", "valley")
STEP = 0.25  # of the grid on which water is looked for, and of the outlines of what stands in it [m]
CORNER = 1.0  # of a footing that water may wash: those of profile `paper` are long [m]
PIERS = ("column", "wall_pier", "pier_footing")
FOOTINGS = ("pier_footing", "abutment_footing")
ASIDE = 12.0  # beside the deck that the grid reaches [m]
DEEP = 1.5  # least distance of a pier in a river from the water's edge [m]
IN_RIVER = {"slab": 4, "beam": 4, "girder": 2}  # number of seeds looked at: of bridges with piers in a river


@dataclass(frozen=True)
class Shore:
    """A bridge, and the ground and water that it stands in."""

    bridge: Bridge
    land: Land
    field: HeightField


def _over_water(family: str, seed: int) -> Iterator[Shore]:
    """Draw a bridge, and build it over each water that suits it; another ground has other piers."""
    layout, drawn = draw_layout(settings_of(family, profile=profile_of(seed)), stream(seed, "bridge"))
    site, axis = SiteSettings(), layout.alignment
    spacing = site.fine_spacing * max((layout.supports[-1] - layout.supports[0]) / LONG, 1.0)
    for kind in KINDS:
        try:
            land = draw_land(kind, site.relief, layout, site.run_out, stream(seed, "site"))
        except InputError:  # no room for it under this bridge
            continue
        if land.crossing.kind == "river":  # a road may run along a valley
            lines = strip_lines(land, site.run_out, site.half_width, (site.fine_reach, spacing, site.coarse_spacing))
            field, _ = strip_ground(land, *lines)

            def ground(xy: F64, field: HeightField = field) -> F64:
                return field(*axis.locate(xy))

            yield Shore(build_on(family, seed, layout, drawn, ground), land, field)


def _water(shore: Shore) -> F64:
    """Places round the bridge that water covers: plan [m], shape (N, 2), float64."""
    crossing, field, layout = shore.land.crossing, shore.field, shore.land.layout
    half_deck = 0.5 * layout.width
    lefts = np.arange(-half_deck - ASIDE, half_deck + ASIDE, STEP)
    reach = 1.5 * water_half(crossing) / float(np.cos(layout.alignment.skew)) + 3.0
    station, left = np.meshgrid(np.arange(-reach, reach, STEP), lefts)
    station = station + crossing.center(left)
    wet = field(station.ravel(), left.ravel()).reshape(station.shape) < crossing.level
    wet &= crossing.distance(station, left) < water_half(crossing)
    place = layout.alignment.point(station[wet], left[wet], np.zeros(int(wet.sum())))
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


def _washed(shore: Shore, points: F64) -> float:
    """How far some points reach into the water, past the line up to which it was meant to lie [m]; 0 on dry land."""
    crossing = shore.land.crossing
    station, left = shore.land.layout.alignment.locate(points)
    wet = shore.field(station, left) < crossing.level
    return float(np.max((crossing.half_width - crossing.distance(station, left))[wet], initial=0.0))


def _away(points: F64, water: F64) -> float:
    """Least distance in plan of some points from water [m]."""
    return float(np.min(np.asarray(KDTree(water).query(points[:, :2])[0])))


@pytest.mark.parametrize("family", FAMILIES)
def test_nothing_stands_in_the_current(family: str, proof_count: Count, record_proof: RecordProof) -> None:
    """All of a bridge that is as low as the water, in the ground too, keeps from the water that lies on the ground.

    A narrow river may wash the end of a footing of profile `paper`: never a pier, wall or tower. The piers that the
    land names stand in the river.
    """
    count = proof_count(2, 60)
    bridges, low, washed, wrong = 0, 0, 0.0, []
    least = {True: np.inf, False: np.inf}
    for seed in range(FIXED, FIXED + count):
        for shore in _over_water(family, seed):
            bridges += 1
            level, water = shore.land.crossing.level, _water(shore)
            for member in shore.bridge.members:
                if member.mesh.points[:, 2].min() < level and not _in_river(shore, member):
                    low += 1
                    points, footing = _outline(member, level), member.kind in FOOTINGS
                    away = _away(points, water)
                    least[footing] = min(least[footing], away)
                    reach = _washed(shore, points)
                    washed = max(washed, reach)
                    if (away < 2.0 * STEP and not footing) or reach > CORNER:
                        wrong.append(f"{family} {seed} {member.name}: {away:.2f} m")
    figures: dict[str, float] = {"members_below_water": low, "footings_reach_into_water_m": round(washed, 2)}
    names = {"least_distance_of_footings_m": least[True], "least_distance_of_others_m": least[False]}
    figures |= {name: round(away, 2) for name, away in names.items() if np.isfinite(away)}
    record_proof(f"bridges/{family}/nothing stands in the current", bridges, FIXED, figures)
    assert bridges > 0
    assert not wrong, "\n".join(wrong[:20])


def _in_river(shore: Shore, member: Component) -> bool:
    """Check whether a member belongs to a pier that the land places in the river."""
    return member.kind in PIERS and member.parameters["support"] in shore.land.crossing.piers


def _misplaced(shore: Shore, member: Component) -> list[str]:
    """Tell what is wrong with a shaft or footing in a river."""
    crossing, points = shore.land.crossing, _outline(member, shore.land.crossing.level)
    station, left = shore.land.layout.alignment.locate(points)
    bed, wrong = shore.field(station, left), []
    if member.kind == "pier_footing":
        if points[:, 2].max() > bed.min() - 0.25 or np.ptp(points[:, 2]) < 0.3:
            wrong.append(f"its top is {bed.min() - points[:, 2].max():.2f} m under the bed")
        return wrong
    if np.min(crossing.half_width - crossing.distance(station, left)) < DEEP:
        wrong.append("it stands near the edge of the water")
    if bed.max() > crossing.level - 0.4:
        wrong.append(f"the water is only {crossing.level - bed.max():.2f} m deep at it")
    return wrong


def _unfounded(shore: Shore, support: int) -> list[str]:
    """Tell which shafts of a pier in a river end above its footing."""
    own = [member for member in shore.bridge.members if member.parameters.get("support") == support]
    (footing,) = (member for member in own if member.kind == "pier_footing")
    top = footing.mesh.points[:, 2].max()
    shafts = [member for member in own if member.kind in ("column", "wall_pier")]
    assert shafts
    return [f"{shaft.name} floats" for shaft in shafts if shaft.mesh.points[:, 2].min() > top - 1e-3]


@pytest.mark.parametrize("family", sorted(IN_RIVER))
def test_piers_in_a_river_stand_on_its_bed(family: str) -> None:
    """Shafts keep from the water's edge and reach their footings, whose tops lie under the bed; caps hang above."""
    seen, wrong = 0, []
    for seed in range(FIXED, 60):
        layout, _ = draw_layout(settings_of(family, profile=profile_of(seed)), stream(seed, "bridge"))
        if not draw_land("river", 1.0, layout, 60.0, stream(seed, "site")).crossing.piers:
            continue
        shore = next(_over_water(family, seed))
        crossing = shore.land.crossing
        for member in shore.bridge.members:
            if _in_river(shore, member):
                wrong += [f"{family} {seed} {member.name}: {fault}" for fault in _misplaced(shore, member)]
            elif member.kind == "pier_cap" and member.mesh.points[:, 2].min() < crossing.level + 1.0:
                wrong.append(f"{family} {seed} {member.name} hangs near the water")
        wrong += [f"{family} {seed} {fault}" for support in crossing.piers for fault in _unfounded(shore, support)]
        seen += 1
        if seen == IN_RIVER[family]:
            break
    assert seen == IN_RIVER[family]
    assert not wrong, "\n".join(wrong[:20])


@pytest.mark.parametrize("aside", [0.0, 0.7, 1.6])
def test_what_stands_in_the_current_is_found(aside: float) -> None:
    """A post of 0.5 m in the middle, near the edge, and beside the water, by half widths of it from the middle."""
    shore = next(_over_water("beam", FIXED))
    crossing, axis = shore.land.crossing, shore.land.layout.alignment
    station = np.array([crossing.station + aside * crossing.half_width * float(crossing.stretch(np.zeros(1))[0])])
    foot = axis.point(station, np.zeros(1), np.zeros(1))[0]
    post = box((foot[0], foot[1], -9.0), (foot[0] + 0.5, foot[1] + 0.5, 3.0))
    points = _outline(Component("Post", "column", "Role_PierConcrete", "Piers", post, 1), crossing.level)
    away = _away(points, _water(shore))
    assert away == pytest.approx(max(aside - 1.0, 0.0) * crossing.half_width, abs=3.0 * STEP)
