"""The verbs of `falsework survey`: plan flights, and score them before rendering."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from falsework.children.products import read_safely
from falsework.commands.answers import AsJson, answer, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import stage_file
from falsework.commands.given_settings import given_settings
from falsework.report.flight_verdicts import ENOUGH_LINKED, ENOUGH_OVERLAP, PARTLY, WELL, coverage_word, judged
from groundwork.errors import InputError
from groundwork.output.file import check_output_file, fresh_file

WORKER = "falsework.children.survey_work"
NAMED = 12  # ids in a line
_FIGURE = ("poses", "half", "outline")  # data for the page only

File = tyro.conf.Positional[Path]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]


def score(
    scene: File,
    *,
    survey: str = "",
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    allow_root: tuple[Path, ...] = (),
    propose: Annotated[bool, tyro.conf.arg(help_behavior_hint="(default: with legs)")] = True,
    as_json: AsJson = False,
) -> int:
    """Score flights by ray casting: clearance, overlap, coverage, registration, and members that no image shows.

    Args:
        scene: Scene folder, its root layer, or any other USD file with cameras.
        survey: Only this one.
        output: HTML page to write: flight in 3D, plan and elevation, coverage, and members that no flight shows.
        allow_root: Further folders from which the scene may load files.
        propose: The page proposes legs that show the members that no flight shows; with `--no-propose` it does not.
        as_json: Print one JSON object instead of lines.
    """
    stage = stage_file(scene)
    request: dict[str, Any] = {
        "scene": str(stage.absolute()),
        "survey": survey,
        "allow_roots": [str(root.absolute()) for root in allow_root],
        "propose": propose,
    }
    if output is not None:
        check_output_file(output, [scene])
    with ConsoleProgress() as progress:
        found: list[dict[str, Any]] = read_safely(WORKER, request, stage, progress)
    if not found:
        raise InputError(
            "has no flight to score", where=scene, hint="Author the scene with a survey, or animate a camera in it"
        )
    if output is not None:
        from falsework.report.survey_page import write_survey_page

        with fresh_file(output, [scene]) as temporary:
            write_survey_page(temporary, found, scene.name)
    if as_json:
        plain = [{key: value for key, value in row.items() if key not in _FIGURE} for row in found]
        return answer({"surveys": plain})
    for row in found:
        _tell(row)
    _tell_unseen(found[-1], scene)
    if output is not None:
        _say(f"page        {output}")
    return 0


def plan(
    scene: File,
    *,
    kind: Literal["global", "local", "grid", "inspection", "mix", "stage"] = "local",
    name: str = "",
    seed: int | None = None,
    members: Annotated[tuple[str, ...], tyro.conf.arg(name="for")] = (),
    set: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    as_json: AsJson = False,
) -> int:
    """Plan a further survey of an editable scene and add it as a layer; a survey of the same name is replaced.

    Args:
        scene: Folder or root layer of an editable scene (`scene checkout` gives one).
        kind: Kind of survey; stage uses an existing camera, such as one animated in Blender.
        name: Id of the survey; default: its kind.
        seed: Seed of the flight; default: that of the scene.
        members: Members to inspect: instance ids, classes, or `unseen` for all that no flight shows enough.
        set: A setting of the survey, such as `length=30` or `pitch=free`; may be given more than once.
        as_json: Print one JSON object instead of lines.
    """
    settings: dict[str, Any] = {"kind": kind, **given_settings(set), **({"id": name} if name else {})}
    if members and kind != "inspection":
        raise InputError("only for an inspection", field="--for", value=" ".join(members), allowed="--kind inspection")
    stage = stage_file(scene)
    request: dict[str, Any] = {
        "plan": settings,
        "scene": str(stage.absolute()),
        "seed": seed,
        "members": list(members),
        "survey": "",
        "allow_roots": [],
    }
    with ConsoleProgress() as progress:
        found: list[dict[str, Any]] = read_safely(WORKER, request, stage, progress)
    row = found[0]
    line = f"survey      {row['survey']}: {row['images']} images, {row['length']:.0f} m"
    return tell({key: row[key] for key in ("survey", "images", "length")}, [line], as_json)


def _tell(row: dict[str, Any]) -> None:
    median, worst = row["sampling"]
    _say(f"survey      {row['survey']}: {row['images']} images, {row['length']:.0f} m, {row['duration']:.0f} s")
    _say(f"clearance   at least {row['clearance']:.2f} m")
    _say(f"overlap     {100.0 * row['overlap']:.0f} % with the next image: {judged(row['overlap'], ENOUGH_OVERLAP)}")
    linked = row["linked"]
    _say(f"linked      {100.0 * linked:.0f} % of the images (prediction): {judged(linked, ENOUGH_LINKED)}")
    if median is None or worst is None:
        _say("sampling    no image sees the bridge at 60 degrees or less")
    else:
        _say(f"sampling    {1e3 * median:.1f} mm per pixel, {1e3 * worst:.1f} mm at the 95th percentile")
    _say(f"base angle  {row['base_angle']:.0f} degrees")
    for line in coverage_lines(row["by_class"]):
        _say(line)
    for line in row["warnings"]:
        _say(f"warning     {line}")


def coverage_lines(by_class: Mapping[str, float]) -> list[str]:
    """List the classes that a flight covers well, partly and poorly, the worst last.

    Args:
        by_class: Share of the surface that three cameras see at 60 degrees or less, by class [1].
    """
    words = {
        "well": f"well (from {100.0 * WELL:.0f} %)",
        "partly": f"partly (from {100.0 * PARTLY:.0f} %)",
        "poorly": "poorly: expect holes",
    }
    lines = ["covered     share of the surface that 3 cameras see at 60 degrees or less, with hidden faces:"]
    for word, said in words.items():
        found = sorted(
            ((share, name) for name, share in by_class.items() if coverage_word(share) == word), reverse=True
        )
        if found:
            lines.append(f"            {said}: " + ", ".join(f"{name} {100.0 * share:.0f} %" for share, name in found))
    return lines


def _tell_unseen(row: dict[str, Any], scene: Path) -> None:
    """List the members that too few images of all flights show, and legs that would show them."""
    for name, few in row["hardly_seen"].items():
        never = f", {len(few['never'])} never" if few["never"] else ""
        ids = " ".join(str(number) for number in few["members"][:NAMED])
        more = " …" if len(few["members"]) > NAMED else ""
        count = f"{len(few['members'])} of {few['of']} in fewer than 3 images of 50 px{never}"
        _say(f"unseen      {name}: {count}: {ids}{more}")
    proposal = row.get("proposal")
    if not proposal:
        return
    if proposal["refused"]:
        _say(f"proposed    no legs: {proposal['refused']}")
        return
    shown, hidden = len(proposal["shown"]), len(proposal["hidden"])
    _say(f"proposed    {proposal['images']} images that show {shown} of these {shown + hidden} members; command:")
    _say(f"            falsework survey plan {scene} --kind inspection --for unseen")
    if hidden:
        _say(
            f"hidden      unseen from all free places: {' '.join(str(number) for number in proposal['hidden'][:NAMED])}"
        )


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


SURVEY_VERBS = {"plan": plan, "score": score}
