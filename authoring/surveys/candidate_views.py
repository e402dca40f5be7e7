"""Candidate views of an inspection: places around a bridge, each with directions all around."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.framing import Eye
from authoring.surveys.sight import SQUARE, Sight, gather_sight, sample_pixels, visible_samples
from authoring.surveys.targets import Targets
from authoring.surveys.turning import look_along
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

HEADINGS = 8
PITCHES = (-50.0, -15.0, 15.0, 45.0)  # [deg] of each heading; straight up and down besides
_PLACES = 256  # places whose views are processed at once


@dataclass(frozen=True, eq=False)
class Candidates:
    """Views to choose from.

    Attributes:
        poses: camera_to_world [m], shape (V, 4, 4), float64.
        place: Place of each view, rising, shape (V,), int64.
        sight: Visibility in each.
    """

    poses: F64
    place: I64
    sight: Sight


def directions(heading: float, highest: float) -> F64:
    """List the rotations of the views of a place: headings all around at several pitches, straight up and down.

    Args:
        heading: First heading, counter-clockwise from +x [rad].
        highest: Highest pitch of the gimbal [rad].

    Returns:
        Camera to world, axes right, down, forward [1], shape (D, 3, 3), float64.
    """
    pitches = np.unique(np.minimum(np.radians(PITCHES), highest))
    turns = heading + np.arange(HEADINGS) * 2.0 * np.pi / HEADINGS
    looks = [[np.cos(t) * np.cos(p), np.sin(t) * np.cos(p), np.sin(p)] for p in pitches for t in turns]
    # Views straight up or down are slightly inclined, so that the gimbal records a heading.
    steep = [p for p in np.radians([89.0, -89.0]) if p <= highest]
    looks += [[np.cos(heading) * np.cos(p), np.sin(heading) * np.cos(p), np.sin(p)] for p in steep]
    return look_along(np.array(looks))


def look_round(places: F64, turns: F64, eye: Eye, targets: Targets, reach: float, obstacles: RayScene) -> Candidates:
    """Find the visible members from every place in every direction; views without members are left out.

    Args:
        places: Camera centers [m], shape (P, 3), float64.
        turns: Rotations of the views of each place, camera to world [1], shape (D, 3, 3), float64.
        eye: The camera.
        targets: Members and stretches.
        reach: Greatest distance [m].
        obstacles: Bridge and site.
    """
    samples, count = targets.samples, len(turns)
    parts = []
    widest = 1.0 / np.sqrt(1.0 + eye.widest**2)  # cosine of the angle between the axis and a corner of the picture
    for begin in range(0, len(places), _PLACES):
        owners, rows = visible_samples(places[begin : begin + _PLACES], samples, reach, obstacles)
        owners = owners + begin
        toward = places[owners] - samples.points[rows]
        distance = np.linalg.norm(toward, axis=1)
        pair, turn = np.nonzero(-toward @ turns[:, :, 2].T >= widest * distance[:, None] - 1e-9)
        local = np.einsum("ni,nij->nj", -toward[pair], turns[turn])
        framed = eye.framed_local(local)
        pair, turn, local = pair[framed], turn[framed], local[framed]
        pixels = sample_pixels(toward[pair], local[:, 2], samples, rows[pair], eye)
        square = (np.sum(toward * samples.normals[rows], axis=1) >= SQUARE * distance)[pair]
        parts.append((owners[pair] * count + turn, rows[pair], pixels, square))
    views, seen, pixels, square = (np.concatenate(column) for column in zip(*parts, strict=True))
    used, view = np.unique(views, return_inverse=True)
    sight = gather_sight(len(used), targets, (view.reshape(-1), seen, pixels, square))
    poses = np.tile(np.eye(4), (len(used), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = turns[used % count], places[used // count]
    return Candidates(poses, used // count, sight)
