"""The dense step as seen from outside: one child process, and the points that it leaves in a folder."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import folder_digest
from groundwork.child import run_child
from groundwork.progress import Progress
from recon.dense.points import FOLDER, DensePoints, read_fate, read_points
from recon.dense.undistort import WorkingCamera, working_camera
from recon.settings import DOWNSCALE, ReconSettings
from recon.sfm.colmap_model import SparseModel
from recon.sfm.sparse import Sparse
from recon.shortage import check_space, plain_shortage
from recon.steps import take_step
from render.capture import Capture

_VERSION = 4  # of what the step writes
_CHILD = "recon.dense.dense_child"
_SLACK = 120.0  # [s] beside the time per image
_BYTES_PER_PIXEL = 12  # on the disk: working image, depth, and the points' share


@dataclass(frozen=True)
class PixelFates:
    """What became of every pixel of the depth maps.

    Attributes:
        folder: Folder of the finished step.
        model: The model that it measured depths for.
        camera: Of the depth maps.
    """

    folder: Path
    model: SparseModel
    camera: WorkingCamera

    def of(self, row: int) -> NDArray[np.uint8]:
        """Read one depth map's, numbers of `recon.dense.fuse.PIXEL_FATES`, shape (H, W), uint8.

        Args:
            row: Row of the image in the model.
        """
        return read_fate(self.folder, row)

    def in_photograph(self) -> NDArray[np.int64]:
        """Find the photograph's pixel, column and row, that shows each pixel's centre, shape (H, W, 2), int64."""
        pinhole = self.camera.pinhole
        column, row = np.meshgrid(np.arange(pinhole.width) + 0.5, np.arange(pinhole.height) + 0.5)
        return np.floor(self.camera.to_photograph(np.stack([column, row], axis=-1))).astype(np.int64)


def run_dense(
    capture: Capture, sparse: Sparse, work: Path, settings: ReconSettings, progress: Progress
) -> tuple[DensePoints, PixelFates, dict[str, Any]]:
    """Measure a depth for nearly every pixel and fuse the depth maps; never looks at the truth.

    Args:
        capture: Photographs.
        sparse: The model, as structure from motion left it.
        work: Existing work folder; a finished step there is taken over, and depth maps of an interrupted one, too.
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
            "capture": str(capture.folder), "model": str(sparse.folder), "out": str(folder), "settings": settings,
        }  # fmt: skip
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
    fates = PixelFates(
        step.folder, sparse.model, working_camera(sparse.model, capture.size, DOWNSCALE[settings.quality])
    )
    return read_points(step.folder), fates, {**step.result, "points_sha256": folder_digest(step.folder / FOLDER)}
