"""The dense step in a child, in the model's own units and without truth: `python -m recon.dense.dense_child`."""

import shutil
from collections import OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from groundwork.child import answer_parent
from groundwork.errors import RejectedSceneError
from groundwork.progress import Progress
from recon.dense.depth_colmap import has_cuda, measure_with_colmap
from recon.dense.depth_patchmatch import measure_slanted
from recon.dense.depth_sgm import PosedImage, measure_depth
from recon.dense.fuse import DepthView, fuse_view
from recon.dense.neighbors import View, choose_sources, choose_views
from recon.dense.pixel_fates import NO_DEPTH, TOO_FEW, write_fates
from recon.dense.points import DensePoints, save_array, write_points
from recon.dense.smooth import smooth
from recon.dense.undistort import WorkingCamera, covered, undistort, working_camera
from recon.photos.photos import open_photographs
from recon.settings import AGREEMENT, DOWNSCALE, DenseSettings, ReconSettings
from recon.sfm.colmap_model import SparseModel, read_model
from render.capture import Capture, load_image

Mask = NDArray[np.bool_]

_CACHE = 400e6  # [bytes] of depth maps that the fusion keeps in memory
_MOST_VIEWS = 250  # each keeps a file open, and a process has 1,024 files at most on many machines


def serve(request: dict[str, Any], progress: Progress) -> object:
    """Measure depth maps and fuse them.

    Args:
        request: `capture`, `model` and `out` (folders), `settings`.
        progress: Listener.

    Returns:
        JSON figures.

    Raises:
        RejectedSceneError: `bad_lens`, or `no_depth`: no pixel has a depth on which enough images agree.
    """
    cv2.setNumThreads(1)  # the views are measured in parallel
    settings = ReconSettings.model_validate(request["settings"])
    capture, model = open_photographs(Path(request["capture"])), read_model(Path(request["model"]))
    out = Path(request["out"])
    camera = working_camera(model, capture.size, DOWNSCALE[settings.quality])
    views = choose_views(model, settings.dense)
    maps = DepthMaps(out, model, camera)
    _undistort_all(capture, model, maps, settings, progress)
    method = choose_method(settings.dense)
    if method == "colmap":
        depths = measure_with_colmap(capture.folder, Path(request["model"]), out / "colmap", model.names, camera)
        for row, depth in enumerate(depths):
            maps.put_depth(row, depth)
    known = _measure_all(views, maps, method, settings, progress)
    count = write_points(out, _fuse_all(views, maps, settings, progress))
    if not count:
        raise RejectedSceneError("no_depth", _why_nothing(views, known, settings))
    write_fates(out, (maps.marks(row)[1] for row in range(len(views))))
    maps.clear()
    return {
        "method": method,
        "reproducible": method != "colmap",
        "quality": settings.quality,
        "filter": settings.filter,
        "depth_size": [camera.pinhole.width, camera.pinhole.height],
        "points": count,
        "depth_maps": sum(len(view.sources) > 0 for view in views),
        "known_share": float(np.mean(known)),
    }


def choose_method(settings: DenseSettings) -> str:
    """Choose the method that `auto` stands for on this machine.

    Args:
        settings: Names the method.

    Returns:
        `sgm`, `patchmatch` or `colmap`.
    """
    if settings.method != "auto":
        return settings.method
    return "colmap" if has_cuda() else "sgm"


