"""Estimates of the work of a scenario relative to the demo, from its settings alone."""

from statistics import fmean

from authoring.surveys.camera_models import DEFAULT, calibration, camera_models
from authoring.surveys.settings import (
    CameraSettings,
    GlobalSettings,
    InspectionSettings,
    LocalSettings,
    MixSettings,
    RecordSettings,
)
from falsework.scenario import Scenario

_UNKNOWN = 150  # images of a flight whose number nothing tells: a grid, an inspection
_DEMO = 52 * 960 * 720  # [px] that the demo asks for; its cloud is dense, of quality medium
_RENDER = {"fast": 0.7, "standard": 1.0, "fine": 2.0}  # processor time of a frame, docs/benchmarks/render.md
_DENSE = {"low": 0.5, "medium": 1.0, "high": 5.0, "ultra": 20.0}  # of a dense cloud with its labels
_SPARSE = 0.15  # of a sparse cloud with its labels


def amounts(scenario: Scenario) -> dict[str, float]:
    """Estimate the time of each stage's results as multiples of the demo's.

    Args:
        scenario: Any scenario. Nothing is known of one that starts from an existing stage, or has no survey.

    Returns:
        Ratio of each stage that differs [1].
    """
    found = sizes(scenario)
    return {**found, "capture": found["capture"] * _RENDER[scenario.render.quality]} if found else {}


def sizes(scenario: Scenario) -> dict[str, float]:
    """Estimate the size of each stage's results as multiples of the demo's.

    Args:
        scenario: As for `amounts`.

    Returns:
        Ratio of each stage that differs [1].
    """
    if scenario.stage is not None or not scenario.survey:
        return {}
    pixels = fmean(_images(survey) * _pixels(survey) for survey in scenario.survey) / _DEMO
    dense, modes = _DENSE[scenario.recon.quality], scenario.recon.modes
    clouds = fmean(dense if mode == "dense" else _SPARSE for mode in modes)
    return {"capture": pixels, "model": pixels, "cloud": pixels * clouds}


def _images(survey: RecordSettings) -> float:
    """Tell how many images a flight takes, as far as its settings do; a long bridge may need more."""
    match survey:
        case GlobalSettings():
            return survey.images
        case LocalSettings():
            return fmean(survey.images)
        case InspectionSettings():
            return min(_UNKNOWN, survey.images)
        case MixSettings():
            return sum(_images(leg) for leg in survey.legs)
        case _:
            return _UNKNOWN


def _pixels(survey: RecordSettings) -> int:
    """Tell the size of its images [px]."""
    name = survey.camera if isinstance(survey, CameraSettings) else DEFAULT
    size = calibration(camera_models()[name], survey.width, survey.height)
    return size.width * size.height
