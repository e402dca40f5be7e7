"""The verbs that write one plain folder, with the same functions that the pipeline's stages call."""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from falsework.children.products import read_safely, surveys_of
from falsework.commands.given_files import need_folder, stage_file
from falsework.stages import SAMPLE_MEMORY_LIMIT, SAMPLE_TIME_LIMIT, STAGES, clouds_of
from groundwork.errors import InputError, MissingError
from groundwork.output.file import fresh_file
from groundwork.output.folder import fresh_output
from groundwork.output.reading import reading
from groundwork.progress import DistinctNotes, Progress
from groundwork.settings import Settings, read_toml
from groundwork.slug import inside

if TYPE_CHECKING:
    from falsework.scenario import Scenario
    from recon.settings import ReconSettings

SAMPLER = "falsework.children.sample_work"


def author_file(scenario: "Scenario", out: Path, scene: int, progress: Progress, inputs: Sequence[Path] = ()) -> Path:
    """Author the layered stage of one scene into a plain folder.

    Args:
        scenario: What to make.
        out: Folder to write; a former scene of ours is replaced, unless it was edited since.
        scene: Number of the scene.
        progress: Listener.
        inputs: Files that the scenario was read from.

    Returns:
        Its root layer.

    Raises:
        InputError: No such scene, or an output folder that is not ours or was edited.
    """
    from falsework.scenario import given_files, scene_seed

    if not 0 <= scene < scenario.scenes:
        raise InputError("no such scene", field="--scene", value=scene, allowed=f"0 to {scenario.scenes - 1}")
    settings = {"seed": scene_seed(scenario.seed, scene), "authoring": scenario.authoring()}
    given = given_files(scenario)

    def write(folder: Path) -> None:
        from authoring.scenes.manifest import edits_since

        if changed := edits_since(out):
            raise InputError(f"was edited after authoring ({changed[0]})", where=out, hint="Choose another folder")
        STAGES["stage"].run(settings, given, folder, progress)

    read = [*inputs, *given.values()]
    with reading(*read):
        fresh_output(out, "scene", write, inputs=read)
    return out / "scene.usda"


def sample_file(
    stage: Path, out: Path, kind: str, settings: Settings, progress: Progress, allow_roots: tuple[Path, ...] = ()
) -> None:
    """Sample the surface of any stage into a plain folder; in a child, because the stage may come from anywhere.

    Args:
        stage: USD file.
        out: Folder to write; a former one of ours is replaced.
        kind: mesh, terrestrial, mobile or airborne.
        settings: Settings of that sampler.
        progress: Listener.
        allow_roots: Further folders from which the stage may load files.

    Raises:
        InputError: No such file, nothing to sample, or an output folder that is not ours.
    """
    named, stage = stage, stage_file(stage)
    request = {
        "kind": kind,
        "settings": settings.model_dump(mode="json"),
        "stage": str(stage.absolute()),
        "allow_roots": [str(root.absolute()) for root in allow_roots],
    }

    def write(folder: Path) -> None:
        read_safely(
            SAMPLER,
            request | {"folder": str(folder.absolute())},
            stage,
            progress,
            SAMPLE_TIME_LIMIT,
            SAMPLE_MEMORY_LIMIT,
        )

    with reading(stage):
        fresh_output(out, "cloud", write, inputs=[named, stage])


def render_file(
    stage: Path,
    out: Path,
    survey: str | None,
    settings: dict[str, Any],
    seed: int,
    progress: Progress,
    *,
    allow_roots: tuple[Path, ...] = (),
    choices: dict[str, Any] | None = None,
) -> list[str]:
    """Render the products of any stage, each into a capture of its own.

    Args:
        stage: USD file.
        out: Folder to write; a former one of ours is replaced.
        survey: Only this product, or None for all.
        settings: JSON of `RenderSettings`.
        seed: Seed of the sensor.
        progress: Listener.
        allow_roots: Further folders from which the stage may load files.
        choices: JSON of `StageChoices`, or None for the stage as it is.

    Returns:
        Names of the captures.

    Raises:
        InputError: No such file or product, nothing to render, or an output folder that is not ours.
    """
    named, stage, chosen = stage, stage_file(stage), list[str]()
    progress = DistinctNotes(progress)  # each camera would say again what is wrong with the stage

    def write(folder: Path) -> None:
        names = surveys_of(stage, allow_roots, progress, choices)
        if survey is not None and survey not in names:
            raise InputError("no such product or camera", where=stage, value=survey, allowed=", ".join(names))
        chosen.extend(names if survey is None else [survey])
        for other in folder.iterdir():
            if other.name not in chosen:  # an interrupted run was asked for other surveys
                shutil.rmtree(other, ignore_errors=True)
        for name in chosen:
            place = inside(folder, name, where=stage)
            place.mkdir(exist_ok=True)
            request = {"seed": seed, "survey": name, "render": settings, "choices": choices}
            STAGES["capture"].run(request, {"stage": stage}, place, progress)

    with reading(stage):
        fresh_output(out, "captures", write, inputs=[named, stage], asked=_place(stage), resume=True)
    return chosen


