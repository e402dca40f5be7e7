"""The capture on disk: photographs with what a drone records, and separately, in `truth/`, the ground truth."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from groundwork.errors import InputError, MissingError
from groundwork.files import read_json
from groundwork.foreign_file import is_regular
from groundwork.output.reading import reading
from groundwork.settings import Settings, parse_settings
from render.images import image_files
from render.images.truth_checks import check_bands, check_camera, check_image, check_poses, check_tables, read_surface
from usd_schemas.components import ClassRow
from usd_schemas.distortion import NO_DISTORTION, Distortion
from usd_schemas.flat_scene import InstanceRow
from usd_schemas.pinhole import Pinhole

FORMAT = "falsework.capture"
FORMAT_VERSION = 1
CAMERAS = "cameras.json"
TRUTH = "truth"
LONGEST_SIDE = 100_000  # [px]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]
Triple = tuple[float, float, float]


class CalibrationPrior(Settings):
    """Calibration from the camera's data sheet: near the truth, but not exact."""

    model: Literal["SIMPLE_RADIAL"] = "SIMPLE_RADIAL"
    """Camera model that a reconstruction should start with, by COLMAP's name."""
    focal_px: float = Field(gt=0.0)
    """Focal length [px]."""
    cx: float
    """Principal point from the left edge [px]."""
    cy: float
    """Principal point from the top edge [px]."""


class CaptureImage(Settings):
    """One photograph."""

    name: str
    """File name without suffix; truth, poses and clouds use it."""
    file: str
    """Path of the file, relative to the capture's folder."""
    gps: Triple | None = None
    """Measured position in the local frame [m]."""
    time: float | None = None
    """Seconds since the first image [s]."""


@dataclass(frozen=True)
class Capture:
    """A folder of photographs, with only the data that a drone would record.

    Attributes:
        folder: Its path.
        survey: Survey id.
        size: Width and height of every image [px].
        prior: Calibration prior.
        gps_sigma: Standard deviation of `CaptureImage.gps` along x, y, z [m].
        facts: Further JSON facts of the survey (kind, seed, spacing …).
        images: The photographs, in the order of flight.
    """

    folder: Path
    survey: str
    size: tuple[int, int]
    prior: CalibrationPrior
    gps_sigma: Triple
    facts: dict[str, object]
    images: tuple[CaptureImage, ...]


class CamerasFile(Settings):
    """Content of `cameras.json`."""

    format: Literal["falsework.capture"]
    format_version: Literal[1]
    survey: str
    size: tuple[int, int]
    prior: CalibrationPrior
    gps_sigma: Triple = (0.0, 0.0, 0.0)
    facts: dict[str, object] = Field(default_factory=dict)
    images: tuple[CaptureImage, ...]


def read_capture(folder: Path | str) -> Capture:
    """Read a capture without its `truth/`; images are decoded later.

    Args:
        folder: A capture.

    Raises:
        InputError: Not a capture, a wrong value, a duplicate name, or a path that leaves the folder.
        MissingError: An image that it lists is missing.
    """
    with reading(Path(folder)):
        return _read_capture(Path(folder))


def _read_capture(folder: Path) -> Capture:
    path = folder / CAMERAS
    if not path.is_file():
        raise MissingError(
            "not a capture: no cameras.json", where=folder, hint="Name the folder that holds cameras.json"
        )
    value = read_json(path)
    if not isinstance(value, dict):
        raise InputError("not a JSON object", where=path)
    stored = parse_settings(CamerasFile, value, path)
    names = [image.name for image in stored.images]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError("two images have the same name", where=path, field="images", value=twice)
    if min(stored.size) < 1 or max(stored.size) > LONGEST_SIDE:
        raise InputError("an image needs a width and a height", where=path, field="size", value=list(stored.size))
    for image in stored.images:
        if image.name in ("", ".", "..") or "/" in image.name or len(image.name) > 200:  # truth files have this name
            raise InputError("not a valid name of an image", where=path, field="images.name", value=image.name)
        _check_file(folder, path, image.file)
    return Capture(
        folder, stored.survey, stored.size, stored.prior, stored.gps_sigma, dict(stored.facts), stored.images
    )


