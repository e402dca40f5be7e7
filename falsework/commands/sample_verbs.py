"""The verbs of `falsework sample`: clouds from a stage without images, with the labels of the surface."""

from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from falsework.commands.answers import AsJson, cloud_facts, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_settings import given_settings
from groundwork.settings import Settings, parse_settings

File = tyro.conf.Positional[Path]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
Given = tyro.conf.UseAppendAction[tuple[str, ...]]


def mesh(
    stage: File,
    output: Output,
    *,
    points: int | None = None,
    density: float = 100.0,
    scope: Literal["bridge", "near"] = "near",
    reach: float = 10.0,
    visible: bool = False,
    seed: int = 0,
    set: Given = (),
    allow_root: tuple[Path, ...] = (),
    as_json: AsJson = False,
) -> int:
    """Sample points on the surface of a stage, uniformly by area.

    Args:
        stage: USD file.
        output: Folder to write: a cloud.
        points: Number of points; default: from the density.
        density: Points per square meter.
        scope: Only the bridge, or everything near it.
        reach: Distance of `near` beyond the bridge's bounding box [m].
        visible: Only points that at least one camera of the stage's surveys sees.
        seed: Seed of every random draw.
        set: A further setting, such as `noise=0.005` or `min_views=3`; may be given more than once.
        allow_root: Further folders from which the stage may load files.
        as_json: Print one JSON object instead of lines.
    """
    from recon.sampling.sampler_settings import MeshSettings

    settings: dict[str, Any] = {"density": density, "scope": scope, "reach": reach, "seed": seed}
    settings |= {"points": points} if points is not None else {}
    settings |= {"min_views": 1} if visible else {}
    given = given_settings(set)
    checked = parse_settings(MeshSettings, settings | given, "--set", settings.keys() - given.keys())
    return _sample("mesh", checked, stage, output, allow_root, as_json)


def lidar(
    stage: File,
    output: Output,
    *,
    kind: Literal["terrestrial", "mobile", "airborne"] = "terrestrial",
    scope: Literal["bridge", "near"] = "near",
    reach: float | None = None,
    seed: int = 0,
    set: Given = (),
    allow_root: tuple[Path, ...] = (),
    as_json: AsJson = False,
) -> int:
    """Scan a stage with a laser: from a tripod, along the deck or a survey's path, or from an aircraft.

    Args:
        stage: USD file.
        output: Folder to write: a cloud.
        kind: Kind of scanner.
        scope: Keep only the points on the bridge, or on everything near it.
        reach: Distance of `near` beyond the bridge's bounding box; default: 10, for an aircraft 100 [m].
        seed: Seed of every random draw.
        set: A further setting, such as `angular_step=0.1`, `positions=[[5, -12, 1.8]]` or `path=global`; may be given
            more than once.
        allow_root: Further folders from which the stage may load files.
        as_json: Print one JSON object instead of lines.
    """
    from recon.sampling.sampler_settings import SCANNERS

    settings: dict[str, Any] = {"scope": scope, "seed": seed} | ({} if reach is None else {"reach": reach})
    given = given_settings(set)
    asked = settings | given | {"kind": kind}
    checked = parse_settings(SCANNERS[kind], asked, "--set", settings.keys() - given.keys())
    return _sample(kind, checked, stage, output, allow_root, as_json)


def _sample(kind: str, settings: Settings, stage: Path, output: Path, roots: tuple[Path, ...], as_json: bool) -> int:
    from falsework.commands.verbs import sample_file

    with ConsoleProgress() as progress:
        sample_file(stage, output, kind, settings, progress, roots)
    return tell({"clouds": [cloud_facts(output)]} if as_json else {}, [f"cloud   {output}"], as_json)


SAMPLE_VERBS = {"mesh": mesh, "lidar": lidar}
