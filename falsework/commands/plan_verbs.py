"""The verb that shows what a run would do."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from falsework.commands.answers import AsJson, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_scenario
from falsework.execution.parts import check_parts, scene_range
from groundwork.progress import duration

if TYPE_CHECKING:
    from falsework.execution.plan import Plan

COLUMNS = ("there", "let_go", "make", "rejected", "failed", "skipped")


def plan(
    scenario: tyro.conf.Positional[Path],
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    *,
    scenes: str | None = None,
    retry_failed: bool = False,
    as_json: AsJson = False,
) -> int:
    """Show what `run` would do: existing results, results to make, time and disk space; nothing is written.

    Args:
        scenario: TOML file.
        output: Output folder of the run; default: an empty one.
        scenes: Part of the scenes, as `first:end`.
        retry_failed: Plan for `run --retry-failed`.
        as_json: Print one JSON object instead of lines.
    """
    check_parts(scenes)
    need_scenario(scenario)
    from falsework.execution.plan import plan_run
    from falsework.scenario import load_scenario, values_of

    loaded = load_scenario(scenario)
    part = scene_range(scenes, loaded.scenes)
    with values_of(scenario), ConsoleProgress() as progress:
        found = plan_run(loaded, output, progress, part, retry_failed=retry_failed)
    return tell(_facts(found), [_as_text(found)], as_json)


def _facts(found: "Plan") -> dict[str, Any]:
    outcome = found.outcome
    counts = {"scenes": found.scenes, "scenes_to_do": found.scenes_to_do, "made": outcome.made}
    reasons = {"reused": outcome.reused, "rejected": outcome.rejected, "failed": outcome.failed}
    costs = {"seconds": found.seconds, "peak_bytes": found.peak_bytes, "free_bytes": found.free_bytes}
    stages = {name: asdict(stage) for name, stage in found.stages.items()}
    return {**counts, **reasons, **costs, "stages": stages}


def _as_text(found: "Plan") -> str:
    lines = [f"{'stage':<8}" + "".join(f"{name.replace('_', ' '):>10}" for name in COLUMNS) + "    s each   MB each"]
    for name, stage in found.stages.items():
        counts = "".join(f"{getattr(stage, column):>10}" for column in COLUMNS)
        source = "" if stage.learned else "  (estimated from the demo)"
        lines.append(f"{name:<8}{counts}{stage.seconds:>10.1f}{stage.bytes / 1e6:>10.1f}{source}")
    lines += [f"scene {name} was rejected: {reason}" for name, reason in found.outcome.rejected.items()]
    lines += [f"scene {name} failed: {reason}" for name, reason in found.outcome.failed.items()]
    lines.append(
        f"{found.outcome.made} results to make in {found.scenes_to_do} of {found.scenes} scenes: about "
        f"{duration(found.seconds)} in one process, {found.peak_bytes / 1e6:.0f} MB more of disk space at most"
        if found.outcome.made
        else f"nothing to make: {found.outcome.reused} results exist already"
        if found.outcome.failed or found.outcome.rejected
        else f"nothing to do: all {found.outcome.reused} results exist already"
    )
    if found.peak_bytes > found.free_bytes:
        lines.append(f"the disk has {found.free_bytes / 1e6:.0f} MB free: too little")
    return "\n".join(lines)
