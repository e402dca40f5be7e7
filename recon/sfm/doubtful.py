"""Doubtful pairs of images: taken far apart, they match only in the background, or in two parts that look alike.

The two ends of a bridge often look alike. If matches between them are used, the mapper registers one half of the bridge
on top of the other: a dozen of 3,068 pairs put 140 of 282 images 50 to 250 m off. Two-view geometry and the distance of
the two GPS positions determine how far away the matched surfaces would be. If that is much farther than the other
surfaces of the images, the pair matches either the background, which hardly determines the cameras' positions, or two
different parts.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
from numpy.typing import NDArray

from recon.sfm.misplaced import Fixes

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FARTHER = 3.0
"""How many times the usual distance of an image's surfaces a pair must imply to be doubtful [1]. In a flight round
a suspension bridge, pairs at one tower implied 0.8 to 2.0 times as much, pairs of its two towers 3.3 and more."""
_NEAREST = 4  # pairs of an image, those taken nearest to each other, whose median gives its usual distance
_LEAST_MATCHES = 3
_MOST = 0.08  # share of the pairs; above it the fixes are wrong, not the pairs: with exchanged fixes it was 10 to 17 %


@dataclass(frozen=True)
class PairGeometry:
    """Facts about pairs of images from two-view geometry and GPS.

    Attributes:
        images: Ids of the two images of each pair, shape (P, 2), int64.
        baseline: Distance of their two fixes [m], shape (P,), float64.
        distance: Median distance of the matched surfaces from the first and from the second camera, if the cameras are
            `baseline` apart [m], shape (P, 2), float64.
    """

    images: I64
    baseline: F64
    distance: F64


def doubtful_pairs(database: Path, fixes: Fixes) -> set[int]:
    """Find the verified pairs that show the background, or two parts that look alike, by the GPS of their images.

    Args:
        database: Database of verified matches.
        fixes: GPS position by name of image [m]; an image may have none.

    Returns:
        Ids of the pairs; none if so many are doubtful that GPS itself must be wrong.
    """
    found = _pair_geometry(database, fixes)
    wrong = doubtful(found)
    if wrong.sum() > _MOST * len(wrong):
        return set()
    return {pycolmap.image_pair_to_pair_id(first, second) for first, second in found.images[wrong].tolist()}


def doubtful(pairs: PairGeometry) -> NDArray[np.bool_]:
    """Tell which pairs imply surfaces much farther away than the other surfaces of their images.

    Only pairs whose images are farther apart than their usual distance from the surfaces are judged: for closer ones,
    the error of the fixes is larger than what they imply.

    Args:
        pairs: Pairs of images.

    Returns:
        Whether each pair is doubtful, shape (P,), bool.
    """
    usual: dict[int, float] = {}
    for image in np.unique(pairs.images).tolist():
        rows, sides = np.nonzero(pairs.images == image)
        nearest = np.lexsort((rows, pairs.baseline[rows]))[:_NEAREST]
        usual[image] = float(np.median(pairs.distance[rows[nearest], sides[nearest]]))
    expected = np.array([[usual[image] for image in pair] for pair in pairs.images.tolist()]).reshape(-1, 2)
    apart = pairs.baseline > expected.max(axis=1, initial=0.0)
    return apart & (pairs.distance > FARTHER * expected).all(axis=1)


def _pair_geometry(database: Path, fixes: Fixes) -> PairGeometry:
    images, baselines, distances = [], [], []
    with pycolmap.Database.open(database) as opened:
        by_id = {image.image_id: image for image in opened.read_all_images()}
        cameras = {camera.camera_id: camera for camera in opened.read_all_cameras()}
        points: dict[int, F64] = {}
        numbers, geometries = opened.read_two_view_geometries()
        for number, geometry in zip(numbers, geometries, strict=True):
            pair = pycolmap.pair_id_to_image_pair(number)
            places = [fixes.get(by_id[image].name) for image in pair]
            known = geometry.E is not None and geometry.H is not None  # without both, COLMAP returns no pose
            if not known or len(geometry.inlier_matches) < _LEAST_MATCHES or places[0] is None or places[1] is None:
                continue
            for image in set(pair) - set(points):
                points[image] = opened.read_keypoints(image)[:, :2].astype(np.float64)
            sides = [(cameras[by_id[image].camera_id], points[image]) for image in pair]
            if pycolmap.estimate_two_view_geometry_pose(*sides[0], *sides[1], geometry):
                images.append(pair)
                baselines.append(float(np.linalg.norm(np.array(places[0]) - np.array(places[1]))))
                distances.append(baselines[-1] * _distances(geometry, sides))
    return PairGeometry(
        np.array(images, np.int64).reshape(-1, 2), np.array(baselines), np.array(distances).reshape(-1, 2)
    )


def _distances(geometry: Any, sides: list[tuple[Any, F64]]) -> F64:
    """Measure the median distances of the matched surfaces from the two cameras, in baselines [1], shape (2,)."""
    matches = geometry.inlier_matches.reshape(-1, 2)
    pose = geometry.cam2_from_cam1
    first, second = (
        _unit(np.column_stack([camera.cam_from_img(points[matches[:, side]]), np.ones(len(matches))]))
        for side, (camera, points) in enumerate(sides)
    )
    first, toward = first @ pose.rotation.matrix().T, _unit(pose.translation[None])
    sine = np.maximum(np.linalg.norm(np.cross(first, second), axis=1), 1e-9)  # of the angle at the surface
    return np.array([np.median(np.linalg.norm(np.cross(toward, other), axis=1) / sine) for other in (second, first)])


def _unit(vectors: F64) -> F64:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
