"""The verbs that run the whole chain: the demo, or a scenario of the user."""

import sys
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import tyro

from falsework.commands.answers import AsJson, answer
from falsework.commands.given_files import need_scenario
from falsework.execution.address import check_address
from falsework.execution.parts import check_parts, scene_range, shard_of

SOME_SCENES_FAILED = 3

Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
File = tyro.conf.Positional[Path]


def demo(output: Output = Path("demo-out"), *, seed: int | None = None, as_json: AsJson = False) -> int:
    """Run the whole chain on one small bridge, up to an annotated dense point cloud and a report.

    Args:
        output: Folder to write into.
        seed: Seed of another bridge than the default one.
        as_json: Print one JSON object at the end instead of lines.
    """
    from falsework.scenario import demo_scenario

    scenario = demo_scenario()
    return _run(scenario if seed is None else scenario.model_copy(update={"seed": seed}), output, None, as_json)


def run(
    scenario: File,
    output: Output,
    *,
    scenes: str | None = None,
    workers: int = 0,
    cluster: str | None = None,
    shard: str | None = None,
    memory: float | None = None,
    retry_failed: bool = False,
    as_json: AsJson = False,
) -> int:
    """Run the whole chain of a scenario; a second call makes only what is missing.

    Args:
        scenario: TOML file.
        output: Folder to write into.
        scenes: Part of the scenes, as `first:end`.
        workers: Number of worker processes that share the scenes; 0: one scene after the other in this process.
        cluster: Address of a Dask scheduler (tcp://HOST:PORT) whose workers share the scenes.
        shard: Part of the scenes as i/n, i from 0 to n - 1: for job arrays that share the output folder.
        memory: Limit of the memory of all processes of the run together, or of each worker of --cluster [GB]. Default:
            nine tenths of the machine's.
        retry_failed: Retry tasks that failed in an earlier run.
        as_json: Print one JSON object at the end instead of lines.
    """
    from groundwork.errors import InputError

    if workers < 0 or (workers and cluster):
        raise InputError(
            "number of workers out of range",
            field="--workers",
            value=workers,
            allowed="0 or more; only 0 with --cluster",
        )
    if memory is not None and not memory > 0.0:
        raise InputError("limit out of range", field="--memory", value=memory, allowed="more than 0 GB")
    check_parts(scenes, shard)
    if cluster is not None:
        check_address(cluster)
    need_scenario(scenario)
    from falsework.scenario import load_scenario, values_of

    loaded = load_scenario(scenario)
    part = shard_of(scene_range(scenes, loaded.scenes), shard)
    with values_of(scenario):
        return _run(
            loaded, output, part, as_json, retry_failed=retry_failed, workers=workers, cluster=cluster, memory=memory
        )


def _run(scenario: object, output: Path, scenes: list[int] | None, as_json: bool, **how: Any) -> int:
    from falsework.commands.run_console import RunConsole
    from falsework.execution.amounts import amounts, sizes
    from falsework.execution.costs import Costs
    from falsework.execution.interrupts import prompt_ending
    from falsework.pipeline import run_scenario
    from falsework.scenario import Scenario

    assert isinstance(scenario, Scenario)
    with prompt_ending(), RunConsole(Costs(output, amounts(scenario), sizes(scenario))) as console:
        outcome = run_scenario(scenario, output, console, scenes, board=console, **how)
    if as_json:
        paths = {"reports": [str(p) for p in outcome.reports], "clouds": [str(p) for p in outcome.clouds]}
        counts = {"made": outcome.made, "reused": outcome.reused}
        answer({**counts, **paths, "few": _few(outcome.clouds), "rejected": outcome.rejected, "failed": outcome.failed})
        return SOME_SCENES_FAILED if outcome.failed else 0
    for name, reason in outcome.rejected.items():
        _say(f"scene {name} rejected: {reason}")
    for name, reason in outcome.failed.items():
        _say(f"scene {name} failed: {reason}")
    if outcome.made or outcome.failed or outcome.rejected:
        _say(f"{outcome.made} results made, {outcome.reused} existed already")
    elif scenes == []:
        _say("nothing to do: this share has no scene")
    else:
        _say(f"nothing to do: all {outcome.reused} results existed already")
    for cloud in outcome.clouds:
        _say(f"cloud   {cloud}")
    for line in _few(outcome.clouds):
        _say(f"few     {line}")
    for page in outcome.reports:
        _say(f"report  {page}")
    return SOME_SCENES_FAILED if outcome.failed else 0


def _few(clouds: list[Path]) -> list[str]:
    """List the classes with few points somewhere along the bridges, and those of which `max_deviation` took most.

    One line of each for each kind of cloud.
    """
    from groundwork.files import read_json
    from recon.truth.per_class import lost_classes, scarce_classes_in_words

    by_source: dict[str, list[dict[str, Any]]] = {}
    for cloud in clouds:
        if (cloud / "cloud.json").is_file():
            stored = read_json(cloud / "cloud.json")
            by_source.setdefault(stored["source"].removeprefix("sfm-"), []).append(stored["statistics"])
    lines = []
    for source, found in sorted(by_source.items()):
        lost = Counter(name for each in found if each.get("classes") for name in lost_classes(each))
        order = sorted(lost, key=lambda name: (-lost[name], name))
        named = ", ".join(f"{name} in {lost[name]} of {len(found)}" for name in order)
        took = f"max_deviation took more than half of a class: {named}. Raise [recon] max_deviation" if lost else ""
        lines += [f"{source} clouds: {line}" for line in (scarce_classes_in_words(found), took) if line]
    return lines


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
