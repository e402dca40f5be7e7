"""Writing of captures; `render.capture` reads them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.files import space_errors, write_json
from render.capture import CAMERAS, FORMAT, FORMAT_VERSION, TRUTH, CamerasFile, Capture, Readout
from render.images import image_files
from render.images.depth_tiff import encode_depth_tiff
from usd_schemas.flat_scene import CameraTrack, FlatScene, without_mostly_transparent
from usd_schemas.pinhole import Pinhole

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]


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


def make_folders(folder: Path, *, normals: bool = False) -> None:
    """Make the sub-folders of a capture.

    Args:
        folder: An existing folder.
        normals: Whether it will hold normals.
    """
    kinds = ("depth", "semantic", "instance", *(("normal",) if normals else ()))
    for name in ("images", *(f"{TRUTH}/{kind}" for kind in kinds)):
        (folder / name).mkdir(parents=True, exist_ok=True)


def write_cameras(capture: Capture) -> None:
    """Write `cameras.json`.

    Args:
        capture: The capture to write into its folder.
    """
    stored = CamerasFile(
        format=FORMAT,
        format_version=FORMAT_VERSION,
        survey=capture.survey,
        size=capture.size,
        prior=capture.prior,
        gps_sigma=capture.gps_sigma,
        facts=capture.facts,
        images=capture.images,
    )
    write_json(capture.folder / CAMERAS, stored)


def encode_frame_truth(name: str, frame: FrameTruth, *, wide_ids: bool) -> dict[str, bytes]:
    """Encode the exact images of one frame, all lossless except the normals.

    Args:
        name: Name of the image.
        frame: Its exact images.
        wide_ids: Whether any instance id of the scene is above 65,535: one kind of file for all its images.

    Returns:
        Path from the capture's folder to content.
    """
    if wide_ids:
        ids = {f"{TRUTH}/instance/{name}.tiff": image_files.encode_wide_ids(frame.instance)}
    else:
        ids = {f"{TRUTH}/instance/{name}.png": image_files.encode_png(frame.instance.astype(np.uint16))}
    files = {
        f"{TRUTH}/depth/{name}.tiff": encode_depth_tiff(frame.depth),
        f"{TRUTH}/semantic/{name}.png": image_files.encode_png(frame.semantic),
        **ids,
    }
    if frame.normal is not None:
        coded = np.rint((frame.normal + 1.0) * 127.5).astype(np.uint8)
        files[f"{TRUTH}/normal/{name}.png"] = image_files.encode_png(coded)
    return files


def write_truth(
    folder: Path,
    camera: Pinhole,
    track: CameraTrack,
    scene: FlatScene,
    readout: Readout | None = None,
) -> None:
    """Write the exact camera, the poses, the tables and the surface.

    Args:
        folder: The capture's folder.
        camera: Exact intrinsics.
        track: Name of each image, pose of its middle row, distortion of the lens.
        scene: Scene that was rendered.
        readout: When the rows were read out; None for a global shutter.
    """
    truth = folder / TRUTH
    rows: list[dict[str, Any]] = [
        {"name": name, "camera_to_world": pose.tolist()}
        for name, pose in zip(track.image_names, track.poses, strict=True)
    ]
    stored: dict[str, Any] = {"pinhole": vars(camera), "poses": rows}
    if not track.distortion.is_identity:
        stored["distortion"] = vars(track.distortion)
    if readout is not None:
        stored["shutter"] = {"readout_time": readout.readout_time, "bands": readout.bands}
        for row, bands in zip(rows, readout.poses, strict=True):
            row["bands"] = bands.tolist()
    write_json(truth / "poses.json", stored)
    instances = [
        {
            "id": row.id,
            "path": row.path,
            "component": row.component,
            "class": row.class_name,
            "parameters": row.parameters,
            **({"moves": True} if row.moves else {}),
        }
        for row in scene.instances
    ]
    classes = [{"id": row.id, "name": row.name, "color": row.color} for row in scene.classes]
    write_json(truth / "instances.json", {"classes": classes, "instances": instances})
    _write_surface(truth / "surface.npz", scene)


def _write_surface(path: Path, scene: FlatScene) -> None:
    geometry, draws = scene.geometry, without_mostly_transparent(scene).draws
    arrays = {
        "positions": geometry.positions,
        "triangles": geometry.triangles,
        "part_first": geometry.part_first,
        "part_count": geometry.part_count,
        "draw_part": draws.part,
        "draw_transform": draws.transform,
        "draw_instance": draws.instance,
        "draw_label": draws.label,
    }
    with space_errors(path):
        np.savez_compressed(path, **arrays)  # inside an atomic folder
