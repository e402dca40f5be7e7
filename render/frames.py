"""Conductor of rendering: one survey of a stage becomes a capture of photographs and ground truth.

`python -m render.frames` serves one request {scene, folder, settings, seed, survey, share, choices} of a parent
process.
"""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import digest
from groundwork.child import answer_parent
from groundwork.locks import hold_lock
from groundwork.progress import Progress
from groundwork.settings import parse_settings
from render.capture import CalibrationPrior, Readout
from render.detail.surveyed_scene import SurveyedScene, survey_scene
from render.gpu.context import Driver, Gl, open_context
from render.images import image_files
from render.images.exif import insert_exif
from render.light.illumination import BRIGHTEST
from render.light.light_volume import LightVolume
from render.sensor.sensor import Exposure, Metering, Sensor, balance, meter
from render.sensor.shutter import read_out
from render.settings import RenderSettings
from render.views.camera_body import CameraBody, Shot
from render.views.preparation_child import cast_volume_apart, survey_scene_apart
from render.views.prepare import Prepared, prepare
from render.views.targets import View
from render.writing.capture_writer import FrameTruth, encode_frame_truth, make_folders, write_cameras, write_truth
from render.writing.journal import Journal
from render.writing.records import capture_record, draw_prior, note_shot, write_render_record
from usd_schemas.flat_scene import CameraTrack, FlatScene
from usd_schemas.pinhole import Pinhole
from usd_schemas.reading.choices import AS_AUTHORED, StageChoices, choices_from

_METERED = 6  # frames that the exposure is metered on
_METER_WIDTH = 256  # [px]
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
_LOOKED_UP = 64  # rows at once
_RECIPE = 16  # increased whenever frames of an interrupted run would no longer match new ones
F32 = NDArray[np.float32]
Share = tuple[int, int]
ALL: Share = (0, 1)


@dataclass(frozen=True)
class _Order:
    """Output folder and settings of a rendering, as in `render_stage`."""

    folder: Path
    settings: RenderSettings
    seed: int
    share: Share = ALL
    choices: StageChoices = AS_AUTHORED


@dataclass(frozen=True)
class Assignment:
    """One survey to render.

    Attributes:
        surveyed: The scene prepared for this survey, without its meshes.
        readout: When the rows are read out; None for a global shutter.
        prior: Calibration prior.
        folder: Capture folder.
        settings: How to draw it.
        seed: Seed of sensor and calibration prior.
        driver: The OpenGL driver that draws it.
        choices: Choices for reading the stage.
    """

    surveyed: SurveyedScene
    readout: Readout | None
    prior: CalibrationPrior
    folder: Path
    settings: RenderSettings
    seed: int
    driver: Driver
    choices: StageChoices = AS_AUTHORED

    @property
    def scene(self) -> FlatScene:
        """The scene, without its meshes."""
        return self.surveyed.scene

    @property
    def track(self) -> CameraTrack:
        """Camera and poses."""
        return self.surveyed.track

    @property
    def camera(self) -> Pinhole:
        """Exact intrinsics."""
        return self.surveyed.camera

    @property
    def meters_light(self) -> bool:
        """Whether the exposure is metered on the incident light instead of the surfaces."""
        told = self.settings.sensor.metering
        return told == "light" or (told == "auto" and "kind" not in self.track.facts)

    def recipe(self) -> str:
        """Hash everything that the capture's bytes depend on."""
        settings = self.settings.model_dump(mode="json", exclude={"workers", "encoders"})
        product = self.scene.products[0]
        chosen = [self.choices.as_json()] if self.choices != AS_AUTHORED else []
        return digest([_RECIPE, self.scene.origin, asdict(product), settings, self.seed, asdict(self.driver), *chosen])


def render_stage(
    scene: Path,
    folder: Path,
    settings: RenderSettings,
    seed: int,
    progress: Progress,
    *,
    survey: str = "",
    share: Share = ALL,
    choices: StageChoices = AS_AUTHORED,
) -> dict[str, Any]:
    """Render one survey of a stage into a capture folder.

    Args:
        scene: A USD file.
        folder: An existing folder: empty, or left by an interrupted run.
        settings: How to draw it.
        seed: Seed of sensor and calibration prior.
        progress: Listener for warnings, the light volume and every frame.
        survey: Name of the RenderProduct; empty for the first.
        share: Number of this worker, and how many there are; only one that works alone finishes the capture.
        choices: Choices for reading the stage; its subdivision is replaced by that of the settings.

    Returns:
        Facts to print: number of frames, driver, exposure, warnings.
    """
    choices = replace(choices, subdivision=settings.subdivision)
    # The only reference, so that the meshes are freed after the upload.
    return _render(
        survey_scene_apart(scene, survey or None, settings.triangle_budget, choices, progress),
        _Order(folder, settings, seed, share, choices),
        progress,
    )


