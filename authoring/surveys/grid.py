"""Grid survey: rows along a bridge's sides and over its deck, at one distance and perpendicular to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.box import OrientedBox, oriented_box
from authoring.surveys.camera_models import calibration, camera_models
from authoring.surveys.framing import Eye, eye_of
from authoring.surveys.settings import GridSettings
from authoring.surveys.subject import Subject
from authoring.surveys.turning import look_along
from authoring.surveys.way import equal_steps
from groundwork.errors import InputError
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]

DECIMALS = 4  # positions are rounded to it [m], so that every CPU places the same cameras
USUAL_DISTANCE = 10.0  # [m] from the bridge where no ground sampling distance is set
COLUMNS, ROWS = 24, 18  # rays that test whether an image shows the bridge
TILT = np.radians(-90.0 + 1.0)  # over the deck: straight down, except for 1 degree that defines the heading


@dataclass(frozen=True)
class _Face:
    """A side of the box with rows of images.

    Attributes:
        rows: Position of each row across the face [m], shape (R,), float64.
        offset: Position of the face along its own axis [m].
        axis: Number of that axis of the box: 1 for a side, 2 for the deck.
        inward: Viewing direction of the cameras, in the box's axes, shape (3,), float64.
    """

    rows: F64
    offset: float
    axis: int
    inward: F64


def fly_grid(settings: GridSettings, subject: Subject, rng: np.random.Generator) -> F64:
    """Plan the rows.

    Args:
        settings: Settings of the scenario.
        subject: Bridge and site.
        rng: Not used: a grid has no random values.

    Returns:
        camera_to_world of each image [m], shape (N, 4, 4), float64.

    Raises:
        InputError: The sampling distance needs a camera closer than is safe, or no part of the grid is free.
    """
    del rng
    model = camera_models()[settings.camera]
    camera = calibration(model, settings.width, settings.height)
    sampling = settings.sampling if settings.sampling is not None else USUAL_DISTANCE / camera.fx
    distance = sampling * camera.fx
    if distance < settings.safety:
        raise InputError(
            f"puts the cameras {distance:.2f} m from the bridge, too near",
            field="survey.sampling",
            value=sampling,
            allowed=f"at least {settings.safety / camera.fx:.4f} m for a safety of {settings.safety:g} m",
            hint="Raise it, lower survey.safety, or choose larger images with survey.width",
        )
    box = oriented_box(subject.bridge.reshape(-1, 3))
    positions, looks = [], []
    for number, face in enumerate(_faces(settings, camera, box, sampling)):
        for row, across in enumerate(face.rows[:: 1 if number % 2 == 0 else -1]):
            line = _row(settings, camera, box, face, sampling, float(across))
            line = line if row % 2 == 0 else line[::-1]
            spots = np.round(box.to_world(line), DECIMALS)
            spots = spots[_is_free(spots, subject, settings)]
            positions.append(spots)
            looks.append(np.tile(face.inward @ box.axes, (len(spots), 1)))
    places = np.concatenate(positions)
    if len(places) < 2:
        middle = box.to_world(np.array([[0.0, -box.half[1] - distance, 0.0], [0.0, box.half[1] + distance, 0.0]]))
        row = int(subject.obstacles.distance(middle)[1][int(np.argmin(subject.clearance(middle)))])
        raise InputError(
            f"no row of the grid is free: the instance {subject.obstacle_ids[row]} is in the way",
            field="survey.sampling",
            value=sampling,
            hint="Raise it, or lower survey.safety and survey.over_ground",
        )
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = look_along(np.concatenate(looks)), places
    shares = _bridge_share(poses, eye_of(camera, model.distortion), subject)
    taken = shares >= settings.least_bridge
    if taken.sum() < 2:
        raise InputError(
            "no image of the grid shows enough of the bridge",
            field="survey.least_bridge",
            value=settings.least_bridge,
            allowed=f"at most {float(np.sort(shares)[-2]):.3f} here",
            hint="Lower it, or survey.sampling",
        )
    return poses[taken]


def _bridge_share(poses: F64, eye: Eye, subject: Subject) -> F64:
    """Find the share of each image covered by the bridge [1], shape (N,), float64."""
    x, y = (np.arange(COLUMNS) + 0.5) / COLUMNS, (np.arange(ROWS) + 0.5) / ROWS
    pixels = np.stack(np.meshgrid(x * eye.camera.width, y * eye.camera.height), axis=-1).reshape(-1, 2)
    rays = eye.rays(pixels)
    bridge = np.unique(subject.bridge_ids)
    shares = np.zeros(len(poses))
    for row, pose in enumerate(poses):
        directions = rays @ pose[:3, :3].T
        _, _, hit = subject.obstacles.cast(np.broadcast_to(pose[:3, 3], directions.shape), directions)
        shares[row] = np.isin(hit, bridge).mean()
    return shares


def _faces(settings: GridSettings, camera: Pinhole, box: OrientedBox, sampling: float) -> list[_Face]:
    """List the two long sides, the deck, and the rows in between that connect them in one reconstruction."""
    between, distance = (1.0 - settings.side_overlap) * sampling, sampling * camera.fx
    heights = _spread(-box.half[2], box.half[2], between * camera.height)
    side = box.half[1] + distance
    faces = [
        _Face(heights, -side, 1, np.array([0.0, 1.0, 0.0])),
        _Face(heights, side, 1, np.array([0.0, -1.0, 0.0])),
    ]
    turns = np.linspace(0.0, 0.5 * np.pi, settings.oblique + 2)[1:-1] if settings.deck else np.zeros(0)
    for turn in turns:
        across, up = float(np.cos(turn)), float(np.sin(turn))
        height = np.array([box.half[2] + distance * up])
        faces += [
            _Face(height, sign * (box.half[1] + distance * across), 1, np.array([0.0, -sign * across, -up]))
            for sign in (-1.0, 1.0)
        ]
    if settings.deck:
        down = np.array([np.cos(TILT), 0.0, np.sin(TILT)])
        faces.append(_Face(_spread(-box.half[1], box.half[1], between * camera.width), box.half[2] + distance, 2, down))
    return faces


def _row(settings: GridSettings, camera: Pinhole, box: OrientedBox, face: _Face, sampling: float, across: float) -> F64:
    """Place the images of a row, in the box's axes [m], shape (N, 3), float64."""
    # Over the deck the image's upright runs along the row: cameras look straight down, their tops forward.
    pixels = camera.width if face.axis == 1 else camera.height
    step = pixels * sampling * (1.0 - settings.overlap)
    ends = np.zeros((2, 3))
    ends[:, 0] = (-box.half[0], box.half[0])
    ends[:, face.axis] = face.offset
    ends[:, 3 - face.axis] = across
    return equal_steps(ends, step)


def _spread(low: float, high: float, step: float) -> F64:
    """Distribute rows evenly, at most a step apart."""
    count = max(1, int(np.ceil((high - low) / step)))
    return low + (np.arange(count) + 0.5) * (high - low) / count


def _is_free(spots: F64, subject: Subject, settings: GridSettings) -> NDArray[np.bool_]:
    high = spots[:, 2] > subject.ground_height(spots[:, :2]) + settings.over_ground
    return high & (np.round(subject.clearance(spots), 2) > settings.safety)
