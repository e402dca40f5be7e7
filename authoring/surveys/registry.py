"""Kinds of survey by name: settings and the function that flies them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.streams import stream
from authoring.surveys.camera_models import CAMERA_MODELS, calibration
from authoring.surveys.gps import measured_positions
from authoring.surveys.grid import fly_grid
from authoring.surveys.local import fly_local
from authoring.surveys.path import CameraPath
from authoring.surveys.settings import AnySurvey, GlobalSettings, GridSettings, LocalSettings, SurveySettings
from authoring.surveys.subject import Subject
from authoring.surveys.whole import fly_whole

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Survey:
    """A kind of survey.

    Attributes:
        settings: Settings that it understands.
        fly: Finds camera_to_world of every image in the order of flight [m], shape (N, 4, 4), float64.
    """

    settings: type[SurveySettings]
    fly: Callable[..., F64]


SURVEYS: dict[str, Survey] = {
    "global": Survey(GlobalSettings, fly_whole),
    "local": Survey(LocalSettings, fly_local),
    "grid": Survey(GridSettings, fly_grid),
}


def plan_survey(settings: AnySurvey, subject: Subject, seed: int) -> CameraPath:
    """Fly one survey and note what the drone would note.

    Args:
        settings: Its settings.
        subject: Bridge and site.
        seed: Seed of the scene.

    Returns:
        Cameras, times and measured positions.
    """
    model = CAMERA_MODELS[settings.camera]
    poses = SURVEYS[settings.kind].fly(settings, subject, stream(seed, f"survey/{settings.id}"))
    positions = poses[:, :3, 3]
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    times = np.concatenate([[0.0], np.cumsum(steps)]) / settings.speed
    return CameraPath(
        id=settings.id,
        kind=settings.kind,
        seed=seed,
        calibration=calibration(model, settings.width, settings.height),
        sensor_width=model.sensor_width,
        spacing=float(steps.mean()),
        poses=poses,
        times=times,
        gps=measured_positions(
            positions, times, settings.gps_sigma, settings.gps_drift, stream(seed, f"gps/{settings.id}")
        ),
        gps_sigma=settings.gps_sigma,
    )
