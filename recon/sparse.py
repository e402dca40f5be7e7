"""Structure from motion as seen from outside: three child processes, their progress, and the verdict on each."""

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from groundwork.canonical import folder_digest
from groundwork.child import run_child
from groundwork.errors import RejectedSceneError
from groundwork.progress import Progress
from recon.colmap_model import SparseModel, read_model
from recon.settings import ReconSettings
from render.capture import Capture

_CHILD = "recon.sparse_child"
_DATABASE, _MODEL = "database.db", "model"  # as the child names them; importing it would load COLMAP here
_SLACK = 120.0  # [s] beside the time per image
_LOOK = 0.5  # [s] how often the database is asked how far it is
_FEW_KEYPOINTS = 50
_MIN_IMAGES = 3


def run_sparse(
    capture: Capture, work: Path, settings: ReconSettings, progress: Progress
) -> tuple[SparseModel, dict[str, Any]]:
    """Reconstruct camera poses and sparse points; never looks at the truth.

    Args:
        capture: Photographs.
        work: Existing empty folder for the database and the model.
        settings: What to do.
        progress: Listener.

    Returns:
        The largest model, in its own units, and JSON figures of the stages.

    Raises:
        InputError: An image is damaged.
        RejectedSceneError: `too_few_images`, `no_texture`, `no_overlap` or `no_model`.
    """
    count = len(capture.images)
    if count < _MIN_IMAGES:
        raise RejectedSceneError("too_few_images", f"{count} images: a reconstruction needs {_MIN_IMAGES} at least")
    with _row_count(work / _DATABASE, "keypoints", progress):
        keypoints = _run("extract", capture, work, settings, progress)
    progress.advance(count)
    if sum(number >= _FEW_KEYPOINTS for number in keypoints) < _MIN_IMAGES:
        raise RejectedSceneError("no_texture", f"fewer than {_MIN_IMAGES} images show {_FEW_KEYPOINTS} keypoints")
    with _row_count(work / _DATABASE, "two_view_geometries", progress):
        matching = _run("match", capture, work, settings, progress)
    progress.advance(matching["pairs"])
    if matching["verified"] == 0:
        raise RejectedSceneError("no_overlap", f"none of {matching['pairs']} image pairs shows the same thing")
    models = _run("map", capture, work, settings, progress)
    if not models:
        raise RejectedSceneError("no_model", "the mapper found no pair of images to start from")
    facts = {"keypoints": sum(keypoints), **matching, "models": models, "model_sha256": folder_digest(work / _MODEL)}
    return read_model(work / _MODEL), facts


def write_world_model(
    work: Path, out: Path, similarity: dict[str, Any], settings: ReconSettings, progress: Progress
) -> None:
    """Write the COLMAP model in world metres.

    Args:
        work: Folder that `run_sparse` filled.
        out: Folder to create.
        similarity: `scale`, `rotation` 3x3 row-major, `translation` [m].
        settings: For the limits.
        progress: Listener.
    """
    request = {"stage": "transform", "work": str(work), "out": str(out), "seed": 0, "similarity": similarity}
    run_child(_CHILD, request, time_limit=_SLACK, memory_limit=settings.sparse.memory_limit, progress=progress)


def _run(stage: str, capture: Capture, work: Path, settings: ReconSettings, progress: Progress) -> Any:
    sparse = settings.sparse
    threads = "1" if stage == "map" and sparse.deterministic else str(sparse.threads)
    return run_child(
        _CHILD,
        {"stage": stage, "capture": str(capture.folder), "work": str(work), "settings": sparse, "seed": settings.seed},
        time_limit=_SLACK + sparse.seconds_per_image * len(capture.images),
        memory_limit=sparse.memory_limit,
        progress=progress,
        environment={"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
    )


@contextmanager
def _row_count(database: Path, table: str, progress: Progress) -> Iterator[None]:
    """Report the rows of a table while a child fills it; COLMAP's extraction and matching call nobody back."""
    finished = threading.Event()

    def watch() -> None:
        last = 0
        while not finished.wait(_LOOK):
            now = _rows(database, table)
            if now > last:
                progress.advance(now)
                last = now

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        finished.set()
        watcher.join()


def _rows(database: Path, table: str) -> int:
    """Count rows beside a writer; 0 while there is no database, no table, or no quiet moment."""
    if not database.is_file():
        return 0
    try:
        with closing(sqlite3.connect(f"{database.absolute().as_uri()}?mode=ro", uri=True)) as connection:
            return int(connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()[0])
    except sqlite3.Error:
        return 0