def reconstruct_folder(
    capture: Path,
    out: Path,
    settings: "ReconSettings",
    progress: Progress,
    control: Path | None = None,
    model: Path | None = None,
) -> list[Path]:
    """Reconstruct one capture, or a folder of photographs, into a plain folder; goes on where it was interrupted.

    Args:
        capture: Capture folder, or one of plain photographs.
        out: Folder to write; a former one of ours is replaced.
        settings: What to do.
        progress: Listener.
        control: File of ground control points and scale bars, or None.
        model: Model of these photographs, or a cloud that was made with its own; None makes one.

    Returns:
        Folders of the clouds.
    """
    inputs = [path for path in (capture, control, model) if path is not None]
    with reading(*(path for path in (capture, model) if path is not None)):
        need_folder(capture, "a capture, or a folder of photographs")
        if model is not None:
            need_folder(model, "a cloud of these photographs, or its model", "--model")
        from recon.reconstruct import reconstruct

        fresh_output(
            out,
            "cloud",
            lambda folder: reconstruct(capture, folder, settings, progress, control, model),
            inputs=inputs,
            asked=_place(capture),
            resume=True,
        )
    return [out / "cloud" / mode for mode in settings.modes] if len(settings.modes) > 1 else [out]


def _place(path: Path) -> str:
    """Name what an interrupted run was working on; whether it is still the same is seen from its content."""
    return str(path.resolve())


def report_scene(scene: Path, page: Path) -> None:
    """Write the page of a finished scene of a run.

    Args:
        scene: Folder such as `OUT/scenes/0000`.
        page: HTML file to write.
    """
    captures = sorted(path for path in scene.glob("capture/*") if path.is_dir())
    clouds = {path.name: path for path in sorted(scene.glob("cloud/*")) if path.is_dir()}
    if not captures and not clouds:
        raise MissingError("has no capture and no cloud", where=scene, hint="Name a folder such as OUT/scenes/0000")
    surveys = {path.name: (path, clouds_of(path.name, clouds)) for path in captures}
    shown = {folder for _, several in surveys.values() for folder in several.values()}
    others = {name: folder for name, folder in clouds.items() if folder not in shown}  # their photographs were removed
    from falsework.report.page import way_to
    from falsework.report.report import write_report

    inputs = [scene, *captures, *clouds.values()]
    with reading(*inputs), fresh_file(page, inputs) as temporary:
        write_report(temporary, _title(scene), scene / "stage", surveys, others, way_to(scene, page))


def _title(scene: Path) -> str:
    """Name a scene of a run with the scenario's seed; any other folder by its own name."""
    from falsework.scenario import scene_title

    scenario = scene.absolute().parents[1] / "scenario.toml"
    if not scenario.is_file() or not scene.name.isdecimal():
        return f"Scene {scene.name}"
    return scene_title(int(scene.name), int(read_toml(scenario).get("seed", 0)))


CAPTURE_FORMATS = ("colmap", "nerfstudio", "video")
CAMERA_FORMATS = ("colmap", "nerfstudio")  # of clouds, that take photographs


def export_folder(source: Path, to: str, out: Path, progress: Progress, photographs: Path | None = None) -> list[Path]:
    """Write a capture or a cloud for another program.

    Args:
        source: A capture, or a cloud.
        to: One of `CAPTURE_FORMATS`, or a row of `recon.formats.export.EXPORTS` for a cloud.
        out: Folder to write; a former one of ours is replaced.
        progress: Listener.
        photographs: Capture whose photographs go with the cameras of a cloud.

    Returns:
        Files for people to open.

    Raises:
        InputError: Neither of them, a format for which it lacks something, or photographs for a format without them.
    """
    if photographs is not None and to not in CAMERA_FORMATS:
        raise InputError(
            f"not with --to {to}", field="--photographs", allowed=f"only with {' or '.join(CAMERA_FORMATS)}"
        )

    def write(folder: Path) -> None:
        is_cloud = (source / "cloud.json").is_file()
        if not is_cloud and to not in CAPTURE_FORMATS:
            raise InputError(
                "a format for clouds, but this is not a cloud",
                where=source,
                field="--to",
                value=to,
                allowed=", ".join(CAPTURE_FORMATS),
                hint="Name the folder that holds cloud.json",
            )
        if is_cloud:
            from recon.formats.export import export_cloud

            files.extend(export_cloud(source, to, folder, photographs))
        else:
            from render.writing.export import export_capture

            files.extend(export_capture(source, to, folder, progress))

    files: list[str] = []
    inputs = [source] if photographs is None else [source, photographs]
    with reading(*inputs):
        need_folder(source, "a cloud or a capture")
        if photographs is not None:
            need_folder(photographs, "the capture of this cloud", "--photographs")
            if not (source / "cloud.json").is_file():
                raise InputError("only for clouds: a capture is exported with its own", field="--photographs")
        fresh_output(out, f"export to {to}", write, inputs=inputs)
    return [out / file for file in files]
