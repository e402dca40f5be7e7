"""What a rendered image is worth to structure from motion: SIFT keypoints, and how many matches are right."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from usd_schemas.pinhole import Pinhole, project, unproject

U8 = NDArray[np.uint8]
F64 = NDArray[np.float64]

RATIO = 0.8  # of the nearest to the second nearest descriptor (Lowe 2004)
RIGHT = 1.5  # [px] a match may lie off where the truth puts it


@dataclass(frozen=True)
class SfmValue:
    """Figures of a pair of images.

    Attributes:
        keypoints: Of the first image.
        matches: That pass the ratio test.
        right: Share of them within `RIGHT` of the truth [1].
    """

    keypoints: int
    matches: int
    right: float


def sfm_value(images: tuple[U8, U8], depth: NDArray[np.float32], poses: tuple[F64, F64], camera: Pinhole) -> SfmValue:
    """Find keypoints in two images, match them, and judge each match by the true depth of the first.

    Args:
        images: Photographs, each shape (H, W, 3), uint8.
        depth: True planar depth of the first [m], +inf for sky, shape (H, W), float32.
        poses: camera_to_world of both, each shape (4, 4), float64.
        camera: Intrinsics of both.
    """
    sift = cv2.SIFT_create()  # pyright: ignore[reportAttributeAccessIssue]  (the stubs of OpenCV 5 lack it)
    found = [sift.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.empty(0, np.uint8)) for image in images]
    (first, here), (second, there) = found
    pairs = cv2.BFMatcher().knnMatch(here, there, k=2)
    kept = [one for one, two in pairs if one.distance < RATIO * two.distance]
    start = np.array([first[match.queryIdx].pt for match in kept]) + 0.5  # OpenCV counts from pixel centers
    end = np.array([second[match.trainIdx].pt for match in kept]) + 0.5
    z = depth[start[:, 1].astype(int), start[:, 0].astype(int)].astype(float)
    seen = np.isfinite(z)
    world = unproject(start[seen], z[seen], camera, poses[0])
    off = np.linalg.norm(project(world, camera, poses[1])[0] - end[seen], axis=1)
    return SfmValue(len(first), len(kept), float((off < RIGHT).sum() / max(len(kept), 1)))