def render_scene(
    scene: FlatScene, folder: Path, settings: RenderSettings, seed: int, progress: Progress, share: Share = ALL
) -> dict[str, Any]:
    """Render the first product of a scene into a capture folder.

    Args:
        scene: What to draw.
        folder: An existing folder: empty, or left by an interrupted run, whose matching frames are kept.
        settings: How to draw it.
        seed: Seed of sensor and calibration prior.
        progress: Listener for warnings, the light volume and every frame.
        share: Number of this worker, and how many there are; only one that works alone finishes the capture.

    Returns:
        Facts to print: number of frames, driver, exposure, warnings.
    """
    return _render(survey_scene(scene, settings.triangle_budget), _Order(folder, settings, seed, share), progress)


def _render(surveyed: SurveyedScene, order: _Order, progress: Progress) -> dict[str, Any]:
    folder, settings, seed, share = order.folder, order.settings, order.seed, order.share
    scene, surveyed = surveyed.scene, surveyed.without_meshes()
    track, camera = surveyed.track, surveyed.camera
    readout = read_out(track, camera.height, settings.sensor, seed)
    gl = open_context(settings.device)
    warnings = scene.warnings
    try:
        prior = draw_prior(camera, settings, seed)
        assignment = Assignment(surveyed, readout, prior, folder, settings, seed, gl.driver, order.choices)
        journal = Journal(folder, assignment.recipe())
        facts = {"frames": len(track.poses), "driver": asdict(gl.driver)}
        if not journal.is_complete():
            make_folders(folder, normals=settings.normals)
            missing = [row for row, name in enumerate(track.image_names) if journal.facts(name) is None]
            mine = [row for row in missing if row % share[1] == share[0]]
            if share == ALL:
                write_truth(folder, camera, track, scene, readout)
            if mine:
                prepared = _prepare(gl, scene, assignment, journal, progress)
                body = CameraBody(track, camera, readout, prepared, scene)
                del scene
                warnings = prepared.warnings
                _draw_missing(assignment, body, journal, mine, progress)
            if share == ALL:
                _finish(assignment, journal)
    finally:
        gl.close()
    return {**facts, "gain": journal.gain(), "warnings": list(warnings)}


def _prepare(gl: Gl, scene: FlatScene, assignment: Assignment, journal: Journal, progress: Progress) -> Prepared:
    """Upload the scene, and report what is not drawn as authored."""

    def cast(*arguments: Any) -> LightVolume:
        with hold_lock(journal.light_lock):  # one worker casts it, the others wait and reuse it
            volume = journal.light_volume() or cast_volume_apart(*arguments)
            journal.keep_light_volume(volume)
        return volume

    eyes, readout = assignment.track.poses[:, :3, 3], assignment.readout
    strays = np.linalg.norm(readout.poses[..., :3, 3] - eyes[:, None], axis=2) if readout is not None else np.zeros(1)
    surveyed = assignment.surveyed
    flight = (eyes, 1.001 * float(strays.max()))
    prepared = prepare(
        gl, scene, assignment.settings, progress, cast=cast, needs=surveyed.needs, flight=flight, bars=surveyed.bars
    )
    for warning in prepared.warnings:
        progress.note(warning)
    return prepared


def _draw_missing(
    assignment: Assignment, body: CameraBody, journal: Journal, rows: list[int], progress: Progress
) -> None:
    """Render the missing frames."""
    with hold_lock(journal.gain_lock):  # one worker meters, the others wait and use its result
        gain = journal.gain()
        if gain is None:
            gain = _meter_survey(body.prepared, assignment)
            journal.keep_gain(gain)
    shape, told = (assignment.camera.height, assignment.camera.width), assignment.settings.sensor
    follows = told.exposure is None and not assignment.meters_light
    white = balance(body.prepared.light.daylight.on_level_ground(), told.white_balance)
    sensor = Sensor(told, Metering(gain, follows, white), BRIGHTEST, shape, assignment.seed)
    _photograph(assignment, body, sensor, journal, rows, progress)


def _finish(assignment: Assignment, journal: Journal) -> None:
    """Write the files beside the images; the record is written last, and marks the capture as complete."""
    scene, track, settings, folder = assignment.scene, assignment.track, assignment.settings, assignment.folder
    camera, name = assignment.camera, scene.products[0].name
    write_cameras(capture_record(folder, name, track, camera, assignment.prior, settings))
    frames = [{"name": name, **(journal.facts(name) or {})} for name in track.image_names]
    write_render_record(folder, assignment.driver, settings, frames, journal.gain(), assignment.recipe())
    journal.close()


