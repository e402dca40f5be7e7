"""Where laser scanners stand and drive, which rays they send, and which of these miss the bridge."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from groundwork.errors import InputError
from recon.sampling.sample_lidar import meets_box
from recon.sampling.sampler_settings import MobileSettings, TerrestrialSettings
from recon.sampling.scan_pattern import Rays, mobile_rays, tripod_rays
from recon.sampling.scan_places import deck_way, place_stations
from recon.sampling.scene_surface import lay_out
from tests.recon.scanned_scenes import deck_on_walls, ground, named, scanned
from usd_schemas.pinhole import look_at
from usd_schemas.raycast import RayScene


def test_a_tripod_looks_into_every_direction() -> None:
    """Columns times elevations; every elevation as often as every other; chunks do not change a ray."""
    settings = TerrestrialSettings(angular_step=1.0, lowest=-30.0, highest=60.0)
    (rays,) = tripod_rays(np.array([[1.0, 2.0, 3.0]]), settings, np.random.default_rng(4))
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=1), 1.0)
    assert len(rays.directions) == 360 * 91
    elevations = np.rad2deg(np.arcsin(rays.directions[:, 2]))
    values, counts = np.unique(np.round(elevations, 6), return_counts=True)
    np.testing.assert_allclose(values, np.arange(-30.0, 61.0), atol=1e-6)
    assert (counts == 360).all()
    fine = list(tripod_rays(np.zeros((2, 3)), TerrestrialSettings(angular_step=0.4), np.random.default_rng(4)))
    assert len(fine) == 4
    assert max(len(part.directions) for part in fine) <= 250_000
    one, other = fine[0], fine[1]  # the second chunk goes on where the first one ends
    row = len(one.directions) % 376
    np.testing.assert_allclose(np.rad2deg(np.arcsin(other.directions[:2, 2])), [0.4 * row - 60, 0.4 * row - 59.6])


def test_a_moving_scanner_turns_as_it_goes() -> None:
    """Place and angle of each shot follow from its number; the error of the path has the spread that was asked for."""
    settings = MobileSettings(
        beams=3,
        lowest=-10.0,
        highest=10.0,
        angular_step=1.0,
        rate=4.0,
        speed=2.0,
        tilt=30.0,
        path_noise=0.05,
        path_noise_length=0.01,
    )
    path = np.array([[0.0, 0.0, 1.0], [30.0, 0.0, 1.0], [30.0, 30.0, 4.0]])
    parts = list(mobile_rays(path, settings, np.random.default_rng(1)))
    origins, directions, errors = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("origins", "directions", "errors")
    )
    length = 30.0 + np.hypot(30.0, 3.0)
    assert len(origins) == (int(length / 2.0 * 4.0 * 360) + 1) * 3
    shot = 360 * 10 + 90  # after ten turns and a quarter: 5.125 m on, looking left
    np.testing.assert_allclose(origins[3 * shot], [10.25 / 2, 0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(directions[3 * shot + 1], [0.0, 1.0, 0.0], atol=1e-9)
    ahead = directions[3 * 360 * 10 + 1]  # the plane of rotation rises ahead by the tilt
    np.testing.assert_allclose(ahead, [np.cos(np.pi / 6), 0.0, np.sin(np.pi / 6)], atol=1e-9)
    axis = np.array([-np.sin(np.pi / 6), 0.0, np.cos(np.pi / 6)])
    first = origins[:, 0] < 29.9
    lifts = np.rad2deg(np.arcsin(directions[first] @ axis)).reshape(-1, 3)
    np.testing.assert_allclose(lifts, np.broadcast_to([-10.0, 0.0, 10.0], lifts.shape), atol=1e-9)
    np.testing.assert_allclose(errors.std(axis=0), 0.05, rtol=0.05)
    np.testing.assert_allclose(origins[-1], path[-1], atol=0.01)


def test_stations_stand_where_a_surveyor_would(tmp_path: Path) -> None:
    """On the ground or on the deck, never inside a wall, with space around; together they see nearly all there is."""
    scene = deck_on_walls()
    surface = lay_out(scene)
    rays = RayScene(surface.corners, surface.instances)
    bridge = surface.instances > 1
    settings = TerrestrialSettings(stations=8)
    stations = place_stations(scene, surface, bridge, rays, settings, np.random.default_rng(0))
    assert 3 <= len(stations) <= 8
    on_deck, on_ground = np.isclose(stations[:, 2], 8.8), np.isclose(stations[:, 2], 1.8)
    assert (on_deck | on_ground).all()
    assert on_deck.any()
    assert on_ground.sum() >= 2
    inside = (
        (np.abs(stations[:, 1]) < 4)
        & on_ground
        & ((np.abs(stations[:, 0] - 1) < 1) | (np.abs(stations[:, 0] - 19) < 1))
    )
    assert not inside.any()
    assert rays.distance(stations)[0].min() >= 0.6
    seen = scanned(scene, tmp_path / "c", angular_step=1.0, scope="bridge").columns
    assert set(seen["instance"].tolist()) == {2, 3, 4, 5}
    soffit = (seen["instance"] == 2) & (seen["normal"][:, 2] < -0.9)
    assert soffit.sum() > 1500
    water = named(ground(20.0), water=(1, "background"))
    with pytest.raises(InputError, match="no firm ground"):
        scanned(water, tmp_path / "lake")


def test_a_vehicle_drives_along_the_deck(tmp_path: Path) -> None:
    """In the middle of the deck, at the scanner's height; it sees the deck's top and nothing of its underside."""
    scene = deck_on_walls()
    way = deck_way(scene, lay_out(scene), 2.2, 0.0)
    assert np.abs(way[:, 1]).max() < 0.1
    np.testing.assert_allclose(way[:, 2], 9.2, atol=1e-6)
    assert way[0, 0] < 1.0
    assert way[-1, 0] > 19.0
    longer = deck_way(scene, lay_out(scene), 2.2, 7.0)
    np.testing.assert_array_equal(longer[1:-1], way)
    np.testing.assert_allclose([way[0, 0] - longer[0, 0], longer[-1, 0] - way[-1, 0]], 7.0, atol=0.01)
    np.testing.assert_allclose(longer[:, 2], 9.2, atol=1e-6)
    cloud = scanned(scene, tmp_path / "c", kind="mobile", angular_step=2.0, beams=8, run_up=0.0)
    assert cloud.source == "lidar-mobile"
    assert "station" not in cloud.columns
    deck = cloud.columns["instance"] == 2
    assert (cloud.columns["normal"][deck, 2] > 0.9).mean() > 0.95
    flown = scanned(
        dataclasses.replace(
            scene,
            cameras=(
                dataclasses.replace(
                    scene.cameras[0],
                    poses=np.stack([look_at(np.array([x, -12.0, 3.0]), np.array([10.0, 0, 3])) for x in (0, 20)]),
                ),
            ),
        ),
        tmp_path / "d",
        kind="mobile",
        path="test",
        angular_step=2.0,
        beams=8,
    )
    assert (flown.columns["instance"] >= 3).any()
    with pytest.raises(InputError, match="the camera of this survey does not move"):
        scanned(scene, tmp_path / "e", kind="mobile", path="test")
    with pytest.raises(InputError, match="no such survey"):
        scanned(scene, tmp_path / "f", kind="mobile", path="other")
    with pytest.raises(InputError, match="no deck"):
        scanned(ground(), tmp_path / "g", kind="mobile")


def test_rays_that_miss_the_box_are_known() -> None:
    """Against points along each ray, also for rays that run along an axis and that start within."""
    rng = np.random.default_rng(2)
    origins, directions = rng.uniform(-3, 3, (900, 3)), rng.normal(size=(900, 3))
    directions[:100, 0] = 0.0
    directions[60:150, 2] = 0.0
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    box = np.array([[-1.0, -0.5, -0.7], [1.0, 1.5, 0.9]])
    rays = Rays(origins, directions, np.zeros((900, 3)), np.zeros(900, np.uint16))
    along = np.linspace(0.0, 10.0, 2001)[:, None, None]
    inside = (
        ((origins + along * directions >= box[0]) & (origins + along * directions <= box[1])).all(axis=2).any(axis=0)
    )
    found = meets_box(rays, box)
    assert found[inside].all()
    assert (found & ~inside).mean() < 0.01  # a corner cut between two of the points
    assert 0.05 < inside.mean() < 0.9
