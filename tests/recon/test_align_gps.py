"""Measured positions place a model without judging its cameras, and what may be off is stated as it is."""

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.recon.gps_flights import Flight, draw_flight, place_flight, true_errors
from recon.photos.photo_xmp import camera_up_of
from recon.placing.align import OK, Target
from recon.placing.align_gps import align_to_fixes
from recon.placing.gps_fit import fit_to_fixes
from recon.placing.gravity import gravity_cues
from recon.placing.place_errors import expected_errors
from recon.placing.similarity import Similarity
from tests.conftest import Count, RecordProof
from tests.recon.test_align import level_flight, random_rotations

F64 = NDArray[np.float64]
LIMITS = ("scale", "tilt", "heading", "place")
SIGMA = (2.0, 2.0, 3.0)
UNSEEN = 300_000  # the first seed; the limits were chosen on flights 0 to 999


def fixes_of(gps: F64, sigma: tuple[float, float, float] = SIGMA, gimbal: F64 | None = None) -> Target:
    """Make the target of measured positions."""
    return Target("gps", gps, None, np.inf, np.tile(sigma, (len(gps), 1)), sigma, gimbal)


def tilt_of(found: Similarity, known: Similarity) -> float:
    """Measure the angle between two ups [deg]."""
    return float(np.degrees(np.arccos(np.clip((found.rotation @ known.rotation.T)[2, 2], -1.0, 1.0))))


def test_stated_limits_hold(proof_count: Count, record_proof: RecordProof) -> None:
    """Of many simulated flights 95 in 100 keep to each stated limit, give or take 3; few are said to be open."""
    count = proof_count(90, 1000)
    kept: list[list[bool]] = []
    for seed in range(UNSEEN, UNSEEN + count):
        flight = draw_flight(np.random.default_rng(seed))
        placed = place_flight(flight, np.random.default_rng(seed))
        if placed is not None:
            fit, limits = placed
            off = true_errors(flight, fit)
            kept.append([getattr(off, name) <= getattr(limits, name) for name in LIMITS])
    share = np.mean(kept, axis=0)
    record_proof(
        "recon: stated 95 % limits of GPS alignments",
        count,
        UNSEEN,
        {**dict(zip((f"{name}_within" for name in LIMITS), share.tolist(), strict=True)), "placed": len(kept)},
    )
    slack = 0.03 if count >= 1000 else 0.05  # one standard deviation of a share of 90 is 0.023
    assert (np.abs(share - 0.95) <= slack).all(), share
    assert len(kept) > 0.85 * count


