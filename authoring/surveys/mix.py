"""Mixed survey: flights of several kinds one after the other, with one camera, as one capture."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.inspection import fly_inspection
from authoring.surveys.settings import CameraSettings, InspectionSettings, MixSettings
from authoring.surveys.subject import Subject

F64 = NDArray[np.float64]

Fly = Callable[..., F64]


def fly_mix(settings: MixSettings, subject: Subject, rng: np.random.Generator, kinds: Mapping[str, Fly]) -> F64:
    """Fly the legs in order; each has a separate random stream, so that a further leg changes none before it.

    Args:
        settings: Settings of the scenario.
        subject: Bridge and site.
        rng: Stream `survey/<id>`.
        kinds: Function of each other kind: camera_to_world of each image [m], shape (N, 4, 4), float64.

    Returns:
        camera_to_world of each image [m], shape (N, 4, 4), float64.
    """
    shared = {name: getattr(settings, name) for name in CameraSettings.model_fields if name != "id"}
    poses = np.zeros((0, 4, 4))
    for leg, own in zip(settings.legs, rng.spawn(len(settings.legs)), strict=True):
        flown = leg.model_copy(update=shared)
        if isinstance(flown, InspectionSettings):
            more = fly_inspection(flown, subject, own, poses if len(poses) else None)
        else:
            more = kinds[flown.kind](flown, subject, own)
        poses = np.concatenate([poses, more])
    return poses
