"""Coverage and quality of a flight, by ray casting before anything is rendered."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.framing import Eye
from authoring.surveys.linked import linked_share
from authoring.surveys.sight import sample_pixels
from authoring.surveys.surface_samples import SurfaceSamples, sample_surfaces
from authoring.surveys.turning import pitch_of
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

ENOUGH_VIEWS = 3
WIDEST_INCIDENCE = 60.0  # [deg] between a surface's normal and the line to the camera
ENOUGH_PIXELS = 50.0  # [px] area of a member from which on an image counts as a view of it
TOUCH = 0.01  # [m] distance before its target sample at which a ray may end
PITCH_EDGES = tuple(range(-90, 91, 15))  # [deg]


@dataclass(frozen=True)
class FlightScore:
    """Coverage and quality of a flight.

    Attributes:
        images: Number of images.
        length: Length of the flight [m].
        duration: Flight time [s]; 0 when the stage has no times.
        clearance: Least distance of a camera to bridge and site [m].
        overlap: Mean share of an image's surfaces that the next one sees as well [1].
        linked: Predicted share of the images that a reconstruction registers [1].
        sampling: Median and 95th percentile of the ground-sampling distance [m].
        base_angle: Median of the widest angle between two views of a point [deg].
        covered: Instance id to the share of its surface that enough cameras see at 60 degrees or less from the normal
            [1].
        pitches: Number of images in each 15 degrees of pitch, from -90 on.
        member_views: Instance id to the number of images in which it covers enough pixels.
    """

    images: int
    length: float
    duration: float
    clearance: float
    overlap: float
    linked: float
    sampling: tuple[float, float]
    base_angle: float
    covered: dict[int, float] = field(default_factory=dict)
    pitches: tuple[int, ...] = ()
    member_views: dict[int, int] = field(default_factory=dict)


def score_flight(
    poses: F64, eye: Eye, duration: float, bridge: tuple[F64, NDArray[np.integer]], obstacles: RayScene
) -> FlightScore:
    """Compute the score of a flight.

    Args:
        poses: camera_to_world in the order of flight [m], shape (N, 4, 4), float64.
        eye: The camera.
        duration: Flight time [s].
        bridge: Corners of the bridge's triangles [m], shape (T, 3, 3), float64, and their instance ids, shape (T,).
        obstacles: Bridge and site.
    """
    samples = sample_surfaces(*bridge)
    views = _views(poses, eye, samples, obstacles)
    enough = views.count >= ENOUGH_VIEWS
    shares = np.bincount(samples.component, enough) / np.bincount(samples.component)
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    overlap, linked = linked_share(poses, eye, obstacles)
    distances = views.nearest[np.isfinite(views.nearest)] / eye.camera.fx
    sampling = np.percentile(distances, [50.0, 95.0]) if len(distances) else np.full(2, np.inf)
    pitch = np.degrees(pitch_of(poses[:, :3, :3]))
    return FlightScore(
        images=len(poses),
        length=float(steps.sum()),
        duration=duration,
        clearance=float(obstacles.distance(poses[:, :3, 3])[0].min()),
        overlap=overlap,
        linked=linked,
        sampling=(float(sampling[0]), float(sampling[1])),
        base_angle=float(np.median(views.angle[views.count >= 2])) if (views.count >= 2).any() else 0.0,
        covered={int(number): float(share) for number, share in zip(samples.ids, shares, strict=True)},
        pitches=tuple(int(count) for count in np.histogram(pitch, PITCH_EDGES)[0]),
        member_views={int(number): int(count) for number, count in zip(samples.ids, views.members, strict=True)},
    )


def member_views(poses: F64, eye: Eye, bridge: tuple[F64, NDArray[np.integer]], obstacles: RayScene) -> dict[int, int]:
    """Count the images in which each member covers enough pixels.

    Args:
        poses: camera_to_world in the order of flight [m], shape (N, 4, 4), float64.
        eye: The camera.
        bridge: Corners of the bridge's triangles [m], shape (T, 3, 3), float64, and their instance ids, shape (T,).
        obstacles: Bridge and site.

    Returns:
        Instance id to number of images.
    """
    samples = sample_surfaces(*bridge)
    views = _views(poses, eye, samples, obstacles)
    return {int(number): int(count) for number, count in zip(samples.ids, views.members, strict=True)}


@dataclass(frozen=True, eq=False)
class _Views:
    """Visibility of samples.

    Attributes:
        count: Number of cameras that see each sample at 60 degrees or less from its normal, shape (N,), int64.
        nearest: Least depth at which one does [m], shape (N,), float64; +inf for none.
        angle: Widest angle between the first view of a sample and any other [deg], shape (N,), float64.
        members: Number of cameras in which each component covers enough pixels, shape (K,), int64.
    """

    count: I64
    nearest: F64
    angle: F64
    members: I64


def _views(poses: F64, eye: Eye, samples: SurfaceSamples, obstacles: RayScene) -> _Views:
    size = len(samples.points)
    count, nearest, angle = np.zeros(size, np.int64), np.full(size, np.inf), np.zeros(size)
    first, members = np.zeros((size, 3)), np.zeros(len(samples.ids), np.int64)
    for pose in poses:
        rows, square = seen_rows(pose, eye, samples, obstacles)
        toward = pose[:3, 3] - samples.points[rows]
        pixels = sample_pixels(toward, -toward @ pose[:3, 2], samples, rows, eye)
        members += np.bincount(samples.component[rows], pixels, minlength=len(members)) >= ENOUGH_PIXELS
        rows, toward = rows[square], toward[square]
        unit = toward / np.linalg.norm(toward, axis=1, keepdims=True)
        fresh = count[rows] == 0
        first[rows[fresh]] = unit[fresh]
        cosine = np.clip(np.sum(first[rows] * unit, axis=1), -1.0, 1.0)
        angle[rows] = np.maximum(angle[rows], np.degrees(np.arccos(cosine)))
        nearest[rows] = np.minimum(nearest[rows], -toward @ pose[:3, 2])
        count[rows] += 1
    return _Views(count, nearest, angle, members)


def seen_rows(pose: F64, eye: Eye, samples: SurfaceSamples, obstacles: RayScene) -> tuple[I64, NDArray[np.bool_]]:
    """Find the samples that a camera sees: inside the image, not from behind, and not occluded.

    Args:
        pose: camera_to_world [m], shape (4, 4), float64.
        eye: The camera.
        samples: Samples of surfaces.
        obstacles: Bridge and site.

    Returns:
        Rows of the samples, shape (M,), int64, and whether each is seen at 60 degrees or less from its normal, shape
        (M,), bool.
    """
    toward = pose[:3, 3] - samples.points
    distance = np.linalg.norm(toward, axis=1)
    facing = np.sum(toward * samples.normals, axis=1)
    square = facing >= np.cos(np.radians(WIDEST_INCIDENCE)) * distance
    rows = np.flatnonzero(facing > 0.0)
    rows = rows[eye.framed(samples.points[rows], pose)]
    reach, _, _ = obstacles.cast(np.broadcast_to(pose[:3, 3], (len(rows), 3)), -toward[rows])
    rows = rows[reach >= 1.0 - TOUCH / distance[rows]]
    return rows, square[rows]
