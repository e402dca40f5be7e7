"""Equal points become one that keeps all its views, against a slow twin; what the cloud gives has no equal points."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from recon.cloud import read_cloud
from recon.points.duplicates import merge_duplicates
from recon.sfm.colmap_model import SparseModel, read_model
from tests.conftest import RecordProof


def told_twice(rng: np.random.Generator) -> SparseModel:
    """Make a model of 40 points in 25 places, of which equal ones share some keypoints."""
    places = rng.normal(size=(25, 3))
    which = np.concatenate([np.arange(25), rng.integers(0, 25, 15)])[rng.permutation(40)]
    point = np.repeat(np.arange(40), rng.integers(2, 6, 40))
    uv = rng.integers(0, 4, (len(point), 2)) + 10.0 * which[point][:, None] + 0.5
    return SparseModel(
        ("a", "b", "c"),
        np.tile(np.eye(4), (3, 1, 1)),
        "SIMPLE_RADIAL",
        (1.0, 0.0, 0.0, 0.0),
        places[which],
        rng.integers(0, 255, (40, 3)).astype(np.uint8),
        rng.random(40),
        point,
        rng.integers(0, 3, len(point)),
        uv,
    )


def test_equal_points_become_one() -> None:
    """The first of each set of equal points stays, in order, with each view of the set once."""
    for seed in range(20):
        model = told_twice(np.random.default_rng(seed))
        found, alike = merge_duplicates(model)
        views: dict[tuple[float, ...], set[tuple[float, ...]]] = {}
        firsts: dict[tuple[float, ...], int] = {}
        for row, place in enumerate(map(tuple, model.points.tolist())):
            firsts.setdefault(place, row)
            mine = model.obs_point == row
            views.setdefault(place, set()).update(
                zip(model.obs_image[mine].tolist(), *model.obs_uv[mine].T.tolist(), strict=True)
            )
        np.testing.assert_array_equal(found.points, model.points[list(firsts.values())])
        assert alike.tolist() == [model.points.tolist().count(list(place)) for place in firsts]
        np.testing.assert_array_equal(found.errors, model.errors[list(firsts.values())])
        assert (np.diff(found.obs_point) >= 0).all()
        for row, place in enumerate(firsts):
            mine = found.obs_point == row
            seen = list(zip(found.obs_image[mine].tolist(), *found.obs_uv[mine].T.tolist(), strict=True))
            assert len(seen) == len(set(seen))
            assert set(seen) == views[place]
        assert merge_duplicates(found)[0] is found
        nothing = replace(model, points=np.zeros((0, 3)))
        assert merge_duplicates(nothing)[0] is nothing


def test_the_same_keypoints_make_one_point() -> None:
    """Two tracks of the same keypoints whose places differ are one; tracks that share but some of them are two."""
    model = told_twice(np.random.default_rng(1))
    image, uv = (
        np.array([0, 1, 2, 2, 0, 1, 0, 1]),
        np.array([[1, 1], [2, 2], [3, 3], [3, 3], [1, 1], [2, 2], [1, 1], [2, 2]]),
    )
    point = np.array([0, 0, 0, 1, 1, 1, 2, 2])
    three = replace(
        model,
        points=np.eye(3),
        colors=model.colors[:3],
        errors=model.errors[:3],
        obs_point=point,
        obs_image=image,
        obs_uv=uv.astype(np.float64),
    )
    found, alike = merge_duplicates(three)
    assert alike.tolist() == [2, 1]
    np.testing.assert_array_equal(found.points, np.eye(3)[[0, 2]])
    np.testing.assert_array_equal(found.obs_point, [0, 0, 0, 1, 1])
    np.testing.assert_array_equal(found.obs_image, [0, 1, 2, 0, 1])


def test_a_cloud_holds_no_point_twice(plane_cloud: Path, record_proof: RecordProof) -> None:
    """COLMAP's model of the planes has equal points, the cloud made from it has none."""
    model = read_model(plane_cloud / "sparse")
    twice = len(model.points) - len(np.unique(model.points, axis=0))
    assert twice > 0
    coord = read_cloud(plane_cloud).columns["coord"]
    left = len(coord) - len(np.unique(coord, axis=0))
    assert left == 0
    merged, alike = merge_duplicates(model)
    figures = {"points_of_the_model": len(model.points), "merged": int((alike - 1).sum()), "twice_in_the_model": twice}
    record_proof("recon: equal points are merged", len(merged.points), 0, {**figures, "twice_in_the_cloud": left})
