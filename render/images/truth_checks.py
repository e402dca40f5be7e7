"""Checks of a truth read from files: camera, rigid poses, tables and surface."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from render.images.array_file import read_arrays
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]

SURFACE = {
    "positions": ("float32", (3,)),
    "triangles": ("uint32", (3,)),
    "part_first": ("int32", ()),
    "part_count": ("int32", ()),
    "draw_part": ("int32", ()),
    "draw_transform": ("float64", (4, 4)),
    "draw_instance": ("uint32", ()),
    "draw_label": ("uint8", ()),
}
MOST_TRIANGLES = 100_000_000  # of a surface, including copies: 7 GB of corners; a scene has some millions
_HINT = "Render the survey again"
_RIGID = 1e-5  # greatest error of a rotation's products [1]; files hold 17 digits


def check_camera(camera: Pinhole, size: tuple[int, int], where: Path) -> None:
    """Refuse invalid intrinsics.

    Args:
        camera: Exact intrinsics as read.
        size: Width and height of the photographs [px].
        where: Folder of the truth.

    Raises:
        InputError: A number that is not finite, a focal length that is not positive, or another size.
    """
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy)
    if not all(isinstance(number, float | int) and np.isfinite(number) for number in numbers):
        raise InputError("a number that is not finite", where=where, field="pinhole", value=numbers, hint=_HINT)
    if min(camera.fx, camera.fy) <= 0.0:
        raise InputError(
            "a focal length that is not positive",
            where=where,
            field="pinhole",
            value=(camera.fx, camera.fy),
            hint=_HINT,
        )
    if (camera.width, camera.height) != size:
        raise InputError(
            "not the size that cameras.json states",
            where=where,
            field="pinhole",
            value=(camera.width, camera.height),
            allowed=str(size),
            hint=_HINT,
        )


def check_poses(poses: F64, where: Path) -> None:
    """Refuse poses that are not rigid motions.

    Args:
        poses: camera_to_world [m], shape (..., 4, 4), float64.
        where: Folder of the truth.

    Raises:
        InputError: A number that is not finite, or a rotation that scales, shears or mirrors.
    """
    if not np.isfinite(poses).all():
        raise InputError("a pose that is not finite", where=where, field="poses", hint=_HINT)
    turn = poses[..., :3, :3]
    square = np.abs(turn @ np.swapaxes(turn, -1, -2) - np.eye(3)).max(initial=0.0)
    last = np.abs(poses[..., 3, :] - [0.0, 0.0, 0.0, 1.0]).max(initial=0.0)
    if max(square, last) > _RIGID or (np.linalg.det(turn) < 0.0).any():
        raise InputError("a pose that is not a rigid motion", where=where, field="poses", hint=_HINT)


def check_tables(instances: list[Any], classes: list[Any], where: Path) -> None:
    """Refuse rows with invalid numbers or names.

    Args:
        instances: JSON rows `{id, path, component, class, parameters}`.
        classes: JSON rows `{id, name, color}`.
        where: Folder of the truth.

    Raises:
        InputError: An id out of range or duplicate, an invalid name, or an invalid color.
    """
    ids = [row["id"] for row in instances]
    texts = all(isinstance(row[key], str) for row in instances for key in ("path", "component", "class"))
    facts = all(isinstance(row["parameters"], dict) for row in instances)
    if not (
        texts and facts and all(type(one) is int and 0 <= one < 2**32 for one in ids) and len(set(ids)) == len(ids)
    ):
        raise InputError("an invalid row, or a duplicate id", where=where, field="instances", hint=_HINT)
    numbers = [number for row in classes for number in (row["id"], *row["color"])]
    names = all(isinstance(row["name"], str) and row["name"].isprintable() for row in classes)
    if not (names and all(type(one) is int and 0 <= one < 256 for one in numbers)):
        raise InputError("an invalid row", where=where, field="classes", hint=_HINT)


def check_bands(bands: tuple[tuple[int, int], ...], height: int, where: Path) -> None:
    """Refuse bands of rows that do not follow each other from the first row to the last.

    Args:
        bands: First row of each band and the row after its last.
        height: Rows of an image [px].
        where: Folder of the truth.

    Raises:
        InputError: They do not.
    """
    edges = [0, *(end for _, end in bands)]
    rises = all(first < end for first, end in bands)
    if not rises or [first for first, _ in bands] != edges[:-1] or edges[-1] != height:
        raise InputError("bands that do not cover all rows", where=where, field="shutter", hint=_HINT)


def check_image(pixels: NDArray[Any], kinds: tuple[str, ...], size: tuple[int, int], where: Path) -> None:
    """Refuse an image of the truth with another type or size than required.

    Args:
        pixels: Values as decoded, shape (H, W) if valid.
        kinds: numpy names of the types allowed.
        size: Width and height [px].
        where: The file.

    Raises:
        InputError: Another type, several channels, another size; of depths, one that is not positive.
    """
    if pixels.dtype.name not in kinds or pixels.shape != size[::-1]:
        raise InputError(
            "not an image of this truth",
            where=where,
            value=f"{pixels.dtype} {pixels.shape}",
            allowed=f"{' or '.join(kinds)} {size[::-1]}",
            hint=_HINT,
        )
    if kinds == ("float32",) and not (pixels > 0).all():
        raise InputError("a depth that is not positive", where=where, hint=_HINT)


def read_surface(path: Path) -> tuple[F64, U32, U8]:
    """Read the true surface, expanded to world triangles; every index is checked first.

    Args:
        path: `surface.npz`.

    Returns:
        Corner positions [m], shape (T, 3, 3), float64; instance id per triangle, shape (T,), uint32; class id per
        triangle, shape (T,), uint8.

    Raises:
        MissingError: There is no such file.
        InputError: Damaged, or with invalid counts or indices.
    """
    stored = read_arrays(path, SURFACE)
    _check_indices(stored, path)
    parts = stored["draw_part"].astype(np.int64)
    counts = stored["part_count"].astype(np.int64)[parts]
    if int(counts.sum()) > MOST_TRIANGLES:
        raise InputError(f"draws {int(counts.sum())} triangles", where=path, allowed=str(MOST_TRIANGLES), hint=_HINT)
    draw = np.repeat(np.arange(len(parts)), counts)
    within = np.arange(len(draw)) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = stored["part_first"].astype(np.int64)[parts][draw] + within
    local = stored["positions"].astype(np.float64)[stored["triangles"].astype(np.int64)[rows]]
    corners = np.empty_like(local)
    transform = stored["draw_transform"]
    for corner in range(3):  # one corner at a time keeps the expanded matrices small
        corners[:, corner] = np.einsum("tij,tj->ti", transform[draw, :3, :3], local[:, corner])
    corners += transform[draw, None, :3, 3]
    return corners, stored["draw_instance"][draw], stored["draw_label"][draw]


def _check_indices(stored: dict[str, NDArray[Any]], path: Path) -> None:
    first, count = stored["part_first"].astype(np.int64), stored["part_count"].astype(np.int64)
    draws = {len(stored[name]) for name in SURFACE if name.startswith("draw_")}
    part, corners = stored["draw_part"], stored["triangles"]
    wrong = {
        "part_first": len(first) != len(count)
        or (first < 0).any()
        or (count < 0).any()
        or (first + count > len(corners)).any(),
        "draw_part": len(draws) != 1 or (part < 0).any() or (part >= len(first)).any(),
        "triangles": bool(len(corners)) and int(corners.max()) >= len(stored["positions"]),
        "positions": not np.isfinite(stored["positions"]).all(),
        "draw_transform": not np.isfinite(stored["draw_transform"]).all(),
    }
    for name, is_wrong in wrong.items():
        if is_wrong:
            raise InputError("values out of range", where=path, field=name, hint=_HINT)
