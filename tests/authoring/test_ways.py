"""Ways of a drone by themselves: equal steps, splines, eased corners, short cuts, over a field with one wall."""

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.surveys.gps import CORRELATION_TIME, GpsNoise, measured_positions
from authoring.surveys.subject import Subject
from authoring.surveys.way import _catmull_rom, eased_way, equal_steps, is_safe, rounded_way, shortcut
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]


@pytest.fixture(scope="module")
def subject() -> Subject:
    """A wall at x = 0 from y = -9 to 9, 20 m high, and nothing else."""
    corners = np.array([[0.0, -9.0, 0.0], [0.0, 9.0, 0.0], [0.0, 9.0, 20.0], [0.0, -9.0, 20.0]])
    wall = corners[[[0, 1, 2], [0, 2, 3]]]
    ids = np.ones(2, np.uint32)
    rays = RayScene(wall, ids)
    return Subject(wall, ids.astype(np.int32), np.zeros((0, 3)), rays, rays, ids.astype(np.int32), rays)


def test_equal_steps_and_rounding(subject: Subject) -> None:
    """Steps of a broken line are L / ceil(L / 0.5); a rounded way passes through its corners."""
    line = np.array([[0.0, 0.0, 40.0], [3.1, 0.0, 40.0], [3.1, 4.0, 40.0]])
    places = equal_steps(line, 0.5)
    assert len(places) == int(np.ceil(7.1 / 0.5)) + 1
    np.testing.assert_allclose(np.linalg.norm(np.diff(places[:6], axis=0), axis=1), 7.1 / 15)
    np.testing.assert_array_equal(places[[0, -1]], line[[0, -1]])
    assert len(equal_steps(np.array([[0.0, 0, 0], [4.0, 0, 0]]), 0.5)) == 9  # a length of whole steps takes no more
    for aside in (np.zeros(3), np.array([500.0, -800.0, 60.0])):
        curve = rounded_way(line + aside, subject, 1.0)
        for corner in line + aside:
            assert np.linalg.norm(curve - corner, axis=1).min() < 1e-9
        assert 72 <= len(curve) <= 74  # a decimeter each
        steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
        assert 0.05 < steps.min() < steps.max() < 0.2
    turned = np.diff(curve, axis=0) / steps[:, None]
    assert (turned[1:] * turned[:-1]).sum(axis=1).min() > np.cos(np.radians(10.0))  # no corner is left
    np.testing.assert_array_equal(rounded_way(line[:2], subject, 1.0), line[:2])


def test_a_spline_goes_evenly_through_its_corners() -> None:
    """Centripetal Catmull-Rom: a straight line of even corners stays one; ends and slopes join the next leg's."""
    even = np.array([[float(k), 2.0 * k, 0.0] for k in range(4)])
    share = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(_catmull_rom(even, share), even[1] + share[:, None] * (even[2] - even[1]), atol=1e-12)
    corners = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 3.0, 0], [2.0, 4.0, 5.0], [7.0, 4.0, 5.0]])
    first, second = (_catmull_rom(corners[k : k + 4], np.array([0.0, 1e-6, 1.0 - 1e-6, 1.0])) for k in (0, 1))
    np.testing.assert_allclose(first[[0, -1]], corners[1:3], atol=1e-12)
    np.testing.assert_allclose(second[[0, -1]], corners[2:4], atol=1e-12)
    knots = np.sqrt(np.linalg.norm(np.diff(corners, axis=0), axis=1))
    ahead, back = (second[1] - second[0]) / knots[2], (first[-1] - first[-2]) / knots[1]
    np.testing.assert_allclose(ahead, back, rtol=1e-4)


def test_a_leg_that_comes_too_near_stays_straight(subject: Subject) -> None:
    """A spline that bulges towards the wall is replaced by its chord, whose places are as close together."""
    way = np.array([[9.0, -6.0, 5.0], [2.0, -5.5, 5.0], [2.0, 5.5, 5.0], [9.0, 6.0, 5.0]])
    free, held = rounded_way(way, subject, 0.5), rounded_way(way, subject, 1.9)
    assert subject.clearance(free).min() < 1.9
    middle = held[(held[:, 1] > -5.4) & (held[:, 1] < 5.4) & (held[:, 0] < 3.0)]
    np.testing.assert_allclose(middle[:, 0], 2.0, atol=1e-9)
    assert np.ptp(np.diff(middle[:, 1])) < 1e-9


