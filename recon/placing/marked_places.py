"""Where the marks of a point in several photographs meet in a model, and how well they determine it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.dense.undistort import lens_of
from recon.placing.ground_control import GroundControl, image_key
from recon.sfm.colmap_model import SparseModel
from render.capture import Capture

F64 = NDArray[np.float64]

_LEAST_MARKS = 2
_LEAST_NOISE = 0.3  # [px] nobody marks more exactly
_RARE = 1e-4  # share of points whose marks deviate by more by chance


@dataclass(frozen=True, eq=False)
class MarkedPlace:
    """Where the marks of a point meet.

    Attributes:
        place: Position [model units], shape (3,), float64.
        images: Number of photographs.
        pixels: Root mean square distance of the marks from the projected position [px].
        covariance: Of the position, for marks with a standard deviation of one pixel along each axis [model units²],
            shape (3, 3), float64.
    """

    place: F64
    images: int
    pixels: float
    covariance: F64


def find_places(model: SparseModel, capture: Capture, control: GroundControl) -> dict[str, MarkedPlace]:
    """Find where the marks of each point meet in the model.

    Args:
        model: Reconstruction.
        capture: Photographs.
        control: Points and marks.

    Returns:
        Place of each point that is marked in two registered photographs; a point whose rays diverge has none.

    Raises:
        InputError: A mark lies outside its image.
    """
    camera, distortion = lens_of(model, capture.size)
    row_of = {image_key(name): row for row, name in enumerate(model.names)}
    focal, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    size = np.array(capture.size)
    found: dict[str, MarkedPlace] = {}
    for point in control.points:
        marks = [mark for mark in point.marks if image_key(mark.image) in row_of]
        uv = np.array([mark.uv for mark in marks]).reshape(-1, 2)
        for mark in marks:
            if not ((np.array(mark.uv) >= 0.0) & (np.array(mark.uv) <= size)).all():
                raise InputError(
                    f"the mark of {point.name} lies outside the image",
                    where=control.file,
                    field=mark.image,
                    value=mark.uv,
                    allowed=f"0 0 to {size[0]} {size[1]}",
                )
        if len(marks) < _LEAST_MARKS:
            continue
        poses = model.poses[[row_of[image_key(mark.image)] for mark in marks]]
        rays = np.column_stack([distortion.undistort((uv - middle) / focal), np.ones(len(marks))])
        world = np.einsum("nij,nj->ni", poses[:, :3, :3], rays / np.linalg.norm(rays, axis=1, keepdims=True))
        place = intersect_rays(poses[:, :3, 3], world)
        local = np.einsum("nji,nj->ni", poses[:, :3, :3], place - poses[:, :3, 3])
        if not (local[:, 2] > 0.0).all():
            continue  # the rays diverge: a mark is wrong
        back = distortion.distort(local[:, :2] / local[:, 2:]) * focal + middle
        pixels = float(np.sqrt(((back - uv) ** 2).sum(axis=1).mean()))
        covariance = _covariance(place - poses[:, :3, 3], float(focal.mean()))
        found[point.name] = MarkedPlace(place, len(marks), pixels, covariance)
    return found


def intersect_rays(centers: F64, directions: F64) -> F64:
    """Find the point nearest to some rays, each weighted by the inverse of its distance, as pixel errors do.

    Args:
        centers: Starts of the rays [model units], shape (N, 3), float64.
        directions: Unit directions [1], shape (N, 3), float64.

    Returns:
        The point [model units], shape (3,), float64; NaN for parallel rays.
    """
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    weights = np.ones(len(centers))
    point = np.full(3, np.nan)
    for _ in range(5):
        normal = np.einsum("n,nij->ij", weights, across)
        if np.linalg.eigvalsh(normal)[0] < 1e-12 * np.trace(normal):
            return np.full(3, np.nan)
        point = np.linalg.solve(normal, np.einsum("n,nij,nj->i", weights, across, centers))
        square = ((point - centers) ** 2).sum(axis=1)
        weights = square.mean() / np.maximum(square, 1e-12 * square.mean())
    return point


def mark_variances(places: list[MarkedPlace]) -> F64:
    """Estimate the variance of the marks of each point along an axis of the picture.

    All points have one variance. If the marks of a point deviate by far more than those of most points, one of them is
    wrong, and the residuals of that point count.

    Args:
        places: All marked points.

    Returns:
        Variances [px²], shape (P,), float64.
    """
    from scipy.stats import chi2  # half of the time to import the room

    freedom = np.array([2 * place.images - 3 for place in places], np.float64)
    squares = np.array([place.images * place.pixels**2 for place in places])
    usual = max(float(np.median(squares / chi2.ppf(0.5, freedom))), _LEAST_NOISE**2)
    sound = squares <= usual * chi2.ppf(1.0 - _RARE, freedom)
    common = max(float(squares[sound].sum() / freedom[sound].sum()), _LEAST_NOISE**2)
    return np.where(sound, common, np.maximum(squares / freedom, common))


def _covariance(lines: F64, focal: float) -> F64:
    """Compute the covariance of the point where lines of sight, shape (N, 3), meet, for marks off by one pixel."""
    square = (lines**2).sum(axis=1)
    across = square[:, None, None] * np.eye(3) - lines[:, :, None] * lines[:, None, :]
    return np.linalg.inv(np.einsum("n,nij->ij", (focal / square) ** 2, across))
