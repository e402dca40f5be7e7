"""Flights: the rules that every survey keeps, and how well the loop round a bridge sees it."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import build_bridge
from authoring.shapes.component import Component, Scatter
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from authoring.surveys.attitude import attitude_of, measured_attitude
from authoring.surveys.box import oriented_box
from authoring.surveys.camera_models import calibration, camera_models
from authoring.surveys.framing import eye_of
from authoring.surveys.gaze import aim, inner_box
from authoring.surveys.gps import GpsNoise, measured_positions
from authoring.surveys.registry import plan_survey
from authoring.surveys.rings import draw_rings, extended_box
from authoring.surveys.settings import GlobalSettings
from authoring.surveys.subject import Subject, make_subject, piece_corners
from authoring.surveys.whole import bearing_lines, clear_route, draw_route, place_images, turns_to_next
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.boxes import box, box_bridge, flat_site
from tests.authoring.flight_views import neighbor_overlap, views_per_instance, visible_pixels
from tests.conftest import Count, RecordProof
from usd_schemas.components import class_of
from usd_schemas.distortion import Distortion
from usd_schemas.pinhole import Pinhole, look_at, project

F64 = NDArray[np.float64]
_END = "parapet_end_block"


@pytest.fixture(scope="module")
def subject() -> Subject:
    """Gather the bridge of boxes on its flat site."""
    return make_subject(box_bridge(), flat_site())


def test_box_is_the_turned_rectangle() -> None:
    """A turned and moved block gives its own size, center and direction."""
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
    placed, _ = place_images(circle, even, least=30, spacing=100.0)
    chords = np.linalg.norm(np.roll(placed, -1, axis=0) - placed, axis=1)
    np.testing.assert_allclose(chords, 20 * np.sin(np.pi / 30), rtol=1e-5)
    assert len(place_images(circle, even, least=8, spacing=1.0)[0]) == int(np.ceil(2 * np.pi * 10))
    twice, _ = place_images(circle, np.where(circle[:, 1] > 0, 2.0, 1.0), least=30, spacing=100.0)
    assert (twice[:, 1] > 0).sum() == pytest.approx(20, abs=1)


@pytest.mark.parametrize("seed", [1, 2])
def test_cameras_of_a_loop_turn_gently(subject: Subject, seed: int) -> None:
    """Where a camera would turn too far to the next, there are more images; elsewhere the flight stays as it is."""
    wide, gentle = (
        plan_survey(GlobalSettings(images=8, spacing=9.0, turn=turn), subject, seed).poses for turn in (180.0, 20.0)
    )
    assert turns_to_next(wide).max() > 30.0
    assert turns_to_next(gentle).max() <= 20.0 + 1e-3
    assert len(wide) < len(gentle) < 3 * len(wide)
    usual = GlobalSettings(images=90, spacing=3.5)
    held = usual.model_copy(update={"turn": turns_to_next(plan_survey(usual, subject, seed).poses).max() + 0.01})
    np.testing.assert_array_equal(plan_survey(held, subject, seed).poses, plan_survey(usual, subject, seed).poses)
    assert len(plan_survey(GlobalSettings(images=8, spacing=50.0), subject, seed).poses) == 8


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
    full = make_subject(box_bridge(), (*flat_site(), *floors))
    with pytest.raises(InputError, match=r"the instance 401\d\d is in the way.*or raise survey\.stand_off"):
        plan_survey(settings, full, 1)
    with pytest.raises(InputError, match=r"the instance 401\d\d is in the way.*or raise survey\.margin"):
        plan_survey(GlobalSettings(tour="rings"), full, 1)


def test_free_routes_stay(subject: Subject) -> None:
    """A route with room to spare is not touched."""
    frame = oriented_box(subject.bridge.reshape(-1, 3))
    route = draw_route(GlobalSettings(), frame, np.zeros(0), subject, stream(1, "survey/x"))
    np.testing.assert_array_equal(clear_route(route, frame, subject, 1.5, "stand_off"), route)


def test_bearing_lines_are_grouped() -> None:
    """Two rows of bearings on one pier are one line."""
    seats = np.array([[18.6, 1, 5], [0, 1, 4], [17.4, -1, 5], [0, -1, 4], [40, 0, 6.0]])
    np.testing.assert_allclose(bearing_lines(seats), [[0, 4], [18, 5], [40, 6]])


def test_gps_noise_has_the_stated_size(proof_count: Count, record_proof: RecordProof) -> None:
    """Spread and memory of the errors in closed form: white noise, a bias that walks, one altitude error a flight."""
    count, noise = proof_count(400, 4000), GpsNoise((0.5, 0.5, 0.8), 0.3, 2.0)
    true, times = np.zeros((60, 3)), 2.0 * np.arange(60.0)
    flights = np.stack([measured_positions(true, times, noise, np.random.default_rng(seed)) for seed in range(count)])
    spread = flights.std(axis=(0, 1))
    np.testing.assert_allclose(spread, np.sqrt([0.25 + 0.09, 0.25 + 0.09, 0.64 + 0.09 + 4.0]), rtol=0.06)
    assert np.abs(flights.mean(axis=(0, 1))[:2]).max() < 0.05
    lags = (1, 10, 30)
    found = [float((flights[:, lag:, :2] * flights[:, :-lag, :2]).mean()) for lag in lags]
    np.testing.assert_allclose(found, [0.09 * np.exp(-2.0 * lag / 60.0) for lag in lags], atol=0.012)
    shared = float((flights[:, 30:, 2] * flights[:, :-30, 2]).mean())
    assert shared == pytest.approx(4.0 + 0.09 * np.exp(-1.0), rel=0.2 if count < 1000 else 0.06)
    figures = {"spread_m": spread.tolist(), "bias_covariance_m2": found, "lags_s": [2 * lag for lag in lags]}
    record_proof("surveys/gps noise", count, 0, figures)


def test_attitude_is_that_of_drones() -> None:
    """Yaw clockwise from +y, pitch up, roll clockwise, straight down included; the noise has the stated spread."""
    looks = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, -1.0], [-1.0, 0.0, 0.0]])
    expected = [[0, 0, 0], [90, 0, 0], [180, -45, 0], [-90, 0, 0]]
    turned = np.stack([look_at(np.zeros(3), look)[:3, :3] for look in looks])
    np.testing.assert_allclose(attitude_of(turned), expected, atol=1e-9)
    rolled = turned @ Rotation.from_euler("z", 20.0, degrees=True).as_matrix()
    np.testing.assert_allclose(attitude_of(rolled), np.add(expected, [0, 0, 20]), atol=1e-9)
    down = np.column_stack([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    np.testing.assert_allclose(attitude_of(down[None]), [[90.0, -90.0, 0.0]], atol=1e-9)
    many = measured_attitude(np.tile(turned[2], (20000, 1, 1)), (2.0, 0.5, 0.2), np.random.default_rng(1))
    errors = (many - expected[2] + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(errors.std(axis=0), [2.0, 0.5, 0.2], rtol=0.03)
    assert np.abs(many[:, 0]).max() <= 180.0


def test_the_paper_tour_runs_on_the_extended_box(subject: Subject) -> None:
    """Every place lies on the surface of the extended box; both rings and the top are flown; steps are equal."""
    settings = GlobalSettings(tour="rings", poi="box50", images=100)
    inner = oriented_box(subject.bridge.reshape(-1, 3))
    outer = extended_box(settings, inner)
    np.testing.assert_allclose(outer.half - inner.half, max(8.0, 0.7 * inner.half[1:].max()))
    starts = set()
    for seed in range(5):
        route = draw_rings(settings, outer, subject, stream(seed, "survey/global"))
        local = outer.to_local(route)
        np.testing.assert_allclose(np.abs(local / outer.half).max(axis=1), 1.0, atol=1e-9)
        on_top = local[:, 2] > outer.half[2] - 1e-6
        assert on_top.sum() * 0.25 > 2 * outer.half[0]  # at least one strip along the whole bridge
        around = np.unwrap(np.arctan2(local[~on_top, 1], local[~on_top, 0]))
        assert abs(around[-1] - around[0]) > 3.5 * np.pi  # two rings
        starts.add(tuple(np.round(route[0], 1)))
        poses = plan_survey(settings, subject, seed).poses
        steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
        assert len(poses) >= 100
        assert steps.max() <= settings.spacing + 1e-3
        assert np.median(steps) > 0.99 * steps.max()
        assert subject.clearance(poses[:, :3, 3]).min() >= settings.safety
        half = inner.to_world(inner.to_local(poses[:, :3, 3]) / 2)
        toward = half - poses[:, :3, 3]
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        np.testing.assert_allclose(np.sum(toward * poses[:, :3, 2], axis=1), 1.0, atol=1e-8)
    assert len(starts) == 5


def test_an_elongated_bridge_is_seen_from_beside(subject: Subject) -> None:
    """Along the sides, views with `axis` are nearly square to the bridge; with the paper's box they look along it."""
    box_of = oriented_box(subject.bridge.reshape(-1, 3))
    aslant = {}
    for poi in ("axis", "box50"):
        poses = plan_survey(GlobalSettings.model_validate({"tour": "rings", "poi": poi}), subject, 2).poses
        local, looks = box_of.to_local(poses[:, :3, 3]), poses[:, :3, 2] @ box_of.axes.T
        beside = (np.abs(local[:, 0]) > 0.4 * box_of.half[0]) & (np.abs(local[:, 0]) < 0.9 * box_of.half[0])
        aslant[poi] = float(np.abs(looks[beside, 0]).mean())
    assert aslant["axis"] < 0.35
    assert aslant["axis"] < 0.75 * aslant["box50"]


