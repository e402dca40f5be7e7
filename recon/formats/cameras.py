"""Export the cameras of a reconstruction: a COLMAP model in meters, and a nerfstudio data set."""

import struct
from pathlib import Path
from typing import Any

from groundwork.errors import InputError, MissingError
from groundwork.files import write_bytes, write_json
from groundwork.foreign_file import is_regular, read_picture, read_regular
from groundwork.slug import flat_names
from recon.cloud import SFM_DENSE, Cloud
from recon.formats.ply import write_colored_points
from recon.sfm.colmap_model import read_model
from usd_schemas.pinhole import USD_FROM_CAMERA

SPARSE = "sparse"
_HEAD = struct.Struct("<I7dI")  # image id, rotation, shift, camera id; the name follows
_KEYPOINT = 24  # [bytes] position and point id


def write_colmap(source: Path, cloud: Cloud, out: Path, photographs: Path | None) -> list[str]:
    """Write the sparse model in the frame of the cloud as COLMAP's `sparse/0`, and a dense cloud as `fused.ply`.

    Args:
        source: Folder of a reconstructed cloud.
        cloud: What it holds.
        out: Empty folder.
        photographs: Capture from which the photographs are copied, or None.

    Returns:
        What to open.

    Raises:
        InputError: The cloud was not reconstructed from photographs.
    """
    model = _model_of(source, cloud)
    (out / SPARSE / "0").mkdir(parents=True)
    for name in ("cameras.bin", "points3D.bin"):
        write_bytes(out / SPARSE / "0" / name, read_regular(model / name))
    names = read_model(model).names
    write_bytes(out / SPARSE / "0" / "images.bin", _renamed(read_regular(model / "images.bin"), flat_names(names)))
    _copy_photographs(photographs, names, out)
    if cloud.source != SFM_DENSE:
        return [f"{SPARSE}/0"]
    write_colored_points(out / "fused.ply", cloud)
    return [f"{SPARSE}/0", "fused.ply"]


def write_nerfstudio(source: Path, cloud: Cloud, out: Path, photographs: Path | None) -> list[str]:
    """Write the reconstructed cameras as `transforms.json`, axes right, up, backward, with the cloud beside it.

    Args:
        source: Folder of a reconstructed cloud.
        cloud: What it holds.
        out: Empty folder.
        photographs: Capture from which the photographs are copied, or None.

    Returns:
        What to open.

    Raises:
        InputError: The cloud was not reconstructed from photographs, or with a camera that nerfstudio does not know.
    """
    folder = _model_of(source, cloud)
    model = read_model(folder)
    _, _, _, width, height = struct.unpack_from("<QIiQQ", read_regular(folder / "cameras.bin"))
    write_colored_points(out / "sparse_pc.ply", cloud)
    stems = flat_names(model.names)
    write_json(
        out / "transforms.json",
        {
            "camera_model": "OPENCV",
            "w": width,
            "h": height,
            **_intrinsics(model.camera_model, model.camera_params),
            "ply_file_path": "sparse_pc.ply",
            "frames": [
                {"file_path": f"images/{stems[name]}", "transform_matrix": (pose @ USD_FROM_CAMERA).tolist()}
                for name, pose in zip(model.names, model.poses, strict=True)
            ],
        },
    )
    _copy_photographs(photographs, model.names, out)
    return ["transforms.json"]


def _model_of(source: Path, cloud: Cloud) -> Path:
    if not (source / SPARSE).is_dir():
        raise InputError(
            f"a cloud from {cloud.source} has no cameras",
            where=source,
            allowed="a reconstructed cloud",
            hint="Export it to laz, las, ply, pointcept, s3dis or hdf5",
        )
    return source / SPARSE


def _intrinsics(model: str, params: tuple[float, ...]) -> dict[str, Any]:
    """Convert the parameters of a COLMAP camera to nerfstudio's names."""
    names = {
        "SIMPLE_PINHOLE": ("f", "cx", "cy"),
        "PINHOLE": ("fl_x", "fl_y", "cx", "cy"),
        "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
        "RADIAL": ("f", "cx", "cy", "k1", "k2"),
        "OPENCV": ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2"),
    }
    if model not in names:
        raise InputError("a camera model that nerfstudio does not have", value=model, allowed=", ".join(names))
    found = dict(zip(names[model], params, strict=True))
    if "f" in found:
        found["fl_x"] = found["fl_y"] = found.pop("f")
    return {name: found.get(name, 0.0) for name in names["OPENCV"]}


def _renamed(data: bytes, stems: dict[str, str]) -> bytes:
    """Rename the images of a COLMAP model to their names in the folder `images`."""
    (count,), at = struct.unpack_from("<Q", data), 8
    parts = [data[:8]]
    for _ in range(count):
        end = data.index(b"\0", at + _HEAD.size)
        name = stems[data[at + _HEAD.size : end].decode()]
        (keypoints,) = struct.unpack_from("<Q", data, end + 1)
        after = end + 9 + keypoints * _KEYPOINT
        parts += [data[at : at + _HEAD.size], name.encode(), data[end:after]]
        at = after
    return b"".join(parts)


def _copy_photographs(photographs: Path | None, names: tuple[str, ...], out: Path) -> None:
    if photographs is None:
        return
    (out / "images").mkdir()
    stems = flat_names(names)
    for name in names:
        file = photographs / name
        if Path(name).is_absolute() or ".." in Path(name).parts or not is_regular(file):
            raise MissingError(
                "a photograph of the cloud is missing", where=file, hint="Name the capture that the cloud was made from"
            )
        write_bytes(out / "images" / stems[name], read_picture(file))
