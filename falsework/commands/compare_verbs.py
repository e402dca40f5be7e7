"""The verb that compares methods of making training clouds: the same bridges, windows, steps and seeds for each."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from falsework.commands.answers import AsJson, answer, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_folder
from falsework.commands.given_settings import given_settings
from groundwork.errors import InputError
from groundwork.files import write_json, write_text
from groundwork.output.file import SIGNATURE, check_output_file, write_fresh_file
from groundwork.output.folder import check_run, claim_run
from groundwork.output.reading import reading

if TYPE_CHECKING:
    from falsework.commands.comparison import Experiment

FORMAT_VERSION = 1
TABLES, PAGE = "comparison.json", "comparison.md"

Sources = tyro.conf.Positional[Annotated[tuple[str, ...], tyro.conf.arg(metavar="[NAME=]FOLDER ...")]]
Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
Given = tyro.conf.UseAppendAction[tuple[str, ...]]


def compare(
    sources: Sources,
    output: Output,
    *,
    preset: str = "sensor-matrix",
    plan: bool = False,
    page: Path | None = None,
    bridge: Given = (),
    set: Given = (),
    as_json: AsJson = False,
) -> int:
    """Train arms that differ only in their clouds, test each on the same bridges, and give confidence intervals.

    Every training is stored under its key: an interrupted command can be repeated, and several commands may share OUT.
    Start with --plan. Needs the extra learn.

    Args:
        sources: Output folders of runs, folders of single bridges with a folder for each cloud, or folders of such
            folders; `NAME=FOLDER` puts its bridges into the set of that name.
        output: Folder to write: results, comparison.json and comparison.md.
        preset: sensor-matrix, sparse-or-dense, uncertainty-filter, task-local-1, task-local-2, task-local-3, global, or
            a TOML file of your own (docs/comparisons.md).
        plan: Only show what would be made, with hours and disk space.
        page: Also write the tables to this Markdown file.
        bridge: Name of the bridge of each source whose clouds do not state it; once for each source, in their order.
        set: A further setting, such as `seeds=8`, `steps=2000` or `tile.voxel=0.1`; may be given more than once.
        as_json: Print one JSON object instead of lines.
    """
    from falsework.commands.dataset_verbs import nested
    from learn.compare.preset import preset_values

    preset_values(preset)
    changed = nested(given_settings(set))
    named = [_named(text) for text in sources]
    inputs = [folder for _, folder in named]
    for folder in inputs:
        need_folder(folder, "a run, or a folder with a bridge's clouds")
    from falsework.commands.comparison import open_experiment
    from learn.compare.experiment import experiment_settings

    settings = experiment_settings(preset, changed)
    if page is not None:
        check_output_file(page, [*inputs, output])
    with ConsoleProgress() as progress, reading(*inputs):
        experiment = open_experiment(settings, named, bridge, output, progress)
        if plan:
            check_run(output, inputs)
            return _tell_plan(experiment, as_json)
        claim_run(output, inputs)
        record = _run(experiment, _command(sources, preset, bridge, set))
    text = _write(record, output)
    if page is not None:
        write_fresh_file(page, f"{text}\n<!-- {SIGNATURE} -->\n".encode(), [*inputs, output])
    counts = {"made": experiment.made, "reused": experiment.reused}
    if as_json:
        return answer({**counts, **record})
    sys.stdout.write(_lines(record, counts, output))
    return 0


def _tell_plan(experiment: "Experiment", as_json: bool) -> int:
    from falsework.commands.compare_plan import plan_lines, planned

    found = planned(experiment)
    return tell(found, plan_lines(found), as_json)


def _run(experiment: "Experiment", command: str) -> dict[str, Any]:
    """Make the missing results, and summarize."""
    from learn.compare.findings import findings
    from learn.compare.selection import losses_of

    scenes, trials = experiment.prepare()
    settings = experiment.settings
    for name in settings.tests:
        if not any(trial.tests[name].work for trial in trials):
            raise InputError(
                "no window of the test bridges is valid",
                field=f"tests.{name}",
                value=settings.tests[name],
                hint="Lower fewest, or give more bridges",
            )
    experiment.make_all({one.training.task.key: one.training for one in trials}.values())
    tests = {job.task.key: job for one in trials for job in one.tests.values()}
    experiment.make_all(tests.values())
    experiment.store.sweep()
    losses = losses_of(scenes, experiment.splits, settings)
    classes = settings.cut.classes
    return {
        "format": "falsework.comparison",
        "format_version": FORMAT_VERSION,
        "title": settings.title or "Comparison",
        "classes": list(classes),
        "groups": [list(group) for group in settings.groups],
        "level": settings.level,
        "draws": settings.draws,
        "settings": settings.model_dump(mode="json"),
        "facts": _facts(experiment),
        "losses": [vars(row) for row in losses],
        **findings(experiment.read_trials(trials), classes, settings),
        "command": command,
    }


def _facts(experiment: "Experiment") -> list[str]:
    """Describe the comparison in lines."""
    settings, splits = experiment.settings, experiment.splits
    kept = {
        arm: f", points up to {settings.kept(arm):g} m of uncertainty" if arm in settings.filters else ""
        for arm in settings.arms
    }
    lines = [f"arm `{arm}`: {', '.join(map(str, settings.parts(arm)))}{kept[arm]}" for arm in settings.arms]
    lines += [f"test `{name}`: {settings.test(name)}" for name in settings.tests]
    for name in dict.fromkeys(one.set for one in experiment.bridges):
        of_set = [split for (own, _), split in splits.items() if own == name]
        counts = ", ".join(
            f"{of_set.count(split)} {word}"
            for split, word in (("train", "to train on"), ("val", "for validation"), ("test", "for the test"))
        )
        lines.append(f"bridges of the set `{name}`: {counts}")
    cut = {
        "metric": f"tiles of {settings.tile.size:g} m, one point in each {settings.tile.voxel:g} m, heights above "
        "a ground estimated from each cloud",
        "paper": f"windows of {settings.window.length:g} m, each scaled to the cube from 0 to 1",
        "whole": "draws from whole bridges",
    }[settings.mode]
    lines.append(
        f"{cut}; {settings.points:,} points a draw, valid from {settings.fewest:,}, table `{settings.table}`, "
        f"inputs {', '.join(settings.channels)}"
    )
    if set(settings.models) - {"forest"}:
        steps = settings.samples_each // settings.batch * settings.looks
        lines.append(
            f"networks: {steps:,} steps of {settings.batch} samples in every arm, recipe `{settings.recipe}`, "
            f"weights of the best of {settings.looks} validations"
        )
        if settings.accelerator == "gpu":
            lines.append("networks were trained and tested on a GPU: another run gives slightly different figures")
    if "forest" in settings.models:
        lines.append(f"forest: {settings.forest_draws:,} draws in every arm, no selection by validation")
    lines.append(f"seeds {settings.first_seed} to {settings.first_seed + settings.seeds - 1}, the same in every arm")
    return lines


def _write(record: dict[str, Any], output: Path) -> str:
    from learn.compare.tables import page

    text = page(record)
    write_json(output / TABLES, record)
    write_text(output / PAGE, text)
    return text


def _lines(record: dict[str, Any], counts: dict[str, int], output: Path) -> str:
    from learn.compare.tables import weakness

    lines = [
        f"{row['model']:<16}{row['test']:<14}{row['first']} - {row['second']}: {100 * row['difference']:+.1f}"
        + (
            ""
            if row["interval"] is None
            else f" ({100 * row['interval'][0]:+.1f} to {100 * row['interval'][1]:+.1f}) points of mean IoU"
        )
        for row in record["differences"]
    ]
    if not lines:  # one arm: nothing to compare
        lines = [
            f"{row['model']:<16}{row['test']:<14}{row['arm']}: {100 * (row['mean_iou'] or 0.0):.1f} % mean IoU"
            for row in record["scores"]
        ]
    if few := weakness(record):
        lines.append(f"weak    {few}: see how wide the intervals are")
    lines.append(f"made    {counts['made']}, {counts['reused']} reused")
    return "\n".join([*lines, f"tables  {output / PAGE}"]) + "\n"


def _named(text: str) -> tuple[str, Path]:
    from learn.compare.preset import DEFAULT_SET

    name, equals, folder = text.partition("=")
    if equals and name.replace("-", "").replace("_", "").isalnum() and not Path(text).exists():
        return name, Path(folder)
    return DEFAULT_SET, Path(text)


def _command(sources: tuple[str, ...], preset: str, bridges: tuple[str, ...], given: tuple[str, ...]) -> str:
    """Format the command with names of folders instead of their paths."""
    short = [
        f"{name}={Path(folder).name}" if equals else Path(text).name
        for text in sources
        for name, equals, folder in [text.partition("=")]
    ]
    preset = Path(preset).name
    words = [*short, "--preset", preset]
    words += [word for name in bridges for word in ("--bridge", name)]
    words += [word for setting in given for word in ("--set", setting)]
    return "falsework compare " + shlex.join(words) + " -o OUT"
