"""Child process of `falsework survey`: the stages that it opens are untrusted."""

import math
from collections import Counter, defaultdict
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from falsework.children.products import ADDRESS_LIMIT
from groundwork.child import answer_parent
from groundwork.errors import InputError
from groundwork.progress import Progress

LINKED_ENOUGH = 0.9  # predicted share of registered images below which a warning is given
MANY = 600  # fewer images of one flight give no warning
OUTLINE = 20_000  # points of the bridge in the figure


def score(request: dict[str, Any], progress: Progress) -> list[dict[str, Any]]:
    """Score the flights of a stage.

    Args:
        request: `{scene, survey, propose}`; `survey` is empty for all.
        progress: Listener.

    Returns:
        For each flight its name, score (`sampling` is None where no image sees the bridge at 60 degrees or less),
        coverage by class, warnings, and the data of the figure; the last one also lists the members that too few images
        of all flights show, and legs that would show them.
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
    outline = _outline(*bridge, classes)
    answers = []
    progress.stage("score", len(scene.products))
    for number, product in enumerate(scene.products):
        track = scene.cameras[product.camera]
        if not track.path:  # the default camera of a stage without any
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
                "sampling": [length if math.isfinite(length) else None for length in found.sampling],
                "by_class": {name: float(np.mean(values)) for name, values in sorted(shares.items())},
                "warnings": _warnings(found.linked, found.clearance),
                "poses": np.round(track.poses[:, :3].reshape(-1, 12), 4).tolist(),
                "half": [0.5 * camera.width / camera.fx, 0.5 * camera.height / camera.fy],
                "outline": outline,
            }
        )
        progress.advance(number + 1)
    if answers:
        answers[-1].update(_unseen(answers, subject, classes, request["propose"]))
    return answers


def _unseen(answers: list[dict[str, Any]], subject: Any, classes: dict[int, str], propose: bool) -> dict[str, Any]:
    """List the members that too few images of all flights show, by class, and legs that would show them."""
    from authoring.streams import stream
    from authoring.surveys.unseen import hardly_seen, propose_legs

    few = hardly_seen([row["member_views"] for row in answers])
    known = sorted({number for row in answers for number in row["member_views"]})
    totals = Counter(classes.get(number, "") for number in known)
    by_class: dict[str, list[int]] = defaultdict(list)
    for number in few:
        by_class[classes.get(number, "")].append(number)
    found: dict[str, Any] = {
        "hardly_seen": {
            name: {"members": ids, "of": totals[name], "never": [number for number in ids if few[number] == 0]}
            for name, ids in sorted(by_class.items())
        }
    }
    if few and propose:
        found["proposal"] = asdict(propose_legs(subject, few, stream(0, "survey/inspection")))
    return found


def plan(request: dict[str, Any], progress: Progress) -> list[dict[str, Any]]:
    """Plan a further survey of a scene and add it.

    Args:
        request: `{scene, plan, members, seed}`: settings of the survey; ids, classes or `unseen` for an inspection; a
            seed, or None for that of the scene.
        progress: Listener.
    """
    from authoring.scenes.add_survey import add_survey
    from authoring.surveys.registry import SURVEYS
    from authoring.surveys.settings import StageSettings
    from groundwork.settings import parse_settings

    progress.stage("plan", 1)
    kinds = {**{name: kind.settings for name, kind in SURVEYS.items()}, "stage": StageSettings}
    wanted = dict(request["plan"])
    if request["members"]:
        name = wanted.get("id", wanted["kind"])
        wanted = {"cover": "members", **wanted, "members": _members(Path(request["scene"]), request["members"], name)}
    settings = parse_settings(kinds[wanted["kind"]], wanted, "survey")
    path = add_survey(Path(request["scene"]), settings, request["seed"])
    progress.advance(1)
    steps = np.linalg.norm(np.diff(path.poses[:, :3, 3], axis=0), axis=1)
    if len(path.poses) > MANY:
        progress.note(f"{len(path.poses)} images: check them with `falsework survey score` before you render them")
    return [{"survey": path.id, "images": len(path.poses), "length": float(steps.sum())}]


def _members(scene: Path, words: list[str], own: str) -> list[int]:
    """Find the instances for ids, classes, or `unseen`: those that no flight but the replaced one shows."""
    from authoring.scenes.add_survey import ALONE
    from authoring.surveys.framing import eye_of
    from authoring.surveys.score import member_views
    from authoring.surveys.stage_subject import stage_subject
    from authoring.surveys.unseen import hardly_seen
    from usd_schemas.pinhole import pinhole_from_lens
    from usd_schemas.reading.stage_reader import read_stage

    flat = read_stage(scene, choices=ALONE)
    subject = stage_subject(flat)
    bridge = set(np.unique(subject.bridge_ids).tolist())
    classes = {row.id: row.class_name for row in flat.instances if row.id in bridge}
    found: set[int] = set()
    for word in words:
        if word == "unseen":
            flown = [product for product in flat.products if product.name != own and flat.cameras[product.camera].path]
            views = [dict.fromkeys(sorted(bridge), 0)]
            for product in flown:
                track = flat.cameras[product.camera]
                camera = track.calibration or pinhole_from_lens(track.lens, product.width, product.height)
                corners = subject.bridge, subject.bridge_ids.astype(np.int64)
                views.append(member_views(track.poses, eye_of(camera, track.distortion), corners, subject.obstacles))
            found |= set(hardly_seen(views))
            continue
        meant = {number for number, name in classes.items() if word in (str(number), name)}
        if not meant:
            raise InputError(
                "no member of the bridge has this id or class",
                field="--for",
                value=word,
                allowed=f"unseen, {', '.join(sorted(set(classes.values())))}, or an id",
                hint="falsework scene info SCENE --members lists the ids",
            )
        found |= meant
    if not found:
        raise InputError(
            "every one of these members is already shown often enough",
            field="--for",
            value=" ".join(words),
            where=scene,
        )
    return sorted(found)


def _warnings(linked: float, clearance: float) -> list[str]:
    lines = []
    if linked < LINKED_ENOUGH:
        lines.append(
            f"about {100.0 * (1.0 - linked):.0f} % of the images will probably not be registered: plan more images"
        )
    if clearance < 0.3:
        lines.append(f"a camera comes within {clearance:.2f} m of a surface")
    return lines


def _outline(corners: Any, ids: Any, classes: dict[int, str]) -> dict[str, Any]:
    """Sample points on the bridge for a figure, each with its member, and the class of each member."""
    from authoring.surveys.surface_samples import sample_surfaces

    samples = sample_surfaces(corners, ids)
    every = max(1, len(samples.points) // OUTLINE)
    members = samples.ids[samples.component[::every]]
    return {
        "points": np.round(samples.points[::every], 2).tolist(),
        "ids": members.tolist(),
        "classes": {str(number): classes[number] for number in samples.ids.tolist() if classes.get(number)},
    }


def _answer(request: dict[str, Any], progress: Progress) -> list[dict[str, Any]]:
    from usd_schemas.guard.guard import check_stage, limit_memory

    limit_memory(ADDRESS_LIMIT)
    check_stage(Path(request["scene"]), tuple(Path(root) for root in request["allow_roots"]), progress.note)
    if "plan" in request:
        return plan(request, progress)
    return score(request, progress)


if __name__ == "__main__":
    answer_parent(_answer)