def test_safe_is_what_keeps_its_distance_between_the_probes(subject: Subject) -> None:
    """A way along the wall is safe at its distance less half a probe; looked at every decimeter all along."""
    along = np.array([[2.0, -5.0, 5.0], [2.0, 5.0, 5.0]])
    assert is_safe(along, subject, 1.94)
    assert not is_safe(along, subject, 1.96)
    dip = np.array([[5.0, 0.0, 5.0], [1.0, 0.0, 5.0], [5.0, 0.1, 5.0]])
    assert not is_safe(dip, subject, 1.5)
    assert is_safe(dip, subject, 0.85)


def test_short_cuts_join_what_sees_each_other(subject: Subject) -> None:
    """Six corners are skipped, then two, in the open; round the end of the wall no leg comes near it."""
    line = np.column_stack([np.full(25, 50.0), np.arange(25.0), np.full(25, 5.0)])
    np.testing.assert_allclose(shortcut(line, subject, 1.0)[:, 1], [0, 12, 24])
    round_it = np.array([[2.0, y, 5.0] for y in range(13)] + [[-2.0, y, 5.0] for y in range(12, -1, -1)])
    short = shortcut(round_it, subject, 1.0)
    np.testing.assert_array_equal(short[[0, -1]], round_it[[0, -1]])
    assert len(short) < 12
    assert is_safe(short, subject, 1.0)


def test_corners_are_eased_as_far_as_is_safe(subject: Subject) -> None:
    """Ends stay, the corner is cut by less than the widest ease, less where the wall is near, not at all at it."""
    corner = np.array([[8.0, 0.0, 5.0], [2.0, 0.0, 5.0], [2.0, 6.0, 5.0]])
    cuts = []
    for safety in (0.5, 1.8, 1.949):
        eased = eased_way(corner, subject, safety)
        np.testing.assert_allclose(eased[[0, -1]], corner[[0, -1]], atol=1e-9)
        assert len(eased) == 121
        cuts.append(float(np.linalg.norm(eased - corner[1], axis=1).min()))
    assert cuts == sorted(cuts, reverse=True)
    assert cuts[0] == pytest.approx(0.8 * np.sqrt(2.0 / np.pi) / np.sqrt(2.0), rel=0.05)  # of a Gauss along a corner
    nearer = np.array([[8.0, 0.0, 5.0], [1.0, 0.0, 5.0], [8.0, 1.0, 5.0]])
    fine = eased_way(nearer, subject, 3.0)
    np.testing.assert_array_equal(fine, equal_steps(nearer, 0.1))


def test_a_receivers_errors_are_their_three_parts() -> None:
    """White noise alone, a bias that remembers exp(-t / 60 s) alone, one altitude error alone, drawn in this order."""
    places, times = np.arange(30.0).reshape(10, 3), np.cumsum(np.arange(10.0) * 7)
    rng = np.random.default_rng(3)
    white, steps, lift = rng.normal(size=(10, 3)), rng.normal(size=(10, 3)), rng.normal()
    for noise in (
        GpsNoise((1.0, 2.0, 3.0), 0.0),
        GpsNoise((0.0, 0.0, 0.0), 0.7),
        GpsNoise((0.0, 0.0, 0.0), 0.0, 4.0),
        GpsNoise((0.5, 0.5, 0.9), 0.3, 2.0),
    ):
        bias = [noise.drift * steps[0]]
        for row in range(1, 10):
            kept = np.exp(-(times[row] - times[row - 1]) / CORRELATION_TIME)
            bias.append(kept * bias[-1] + noise.drift * np.sqrt(1.0 - kept * kept) * steps[row])
        wanted = places + white * noise.sigma + np.array(bias) + [0.0, 0.0, noise.altitude * lift]
        found = measured_positions(places, times, noise, np.random.default_rng(3))
        np.testing.assert_allclose(found, wanted, atol=1e-9)