def load_image(capture: Capture, index: int) -> U8:
    """Decode one photograph completely.

    Args:
        capture: A capture.
        index: Row in `capture.images`.

    Returns:
        sRGB colors [0 to 255], shape (H, W, 3), uint8, order red, green, blue.

    Raises:
        InputError: Truncated, damaged, of 16 bits, or of another size than in `cameras.json`; names the file.
    """
    path = capture.folder / capture.images[index].file
    pixels = image_files.decode(path, capture.size)
    size = (pixels.shape[1], pixels.shape[0])
    if pixels.dtype != np.uint8:
        raise InputError(
            "not an image with 8 bits per channel", where=path, hint="Save it with 8 bits, or leave it out"
        )
    pixels = np.dstack([pixels] * 3) if pixels.ndim == 2 else pixels[:, :, :3]  # gray; or with an opacity
    if size != capture.size:
        raise InputError("not the size that cameras.json states", where=path, value=size, allowed=str(capture.size))
    return np.ascontiguousarray(pixels, np.uint8)


@dataclass(frozen=True)
class Readout:
    """Read-out of a rolling shutter: bands of rows, each with its own pose.

    Attributes:
        bands: First row of each band and the row after its last.
        poses: camera_to_world of each band of each image [m], shape (N, B, 4, 4), float64.
        readout_time: Time from the first row to the last [s].
    """

    bands: tuple[tuple[int, int], ...]
    poses: F64
    readout_time: float


@dataclass(frozen=True)
class Truth:
    """Ground truth of a simulated capture; its images share pixels exactly with the photographs.

    Attributes:
        folder: The capture's `truth` folder.
        camera: Exact intrinsics.
        names: Name of each image.
        poses: camera_to_world [m], shape (N, 4, 4), float64, camera axes right, down, forward.
        instances: Meaning of each instance id.
        classes: Class table of the capture.
        distortion: Distortion of the lens.
        readout: Read-out of a rolling shutter; None for a global shutter.
    """

    folder: Path
    camera: Pinhole
    names: tuple[str, ...]
    poses: F64
    instances: tuple[InstanceRow, ...]
    classes: tuple[ClassRow, ...]
    distortion: Distortion = NO_DISTORTION
    readout: Readout | None = None

    def seen_from(self, index: int, pixels: F64) -> F64:
        """Find the camera pose of pixels: that of the image, or of each pixel's band of rows.

        Args:
            index: Row in `names`.
            pixels: Pixel positions [px], shape (N, 2), float64.

        Returns:
            camera_to_world [m], shape (N, 4, 4), float64.
        """
        if self.readout is None:
            return np.broadcast_to(self.poses[index], (len(pixels), 4, 4))
        return self.readout.poses[index, self._bands(pixels)]

    def surface_points(self, index: int, pixels: F64, depth: F64) -> F64:
        """Find the world points at given pixels of an image, with lens distortion and rolling shutter.

        Args:
            index: Row in `names`.
            pixels: Pixel positions [px], shape (N, 2), float64.
            depth: Planar depths there [m], shape (N,), float64.

        Returns:
            World positions [m], shape (N, 3), float64.
        """
        camera = self.camera
        bent = (np.asarray(pixels, np.float64) - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
        straight = self.distortion.undistort(bent)
        local = (straight[:, 0] * depth, straight[:, 1] * depth, depth)
        if self.readout is None:
            return _in_world(self.poses[index], local)
        world = np.empty((len(depth), 3))
        band = self._bands(pixels)
        for number in np.unique(band):  # one pose per pixel would take ten times as long
            mine = band == number
            world[mine] = _in_world(self.readout.poses[index, number], (local[0][mine], local[1][mine], depth[mine]))
        return world

    def _bands(self, pixels: F64) -> NDArray[np.int64]:
        """Find the band of rows of each pixel, shape (N,)."""
        ends = np.array([end for _, end in self.readout.bands]) if self.readout else np.zeros(1)
        return np.minimum(np.searchsorted(ends, np.floor(pixels[:, 1]), side="right"), len(ends) - 1)

    def depth(self, index: int) -> F32:
        """Read planar depth [m], +inf for sky, shape (H, W), float32.

        Args:
            index: Row in `names`.
        """
        return self._image(self.folder / "depth" / f"{self.names[index]}.tiff", ("float32",)).astype(
            np.float32, copy=False
        )

    def semantic(self, index: int) -> U8:
        """Read class ids, shape (H, W), uint8.

        Args:
            index: Row in `names`.
        """
        return self._image(self.folder / "semantic" / f"{self.names[index]}.png", ("uint8",)).astype(
            np.uint8, copy=False
        )

    def instance(self, index: int) -> U32:
        """Read instance ids, 0 for sky, shape (H, W), uint32.

        Args:
            index: Row in `names`.
        """
        path = image_files.ids_file(self.folder / "instance", self.names[index])
        return self._image(path, ("uint16", "uint32", "int32")).astype(np.uint32)

    def _image(self, path: Path, kinds: tuple[str, ...]) -> NDArray[Any]:
        size = (self.camera.width, self.camera.height)
        pixels = image_files.decode(path, size)
        check_image(pixels, kinds, size, path)
        return pixels

    def surface(self) -> tuple[F64, U32, U8]:
        """Read the true surface, expanded to world triangles.

        Returns:
            Corner positions [m], shape (T, 3, 3), float64; instance id per triangle, shape (T,), uint32; class id per
            triangle, shape (T,), uint8.
        """
        return read_surface(self.folder / "surface.npz")


def read_truth(capture: Capture | Path | str) -> Truth | None:
    """Open the truth of a capture.

    Args:
        capture: A capture, or its folder.

    Returns:
        The truth; None for real photographs.

    Raises:
        InputError: The truth does not belong to these images.
    """
    known = capture if isinstance(capture, Capture) else read_capture(capture)
    with reading(known.folder):
        return _read_truth(known)


def _read_truth(capture: Capture) -> Truth | None:
    folder = capture.folder / TRUTH
    if not folder.is_dir():
        return None
    stored, table = read_json(folder / "poses.json"), read_json(folder / "instances.json")
    try:
        check_tables(table["instances"], table["classes"], folder)
        truth = Truth(
            folder,
            Pinhole(**stored["pinhole"]),
            tuple(pose["name"] for pose in stored["poses"]),
            np.array([pose["camera_to_world"] for pose in stored["poses"]], np.float64).reshape(-1, 4, 4),
            tuple(
                InstanceRow(
                    row["id"],
                    row["path"],
                    row["component"],
                    row["class"],
                    row["parameters"],
                    moves=row.get("moves") is True,
                )
                for row in table["instances"]
            ),
            tuple(ClassRow(row["id"], row["name"], _color(*row["color"])) for row in table["classes"]),
            Distortion(**stored.get("distortion", {})),
            _read_readout(stored),
        )
        _check_truth(truth, capture.size)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"not the truth of a capture: {error!r}", where=folder, hint="Render the survey again"
        ) from None
    if truth.names != tuple(image.name for image in capture.images):
        raise InputError("truth and cameras.json list different images", where=folder, hint="Render the survey again")
    return truth


