"""Flights: the rules that every survey keeps, and how well the loop round a bridge sees it."""

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from authoring.component import Component, Scatter
from authoring.families.registry import build_bridge
from authoring.layout import BridgeSettings, draw_layout
from authoring.site import SiteSettings, draw_site
from authoring.streams import stream
from authoring.surveys.box import oriented_box
from authoring.surveys.gaze import aim, inner_box
from authoring.surveys.gps import GpsNoise, measured_positions
from authoring.surveys.registry import plan_survey
from authoring.surveys.settings import GlobalSettings
from authoring.surveys.subject import Subject, make_subject, piece_corners
from authoring.surveys.whole import bearing_lines, clear_route, draw_route, place_images
from groundwork.errors import InputError
from tests.authoring.boxes import box, box_bridge, flat_site
from tests.authoring.flight_views import neighbour_overlap, views_per_instance, visible_pixels
from tests.conftest import Count, RecordProof
from usd_schemas.components import class_of
from usd_schemas.pinhole import look_at, project

F64 = NDArray[np.float64]


@pytest.fixture(scope="module")
def subject() -> Subject:
    """Gather the bridge of boxes on its flat site."""
    return make_subject(box_bridge(), flat_site())


def test_box_is_the_turned_rectangle() -> None:
    """A turned and moved block gives its own size, centre and direction."""
    rng = np.random.default_rng(1)
    for angle in rng.uniform(-np.pi / 2, np.pi / 2, 20):
        inside = rng.uniform(-1, 1, (200, 3))
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        local = np.concatenate([inside, corners]) * [20.0, 5.0, 3.0]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        points = local.copy()
        points[:, :2] = local[:, :2] @ turn.T
        found = oriented_box(points + np.array([100.0, -50.0, 7.0]))
        np.testing.assert_allclose(found.half, [20.0, 5.0, 3.0], atol=1e-4)
        np.testing.assert_allclose(found.center, [100.0, -50.0, 7.0], atol=1e-4)
        assert abs(found.axes[0, :2] @ turn[:, 0]) == pytest.approx(1.0, abs=1e-9)
        assert np.linalg.det(found.axes) == pytest.approx(1.0)
        np.testing.assert_allclose(found.to_world(found.to_local(points)), points, atol=1e-9)


def test_images_stand_at_equal_steps() -> None:
    """On a circle the images are a regular polygon; the count grows where the spacing asks for it."""
    turns = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    circle = np.column_stack([10 * np.cos(turns), 10 * np.sin(turns), np.zeros(4000)])
    even = np.ones(len(circle))
    placed = place_images(circle, even, least=30, spacing=100.0)
    chords = np.linalg.norm(np.roll(placed, -1, axis=0) - placed, axis=1)
    np.testing.assert_allclose(chords, 20 * np.sin(np.pi / 30), rtol=1e-5)
    assert len(place_images(circle, even, least=8, spacing=1.0)) == int(np.ceil(2 * np.pi * 10))
    twice = place_images(circle, np.where(circle[:, 1] > 0, 2.0, 1.0), least=30, spacing=100.0)
    assert (twice[:, 1] > 0).sum() == pytest.approx(20, abs=1)


def test_half_box_rule_is_exact(subject: Subject) -> None:
    """With the paper's rule the counterpart on the box of half the size lies on every principal axis."""
    settings = GlobalSettings(poi="box50")
    poses = plan_survey(settings, subject, 3).poses
    frame = oriented_box(subject.bridge.reshape(-1, 3))
    local = frame.to_local(poses[:, :3, 3])
    middle = np.array([0.0, 0.0, (local[:, 2].min() + local[:, 2].max()) / 2])
    counterparts = frame.to_world((middle + local) / 2)
    camera = plan_survey(settings, subject, 3).calibration
    for pose, point in zip(poses, counterparts, strict=True):
        pixel, depth = project(point[None], camera, pose)
        np.testing.assert_allclose(pixel[0], [camera.cx, camera.cy], atol=0.05)
        assert depth[0] > 0
    np.testing.assert_array_equal(inner_box(local), local / 2)


