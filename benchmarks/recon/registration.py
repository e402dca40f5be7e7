"""Fly good and deliberately bad surveys, reconstruct them, and set the predicted against the registered share.

Writes `docs/benchmarks/registration.md`. Usage: python -m benchmarks.recon.registration [FOLDER]; what FOLDER holds
already is not made again.
"""

import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from authoring.surveys.framing import eye_of
from authoring.surveys.score import score_flight
from authoring.surveys.stage_subject import stage_subject
from benchmarks.page import write_page
from benchmarks.speed_unit import this_machine
from falsework.stages import STAGES
from groundwork.errors import RejectedSceneError
from groundwork.files import write_text
from groundwork.progress import SILENT
from recon.placing.align import OK, Target, align
from recon.settings import ReconSettings
from recon.sfm.sparse import run_sparse
from render.capture import read_capture, read_truth
from usd_schemas.pinhole import pinhole_from_lens
from usd_schemas.reading.stage_reader import read_stage

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "registration.md"
SIZE: dict[str, Any] = {"width": 640, "height": 480}
SITE: dict[str, Any] = {"half_width": 40, "run_out": 40}
CENTER_LIMIT = 0.5  # [m] beyond which a registered camera counts as lost
BRIDGES: dict[str, dict[str, Any]] = {
    "beam": {"family": "beam", "beam": {"spans": [14.0]}},
    "girder": {"family": "girder", "girder": {"spans": [18.0]}},
    "slab": {"family": "slab", "slab": {"spans": [7.0, 9.0]}},
}


@dataclass(frozen=True)
class Trial:
    """One way to fly.

    Attributes:
        name: Survey id.
        bad: Whether it is meant to fail.
        settings: Settings of the survey.
    """

    name: str
    bad: bool
    settings: dict[str, Any]


TRIALS = (
    Trial("loop", False, {"kind": "global", "images": 30, "spacing": 4.5}),
    Trial("close", False, {"kind": "local", "length": 10.0, "spacing": 0.8, "images": [20, 36]}),
    Trial("rows", False, {"kind": "grid", "sampling": 0.02, "overlap": 0.7, "side_overlap": 0.4, "deck": False}),
    Trial("loop_gaps", True, {"kind": "global", "images": 16, "spacing": 50.0}),
    Trial("loop_thin", True, {"kind": "global", "images": 10, "spacing": 50.0}),
    Trial("close_thin", True, {"kind": "local", "length": 14.0, "spacing": 2.2, "images": [8, 24]}),
    Trial("close_touch", True, {"kind": "local", "near": 0.8, "safety": 0.5, "spacing": 1.4, "images": [12, 24]}),
    Trial("rows_gaps", True, {"kind": "grid", "sampling": 0.012, "overlap": 0.35, "side_overlap": 0.3, "deck": False}),
)


def main(folder: Path) -> None:
    """Measure every trial on every bridge, and write the page.

    Args:
        folder: Where stages, captures and answers go.
    """
    rows = measure(folder)
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    write_page(PAGE, _page(rows), __file__)


def measure(folder: Path) -> list[dict[str, Any]]:
    """Measure every trial on every bridge.

    Args:
        folder: Where stages, captures and answers go.

    Returns:
        A row for each flight: bridge, flight, whether it is meant to fail, images, overlap, and the predicted, the
        registered and the rightly registered share.
    """
    rows = []
    for number, (bridge, settings) in enumerate(BRIDGES.items()):
        stage = folder / bridge
        if not (stage / "scene.usda").exists():
            stage.mkdir(parents=True)
            author_scene(_authoring(settings), 21 + number, stage, SILENT)
        for trial in TRIALS:
            row = {"bridge": bridge, "flight": trial.name, "bad": trial.bad}
            row |= predict(stage / "scene.usda", trial.name)
            row |= _measured(stage / "scene.usda", trial.name, folder / f"{bridge}_{trial.name}")
            sys.stderr.write(json.dumps(row) + "\n")
            rows.append(row)
    return rows


def rank_correlation(rows: list[dict[str, Any]], measured: str) -> float:
    """Compare the order of the predicted shares with that of the measured ones (Spearman).

    Args:
        rows: What `measure` found.
        measured: `registered` or `right`.
    """
    predicted, found = ([row[key] for row in rows] for key in ("predicted", measured))
    return float(np.asarray(spearmanr(predicted, found))[0])


