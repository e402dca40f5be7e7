"""Local and grid surveys: safe, even, varied flights that look at what is nearest to them."""

from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import build_bridge
from authoring.shapes.component import Component
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from authoring.surveys.box import OrientedBox, oriented_box
from authoring.surveys.camera_models import calibration, camera_models
from authoring.surveys.framing import eye_of
from authoring.surveys.freespace import cut_free_space, link_cells
from authoring.surveys.grid import fly_grid
from authoring.surveys.linked import linked_share
from authoring.surveys.local import DECIMALS, fly_local
from authoring.surveys.local_box import draw_local_box
from authoring.surveys.local_gaze import FASTEST, key_cameras
from authoring.surveys.score import score_flight
from authoring.surveys.settings import GridSettings, LocalSettings
from authoring.surveys.subject import Subject, make_subject
from authoring.surveys.turning import angle_between, limit_pitch, look_along, pitch_of, turn_between
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.boxes import box, flat_site
from tests.conftest import Count, RecordProof
from usd_schemas.pinhole import Pinhole
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
DEMO = 7  # seed


@lru_cache(1)
def subject_of(seed: int) -> Subject:
    """A bridge on its site."""
    layout, record = draw_layout(parse_settings(BridgeSettings, {"family": "beam"}, "test"), stream(seed, "bridge"))
    site = draw_site(SiteSettings(), layout, stream(seed, "site"))
    return make_subject(build_bridge(layout, record, site.ground), site.pieces)


@pytest.fixture(scope="module")
def subject() -> Subject:
    """The bridge of the demo's seed."""
    return subject_of(DEMO)


def fly(subject: Subject, seed: int, **settings: object) -> F64:
    """Fly one local survey."""
    return fly_local(LocalSettings.model_validate({"kind": "local", **settings}), subject, stream(seed, "survey/local"))


@cache
def flown_freely(seed: int) -> F64:
    """A local survey round the bridge of the demo's seed whose gimbal has no limit, flown once."""
    return fly(subject_of(DEMO), seed, pitch="free")


def exact_distance(points: F64, triangles: F64) -> F64:
    """Distance of each point to the nearest of some triangles, all against all [m], shape (N,).

    Source: C. Ericson, Real-Time Collision Detection, 2004, section 5.1.5.
    """
    best = np.full(len(points), np.inf)
    for a, b, c in triangles:
        edges = ((a, b - a), (b, c - b), (c, a - c))
        normal = np.cross(b - a, c - a)
        unit = normal / np.linalg.norm(normal)
        height = (points - a) @ unit
        foot = points - height[:, None] * unit
        inside = np.all([np.cross(d, foot - o) @ unit >= 0 for o, d in edges], axis=0)
        sides = []
        for origin, edge in edges:
            share = np.clip((points - origin) @ edge / (edge @ edge), 0.0, 1.0)
            sides.append(np.linalg.norm(points - origin - share[:, None] * edge, axis=1))
        best = np.minimum(best, np.where(inside, np.abs(height), np.min(sides, axis=0)))
    return best


