"""Votes and uncertainty: hand-made tracks with known answers, and brute-force twins of the vectorised code."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.recon.plain_vote import plain_verdict
from groundwork.errors import InputError
from recon.points.observations import Observations, median_per_point, select_points
from recon.sfm.colmap_model import SparseModel
from recon.truth.annotate import ObservedTruth, annotate, gather
from recon.truth.label_margin import edge_distance
from recon.truth.uncertainty import depths, measure
from render.capture import Truth
from render.writing.capture_writer import FrameTruth, make_folders
from tests.frame_truth import write_frame_truth
from usd_schemas.pinhole import Pinhole, look_at, project

CAMERA = Pinhole(16, 12, 20.0, 20.0, 8.0, 6.0)
DECK, GIRDER = 9, 10


def observations(points: list[int], images: list[int], uv: list[tuple[float, float]]) -> Observations:
    """Make observations from rows sorted by point."""
    counts = np.bincount(points)
    return Observations(np.concatenate([[0], np.cumsum(counts)]), np.array(images), np.array(uv, np.float64))


@pytest.fixture
def three_views(tmp_path: Path) -> Truth:
    """Three cameras at x = 0, 1, 2 m that look along +y at a wall 10 m away; deck left of column 4, girder right of it.

    The first row of pixels is sky, and view 2 stands 5 cm too near: its true depth is 10.05 m.
    """
    make_folders(tmp_path)
    poses = np.stack([look_at(np.array([x, 0.0, 0.0]), np.array([x, 10.0, 0.0])) for x in (0.0, 1.0, 2.0)])
    for view in range(3):
        semantic, instance = np.full((12, 16), GIRDER, np.uint8), np.full((12, 16), 70 + view, np.uint32)
        depth = np.full((12, 16), 10.0 if view < 2 else 10.05, np.float32)
        semantic[:, :4], instance[:, :4] = DECK, 50
        semantic[0], instance[0], depth[0] = 0, 0, np.inf
        write_frame_truth(tmp_path, f"{view:06d}", FrameTruth(depth, semantic, instance), wide_ids=False)
    return Truth(tmp_path / "truth", CAMERA, ("000000", "000001", "000002"), poses, (), ())


def test_three_view_track(three_views: Truth) -> None:
    """Three tracks by hand: majority, depth errors, their median, an even number of views, sky."""
    points = np.array([[1.0, 10.02, 0.0], [0.0, 10.01, 0.0], [1.0, 9.0, 4.0]])
    seen = observations(
        [0, 0, 0, 1, 1, 2, 2],
        [0, 1, 2, 0, 2, 0, 1],
        [(9.9, 6.0), (3.99, 6.0), (6.1, 6.0), (8.0, 6.0), (4.0, 6.0), (10.0, 0.5), (8.0, 0.9)],
    )
    observed = gather(three_views, seen)
    assert observed.label.tolist() == [GIRDER, DECK, GIRDER, GIRDER, GIRDER, 0, 0]
    depth = depths(points, three_views.poses, seen)
    np.testing.assert_allclose(depth, [10.02, 10.02, 10.02, 10.01, 10.01, 9.0, 9.0], atol=1e-12)
    error, measured = measure(points, depth, observed.depth.astype(float), three_views, seen)
    np.testing.assert_allclose(error, [0.02, 0.02, 0.03, 0.01, 0.04, np.inf, np.inf], atol=1e-6)
    np.testing.assert_allclose(measured.median, [0.02, 0.025, np.inf], atol=1e-6)
    np.testing.assert_allclose(measured.least, [0.02, 0.01, np.inf], atol=1e-6)
    np.testing.assert_allclose(measured.greatest, [0.03, 0.04, np.inf], atol=1e-6)
    np.testing.assert_allclose(measured.relative, [0.02 / 10.02, 0.025 / 10.01, np.inf], atol=1e-7)
    assert np.isinf(measured.displacement[2])
    verdict = annotate(observed, error, seen)
    assert verdict.label.tolist() == [GIRDER, GIRDER, 0]
    assert verdict.instance.tolist() == [70, 70, 0]  # views disagree on the girder: the nearer surface settles it
    np.testing.assert_allclose(verdict.confidence, [2 / 3, 1.0, 1.0], rtol=1e-6)


def test_displacement_sees_what_the_depth_error_cannot(three_views: Truth) -> None:
    """A point moved sideways along the wall keeps its depth, but not its place."""
    truth = np.array([[0.5, 10.0, 0.2]])
    pixels = [project(truth, CAMERA, three_views.poses[view])[0][0] for view in (0, 1)]
    seen = observations([0, 0], [0, 1], [(float(u), float(v)) for u, v in pixels])
    depth_of_truth = np.full(2, 10.0)
    moved = truth + np.array([0.3, 0.0, 0.0])
    for points, away in ((truth, 0.0), (moved, 0.3)):
        depth = depths(points, three_views.poses, seen)
        _, measured = measure(points, depth, depth_of_truth, three_views, seen)
        assert measured.median[0] == pytest.approx(0.0, abs=1e-12)
        assert measured.displacement[0] == pytest.approx(away, abs=1e-12)


def test_half_a_pixel_changes_the_label(three_views: Truth) -> None:
    """The edge lies at x = 4.0: keypoints 0.1 px to either side of it know where they are; half a pixel on, not."""
    uv = [(3.9, 5.5), (4.1, 5.5), (3.5, 5.5), (4.4, 5.5)]
    labels = [DECK, GIRDER, DECK, GIRDER]
    assert gather(three_views, observations([0, 0, 0, 0], [1] * 4, uv)).label.tolist() == labels
    for shift in (-0.5, 0.5):
        moved = observations([0, 0, 0, 0], [1] * 4, [(u + shift, v) for u, v in uv])
        assert gather(three_views, moved).label.tolist() != labels


@pytest.mark.parametrize("kind", ["semantic", "instance", "depth"])
def test_truth_of_another_size_is_refused(three_views: Truth, tmp_path: Path, kind: str) -> None:
    """Each kind must share the photograph's pixels: anything else would be silently wrong."""
    small = np.zeros((6, 8), np.uint8)
    frame = FrameTruth(np.ones((6, 8), np.float32), small, small.astype(np.uint32))
    make_folders(tmp_path / "other")
    write_frame_truth(tmp_path / "other", "000001", frame, wide_ids=False)
    file = next((tmp_path / "other" / "truth" / kind).iterdir())
    file.replace(three_views.folder / kind / file.name)
    with pytest.raises(InputError, match=rf"{kind}/000001.*\(8, 6\)"):
        gather(three_views, observations([0, 0], [0, 1], [(1.0, 1.0), (1.0, 1.0)]))


