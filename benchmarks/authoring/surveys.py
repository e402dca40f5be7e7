"""Time the planning and the judging of flights on one core, and write `docs/benchmarks/surveys.md`.

Usage: python -m benchmarks.authoring.surveys
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import build_bridge
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from authoring.surveys.camera_models import calibration, camera_models
from authoring.surveys.framing import eye_of
from authoring.surveys.path import CameraPath
from authoring.surveys.registry import plan_survey
from authoring.surveys.score import score_flight
from authoring.surveys.settings import GlobalSettings, GridSettings, LocalSettings
from authoring.surveys.subject import Subject, make_subject
from benchmarks.authoring.inspection import inspection_rows
from benchmarks.page import write_page
from benchmarks.speed_unit import slower, this_machine
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "surveys.md"
LONG = {"family": "girder", "service": "road", "girder": {"spans": [60.0] * 5}}  # 300 m
SHORT = {"family": "beam", "service": "road", "beam": {"spans": [18.0, 22.0]}}
TRIANGLES, IMAGES = 1_000_000, 400
SEED = 7
EXPLANATION = (
    "Random bridges with the default `inspection`. A view is an image with 50 pixels of a member, counted by a ray for",
    "every fourth pixel in both directions. *Missed* are members that a free place would show and fewer than three",
    "images do; *hidden* are those that no free place within 10 m of them shows. `make proof` does it for 30 bridges.",
)
INSPECTED = 6  # bridges, one a family


def main() -> None:
    """Measure, and write the page."""
    short, long = _subject(SHORT), _subject(LONG)
    local = LocalSettings(kind="local", length=20.0, images=(70, 80))
    whole = GlobalSettings(images=378)
    rings = GlobalSettings(tour="rings", images=378)
    rows = [
        _timed("local, box of 20 m", 5.0, lambda: plan_survey(local, short, SEED)),
        _timed("global, loop, bridge of 300 m", 10.0, lambda: plan_survey(whole, long, SEED)),
        _timed("global, rings, bridge of 300 m", 10.0, lambda: plan_survey(rings, long, SEED)),
        _timed("grid, bridge of 300 m", 10.0, lambda: plan_survey(GridSettings(kind="grid"), long, SEED)),
        _score(long),
    ]
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    write_page(PAGE, _page(rows, inspection_rows(INSPECTED)), __file__)


def _subject(bridge: dict[str, object]) -> Subject:
    layout, record = draw_layout(BridgeSettings.model_validate(bridge), stream(SEED, "bridge"))
    site = draw_site(SiteSettings(), layout, stream(SEED, "site"))
    return make_subject(build_bridge(layout, record, site.ground), site.pieces)


def _timed(name: str, limit: float, fly: Callable[[], CameraPath]) -> tuple[str, int, float, float]:
    begin = time.process_time()
    path = fly()
    return name, len(path.poses), time.process_time() - begin, limit


def _score(subject: Subject) -> tuple[str, int, float, float]:
    corners, ids = subject.bridge, subject.bridge_ids.astype(np.int64)
    while len(corners) < TRIANGLES:
        corners, ids = _split(corners, ids)
    corners, ids = corners[:TRIANGLES], ids[:TRIANGLES]
    poses = plan_survey(GlobalSettings(images=IMAGES, spacing=50.0), subject, SEED).poses[:IMAGES]
    eye = eye_of(calibration(camera_models()["default_24mm"]))
    begin = time.process_time()
    scene = RayScene(corners, ids.astype(np.uint32))
    score_flight(poses, eye, 0.0, (corners, ids), scene)
    spent = time.process_time() - begin
    return f"score, {len(corners):,} triangles of {len(np.unique(ids))} components", len(poses), spent, 10.0


def _split(corners: F64, ids: I64) -> tuple[F64, I64]:
    """Split every triangle into four; the surface stays."""
    a, b, c = np.moveaxis(corners, 1, 0)
    d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [np.stack(part, axis=1) for part in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))]
    return np.concatenate(parts), np.tile(ids, 4)


def _page(rows: list[tuple[str, int, float, float]], inspected: list[str]) -> str:
    speed = slower("numpy")
    lines = [
        "# Planning and judging flights",
        "",
        f"Written by `python -m benchmarks.authoring.surveys`. Processor time, all threads together, {this_machine()}.",
        "",
        "| what | images | seconds | limit [s] |",
        "|---|---|---|---|",
        *(f"| {name} | {images} | {spent:.2f} | {limit * speed:.2g} |" for name, images, spent, limit in rows),
        "",
        "## What an inspection shows",
        "",
        *EXPLANATION,
        "",
        *inspected,
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
