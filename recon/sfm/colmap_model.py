"""A COLMAP model on disk as arrays, read without COLMAP.

Source: the binary layout that COLMAP documents under "Output Format": little endian, no padding.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError, OutOfSpaceError
from groundwork.foreign_file import read_regular

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_NO_POINT = np.uint64(2**64 - 1)
_POINT2D = np.dtype([("uv", "<f8", 2), ("point", "<u8")])
_POINT3D = np.dtype([("id", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8"), ("length", "<u8")])
_LEAST_IMAGE = 73  # [bytes] id, pose, camera, an empty name, no keypoint
_TRACK_ELEMENT = 8  # [bytes] image id and keypoint number
_MODEL_NAMES = {0: "SIMPLE_PINHOLE", 1: "PINHOLE", 2: "SIMPLE_RADIAL", 3: "RADIAL", 4: "OPENCV"}
_MODEL_PARAMS = {0: 3, 1: 4, 2: 4, 3: 5, 4: 8}


@dataclass(frozen=True)
class SparseModel:
    """Cameras, points and observations of one reconstruction, in its own units.

    Attributes:
        names: File name of each registered image, in ascending order.
        poses: camera_to_world [model units] of each registered image, shape (I, 4, 4), float64.
        camera_model: Name of the camera model of all images.
        camera_params: Its parameters in COLMAP's order [px].
        points: Positions [model units], shape (P, 3), float64, in ascending order of COLMAP's point ids.
        colors: sRGB colors, shape (P, 3), uint8.
        errors: Mean reprojection error of each point [px], shape (P,), float64.
        obs_point: Row in `points` of each observation, ascending, shape (M,), int64.
        obs_image: Row in `names` of each observation, shape (M,), int64.
        obs_uv: Keypoint of each observation [px], shape (M, 2), float64, pixel centers at +0.5.
    """

    names: tuple[str, ...]
    poses: F64
    camera_model: str
    camera_params: tuple[float, ...]
    points: F64
    colors: NDArray[np.uint8]
    errors: F64
    obs_point: I64
    obs_image: I64
    obs_uv: F64


def read_model(folder: Path) -> SparseModel:
    """Read `cameras.bin`, `images.bin` and `points3D.bin`.

    Args:
        folder: A binary COLMAP model with one camera.

    Raises:
        InputError: Missing, cut off, of an unknown camera model, or with invalid numbers.
    """
    try:
        camera_model, camera_params = _read_camera(read_regular(folder / "cameras.bin"))
        names, poses, keypoints = _read_images(read_regular(folder / "images.bin"))
        table = _read_points(read_regular(folder / "points3D.bin"))
        order = np.argsort(table["id"])
        ids = table["id"][order]
        rank = sorted(range(len(names)), key=names.__getitem__)
        seen = [keypoints[row][keypoints[row]["point"] != _NO_POINT] for row in rank]
        image = np.repeat(np.arange(len(rank)), [len(block) for block in seen])
        joined = np.concatenate([*seen, np.zeros(0, _POINT2D)])
        _check_numbers(camera_params, np.array(poses), table, joined)
    except (OSError, struct.error, ValueError, IndexError, KeyError, OverflowError) as error:
        raise InputError(f"not a complete COLMAP model: {error}", where=folder, hint="Reconstruct again") from None
    point = np.searchsorted(ids, joined["point"])
    by_point = np.argsort(point, kind="stable")
    return SparseModel(
        names=tuple(names[row] for row in rank),
        poses=np.array([poses[row] for row in rank]).reshape(-1, 4, 4),
        camera_model=camera_model,
        camera_params=camera_params,
        points=table["xyz"][order],
        colors=table["rgb"][order],
        errors=table["error"][order],
        obs_point=point[by_point].astype(np.int64),
        obs_image=image[by_point],
        obs_uv=joined["uv"][by_point],
    )


def _check_numbers(
    params: tuple[float, ...], poses: F64, points: NDArray[np.void], keypoints: NDArray[np.void]
) -> None:
    """Refuse numbers that are not finite, and keypoints that refer to a missing point."""
    for name, values in (
        ("camera", np.array(params)),
        ("pose", poses),
        ("point", points["xyz"]),
        ("keypoint", keypoints["uv"]),
    ):
        if not np.isfinite(values).all():
            raise ValueError(f"a {name} is not finite")
    if not np.isin(keypoints["point"], points["id"]).all():
        raise ValueError("a keypoint belongs to a point that does not exist")


def rotation_from_quaternion(quaternion: F64) -> F64:
    """Turn a unit quaternion into a rotation matrix.

    Args:
        quaternion: w, x, y, z [1], shape (4,), float64.

    Returns:
        Rotation [1], shape (3, 3), float64.
    """
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _read_camera(data: bytes) -> tuple[str, tuple[float, ...]]:
    _, _, model, _, _ = struct.unpack_from("<QIiQQ", data)
    return _MODEL_NAMES[model], struct.unpack_from(f"<{_MODEL_PARAMS[model]}d", data, struct.calcsize("<QIiQQ"))


def _read_images(data: bytes) -> tuple[list[str], list[F64], list[NDArray[np.void]]]:
    names, poses, keypoints = [], [], []
    (count,), at = struct.unpack_from("<Q", data), 8
    for _ in range(_no_more(count, data, _LEAST_IMAGE)):
        quaternion, shift = np.frombuffer(data, "<f8", 4, at + 4), np.frombuffer(data, "<f8", 3, at + 36)
        end = data.index(b"\0", at + 64)
        names.append(data[at + 64 : end].decode())
        (length,) = struct.unpack_from("<Q", data, end + 1)
        keypoints.append(np.frombuffer(data, _POINT2D, length, end + 9))
        at = end + 9 + length * _POINT2D.itemsize
        pose = np.eye(4)
        pose[:3, :3] = rotation_from_quaternion(quaternion).T
        pose[:3, 3] = -pose[:3, :3] @ shift
        poses.append(pose)
    return names, poses, keypoints


def _no_more(count: int, data: bytes, least: int) -> int:
    """Refuse a count that is too large for the file's length."""
    if count * least > len(data):
        raise ValueError(f"{count} rows in {len(data)} bytes")
    return count


def _read_points(data: bytes) -> NDArray[np.void]:
    """Read the fixed part of every point; the track behind it is skipped to find the next point."""
    (count,), at = struct.unpack_from("<Q", data), 8
    starts = np.empty(_no_more(count, data, _POINT3D.itemsize), np.int64)
    length_at = _POINT3D.fields["length"][1] if _POINT3D.fields else 0
    for row in range(count):
        starts[row] = at
        at += _POINT3D.itemsize + _TRACK_ELEMENT * struct.unpack_from("<Q", data, at + length_at)[0]
    if at != len(data):
        raise ValueError("the length of points3D.bin does not fit its tracks")
    raw = np.frombuffer(data, np.uint8)
    fixed = raw[starts[:, None] + np.arange(_POINT3D.itemsize)]
    return np.ascontiguousarray(fixed).view(_POINT3D).reshape(count)


def check_whole(model: Path) -> None:
    """Read a model back to check it: COLMAP's writers report no error when the disk is full.

    Args:
        model: Folder that COLMAP wrote.

    Raises:
        OutOfSpaceError: It is incomplete.
    """
    try:
        read_model(model)
    except InputError:
        raise OutOfSpaceError(
            f"{model.parent}: no space left on the disk. Free some space, then run the same command again"
        ) from None
