"""Runaway cameras: those that bundle adjustment moved so far away that no point determines their position."""

import numpy as np
import pycolmap

FAR = 100.0
"""Distance from the middle of all cameras from which on a camera counts as runaway, as a multiple of the distance that
three quarters of cameras and points do not exceed [1]. Real photographs and flights stay below 10; one camera of 222
was at 180,000 (4,000 km from its bridge), and so were its 144 dense points."""
_SHARE = 0.75


def runaways(model: pycolmap.Reconstruction) -> list[int]:
    """Find the runaway cameras.

    Args:
        model: A model.

    Returns:
        Ids of their images, ascending.
    """
    numbers = sorted(model.reg_image_ids())
    if not numbers:
        return []
    centers = np.array([model.image(number).projection_center() for number in numbers])
    points = np.array([point.xyz for point in model.points3D.values()]).reshape(-1, 3)
    away, reach = (np.linalg.norm(places - np.median(centers, axis=0), axis=1) for places in (centers, points))
    sizes = [float(np.quantile(distances, _SHARE, method="lower")) for distances in (away, reach) if len(distances)]
    limit = FAR * max(sizes)  # if all cameras are at one position, only the points give the size of the scene
    return [number for number, distance in zip(numbers, away, strict=True) if not distance <= limit]


def leave_out(model: pycolmap.Reconstruction, images: list[int]) -> None:
    """Remove images from a model, and the points that are then seen by too few others.

    Args:
        model: The model; changed in place.
        images: Ids of registered images.
    """
    for number in images:
        model.deregister_frame(model.image(number).frame_id)