class DepthMaps:
    """Working images, depth maps and the marks of fusion on disk, with the most recently used in memory.

    Attributes:
        camera: Their camera.
    """

    def __init__(self, folder: Path, model: SparseModel, camera: WorkingCamera) -> None:
        """Make the folders.

        Args:
            folder: Folder to store them in.
            model: Has the names and poses of the images.
            camera: Their camera.
        """
        self.camera, self._model = camera, model
        self._images, self._depths = folder / "images", folder / "depth"
        for path in (self._images, self._depths):
            path.mkdir(parents=True, exist_ok=True)
        self._shape = shape = (camera.pinhole.height, camera.pinhole.width)
        self._marks = folder / "marks"
        self._unmark(len(model.names))
        self._views: OrderedDict[int, DepthView] = OrderedDict()
        self._room = min(max(1, int(_CACHE // (shape[0] * shape[1] * 19))), _MOST_VIEWS)

    def clear(self) -> None:
        """Delete all of them from the disk."""
        for path in (self._images, self._depths):
            shutil.rmtree(path)
        self._marks.unlink()

    def marks(self, row: int) -> tuple[Mask, NDArray[np.uint8]]:
        """Map the marks that fusion sets: pixels that are part of a point, and fates, numbers of `PIXEL_FATES`.

        They are in a file, because their size grows with the number of images; all maps of one row share their bytes.

        Args:
            row: Row of the image.

        Returns:
            Used pixels, shape (H, W), bool; fates, shape (H, W), uint8.
        """
        size = self._shape[0] * self._shape[1]
        both = np.asarray(np.memmap(self._marks, np.uint8, "r+", 2 * size * row, (2, *self._shape)))
        return both[0].view(bool), both[1]

    def _unmark(self, count: int) -> None:
        blank = np.zeros((2, *self._shape), np.uint8)
        blank[1] = NO_DEPTH
        with self._marks.open("wb") as file:  # inside an atomic folder
            for _ in range(count):  # in full: a map of a file with holes would crash on a full disk
                file.write(blank.data)

    def has(self, row: int) -> bool:
        """Tell whether a depth map exists, perhaps from an interrupted run."""
        return (self._depths / f"{row:06d}.npy").is_file()

    @property
    def poses(self) -> NDArray[np.float64]:
        """Return camera_to_world of every image [model units], shape (I, 4, 4), float64."""
        return self._model.poses

    def put_image(self, row: int, image: NDArray[np.uint8]) -> None:
        """Store a working image.

        Args:
            row: Row of the image.
            image: The image, shape (H, W, 3), uint8.
        """
        save_array(self._images / f"{row:06d}.npy", image)

    def image(self, row: int) -> NDArray[np.uint8]:
        """Read a working image, shape (H, W, 3), uint8."""
        return np.load(self._images / f"{row:06d}.npy", allow_pickle=False)

    def put_depth(self, row: int, depth: NDArray[np.float32]) -> None:
        """Store a depth map.

        Args:
            row: Row of the image.
            depth: Planar depths [model units], shape (H, W), float32.
        """
        save_array(self._depths / f"{row:06d}.npy", depth)

    def depth(self, row: int) -> NDArray[np.float32]:
        """Read a depth map, 0 where unknown [model units], shape (H, W), float32."""
        return np.load(self._depths / f"{row:06d}.npy", allow_pickle=False)

    def depth_view(self, row: int) -> DepthView:
        """Read a depth map with its normals; the least recently used one is dropped from memory."""
        if row in self._views:
            self._views.move_to_end(row)
            return self._views[row]
        depth, normal = smooth(self.depth(row), intrinsics(self.camera))
        used, fate = self.marks(row)
        view = DepthView(row, depth, normal, self.image(row), used, self.poses[row], fate)
        self._views[row] = view
        while len(self._views) > self._room:
            self._views.popitem(last=False)
        return view


def intrinsics(camera: WorkingCamera) -> NDArray[np.float64]:
    """List fx, fy, cx, cy of the working camera [px], shape (4,), float64."""
    pinhole = camera.pinhole
    return np.array([pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy])


def _undistort_all(
    capture: Capture, model: SparseModel, maps: DepthMaps, settings: ReconSettings, progress: Progress
) -> None:
    row_of = {image.file: row for row, image in enumerate(capture.images)}

    def one(row: int) -> None:
        maps.put_image(row, undistort(load_image(capture, row_of[model.names[row]]), maps.camera))

    _for_each(one, len(model.names), "undistort", settings.dense.threads, progress)


def _measure_all(
    views: tuple[View, ...], maps: DepthMaps, method: str, settings: ReconSettings, progress: Progress
) -> list[float]:
    """Measure all depth maps that are not there yet; returns the share of each that is known."""
    _, tolerance = AGREEMENT[settings.filter]
    measure = measure_slanted if method == "patchmatch" else measure_depth
    mask = covered(maps.camera)

    def posed(row: int) -> PosedImage:
        gray = cv2.cvtColor(maps.image(row), cv2.COLOR_RGB2GRAY).astype(np.uint8, copy=False)
        return PosedImage(gray, maps.poses[row])

    def one(row: int) -> float:
        if maps.has(row):
            return float((maps.depth(row) > 0).mean())
        view = views[row]
        pinhole = maps.camera.pinhole
        if method == "patchmatch":  # PatchMatch compares whole images, whatever the camera's motion
            sources = tuple(view.sources[: settings.dense.sources].tolist())
        else:
            sources = choose_sources(view, maps.poses, pinhole, settings.dense.sources)
        others = [posed(source) for source in sources]
        depth = measure(posed(row), others, pinhole, mask, (view.near, view.far), tolerance)
        maps.put_depth(row, depth)
        return float((depth > 0).mean())

    return _for_each(one, len(views), "depth", settings.dense.threads, progress)


def _fuse_all(
    views: tuple[View, ...], maps: DepthMaps, settings: ReconSettings, progress: Progress
) -> Iterator[DensePoints]:
    """Yield the points of one view after the other."""
    min_views, tolerance = AGREEMENT[settings.filter]
    camera, dense = intrinsics(maps.camera), settings.dense
    progress.stage("fuse", len(views))
    for view in views:
        if len(view.sources):
            others = [maps.depth_view(int(row)) for row in view.sources]
            found = fuse_view(maps.depth_view(view.row), others, camera, min_views, tolerance, dense.min_point_angle)
            uv = maps.camera.to_photograph(found.uv.astype(np.float64)).astype(np.float32)
            yield replace(found, uv=uv)
        else:
            maps.marks(view.row)[1][maps.depth(view.row) > 0] = TOO_FEW  # colmap measures these, too
        progress.advance(view.row + 1)


def _for_each(work: Callable[[int], Any], count: int, name: str, threads: int, progress: Progress) -> list[Any]:
    """Process every image, several in parallel; results and progress in the images' order."""
    progress.stage(name, count)
    results = []
    with ThreadPoolExecutor(threads) as pool:
        for done, result in enumerate(pool.map(work, range(count))):
            results.append(result)
            progress.advance(done + 1)
    return results


def _why_nothing(views: tuple[View, ...], known: list[float], settings: ReconSettings) -> str:
    if not any(len(view.sources) for view in views):
        return "no two images share enough sparse points at a useful angle"
    least, _ = AGREEMENT[settings.filter]
    share = float(np.mean(known))
    return f"depth is known for {share:.1%} of the pixels, but no {least} views agree on a depth"


if __name__ == "__main__":
    answer_parent(serve)
