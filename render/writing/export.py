"""Export of a capture with its truth: a COLMAP model, a nerfstudio dataset, a video of the flight."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from groundwork.errors import InputError
from groundwork.files import write_bytes, write_json, write_text
from groundwork.foreign_file import read_picture
from groundwork.progress import Progress
from groundwork.slug import flat_names
from render.capture import Capture, Truth, load_image, read_capture, read_truth
from usd_schemas.pinhole import USD_FROM_CAMERA

F64 = NDArray[np.float64]

_POINTS_STEP = 24  # [px] between the pixels whose surface becomes a point
_MOST_POINTS = 200_000
_FILM_WIDTH = 1280  # [px]
_FILM_RATE = 8.0  # images per second


def export_capture(folder: Path, to: str, out: Path, progress: Progress) -> list[str]:
    """Write a capture for another program.

    Args:
        folder: A capture.
        to: Row of `EXPORTS`.
        out: Empty folder to fill.
        progress: Listener.

    Returns:
        Files for people to open, relative to `out`.

    Raises:
        InputError: Not a capture, or one without the truth that this format needs.
    """
    capture = read_capture(folder)
    return EXPORTS[to](capture, out, progress)


def write_colmap(capture: Capture, out: Path, progress: Progress) -> list[str]:
    """Write the true cameras, and points of the true surface in the colors of the photographs, as a COLMAP text model.

    Args:
        capture: A capture with truth.
        out: Folder to fill: `images/` and `sparse/0/`.
        progress: Listener.
    """
    truth = _truth(capture)
    camera, bend = truth.camera, truth.distortion
    model = out / "sparse/0"
    model.mkdir(parents=True)
    values = [camera.fx, camera.fy, camera.cx, camera.cy, bend.k1, bend.k2, bend.p1, bend.p2]
    kind, values = ("PINHOLE", values[:4]) if bend.is_identity else ("OPENCV", values)
    numbers = " ".join(repr(float(value)) for value in values)
    write_text(model / "cameras.txt", f"1 {kind} {camera.width} {camera.height} {numbers}\n")
    lines, stems = [], flat_names(image.file for image in capture.images)
    for row, image in enumerate(capture.images):
        from_world = np.linalg.inv(truth.poses[row])
        x, y, z, w = Rotation.from_matrix(from_world[:3, :3]).as_quat()
        pose = " ".join(repr(float(value)) for value in (w, x, y, z, *from_world[:3, 3]))
        lines.append(f"{row + 1} {pose} 1 {stems[image.file]}\n\n")  # the empty line holds no keypoints
    write_text(model / "images.txt", "".join(lines))
    points, colors = _surface_points(capture, truth, progress)
    rows = (
        f"{number} {x!r} {y!r} {z!r} {r} {g} {b} 0\n"
        for number, ((x, y, z), (r, g, b)) in enumerate(zip(points.tolist(), colors.tolist(), strict=True), 1)
    )
    write_text(model / "points3D.txt", "".join(rows))
    _copy_images(capture, out)
    return ["sparse/0"]


def write_nerfstudio(capture: Capture, out: Path, progress: Progress) -> list[str]:
    """Write the true cameras as `transforms.json`, with camera axes right, up, backward, and the photographs beside it.

    Args:
        capture: A capture with truth.
        out: Folder to fill.
        progress: Listener.
    """
    truth = _truth(capture)
    camera, bend = truth.camera, truth.distortion
    stems = flat_names(image.file for image in capture.images)
    frames = [
        {
            "file_path": f"images/{stems[image.file]}",
            "transform_matrix": (truth.poses[row] @ USD_FROM_CAMERA).tolist(),
            "colmap_im_id": row + 1,
        }
        for row, image in enumerate(capture.images)
    ]
    points, colors = _surface_points(capture, truth, progress)
    _write_points(out / "sparse_pc.ply", points, colors)
    write_json(
        out / "transforms.json",
        {
            "camera_model": "OPENCV",
            "w": camera.width,
            "h": camera.height,
            "fl_x": camera.fx,
            "fl_y": camera.fy,
            "cx": camera.cx,
            "cy": camera.cy,
            "k1": bend.k1,
            "k2": bend.k2,
            "p1": bend.p1,
            "p2": bend.p2,
            "ply_file_path": "sparse_pc.ply",
            "frames": frames,
        },
    )
    _copy_images(capture, out)
    return ["transforms.json"]


def write_video(capture: Capture, out: Path, progress: Progress) -> list[str]:
    """Write a video of the flight; with truth, the classes are shown beside the photographs.

    Args:
        capture: A capture.
        out: Folder to fill.
        progress: Listener.

    Raises:
        InputError: OpenCV cannot write the film, or could not write all of it.
    """
    truth = read_truth(capture)
    width, height = capture.size
    scale = min(1.0, _FILM_WIDTH / (width * (1 if truth is None else 2)))
    size = (max(2, round(width * scale)) // 2 * 2, max(2, round(height * scale)) // 2 * 2)
    palette = np.zeros((256, 3), np.uint8)
    for row in truth.classes if truth is not None else ():
        palette[row.id] = row.color
    path = out / "flight.mp4"
    film = cv2.VideoWriter(
        str(path), cv2.VideoWriter.fourcc(*"mp4v"), _FILM_RATE, (size[0] * (1 if truth is None else 2), size[1])
    )
    if not film.isOpened():
        raise InputError("this OpenCV cannot write mp4", where=path, hint="Install opencv-python-headless with pip")
    progress.stage("film", len(capture.images))
    for row in range(len(capture.images)):
        parts = [cv2.resize(load_image(capture, row), size, interpolation=cv2.INTER_AREA)]
        if truth is not None:
            parts.append(cv2.resize(palette[truth.semantic(row)], size, interpolation=cv2.INTER_NEAREST))
        film.write(cv2.cvtColor(np.hstack(parts).astype(np.uint8), cv2.COLOR_RGB2BGR))
        progress.advance(row + 1)
    film.release()
    _check_film(path, len(capture.images))
    return ["flight.mp4"]


def _check_film(path: Path, count: int) -> None:
    """Refuse a film that is not complete: OpenCV says nothing where it could not write, as on a full disk."""
    film = cv2.VideoCapture(str(path)) if path.is_file() and path.stat().st_size else None
    found = 0 if film is None else round(film.get(cv2.CAP_PROP_FRAME_COUNT))
    if film is not None:
        film.release()
    if found != count:
        raise InputError(
            "the film is not complete",
            where=path,
            value=f"{max(found, 0)} of {count} images",
            hint="Check that the disk has room; else install opencv-python-headless with pip",
        )


EXPORTS: dict[str, Callable[[Capture, Path, Progress], list[str]]] = {
    "colmap": write_colmap,
    "nerfstudio": write_nerfstudio,
    "video": write_video,
}


def _truth(capture: Capture) -> Truth:
    truth = read_truth(capture)
    if truth is None:
        raise InputError(
            "has no truth, and so no true cameras",
            where=capture.folder,
            hint="Reconstruct it; the cloud's folder then has a COLMAP model",
        )
    return truth


def _surface_points(capture: Capture, truth: Truth, progress: Progress) -> tuple[F64, NDArray[np.uint8]]:
    """Sample the surface on a coarse grid of all images, or of every n-th if there are too many points.

    Returns positions [m], shape (N, 3), and colors, shape (N, 3).
    """
    camera = truth.camera
    start = _POINTS_STEP // 2
    grid = np.mgrid[start : camera.height : _POINTS_STEP, start : camera.width : _POINTS_STEP]
    rows, columns = grid.reshape(2, -1)
    positions, colors = [np.zeros((0, 3))], [np.zeros((0, 3), np.uint8)]
    progress.stage("points", len(capture.images))
    every = max(1, -(-len(capture.images) * len(rows) // _MOST_POINTS))
    for index in range(0, len(capture.images), every):
        depth = truth.depth(index)[rows, columns].astype(np.float64)
        seen = np.isfinite(depth)
        pixels = np.column_stack([columns, rows])[seen] + 0.5
        positions.append(truth.surface_points(index, pixels, depth[seen]))
        colors.append(load_image(capture, index)[rows, columns][seen])
        progress.advance(index + 1)
    return np.concatenate(positions), np.concatenate(colors)


def _write_points(path: Path, points: F64, colors: NDArray[np.uint8]) -> None:
    header = "".join(
        f"property {kind} {name}\n"
        for kind, name in (
            *(("double", axis) for axis in "xyz"),
            *(("uchar", name) for name in ("red", "green", "blue")),
        )
    )
    table = np.empty(len(points), [("xyz", "<3f8"), ("rgb", "3u1")])
    table["xyz"], table["rgb"] = points, colors
    text = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{header}end_header\n"
    write_bytes(path, text.encode() + table.tobytes())


def _copy_images(capture: Capture, out: Path) -> None:
    (out / "images").mkdir()
    stems = flat_names(image.file for image in capture.images)
    for image in capture.images:
        write_bytes(out / "images" / stems[image.file], read_picture(capture.folder / image.file))