def _authoring(bridge: dict[str, Any]) -> AuthoringSettings:
    surveys = [{"id": trial.name, **SIZE, **trial.settings} for trial in TRIALS]
    return AuthoringSettings.model_validate(
        {
            "bridge": {"service": "road", "alignment": {"kind": "straight"}, **bridge},
            "site": SITE,
            "background": {"name": "none"},
            "look": {"texels": 1024},
            "survey": surveys,
        }
    )


def predict(scene: Path, survey: str) -> dict[str, Any]:
    """Judge one flight without rendering it.

    Args:
        scene: Root layer.
        survey: Survey id.

    Returns:
        Number of images, mean overlap, predicted share of registered images.
    """
    flat = read_stage(scene, survey=survey)
    product = flat.products[0]
    track = flat.cameras[product.camera]
    subject = stage_subject(flat)
    camera = track.calibration or pinhole_from_lens(track.lens, product.width, product.height)
    bridge = subject.bridge, subject.bridge_ids.astype(np.int64)
    found = score_flight(track.poses, eye_of(camera, track.distortion), 0.0, bridge, subject.obstacles)
    return {"images": found.images, "overlap": found.overlap, "predicted": found.linked}


def _measured(scene: Path, survey: str, folder: Path) -> dict[str, Any]:
    answer = folder / "answer.json"
    if answer.exists():
        return json.loads(answer.read_text())
    capture, work = folder / "capture", folder / "work"
    if not (capture / "cameras.json").exists():
        capture.mkdir(parents=True, exist_ok=True)
        request = {"seed": 1, "survey": survey, "render": {"quality": "fast"}}
        STAGES["capture"].run(request, {"stage": scene}, capture, SILENT)
    work.mkdir(exist_ok=True)
    begin = time.perf_counter()
    measured = registered(capture, work)
    measured["seconds"] = time.perf_counter() - begin
    write_text(answer, json.dumps(measured))
    return measured


def registered(capture: Path, work: Path) -> dict[str, Any]:
    """Reconstruct a capture, and count the cameras that end up where they were.

    Args:
        capture: Capture folder with truth.
        work: Empty folder for what lies in between.

    Returns:
        Shares of the images that were registered, and that were registered within the limit.
    """
    photographs = read_capture(capture)
    truth, settings = read_truth(photographs), ReconSettings()
    if truth is None:
        raise ValueError("a capture without truth")
    count = len(photographs.images)
    try:
        model = run_sparse(photographs, work, settings, SILENT).model
        row_of = {image.file: row for row, image in enumerate(photographs.images)}
        rows = np.array([row_of[name] for name in model.names], np.int64)
        target = Target("truth", truth.poses[:, :3, 3], truth.poses[:, :3, :3], CENTER_LIMIT)
        found = align(model.poses, rows, target, settings.alignment, np.random.default_rng(0))
    except RejectedSceneError as error:
        return {"registered": 0.0, "right": 0.0, "why": error.reason}
    right = sum(status == OK for status in found.status)
    return {"registered": len(rows) / count, "right": right / count, "why": ""}


def _page(rows: list[dict[str, Any]]) -> str:
    right = np.array([row["right"] for row in rows])
    good = np.array([not row["bad"] for row in rows])
    lines = [
        "# Predicted and registered share of flights",
        "",
        f"Written by `python -m benchmarks.recon.registration`. {len(rows)} flights of "
        f"{SIZE['width']} x {SIZE['height']} px, "
        f"{int((~good).sum())} of them deliberately bad; sparse reconstruction with the default settings; "
        f"{len(os.sched_getaffinity(0))} cores of {this_machine()}.",
        "",
        f"Rank correlation (Spearman) of the predicted share with the registered one "
        f"**{rank_correlation(rows, 'registered'):.2f}**, with the right one "
        f"**{rank_correlation(rows, 'right'):.2f}**; the prediction's parameters were fitted to these flights. "
        f"Mean right share of the good flights {right[good].mean():.0%}, of the bad ones {right[~good].mean():.0%}.",
        "",
        f"*Right* is registered within {CENTER_LIMIT} m and the rotation limit of the aligned reconstruction.",
        "",
        "| bridge | flight | meant | images | overlap | predicted | registered | right |",
        "|---|---|---|---|---|---|---|---|",
        *(
            f"| {row['bridge']} | {row['flight']} | {'bad' if row['bad'] else 'good'} | {row['images']} "
            f"| {row['overlap']:.0%} | {row['predicted']:.0%} | {row['registered']:.0%} | {row['right']:.0%} |"
            for row in rows
        ),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as scratch:
            main(Path(scratch))
