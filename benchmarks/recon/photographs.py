"""What became of folders of real photographs, and how far a frame made of GPS is from one of surveyed points.

Usage: python -m benchmarks.recon.photographs [NAME=CLOUD …] [--defaults NAME=PHOTOGRAPHS …]
           [--openmvg PYTHON --peer NAME=PHOTOGRAPHS …] [--control NAME=GPS_CLOUD NAME=CONTROL_CLOUD]

Each CLOUD is a cloud folder that `falsework reconstruct` made of photographs; `docs/benchmarks/photographs.md` shows
what it says of itself, and beside it what pycolmap makes of the folders behind `--defaults`, with its default
settings, and openmvg-rs of those behind `--peer`; PYTHON is an interpreter that has it (`pip install openmvg-rs`). The
photographs are other people's: they are named, not kept here. The two clouds behind `--control` come from one model
(`reconstruct --model`): the first stands on GPS, the second on control points.
"""

import argparse
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.page import write_page
from benchmarks.recon.colmap_defaults import TIME_LIMIT, run_defaults
from benchmarks.recon.gps_flights import frame_errors
from benchmarks.recon.noise import named_cloud
from groundwork.errors import ChildError, InputError
from groundwork.files import read_json
from recon.cloud import Cloud, read_cloud
from recon.photos.photos import local_position, open_photographs
from recon.placing.place_errors import PlaceErrors
from recon.placing.similarity import Similarity
from recon.sfm.colmap_model import read_model

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "photographs.md"
HEADS = [
    "photographs",
    "cloud",
    "in the model",
    "points",
    "of the model's",
    "duplicates merged",
    "of three views and more",
    "views of a point",
    "reprojection [px]",
    "aligned to",
    "from GPS or control points [m]",
    "stated limits: scale, tilt, heading, place",
]


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", nargs="*", type=named_cloud, metavar="NAME=CLOUD")
    parser.add_argument("--defaults", nargs="*", type=named_cloud, default=[], metavar="NAME=PHOTOGRAPHS")
    parser.add_argument("--openmvg", type=Path, metavar="PYTHON")
    parser.add_argument("--peer", nargs="*", type=named_cloud, default=[], metavar="NAME=PHOTOGRAPHS")
    parser.add_argument("--control", nargs=2, type=named_cloud, metavar="NAME=CLOUD")
    told = parser.parse_args()
    rows = [(name, figures_of(folder)) for name, folder in told.clouds]
    rows += [(name, figures_of_defaults(folder)) for name, folder in told.defaults]
    if told.peer and not told.openmvg:
        parser.error("--peer needs --openmvg PYTHON")
    rows += [(name, figures_of_openmvg(told.openmvg, folder)) for name, folder in told.peer]
    page = photographs_page(rows)
    if told.control:
        (name, on_gps), (_, on_points) = told.control
        page += control_section(name, read_cloud(on_gps), read_cloud(on_points))
    write_page(PAGE, page, __file__)


def figures_of(folder: Path) -> dict[str, Any]:
    """Read a cloud's data about its photographs.

    Args:
        folder: Cloud folder.

    Returns:
        The cloud's `statistics`, with `mode` (`sparse` or `dense`), the share of points of three views and more as
        `thrice`, the points that were merged into equal ones as `duplicates`, and `target`, `method`,
        `expected_error` and `control_points` of its alignment.

    Raises:
        InputError: The folder is no cloud.
    """
    cloud = read_cloud(folder)
    alignment = {key: cloud.alignment.get(key) for key in ("target", "method", "expected_error", "control_points")}
    thrice = float(np.mean(cloud.columns["n_views"] >= 3)) if len(cloud) else 0.0
    merged = sum(row["dropped"]["duplicate"] for row in cloud.statistics.get("classes", {}).values())
    mode = cloud.source.removeprefix("sfm-")
    return {**cloud.statistics, **alignment, "mode": mode, "thrice": thrice, "duplicates": merged}


def figures_of_defaults(folder: Path) -> dict[str, Any]:
    """Let pycolmap make a model of photographs with every setting as it comes.

    Args:
        folder: Photographs.

    Returns:
        As `figures_of`, of the largest model; its points are those of the model.
    """
    capture = open_photographs(folder)
    with tempfile.TemporaryDirectory() as work:
        run_defaults(capture, Path(work))
        model = read_model(Path(work) / "defaults" / "model")
    views = np.bincount(model.obs_point, minlength=len(model.points))
    return {
        "mode": "pycolmap's defaults",
        "target": "none",
        "method": "none",
        "images": len(capture.images),
        "registered": len(model.names),
        "points": len(model.points),
        "model_points": len(model.points),
        "observations": len(model.obs_point),
        "thrice": float(np.mean(views >= 3)),
        "mean_reprojection_error": float(model.errors.mean()),
        "expected_error": None,
    }


def figures_of_openmvg(python: Path, folder: Path) -> dict[str, Any]:
    """Let openmvg-rs make a model of photographs from SIFT keypoints, with everything else as it comes.

    Args:
        python: Interpreter that has it.
        folder: Photographs; it takes the folder itself, or `images` in it.

    Returns:
        As `figures_of`, of its model.

    Raises:
        ChildError: It failed; the last line that it said.
    """
    script = Path(__file__).resolve().parents[1] / "peers" / "in_openmvg.py"
    with tempfile.TemporaryDirectory() as work:
        answer = Path(work) / "openmvg.json"
        command = [str(python), str(script), str(folder), str(answer)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT, check=False)
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if line.strip()]
            raise ChildError(f"openmvg-rs: {lines[-1] if lines else f'exit code {done.returncode}'}")
        found = read_json(answer)
    lengths = np.array(found["track_lengths"], np.int64)
    return {
        "mode": "openmvg-rs, SIFT",
        "target": "none",
        "method": "none",
        "images": len(open_photographs(folder).images),
        "registered": len(found["views"]),
        "points": found["points"],
        "model_points": found["points"],
        "observations": int(lengths.sum()),
        "thrice": float(np.mean(lengths >= 3)),
        "mean_reprojection_error": float(np.mean(found["errors"])),
        "expected_error": None,
    }


