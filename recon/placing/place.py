"""Where a model belongs: its target (truth, GPS, or nothing), the alignment to it, and every camera's reason code."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import RejectedSceneError
from recon.placing.align import OK, UNREGISTERED, Alignment, Target, align, centre_limit, check_share, stand_upright
from recon.placing.similarity import Similarity
from recon.settings import AlignmentSettings
from render.capture import Capture, Truth

F64 = NDArray[np.float64]

_GPS_SIGMAS = 4.0  # a centre may stray this many standard deviations of the GPS
_FEW_POSITIONS = 3
NOTES = {
    "truth": "labels and uncertainty from truth",
    "gps": "no truth: aligned to GPS, without labels",
    "none": "no truth and no GPS that fits: in its own units, upright, without labels",
}


def place(
    poses: F64, rows: NDArray[np.int64], reasons: Mapping[str, str], capture: Capture, truth: Truth | None,
    settings: AlignmentSettings, rng: np.random.Generator,
) -> tuple[Alignment, Target]:  # fmt: skip
    """Carry a model to where it belongs, as far as anybody knows, and judge every camera.

    Photographs whose GPS is absent or does not fit the model leave it in its own units, standing upright.

    Args:
        poses: camera_to_world of the registered images in model units, shape (I, 4, 4), float64.
        rows: Their rows in the capture, shape (I,), int64.
        reasons: Why an image is not in the model, by file, where more is known than that.
        capture: Photographs.
        truth: Its truth, if there is any.
        settings: Method and limits.
        rng: Draws RANSAC's samples.

    Returns:
        The alignment and what it aligned to.

    Raises:
        RejectedSceneError: With truth only: `alignment_failed`, `straight_path` or `too_few_cameras`.
    """
    target = _target(capture, truth, settings)
    try:
        found = align(poses, rows, target, settings, rng) if target.kind != "none" else None
    except RejectedSceneError:
        if truth is not None:
            raise
        found = None
    if found is None:
        target = replace(target, kind="none")
        found = stand_upright(poses, rows, target)
    status = tuple(
        reasons.get(image.file, code) if code == UNREGISTERED else code
        for image, code in zip(capture.images, found.status, strict=True)
    )
    if truth is not None:  # the rule is that of a data set; whoever brings photographs wants what they give
        check_share(status, settings)
    return replace(found, status=status), target


def similarity_facts(similarity: Similarity) -> dict[str, Any]:
    """State a similarity as JSON.

    Args:
        similarity: From the model into the world.
    """
    return {
        "scale": similarity.scale,
        "rotation": similarity.rotation.tolist(),
        "translation": similarity.translation.tolist(),
    }


def alignment_facts(alignment: Alignment, target: Target, capture: Capture) -> dict[str, Any]:
    """State an alignment as JSON: the similarity, what it was found on, and how far that can be relied upon.

    Args:
        alignment: The alignment.
        target: What it aligned to.
        capture: Photographs.
    """
    placed = target.kind != "none"
    limit = target.centre_limit if placed else None
    facts = {
        **similarity_facts(alignment.similarity), "target": target.kind, "method": alignment.method,
        "note": NOTES[target.kind], "unit": "m" if placed else "unknown",
        "inliers": sum(code == OK for code in alignment.status), "centre_limit": limit,
        "singular_values": alignment.singular_values.tolist(),
    }  # fmt: skip
    if "origin" in capture.facts and target.kind == "gps":
        facts["origin"] = capture.facts["origin"]
    return facts


def camera_rows(capture: Capture, alignment: Alignment) -> tuple[dict[str, Any], ...]:
    """State the verdict on every image as JSON.

    Args:
        capture: Photographs.
        alignment: Its alignment.
    """

    def known(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    return tuple(
        {"name": image.name, "status": status, "center_error": known(centre), "rotation_error": known(rotation)}
        for image, status, centre, rotation in zip(
            capture.images, alignment.status, alignment.centre_errors, alignment.rotation_errors, strict=True
        )
    )


def _target(capture: Capture, truth: Truth | None, settings: AlignmentSettings) -> Target:
    kind = capture.facts.get("kind")
    if truth is not None:
        centres = truth.poses[:, :3, 3]
        return Target("truth", centres, truth.poses[:, :3, :3], centre_limit(centres, kind, settings))
    centres = np.array([image.gps or (np.nan,) * 3 for image in capture.images])
    turns = _quarter_turns(capture)
    if np.isfinite(centres).all(axis=1).sum() < _FEW_POSITIONS:
        return Target("none", centres, None, 0.0, quarter_turns=turns)
    limit = centre_limit(centres, kind, settings) + _GPS_SIGMAS * float(np.linalg.norm(capture.gps_sigma))
    return Target("gps", centres, None, limit, float(np.mean(capture.gps_sigma[:2])), turns)


def _quarter_turns(capture: Capture) -> NDArray[np.int64] | None:
    """Tell how the photographs were held, where their EXIF says so."""
    turns = capture.facts.get("quarter_turns")
    if not isinstance(turns, dict):
        return None
    return np.array([turns[image.name] for image in capture.images], np.int64)
