"""The capture on disk: photographs and what a drone knows about them; apart from it, in `truth/`, what only we know."""

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from groundwork.errors import InputError, MissingError
from groundwork.files import read_json, space_errors, write_bytes, write_json
from groundwork.settings import Settings, parse_settings
from render import image_files
from usd_schemas.components import ClassRow
from usd_schemas.flat_scene import FlatScene, InstanceRow
from usd_schemas.pinhole import Pinhole

FORMAT = "falsework.capture"
FORMAT_VERSION = 1
CAMERAS = "cameras.json"
TRUTH = "truth"

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]
Triple = tuple[float, float, float]


class CalibrationPrior(Settings):
    """What the camera's maker says about the lens: near the truth, not the truth."""

    model: Literal["SIMPLE_RADIAL"] = "SIMPLE_RADIAL"
    """Camera model that a reconstruction should start with, as COLMAP names it."""
    focal_px: float
    """Focal length [px]."""
    cx: float
    """Principal point from the left edge [px]."""
    cy: float
    """Principal point from the top edge [px]."""


class CaptureImage(Settings):
    """One photograph."""

    name: str
    """Stem by which truth, poses and clouds name it."""
    file: str
    """Path of the file from the capture's folder."""
    gps: Triple | None = None
    """Measured position in the local frame [m]."""
    time: float | None = None
    """Seconds since the first image [s]."""


@dataclass(frozen=True)
class Capture:
    """A folder of photographs, with nothing in it that a drone would not know.

    Attributes:
        folder: Where it lies.
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


class _CamerasFile(Settings):
    format: Literal["falsework.capture"]
    format_version: Literal[1]
    survey: str
    size: tuple[int, int]
    prior: CalibrationPrior
    gps_sigma: Triple = (0.0, 0.0, 0.0)
    facts: dict[str, object] = Field(default_factory=dict)
    images: tuple[CaptureImage, ...]


def read_capture(folder: Path) -> Capture:
    """Read what lies outside `truth/`; no image is decoded yet.

    Args:
        folder: A capture.

    Raises:
        InputError: Not a capture, a wrong value, a name twice, or a path that leaves the folder.
        MissingError: An image that it lists is not there.
    """
    path = folder / CAMERAS
    if not path.is_file():
        raise MissingError(
            "not a capture: no cameras.json", where=folder, mend="Name the folder that holds cameras.json"
        )
    value = read_json(path)
    if not isinstance(value, dict):
        raise InputError("not a JSON object", where=path)
    stored = parse_settings(_CamerasFile, value, path)
    names = [image.name for image in stored.images]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError("two images have the same name", where=path, field="images", value=twice)
    if min(stored.size) < 1:
        raise InputError("an image needs a width and a height", where=path, field="size", value=list(stored.size))
    for image in stored.images:
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
        sRGB colours [0 to 255], shape (H, W, 3), uint8, order red, green, blue.

    Raises:
        InputError: Cut off, damaged, or of another size than `cameras.json` says; names the file.
    """
    path = capture.folder / capture.images[index].file
    pixels = image_files.decode(path)
    size = (pixels.shape[1], pixels.shape[0])
    if pixels.ndim != 3 or pixels.dtype != np.uint8:
        raise InputError("not an 8-bit colour image", where=path)
    if size != capture.size:
        raise InputError("not the size that cameras.json states", where=path, value=size, allowed=str(capture.size))
    return pixels.astype(np.uint8, copy=False)


