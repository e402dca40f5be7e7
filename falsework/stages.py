"""The stages of the chain: each is a function from settings and inputs to a result."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from groundwork.child import run_child
from groundwork.progress import Progress
from groundwork.settings import parse_settings
from groundwork.slug import inside

if TYPE_CHECKING:
    from recon.settings import ReconSettings

RENDER_TIME_LIMIT = 6 * 3600.0  # [s] per survey
RENDER_MEMORY_LIMIT = 16.0  # [GB]
SAMPLE_TIME_LIMIT = 6 * 3600.0  # [s] per cloud
SAMPLE_MEMORY_LIMIT = 16.0  # [GB]

SEVERAL = "+"
"""What stands between the names of a survey and of one of its clouds, where it has several; no slug holds it."""

Run = Callable[[dict[str, Any], dict[str, Path], Path, Progress], None]


@dataclass(frozen=True)
class Stage:
    """One kind of task.

    Attributes:
        version: Increased by hand whenever the same settings would give another result.
        run: Function of the task's settings, the folders of its inputs, an empty folder to fill, and a listener.
        resumes: Whether it can continue in a folder that an interrupted run of the same task left.
    """

    version: int
    run: Run
    resumes: bool = False


def author(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Write a layered stage.

    Args:
        settings: `{seed, authoring, platform}`.
        inputs: `world/<name>`, `sky/<name>` and `surface/<name>`: each imported world, photographed sky and folder of
            surfaces that the scenario names.
        folder: Empty folder to fill.
        progress: Listener.
    """
    from authoring.scene import GivenFiles, author_scene
    from authoring.settings import AuthoringSettings

    given = {
        kind: {name[len(kind) :]: path for name, path in inputs.items() if name.startswith(kind)}
        for kind in ("world/", "sky/", "surface/")
    }
    authoring = parse_settings(AuthoringSettings, settings["authoring"], "scenario")
    files = GivenFiles(given["world/"], given["sky/"], given["surface/"])
    author_scene(authoring, settings["seed"], folder, progress, files)


def capture(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Render one survey of a stage, in a child process, because a graphics driver may crash and belongs to one process.

    Args:
        settings: `{seed, render, survey, platform}`, `variant` where one of the scene's variants is rendered, `choices`
            of camera, frames and the like where there are any, and `drawing`: how many processes and threads share the
            work.
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
            "choices": settings.get("choices"),
        },
        time_limit=RENDER_TIME_LIMIT,
        memory_limit=RENDER_MEMORY_LIMIT,
        progress=progress,
    )


def model(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Run structure from motion for a capture; its clouds are made from the model.

    Args:
        settings: `{recon, platform}`, and `limits` of time and memory.
        inputs: `capture`: a capture folder, or one of plain photographs.
        folder: Folder to fill: empty, or left by an interrupted run.
        progress: Listener.
    """
    from recon.reconstruct import reconstruct_model

    reconstruct_model(inputs["capture"], folder, _recon(settings), progress)


def cloud(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Make one cloud from a model, and annotate its points.

    Args:
        settings: `{recon, platform}`, and `limits` of time and memory.
        inputs: `capture`: a capture folder, or one of plain photographs; `model`: the folder of its model.
        folder: Folder to fill: empty, or left by an interrupted run.
        progress: Listener.
    """
    from recon.reconstruct import reconstruct_cloud

    reconstruct_cloud(inputs["capture"], inputs["model"], folder, _recon(settings), progress)


def _recon(settings: dict[str, Any]) -> "ReconSettings":
    """Combine the settings of a result and the limits of the work."""
    from recon.settings import ReconSettings

    values = dict(settings["recon"])
    for section, limits in settings.get("limits", {}).items():
        values[section] = {**values.get(section, {}), **limits}
    return parse_settings(ReconSettings, values, "scenario")


def sample(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Sample the surface of a stage as a cloud, in a child process, because the stage is untrusted.

    Args:
        settings: `{kind, sample, platform}`: mesh, terrestrial, mobile or airborne, and the settings of that sampler;
            `variant` where one of the scene's variants is sampled, and `allow_roots`: folders beside that of the stage
            from which it may take files.
        inputs: `stage`: the root layer, or the folder that holds `scene.usda`.
        folder: Empty folder to fill.
        progress: Listener.
    """
    request = {
        "kind": settings["kind"],
        "settings": settings["sample"],
        "folder": str(folder.resolve()),
        "stage": str(root_layer(inputs["stage"], settings.get("variant", "")).resolve()),
        "allow_roots": settings.get("allow_roots", []),
    }
    run_child(
        "falsework.children.sample_work",
        request,
        time_limit=SAMPLE_TIME_LIMIT,
        memory_limit=SAMPLE_MEMORY_LIMIT,
        progress=progress,
    )


def report(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Write the report page of one scene.

    Args:
        settings: `{title, platform}`.
        inputs: `stage`, for each survey `capture/<survey>`, and `cloud/<survey>`, or with several clouds
            `cloud/<survey>+sparse` and so on; `sample/<id>` for each sample.
        folder: Empty folder to fill.
        progress: Listener.
    """
    from falsework.report.report import write_report

    progress.stage("report", 0)
    surveys = sorted(name.partition("/")[2] for name in inputs if name.startswith("capture/"))
    clouds = {name.partition("/")[2]: path for name, path in inputs.items() if name.startswith("cloud/")}
    pairs = {survey: (inputs[f"capture/{survey}"], clouds_of(survey, clouds)) for survey in surveys}
    samples = {name.partition("/")[2]: path for name, path in inputs.items() if name.startswith("sample/")}
    write_report(folder / "report.html", settings["title"], inputs["stage"], pairs, samples)


def clouds_of(survey: str, clouds: dict[str, Path]) -> dict[str, Path]:
    """Choose the clouds of one survey.

    Args:
        survey: Name of its capture.
        clouds: Folder of each cloud by its name.

    Returns:
        Folder of each of its clouds by the suffix of its name, which is empty for a single cloud.
    """
    apart = {name: name.partition(SEVERAL) for name in sorted(clouds)}
    return {mode: clouds[name] for name, (own, _, mode) in apart.items() if own == survey}


def root_layer(stage: Path, variant: str = "") -> Path:
    """Find the root layer of a stage.

    Args:
        stage: A USD file, or a scene folder.
        variant: Name of a variant of the scene, or empty for none.
    """
    name = f"variant_{variant}.usda" if variant else "scene.usda"
    return inside(stage, name) if stage.is_dir() else stage


STAGES: dict[str, Stage] = {
    "stage": Stage(24, author),
    "capture": Stage(19, capture, resumes=True),
    "model": Stage(4, model, resumes=True),
    "cloud": Stage(16, cloud, resumes=True),
    "sample": Stage(1, sample),
    "report": Stage(14, report),
}
