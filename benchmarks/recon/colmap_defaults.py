"""Reconstruct photographs with the default settings of `pycolmap`: `python -m benchmarks.recon.colmap_defaults`."""

import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.child import answer_parent, run_child
from groundwork.progress import Progress
from recon.sfm.colmap_model import SparseModel, read_model
from render.capture import Capture

TIME_LIMIT = 6 * 3600.0  # [s]
MEMORY_LIMIT = 16.0  # [GB]
STEPS = ("features", "matching", "mapping")


@dataclass(frozen=True)
class Found:
    """What one way made of photographs.

    Attributes:
        names: File of each registered image.
        poses: Their camera_to_world in model units, shape (I, 4, 4), float64.
        points: Number of points.
        pairs: Image pairs tried, or why there is no model.
        seconds: Processor time of each step [s]; of steps that were taken over, nothing.
        thrice: Share of the points that three or more images saw [1]; None where not counted.
    """

    names: tuple[str, ...]
    poses: NDArray[np.float64]
    points: int
    pairs: str
    seconds: Mapping[str, float]
    thrice: float | None = None


def found_in(model: SparseModel, pairs: int, seconds: Mapping[str, float]) -> Found:
    """Sum up a model.

    Args:
        model: The largest one.
        pairs: Image pairs tried.
        seconds: Processor time of each step [s].
    """
    views = np.bincount(model.obs_point, minlength=len(model.points))
    thrice = float(np.mean(views >= 3)) if len(views) else None
    return Found(model.names, model.poses, len(model.points), str(pairs), seconds, thrice)


def run_defaults(capture: Capture, work: Path) -> Found:
    """Extract, match every pair, and map, with every setting as it comes.

    Args:
        capture: Photographs.
        work: Folder; `defaults` is made anew in it.
    """
    folder = work / "defaults"
    shutil.rmtree(folder, ignore_errors=True)  # what an interrupted run left
    folder.mkdir()
    request = {"images": str(capture.folder), "work": str(folder), "names": [image.file for image in capture.images]}
    found = run_child("benchmarks.recon.colmap_defaults", request, time_limit=TIME_LIMIT, memory_limit=MEMORY_LIMIT)
    if not found["found"]:
        return Found((), np.zeros((0, 4, 4)), 0, "no model", found["seconds"])
    return found_in(read_model(folder / "model"), found["pairs"], found["seconds"])


def serve(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    """Run COLMAP in this process.

    Args:
        request: `images` folder, `work` folder, `names` of the files.
        progress: Listener; nothing is told.
    """
    import pycolmap

    pycolmap.logging.minloglevel = 3
    work = Path(request["work"])
    database, images = work / "database.db", Path(request["images"])
    marks = [time.process_time()]
    pycolmap.extract_features(database, images, request["names"], pycolmap.CameraMode.SINGLE)
    marks.append(time.process_time())
    pycolmap.match_exhaustive(database)
    marks.append(time.process_time())
    (work / "models").mkdir()
    found = pycolmap.incremental_mapping(database, images, work / "models")
    marks.append(time.process_time())
    seconds = dict(zip(STEPS, (end - begin for begin, end in pairwise(marks)), strict=True))
    (work / "model").mkdir()
    if found:
        max(found.values(), key=lambda model: model.num_reg_images()).write_binary(work / "model")
    count = len(request["names"])
    return {"found": bool(found), "pairs": count * (count - 1) // 2, "seconds": seconds}


if __name__ == "__main__":
    answer_parent(serve)