@dataclass(frozen=True)
class Truth:
    """What only a simulation knows; its images share pixels exactly with the photographs.

    Attributes:
        folder: The capture's `truth` folder.
        camera: Exact intrinsics.
        names: Name of each image.
        poses: camera_to_world [m], shape (N, 4, 4), float64, camera axes right, down, forward.
        instances: What each instance id stands for.
        classes: Class table in force.
    """

    folder: Path
    camera: Pinhole
    names: tuple[str, ...]
    poses: F64
    instances: tuple[InstanceRow, ...]
    classes: tuple[ClassRow, ...]

    def depth(self, index: int) -> F32:
        """Read planar depth [m], +inf for sky, shape (H, W), float32.

        Args:
            index: Row in `names`.
        """
        return image_files.decode(self.folder / "depth" / f"{self.names[index]}.tiff").astype(np.float32, copy=False)

    def semantic(self, index: int) -> U8:
        """Read class ids, shape (H, W), uint8.

        Args:
            index: Row in `names`.
        """
        return image_files.decode(self.folder / "semantic" / f"{self.names[index]}.png").astype(np.uint8, copy=False)

    def instance(self, index: int) -> U32:
        """Read instance ids, 0 for sky, shape (H, W), uint32.

        Args:
            index: Row in `names`.
        """
        return image_files.read_ids(self.folder / "instance", self.names[index])

    def surface(self) -> tuple[F64, U32, U8]:
        """Read the true surface, expanded to world triangles.

        Returns:
            Corner positions [m], shape (T, 3, 3), float64; instance id per triangle, shape (T,), uint32; class id per
            triangle, shape (T,), uint8.
        """
        path = self.folder / "surface.npz"
        try:
            with np.load(path, allow_pickle=False) as stored:
                return _expand({name: stored[name] for name in stored.files})
        except (OSError, KeyError, ValueError, zipfile.BadZipFile):
            raise InputError("missing or damaged", where=path, mend="Render the survey again") from None


def read_truth(capture: Capture) -> Truth | None:
    """Open the truth beside a capture, if there is any.

    Args:
        capture: A capture.

    Returns:
        The truth, or None for real photographs.

    Raises:
        InputError: The truth does not belong to these images.
    """
    folder = capture.folder / TRUTH
    if not folder.is_dir():
        return None
    stored, table = read_json(folder / "poses.json"), read_json(folder / "instances.json")
    try:
        truth = Truth(
            folder,
            Pinhole(**stored["pinhole"]),
            tuple(pose["name"] for pose in stored["poses"]),
            np.array([pose["camera_to_world"] for pose in stored["poses"]], np.float64).reshape(-1, 4, 4),
            tuple(
                InstanceRow(row["id"], row["path"], row["component"], row["class"], row["parameters"])
                for row in table["instances"]
            ),
            tuple(ClassRow(row["id"], row["name"], _color(*row["color"])) for row in table["classes"]),
        )
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(
            f"not the truth of a capture: {error!r}", where=folder, mend="Render the survey again"
        ) from None
    if truth.names != tuple(image.name for image in capture.images):
        raise InputError("truth and cameras.json list different images", where=folder, mend="Render the survey again")
    return truth


@dataclass(frozen=True)
class FrameTruth:
    """The exact images of one frame.

    Attributes:
        depth: Planar depth [m], +inf for sky, shape (H, W), float32.
        semantic: Class ids, shape (H, W), uint8.
        instance: Instance ids, 0 for sky, shape (H, W), uint32.
        normal: Unit normals in world axes [1], zero for sky, shape (H, W, 3), float32, or None.
    """

    depth: F32
    semantic: U8
    instance: U32
    normal: F32 | None = None


def make_folders(folder: Path) -> None:
    """Make the sub-folders of a capture.

    Args:
        folder: An existing folder.
    """
    for name in ("images", *(f"{TRUTH}/{kind}" for kind in ("depth", "semantic", "instance"))):
        (folder / name).mkdir(parents=True, exist_ok=True)


def write_cameras(capture: Capture) -> None:
    """Write `cameras.json`.

    Args:
        capture: What to write, into its folder.
    """
    stored = _CamerasFile(
        format=FORMAT, format_version=FORMAT_VERSION, survey=capture.survey, size=capture.size, prior=capture.prior,
        gps_sigma=capture.gps_sigma, facts=capture.facts, images=capture.images,
    )  # fmt: skip
    write_json(capture.folder / CAMERAS, stored)


