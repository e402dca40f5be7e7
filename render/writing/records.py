"""Records of a survey beside its images: calibration prior, EXIF, and how the frames were made."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from groundwork.files import write_json
from render.capture import TRUTH, CalibrationPrior, Capture, CaptureImage
from render.gpu.context import Driver
from render.images.exif import Shot
from render.sensor.sensor import Exposure
from render.settings import RenderSettings
from usd_schemas.flat_scene import CameraTrack
from usd_schemas.pinhole import Pinhole

_MIDDLE_EXPOSURE = 1 / 640  # [s] exposure time at gain 1
_STREAM = 0x70726972  # the prior's own random stream beside the sensor's


def draw_prior(camera: Pinhole, settings: RenderSettings, seed: int) -> CalibrationPrior:
    """Draw the calibration of a data sheet: a focal length near the truth, the principal point in the center.

    Args:
        camera: Exact intrinsics.
        settings: Largest error of the focal length.
        seed: Seed of the survey's sensor.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, _STREAM]))
    error = rng.uniform(-1.0, 1.0) * settings.sensor.focal_error
    return CalibrationPrior(focal_px=camera.fx * (1.0 + error), cx=camera.width / 2, cy=camera.height / 2)


def note_shot(
    track: CameraTrack, camera: Pinhole, prior: CalibrationPrior, settings: RenderSettings, exposure: Exposure, row: int
) -> Shot:
    """Collect the EXIF data of one photograph, from the prior, not from the truth.

    Args:
        track: Camera and poses.
        camera: Exact intrinsics; only their image width is used.
        prior: Calibration prior.
        settings: Position of the local frame on the earth.
        exposure: Sensor values of the frame.
        row: Number of the frame.
    """
    seconds = _time(track, row)
    return Shot(
        focal_length=prior.focal_px * track.sensor_width / camera.width,
        sensor_width=track.sensor_width,
        exposure_time=_MIDDLE_EXPOSURE * exposure.gain,
        seconds=seconds if seconds is not None else float(row),
        gps=_gps(track, row),
        origin=settings.geodetic_origin,
        make=track.make,
        model=track.model,
    )


def capture_record(
    folder: Path, survey: str, track: CameraTrack, camera: Pinhole, prior: CalibrationPrior, settings: RenderSettings
) -> Capture:
    """Collect the content of `cameras.json`.

    Args:
        folder: Capture folder.
        survey: Survey id.
        track: Camera and poses.
        camera: Exact intrinsics; only their size is used.
        prior: Calibration prior.
        settings: Kind of image file.
    """
    suffix = settings.sensor.image_format
    images = tuple(
        CaptureImage(name=name, file=f"images/{name}.{suffix}", gps=_gps(track, row), time=_time(track, row))
        for row, name in enumerate(track.image_names)
    )
    facts = {key: value for key, value in track.facts.items() if key != "capture_times"}
    return Capture(folder, survey, (camera.width, camera.height), prior, track.gps_sigma, facts, images)


def write_render_record(
    folder: Path,
    driver: Driver,
    settings: RenderSettings,
    frames: list[dict[str, Any]],
    gain: float | None,
    recipe: str,
) -> None:
    """Write `truth/render.json`: driver, settings, and sensor values of each frame.

    Args:
        folder: Capture folder.
        driver: The OpenGL driver.
        settings: Settings of the renderer.
        frames: Name of each image, and its sensor values.
        gain: Exposure metered for the survey [1].
        recipe: Hash of everything that the capture's bytes depend on.
    """
    told = settings.model_dump(mode="json", exclude={"workers", "encoders"})
    record = {"driver": asdict(driver), "settings": told, "gain": gain, "frames": frames, "recipe": recipe}
    write_json(folder / TRUTH / "render.json", record)


def _gps(track: CameraTrack, row: int) -> tuple[float, float, float] | None:
    if track.gps is None:
        return None
    east, north, up = track.gps[row].tolist()
    return east, north, up


def _time(track: CameraTrack, row: int) -> float | None:
    times = track.facts.get("capture_times")
    return float(times[row]) if isinstance(times, list | tuple) and len(times) == len(track.poses) else None
