"""What `falsework survey` does, in a child process: the stages that it opens may come from anywhere."""

from collections import defaultdict
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from falsework.children.products import ADDRESS_LIMIT
from groundwork.child import answer_parent
from groundwork.progress import Progress

LINKED_ENOUGH = 0.9  # predicted share of registered images below which a flight is warned of
MANY = 600  # images of one flight that are worth a word
OUTLINE = 6000  # points of the bridge in the figure


def score(request: dict[str, Any], progress: Progress) -> list[dict[str, Any]]:
    """Judge the flights of a stage.

    Args:
        request: `{scene, survey}`; `survey` is empty for all.
        progress: Listener.

    Returns:
        For each flight its name, score, coverage by class, warnings, and what the figure draws.
    """
    from authoring.surveys.framing import eye_of
    from authoring.surveys.score import score_flight
    from authoring.surveys.stage_subject import stage_subject
    from usd_schemas.pinhole import pinhole_from_lens
    from usd_schemas.reading.scene_cache import load_scene

    scene = load_scene(Path(request["scene"]), survey=request["survey"] or None)
    subject = stage_subject(scene)
    bridge = subject.bridge, subject.bridge_ids.astype(np.int64)
    classes = {row.id: row.class_name for row in scene.instances}
    outline = _outline(*bridge)
    answers = []
    progress.stage("score", len(scene.products))
    for number, product in enumerate(scene.products):
        track = scene.cameras[product.camera]
        if not track.path:  # the camera that frames a stage without any
            continue
        camera = track.calibration or pinhole_from_lens(track.lens, product.width, product.height)
        times = track.facts.get("capture_times")
        duration = float(times[-1]) if isinstance(times, (list, tuple)) and times else 0.0
        found = score_flight(track.poses, eye_of(camera, track.distortion), duration, bridge, subject.obstacles)
        shares: dict[str, list[float]] = defaultdict(list)
        for instance, share in found.covered.items():
            shares[classes.get(instance, "")].append(share)
        answers.append(
            {
                "survey": product.name,
                **asdict(found),
                "by_class": {name: float(np.mean(values)) for name, values in sorted(shares.items())},
                "warnings": _warnings(found.linked, found.clearance),
                "centres": np.round(track.poses[:, :3, 3], 3).tolist(),
                "looks": np.round(track.poses[:, :3, 2], 3).tolist(),
                "outline": outline,
            }
        )
        progress.advance(number + 1)
    return answers


def plan(request: dict[str, Any], progress: Progress) -> list[dict[str, Any]]:
    """Fly one more survey over a scene and add it.

    Args:
        request: `{scene, plan, seed}`: settings of the survey, and a seed or None for that of the scene.
        progress: Listener.
    """
    from authoring.scenes.add_survey import add_survey
    from authoring.surveys.settings import GlobalSettings, GridSettings, LocalSettings, StageSettings
    from groundwork.settings import parse_settings

    progress.stage("plan", 1)
    kinds = {"global": GlobalSettings, "local": LocalSettings, "grid": GridSettings, "stage": StageSettings}
    settings = parse_settings(kinds[request["plan"]["kind"]], request["plan"], "survey")
    path = add_survey(Path(request["scene"]), settings, request["seed"])
    progress.advance(1)
    steps = np.linalg.norm(np.diff(path.poses[:, :3, 3], axis=0), axis=1)
    if len(path.poses) > MANY:
        progress.note(f"{len(path.poses)} images: judge them with `falsework survey score` before you render them")
    return [{"survey": path.id, "images": len(path.poses), "length": float(steps.sum())}]


def _warnings(linked: float, clearance: float) -> list[str]:
    lines = []
    if linked < LINKED_ENOUGH:
        lines.append(f"about {100.0 * (1.0 - linked):.0f} % of the images will hardly be registered: fly denser")
    if clearance < 0.3:
        lines.append(f"a camera comes within {clearance:.2f} m of a surface")
    return lines


def _outline(corners: Any, ids: Any) -> list[list[float]]:
    """Take points all over the bridge, for orientation in a figure."""
    from authoring.surveys.surface_samples import sample_surfaces

    points = sample_surfaces(corners, ids).points
    return np.round(points[:: max(1, len(points) // OUTLINE)], 2).tolist()


def _answer(request: dict[str, Any], progress: Progress) -> list[dict[str, Any]]:
    from usd_schemas.guard.guard import check_stage, limit_memory

    limit_memory(ADDRESS_LIMIT)
    check_stage(Path(request["scene"]), tuple(Path(root) for root in request["allow_roots"]), progress.note)
    if "plan" in request:
        return plan(request, progress)
    return score(request, progress)


if __name__ == "__main__":
    answer_parent(_answer)