def write_frame_truth(folder: Path, name: str, frame: FrameTruth, *, wide_ids: bool) -> None:
    """Write the exact images of one frame, all without loss but the normals.

    Args:
        folder: The capture's folder.
        name: Name of the image.
        frame: Its exact images.
        wide_ids: Whether any instance id of the scene is above 65,535.
    """
    truth = folder / TRUTH
    write_bytes(truth / "depth" / f"{name}.tiff", image_files.encode_depth(frame.depth))
    write_bytes(truth / "semantic" / f"{name}.png", image_files.encode_png(frame.semantic))
    image_files.write_ids(truth / "instance", name, frame.instance, wide=wide_ids)
    if frame.normal is not None:
        (truth / "normal").mkdir(exist_ok=True)
        coded = np.rint((frame.normal + 1.0) * 127.5).astype(np.uint8)
        write_bytes(truth / "normal" / f"{name}.png", image_files.encode_png(coded))


def write_truth(folder: Path, camera: Pinhole, names: tuple[str, ...], poses: F64, scene: FlatScene) -> None:
    """Write the exact camera, the poses, the tables and the surface.

    Args:
        folder: The capture's folder.
        camera: Exact intrinsics.
        names: Name of each image.
        poses: camera_to_world [m], shape (N, 4, 4), float64.
        scene: Scene that was rendered.
    """
    truth = folder / TRUTH
    rows = [{"name": name, "camera_to_world": pose.tolist()} for name, pose in zip(names, poses, strict=True)]
    write_json(truth / "poses.json", {"pinhole": vars(camera), "poses": rows})
    instances = [
        {
            "id": row.id,
            "path": row.path,
            "component": row.component,
            "class": row.class_name,
            "parameters": row.parameters,
        }
        for row in scene.instances
    ]
    classes = [{"id": row.id, "name": row.name, "color": row.color} for row in scene.classes]
    write_json(truth / "instances.json", {"classes": classes, "instances": instances})
    _write_surface(truth / "surface.npz", scene)


def _write_surface(path: Path, scene: FlatScene) -> None:
    geometry, draws = scene.geometry, scene.draws
    arrays = {
        "positions": geometry.positions, "triangles": geometry.triangles,
        "part_first": geometry.part_first, "part_count": geometry.part_count,
        "draw_part": draws.part, "draw_transform": draws.transform,
        "draw_instance": draws.instance, "draw_label": draws.label,
    }  # fmt: skip
    with space_errors(path):
        np.savez_compressed(path, **arrays)  # inside an atomic folder


def _color(red: int, green: int, blue: int) -> tuple[int, int, int]:
    return red, green, blue


def _expand(stored: dict[str, NDArray[Any]]) -> tuple[F64, U32, U8]:
    parts = stored["draw_part"].astype(np.int64)
    counts = stored["part_count"].astype(np.int64)[parts]
    draw = np.repeat(np.arange(len(parts)), counts)
    within = np.arange(len(draw)) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = stored["part_first"].astype(np.int64)[parts][draw] + within
    local = stored["positions"].astype(np.float64)[stored["triangles"].astype(np.int64)[rows]]
    corners = np.empty_like(local)
    transform = stored["draw_transform"].astype(np.float64)
    for corner in range(3):  # one corner at a time keeps the expanded matrices small
        corners[:, corner] = np.einsum("tij,tj->ti", transform[draw, :3, :3], local[:, corner])
    corners += transform[draw, None, :3, 3]
    return corners, stored["draw_instance"].astype(np.uint32)[draw], stored["draw_label"].astype(np.uint8)[draw]


def _check_file(folder: Path, path: Path, name: str) -> None:
    relative = Path(name)
    if relative.is_absolute() or ".." in relative.parts or not name:
        raise InputError("a path that leaves the capture", where=path, field="images.file", value=name)
    if not (folder / relative).is_file():
        raise MissingError("no such image", where=folder / relative, mend="Put it back, or take it out of cameras.json")
