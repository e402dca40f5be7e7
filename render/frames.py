"""One survey of a stage becomes a capture: photographs as a drone would bring them home, and beside them the truth.

`python -m render.frames` serves one request {scene, folder, settings, seed, survey} of a parent process.
"""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from groundwork.child import answer_parent
from groundwork.files import write_bytes
from groundwork.progress import Progress
from groundwork.settings import parse_settings
from render import image_files
from render.capture import CalibrationPrior, FrameTruth, make_folders, write_cameras, write_frame_truth, write_truth
from render.context import open_context
from render.exif import insert_exif
from render.illumination import BRIGHTEST
from render.passes import View
from render.prepare import Prepared, prepare
from render.records import capture_record, draw_prior, note_shot, write_render_record
from render.sensor import Exposure, Sensor, meter
from render.settings import RenderSettings
from usd_schemas.flat_scene import CameraTrack, FlatScene
from usd_schemas.pinhole import Pinhole, pinhole_from_lens
from usd_schemas.stage_reader import read_stage

_METERED = 6  # frames that the exposure is metered on
_METER_WIDTH = 256  # [px]
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


@dataclass(frozen=True)
class Assignment:
    """One survey to photograph.

    Attributes:
        scene: The scene, with this survey's product first.
        track: Camera and poses.
        camera: Exact intrinsics.
        prior: Calibration prior.
        folder: Capture folder.
        settings: How to draw it.
    """

    scene: FlatScene
    track: CameraTrack
    camera: Pinhole
    prior: CalibrationPrior
    folder: Path
    settings: RenderSettings


def render_stage(
    scene: Path, folder: Path, settings: RenderSettings, seed: int, progress: Progress, survey: str = ""
) -> dict[str, Any]:
    """Render one survey of a stage into a capture folder.

    Args:
        scene: A USD file.
        folder: An existing, empty folder.
        settings: How to draw it.
        seed: Seed of sensor and calibration prior.
        progress: Told about warnings, the light volume and every frame.
        survey: Name of the RenderProduct; empty for the first.

    Returns:
        Facts for people: number of frames, driver, exposure, warnings.
    """
    return render_scene(read_stage(scene, survey=survey or None), folder, settings, seed, progress)


def render_scene(
    scene: FlatScene, folder: Path, settings: RenderSettings, seed: int, progress: Progress
) -> dict[str, Any]:
    """Render the first product of a scene into a capture folder.

    Args:
        scene: What to draw.
        folder: An existing, empty folder.
        settings: How to draw it.
        seed: Seed of sensor and calibration prior.
        progress: Told about warnings, the light volume and every frame.

    Returns:
        Facts for people: number of frames, driver, exposure, warnings.
    """
    product = scene.products[0]
    track = scene.cameras[product.camera]
    camera = product_camera(track, product.width, product.height)
    prior = draw_prior(camera, settings, seed)
    assignment = Assignment(scene, track, camera, prior, folder, settings)
    gl = open_context(settings.device)
    try:
        prepared = prepare(gl, scene, settings, progress)
        for warning in prepared.warnings:
            progress.note(warning)
        gain = _meter_survey(prepared, track, camera)
        sensor = Sensor(settings.sensor, gain, BRIGHTEST, (camera.height, camera.width), seed)
        make_folders(folder)
        exposures = _photograph(assignment, prepared, sensor, progress)
    finally:
        gl.close()
    write_cameras(capture_record(folder, product.name, track, camera, prior, settings))
    write_truth(folder, camera, track.image_names, track.poses, scene)
    write_render_record(folder, gl.driver, settings, track.image_names, exposures)
    return {
        "frames": len(track.poses), "driver": asdict(gl.driver), "gain": gain, "warnings": list(prepared.warnings)
    }  # fmt: skip


def product_camera(track: CameraTrack, width: int, height: int) -> Pinhole:
    """Find the exact intrinsics of a product: the stated calibration at its own size, else the lens.

    Args:
        track: A camera.
        width: Image width [px].
        height: Image height [px].
    """
    exact = track.calibration
    if exact is not None and (exact.width, exact.height) == (width, height):
        return exact
    return pinhole_from_lens(track.lens, width, height)


def _meter_survey(prepared: Prepared, track: CameraTrack, camera: Pinhole) -> float:
    """Meter the exposure on a few small frames of the survey, surfaces only."""
    ratio = _METER_WIDTH / camera.width
    small = Pinhole(
        _METER_WIDTH, max(1, round(camera.height * ratio)),
        camera.fx * ratio, camera.fy * ratio, camera.cx * ratio, camera.cy * ratio,
    )  # fmt: skip
    painter = prepared.painter(small, sharp=False)
    rows = np.unique(np.linspace(0, len(track.poses) - 1, _METERED).round().astype(int))
    samples = []
    for row in rows:
        view = painter.draw(track.poses[row], track.near)
        light = (view.code.astype(np.float32) / 65535) ** 2 * BRIGHTEST
        samples.append((light @ _LUMINANCE)[view.draw > 0])
    return meter(np.concatenate(samples))


def _photograph(assignment: Assignment, prepared: Prepared, sensor: Sensor, progress: Progress) -> list[Exposure]:
    """Draw on this thread, develop and encode on others; a few frames at most are in flight."""
    settings, track = assignment.settings, assignment.track
    painter = prepared.painter(assignment.camera, sharp=True)
    waiting: deque[Future[Exposure]] = deque()
    exposures: list[Exposure] = []

    def collect() -> None:
        exposures.append(waiting.popleft().result())
        progress.advance(len(exposures))

    progress.stage("render", len(track.poses))
    with ThreadPoolExecutor(settings.encoders) as pool:
        for row, pose in enumerate(track.poses):
            waiting.append(pool.submit(_finish_frame, assignment, sensor, row, painter.draw(pose, track.near)))
            while len(waiting) > 2 * settings.encoders or (waiting and waiting[0].done()):
                collect()
        while waiting:
            collect()
    return exposures


def _finish_frame(assignment: Assignment, sensor: Sensor, row: int, view: View) -> Exposure:
    scene, track, folder = assignment.scene, assignment.track, assignment.folder
    name = track.image_names[row]
    ids = np.concatenate([np.zeros(1, np.uint32), scene.draws.instance])
    labels = np.concatenate([np.zeros(1, np.uint8), scene.draws.label])
    frame = FrameTruth(view.depth, labels[view.draw], ids[view.draw], view.normal)
    write_frame_truth(folder, name, frame, wide_ids=int(ids.max()) >= image_files.WIDE_ID)
    exposure = sensor.expose(row, view.code)
    pixels = sensor.develop(view.code, exposure)
    settings = assignment.settings.sensor
    if settings.image_format == "png":
        data = image_files.encode_png(pixels)
    else:
        height, width = pixels.shape[:2]
        shot = note_shot(track, assignment.camera, assignment.prior, assignment.settings, exposure, row)
        data = insert_exif(image_files.encode_jpeg(pixels, settings.jpeg_quality), shot, width, height)
    write_bytes(folder / "images" / f"{name}.{settings.image_format}", data)
    return exposure


def _serve(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    settings = parse_settings(RenderSettings, request["settings"], "render settings")
    return render_stage(
        Path(request["scene"]), Path(request["folder"]), settings, int(request["seed"]), progress,
        str(request.get("survey") or ""),
    )  # fmt: skip


if __name__ == "__main__":
    answer_parent(_serve)
