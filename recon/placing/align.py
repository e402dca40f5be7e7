"""The similarity from a reconstruction's frame to the world, and a status for every camera."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import RejectedSceneError
from recon.placing.place_errors import PlaceErrors
from recon.placing.similarity import Similarity, angles, fit_similarity, level_rotation, turn_upright
from recon.settings import AlignmentSettings

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

OK, UNREGISTERED, CENTER_OUTLIER, ROTATION_OUTLIER = "ok", "unregistered", "centre_outlier", "rotation_outlier"
REGISTERED = (OK, CENTER_OUTLIER, ROTATION_OUTLIER)
_MIN_CAMERAS = 3
_STRAIGHT = 1e-3  # ratio of second to first singular value below which centers do not determine the rotation
_ROUNDS = 10


@dataclass(frozen=True)
class Target:
    """The known or measured camera poses that a model is aligned to.

    Attributes:
        kind: `truth`, `gps`, `control points`, `scale bars` or `none`.
        centers: Camera centers [m], shape (N, 3), float64, one row per image of the capture; NaN where unknown.
        rotations: Camera-to-world rotations [1], shape (N, 3, 3), float64, or None when only positions are known.
        center_limit: Distance above which a center is an outlier [m].
        sigmas: Stated standard deviation of each center along x, y, z [m], shape (N, 3), float64, or None; infinite for
            a height that was not measured.
        bias: Standard deviation along x, y, z of the error that all centers share [m].
        gimbal: Up direction in each camera's axes from its gimbal [1], shape (N, 3), float64, NaN where unknown; or
            None.
        quarter_turns: Turns by 90 degrees clockwise that make each picture upright, shape (N,), int64; None for none.
    """

    kind: str
    centers: F64
    rotations: F64 | None
    center_limit: float
    sigmas: F64 | None = None
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gimbal: F64 | None = None
    quarter_turns: NDArray[np.int64] | None = None

    def level(self, poses: F64, rows: NDArray[np.int64]) -> F64:
        """Rotate cameras about their line of sight so that each picture is upright.

        Args:
            poses: camera_to_world [model units], shape (I, 4, 4), float64.
            rows: Their rows in the capture, shape (I,), int64.

        Returns:
            Rotations [1], shape (I, 3, 3), float64.
        """
        turns = np.zeros(len(rows), np.int64) if self.quarter_turns is None else self.quarter_turns[rows]
        return turn_upright(poses[:, :3, :3], turns)


@dataclass(frozen=True)
class Alignment:
    """The similarity and its residuals.

    Attributes:
        similarity: From the model into the world.
        method: How it was found: `centres+rotations`, `centres`, `fixes+gravity`, `control points`,
            `scale bars`, or `up` alone.
        status: Reason code of every image of the capture, `ok` for valid ones.
        center_errors: Distance between aligned and target center [m], shape (N,), float64; NaN when unregistered.
        rotation_errors: Angle between aligned and target rotation [deg], shape (N,), float64; NaN when unknown.
        singular_values: Singular values of the centered target centers of valid cameras [m], shape (3,), float64,
            descending.
        agreeing: Whether each measured position agrees with the others, shape (N,), bool; None with truth.
        errors: Limits of the alignment's errors; None with truth, and where nothing was measured.
        unfixed: Why the measured positions do not determine the model's frame; empty where they do, or there are none.
    """

    similarity: Similarity
    method: str
    status: tuple[str, ...]
    center_errors: F64
    rotation_errors: F64
    singular_values: F64
    agreeing: Mask | None = None
    errors: PlaceErrors | None = None
    unfixed: str = ""


def center_limit(centers: F64, survey_kind: object, settings: AlignmentSettings) -> float:
    """Choose the distance above which a camera center is an outlier.

    Args:
        centers: Target camera centers [m], shape (N, 3), float64.
        survey_kind: The survey's kind; `local` has its own limit.
        settings: May state the limit.

    Returns:
        Limit [m].
    """
    if settings.center_limit is not None:
        return settings.center_limit
    if survey_kind == "local":
        return 0.25
    return float(min(0.005 * np.linalg.norm(np.nanmax(centers, axis=0) - np.nanmin(centers, axis=0)), 0.5))


def align(
    poses: F64, rows: NDArray[np.int64], target: Target, settings: AlignmentSettings, rng: np.random.Generator
) -> Alignment:
    """Fit the similarity to the inlier cameras, and give every camera a status.

    RANSAC over the centers finds the inliers. By default the rotation is then the mean of the cameras' own rotations:
    on a nearly straight flight the centers alone do not determine the roll about the path.
    Source: the paper aligns by RANSAC over centers (method `paper`).

    Args:
        poses: camera_to_world of the registered images [model units], shape (I, 4, 4), float64.
        rows: Their rows in the capture, shape (I,), int64.
        target: The true or measured poses.
        settings: Method and limits.
        rng: Source of RANSAC's samples.

    Returns:
        The alignment.

    Raises:
        RejectedSceneError: `alignment_failed`, or `straight_path` where centers alone do not determine the rotation.
    """
    known = np.asarray(np.isfinite(target.centers[rows]).all(axis=1))
    source, goal = poses[:, :3, 3], np.nan_to_num(target.centers[rows])
    turned = None  # rotation from the model into the world according to each camera alone
    if target.rotations is not None:
        turned = target.rotations[rows] @ poses[:, :3, :3].transpose(0, 2, 1)
    by_rotations = settings.method != "paper" and turned is not None
    ruling = turned if by_rotations else None
    inliers = find_inliers(source, goal, known, target.center_limit, settings.iterations, rng)
    if ruling is not None:
        inliers &= angles(ruling, _central_rotation(ruling, inliers)) <= settings.rotation_limit
    similarity = _fit(source, goal, ruling, inliers)
    far, twist = _misfit(similarity, source, goal, turned)
    for _ in range(_ROUNDS):
        agreeing = known & (far <= target.center_limit) & ~(by_rotations & (twist > settings.rotation_limit))
        if (agreeing == inliers).all():
            break
        inliers = agreeing
        similarity = _fit(source, goal, ruling, inliers)
        far, twist = _misfit(similarity, source, goal, turned)
    spread = np.linalg.svd(goal[inliers] - goal[inliers].mean(axis=0), compute_uv=False).astype(np.float64)
    method = "centres+rotations" if by_rotations else "centres"
    if not by_rotations and spread[1] < _STRAIGHT * spread[0]:
        raise RejectedSceneError("straight_path", "all cameras lie on one line, so their centers determine no rotation")
    straying = ~known | (far > target.center_limit)
    twisted = by_rotations & (twist > settings.rotation_limit)
    count = len(target.centers)
    status = np.full(count, UNREGISTERED, dtype=object)
    status[rows] = np.where(straying, CENTER_OUTLIER, np.where(twisted, ROTATION_OUTLIER, OK))
    center_errors, rotation_errors = np.full(count, np.nan), np.full(count, np.nan)
    center_errors[rows], rotation_errors[rows] = np.where(known, far, np.nan), twist
    return Alignment(similarity, method, tuple(status), center_errors, rotation_errors, spread)


def stand_upright(poses: F64, rows: NDArray[np.int64], target: Target) -> Alignment:
    """Keep a model in its own units, but turn it upright and center its cameras on the origin.

    Args:
        poses: camera_to_world of the registered images [model units], shape (I, 4, 4), float64.
        rows: Their rows in the capture, shape (I,), int64.
        target: For the number of images, and the gimbal and orientation of each.

    Returns:
        An alignment of scale 1 in which every registered camera is valid.
    """
    gimbal = None if target.gimbal is None else target.gimbal[rows]
    rotation = level_rotation(target.level(poses, rows), gimbal)
    centers, count = poses[:, :3, 3], len(target.centers)
    status, unknown = np.full(count, UNREGISTERED, dtype=object), np.full(count, np.nan)
    status[rows] = OK
    spread = np.linalg.svd(centers - centers.mean(axis=0), compute_uv=False).astype(np.float64)
    upright = Similarity(1.0, rotation, -rotation @ centers.mean(axis=0))
    return Alignment(upright, "up", tuple(status), unknown, unknown, spread)


def check_share(status: tuple[str, ...], settings: AlignmentSettings) -> None:
    """Reject a scene with too many invalid cameras.

    Args:
        status: Reason code of every image of the capture.
        settings: States the greatest share allowed.

    Raises:
        RejectedSceneError: `too_few_cameras`.
    """
    invalid, count = sum(code != OK for code in status), len(status)
    if invalid > settings.max_invalid_share * count + 1e-9:
        raise RejectedSceneError(
            "too_few_cameras",
            f"{invalid} of {count} cameras are invalid (unregistered or outliers), more than "
            f"{settings.max_invalid_share:.0%}. Take more photographs, or raise [recon.alignment] max_invalid_share",
        )


def find_inliers(source: F64, goal: F64, known: Mask, limit: float, iterations: int, rng: np.random.Generator) -> Mask:
    """Find the inliers of one similarity, by RANSAC over triples.

    Args:
        source: Points [model units], shape (N, 3), float64.
        goal: Matching points [m], shape (N, 3), float64.
        known: Points that are used, shape (N,), bool.
        limit: Largest distance of an inlier [m].
        iterations: Triples tried.
        rng: Source of randomness.

    Returns:
        Inliers, shape (N,), bool.

    Raises:
        RejectedSceneError: `alignment_failed`: no similarity has three inliers.
    """
    candidates = np.flatnonzero(known)
    if len(candidates) >= _MIN_CAMERAS:
        keys = rng.random((iterations, len(candidates)))
        triples = candidates[np.argpartition(keys, _MIN_CAMERAS - 1, axis=1)[:, :_MIN_CAMERAS]]
        scale, rotation, translation = fit_similarity(source[triples], goal[triples])
        moved = scale[:, None, None] * (source @ rotation.transpose(0, 2, 1)) + translation[:, None, :]
        far = np.nan_to_num(np.linalg.norm(moved - goal, axis=2), nan=np.inf, posinf=np.inf)
        far[:, ~known] = np.inf
        cost = np.minimum(far, limit).sum(axis=1)  # truncated: of equal counts the closer fit is chosen
        inliers = far[np.argmin(cost)] <= limit
        if inliers.sum() >= _MIN_CAMERAS:
            return inliers
    raise RejectedSceneError("alignment_failed", "no similarity brings three cameras to their known positions")


def _central_rotation(rotations: F64, inliers: Mask) -> F64:
    """Choose the rotation whose median distance to the others is smallest: up to half of them may be wrong."""
    chosen = rotations[inliers]
    closeness = np.einsum("aij,bij->ab", chosen, chosen)  # trace of A^T B: grows as the angle shrinks
    return chosen[np.argmax(np.median(closeness, axis=1))]


def _misfit(similarity: Similarity, source: F64, goal: F64, turned: F64 | None) -> tuple[F64, F64]:
    """Compute the residuals of a similarity: distances of centers [m] and angles [deg], both of shape (I,)."""
    far = np.linalg.norm(similarity.move(source) - goal, axis=1).astype(np.float64)
    return far, angles(turned, similarity.rotation) if turned is not None else np.full(len(source), np.nan)


def _fit(source: F64, goal: F64, turned: F64 | None, inliers: Mask) -> Similarity:
    if inliers.sum() < _MIN_CAMERAS:
        raise RejectedSceneError("alignment_failed", "fewer than three cameras agree with their known positions")
    source, goal = source[inliers], goal[inliers]
    if turned is None:
        scale, rotation, translation = fit_similarity(source, goal)
        return Similarity(float(scale), rotation, translation)
    left, _, right = np.linalg.svd(turned[inliers].sum(axis=0))
    return _with_rotation(left @ right, source, goal)  # no reflection: the rotations lie within 45 degrees


def _with_rotation(rotation: F64, source: F64, goal: F64) -> Similarity:
    source_mean, goal_mean = source.mean(axis=0), goal.mean(axis=0)
    spread = np.linalg.norm(source - source_mean)
    if spread == 0.0:
        raise RejectedSceneError("alignment_failed", "all cameras are in one place, so nothing determines the scale")
    scale = float(np.linalg.norm(goal - goal_mean) / spread)
    return Similarity(scale, rotation, goal_mean - scale * rotation @ source_mean)
