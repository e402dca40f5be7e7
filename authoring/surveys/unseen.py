"""The members of a bridge that no flight shows often enough, and the legs that would show them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from authoring.surveys.camera_models import calibration, camera_models
from authoring.surveys.framing import eye_of
from authoring.surveys.inspection import fly_inspection
from authoring.surveys.score import ENOUGH_PIXELS, ENOUGH_VIEWS
from authoring.surveys.settings import InspectionSettings
from authoring.surveys.sight import sight_of
from authoring.surveys.subject import Subject
from authoring.surveys.targets import cut_targets
from groundwork.errors import InputError


@dataclass(frozen=True)
class Proposal:
    """Proposed legs that are not part of any flight yet.

    Attributes:
        images: Number of images.
        shown: Instance ids of the members that they show often enough, together with the existing flights.
        hidden: Instance ids of those that they do not.
        refused: Why no legs can be proposed; empty if some are.
    """

    images: int
    shown: tuple[int, ...]
    hidden: tuple[int, ...]
    refused: str = ""


def hardly_seen(flights: Sequence[Mapping[int, int]]) -> dict[int, int]:
    """Find the members with too few views in all flights together.

    Args:
        flights: For each flight, instance id to the number of images in which the member is large enough.

    Returns:
        Instance id to the number of its views, ascending, fewer than `ENOUGH_VIEWS` each.
    """
    ids = sorted({number for flight in flights for number in flight})
    views = {number: sum(flight.get(number, 0) for flight in flights) for number in ids}
    return {number: count for number, count in views.items() if count < ENOUGH_VIEWS}


def propose_legs(subject: Subject, few: Mapping[int, int], rng: np.random.Generator) -> Proposal:
    """Find legs that show members often enough, and list the members that they would show.

    Args:
        subject: Bridge and site.
        few: Instance id to the number of views that it has.
        rng: Stream of the flight that would be planned.
    """
    settings = proposed_settings(tuple(few))
    try:
        poses = fly_inspection(settings, subject, rng)
    except InputError as error:
        return Proposal(0, (), tuple(few), str(error))
    model = camera_models()[settings.camera]
    eye = eye_of(calibration(model), model.distortion)
    targets = cut_targets(subject, settings.stretch, np.array(settings.members, np.int64))
    pixels = sight_of(poses, eye, targets, settings.reach, subject.obstacles).pixels.tocoo()
    views = np.bincount(pixels.col[pixels.data >= ENOUGH_PIXELS], minlength=len(targets.samples.ids))
    shown = [
        int(number)
        for number, count in zip(targets.samples.ids, views, strict=True)
        if count + few[int(number)] >= ENOUGH_VIEWS
    ]
    return Proposal(len(poses), tuple(shown), tuple(number for number in few if number not in shown))


def proposed_settings(members: tuple[int, ...]) -> InspectionSettings:
    """Return the settings of a flight for some members alone.

    Args:
        members: Their instance ids.
    """
    return InspectionSettings(kind="inspection", members=members, cover="members", pixels=ENOUGH_PIXELS)
