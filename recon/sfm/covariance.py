"""Expected errors of the lens and of the camera positions, from the residuals of a model's keypoints.

These are the errors caused by the scatter of the keypoints alone (the "internal precision" of photogrammetry). Real
errors are larger if the lens has other distortions than its model, or if matches are wrong. Wrong matches count fully
in the scatter, though the adjustment gives them little weight: this makes the expected errors larger.

Source: Triggs et al., Bundle Adjustment: A Modern Synthesis (2000), sections 6.1 (reduced camera system), 9.3 (inner
constraints).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, csr_array, diags_array

from recon.sfm.camera_model import parameter_names, project
from recon.sfm.colmap_model import SparseModel

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

MOST_IMAGES = 1000  # the inverse of a matrix of 6,000 rows takes a minute
MOST_OBSERVATIONS = 1_200_000  # each needs 1.8 kB of memory
_POSE = 6  # numbers of a pose: center, rotation about the axes of the world
_STEP = 1e-6  # of numerical derivatives, in directions at depth 1 and in parameters as shares of their size
_NEAREST = 1e-6  # of a point in front of a camera, as a share of the extent of the cameras
_FIXED = ("cx", "cy")  # the adjustment does not change the principal point


@dataclass(frozen=True)
class Precision:
    """Expected errors of a model, one standard deviation.

    Attributes:
        names: File name of each image.
        centers: Covariance of each camera center [m²] in a model in meters, shape (I, 3, 3), float64, where
            translation, rotation and scale of the whole model are chosen so that the centers move least.
        lens: Names of the parameters of the lens that were adjusted.
        lens_sigma: Standard deviation of each [px] [1], shape (K,), float64.
        correlation: Correlations between them [1], shape (K, K), float64.
        residual: Scatter of the keypoints along an axis of the photographs [px].
    """

    names: tuple[str, ...]
    centers: F64
    lens: tuple[str, ...]
    lens_sigma: F64
    correlation: F64
    residual: float


def precision_of(model: SparseModel) -> Precision | None:
    """Compute the expected errors of a model.

    Args:
        model: A model.

    Returns:
        The errors; None if they cannot be computed: more than `MOST_IMAGES` images or `MOST_OBSERVATIONS`, too few
        keypoints, or images without a connection to the others.
    """
    model = _usable(model)
    images, rows = len(model.names), 2 * len(model.obs_point)
    names = parameter_names(model.camera_model, len(model.camera_params))
    free = [number for number, name in enumerate(names) if name not in _FIXED]
    size = _POSE * images + len(free)
    count = np.bincount(model.obs_point, minlength=len(model.points))
    spare = rows - 3 * np.count_nonzero(count) - size + 7
    if not 2 <= images <= MOST_IMAGES or rows > 2 * MOST_OBSERVATIONS or spare <= 0:
        return None
    middle, unit = model.poses[:, :3, 3].mean(axis=0), float(np.ptp(model.poses[:, :3, 3], axis=0).max())
    if unit <= 0.0:
        return None
    centers = (model.poses[:, :3, 3] - middle) / unit
    points = (model.points - middle) / unit
    poses, lens, place, miss = _derivatives(model, centers, points, free)
    reduced = _reduced(model, (poses, lens, place), size)
    covariance = _inner_inverse(reduced, centers, size)
    variance = float((miss**2).sum()) / spare
    if covariance is None or not np.isfinite(variance):
        return None
    covariance *= variance
    at = _POSE * np.arange(images)[:, None] + np.arange(3)
    own = covariance[_POSE * images :, _POSE * images :]
    sigma = np.sqrt(np.diag(own))
    return Precision(
        model.names,
        covariance[at[:, :, None], at[:, None, :]] * unit**2,
        tuple(names[number] for number in free),
        sigma,
        own / np.outer(sigma, sigma),
        float(np.sqrt(variance)),
    )


def _usable(model: SparseModel) -> SparseModel:
    """Leave out observations from behind, and those of points that only one image sees, which add no information."""
    poses = model.poses[model.obs_image]
    ahead = np.einsum("mi,mi->m", model.points[model.obs_point] - poses[:, :3, 3], poses[:, :3, 2])
    kept = ahead > _NEAREST * float(np.ptp(model.poses[:, :3, 3], axis=0).max(initial=0.0))
    count = np.bincount(model.obs_point[kept], minlength=len(model.points))
    kept &= count[model.obs_point] >= 2
    return replace(model, obs_point=model.obs_point[kept], obs_image=model.obs_image[kept], obs_uv=model.obs_uv[kept])


def _derivatives(model: SparseModel, centers: F64, points: F64, free: list[int]) -> tuple[F64, F64, F64, F64]:
    """Differentiate the pixel of every observation.

    Returns:
        By center and rotation of its camera, shape (M, 2, 6); by the free parameters of the lens, shape (M, 2, K); by
        its point, shape (M, 2, 3); and pixel minus keypoint [px], shape (M, 2).
    """
    rays = points[model.obs_point] - centers[model.obs_image]
    turns = model.poses[model.obs_image, :3, :3]  # camera to world
    local = np.einsum("mi,mij->mj", rays, turns)
    depth = local[:, 2]
    plane, params = local[:, :2] / depth[:, None], np.array(model.camera_params)

    def seen(at: F64, values: F64) -> F64:
        return project(at, model.camera_model, values)

    by_plane = np.stack(
        [(seen(plane + step, params) - seen(plane - step, params)) / (2 * _STEP) for step in _STEP * np.eye(2)], axis=2
    )
    by_lens = np.zeros((len(plane), 2, len(free)))
    for column, number in enumerate(free):
        step = np.zeros(len(params))
        step[number] = _STEP * max(abs(params[number]), 1.0)
        by_lens[:, :, column] = (seen(plane, params + step) - seen(plane, params - step)) / (2 * step[number])
    flat = np.zeros((len(plane), 2, 3))  # of plane by local
    flat[:, 0, 0] = flat[:, 1, 1] = 1.0 / depth
    flat[:, :, 2] = -plane / depth[:, None]
    by_point = np.einsum("mij,mjk,mlk->mil", by_plane, flat, turns)
    by_turn = np.asarray(np.cross(rays[:, None, :], -by_point), np.float64)  # a rotation w moves the ray by -w x ray
    return np.concatenate([-by_point, by_turn], axis=2), by_lens, by_point, seen(plane, params) - model.obs_uv


def _reduced(model: SparseModel, parts: tuple[F64, F64, F64], size: int) -> F64:
    """Eliminate the points from the normal equations (Schur complement); shape (size, size)."""
    poses, lens, place = parts
    count, rows = len(model.obs_point), np.arange(2 * len(model.obs_point))
    own = _POSE * model.obs_image[:, None, None] + np.arange(_POSE)
    at = np.broadcast_to(own, (count, 2, _POSE)).ravel()
    by_pose = csr_array((poses.ravel(), (np.repeat(rows, _POSE), at)), shape=(2 * count, size - lens.shape[2]))
    cameras = block_array([[by_pose, csr_array(lens.reshape(2 * count, -1))]], format="csr")
    normal = np.zeros((len(model.points), 3, 3))
    np.add.at(normal, model.obs_point, np.einsum("mij,mik->mjk", place, place))
    seen = np.bincount(model.obs_point, minlength=len(model.points)) > 0
    value, axes = np.linalg.eigh(normal[seen])
    weak = value <= 1e-12 * value[:, -1:]  # the views do not determine a point along this axis
    root = np.zeros((len(model.points), 3, 3))
    root[seen] = axes * np.where(weak, 0.0, 1.0 / np.sqrt(np.where(weak, 1.0, value)))[:, None, :]
    scaled = np.einsum("mij,mjk->mik", place, root[model.obs_point])
    columns = np.broadcast_to(3 * model.obs_point[:, None, None] + np.arange(3), (count, 2, 3)).ravel()
    points = csr_array((scaled.ravel(), (np.repeat(rows, 3), columns)), shape=(2 * count, 3 * len(model.points)))
    shared = (cameras.T @ points).tocsr()
    return (cameras.T @ cameras).toarray() - (shared @ shared.T).toarray()


def _inner_inverse(normal: F64, centers: F64, size: int) -> F64 | None:
    """Invert singular normal equations under the conditions that minimize the changes of the centers."""
    images = len(centers)
    null = np.zeros((images, _POSE, 7))
    null[:, :3, :3] = np.eye(3)
    null[:, 3:, 3:6] = np.eye(3)
    null[:, :3, 3:6] = np.cross(np.eye(3), centers[:, None, :]).transpose(0, 2, 1)
    null[:, :3, 6] = centers
    free = np.zeros((size, 7))
    free[: _POSE * images] = null.reshape(-1, 7)
    bound = np.zeros((size, 7))
    null[:, 3:] = 0.0
    bound[: _POSE * images] = null.reshape(-1, 7)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    weight = float(np.median(np.diag(normal)[: _POSE * images]))
    whole = diags_array(scale) @ (normal + weight * bound @ bound.T) @ diags_array(scale)
    try:
        inverse = np.linalg.inv(whole) * np.outer(scale, scale)
        inner = np.linalg.inv(bound.T @ free)
    except np.linalg.LinAlgError:
        return None
    covariance = inverse - free @ (inner @ inner.T / weight) @ free.T
    return covariance if np.isfinite(covariance).all() and (np.diag(covariance) > 0.0).all() else None
