"""The verbs of `falsework survey`: flights, judged before they are rendered."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from falsework.children.products import read_safely
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_settings import given_settings
from groundwork.errors import InputError

WORKER = "falsework.children.survey_work"
JSON_VERSION = 1
_FIGURE = ("centres", "looks", "outline")  # what only the figure needs

File = tyro.conf.Positional[Path]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]


def score(
    scene: File,
    *,
    survey: str = "",
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    allow_root: tuple[Path, ...] = (),
    as_json: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> int:
    """Judge flights by casting rays: clearance, overlap, coverage, and how much of them a reconstruction will link.

    Args:
        scene: Root layer of a scene, or any other USD file with cameras.
        survey: Only this one.
        output: HTML page to write, with plan, elevation and 3D.
        allow_root: Folders beside that of the scene from which it may take files.
        as_json: Print one JSON object instead of lines.
    """
    request: dict[str, Any] = {
        "scene": str(scene.absolute()), "survey": survey, "allow_roots": [str(root.absolute()) for root in allow_root],
    }  # fmt: skip
    with ConsoleProgress() as progress:
        found: list[dict[str, Any]] = read_safely(WORKER, request, scene, progress)
    if not found:
        raise InputError("has no flight to judge", where=scene, mend="Author it with a survey, or animate a camera")
    if output is not None:
        from falsework.report.survey_figures import write_page

        write_page(output, found)
    if as_json:
        plain = [{key: value for key, value in row.items() if key not in _FIGURE} for row in found]
        sys.stdout.write(json.dumps({"version": JSON_VERSION, "surveys": plain}, sort_keys=True) + "\n")
        return 0
    for row in found:
        _tell(row)
    if output is not None:
        _say(f"page        {output}")
    return 0


def plan(
    scene: File,
    *,
    kind: Literal["global", "local", "grid", "stage"] = "local",
    name: str = "",
    seed: int | None = None,
    set: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
) -> int:
    """Fly one more survey over a scene of ours and add it as a layer; a former one of that name is replaced.

    Args:
        scene: Root layer of an editable scene (`scene checkout` gives one).
        kind: Kind of survey; stage takes a camera that is there already, such as one animated in Blender.
        name: Its id; that of the kind when left out.
        seed: Another flight than the scene's own seed gives.
        set: A setting of the survey, such as `length=30` or `pitch=free`; may be given more than once.
    """
    settings: dict[str, Any] = {"kind": kind, **given_settings(set), **({"id": name} if name else {})}
    request = {"plan": settings, "scene": str(scene.absolute()), "seed": seed, "survey": "", "allow_roots": []}
    with ConsoleProgress() as progress:
        found: list[dict[str, Any]] = read_safely(WORKER, request, scene, progress)
    _say(f"survey      {found[0]['survey']}: {found[0]['images']} images, {found[0]['length']:.0f} m")
    return 0


def _tell(row: dict[str, Any]) -> None:
    median, worst = row["sampling"]
    _say(f"survey      {row['survey']}: {row['images']} images, {row['length']:.0f} m, {row['duration']:.0f} s")
    _say(f"clearance   {row['clearance']:.2f} m at least")
    _say(f"overlap     {100.0 * row['overlap']:.0f} % with the next image")
    _say(f"linked      {100.0 * row['linked']:.0f} % of the images, as predicted")
    _say(f"sampling    {1e3 * median:.1f} mm a pixel, {1e3 * worst:.1f} mm at the 95th percentile")
    _say(f"base angle  {row['base_angle']:.0f} degrees")
    shares = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in row["by_class"].items())
    _say(f"covered     by 3 cameras at 60 degrees or less: {shares}")
    for line in row["warnings"]:
        _say(f"warning     {line}")


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


SURVEY_VERBS = {"plan": plan, "score": score}
