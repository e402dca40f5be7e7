"""The Python API: `author`, `swap`, `render`, `reconstruct`, `sample` and `run` as functions, for scripts.

Each writes one output folder, replacing an earlier one that Falsework wrote, and returns its content. Every path may be
a `str` or a `pathlib.Path`. The readers are in `falsework.api_reading`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from falsework.api_reading import read_capture, read_cloud, scenario_of
from falsework.arguments import (
    check,
    check_progress,
    check_text,
    flag,
    gigabytes,
    of_python,
    path_of,
    whole,
    whole_numbers,
)
from groundwork.errors import InputError
from groundwork.progress import SILENT, Progress

if TYPE_CHECKING:
    from falsework.pipeline import Outcome
    from falsework.scenario import Scenario
    from recon.cloud import Cloud
    from recon.sampling.sampler_settings import AirborneSettings, MeshSettings, MobileSettings, TerrestrialSettings
    from recon.settings import ReconSettings
    from render.capture import Capture
    from render.settings import RenderSettings

S = TypeVar("S")


@of_python
def author(
    scenario: Scenario | Mapping[str, Any],
    out: str | PathLike[str],
    *,
    scene: int = 0,
    progress: Progress = SILENT,
) -> Path:
    """Author the layered USD stage of one scene.

    Args:
        scenario: A scenario from `load_scenario`, or a dict of its sections and keys.
        out: Folder to write: the scene folder itself.
        scene: Number of the scene.
        progress: Listener.

    Returns:
        Path of `scene.usda`.

    Raises:
        InputError: A key or value that is not allowed, or an output folder that Falsework did not write or that was
            edited since.

    Example:
        >>> scene = falsework.author({"bridge": {"family": "beam"}, "background": {"name": "none"}}, "scene")
    """
    from falsework.commands.verbs import author_file

    check_progress(progress)
    return author_file(_scenario(scenario), path_of(out, "out"), whole(scene, "scene"), progress)


@of_python
def swap(
    scene: str | PathLike[str],
    out: str | PathLike[str],
    *,
    look: str | PathLike[str] | None = None,
    background: str | PathLike[str] | None = None,
    light: str | None = None,
    taxonomy: str | None = None,
    allow_roots: str | PathLike[str] | Iterable[str | PathLike[str]] = (),
    progress: Progress = SILENT,
) -> Path:
    """Copy a scene, and swap layers of the copy: no camera and no part of the bridge moves.

    Args:
        scene: Scene folder, its root layer, or a folder of a run such as `out/scenes/0000`.
        out: Folder to make; an existing one is never replaced, since it may hold edits.
        look: clean, weathered, aged or random, a USD file with materials named like the roles, or a folder or ZIP file
            of surfaces.
        background: none, countryside, city, lakeside or hillside, a USD file, or the folder of an imported world.
        light: Name of a light of the scene, a date and time such as `2024-12-21T10:00`, or a photographed sky (`.hdr`,
            `.exr`).
        taxonomy: Name of another class table.
        allow_roots: One or more further folders from which your own files may load layers and textures.
        progress: Listener.

    Returns:
        Path of the copy's `scene.usda`.

    Raises:
        InputError: No such scene, layer or file, or the output folder exists.

    Example:
        >>> evening = falsework.swap(scene, "evening", light="2024-06-21T20:00", background="none")
    """
    from shutil import rmtree

    from authoring.scenes.checkout import checkout_scene
    from falsework.commands.scene_verbs import choose_layers

    check_progress(progress)
    asked = {"look": look, "background": background, "light": light, "taxonomy": taxonomy}
    choices = {axis: str(path_of(value, axis)) for axis, value in asked.items() if value is not None}
    place = path_of(out, "out")
    copy = checkout_scene(path_of(scene, "scene"), place)
    try:
        if choices:
            choose_layers(copy, choices, "", None, tuple(_roots(allow_roots)), progress)
    except BaseException:
        rmtree(place)  # ours: it was made above
        raise
    return copy


@of_python
def render(
    stage: str | PathLike[str],
    out: str | PathLike[str],
    *,
    survey: str | None = None,
    settings: RenderSettings | None = None,
    seed: int = 7,
    allow_roots: str | PathLike[str] | Iterable[str | PathLike[str]] = (),
    progress: Progress = SILENT,
) -> dict[str, Capture]:
    """Render any USD stage: one capture for each of its RenderProducts or, if it has none, for each camera.

    Args:
        stage: USD file.
        out: Folder to write; it gets one folder for each capture.
        survey: Only this product or camera.
        settings: Settings of the renderer; `RenderSettings()` if None.
        seed: Seed of the sensor's noise, 0 or more.
        allow_roots: One or more further folders from which the stage may load layers and textures.
        progress: Listener.

    Returns:
        Dict from the name of each product to its capture.

    Raises:
        InputError: No such file or product, nothing to render, a negative seed, or an output folder that Falsework did
            not write.

    Example:
        >>> flight = falsework.render(scene, "captures")["global"]
    """
    from falsework.commands.given_settings import check_seed
    from falsework.commands.verbs import render_file
    from render.settings import RenderSettings

    check_progress(progress)
    check_text(survey, "survey")
    seed = whole(seed, "seed")
    check_seed(seed, "seed")
    told = _settings(RenderSettings() if settings is None else settings, RenderSettings).model_dump(mode="json")
    place = path_of(out, "out")
    names = render_file(path_of(stage, "stage"), place, survey, told, seed, progress, allow_roots=_roots(allow_roots))
    return {name: read_capture(place / name) for name in names}


@of_python
def reconstruct(
    capture: Capture | str | PathLike[str],
    out: str | PathLike[str],
    *,
    settings: ReconSettings | None = None,
    control: str | PathLike[str] | None = None,
    model: str | PathLike[str] | None = None,
    progress: Progress = SILENT,
) -> Cloud:
    """Reconstruct a cloud from a capture or a folder of photographs; with labels if the capture has its truth.

    Args:
        capture: A capture, its folder, or a folder of JPEG or PNG files.
        out: Folder to write.
        settings: Settings of the reconstruction; `ReconSettings()` if None. For both a sparse and a dense cloud, call
            twice: the second time with the folder of the first as `model`, so that structure from motion is not
            repeated.
        control: File of ground control points and scale bars.
        model: Cloud whose cameras are reused.
        progress: Listener.

    Returns:
        The cloud.

    Raises:
        InputError: The capture is damaged, the settings ask for several clouds, or Falsework did not write the output
            folder.
        RejectedSceneError: The images do not suffice for a cloud; its reason says why.

    Example:
        >>> cloud = falsework.reconstruct(flight, "cloud", settings=falsework.ReconSettings(mode="dense"))
    """
    from falsework.commands.verbs import reconstruct_folder
    from recon.settings import ReconSettings
    from render.capture import Capture

    check_progress(progress)
    wanted = _settings(ReconSettings() if settings is None else settings, ReconSettings)
    if len(wanted.modes) > 1:
        raise InputError(
            "makes one cloud per call",
            field="mode",
            value=wanted.mode,
            allowed=", ".join(wanted.modes),
            hint="Call twice, the second time with the first cloud as model",
        )
    folder = capture.folder if isinstance(capture, Capture) else path_of(capture, "capture")
    points = None if control is None else path_of(control, "control")
    cameras = None if model is None else path_of(model, "model")
    (place,) = reconstruct_folder(folder, path_of(out, "out"), wanted, progress, points, cameras)
    return read_cloud(place)


@of_python
def sample(
    stage: str | PathLike[str],
    out: str | PathLike[str],
    settings: MeshSettings | TerrestrialSettings | MobileSettings | AirborneSettings,
    *,
    allow_roots: str | PathLike[str] | Iterable[str | PathLike[str]] = (),
    progress: Progress = SILENT,
) -> Cloud:
    """Make a cloud from a stage without images: points on its surface, or a simulated laser scan.

    Args:
        stage: USD file.
        out: Folder to write.
        settings: The sampler: `MeshSettings`, `TerrestrialSettings` (a tripod), `MobileSettings` or `AirborneSettings`.
        allow_roots: One or more further folders from which the stage may load files.
        progress: Listener.

    Returns:
        The cloud.

    Raises:
        InputError: No such file, nothing to sample, or an output folder that Falsework did not write.

    Example:
        >>> scan = falsework.sample(scene, "scan", falsework.TerrestrialSettings(reach=40.0))
    """
    from falsework.commands.verbs import sample_file
    from recon.sampling.sampler_settings import SCANNERS, MeshSettings

    check_progress(progress)
    _settings(settings, MeshSettings, *SCANNERS.values())
    kind = "mesh" if isinstance(settings, MeshSettings) else settings.kind
    place = path_of(out, "out")
    sample_file(path_of(stage, "stage"), place, kind, settings, progress, _roots(allow_roots))
    return read_cloud(place)


@of_python
def run(
    scenario: Scenario | Mapping[str, Any],
    out: str | PathLike[str],
    *,
    scenes: Iterable[int] | None = None,
    retry_failed: bool = False,
    workers: int = 0,
    cluster: str | None = None,
    memory: float | None = None,
    progress: Progress = SILENT,
) -> Outcome:
    """Run the whole chain for many scenes; finished results are reused, and several processes may share one folder.

    Args:
        scenario: A scenario from `load_scenario`, or a dict of its sections and keys.
        out: Output folder.
        scenes: Numbers of the scenes to run; None: all.
        retry_failed: Retry tasks that failed in an earlier run.
        workers: Number of worker processes on this machine; 0: run in this process. Each worker reads the calling
            script again, so that the script must call `run` below `if __name__ == "__main__":`.
        cluster: Address of a Dask scheduler.
        memory: Limit of the memory of all processes of the run together, or of each worker of a cluster [GB]; None:
            nine tenths of the machine's.
        progress: Listener.

    Returns:
        Counts, paths, failures and warnings.

    Raises:
        InputError: A value that is not allowed, workers that do not start, or an output folder that Falsework did not
            write.
        FalseworkError: The disk is full, or the cluster does not answer any more.

    Example:
        >>> if __name__ == "__main__":
        ...     outcome = falsework.run(falsework.load_scenario("bridges.toml"), "out", workers=2)
    """
    from falsework.pipeline import run_scenario

    check_progress(progress)
    check_text(cluster, "cluster")
    how: dict[str, Any] = {
        "retry_failed": flag(retry_failed, "retry_failed"),
        "workers": whole(workers, "workers"),
        "cluster": cluster,
    }
    how["memory"] = gigabytes(memory, "memory")
    numbers = None if scenes is None else whole_numbers(scenes, "scenes")
    return run_scenario(_scenario(scenario), path_of(out, "out"), progress, numbers, **how)


@of_python
def save_cloud(cloud: Cloud, out: str | PathLike[str]) -> None:
    """Write a cloud to a folder.

    Args:
        cloud: The cloud.
        out: Folder to write; an earlier output of Falsework there is replaced.

    Raises:
        InputError: A column is missing or of a wrong shape or type, or Falsework did not write the output folder.

    Example:
        >>> falsework.save_cloud(cloud, "copy")
    """
    from groundwork.output.folder import fresh_output
    from recon.cloud import Cloud, write_cloud

    check(cloud, "cloud", Cloud, "a Cloud; a folder of one is read by read_cloud")
    fresh_output(path_of(out, "out"), "cloud", lambda folder: write_cloud(folder, cloud))


def _scenario(given: Scenario | Mapping[str, Any]) -> Scenario:
    from falsework.scenario import Scenario

    return given if isinstance(given, Scenario) else scenario_of(given)


def _roots(allowed: str | PathLike[str] | Iterable[str | PathLike[str]]) -> tuple[Path, ...]:
    """Accept a single folder too: a str must not be read as a list of letters."""
    several = allowed if isinstance(allowed, Iterable) and not isinstance(allowed, str | PathLike) else (allowed,)
    return tuple(path_of(root, "allow_roots") for root in several)


def _settings(given: S, *kinds: type[Any]) -> S:
    if not isinstance(given, kinds):
        raise InputError(
            "of a wrong class",
            field="settings",
            value=type(given).__name__,
            allowed=", ".join(kind.__name__ for kind in kinds),
        )
    return given
