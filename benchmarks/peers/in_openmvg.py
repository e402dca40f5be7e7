"""Reconstruct a folder of photographs with openmvg-rs, and write what it found as JSON; runs in a Python that has it.

Usage: python in_openmvg.py IMAGES OUT.json
"""

import json
import sys
import tempfile
import time
from pathlib import Path

import openmvg_rs  # pyright: ignore[reportMissingImports]


def main(images: Path, out: Path) -> None:
    """Reconstruct with SIFT keypoints and everything else as it comes.

    Args:
        images: Folder of photographs.
        out: JSON file to write: `seconds` of processor time, `points`, `views` with name, rotation and center, and of
            each point the number of its views (`track_lengths`) and its mean reprojection error (`errors`) [px].
    """
    scene = openmvg_rs.reconstruct(images, extraction_method="sift", progress=False)
    views = [
        {"name": Path(view.image).name, "rotation": view.pose.rotation.tolist(), "center": view.pose.center.tolist()}
        for view in scene.views
    ]
    found = {"seconds": time.process_time(), "points": len(scene.points), "views": views}
    with tempfile.TemporaryDirectory() as folder:
        scene.write_colmap(folder)
        errors, lengths = tracks_of(Path(folder) / "sparse" / "0" / "points3D.txt")
    out.write_text(json.dumps({**found, "errors": errors, "track_lengths": lengths}), encoding="utf-8")


def tracks_of(file: Path) -> tuple[list[float], list[int]]:
    """Read of a COLMAP text model how far each point misses its keypoints [px], and how many of them it has.

    Args:
        file: Its `points3D.txt`: number, place, color and error, then image and keypoint of each view.
    """
    rows = [line.split() for line in file.read_text(encoding="utf-8").splitlines() if line and line[0] != "#"]
    return [float(row[7]) for row in rows], [(len(row) - 8) // 2 for row in rows]


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
