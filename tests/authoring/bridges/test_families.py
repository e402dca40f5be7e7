"""Every registered family against all that holds for bridges; a new one takes part by being registered."""

from collections.abc import Callable

import numpy as np
import pytest

from authoring.families.bridge_settings import draw_layout
from authoring.families.registry import FAMILIES
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from tests.authoring.bridges import invariants, structure
from tests.authoring.bridges.built import STRAIGHT, Figures, build_on, join_figures, make_bridge, settings_of
from tests.authoring.bridges.conftest import BUILDS, FIXED, INVARIANTS, Judged, profile_of
from tests.conftest import Count, RecordProof
from usd_schemas.components import class_of, class_rows

_MESSAGES = 12
_EVERYWHERE = {"deck", "parapet", "abutment", "bearing", "column", "pier_cap", "slab", "sleeper", "track"}
_HUNG = {"girder", "beam", "cable", "cable_base", "cable_top"}
_OWN = {
    "slab": set(),
    "beam": {"girder"},
    "girder": {"beam"},
    "arch": {"arch"},
    "suspension": _HUNG,
    "cable_stayed": _HUNG,
}
_WITHOUT_CABLES = {"slab", "beam", "girder"}
_CASES = [
    (family, name)
    for family in FAMILIES
    for name in (BUILDS, *(invariant.__name__ for invariant in INVARIANTS))
    if name != structure.cables_end_in_fittings.__name__ or family not in _WITHOUT_CABLES
]


@pytest.mark.parametrize(("family", "invariant"), _CASES)
def test_holds_for_every_bridge(
    family: str, invariant: str, judged: Callable[[str], Judged], record_proof: RecordProof
) -> None:
    """One invariant over the sample of one family; the row has what it came closest by, or how much it looked at."""
    table, measured = judged(family), Figures()
    wrong = {seed: found[invariant] for seed, (found, _) in table.items() if invariant in found}
    for _, figures in table.values():
        join_figures(measured, figures.get(invariant, {}))
    record_proof(f"bridges/{family}/{invariant}", len(table), min(table), dict(measured))
    if wrong:
        lines = [f"{family} {seed} ({profile_of(seed)}): {line}" for seed, found in wrong.items() for line in found]
        more = f"\n… and {len(lines) - _MESSAGES} more" if len(lines) > _MESSAGES else ""
        pytest.fail(
            f"{invariant}: {len(wrong)} of {len(table)} bridges\n" + "\n".join(lines[:_MESSAGES]) + more, pytrace=False
        )


def test_figures_are_joined_by_what_they_are() -> None:
    """Of margins the least counts, of errors the largest; what was looked at is added up."""
    figures = Figures()
    for room, error, count in ((0.5, 1e-3, 3), (0.2, 2e-3, 4), (0.9, 1e-4, 5)):
        join_figures(figures, {"least_room_m": room, "largest_error_m": error, "members": count})
    assert figures == {"least_room_m": 0.2, "largest_error_m": 2e-3, "members": 12.0}


@pytest.mark.parametrize("family", FAMILIES)
def test_same_seed_is_the_same_bytes(family: str, proof_count: Count, record_proof: RecordProof) -> None:
    """A seed gives one bridge to the byte, the next seed another."""
    count = proof_count(1, 200)
    before, members = None, 0
    for seed in range(FIXED, FIXED + count):
        one, two = make_bridge(family, seed), make_bridge(family, seed)
        assert len(one.members) == len(two.members)
        members += len(one.members)
        for first, second in zip(one.members, two.members, strict=True):
            assert (first.name, first.kind, first.role, first.instance_id, first.parameters) == (
                second.name,
                second.kind,
                second.role,
                second.instance_id,
                second.parameters,
            )
            for key in ("points", "face_counts", "corners", "normals", "st", "st1"):
                assert getattr(first.mesh, key).tobytes() == getattr(second.mesh, key).tobytes(), (first.name, key)
        assert one.drawn != (before or make_bridge(family, seed + 1).drawn)
        before = one.drawn
    record_proof(f"bridges/{family}/same_seed_same_bytes", count, FIXED, {"members": members})


@pytest.mark.parametrize("family", FAMILIES)
def test_railway_bridges_show_every_class_of_their_family(family: str) -> None:
    """The matrix of classes and families, on track slabs; all families together have the paper's sixteen."""
    wanted, seen = _EVERYWHERE | _OWN[family], set[str]()
    for seed in range(FIXED, FIXED + 12):
        bridge = make_bridge(family, seed, service="rail_double", track={"bed": "slab"})
        seen |= {class_of(member.kind) for member in bridge.members}
        if wanted <= seen:
            break
    assert wanted <= seen, wanted - seen
    paper = {row.name for row in class_rows()} - {"background", "noisy_point", "unlabelled"}
    assert _EVERYWHERE.union(*_OWN.values()) == paper


