"""Fate of every pixel of the depth maps: part of a point, or the reason why not."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.dense.points import save_array
from recon.dense.undistort import WorkingCamera
from recon.sfm.colmap_model import SparseModel

PIXEL_FATES = ("no_depth", "views", "seen_through", "angle", "in_points")
"""Fates by number: a pixel has no depth; too few maps agree with it; other maps see through it; its rays
meet at too small an angle; or it is part of a point."""
NO_DEPTH, TOO_FEW, SEEN_THROUGH, NARROW, IN_POINTS = range(5)
FOLDER = "fates"


@dataclass(frozen=True)
class PixelFates:
    """The fates that a dense step has written, image by image.

    Attributes:
        folder: Folder of the step.
        model: The model that it measured depths for.
        camera: Working camera of the depth maps.
    """

    folder: Path
    model: SparseModel
    camera: WorkingCamera

    def of(self, row: int) -> NDArray[np.uint8]:
        """Read the fates of one depth map, numbers of `PIXEL_FATES`, shape (H, W), uint8.

        Args:
            row: Row of the image in the model.
        """
        return np.load(self.folder / FOLDER / f"{row:06d}.npy", allow_pickle=False)

    def in_photograph(self) -> NDArray[np.int64]:
        """Find the photograph's pixel, column and row, that shows each pixel's center [px], shape (H, W, 2), int64.

        The working camera may see more than the photograph; such pixels lie outside it.
        """
        pinhole = self.camera.pinhole
        column, row = np.meshgrid(np.arange(pinhole.width) + 0.5, np.arange(pinhole.height) + 0.5)
        centers = np.stack([column, row], axis=-1).astype(np.float64)
        return np.floor(self.camera.to_photograph(centers)).astype(np.int64)


def write_fates(folder: Path, fates: Iterable[NDArray[np.uint8]]) -> None:
    """Write the fates of all depth maps, one file for each.

    Args:
        folder: Folder of the step; gains a folder `fates`.
        fates: Numbers of `PIXEL_FATES` of each depth map, shape (H, W), uint8.
    """
    place = folder / FOLDER
    place.mkdir(exist_ok=True)
    for row, fate in enumerate(fates):
        save_array(place / f"{row:06d}.npy", fate)