def test_cameras_are_rigid_and_level() -> None:
    """Every pose is a rotation without roll whose forward axis meets its target, looking straight down included."""
    rng = np.random.default_rng(5)
    eyes, targets = rng.normal(size=(50, 3)) * 10, rng.normal(size=(50, 3))
    targets[0] = eyes[0] - [0.0, 0.0, 3.0]
    poses = aim(eyes, targets)
    turns = poses[:, :3, :3]
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turns), 1.0)
    np.testing.assert_allclose(turns[:, 2, 0], 0.0, atol=1e-12)
    assert (turns[:, 2, 1] <= 1e-12).all()  # down in the image is down in the world
    np.testing.assert_array_equal(poses[3], look_at(eyes[3], targets[3]))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_flight_keeps_its_rules(subject: Subject, seed: int) -> None:
    """Distance to every triangle by brute force, height over ground, spacing, closure and timing."""
    settings = GlobalSettings()
    path = plan_survey(settings, subject, seed)
    positions = path.poses[:, :3, 3]
    corners = np.concatenate([subject.bridge, piece_corners(flat_site())[0]])
    nearest = np.array([_brute_distance(position, corners) for position in positions])
    assert nearest.min() >= settings.safety
    assert positions[:, 2].min() >= -0.5 + settings.over_ground - 0.05
    steps = np.linalg.norm(np.roll(positions, -1, axis=0) - positions, axis=1)
    assert len(positions) >= settings.images
    assert steps.max() <= settings.spacing
    along = np.abs(positions[:, 0] - 20) < 15
    assert steps[along & np.roll(along, -1)].min() > 0.85 * steps.max()
    assert np.median(steps[np.abs(positions[:, 0] - 20) > 18.5]) < 0.6 * steps.max()
    np.testing.assert_allclose(np.diff(path.times), steps[:-1] / settings.speed, rtol=1e-9)
    around = np.unwrap(np.arctan2(positions[:, 1], positions[:, 0] - 20))
    assert abs(around[-1] - around[0]) > 1.9 * np.pi


