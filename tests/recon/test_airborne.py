"""Laser scans from an aircraft against closed forms: strips, lines, pulses, and what is hidden below a deck."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.sampling.airborne import airborne_rays, pulses_on, strips_over, swath_width
from recon.sampling.sampler_settings import AirborneSettings
from recon.sampling.scan_pattern import Rays
from tests.recon.scanned_scenes import EXACT, deck_on_walls, ground, scanned

F64 = NDArray[np.float64]
CLEAR = {**EXACT, "path_noise": 0.0, "max_incidence": 90.0, "range_at_10_percent": 5000.0, "kind": "airborne"}
# What `deck_on_walls` is made of: middle and size [m].
BOXES = (
    ((10.0, 0.0, 6.5), (20.0, 8.0, 1.0)),
    ((1.0, 0.0, 3.0), (2.0, 8.0, 6.0)),
    ((19.0, 0.0, 3.0), (2.0, 8.0, 6.0)),
    ((10.0, 3.9, 7.5), (20.0, 0.2, 1.0)),
)


def flown(strips: F64, settings: AirborneSettings) -> Rays:
    """Put all rays behind each other."""
    parts = list(airborne_rays(strips, settings, np.random.default_rng(1)))
    names = ("origins", "directions", "errors", "station")
    return Rays(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def first_hits(rays: Rays) -> F64:
    """Cut rays with the level ground and with each box, slab by slab; the nearest cut, shape (N, 3)."""
    nearest = -rays.origins[:, 2] / rays.directions[:, 2]
    for middle, size in BOXES:
        corners = np.array([np.subtract(middle, np.divide(size, 2)), np.add(middle, np.divide(size, 2))])
        with np.errstate(divide="ignore"):
            cuts = (corners[:, None] - rays.origins) / rays.directions
        enter, leave = cuts.min(axis=0).max(axis=1), cuts.max(axis=0).min(axis=1)
        nearest = np.where(enter <= leave, np.minimum(nearest, enter), nearest)
    return rays.origins + nearest[:, None] * rays.directions


@pytest.mark.parametrize("heading", [0.0, 33.0, 90.0, None])
def test_strips_cover_the_box(heading: float | None) -> None:
    """Each place of the box lies below a strip; neighbors are flown against each other and overlap as asked."""
    settings = AirborneSettings(altitude=150.0, overlap=0.25, heading=heading)
    box = np.array([[-210.0, 40.0, -5.0], [320.0, 260.0, 30.0]])
    strips = strips_over(box, 20.0, settings, np.random.default_rng(3))
    assert (strips[..., 2] == 170.0).all()
    swath = 2.0 * 150.0 * np.tan(np.deg2rad(20.0))
    assert swath_width(settings) == pytest.approx(swath)
    ways = strips[:, 1, :2] - strips[:, 0, :2]
    ahead = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    np.testing.assert_allclose(ahead[1:], -ahead[:-1], atol=1e-12)
    if heading is not None:
        np.testing.assert_allclose(ahead[0], [np.cos(np.deg2rad(heading)), np.sin(np.deg2rad(heading))], atol=1e-12)
    left = np.array([-ahead[0, 1], ahead[0, 0]])
    sides = strips[:, 0, :2] @ left
    np.testing.assert_allclose(np.diff(sides), 0.75 * swath)
    places = np.random.default_rng(0).uniform(box[0, :2], box[1, :2], (5000, 2))
    places[:4] = [box[i, :2] * [1, 0] + box[j, :2] * [0, 1] for i in (0, 1) for j in (0, 1)]
    assert (np.abs(places @ left - sides[:, None]).min(axis=0) <= swath / 2 + 1e-9).all()
    runs = np.sort(strips[:, :, :2] @ ahead[0], axis=1)
    assert ((places @ ahead[0] >= runs[0, 0] - 1e-9) & (places @ ahead[0] <= runs[0, 1] + 1e-9)).all()
    away = np.abs(places @ left - sides[:, None]).min(axis=1)
    assert (away < swath / 2).all()  # no strip lies beside the box


def test_lines_and_pulses_lie_as_speed_and_rates_say() -> None:
    """On level ground: lines speed / line rate apart, pulses at altitude · tan(angle), each at its own place."""
    settings = AirborneSettings(
        altitude=100.0, speed=50.0, line_rate=80.0, pulses_per_line=40, field_of_view=30.0, path_noise=0.05
    )
    strips = np.array([[[0.0, 0.0, 100.0], [200.0, 0.0, 100.0]], [[0.0, 40.0, 100.0], [0.0, -60.0, 100.0]]])
    rays = flown(strips, settings)
    assert len(rays.origins) == pulses_on(strips, settings) == (321 + 161) * 40
    np.testing.assert_array_equal(rays.station, np.repeat([0, 1], [321 * 40, 161 * 40]))
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=1), 1.0)
    met = (rays.origins - rays.origins[:, 2:] / rays.directions[:, 2:] * rays.directions)[: 321 * 40].reshape(-1, 40, 3)
    np.testing.assert_allclose(np.diff(met[:, :, 0], axis=0), 50.0 / 80.0, atol=1e-9)
    angles = np.deg2rad(30.0 * ((np.arange(40) + 0.5) / 40 - 0.5))
    np.testing.assert_allclose(met[:, :, 1], np.broadcast_to(100.0 * np.tan(angles), (321, 40)), atol=1e-9)
    np.testing.assert_allclose(met[7, :, 0], (7 + np.arange(40) / 40) * 50.0 / 80.0, atol=1e-9)
    beneath = np.diff(met[0, 18:22, 1])
    np.testing.assert_allclose(beneath, 100.0 * np.deg2rad(30.0) / 40, rtol=2e-3)  # altitude · view / pulses
    long = AirborneSettings(pulses_per_line=2, path_noise=0.05, path_noise_length=0.5, line_rate=400.0)
    errors = flown(np.array([[[0.0, 0.0, 100.0], [3000.0, 0.0, 100.0]]]), long).errors
    np.testing.assert_allclose(errors.std(axis=0), 0.05, rtol=0.06)


def test_every_pulse_meets_what_it_should(tmp_path: Path) -> None:
    """Each pulse gives the point where ray and boxes cut; below the deck is what slanting rays reach, and no soffit."""
    given = {**CLEAR, "altitude": 60.0, "line_rate": 120.0, "pulses_per_line": 90, "heading": 20.0, "reach": 15.0}
    cloud = scanned(deck_on_walls(), tmp_path / "c", **given)
    assert cloud.source == "lidar-airborne"
    box, settings = np.array([[-15.0, -19.0, -15.0], [35.0, 19.0, 23.0]]), AirborneSettings.model_validate(given)
    strips = strips_over(box, 8.0, settings, np.random.default_rng(0))
    expected = first_hits(flown(strips, settings))
    assert cloud.statistics["rays"] == len(expected)
    found = cloud.columns["coord"]
    np.testing.assert_allclose(found, expected[((expected >= box[0]) & (expected <= box[1])).all(axis=1)], atol=1e-6)
    x, y, z = found.T
    below = (z < 5.99) & (x > 2.01) & (x < 17.99) & (np.abs(y) < 3.99)
    inward = 4.0 - np.abs(y[below])  # through the open side, as far as the widest ray reaches from the deck's edge
    assert below.sum() > 20
    assert (inward <= (6.0 - z[below]) * np.tan(np.deg2rad(20.0)) + 1e-6).all()
    assert (cloud.columns["normal"][:, 2] > -1e-6).all()  # nothing that looks down is seen
    steep = scanned(deck_on_walls(), tmp_path / "d", **{**given, "field_of_view": 0.2, "overlap": 0.0, "reach": 1.0})
    x, y, z = steep.columns["coord"].T
    assert not ((z < 5.9) & (np.abs(x - 10) < 7.9) & (np.abs(y) < 3.9)).any()


def test_the_whole_surroundings_are_seen(tmp_path: Path) -> None:
    """A hundred meters on every side without saying so; the points of a square meter follow from speed and rates."""
    given = {name: value for name, value in CLEAR.items() if name != "reach"}
    cloud = scanned(deck_on_walls(), tmp_path / "c", **given, altitude=300.0, line_rate=60.0, pulses_per_line=220)
    settings = AirborneSettings()
    assert settings.reach == 100.0
    low, high = cloud.columns["coord"].min(axis=0), cloud.columns["coord"].max(axis=0)
    np.testing.assert_allclose([low[0], high[0], low[1], high[1]], [-60.0, 60.0, -60.0, 60.0], atol=1.5)
    # The ground of the scene ends at 60 m, and one swath covers it: the aircraft is 308 m above the ground.
    single = 220 * 60.0 / (60.0 * 2.0 * 308.0 * np.tan(np.deg2rad(20.0)))
    count = len(cloud) / 120.0**2
    strips = len(cloud.statistics["strips"])
    assert 0.95 * single < count < 1.1 * single * strips


def test_too_many_pulses_are_refused(tmp_path: Path) -> None:
    """The message names the setting that an aircraft has."""
    with pytest.raises(InputError, match="pulses_per_line"):
        scanned(ground(), tmp_path / "a", kind="airborne", pulses_per_line=100_000, line_rate=2000.0, speed=1.0)
    low = AirborneSettings(altitude=100.0)
    assert pulses_on(np.array([[[0.0, 0, 0], [60.0, 0, 0]]]), low) == 201 * 800