def test_exact_positions_give_the_exact_similarity() -> None:
    """Without noise the known similarity comes back, whatever gravity says: it says little against millimeters."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        true, model, known = level_flight(rng, rng.normal(0, 20, (15, 3)))
        found = align_to_fixes(model, np.arange(15), fixes_of(true[:, :3, 3], (1e-3, 1e-3, 1e-3)), rng)
        np.testing.assert_allclose(found.similarity.move(np.eye(3)), known.move(np.eye(3)), atol=1e-2)
        assert found.errors is not None
        assert found.errors.scale < 0.1


def test_a_fix_that_strays_costs_no_camera() -> None:
    """A third of the fixes hundreds of meters off, one camera without any: all cameras stay, the fixes are named."""
    rng = np.random.default_rng(5)
    true, model, known = level_flight(rng, rng.normal(0, 40, (18, 3)))
    gps = true[:, :3, 3] + rng.normal(0, 1.0, (18, 3))
    gps[:6] += rng.normal(0, 200, (6, 3))
    gps[17] = np.nan
    found = align_to_fixes(model, np.arange(18), fixes_of(gps), rng)
    assert found.status == (OK,) * 18
    assert found.agreeing is not None
    assert found.agreeing.tolist() == [False] * 6 + [True] * 11 + [False]
    assert np.isnan(found.center_errors[17])
    assert found.similarity.scale == pytest.approx(known.scale, rel=0.05)
    assert tilt_of(found.similarity, known) < 3.0


def nadir(rng: np.random.Generator, centers: F64) -> tuple[F64, Similarity]:
    """Make poses in model units of cameras that all look straight down with one side ahead."""
    down = np.diag([1.0, -1.0, -1.0])
    known = Similarity(2.5, random_rotations(rng, 1)[0], np.array([10.0, -4.0, 3.0]))
    model = np.tile(np.eye(4), (len(centers), 1, 1))
    model[:, :3, :3] = known.rotation.T @ down
    model[:, :3, 3] = (centers - known.translation) @ known.rotation / known.scale
    return model, known


def test_photographs_straight_down_do_not_tilt_the_ground() -> None:
    """A short flight over a field, all photographs turned alike: their tops are north, not up, and the fixes say so."""
    rng = np.random.default_rng(1)
    lanes = np.array([[12.0 * x, 10.0 * y] for y in range(4) for x in range(4)])
    centers = np.column_stack([lanes, np.full(16, 60.0)])
    model, known = nadir(rng, centers)
    gps = centers + rng.normal(0, [1.5, 1.5, 0.8], (16, 3))
    found = align_to_fixes(model, np.arange(16), fixes_of(gps), rng)
    assert found.errors is not None
    assert found.errors.scale < 15.0
    assert tilt_of(found.similarity, known) < found.errors.tilt < 8.0
    assert found.status == (OK,) * 16


def test_a_gimbal_knows_up_where_fixes_do_not() -> None:
    """One straight lane, straight down: rows along it leave the roll open; the gimbal closes it."""
    rng = np.random.default_rng(2)
    centers = np.column_stack([np.linspace(0, 120, 20), np.zeros(20), np.full(20, 50.0)])
    model, known = nadir(rng, centers)
    gps = centers + rng.normal(0, 1.0, (20, 3))
    bare = align_to_fixes(model, np.arange(20), fixes_of(gps), rng)
    told = align_to_fixes(model, np.arange(20), fixes_of(gps, gimbal=np.tile(camera_up_of(-90.0, 0.0), (20, 1))), rng)
    assert not told.unfixed
    assert told.errors is not None
    assert tilt_of(told.similarity, known) < min(told.errors.tilt, 4.0)
    assert bare.errors is not None
    assert bare.unfixed or bare.errors.tilt > 2 * told.errors.tilt


def test_a_straight_flight_stands_upright() -> None:
    """Fixes along a line say nothing of the roll about it; level photographs do, and meters aside are right."""
    rng = np.random.default_rng(12)
    line = np.column_stack([np.linspace(0, 30, 40), np.zeros(40), np.full(40, 3.0)])
    _, model, known = level_flight(rng, line)
    gps = line + rng.normal(0, 0.5, (40, 3))
    aside = np.array([[15.0, 6.0, 3.0], [15.0, -6.0, 3.0]])
    local = (aside - known.translation) @ known.rotation / known.scale
    found = align_to_fixes(model, np.arange(40), fixes_of(gps, (0.5, 0.5, 0.5)), np.random.default_rng(1))
    assert np.linalg.norm(found.similarity.move(local) - aside, axis=1).max() < 0.6
    assert found.method == "fixes+gravity"


@pytest.mark.parametrize("kind", ["climb", "two fixes", "one place", "noise larger than the flight", "elsewhere"])
def test_what_fixes_no_frame_is_said(kind: str) -> None:
    """Straight up, too few, on one spot, drowned in noise, of another flight: upright, own units, and the reason."""
    rng = np.random.default_rng(3)
    centers = rng.normal(0, 6, (10, 3))
    if kind == "climb":
        centers = np.column_stack([np.zeros(10), np.zeros(10), np.linspace(3, 40, 10)])
    _, model, _ = level_flight(rng, centers)
    gps = centers + rng.normal(0, 0.1, (10, 3))
    if kind == "two fixes":
        gps[2:] = np.nan
    if kind == "one place":
        gps[:] = 0.0
    if kind == "noise larger than the flight":
        gps += rng.normal(0, 20.0, (10, 3))
    if kind == "elsewhere":
        gps = rng.normal(0, 900, (10, 3))
    found = align_to_fixes(model, np.arange(10), fixes_of(gps), rng)
    assert found.unfixed
    assert (found.similarity.scale, found.method) == (1.0, "up")
    assert found.status == (OK,) * 10
    assert found.agreeing is None


def test_better_fixes_weigh_more() -> None:
    """Ten fixes to a centimeter among thirty to meters, as of a receiver that now and then had its corrections."""
    rng = np.random.default_rng(7)
    sharp = np.arange(40) % 4 == 0
    stated = np.where(sharp, 0.01, 3.0)[:, None] * np.ones(3)
    off = []
    for trial in range(2):
        draw = np.random.default_rng(8)
        true, model, _ = level_flight(draw, draw.normal(0, 25, (40, 3)))
        gps = true[:, :3, 3] + draw.normal(0, 1, (40, 3)) * stated
        told = stated if trial == 0 else np.full((40, 3), 3.0)
        fit = fit_to_fixes(model[:, :3, 3], gps, told, gravity_cues(model[:, :3, :3], None), rng)
        assert fit is not None
        off.append(np.linalg.norm(fit.similarity.move(model[:, :3, 3]) - true[:, :3, 3], axis=1).mean())
        if trial == 0:
            assert expected_errors(fit, np.zeros(3)).place < 0.05
    assert off[0] < 0.03 < 0.3 < off[1]


@pytest.mark.parametrize("known", [0, 6])
def test_fixes_without_height_say_nothing_of_it(known: int) -> None:
    """A flight up a slope of 12 %, with no height or some: upright within the limit; what is put there is ignored."""
    rng = np.random.default_rng(6)
    angle = np.linspace(0.0, 2 * np.pi, 40)
    ring = 40 * np.column_stack([np.cos(angle), np.sin(angle)])
    true, model, world = level_flight(rng, np.column_stack([ring, 30 + 0.12 * ring[:, 0]]))
    fixes = fixes_of(true[:, :3, 3] + rng.normal(0, 1.0, (40, 3)))
    assert fixes.sigmas is not None
    fixes.sigmas[known:, 2] = np.inf
    places = []
    for height in (0.0, -25.0):
        fixes.centers[known:, 2] = height
        found = align_to_fixes(model, np.arange(40), fixes, np.random.default_rng(1))
        assert found.errors is not None
        assert tilt_of(found.similarity, world) < min(found.errors.tilt, 4.0)
        assert found.similarity.scale == pytest.approx(world.scale, rel=found.errors.scale / 100.0)
        assert np.nanmax(found.center_errors) < 6.0
        assert found.errors.heightless == (known == 0)
        assert ("height unknown" in found.errors.in_words()) == ("height" in found.errors.facts()) == (known == 0)
        middle = found.similarity.move(model[:, :3, 3]).mean(axis=0) - true[:, :3, 3].mean(axis=0)
        assert np.linalg.norm(middle[: 3 if known else 2]) < found.errors.place < 10.0
        places.append(found.similarity)
    np.testing.assert_allclose(places[0].rotation, places[1].rotation, atol=1e-6)
    assert places[0].scale == pytest.approx(places[1].scale, rel=1e-6)


def test_the_scale_is_not_that_of_the_noise() -> None:
    """Noise as large as a third of the flight leaves the scale unbiased; a ratio of spreads makes it larger."""
    found, ratio = [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        true, model, known = level_flight(rng, rng.normal(0, [9, 9, 3], (60, 3)))
        gps = true[:, :3, 3] + rng.normal(0, 3.0, (60, 3))
        source = model[:, :3, 3]
        fit = fit_to_fixes(source, gps, np.full((60, 3), 3.0), gravity_cues(model[:, :3, :3], None), rng)
        assert fit is not None
        found.append(fit.similarity.scale / known.scale)
        spread = np.linalg.norm(gps - gps.mean(axis=0)) / np.linalg.norm(source - source.mean(axis=0))
        ratio.append(spread / known.scale)
    assert np.mean(found) == pytest.approx(1.0, abs=3.5 * np.std(found) / np.sqrt(30) + 0.01)
    assert np.mean(ratio) > 1.05


def test_flights_repeat() -> None:
    """The same seed draws the same flight and places it the same, bit for bit."""

    def once() -> tuple[Flight, float]:
        flight = draw_flight(np.random.default_rng(4))
        placed = place_flight(flight, np.random.default_rng(4))
        assert placed is not None
        return flight, placed[0].similarity.scale

    assert once()[1] == once()[1]
