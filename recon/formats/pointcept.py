"""A cloud as the folders that training code for indoor scans reads: Pointcept's arrays, and S3DIS' text files."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.files import space_errors, write_json, write_text
from groundwork.slug import inside, slug
from recon.cloud import Cloud
from usd_schemas.components import UNLABELED

F64 = NDArray[np.float64]

AREA, ROOM = "Area_1", "bridge_1"  # S3DIS counts rooms in areas
_IGNORED = -1  # Pointcept's label for points that are excluded from the loss


def write_pointcept(out: Path, cloud: Cloud) -> list[str]:
    """Write one scene as Pointcept's `DefaultDataset` reads it.

    Pointcept's `coord` has single precision, so positions are relative to `origin` in scene.json. Class and instance
    are int32, -1 where there is none.

    Args:
        out: Empty folder.
        cloud: What to write.

    Returns:
        What to open.

    Raises:
        InputError: An instance id is too large for int32.
    """
    columns = cloud.columns
    origin = _origin(columns["coord"])
    if len(cloud) and columns["instance"].max() > np.iinfo(np.int32).max:
        raise InputError(
            "an instance id is too large for int32", field="instance", value=int(columns["instance"].max())
        )
    segment, instance = columns["segment"].astype(np.int32), columns["instance"].astype(np.int32)
    arrays = {
        "coord": (columns["coord"] - origin).astype(np.float32),
        "color": columns["color"],
        "normal": columns["normal"],
        "segment": np.where(segment == UNLABELED, _IGNORED, segment),
        "instance": np.where(instance == 0, _IGNORED, instance),
        "uncertainty": columns["uncertainty"],
    }
    if "intensity" in columns:
        arrays["strength"] = columns["intensity"][:, None]
    scene = out / "train" / ROOM
    scene.mkdir(parents=True)
    for name, values in arrays.items():
        with space_errors(scene):
            np.save(scene / f"{name}.npy", values)  # inside an atomic folder
    write_json(
        scene / "scene.json",
        {
            "origin": origin.tolist(),
            "source": cloud.source,
            "classes": {row.id: row.name for row in cloud.classes},
        },
    )
    return [f"train/{ROOM}"]


def write_s3dis(out: Path, cloud: Cloud) -> list[str]:
    """Write the cloud as one room of S3DIS: all points, and one file for each instance, named by its class.

    Readers of S3DIS take the class from the text before the first underscore, so underscores are removed from class
    names (`piercap_12.txt`); classes.txt lists them. Points without an instance are in one file for each class, number
    0.

    Args:
        out: Empty folder.
        cloud: What to write.

    Returns:
        What to open.
    """
    columns = cloud.columns
    origin = _origin(columns["coord"])
    rows = np.array(_lines(columns["coord"] - origin, columns["color"]), object)
    room = out / AREA / ROOM
    (room / "Annotations").mkdir(parents=True)
    write_text(room / f"{ROOM}.txt", "".join(rows))
    names = _plain_names(cloud)
    order = np.lexsort((columns["instance"], columns["segment"]))
    keys = np.column_stack([columns["segment"], columns["instance"]])[order].astype(np.int64)
    first = np.flatnonzero(np.any(np.diff(keys, axis=0, prepend=-1), axis=1))
    for begin, part in zip(first, np.split(order, first[1:]) if len(order) else [], strict=True):
        segment, instance = keys[begin]
        file = inside(room / "Annotations", f"{names[int(segment)]}_{instance}.txt")
        write_text(file, "".join(rows[part]))
    write_text(out / "classes.txt", "".join(f"{row.id} {names[row.id]} {row.name}\n" for row in cloud.classes))
    write_json(out / "origin.json", {"origin": origin.tolist()})
    return [f"{AREA}/{ROOM}"]


def _plain_names(cloud: Cloud) -> dict[int, str]:
    """Give each class in the table or of a point a unique name without underscores that is valid as a file name."""
    names = {row.id: slug(row.name.replace("_", "")).replace("_", "-") for row in cloud.classes}
    names |= {
        number: f"class{number}" for number in np.unique(cloud.columns["segment"]).tolist() if number not in names
    }
    twice = {name for name in names.values() if list(names.values()).count(name) > 1}
    return {number: f"{name}-{number}" if name in twice else name for number, name in names.items()}


def _origin(coord: F64) -> F64:
    """Choose an origin near the points, in whole meters, from which single precision resolves them."""
    return np.floor(np.median(coord, axis=0)) if len(coord) else np.zeros(3)


def _lines(points: F64, colors: NDArray[np.uint8]) -> list[str]:
    form = "%.4f %.4f %.4f %d %d %d\n"
    return [form % (*point, *color) for point, color in zip(points.tolist(), colors.tolist(), strict=True)]
