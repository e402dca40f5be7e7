"""The stages of the chain: for each, what its result depends on and how it is made from its inputs."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from groundwork.progress import Progress
from groundwork.settings import parse_settings
from groundwork.slug import inside

RENDER_TIME_LIMIT = 6 * 3600.0  # [s] per survey
RENDER_MEMORY_LIMIT = 16.0  # [GB]

Run = Callable[[dict[str, Any], dict[str, Path], Path, Progress], None]


@dataclass(frozen=True)
class Stage:
    """One kind of task.

    Attributes:
        version: Raised by hand whenever the same settings would give another result.
        run: Called with the task's settings, the folders of its inputs, an empty folder to fill, and a listener.
        resumes: Whether it goes on in a folder that an interrupted run of the same task left.
    """

    version: int
    run: Run
    resumes: bool = False


def author(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Write a layered stage.

    Args:
        settings: `{seed, authoring}`.
        inputs: `world/<name>`, `sky/<name>` and `surface/<name>`: each imported world, photographed sky and folder of
            surfaces that the scenario names.
        folder: Empty folder to fill.
        progress: Listener.
    """
    from authoring.scene import author_scene
    from authoring.settings import AuthoringSettings

    given = {kind: {name[len(kind) :]: path for name, path in inputs.items() if name.startswith(kind)}
             for kind in ("world/", "sky/", "surface/")}  # fmt: skip
    authoring = parse_settings(AuthoringSettings, settings["authoring"], "scenario")
    author_scene(authoring, settings["seed"], folder, progress, given["world/"], given["sky/"], given["surface/"])


def capture(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Render one survey of a stage; in a child, because a graphics driver may crash and belongs to one process.

    Args:
        settings: `{seed, render, survey, platform}`, `variant` where one of the scene's variants is rendered, and
            `drawing`: how many processes and threads share the work.
        inputs: `stage`: the root layer, or the folder that holds `scene.usda`.
        folder: Folder to fill: empty, or left by an interrupted run.
        progress: Listener.
    """
    from render.workers import render_survey

    render_survey(
        {
            "scene": str(root_layer(inputs["stage"], settings.get("variant", "")).resolve()),
            "folder": str(folder.resolve()),
            "settings": {**settings["render"], **settings.get("drawing", {})},
            "seed": settings["seed"],
            "survey": settings["survey"],
        },
        time_limit=RENDER_TIME_LIMIT,
        memory_limit=RENDER_MEMORY_LIMIT,
        progress=progress,
    )


def cloud(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Reconstruct a capture and annotate its points.

    Args:
        settings: `{recon, platform}`.
        inputs: `capture`: a capture folder, or one of plain photographs; `control`: a file of ground control points, if
            there is one.
        folder: Folder to fill: empty, or left by an interrupted run.
        progress: Listener.
    """
    from recon.reconstruct import reconstruct
    from recon.settings import ReconSettings

    recon = parse_settings(ReconSettings, settings["recon"], "scenario")
    reconstruct(inputs["capture"], folder, recon, progress, inputs.get("control"))


def report(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Write the page that shows one scene.

    Args:
        settings: `{title}`.
        inputs: `stage`, and `capture/<survey>` and `cloud/<survey>` for each survey.
        folder: Empty folder to fill.
        progress: Listener.
    """
    from falsework.report.report import write_report

    progress.stage("report", 0)
    surveys = sorted(name.partition("/")[2] for name in inputs if name.startswith("capture/"))
    pairs = {survey: (inputs[f"capture/{survey}"], inputs.get(f"cloud/{survey}")) for survey in surveys}
    write_report(folder / "report.html", settings["title"], inputs["stage"], pairs)


def root_layer(stage: Path, variant: str = "") -> Path:
    """Find the root layer of a stage.

    Args:
        stage: A USD file, or a scene folder.
        variant: Name of a variant of the scene, or empty for the scene as it is.
    """
    name = f"variant_{variant}.usda" if variant else "scene.usda"
    return inside(stage, name) if stage.is_dir() else stage


STAGES: dict[str, Stage] = {
    "stage": Stage(9, author),
    "capture": Stage(10, capture, resumes=True),
    "cloud": Stage(13, cloud, resumes=True),
    "report": Stage(5, report),
}