def _check_truth(truth: Truth, size: tuple[int, int]) -> None:
    check_camera(truth.camera, size, truth.folder)
    if len(truth.poses) != len(truth.names):
        raise ValueError("poses and images differ in number")
    check_poses(truth.poses, truth.folder)
    if not all(np.isfinite(value) for value in vars(truth.distortion).values()):
        raise ValueError("a distortion that is not finite")
    if truth.readout is not None:
        check_bands(truth.readout.bands, truth.camera.height, truth.folder)
        check_poses(truth.readout.poses, truth.folder)
        if len(truth.readout.poses) != len(truth.names) or not 0.0 <= truth.readout.readout_time < np.inf:
            raise ValueError("an invalid shutter")


def _in_world(pose: F64, local: tuple[F64, F64, F64]) -> F64:
    """Transform camera coordinates to the world, shape (N, 3); by columns, five times faster than a product."""
    world = np.empty((len(local[0]), 3))
    for axis in range(3):
        x, y, z = pose[axis, :3]
        world[:, axis] = local[0] * x + local[1] * y + local[2] * z + pose[axis, 3]
    return world


def _read_readout(stored: dict[str, Any]) -> Readout | None:
    if "shutter" not in stored:
        return None
    bands = tuple((int(first), int(end)) for first, end in stored["shutter"]["bands"])
    poses = np.array([row["bands"] for row in stored["poses"]], np.float64).reshape(-1, len(bands), 4, 4)
    return Readout(bands, poses, float(stored["shutter"]["readout_time"]))


def _color(red: int, green: int, blue: int) -> tuple[int, int, int]:
    return red, green, blue


def _check_file(folder: Path, path: Path, name: str) -> None:
    relative = Path(name)
    if relative.is_absolute() or ".." in relative.parts or not name:
        raise InputError("a path that leads out of the capture", where=path, field="images.file", value=name)
    if not is_regular(folder / relative):
        raise MissingError("no such image", where=folder / relative, hint="Put it back, or take it out of cameras.json")
