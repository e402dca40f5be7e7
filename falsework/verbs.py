"""The verbs that write one plain folder, with the same functions that the pipeline's stages call."""

import shutil
from pathlib import Path
from typing import Any

from falsework.products import surveys_of
from falsework.report import write_report
from falsework.scenario import load_scenario
from falsework.stages import STAGES
from groundwork.errors import InputError, MissingError
from groundwork.files import claim_output, fresh_output
from groundwork.progress import Progress
from recon.settings import ReconSettings


def render_file(
    stage: Path, out: Path, survey: str | None, settings: dict[str, Any], seed: int, progress: Progress,
    allow_roots: tuple[Path, ...] = (),
) -> list[str]:  # fmt: skip
    """Render the products of any stage, each into a capture of its own.

    Args:
        stage: USD file.
        out: Folder to write; a former one of ours is replaced.
        survey: Only this product, or None for all.
        settings: JSON of `RenderSettings`.
        seed: Seed of the sensor.
        progress: Listener.
        allow_roots: Folders beside that of the stage from which it may take files.

    Returns:
        Names of the captures.

    Raises:
        InputError: No such file or product, nothing to render, or an output folder that is not ours.
    """
    if not stage.is_file():
        raise MissingError("no such file", where=stage, mend="Name a .usda, .usdc, .usd or .usdz file")
    claim_output(out, "captures")
    names = surveys_of(stage, allow_roots, progress)
    if survey is not None and survey not in names:
        raise InputError("no such product or camera", where=stage, value=survey, allowed=", ".join(names))
    chosen = names if survey is None else [survey]

    def write(folder: Path) -> None:
        for other in folder.iterdir():
            if other.name not in chosen:  # an interrupted run was asked for other surveys
                shutil.rmtree(other, ignore_errors=True)
        for name in chosen:
            (folder / name).mkdir(exist_ok=True)
            request = {"seed": seed, "survey": name, "render": settings}
            STAGES["capture"].run(request, {"stage": stage}, folder / name, progress)

    fresh_output(out, "captures", write, resume=True)
    return chosen


def reconstruct_folder(capture: Path, out: Path, scenario: Path | None, progress: Progress) -> None:
    """Reconstruct one capture into a plain folder.

    Args:
        capture: Capture folder.
        out: Folder to write; a former one of ours is replaced.
        scenario: File whose `[recon]` section applies, or None for the defaults.
        progress: Listener.
    """
    if not capture.is_dir():
        raise MissingError("no such folder", where=capture, mend="Name a capture")
    settings = ReconSettings() if scenario is None else load_scenario(scenario).recon
    request = {"recon": settings.model_dump(mode="json")}
    fresh_output(out, "cloud", lambda folder: STAGES["cloud"].run(request, {"capture": capture}, folder, progress))


def report_scene(scene: Path, page: Path) -> None:
    """Write the page of a finished scene of a run.

    Args:
        scene: Folder such as `OUT/scenes/0000`.
        page: HTML file to write.
    """
    captures = sorted(path for path in scene.glob("capture/*") if path.is_dir())
    if not captures:
        raise MissingError("holds no capture", where=scene, mend="Name a folder such as OUT/scenes/0000")
    clouds = {path.name: path for path in scene.glob("cloud/*") if path.is_dir()}
    surveys = {path.name: (path, clouds.get(path.name)) for path in captures}
    write_report(page, f"Scene {scene.name}", scene / "stage", surveys)


CAPTURE_FORMATS = ("colmap", "nerfstudio", "video")


def export_folder(source: Path, to: str, out: Path, progress: Progress) -> list[Path]:
    """Write a capture for another program.

    Args:
        source: A capture.
        to: One of `CAPTURE_FORMATS`.
        out: Folder to write; a former one of ours is replaced.
        progress: Listener.

    Returns:
        Files for people to open.

    Raises:
        InputError: Not a capture, one without truth where that is needed, or a cloud.
    """
    from render.export import export_capture

    if (source / "cloud.json").is_file():
        raise InputError(
            "a cloud lies ready for other programs in its own folder", where=source, allowed="a capture",
            mend="Take cloud.laz, cloud.ply, the .npy columns, or sparse/ (a COLMAP model)",
        )  # fmt: skip
    files: list[str] = []
    fresh_output(out, f"export to {to}", lambda folder: files.extend(export_capture(source, to, folder, progress)))
    return [out / file for file in files]