@pytest.mark.parametrize("name", list(camera_models()))
def test_cameras_of_the_table(name: str, subject: Subject) -> None:
    """Each is a camera that can be: its field of view, a lens with an inverse, its own size unless another is asked."""
    model = camera_models()[name]
    full = calibration(model)
    assert (full.width, full.height) == (model.width, model.height)
    diagonal = 2.0 * np.degrees(np.arctan(0.5 * np.hypot(full.width, full.height) / full.fx))
    fields = {"default_24mm": 84, "mavic_air_2_like": 84, "mini_like": 83, "p1_like": 63, "phone": 80}
    assert diagonal == pytest.approx(fields[name], abs=4.0)
    eye = eye_of(full, model.distortion)
    corner = np.array([[0.0, 0.0], [full.width, full.height]])
    rays = eye.rays(corner)
    drawn = model.distortion.distort(rays[:, :2]) * [full.fx, full.fy] + [full.cx, full.cy]
    np.testing.assert_allclose(drawn, corner, atol=1e-6)
    small = plan_survey(GlobalSettings(camera=name, width=640), subject, 1)
    assert (small.calibration.width, small.calibration.height) == (640, round(640 * model.height / model.width))
    assert (small.distortion, small.readout_time, small.model) == (model.distortion, model.readout_time, model.model)
    assert (model.readout_time > 0.0) == (name not in ("default_24mm", "p1_like"))


