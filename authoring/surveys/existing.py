"""An existing camera of a stage, animated in another program: found, and used unchanged."""

from authoring.surveys.path import Flown
from authoring.surveys.settings import StageSettings
from groundwork.errors import InputError
from usd_schemas.flat_scene import CameraTrack, FlatScene
from usd_schemas.pinhole import Pinhole, pinhole_from_lens

WIDTH = 1280  # [px] if neither survey nor stage states a size


def existing_flight(settings: StageSettings, scene: FlatScene) -> Flown:
    """Copy the poses and the lens of a camera.

    Args:
        settings: Which camera, and the size of its images.
        scene: The stage.

    Raises:
        InputError: No such camera, or several that could be meant.
    """
    row = _find(settings.prim, scene)
    track = scene.cameras[row]
    return Flown(
        poses=track.poses,
        calibration=_calibration(settings, scene, row),
        sensor_width=track.sensor_width,
        distortion=track.distortion,
        readout_time=track.readout_time,
        make=track.make,
        model=track.model,
    )


def _find(wanted: str, scene: FlatScene) -> int:
    own = [row for row, track in enumerate(scene.cameras) if track.path]  # the framing camera has no prim
    found = [row for row in own if wanted in ("", scene.cameras[row].path, _leaf(scene.cameras[row]))]
    if not wanted:  # without a name: the flight that was not made by a survey of Falsework
        found = [row for row in found if "kind" not in scene.cameras[row].facts] or found
    if len(found) == 1:
        return found[0]
    names = ", ".join(scene.cameras[row].path for row in own) or "none, the stage has no camera"
    if len(found) > 1:
        raise InputError(
            "it is not clear which camera is meant",
            field="survey.prim",
            value=wanted or None,
            allowed=names,
            hint="Give the path of one of them",
        )
    left_out = [line for line in scene.warnings if wanted and line.partition(":")[0].endswith(wanted)]
    if left_out:
        raise InputError(f"this camera cannot be used: {left_out[0]}", field="survey.prim", value=wanted, allowed=names)
    raise InputError(
        "the stage has no such camera" if wanted else "the stage has no camera",
        field="survey.prim",
        value=wanted or None,
        allowed=names,
        hint=None if own else "Animate a perspective camera in it",
    )


def _leaf(track: CameraTrack) -> str:
    return track.path.rpartition("/")[2]


def _calibration(settings: StageSettings, scene: FlatScene, row: int) -> Pinhole:
    track = scene.cameras[row]
    sizes = [(product.width, product.height) for product in scene.products if product.camera == row]
    aspect = track.lens.vertical_aperture / track.lens.horizontal_aperture
    width, height = sizes[0] if sizes else (WIDTH, round(WIDTH * aspect))
    if settings.width is not None or settings.height is not None:
        shape = height / width
        width = settings.width or round((settings.height or 0) / shape)
        height = settings.height or round(width * shape)
    stated = track.calibration
    if stated is not None and (stated.width, stated.height) == (width, height):
        return stated
    return pinhole_from_lens(track.lens, width, height)
