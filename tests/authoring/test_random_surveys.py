"""Random surveys of every kind over every family: safe by exact distances, steady, and within what was asked."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import FAMILIES, build_bridge
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from authoring.surveys.local import DECIMALS
from authoring.surveys.registry import plan_survey
from authoring.surveys.settings import AnySurvey, GlobalSettings, GridSettings, LocalSettings
from authoring.surveys.subject import Subject, make_subject, piece_corners
from authoring.surveys.turning import angle_between, pitch_of
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.test_local_survey import exact_distance
from tests.conftest import Count, RecordProof

F64 = NDArray[np.float64]
Drawn = tuple[Subject, F64]


def drawn_bridge(family: str, seed: int) -> Drawn:
    """A bridge on its site, and every triangle of both."""
    layout, record = draw_layout(parse_settings(BridgeSettings, {"family": family}, "test"), stream(seed, "bridge"))
    site = draw_site(SiteSettings(), layout, stream(seed, "site"))
    bridge = build_bridge(layout, record, site.ground)
    subject = make_subject(bridge, site.pieces)
    return subject, np.concatenate([subject.bridge, piece_corners(site.pieces)[0]])


def drawn_survey(kind: str, rng: np.random.Generator) -> AnySurvey:
    """Settings that a user might choose."""
    if kind == "local":
        pitch = ("free", "limited")[int(rng.integers(2))]
        free = LocalSettings(
            kind="local",
            length=float(rng.uniform(14, 26)),
            beside=float(rng.uniform(4, 9)),
            above=float(rng.uniform(3, 7)),
            pitch="free",
            near=float(rng.uniform(2, 4)),
        )
        limit = float(rng.uniform(0, 30))
        return free if pitch == "free" else free.model_copy(update={"pitch": pitch, "pitch_limit": limit})
    if kind == "grid":
        return GridSettings(
            kind="grid",
            sampling=float(rng.uniform(0.008, 0.016)),
            deck=bool(rng.integers(2)),
            camera=("default_24mm", "mini_like")[int(rng.integers(2))],
            width=960,
            height=720,
        )
    tour = "rings" if kind == "rings" else "loop"
    poi = ("axis", "box50")[int(rng.integers(2))]
    return GlobalSettings(tour=tour, poi=poi, spacing=float(rng.uniform(2.5, 6.0)), safety=float(rng.uniform(1, 2.5)))


def true_clearance(places: F64, corners: F64, reach: float) -> float:
    """Least distance of places to triangles, exact where it is below a reach [m]."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    inside = ((high > places.min(axis=0) - reach) & (low < places.max(axis=0) + reach)).all(axis=1)
    corners, low, high = corners[inside], low[inside], high[inside]
    best = reach
    for place in places:
        gap = np.maximum(np.maximum(low - place, place - high), 0.0)
        close = np.einsum("ij,ij->i", gap, gap) < best * best
        if close.any():
            best = min(best, float(exact_distance(place[None], corners[close])[0]))
    return best


def check_flight(settings: AnySurvey, poses: F64, drawn: Drawn) -> tuple[float, float]:
    """Assert the rules of one flight; give its margin over the safety distance [m] and its widest turn [deg]."""
    places, turned = poses[:, :3, 3], poses[:, :3, :3]
    assert not isinstance(settings, LocalSettings) or 40 <= len(poses) <= 120
    safety = float(getattr(settings, "safety", 0.0))
    clear = true_clearance(places, drawn[1], safety + 0.5)
    assert clear >= safety - 1e-4
    np.testing.assert_allclose(turned @ turned.transpose(0, 2, 1), np.tile(np.eye(3), (len(poses), 1, 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(turned), 1.0, atol=1e-9)
    turns = np.degrees([angle_between(a, b) for a, b in pairwise(turned)])
    if isinstance(settings, LocalSettings):
        chords = np.linalg.norm(np.diff(places, axis=0), axis=1)
        assert 0.45 <= chords.min() <= chords.max() <= 0.5 + np.sqrt(3.0) * 10.0**-DECIMALS  # positions are rounded
        assert turns.max() < 40.0  # no flip: neighboring images turn little
        if settings.pitch == "limited":
            assert np.degrees(pitch_of(turned)).max() <= settings.pitch_limit + 1e-6
    return clear - safety, float(turns.max())


def test_random_surveys_over_all_families(proof_count: Count, record_proof: RecordProof) -> None:
    """Kinds and families in turn, settings drawn; a flight that is refused says why, and few are."""
    count, bridges = proof_count(4, 200), proof_count(2, 30)
    kinds, families = ("local", "global", "rings", "grid"), sorted(FAMILIES)
    quick = ("beam", "slab", "girder", "arch")  # of moderate size
    margins: dict[str, list[float]] = {kind: [] for kind in kinds}
    refused, flown, widest = [], 0, 0.0
    for bridge in range(bridges):
        family = (families if bridges > 2 else quick)[bridge % (len(families) if bridges > 2 else len(quick))]
        drawn = drawn_bridge(family, 100 + bridge)
        for number in range(bridge, count, bridges):
            rng = np.random.default_rng(number)
            kind = kinds[int(rng.integers(4))] if bridges > 2 else kinds[number % 4]
            settings = drawn_survey(kind, rng)
            try:
                poses = plan_survey(settings, drawn[0], number).poses
            except InputError as error:
                refused.append(f"{family} {kind}: {error}")
                continue
            margin, turn = check_flight(settings, poses, drawn)
            margins[kind].append(margin)
            widest = max(widest, turn) if kind == "local" else widest
            flown += 1
    assert len(refused) <= 0.05 * count, refused
    assert all("survey." in line for line in refused), refused
    figures = {
        "flown": flown,
        "refused": refused,
        "families": len(families) if bridges > 2 else bridges,
        "widest_local_turn_deg": widest,
        **{f"{kind}_least_margin_m": min(values) for kind, values in margins.items() if values},
    }
    record_proof("surveys/random flights over all families", count, 100, figures)


def test_true_clearance_sees_what_is_near() -> None:
    """The exact check itself: a triangle at a known distance, and nothing within reach."""
    corners = np.array([[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]])
    assert true_clearance(np.array([[1.0, 1.0, 0.7], [9.0, 9.0, 9.0]]), corners, 2.0) == pytest.approx(0.7)
    assert true_clearance(np.array([[9.0, 9.0, 9.0]]), corners, 2.0) == 2.0