def test_flights_are_safe_even_and_steady(proof_count: Count, record_proof: RecordProof) -> None:
    """Each image keeps its distance; steps are L / ceil(L / 0.5); rotations proper, turning no faster than a gimbal."""
    flights, bridges = proof_count(3, 200), proof_count(1, 20)
    clear, chords, turns = [], [], []
    for bridge in range(bridges):
        one = subject_of(DEMO + bridge)
        for seed in range(flights // bridges):
            poses = fly(one, seed)
            places, turned = poses[:, :3, 3], poses[:, :3, :3]
            clear.append(float(one.clearance(places).min()))
            steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
            chords += [float(steps.min()), float(steps.max())]
            np.testing.assert_allclose(
                turned @ turned.transpose(0, 2, 1), np.tile(np.eye(3), (len(turned), 1, 1)), atol=1e-9
            )
            assert np.linalg.det(turned).min() > 0.999
            turns.append(max(angle_between(a, b) for a, b in pairwise(turned)))
            assert 40 <= len(poses) <= 120
    assert min(clear) >= 1.0
    assert min(chords) >= 0.45
    assert max(chords) <= 0.5 + np.sqrt(3.0) * 10.0**-DECIMALS  # positions are rounded
    assert max(turns) < 3.0 * FASTEST
    figures = {
        "least_clearance_m": min(clear),
        "chord_m": f"{min(chords):.3f} to {max(chords):.3f}",
        "widest_turn_deg": float(np.degrees(max(turns))),
    }
    record_proof("surveys/local flights", flights, 0, figures)


def test_clearance_is_the_distance_to_every_triangle(subject: Subject) -> None:
    """The ray scene's distances are those of a plain loop over all triangles near the flight."""
    places = fly(subject, 3)[:, :3, 3][::6]
    near = np.linalg.norm(subject.bridge.mean(axis=1)[:, None] - places[None], axis=2).min(axis=1) < 14.0
    ours = np.minimum(subject.surface.distance(places)[0], 9.0)
    np.testing.assert_allclose(np.minimum(exact_distance(places, subject.bridge[near]), 9.0), ours, atol=1e-4)


def test_seeds_take_different_routes(subject: Subject, proof_count: Count) -> None:
    """In one box, few seeds pass it in at least three of four ways: under, left, right, over."""
    settings = LocalSettings(kind="local", station=0.0)
    box = draw_local_box(settings, subject, stream(0, "survey/local"))
    whole = oriented_box(subject.bridge.reshape(-1, 3))
    ways: dict[str, int] = dict.fromkeys(("under", "left", "right", "over"), 0)
    for seed in range(proof_count(8, 20)):
        local = whole.to_local(fly(subject, seed, station=0.0)[:, :3, 3])
        assert (np.abs(box.to_local(whole.to_world(local))) < box.half + 0.3).all()
        beside = np.abs(local[:, 1]) > whole.half[1]
        shares = {
            "left": (local[:, 1] > whole.half[1]).mean(),
            "right": (local[:, 1] < -whole.half[1]).mean(),
            "over": (~beside & (local[:, 2] > 0.5 * whole.half[2])).mean(),
            "under": (~beside & (local[:, 2] < 0.5 * whole.half[2])).mean(),
        }
        ways[max(shares, key=lambda way: float(shares[way]))] += 1
        if proof_count(1, 0) and sum(count > 0 for count in ways.values()) >= 3:
            break
    assert sum(count > 0 for count in ways.values()) >= 3, ways


def test_limited_gimbal_never_looks_higher(subject: Subject, proof_count: Count) -> None:
    """At every frame, those on great arcs as well; a free gimbal under the same deck does look up."""
    free, limited = [], []
    seeds = (0, 4)[: proof_count(1, 2)]  # both look up by more than 60 degrees where they may; most do not
    for seed in seeds:
        free.append(pitch_of(flown_freely(seed)[:, :3, :3]).max())
        limited.append(pitch_of(fly(subject, seed, pitch="limited", pitch_limit=10.0)[:, :3, :3]).max())
    assert max(limited) <= np.radians(10.0) + 1e-9
    assert min(free) > np.radians(60.0)


def test_cameras_look_at_the_nearest_component(subject: Subject) -> None:
    """At least half of the views have the nearest point of the bridge within their frame."""
    for seed in range(3):
        poses = flown_freely(seed)
        nearest, _ = subject.surface.nearest(poses[:, :3, 3])
        local = np.einsum("nji,nj->ni", poses[:, :3, :3], nearest - poses[:, :3, 3])
        framed = (local[:, 2] > 0) & (np.abs(local[:, 0]) < 0.75 * local[:, 2])
        assert framed.mean() > 0.5


def test_key_cameras_of_a_hand_made_flight() -> None:
    """Past two walls: the nearest camera to each, and both ends; a camera that is too near is none."""
    x = np.arange(9, dtype=np.float64)
    places = np.column_stack([x, np.zeros(9), np.zeros(9)])
    away = np.array([5.0, 4.0, 3.0, 4.0, 6.0, 3.0, 2.0, 0.5, 4.0])
    points = places + np.column_stack([np.zeros(9), away, np.zeros(9)])
    walls = np.array([1, 1, 1, 1, 2, 2, 2, 2, 2])
    assert key_cameras(places, points, walls) == [0, 2, 8]
    assert key_cameras(places, points + np.array([0.0, 1.0, 0.0]), walls) == [0, 2, 7, 8]


def test_free_cells_by_brute_force() -> None:
    """Cells round a slab over level ground: free where no corner is nearer than the safety distance, and linked."""
    slab = np.array(
        [[[-3.0, -2.0, 4.0], [3.0, -2.0, 4.0], [3.0, 2.0, 4.0]], [[-3.0, -2.0, 4.0], [3.0, 2.0, 4.0], [-3.0, 2.0, 4.0]]]
    )
    land = np.array(
        [
            [[-50.0, -50.0, 0.0], [50.0, -50.0, 0.0], [50.0, 50.0, 0.0]],
            [[-50.0, -50.0, 0.0], [50.0, 50.0, 0.0], [-50.0, 50.0, 0.0]],
        ]
    )
    one, two = np.ones(2, np.uint32), np.full(2, 2, np.uint32)
    both, ids = np.concatenate([slab, land]), np.concatenate([one, two])
    subject = Subject(
        slab,
        one.astype(np.int32),
        np.zeros((0, 3)),
        RayScene(slab, one),
        RayScene(both, ids),
        ids.astype(np.int32),
        RayScene(land, two),
    )
    box = OrientedBox(np.array([0.0, 0.0, 4.0]), np.eye(3), np.array([5.0, 4.0, 4.0]))
    space = cut_free_space(box, subject, 0.5, 1.0, 1.0)
    cells = np.argwhere(np.ones(space.free.shape, bool))
    middles = space.middles(cells)
    np.testing.assert_allclose(middles, [-4.75, -3.75, 0.25] + 0.5 * cells, atol=1e-12)
    corners = middles[:, None] + 0.25 * np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    near = exact_distance(corners.reshape(-1, 3), both).reshape(-1, 8).min(axis=1)
    free = space.free.ravel()
    assert near[free].min() > 1.0
    surely = (exact_distance(middles, both) > 1.0 + 0.25 * np.sqrt(3.0) + 0.02) & (middles[:, 2] > 1.0)
    np.testing.assert_array_equal(free, surely)
    ways = link_cells(space, np.ones(space.free.shape))
    linked = np.argwhere(space.free)
    way = linked[ways.between(0, len(linked) - 1)]
    assert np.abs(np.diff(way, axis=0)).max() == 1
    length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum() * 0.5
    assert length >= np.linalg.norm(space.middles(way[[0, -1]])[1] - space.middles(way[[0, -1]])[0])


def test_turns_and_pitch_in_closed_form() -> None:
    """Half-way between two turns lies half the angle; limits keep the heading; a view straight up stays proper."""
    ends = Rotation.from_euler("z", [[10.0], [90.0]], degrees=True).as_matrix()
    middle = turn_between(ends, np.array([0.0, 4.0]), np.array([2.0]))[0]
    np.testing.assert_allclose(middle, Rotation.from_euler("z", 50.0, degrees=True).as_matrix(), atol=1e-12)
    low = limit_pitch(np.array([[1.0, 1.0, 3.0], [1.0, 0.0, -2.0]]), np.radians(20.0))
    assert np.degrees(np.arcsin(low[0, 2])) == pytest.approx(20.0)
    assert np.arctan2(low[0, 1], low[0, 0]) == pytest.approx(np.pi / 4)
    np.testing.assert_allclose(low[1], np.array([1.0, 0.0, -2.0]) / np.sqrt(5.0))
    up = look_along(np.array([[1.0, 0.0, 0.2], [0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(np.linalg.det(up), 1.0)
    np.testing.assert_allclose(up[1, :, 0], up[0, :, 0], atol=1e-12)


def test_same_seed_same_flight_and_sections_do_not_disturb(subject: Subject) -> None:
    """Bytes of two flights; another seed differs; the paper's ways of pitch share one path."""
    first, other = flown_freely(1), flown_freely(2)
    assert first.tobytes() == fly(subject, 1, pitch="free").tobytes()
    assert first.shape != other.shape or not np.allclose(first, other)
    np.testing.assert_array_equal(first[:, :3, 3], fly(subject, 1, pitch="limited")[:, :3, 3])


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"station": 400.0}, "contains no part of the bridge"),
        ({"safety": 5.0, "beside": 2.0, "above": 1.0}, "no free space"),
        ({"images": [2000, 2100], "length": 6.0, "cell": 1.0}, "no flight of the requested length"),
        ({"target": 999_999}, "no component of the bridge has this id"),
    ],
)
def test_bad_boxes_name_what_limits_them(subject: Subject, settings: dict[str, object], problem: str) -> None:
    """A box off the bridge, one without room, one too small for the images: one line with the field."""
    with pytest.raises(InputError, match=problem) as caught:
        fly(subject, 0, **settings)
    assert "survey." in str(caught.value)


def test_a_flight_comes_near_its_target(subject: Subject) -> None:
    """The box lies round the component asked for, and some image is taken near it."""
    for target in np.unique(subject.bridge_ids)[[40]].tolist():
        places = fly(subject, 1, target=target, images=[20, 160])[:, :3, 3]
        own = subject.bridge_ids == target
        assert RayScene(subject.bridge[own], subject.bridge_ids[own].astype(np.uint32)).distance(places)[0].min() < 6.5


def test_a_target_out_of_reach_is_named(subject: Subject) -> None:
    """A component at the other end of the bridge than the box: how near the flight comes, and what lies between."""
    along = oriented_box(subject.bridge.reshape(-1, 3)).to_local(subject.bridge.reshape(-1, 3))[:, 0].reshape(-1, 3)
    ids = np.unique(subject.bridge_ids)
    first = int(ids[np.argmin([along[subject.bridge_ids == number].max() for number in ids])])
    with pytest.raises(
        InputError, match=rf"survey\.target.*smallest possible distance is \d\d.*(instance \d+|box ends).*{first}"
    ):
        fly(subject, 0, target=first, station=16.0, length=8.0)


def test_a_divided_box_names_what_divides_it() -> None:
    """A wall across the whole box leaves half of it; a flight too long for that half is told of the wall."""
    deck = Component("Deck", "deck_slab", "Role_DeckConcrete", "Superstructure", box((0, -4, 6), (40, 4, 7)), 1)
    wall = Component("Wall", "building", "brick", "Ways", box((19.8, -60, -1), (20.2, 60, 60)), 40_009)
    subject = make_subject((deck,), (*flat_site(), wall))
    with pytest.raises(
        InputError, match=r"no flight of the requested length.* 5\d% of the free space .* instance 40009"
    ):
        fly(subject, 0, station=0.0, images=[300, 400])


def test_a_long_way_is_cut_to_the_images_asked_for(subject: Subject) -> None:
    """Where every way drawn is too long, a part of one is flown: as safe, as even, and of the length."""
    for seed in range(1):
        places = fly(subject, seed, images=[20, 24], length=14.0)[:, :3, 3]
        assert 20 <= len(places) <= 25
        assert subject.clearance(places).min() >= 1.0
        chords = np.linalg.norm(np.diff(places, axis=0), axis=1)
        assert 0.45 <= chords.min() <= chords.max() <= 0.5 + np.sqrt(3.0) * 10.0**-DECIMALS  # positions are rounded


def test_grid_covers_the_sides_at_the_sampling_asked_for(subject: Subject) -> None:
    """Cameras stand square to a side at sampling x focal length; neighbors overlap as asked; all are safe."""
    settings = GridSettings(kind="grid", sampling=0.008, overlap=0.8, oblique=0)
    poses = fly_grid(settings, subject, np.random.default_rng(0))
    box = oriented_box(subject.bridge.reshape(-1, 3))
    local, looks = box.to_local(poses[:, :3, 3]), poses[:, :3, 2] @ box.axes.T
    distance = 0.008 * 960 * 24.0 / 36.0
    side = np.abs(looks[:, 1]) > 0.99
    np.testing.assert_allclose(np.abs(local[side, 1]) - box.half[1], distance, atol=1e-3)
    assert (np.sign(local[side, 1]) == -np.sign(looks[side, 1])).all()
    steps = np.linalg.norm(np.diff(local[side], axis=0), axis=1)
    assert np.median(steps) <= 960 * 0.008 * (1.0 - 0.8) + 1e-6
    assert np.median(steps) > 0.9 * 960 * 0.008 * (1.0 - 0.8)
    assert (looks[~side, 2] < -0.99).all()
    assert subject.clearance(poses[:, :3, 3]).min() > settings.safety
    with pytest.raises(InputError, match=r"survey\.sampling"):
        fly_grid(replace_sampling(settings, 0.0005), subject, np.random.default_rng(0))


def test_oblique_rows_tie_the_grid_together(subject: Subject) -> None:
    """With them, sides and deck are predicted to be one reconstruction; without, they fall apart."""
    eye = eye_of(calibration(camera_models()["default_24mm"]))
    shares = []
    for rows in (3, 0):
        poses = fly_grid(GridSettings(kind="grid", oblique=rows), subject, np.random.default_rng(0))
        assert subject.clearance(poses[:, :3, 3]).min() > 1.5
        shares.append(linked_share(poses, eye, subject.obstacles)[1])
    assert shares[0] > 0.85
    assert shares[1] < 0.5


def replace_sampling(settings: GridSettings, sampling: float) -> GridSettings:
    """The same grid at another sampling distance."""
    return settings.model_copy(update={"sampling": sampling})


def wall_scene() -> tuple[F64, NDArray[np.uint32]]:
    """A wall of 20 x 6 m in the plane y = 0, facing -y."""
    a, b, c, d = (-10.0, 0.0, 0.0), (10.0, 0.0, 0.0), (10.0, 0.0, 6.0), (-10.0, 0.0, 6.0)
    return np.array([[a, b, c], [a, c, d]]), np.ones(2, np.uint32)


def facing(x: float, distance: float, *, turned: float = 0.0) -> F64:
    """A camera before the wall at mid-height, turned away from square to it [rad]."""
    pose = np.eye(4)
    pose[:3, :3] = look_along(np.array([[np.sin(turned), np.cos(turned), 0.0]]))[0]
    pose[:3, 3] = (x, -distance, 3.0)
    return pose


def test_score_of_a_wall_in_closed_form() -> None:
    """Three cameras see what all three frame; a fourth apart is not linked; sampling is depth over focal length."""
    corners, ids = wall_scene()
    eye = eye_of(Pinhole(800, 600, 800.0, 800.0, 400.0, 300.0))
    scene = RayScene(corners, ids)
    close = np.stack([facing(x, 6.0) for x in (-0.5, 0.0, 0.5, 1.0)])
    score = score_flight(close[:3], eye, 2.0, (corners, ids.astype(np.int64)), scene)
    # Each camera frames 6 m x 4.5 m of the wall; all three share 5 m of its length.
    assert score.covered[1] == pytest.approx(5.0 * 4.5 / 120.0, abs=0.01)
    assert score.sampling[0] == pytest.approx(6.0 / 800.0)
    assert score.clearance == pytest.approx(6.0)
    assert score.length == pytest.approx(1.0)
    assert score.overlap == pytest.approx(5.5 / 6.0, abs=0.03)
    assert score.linked == 1.0
    assert sum(score.pitches) == 3
    away = np.concatenate([close, [facing(8.0, 2.0)], [facing(-8.0, 6.0, turned=1.2)]])
    apart = score_flight(away, eye, 2.0, (corners, ids.astype(np.int64)), scene)
    assert apart.linked == pytest.approx(4.0 / 6.0)
    behind = score_flight(
        np.stack([facing(0.0, -6.0, turned=np.pi)] * 3), eye, 0.0, (corners, ids.astype(np.int64)), scene
    )
    assert behind.covered[1] == 0.0
    assert behind.sampling[0] == np.inf