def test_ties_go_to_the_nearest_surface() -> None:
    """One vote each: the smaller depth error wins; with equal errors, the smaller label; two beat one nearer."""
    label = np.array([9, 4, 9, 4, 7, 7, 3, 3, 6, 8, 8], np.uint8)
    error = np.array([0.01, 0.02, 0.03, 0.03, 0.05, np.inf, 0.04, 0.06, 0.01, 0.02, 0.03])
    seen = observations([0, 0, 1, 1, 2, 2, 2, 2, 3, 3, 3], [0] * 11, [(1.0, 1.0)] * 11)
    nothing = np.zeros(11, np.float32)
    verdict = annotate(ObservedTruth(label, label.astype(np.uint32), nothing, nothing), error, seen)
    assert verdict.label.tolist() == verdict.instance.tolist() == [9, 4, 3, 8]


def test_who_looks_past_a_point_does_not_vote() -> None:
    """A point on a cable: three views show the sky, one a hill, two the cable; and one that nobody shows as near."""
    nothing = np.zeros(8, np.float32)
    observed = ObservedTruth(
        np.array([0, 0, 0, 0, 5, 5, DECK, GIRDER], np.uint8),
        np.array([0, 0, 0, 7, 31, 30, 50, 70], np.uint32),
        nothing,
        nothing,
    )
    error = np.array([np.inf, np.inf, np.inf, 0.11, 0.1, 0.02, 0.31, 0.3])
    verdict = annotate(observed, error, observations([0] * 6 + [1] * 2, [0] * 8, [(1.0, 1.0)] * 8))
    assert verdict.label.tolist() == [5, GIRDER]
    assert verdict.instance.tolist() == [30, 70]
    np.testing.assert_allclose(verdict.confidence, [2 / 6, 1 / 2], rtol=1e-6)


def random_votes(seed: int) -> tuple[Observations, NDArray[np.float64], np.random.Generator]:
    """Draw 300 tracks with one to a dozen observations, and coarse depth errors, with ties, some of them infinite."""
    rng = np.random.default_rng(seed)
    point = np.sort(np.concatenate([np.arange(300), rng.integers(0, 300, 1500)]))
    error = np.asarray(rng.integers(0, 6, len(point)) * 0.04, np.float64)
    error[rng.random(len(point)) < 0.1] = np.inf
    seen = Observations(np.searchsorted(point, np.arange(301)), point, np.zeros((len(point), 2)))
    return seen, error, rng


