"""Alignment to positions that a receiver measured: every camera stays valid, and the possible errors are stated."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.placing.align import Alignment, Target, stand_upright
from recon.placing.gps_fit import fit_to_fixes
from recon.placing.gravity import gravity_cues
from recon.placing.place_errors import expected_errors

F64 = NDArray[np.float64]

METHOD = "fixes+gravity"


def align_to_fixes(poses: F64, rows: NDArray[np.int64], target: Target, rng: np.random.Generator) -> Alignment:
    """Align a model to the measured positions of its cameras and to gravity; every registered camera stays valid.

    The distance of a camera to its GPS fix is an error of the receiver: an outlier fix is left out of the fit, its
    camera is kept.

    Args:
        poses: camera_to_world of the registered images [model units], shape (I, 4, 4), float64.
        rows: Their rows in the capture, shape (I,), int64.
        target: The GPS fixes, with `sigmas`.
        rng: Source of the initial triples of cameras.

    Returns:
        The alignment; if the fixes do not determine the frame, one that is only upright, with the reason in `unfixed`.
    """
    known = np.isfinite(target.centers[rows]).all(axis=1) & (target.sigmas is not None)
    upright = stand_upright(poses, rows, target)
    flown = np.argsort(rows[known], kind="stable")
    used = rows[known][flown]
    source, goal = poses[known][flown][:, :3, 3], target.centers[used]
    gimbal = None if target.gimbal is None else target.gimbal[rows]
    sigmas = np.ones((len(target.centers), 3)) if target.sigmas is None else target.sigmas
    fit = fit_to_fixes(source, goal, sigmas[used], gravity_cues(target.level(poses, rows), gimbal), rng)
    if fit is None:
        return replace(upright, unfixed="fewer than three positions that differ")
    errors = expected_errors(fit, np.array(target.bias))
    if errors.unfixed():
        return replace(upright, unfixed=errors.unfixed(), errors=errors)
    agreeing, far = np.zeros(len(target.centers), bool), np.full(len(target.centers), np.nan)
    agreeing[used] = fit.agreeing
    away = np.where(np.isfinite(sigmas[used]), fit.similarity.move(source) - goal, 0.0)
    far[used] = np.linalg.norm(away, axis=1)
    resting = goal[fit.agreeing]
    return replace(
        upright,
        similarity=fit.similarity,
        method=METHOD,
        center_errors=far,
        agreeing=agreeing,
        errors=errors,
        singular_values=np.linalg.svd(resting - resting.mean(axis=0), compute_uv=False).astype(np.float64),
    )
