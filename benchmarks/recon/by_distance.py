"""How far each point is from the camera that saw it from nearest, and how true the clouds are at each distance."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.files import read_json
from recon.cloud import Cloud

Bools = NDArray[np.bool_]
F64 = NDArray[np.float64]

BOUNDS = (0.0, 5.0, 10.0, 20.0, 30.0, 45.0, 70.0, np.inf)  # [m]


def nearest_camera(folder: Path, cloud: Cloud) -> F64:
    """Measure the distance of each point to the nearest of the cameras that saw it.

    Args:
        folder: Folder of the cloud.
        cloud: What is in it: a reconstruction, with one observation of each point or more.

    Returns:
        Distances [m], shape (N,), float64.
    """
    rows = {str(camera["name"]): number for number, camera in enumerate(cloud.cameras)}
    places = np.full((len(rows), 3), np.nan)
    for pose in read_json(folder / "cameras_sfm.json")["poses"]:
        places[rows[str(pose["name"])]] = np.array(pose["camera_to_world"])[:3, 3]
    start = cloud.observations["start"]
    points = np.repeat(cloud.columns["coord"].astype(np.float64), np.diff(start), axis=0)
    distances = np.linalg.norm(points - places[cloud.observations["image"]], axis=1)
    return np.fmin.reduceat(distances, start[:-1])


def distance_lines(clouds: Sequence[tuple[F64, Bools, Bools]]) -> list[str]:
    """Write a line for each range of distances: of all clouds of one mode.

    Args:
        clouds: For each cloud the distances of its points [m], shape (N,), float64; whether each is near the true
            surface; and whether it has the class of that surface, too, both of shape (N,).
    """
    lines = []
    for low, high in pairwise(BOUNDS):
        inside = [(distances >= low) & (distances < high) for distances, _, _ in clouds]
        points = sum(int(each.sum()) for each in inside)
        if not points:
            continue
        near = sum(int((each & close).sum()) for each, (_, close, _) in zip(inside, clouds, strict=True))
        right = sum(int((each & same).sum()) for each, (_, _, same) in zip(inside, clouds, strict=True))
        reach = f"{low:g} to {high:g} m" if np.isfinite(high) else f"more than {low:g} m"
        lines.append(f"| {reach} | {points:,} | {near / points:.1%} | {right / near if near else 0:.1%} |")
    return lines
