"""The verbs as functions: what `falsework author`, `render`, `reconstruct`, `sample` and `run` do, for scripts.

Each writes one folder as a whole, in place of a former one of ours, and gives back what lies in it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

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


def author(
    scenario: Scenario | Mapping[str, Any], out: Path | str, *, scene: int = 0, progress: Progress = SILENT
) -> Path:
    """Author the layered USD stage of one scene.

    Args:
        scenario: What to make: of `load_scenario`, or the sections and keys of its file.
        out: Folder to write: the scene folder itself.
        scene: Number of the scene.
        progress: Listener.

    Returns:
        Path of `scene.usda`.

    Raises:
        InputError: A key or value that is not allowed, or a folder that is not ours or was edited since.

    Example:
        >>> scene = falsework.author({"bridge": {"family": "beam"}, "background": {"name": "none"}}, "scene")
    """
    from falsework.commands.verbs import author_file
    from falsework.scenario import Scenario, scenario_of

    wanted = scenario if isinstance(scenario, Scenario) else scenario_of(scenario)
    return author_file(wanted, Path(out), scene, progress)


def render(
    stage: Path | str,
    out: Path | str,
    *,
    survey: str | None = None,
    settings: RenderSettings | None = None,
    seed: int = 7,
    allow_roots: Path | str | Iterable[Path | str] = (),
    progress: Progress = SILENT,
) -> dict[str, Capture]:
    """Render any USD stage: a capture for each of its RenderProducts, or for each camera where it has none.

    Args:
        stage: USD file.
        out: Folder to write, a folder for each capture in it.
        survey: Only this product or camera.
        settings: How to draw it; `RenderSettings()` when None.
        seed: Seed of the sensor's noise.
        allow_roots: A folder, or several, beside that of the stage from which it may take layers and textures.
        progress: Listener.

    Returns:
        Name of each product to its capture.

    Raises:
        InputError: No such file or product, nothing to render, or an output folder that is not ours.

    Example:
        >>> flight = falsework.render(scene, "captures")["global"]
    """
    from falsework.commands.verbs import render_file
    from render.capture import read_capture
    from render.settings import RenderSettings

    told = _settings(settings or RenderSettings(), RenderSettings).model_dump(mode="json")
    names = render_file(Path(stage), Path(out), survey, told, seed, progress, allow_roots=_roots(allow_roots))
    return {name: read_capture(Path(out) / name) for name in names}


def reconstruct(
    capture: Capture | Path | str,
    out: Path | str,
    *,
    settings: ReconSettings | None = None,
    control: Path | None = None,
    model: Path | None = None,
    progress: Progress = SILENT,
) -> Cloud:
    """Reconstruct a capture, or a folder of photographs, into a cloud; annotated where the capture has its truth.

    Args:
        capture: A capture, its folder, or a folder of JPEG or PNG files.
        out: Folder to write.
        settings: What to do; `ReconSettings()` when None. For both a sparse and a dense cloud, call twice: the second
            time with the folder of the first as `model`, so that the cameras are not looked for again.
        control: File of ground control points and scale bars.
        model: Cloud whose cameras are taken over.
        progress: Listener.

    Returns:
        The cloud.

    Raises:
        InputError: The capture is damaged, the settings ask for several clouds, or an output folder that is not ours.
        RejectedSceneError: The images cannot become a cloud; its reason says why.

    Example:
        >>> cloud = falsework.reconstruct(flight, "cloud", settings=falsework.ReconSettings(mode="dense"))
    """
    from falsework.commands.verbs import reconstruct_folder
    from recon.cloud import read_cloud
    from recon.settings import ReconSettings
    from render.capture import Capture

    wanted = _settings(settings or ReconSettings(), ReconSettings)
    if len(wanted.modes) > 1:
        raise InputError(
            "one cloud per call",
            field="mode",
            value=wanted.mode,
            allowed=", ".join(wanted.modes),
            hint="Call twice, the second time with the first cloud as model",
        )
    folder = capture.folder if isinstance(capture, Capture) else Path(capture)
    (place,) = reconstruct_folder(folder, Path(out), wanted, progress, control, model)
    return read_cloud(place)


def sample(
    stage: Path | str,
    out: Path | str,
    settings: MeshSettings | TerrestrialSettings | MobileSettings | AirborneSettings,
    *,
    allow_roots: Path | str | Iterable[Path | str] = (),
    progress: Progress = SILENT,
) -> Cloud:
    """Make a cloud from a stage without any image: points on its surface, or the scan of a laser.

    Args:
        stage: USD file.
        out: Folder to write.
        settings: The sampler: `MeshSettings`, `TerrestrialSettings` (a tripod), `MobileSettings` or `AirborneSettings`.
        allow_roots: A folder, or several, beside that of the stage from which it may take files.
        progress: Listener.

    Returns:
        The cloud.

    Raises:
        InputError: No such file, nothing to sample, or an output folder that is not ours.

    Example:
        >>> scan = falsework.sample(scene, "scan", falsework.TerrestrialSettings(reach=40.0))
    """
    from falsework.commands.verbs import sample_file
    from recon.cloud import read_cloud
    from recon.sampling.sampler_settings import SCANNERS, MeshSettings

    _settings(settings, MeshSettings, *SCANNERS.values())
    kind = "mesh" if isinstance(settings, MeshSettings) else settings.kind
    sample_file(Path(stage), Path(out), kind, settings, progress, _roots(allow_roots))
    return read_cloud(Path(out))


def run(
    scenario: Scenario | Mapping[str, Any],
    out: Path | str,
    *,
    scenes: Iterable[int] | None = None,
    retry_failed: bool = False,
    workers: int = 0,
    cluster: str | None = None,
    progress: Progress = SILENT,
) -> Outcome:
    """Run the whole chain for many scenes, or what is left of it; several processes may do so in one folder.

    Args:
        scenario: What to make: of `load_scenario`, or the sections and keys of its file.
        out: Output folder.
        scenes: Their numbers; all when None.
        retry_failed: Try again what failed before.
        workers: Processes of this machine; 0 works in this one.
        cluster: Address of a Dask scheduler.
        progress: Listener.

    Returns:
        Counts, paths, failures and warnings.

    Raises:
        InputError: A value that is not allowed, an output folder that is not ours, or no room on the disk.

    Example:
        >>> outcome = falsework.run(falsework.load_scenario("bridges.toml"), "out", workers=2)
    """
    from falsework.pipeline import run_scenario
    from falsework.scenario import Scenario, scenario_of

    wanted = scenario if isinstance(scenario, Scenario) else scenario_of(scenario)
    return run_scenario(
        wanted, Path(out), progress, scenes, retry_failed=retry_failed, workers=workers, cluster=cluster
    )


def save_cloud(cloud: Cloud, out: Path | str) -> None:
    """Write a cloud into a folder of its own.

    Args:
        cloud: What to write.
        out: Folder to write; a former one of ours is replaced.

    Raises:
        InputError: A column is missing or of a wrong shape or type, or an output folder that is not ours.

    Example:
        >>> falsework.save_cloud(cloud, "copy")
    """
    from groundwork.output_folder import fresh_output
    from recon.cloud import write_cloud

    fresh_output(Path(out), "cloud", lambda folder: write_cloud(folder, cloud))


def _roots(allowed: Path | str | Iterable[Path | str]) -> tuple[Path, ...]:
    """Take one folder for what it is: the letters of its name are none."""
    return (Path(allowed),) if isinstance(allowed, Path | str) else tuple(Path(root) for root in allowed)


def _settings(given: S, *kinds: type[Any]) -> S:
    if not isinstance(given, kinds):
        raise InputError(
            "settings of a wrong class",
            field="settings",
            value=type(given).__name__,
            allowed=", ".join(kind.__name__ for kind in kinds),
        )
    return given
