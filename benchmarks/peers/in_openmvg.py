"""Reconstruct a folder of photographs with openmvg-rs, and write what it found as JSON; runs in a Python that has it.

Usage: python in_openmvg.py IMAGES OUT.json
"""

import json
import sys
import time
from pathlib import Path

import openmvg_rs  # pyright: ignore[reportMissingImports]


def main(images: Path, out: Path) -> None:
    """Reconstruct with SIFT keypoints and everything else as it comes.

    Args:
        images: Folder of photographs.
        out: JSON file to write: `seconds` of processor time, `points`, and `views` with name, rotation and centre.
    """
    scene = openmvg_rs.reconstruct(images, extraction_method="sift", progress=False)
    views = [
        {"name": Path(view.image).name, "rotation": view.pose.rotation.tolist(), "center": view.pose.center.tolist()}
        for view in scene.views
    ]
    found = {"seconds": time.process_time(), "points": len(scene.points), "views": views}
    out.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