def test_an_unknown_camera_is_told_with_the_known() -> None:
    """One line with every name."""
    with pytest.raises(InputError, match=r"camera: no such camera; allowed: default_24mm, mavic_air_2_like.*'gopro'"):
        parse_settings(GlobalSettings, {"camera": "gopro"}, "survey")


def test_framing_follows_the_distortion() -> None:
    """A point is framed exactly where its distorted pixel lies inside; far outside the fold brings none back in."""
    camera, lens = Pinhole(800, 600, 600.0, 600.0, 400.0, 300.0), Distortion(-0.2, 0.03)
    eye, pose = eye_of(camera, lens), np.eye(4)
    rng = np.random.default_rng(2)
    pixels = rng.uniform([-100, -100], [900, 700], (500, 2))
    inside = ((pixels >= 0) & (pixels < [800, 600])).all(axis=1)
    points = np.column_stack([lens.undistort((pixels - [400, 300]) / 600), np.ones(500)]) * rng.uniform(1, 9, (500, 1))
    np.testing.assert_array_equal(eye.framed(points, pose), inside)
    assert not eye.framed(np.array([[30.0, 0.0, 1.0], [2.2, 0.0, 1.0], [0.0, 0.0, -1.0]]), pose).any()


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
    np.testing.assert_allclose(neighbor_overlap(path, make_subject((plate,), (far,))), 1.0)