@pytest.mark.parametrize("seed", range(3))
def test_verdicts_have_a_plain_twin(seed: int) -> None:
    """Class, instance, confidence and margin equal those of a loop over points."""
    seen, error, rng = random_votes(seed)
    label, instance = rng.integers(0, 4, len(error)).astype(np.uint8), rng.integers(0, 3, len(error)).astype(np.uint32)
    margin = rng.integers(0, 9, len(error)).astype(np.float32)
    verdict = annotate(ObservedTruth(label, instance, margin, margin), error, seen)
    found = zip(verdict.label, verdict.instance, verdict.confidence, verdict.margin, strict=True)
    for number, row in enumerate(found):
        mine = slice(seen.start[number], seen.start[number + 1])
        twin = plain_verdict(label[mine].tolist(), instance[mine].tolist(), margin[mine].tolist(), error[mine].tolist())
        assert row == pytest.approx(twin, rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_median_has_a_plain_twin(seed: int) -> None:
    """The sorted median equals numpy's, point by point, infinities included."""
    seen, error, _ = random_votes(seed)
    with np.errstate(invalid="ignore"):
        twin = [np.median(error[seen.point == number]) for number in range(300)]
    found = median_per_point(error, seen)
    np.testing.assert_array_equal(np.isinf(found), [not np.isfinite(value) for value in twin])
    finite = np.isfinite(found)
    np.testing.assert_array_equal(found[finite], np.array(twin)[finite])


def test_instance_belongs_to_the_class_that_won() -> None:
    """Three views of three shrubs outvote two views of one parapet, though no shrub has two votes."""
    seen = observations([0] * 5, [0] * 5, [(1.0, 1.0)] * 5)
    margin = np.array([1, 2, 9, 1, 1], np.float32)
    observed = ObservedTruth(
        np.array([0, 0, 0, 11, 11], np.uint8), np.array([201, 202, 203, 30, 30], np.uint32), margin, margin
    )
    verdict = annotate(observed, np.array([0.03, 0.01, 0.02, 0.0, 0.0]), seen)
    assert (verdict.label[0], verdict.instance[0]) == (0, 202)
    assert verdict.confidence[0] == pytest.approx(0.6)
    assert verdict.margin[0] == 9


def test_edge_distance_has_a_plain_twin() -> None:
    """Half a pixel beside an edge, and the exact distance to the nearest such pixel elsewhere."""
    labels = np.zeros((14, 230), np.uint8)  # wider than what is searched at a time
    labels[3:8, 5:9], labels[10:, 40:] = 2, 7
    rows, columns = np.indices(labels.shape)
    beside = np.array(
        [
            [
                any(
                    0 <= r + a < 14 and 0 <= c + b < 230 and labels[r + a, c + b] != labels[r, c]
                    for a, b in ((0, 1), (0, -1), (1, 0), (-1, 0))
                )
                for c in range(230)
            ]
            for r in range(14)
        ]
    )
    twin = np.min([np.hypot(rows - r, columns - c) for r, c in zip(*np.nonzero(beside), strict=True)], axis=0) + 0.5
    for one, other in ((labels, twin), (labels[:, ::-1], twin[:, ::-1]), (labels[::-1], twin[::-1])):
        found = edge_distance(np.ascontiguousarray(one), rows.ravel(), columns.ravel())
        np.testing.assert_allclose(found, other.ravel(), rtol=1e-6)
    labels = np.zeros((30, 230), np.uint8)
    labels[:4], labels[20:] = 1, 2  # the nearest edge of a row between lies above or below it
    found = edge_distance(labels, np.arange(30), np.full(30, 100))
    edges = np.array([3, 4, 19, 20])
    np.testing.assert_allclose(found, np.abs(np.arange(30)[:, None] - edges).min(axis=1) + 0.5)
    labels = np.zeros((3, 230), np.uint8)
    labels[:, 0] = 1  # most columns have no edge at all
    found = edge_distance(labels, np.ones(230, np.int64), np.arange(230))
    np.testing.assert_allclose(found, np.maximum(np.arange(230) - 1, 0) + 0.5)
    assert (edge_distance(np.ones((3, 4), np.uint8), np.arange(3), np.arange(3)) == 5.0).all()


def test_points_need_valid_cameras() -> None:
    """Observations of outlying cameras do not count; points left with too few, or badly reprojected, go."""
    model = SparseModel(
        names=("a", "b", "c"),
        poses=np.tile(np.eye(4), (3, 1, 1)),
        camera_model="SIMPLE_RADIAL",
        camera_params=(1.0, 0.0, 0.0, 0.0),
        points=np.zeros((4, 3)),
        colors=np.zeros((4, 3), np.uint8),
        errors=np.array([0.5, 0.5, 0.5, 3.0]),
        obs_point=np.array([0, 0, 0, 1, 1, 2, 2, 3, 3]),
        obs_image=np.array([0, 1, 2, 0, 2, 0, 1, 0, 1]),
        obs_uv=np.arange(18.0).reshape(9, 2),
    )
    valid = np.array([True, False, True, True, False, False])  # the model's image c is row 4 of the capture: invalid
    kept, seen = select_points(model, np.array([0, 2, 4]), valid, max_error=2.0, min_views=2)
    assert kept.tolist() == [True, False, True, False]
    assert seen.start.tolist() == [0, 2, 4]
    assert seen.image.tolist() == [0, 2, 0, 2]
    assert seen.uv[:, 0].tolist() == [0.0, 2.0, 10.0, 12.0]