def test_flights_are_drawn(subject: Subject) -> None:
    """The same seed flies the same path, another seed another one; the noise of the GPS has its own stream."""
    first, again, other = (plan_survey(GlobalSettings(), subject, seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.poses, again.poses)
    np.testing.assert_array_equal(first.gps, again.gps)
    assert np.abs(first.poses[0] - other.poses[0]).max() > 1.0
    quiet = plan_survey(GlobalSettings(gps_sigma=(0.1, 0.1, 0.1)), subject, 4)
    np.testing.assert_array_equal(first.poses, quiet.poses)


def test_obstacles_push_the_route_away() -> None:
    """A mast beside the bridge moves the route off it; floors everywhere are an error that names one."""
    mast = Component("Site_Mast", "pole", "rock", "Ways", box((9, -13.5, -0.5), (11, -11.5, 30)), 40_001)
    settings = GlobalSettings(stand_off=(7.5, 7.5))
    blocked = make_subject(box_bridge(), (*flat_site(), mast))
    positions = plan_survey(settings, blocked, 1).poses[:, :3, 3]
    assert blocked.clearance(positions).min() >= settings.safety
    floors = tuple(
        Component(f"Site_Floor_{z:02d}", "building", "rock", "Ways", box((-60, -60, z), (100, 60, z + 0.2)), 40_100 + z)
        for z in range(0, 60, 2)
    )
    with pytest.raises(InputError, match=r"the instance 401\d\d is in the way"):
        plan_survey(settings, make_subject(box_bridge(), (*flat_site(), *floors)), 1)


def test_free_routes_stay(subject: Subject) -> None:
    """A route with room to spare is not touched."""
    frame = oriented_box(subject.bridge.reshape(-1, 3))
    route = draw_route(GlobalSettings(), frame, np.zeros(0), subject, stream(1, "survey/x"))
    np.testing.assert_array_equal(clear_route(route, frame, subject, 1.5), route)


def test_bearing_lines_are_grouped() -> None:
    """Two rows of bearings on one pier are one line."""
    seats = np.array([[18.6, 1, 5], [0, 1, 4], [17.4, -1, 5], [0, -1, 4], [40, 0, 6.0]])
    np.testing.assert_allclose(bearing_lines(seats), [[0, 4], [18, 5], [40, 6]])


def test_gps_noise_has_the_stated_size() -> None:
    """Over many flights the error has the stated spread along each axis, and the bias lasts from image to image."""
    true, times = np.zeros((60, 3)), np.arange(60.0)
    flights = np.stack(
        [
            measured_positions(true, times, GpsNoise((0.5, 0.5, 0.8), 0.3), np.random.default_rng(seed))
            for seed in range(400)
        ]
    )
    np.testing.assert_allclose(flights.std(axis=(0, 1)), np.hypot([0.5, 0.5, 0.8], 0.3), rtol=0.05)
    assert np.abs(flights.mean(axis=(0, 1))).max() < 0.05
    covariance = (flights[:, 1:] * flights[:, :-1]).mean(axis=(0, 1))
    np.testing.assert_allclose(covariance, 0.09 * np.exp(-1 / 60), atol=0.02)


def test_pixels_agree_with_the_pinhole() -> None:
    """A plate square in front of a camera covers the area that its projection says."""
    plate = Component("Plate", "deck_slab", "Role_DeckConcrete", "Superstructure", box((-2, 10, -1), (2, 10.1, 1)), 5)
    far = Component("Site_Far", "ground", "grass", "Ground", box((-500, 400, -500), (500, 401, 500)), 40_000)
    flown = plan_survey(GlobalSettings(), make_subject(box_bridge(), flat_site()), 1)
    pose = look_at(np.zeros(3), np.array([0.0, 1.0, 0.0]))
    path = type(flown)(**{**vars(flown), "poses": np.stack([pose, pose])})
    ids, counts = visible_pixels(path, make_subject((plate,), (far,)))
    expected = (4 * path.calibration.fx / 10) * (2 * path.calibration.fx / 10)
    assert ids.tolist() == [5]
    np.testing.assert_allclose(counts[:, 0], expected, rtol=0.03)
    np.testing.assert_allclose(neighbour_overlap(path, make_subject((plate,), (far,))), 1.0)


def test_every_class_is_well_seen(proof_count: Count, record_proof: RecordProof) -> None:
    """On drawn bridges every class has enough large views, bearings included, and neighbours overlap."""
    seeds = range(proof_count(2, 30))
    seen: dict[str, list[float]] = {}
    overlaps, counts = [], []
    for seed in seeds:
        subject, kinds = _drawn(seed)
        path = plan_survey(GlobalSettings(), subject, seed)
        ids, pixels = visible_pixels(path, subject)
        classes = np.array([class_of(kinds[int(number)]) for number in ids])
        often = views_per_instance(pixels, least=50) >= 3
        for name in np.unique(classes):
            seen.setdefault(str(name), []).append(float(often[classes == name].mean()))
        overlaps.append(float(neighbour_overlap(path, subject).mean()))
        counts.append(len(path.poses))
    worst = {name: min(shares) for name, shares in sorted(seen.items())}
    assert set(worst) >= {"abutment", "bearing", "column", "deck", "girder", "parapet", "pier_cap"}
    # Diaphragms hide between the girders of wide bridges, and one wing wall may lie behind its embankment.
    least = {"bearing": 0.5, "girder": 0.4, "abutment": 0.7, "background": 0.4}  # scuppers and conduits are small
    assert all(share >= least.get(name, 0.85) for name, share in worst.items()), worst
    assert min(overlaps) > 0.7
    record_proof(
        "surveys: share of instances with 50 px in 3 images, worst bridge", len(seeds), 0,
        {**{f"{name}_share": share for name, share in worst.items()}, "least_mean_overlap": min(overlaps),
         "most_images": max(counts)},
    )  # fmt: skip


def _drawn(seed: int) -> tuple[Subject, dict[int, str]]:
    layout, record = draw_layout(BridgeSettings(service="road"), stream(seed, "bridge"))
    site = draw_site(SiteSettings(), layout, stream(seed, "site"))
    bridge = build_bridge(layout, record, site.ground)
    kinds = {}
    for piece in bridge:
        numbers = piece.instance_ids if isinstance(piece, Scatter) else (piece.instance_id,)
        kinds.update(dict.fromkeys(numbers, piece.kind))
    return make_subject(bridge, site.pieces), kinds


def _brute_distance(point: F64, corners: F64) -> float:
    nearest = trimesh.triangles.closest_point(corners, np.repeat(point[None], len(corners), axis=0))
    return float(np.linalg.norm(nearest - point, axis=1).min())
