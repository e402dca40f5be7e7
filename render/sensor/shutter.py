"""Rolling shutter: rows are read out one after the other while the drone moves.

The rows are divided into bands; photograph and truth of each band are rendered from the camera pose at the read-out of
the band's middle. The pose of the image is that of its middle row.
"""

import numpy as np
from numpy.typing import NDArray

from render.capture import Readout
from render.settings import SensorSettings
from usd_schemas.flat_scene import CameraTrack

F64 = NDArray[np.float64]

_FASTEST = 5.0  # [m/s] between strips of a survey the positions jump, but no inspection flight is faster than this
_STREAM = 0x73687574  # the shutter's own random stream beside the sensor's


def read_out(track: CameraTrack, height: int, settings: SensorSettings, seed: int) -> Readout | None:
    """Compute the camera poses during the read-out of each image: motion of the flight, gusts and gimbal vibration.

    Args:
        track: Camera and poses.
        height: Image height [px].
        settings: Number of bands, and the camera's vibration.
        seed: Seed of the survey's sensor.

    Returns:
        None for a global shutter.
    """
    if not (settings.rolling_shutter and track.readout_time > 0):
        return None
    from scipy.spatial.transform import Rotation  # takes memory that a global shutter does not need

    count = min(settings.shutter_bands, height)
    edges = np.linspace(0, height, count + 1).round().astype(int)
    bands = tuple(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
    middle = np.array([(first + end) / 2 / height - 0.5 for first, end in bands]) * track.readout_time
    velocity = flight_velocity(track)
    poses = np.repeat(track.poses[:, None], count, axis=1)
    for row in range(len(poses)):
        rng = np.random.default_rng(np.random.SeedSequence([seed, _STREAM, row]))
        drift = velocity[row] + rng.standard_normal(3) * settings.tremble_speed
        spin = rng.standard_normal(3) * np.deg2rad(settings.tremble_rate)
        turns = Rotation.from_rotvec(middle[:, None] * spin).as_matrix()
        poses[row, :, :3, :3] = turns @ track.poses[row, :3, :3]
        poses[row, :, :3, 3] += middle[:, None] * drift
    return Readout(bands, poses, track.readout_time)


def flight_velocity(track: CameraTrack) -> F64:
    """Compute the velocity at each image from the images before and after it.

    Args:
        track: Camera and poses; without capture times it hovers.

    Returns:
        Velocities [m/s], shape (N, 3), float64, none faster than an inspection flight.
    """
    centers = track.poses[:, :3, 3]
    times = track.facts.get("capture_times")
    if not isinstance(times, list | tuple) or len(times) != len(centers) or len(centers) < 2:
        return np.zeros((len(centers), 3))
    rows = np.arange(len(centers))
    after, before = np.minimum(rows + 1, len(rows) - 1), np.maximum(rows - 1, 0)
    seconds = np.asarray(times, np.float64)
    gap = np.maximum(seconds[after] - seconds[before], 1e-3)
    velocity = (centers[after] - centers[before]) / gap[:, None]
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    return velocity * np.minimum(1.0, _FASTEST / np.maximum(speed, 1e-9))