def control_errors(on_gps: Cloud, on_points: Cloud) -> PlaceErrors:
    """Measure how far a frame made of GPS is from that of control points, both of the same model.

    Args:
        on_gps: Cloud that stands on GPS.
        on_points: Cloud that stands on control points, without heights: place is taken along the ground alone.

    Raises:
        InputError: The clouds come from two models.
    """
    models = [cloud.statistics["sparse"]["model_sha256"] for cloud in (on_gps, on_points)]
    if models[0] != models[1]:
        raise InputError("the two clouds come from two models", hint="Make one with `reconstruct --model` of the other")
    found, known = (_similarity(cloud) for cloud in (on_gps, on_points))
    middle = on_gps.columns["coord"].astype(np.float64).mean(axis=0)
    known = replace(known, translation=known.translation + local_position(_origin(on_points), _origin(on_gps)))
    back = (middle - found.translation) @ found.rotation / found.scale
    lifted = np.array([0.0, 0.0, middle[2] - known.move(back[None])[0, 2]])
    return frame_errors(found, replace(known, translation=known.translation + lifted), middle)


def photographs_page(clouds: list[tuple[str, dict[str, Any]]]) -> str:
    """Write the table.

    Args:
        clouds: Name and figures of each cloud.
    """
    rows = [[name, *_cells(figures)] for name, figures in clouds]
    return "\n".join(
        [
            "# Real photographs",
            "",
            "Written by `python -m benchmarks.recon.photographs`. Each folder, or part, as its authors made it;",
            'no settings but `mode = "dense"`, the quality and the control points that are named.',
            "*pycolmap's defaults* and *openmvg-rs* are other programs with their default settings; their points are",
            "unfiltered and not georeferenced.",
            "*Of the model's*: share of the model's points that the sparse cloud keeps (`recon.max_deviation`).",
            "*Duplicates merged*: points that were equal to another one, which stays.",
            "*From GPS or control points*: median distance of the cameras from their EXIF's positions, or what is left",
            "at control points (rms).",
            "*Stated limits*: what the cloud says of its own frame, 95 in 100. None of these folders has both GPS and",
            "control points: whether the limits of a frame made of GPS hold could not be measured on photographs.",
            "",
            f"| {' | '.join(HEADS)} |",
            "|" + "---|" * len(HEADS),
            *(f"| {' | '.join(row)} |" for row in rows),
            "",
        ]
    )


def _cells(figures: dict[str, Any]) -> list[str]:
    sparse, gps = figures["mode"] != "dense", figures["target"] == "gps"
    left = f"{figures['center_error_median']:.2f}" if gps else ""
    if figures.get("control_points"):
        left = f"{_left_at(figures['control_points']):.2f}"
    return [
        figures["mode"],
        f"{figures['registered']} of {figures['images']}",
        f"{figures['points']:,}",
        f"{figures['points'] / max(figures['model_points'], 1):.0%}" if sparse else "",
        f"{figures['duplicates']:,}" if figures["mode"] == "sparse" else "",
        f"{figures['thrice']:.0%}",
        f"{figures['observations'] / max(figures['points'], 1):.1f}",
        f"{figures['mean_reprojection_error']:.2f}" if sparse else "",
        {"gps": f"GPS, {figures['method']}", "none": "nothing"}.get(figures["target"], str(figures["target"])),
        left,
        _limits(figures["expected_error"]),
    ]


def control_section(name: str, on_gps: Cloud, on_points: Cloud) -> str:
    """Write the stated accuracy of the GPS frame beside the errors at control points.

    Args:
        name: Name of the photographs.
        on_gps: Cloud that stands on GPS.
        on_points: Cloud that stands on control points.
    """
    points = on_points.alignment["control_points"]
    agreeing = sum(row["agrees"] for row in points)
    found, stated = control_errors(on_gps, on_points), on_gps.alignment.get("expected_error")
    lines = [
        "",
        "## Stated limits against control points",
        f"{name}: {agreeing} of {len(points)} control points agree, {_left_at(points):.3f} m rms after the fit.",
        "Place is along the ground alone: the points were surveyed without heights.",
        "",
        "| frame made of GPS | scale, tilt, heading, place |",
        "|---|---|",
        f"| stated limits | {_limits(stated)} |",
        f"| off from the control points' frame | {_limits(found.facts())} |",
        "",
    ]
    return "\n".join(lines)


def _left_at(points: list[dict[str, Any]]) -> float:
    """Root mean square of what is left at the control points that agree [m]."""
    return float(np.sqrt(np.mean([row["distance"] ** 2 for row in points if row["agrees"]])))


def _limits(error: dict[str, Any] | None) -> str:
    if error is None:
        return ""
    scale, tilt, heading, place = (error[key] for key in ("scale_percent", "tilt_deg", "heading_deg", "place_m"))
    return f"{scale:.1f} %, {tilt:.1f}°, {heading:.1f}°, {place:.1f} m"


def _similarity(cloud: Cloud) -> Similarity:
    told = cloud.alignment
    return Similarity(told["scale"], np.array(told["rotation"]), np.array(told["translation"]))


def _origin(cloud: Cloud) -> tuple[float, float, float]:
    told = cloud.alignment["origin"]
    return told["latitude"], told["longitude"], told["height"]


if __name__ == "__main__":
    main()
