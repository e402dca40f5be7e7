"""Kinds of survey by name: settings and planning function."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from authoring.streams import stream
from authoring.surveys.attitude import measured_attitude
from authoring.surveys.camera_models import calibration, camera_models
from authoring.surveys.gps import GpsNoise, measured_positions
from authoring.surveys.grid import fly_grid
from authoring.surveys.inspection import fly_inspection
from authoring.surveys.local import fly_local
from authoring.surveys.mix import fly_mix
from authoring.surveys.path import CameraPath, Flown
from authoring.surveys.settings import (
    AnySurvey,
    CameraSettings,
    GlobalSettings,
    GridSettings,
    InspectionSettings,
    LocalSettings,
    MixSettings,
    StageSettings,
)
from authoring.surveys.subject import Subject
from authoring.surveys.whole import fly_whole
from groundwork.errors import InputError

F64 = NDArray[np.float64]

FRAME_TIME = 1.0 / 24.0  # [s] that passes at least between two images, also for a camera that only turns


@dataclass(frozen=True)
class Survey:
    """A kind of survey.

    Attributes:
        settings: Settings that it understands.
        fly: Returns camera_to_world of every image in the order of flight [m], shape (N, 4, 4), float64.
    """

    settings: type[CameraSettings]
    fly: Callable[..., F64]


_KINDS: dict[str, Survey] = {
    "global": Survey(GlobalSettings, fly_whole),
    "local": Survey(LocalSettings, fly_local),
    "grid": Survey(GridSettings, fly_grid),
    "inspection": Survey(InspectionSettings, fly_inspection),
}
_MIX = partial(fly_mix, kinds={name: kind.fly for name, kind in _KINDS.items()})
SURVEYS: dict[str, Survey] = {**_KINDS, "mix": Survey(MixSettings, _MIX)}


def plan_survey(settings: AnySurvey, subject: Subject, seed: int) -> CameraPath:
    """Plan one survey and simulate the drone's records.

    Args:
        settings: Its settings.
        subject: Bridge and site.
        seed: Seed of the scene.

    Returns:
        Cameras, times, measured positions and attitudes.

    Raises:
        InputError: The flight is not possible; the error states the obstacle.
    """
    if isinstance(settings, StageSettings):
        raise InputError(
            "needs a camera of an existing stage",
            field="survey.kind",
            value=settings.kind,
            allowed=", ".join(SURVEYS),
            hint="Author the scene without it, then run: falsework survey plan SCENE --kind stage",
        )
    poses = SURVEYS[settings.kind].fly(settings, subject, stream(seed, f"survey/{settings.id}"))
    model = camera_models()[settings.camera]
    camera = calibration(model, settings.width, settings.height)
    flown = Flown(poses, camera, model.sensor_width, model.distortion, model.readout_time, model.make, model.model)
    return record_flight(settings, flown, seed)


def record_flight(settings: AnySurvey, flown: Flown, seed: int) -> CameraPath:
    """Simulate the records of a drone: times at its speed, and positions and attitudes with noise.

    Args:
        settings: Settings of the survey.
        flown: Poses and model of its camera.
        seed: Seed of the scene.
    """
    positions = flown.poses[:, :3, 3]
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    times = np.concatenate([[0.0], np.cumsum(np.maximum(steps / settings.speed, FRAME_TIME))])
    noise = GpsNoise(settings.gps_sigma, settings.gps_drift, settings.gps_altitude)
    return CameraPath(
        id=settings.id,
        kind=settings.kind,
        seed=seed,
        calibration=flown.calibration,
        sensor_width=flown.sensor_width,
        spacing=float(steps.mean()) if len(steps) else 0.0,
        poses=flown.poses,
        times=times,
        gps=measured_positions(positions, times, noise, stream(seed, f"gps/{settings.id}")),
        gps_sigma=settings.gps_sigma,
        attitude=measured_attitude(
            flown.poses[:, :3, :3], settings.attitude_sigma, stream(seed, f"attitude/{settings.id}")
        ),
        attitude_sigma=settings.attitude_sigma,
        distortion=flown.distortion,
        readout_time=flown.readout_time,
        make=flown.make,
        model=flown.model,
    )
