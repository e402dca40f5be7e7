"""Runs the dense step in a child process and reads the points that it writes to a folder."""

from pathlib import Path
from typing import Any

from groundwork.canonical import folder_digest
from groundwork.child import run_child
from groundwork.progress import Progress
from recon.dense.pixel_fates import PixelFates
from recon.dense.points import FOLDER, DensePoints, read_points
from recon.dense.undistort import working_camera
from recon.settings import DOWNSCALE, ReconSettings
from recon.sfm.sparse import Sparse
from recon.shortage import check_space, plain_shortage
from recon.steps import take_step
from render.capture import Capture

_VERSION = 4  # format of what the step writes
_CHILD = "recon.dense.dense_child"
_SLACK = 120.0  # [s] beside the time per image
_BYTES_PER_PIXEL = 46  # [bytes per pixel] on disk: image 3, depth 4, marks 2, fate 1, point up to 36


def run_dense(
    capture: Capture, sparse: Sparse, work: Path, settings: ReconSettings, progress: Progress
) -> tuple[DensePoints, PixelFates, dict[str, Any]]:
    """Measure a depth for nearly every pixel and fuse the depth maps, without using the truth.

    Args:
        capture: Photographs.
        sparse: The model from structure from motion.
        work: Existing work folder; a finished step there is reused, and so are depth maps of an interrupted one.
        settings: What to do.
        progress: Listener.

    Returns:
        The points, in the model's own units, what became of every pixel, and JSON figures of the step.

    Raises:
        RejectedSceneError: `bad_lens` or `no_depth`.
        OutOfSpaceError: The disk is full; finished depth maps stay.
    """
    dense = settings.dense
    limits = {"threads", "seconds_per_image", "memory_limit", "memory_per_megapixel"}
    recipe = [_VERSION, sparse.recipe, settings.quality, settings.filter, dense.model_dump(exclude=limits)]

    def make(folder: Path) -> Any:
        width, height = (side // DOWNSCALE[settings.quality] for side in capture.size)
        check_space(folder, len(capture.images) * width * height * _BYTES_PER_PIXEL, "the dense step")
        request = {
            "capture": str(capture.folder),
            "model": str(sparse.folder),
            "out": str(folder),
            "settings": settings,
        }
        with plain_shortage(folder, "recon.dense", ", or a lower quality"):
            return run_child(
                _CHILD,
                request,
                time_limit=_SLACK + dense.seconds_per_image * len(capture.images),
                memory_limit=dense.memory_limit + dense.memory_per_megapixel * dense.threads * width * height / 1e6,
                progress=progress,
                environment={"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )

    step = take_step(work, "dense", recipe, make)
    camera = working_camera(sparse.model, capture.size, DOWNSCALE[settings.quality])
    fates = PixelFates(step.folder, sparse.model, camera)
    return read_points(step.folder), fates, {**step.result, "points_sha256": folder_digest(step.folder / FOLDER)}