def test_every_class_is_well_seen(proof_count: Count, record_proof: RecordProof) -> None:
    """On drawn bridges every class has enough large views, bearings included, and neighbors overlap."""
    seeds = range(proof_count(2, 30))
    seen: dict[str, list[float]] = {}
    overlaps, counts = [], []
    for seed in seeds:
        subject, kinds = _drawn(seed)
        path = plan_survey(GlobalSettings(), subject, seed)
        ids, pixels = visible_pixels(path, subject)
        bare = np.array([not _buried(subject, int(number)) for number in ids])
        assert pixels[:, ~bare].max(initial=0) == 0
        ids, pixels = ids[bare], pixels[:, bare]
        classes = np.array([_seen_as(subject, int(number), kinds[int(number)]) for number in ids])
        often = views_per_instance(pixels, least=50) >= 3
        for name in np.unique(classes):
            seen.setdefault(str(name), []).append(float(often[classes == name].mean()))
        # Quick: eight pairs along the way, each forth and back.
        pairs = [replace(path, poses=path.poses[row : row + 2]) for row in range(0, len(path.poses) - 1, 7)]
        ways = (path,) if proof_count(0, 1) else pairs
        overlaps.append(float(np.concatenate([neighbor_overlap(way, subject) for way in ways]).mean()))
        counts.append(len(path.poses))
    worst = {name: min(shares) for name, shares in sorted(seen.items())}
    assert set(worst) >= {"abutment", "bearing", "column", "deck", "girder", "parapet", "pier_cap"}
    # A flight round a wide bridge sees few of its inner bearings and diaphragms, and wing walls may lie behind their
    # embankments: docs/surveys.md says so, and what to fly instead. Scuppers and conduits (background) are small.
    # Half of the abutments' parts are wing walls. Plants hide none. Parapets end in four blocks 1 m long on the
    # approaches: cameras look at the axis drawn inwards from there, so up to all of these are out of the pictures.
    least = {"bearing": 0.15, "girder": 0.35, "abutment": 0.5, "background": 0.4, _END: 0.0}
    assert all(share >= least.get(name, 0.85) for name, share in worst.items()), worst
    typical = {name: float(np.mean(shares)) for name, shares in sorted(seen.items())}
    usual = {"bearing": 0.5, "girder": 0.7, "abutment": 0.8, "background": 0.4, _END: 0.4}
    assert all(share >= usual.get(name, 0.95) for name, share in typical.items()), typical
    assert min(overlaps) > 0.7
    record_proof(
        "surveys: share of instances with 50 px in 3 images, worst bridge",
        len(seeds),
        0,
        {
            **{f"{name}_share": share for name, share in worst.items()},
            **{f"{name}_mean_share": share for name, share in typical.items()},
            "least_mean_overlap": min(overlaps),
            "most_images": max(counts),
        },
    )


def _buried(subject: Subject, number: int) -> bool:
    """Whether all of an instance lies below the ground, as footings do: nobody can see it."""
    points = subject.bridge[subject.bridge_ids == number].reshape(-1, 3)
    return bool((points[:, 2] < subject.ground_height(points[:, :2])).all())


def _seen_as(subject: Subject, number: int, kind: str) -> str:
    """Name the class of an instance, and the end blocks of parapets by themselves: they are less than 2 m long."""
    points = subject.bridge[subject.bridge_ids == number].reshape(-1, 3)
    is_end = kind == "parapet" and np.hypot(*np.ptp(points[:, :2], axis=0)) < 2.0
    return _END if is_end else class_of(kind)


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