@pytest.mark.parametrize("family", FAMILIES)
def test_left_and_right_are_alike(family: str, proof_count: Count, record_proof: RecordProof) -> None:
    """A straight, square, unbanked bridge without fittings is the mirror image of itself."""
    count = proof_count(1, 200)
    members = 0
    for seed in range(FIXED, FIXED + count):
        bridge = make_bridge(family, seed, **STRAIGHT)
        members += len(bridge.members)
        wrong = structure.mirrored_about_the_axis(bridge)
        assert not wrong, f"{family} {seed}: " + "; ".join(wrong[:_MESSAGES])
    record_proof(f"bridges/{family}/mirrored_about_the_axis", count, FIXED, {"members": members})


@pytest.mark.parametrize("family", FAMILIES)
def test_stands_on_its_site(family: str, proof_count: Count, record_proof: RecordProof) -> None:
    """On the ground drawn for it nothing floats, and no ground reaches deck or girders between the abutments."""
    count = proof_count(1, 60)
    least = np.inf
    for seed in range(FIXED, FIXED + count):
        layout, drawn = draw_layout(settings_of(family), stream(seed, "bridge"))
        site = draw_site(SiteSettings(), layout, stream(seed, "site"))
        bridge = build_on(family, seed, layout, drawn, site.ground)
        wrong = invariants.nothing_floats(bridge)
        for member, points in zip(bridge.members, bridge.bridge_coordinates, strict=True):
            over = (points[:, 0] > layout.supports[0] + 1.0) & (points[:, 0] < layout.supports[-1] - 1.0)
            if class_of(member.kind) in ("deck", "girder", "beam") and over.any():
                height = member.mesh.points[over, 2] - site.ground(member.mesh.points[over, :2])
                least = min(least, float(height.min()))
                if height.min() < 0.3:
                    wrong.append(f"{member.name} is {height.min():.2f} m over the ground")
        assert not wrong, f"{family} {seed}: " + "; ".join(wrong[:_MESSAGES])
    record_proof(f"bridges/{family}/stands_on_its_site", count, FIXED, {"least_height_of_superstructure_m": least})


@pytest.mark.parametrize(("kind", "axis"), [("deck", 0), ("parapet", 0), ("pier_cap", 1), ("column", 2)])
def test_u_runs_along_a_member(kind: str, axis: int) -> None:
    """So that joints and board marks, which cross u, lie square to a member: decks ahead, caps across, columns up."""
    bridge = make_bridge("girder", FIXED, **STRAIGHT)
    along = whole = 0.0
    for member, points in zip(bridge.members, bridge.bridge_coordinates, strict=True):
        if class_of(member.kind) != kind:
            continue
        first = np.concatenate([[0], np.cumsum(member.mesh.face_counts)[:-1]])[:, None] + np.arange(3)
        corners, uv = points[member.mesh.corners[first]], member.mesh.st[first]
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
        turned = (one * b[:, 1:] - two * a[:, 1:]) * np.sign(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
        length = np.linalg.norm(turned, axis=1)
        area = np.linalg.norm(np.cross(one, two), axis=1)
        whole += float(area[length > 0].sum())
        along += float(area[(length > 0) & (np.abs(turned[:, axis]) > 0.97 * length)].sum())
    assert along > 0.9 * whole > 0.0, along / whole


@pytest.mark.parametrize("family", FAMILIES)
def test_layout_tells_the_truth(family: str, seeds: list[int]) -> None:
    """The site is told the deck's width and the supports as they are built."""
    for seed in seeds[:2]:
        bridge = make_bridge(family, seed)
        first, last = bridge.layout.supports[0], bridge.layout.supports[-1]
        lefts = [
            np.abs(points[(points[:, 0] > first) & (points[:, 0] < last), 1])
            for member, points in zip(bridge.members, bridge.bridge_coordinates, strict=True)
            if class_of(member.kind) in ("deck", "parapet")
        ]
        half = float(np.concatenate(lefts).max())
        assert half == pytest.approx(0.5 * bridge.layout.width, abs=0.1), (
            f"{family} {seed}: half a deck is {half:.3f} m"
        )
        assert list(bridge.layout.supports) == sorted(bridge.layout.supports)
