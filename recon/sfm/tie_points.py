"""Tie points: the subset of matches that a mapper uses, enough to constrain every camera and every pair.

A mapper's time and memory grow with the number of matches; the accuracy of its cameras hardly does beyond about a
thousand well-spread tie points per image. The matches left out are triangulated afterwards.
Source: tie point limits of photogrammetry packages; Cui et al., "Tracks selection for robust, efficient and scalable
large-scale structure from motion" (2017).
"""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]

_CELLS = 8  # cells along each side of an image; each cell keeps its share of tie points
_LONG = 3  # views above which a longer track is not preferred: the longest tracks show distant objects
_SPREAD_SHARE = 0.5  # share of an image's tie points that is distributed evenly over its cells [1]
_PAIR_TIES = 100  # matches that a pair always keeps: COLMAP initializes only from pairs with at least as many


@dataclass(frozen=True)
class Matches:
    """Verified matches of all image pairs; keypoints are numbered through all images.

    Attributes:
        image: Image of each keypoint, shape (K,), int64.
        cell: Cell of each keypoint, numbered through all images, shape (K,), int64.
        pair: Pair of each match, shape (M,), int64.
        first: Keypoint of each match in the pair's first image, shape (M,), int64.
        second: The same in its second image, shape (M,), int64.
    """

    image: I64
    cell: I64
    pair: I64
    first: I64
    second: I64


def choose_tie_points(matches: Matches, limit: int, rng: np.random.Generator) -> Bools:
    """Choose tracks that cover every cell of every image and every pair; a track is kept or dropped as a whole.

    Tracks of three or more views take precedence over tracks of two; among equals the choice is random, so that the
    subset has the distribution of the whole. A track that joins two keypoints of one image contains a wrong match and
    is used last, where there is no other.

    Args:
        matches: Verified matches.
        limit: Approximate number of tie points per image: half of them from its cells, and a hundred from each of its
            pairs.
        rng: Source of randomness.

    Returns:
        Whether each match stays, shape (M,), bool.
    """
    count = len(matches.image)
    links = coo_matrix((np.ones(len(matches.first), bool), (matches.first, matches.second)), shape=(count, count))
    tracks, track = connected_components(links, directed=False)
    views = np.bincount(track, minlength=tracks)
    images = int(matches.image.max(initial=0)) + 1
    seen = np.unique(track.astype(np.int64) * images + matches.image)
    sound = np.bincount(seen // images, minlength=tracks) == views
    place = np.empty(tracks, np.int64)
    place[np.lexsort((rng.random(tracks), -np.minimum(views, _LONG), ~sound))] = np.arange(tracks)
    stays = np.zeros(tracks, bool)
    keypoint = np.flatnonzero(views[track] > 1)
    per_cell = max(round(limit * _SPREAD_SHARE / _CELLS**2), 1)
    stays[track[keypoint[_best(matches.cell[keypoint], place[track[keypoint]], per_cell)]]] = True
    joined = track[matches.first]
    stays[joined[_best(matches.pair, place[joined], _PAIR_TIES)]] = True
    return stays[joined]


def write_tie_points(database: Path, out: Path, limit: int, seed: int, without: Set[int] = frozenset()) -> bool:
    """Write a database of tie points only, without descriptors, if there are more matches than needed.

    Args:
        database: Database of verified matches.
        out: Database to create.
        limit: Approximate number of tie points per image.
        seed: Seed of the random choice.
        without: Ids of pairs that the mapper must not use; they are not written.

    Returns:
        Whether it was written; if not, the mapper can use all matches.
    """
    with pycolmap.Database.open(database) as source:
        images = sorted(source.read_all_images(), key=lambda image: image.image_id)
        keypoints = {image.image_id: source.read_keypoints(image.image_id) for image in images}
        verified = zip(*source.read_two_view_geometries(), strict=True)
        kept = {number: found for number, found in verified if number not in without}
        if not kept:
            return False
        pairs, geometries = [pycolmap.pair_id_to_image_pair(number) for number in kept], list(kept.values())
        matches = _gather(source.read_all_cameras(), images, keypoints, pairs, geometries)
        few = len(np.unique(np.concatenate([matches.first, matches.second]))) <= limit * len(images)
        if few and not without:
            return False
        stays = choose_tie_points(matches, limit, np.random.default_rng(seed)) | few
        with pycolmap.Database.open(out) as thin:
            _copy_images(source, thin, images, keypoints)
            start = 0
            for (first, second), geometry in zip(pairs, geometries, strict=True):
                end = start + len(geometry.inlier_matches)
                geometry.inlier_matches = geometry.inlier_matches.reshape(-1, 2)[stays[start:end]]
                thin.write_two_view_geometry(first, second, geometry)
                start = end
    return True


def _best(group: I64, place: I64, count: int) -> Bools:
    """Tell which members are among the first `count` of their group in the order of `place`."""
    order = np.lexsort((place, group))
    ordered = group[order]
    begins = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]])[: len(ordered)])
    lengths = np.diff(np.append(begins, len(ordered)))
    rank = np.arange(len(ordered)) - np.repeat(begins, lengths)
    found = np.empty(len(group), bool)
    found[order] = rank < count
    return found


def _gather(
    cameras: Sequence[Any],
    images: Sequence[Any],
    keypoints: Mapping[int, Any],
    pairs: Sequence[Any],
    geometries: Sequence[Any],
) -> Matches:
    size_of = {camera.camera_id: np.array([camera.width, camera.height]) for camera in cameras}
    sizes = [len(points) for points in keypoints.values()]
    begin = dict(zip(keypoints, np.concatenate([[0], np.cumsum(sizes)]).tolist(), strict=False))
    cells = []
    for owner, points in zip(images, keypoints.values(), strict=True):
        place = points[:, :2] if len(points) else np.zeros((0, 2))
        column, row = np.clip((place / size_of[owner.camera_id] * _CELLS).astype(np.int64), 0, _CELLS - 1).T
        cells.append(row * _CELLS + column)
    image = np.repeat(np.arange(len(sizes)), sizes)
    sides = [
        np.concatenate(
            [
                geometry.inlier_matches.reshape(-1, 2)[:, side].astype(np.int64) + begin[pair[side]]
                for pair, geometry in zip(pairs, geometries, strict=True)
            ]
        )
        for side in (0, 1)
    ]
    per_pair = [len(geometry.inlier_matches) for geometry in geometries]
    return Matches(image, np.concatenate(cells) + image * _CELLS**2, np.repeat(np.arange(len(pairs)), per_pair), *sides)


def _copy_images(
    source: pycolmap.Database, out: pycolmap.Database, images: Sequence[Any], keypoints: Mapping[int, Any]
) -> None:
    """Copy cameras, rigs, frames and images with their numbers, and their keypoints and positions."""
    for camera in source.read_all_cameras():
        out.write_camera(camera, use_camera_id=True)
    for rig in source.read_all_rigs():
        out.write_rig(rig, use_rig_id=True)
    for frame in source.read_all_frames():  # before the images, which refer to them
        out.write_frame(frame, use_frame_id=True)
    for image in images:
        out.write_image(image, use_image_id=True)
        if len(keypoints[image.image_id]):
            out.write_keypoints(image.image_id, keypoints[image.image_id])
    for prior in source.read_all_pose_priors():
        out.write_pose_prior(prior, use_pose_prior_id=True)
