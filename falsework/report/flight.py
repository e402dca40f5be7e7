"""A flight in 3D: pose and field of view of every image, and a sheet of thumbnails."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from falsework.report.page import file_link
from falsework.report.pictures import data_uri
from groundwork.errors import InputError
from groundwork.files import read_json
from groundwork.foreign_file import read_regular
from groundwork.png_chunks import SIGNATURE, is_whole_png
from render.capture import Capture, Truth

if TYPE_CHECKING:
    from recon.cloud import Cloud

F64 = NDArray[np.float64]

MOST_PICTURES = 120  # images of one flight in the view; of more, every second, third …
CELL = 128  # [px] width of a thumbnail
REDUCED = {1: cv2.IMREAD_COLOR, 2: cv2.IMREAD_REDUCED_COLOR_2, 4: cv2.IMREAD_REDUCED_COLOR_4}
SMALLEST = {8: cv2.IMREAD_REDUCED_COLOR_8, **REDUCED}


@dataclass(frozen=True)
class Flight:
    """Poses of the images of one survey.

    Attributes:
        names: Name of each image with a pose.
        rows: Its row in the list of cameras of the cloud, or of images of the capture.
        poses: camera_to_world of each [m], shape (N, 4, 4), float64, axes right, down, forward.
        statuses: `ok` or the reason code of each.
        half: Half the width and height of an image at a distance of 1 [1].
        files: Link to each photograph.
        sheet: Sheet of thumbnails as a data URI, its columns and rows, and the cell of each image, -1 for none.
    """

    names: tuple[str, ...]
    rows: tuple[int, ...]
    poses: F64
    statuses: tuple[str, ...]
    half: tuple[float, float]
    files: tuple[str, ...]
    sheet: "Sheet | None" = None


@dataclass(frozen=True)
class Sheet:
    """Thumbnails in one picture.

    Attributes:
        picture: Data URI.
        columns: Pictures side by side.
        rows: Pictures one below the other.
        cells: Cell of each image, counted along the rows; -1 for those that have none.
    """

    picture: str
    columns: int
    rows: int
    cells: tuple[int, ...]


def flight_of(capture: Capture, truth: Truth | None, cloud: "Cloud | None", folder: Path | None, place: str) -> Flight:
    """Collect the poses of a capture's images: the true ones if known, else the reconstructed ones.

    Args:
        capture: Photographs.
        truth: Their truth, or None.
        cloud: Their cloud, or None.
        folder: Its folder.
        place: Link to the capture's folder.
    """
    told = {} if cloud is None else {row["name"]: str(row["status"]) for row in cloud.cameras}
    if truth is not None:
        camera, poses = truth.camera, dict(zip(truth.names, truth.poses, strict=True))
        half = (0.5 * camera.width / camera.fx, 0.5 * camera.height / camera.fy)
    else:
        poses, half = _reconstructed(folder) if folder is not None else ({}, (0.5, 0.4))
    rows = [k for k, image in enumerate(capture.images) if image.name in poses]
    images = [capture.images[k] for k in rows]
    return Flight(
        tuple(image.name for image in images),
        tuple(rows),
        np.array([poses[image.name] for image in images]).reshape(-1, 4, 4),
        tuple(told.get(image.name, "ok") for image in images),
        half,
        tuple(f"{place}/{file_link(*image.file.split('/'))}" if place else "" for image in images),
        _sheet(capture, rows),
    )


def flight_of_cloud(cloud: "Cloud", folder: Path) -> Flight:
    """Collect the reconstructed poses of a cloud's images, without reading the images.

    Args:
        cloud: A reconstructed cloud.
        folder: Its folder.

    Raises:
        InputError: Its cameras are damaged.
    """
    poses, half = _reconstructed(folder)
    rows = [k for k, camera in enumerate(cloud.cameras) if camera["name"] in poses]
    cameras = [cloud.cameras[k] for k in rows]
    return Flight(
        tuple(str(camera["name"]) for camera in cameras),
        tuple(rows),
        np.array([poses[camera["name"]] for camera in cameras]).reshape(-1, 4, 4),
        tuple(str(camera["status"]) for camera in cameras),
        half,
        ("",) * len(rows),
    )


def small_picture(path: Path, width: int) -> NDArray[np.uint8] | None:
    """Decode a photograph at reduced resolution, which takes a tenth of the time.

    Args:
        path: JPEG or PNG file.
        width: Width wanted [px].

    Returns:
        sRGB colors, shape (H, width, 3), uint8; None where it cannot be read.
    """
    try:
        file = read_regular(path)
        if file.startswith(SIGNATURE) and not is_whole_png(file):
            return None
        data = np.frombuffer(file, np.uint8)
        for reduced in (SMALLEST[8], SMALLEST[4], SMALLEST[2], SMALLEST[1]):
            pixels = cv2.imdecode(data, reduced | cv2.IMREAD_IGNORE_ORIENTATION)
            if pixels is None:
                return None
            if pixels.shape[1] >= width:
                break
    except (InputError, OSError, cv2.error):
        return None
    height = max(round(pixels.shape[0] * width / pixels.shape[1]), 1)
    small = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(small[..., ::-1], np.uint8)


def flight_data(flight: Flight | None, origin: F64) -> dict[str, Any]:
    """Encode a flight for the page.

    Args:
        flight: A flight, or None.
        origin: Origin of positions on the page [m], shape (3,), float64.
    """
    if flight is None or not len(flight.poses):
        return {"cameras": [], "half": [1, 1], "depth": 1, "path": False, "sheet": None}
    poses = flight.poses.copy()
    poses[:, :3, 3] -= origin
    cells = (-1,) * len(poses) if flight.sheet is None else flight.sheet.cells
    told = zip(flight.names, flight.rows, poses, flight.statuses, flight.files, cells, strict=True)
    cameras = [
        {
            "name": name,
            "row": row,
            "pose": np.round(pose[:3].reshape(-1), 4).tolist(),
            "ok": status == "ok",
            "status": status,
            "file": file,
            "cell": cell,
        }
        for name, row, pose, status, file, cell in told
    ]
    sheet = flight.sheet and {key: getattr(flight.sheet, key) for key in ("picture", "columns", "rows")}
    return {
        "cameras": cameras,
        "half": [round(float(value), 5) for value in flight.half],
        "depth": _frame_depth(poses[:, :3, 3]),
        "path": True,
        "sheet": sheet,
    }


def _frame_depth(centers: F64) -> float:
    """Choose the length of the drawn frusta [m]: about the distance between images, so that they do not overlap."""
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    return float(np.clip(0.8 * np.median(steps), 0.3, 8.0)) if len(steps) else 1.0


def _reconstructed(folder: Path) -> tuple[dict[str, F64], tuple[float, float]]:
    """Read the cameras of a reconstruction, and their field of view."""
    path = folder / "cameras_sfm.json"
    if not path.is_file():
        return {}, (0.5, 0.4)
    try:
        stored = read_json(path)
        width, height = stored["camera"]["size"]
        focal = float(stored["camera"]["params"][0])
        poses = {str(row["name"]): np.array(row["camera_to_world"], np.float64) for row in stored["poses"]}
        right = all(pose.shape == (4, 4) and np.isfinite(pose).all() for pose in poses.values())
        if not (right and focal > 0.0):
            raise ValueError("a pose is not finite, or a focal length is not positive")
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise InputError(f"a key is missing or of a wrong kind: {error}", where=path) from None
    return poses, (0.5 * width / focal, 0.5 * height / focal)


def _sheet(capture: Capture, rows: Sequence[int]) -> Sheet | None:
    """Make a sheet of thumbnails of evenly chosen images."""
    every = max(-(-len(rows) // MOST_PICTURES), 1)
    chosen = range(0, len(rows), every)
    if not rows:
        return None
    height = max(round(CELL * capture.size[1] / capture.size[0]), 1)
    columns = int(np.ceil(np.sqrt(len(chosen) * height / CELL)))
    lines = -(-len(chosen) // columns)
    sheet = np.full((lines * height, columns * CELL, 3), 128, np.uint8)
    cells = [-1] * len(rows)
    for cell, number in enumerate(chosen):
        pixels = small_picture(capture.folder / capture.images[rows[number]].file, CELL)
        cells[number] = cell
        if pixels is not None:
            line, column = divmod(cell, columns)
            fitted = cv2.resize(pixels, (CELL, height))
            sheet[line * height : (line + 1) * height, column * CELL : (column + 1) * CELL] = fitted
    return Sheet(data_uri(sheet, sheet.shape[1], quality=80), columns, lines, tuple(cells))