def _meter_survey(prepared: Prepared, assignment: Assignment) -> float:
    """Meter the exposure on a few small frames of the survey, surfaces only, unless it is given."""
    track, camera, fixed = assignment.track, assignment.camera, assignment.settings.sensor.exposure
    if fixed is not None:
        return 2.0**fixed
    ratio = _METER_WIDTH / camera.width
    small = Pinhole(
        _METER_WIDTH,
        max(1, round(camera.height * ratio)),
        camera.fx * ratio,
        camera.fy * ratio,
        camera.cx * ratio,
        camera.cy * ratio,
    )
    rows = np.unique(np.linspace(0, len(track.poses) - 1, _METERED).round().astype(int))

    def luminance(cards: bool) -> "tuple[F32, F32]":
        painter, samples, skies = prepared.painter(small, sharp=False, cards=cards), [], []
        for row in rows:
            view = painter.draw(track.poses[row], track.near)
            light = (view.code.astype(np.float32) / 65535) ** 2 * BRIGHTEST
            samples.append((light @ _LUMINANCE)[view.draw > 0])
            skies.append((light @ _LUMINANCE)[view.draw == 0])
        return np.concatenate(samples), np.concatenate(skies)

    surfaces, sky = luminance(False)
    return meter(surfaces, luminance(True)[0] if assignment.meters_light else None, sky)


def _photograph(
    assignment: Assignment, body: CameraBody, sensor: Sensor, journal: Journal, rows: list[int], progress: Progress
) -> None:
    """Draw on this thread, develop and encode on others; no more frames are in progress than there are threads.

    Frames of the same shadow square are consecutive, so that its shadows are drawn once.
    """
    encoders, total = assignment.settings.encoders, len(assignment.track.poses)
    squares = body.prepared.shadow_squares(assignment.track.poses, body.widest)
    waiting: deque[Future[None]] = deque()
    done = total - len(rows)

    def collect() -> None:
        nonlocal done
        waiting.popleft().result()
        done += 1
        progress.advance(done)

    progress.stage("render", total)
    with ThreadPoolExecutor(encoders) as pool:
        for row in sorted(squares.together(rows), key=body.moment):
            while len(waiting) >= encoders or (waiting and waiting[0].done()):
                collect()
            body.move(row)
            body.prepared.sharpen_shadows(squares, row)
            waiting.append(pool.submit(_finish_frame, assignment, sensor, journal, row, body.shoot(row)))
        while waiting:
            collect()


def _finish_frame(assignment: Assignment, sensor: Sensor, journal: Journal, row: int, shot: Shot) -> None:
    name, view = assignment.track.image_names[row], shot()
    moments = assignment.track.moments
    files = _encode_truth(assignment.scene.at_moment(moments[row] if moments else 0), name, view)
    exposure = sensor.expose(row, view.code, view.draw > 0)
    pixels = sensor.develop(view.code, exposure)
    settings = assignment.settings.sensor
    files[f"images/{name}.{settings.image_format}"] = _encode_photograph(assignment, pixels, exposure, row)
    journal.write_frame(name, files, asdict(exposure))


def _encode_truth(scene: FlatScene, name: str, view: View) -> dict[str, bytes]:
    ids = np.concatenate([np.zeros(1, np.uint32), scene.draws.instance])
    labels = np.concatenate([np.zeros(1, np.uint8), scene.draws.label])
    frame = FrameTruth(
        view.depth, np.empty(view.draw.shape, np.uint8), np.empty(view.draw.shape, np.uint32), view.normal
    )
    for first in range(0, len(view.draw), _LOOKED_UP):
        rows = slice(first, first + _LOOKED_UP)
        draw = view.draw[rows].astype(np.intp)  # index type of both tables: four times as large as the labels
        np.take(labels, draw, out=frame.semantic[rows], mode="clip")  # the fastest mode: a draw is always in range
        np.take(ids, draw, out=frame.instance[rows], mode="clip")
    widest = max((row.id for row in scene.instances), default=0) if scene.moments else int(ids.max())
    return encode_frame_truth(name, frame, wide_ids=widest >= image_files.WIDE_ID)


def _encode_photograph(assignment: Assignment, pixels: "np.ndarray[Any, Any]", exposure: Exposure, row: int) -> bytes:
    settings = assignment.settings
    if settings.sensor.image_format == "png":
        return image_files.encode_png(pixels)
    height, width = pixels.shape[:2]
    shot = note_shot(assignment.track, assignment.camera, assignment.prior, settings, exposure, row)
    return insert_exif(image_files.encode_jpeg(pixels, settings.sensor.jpeg_quality), shot, width, height)


def _serve(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    cv2.setNumThreads(1)  # frames are already developed in parallel; OpenCV's own threads would busy-wait
    settings = parse_settings(RenderSettings, request["settings"], "render settings")
    number, count = request.get("share", ALL)
    return render_stage(
        Path(request["scene"]),
        Path(request["folder"]),
        settings,
        int(request["seed"]),
        progress,
        survey=str(request.get("survey") or ""),
        share=(int(number), int(count)),
        choices=choices_from(request.get("choices")),
    )


if __name__ == "__main__":
    answer_parent(_serve)
