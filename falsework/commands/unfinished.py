"""Results that a run's scenes should have and lack: never made, or deleted."""

import os
from pathlib import Path

from falsework.execution.chain import read_sources, scene_chain
from falsework.execution.run_facts import run_facts
from falsework.execution.run_folder import is_run
from falsework.scenario import load_scenario
from groundwork.errors import InputError
from groundwork.progress import Progress

_SHOWN = 3  # results of a scene that its line names


def unfinished_scenes(root: Path, progress: Progress) -> list[str]:
    """List the scenes of a run that lack results; those with a record of a failure have the reason there.

    Results are sought by their names in `scenes/`, so that a run of another machine can be checked, too.

    Args:
        root: Output folder of a run.
        progress: Listener.

    Returns:
        One line for each scene; one line if the scenario is not readable; empty for other folders with a store.
    """
    if not is_run(root):
        return []
    path = root / "scenario.toml"
    try:
        scenario = load_scenario(path)
    except InputError as error:
        return [f"scenario.toml: {str(error).removeprefix(f'{path}: ')}"]
    try:
        sources = read_sources(scenario, progress)
    except InputError as error:
        progress.note(f"scenes are not checked for missing results, since an input is not readable: {error}")
        return []
    failed = {row.scene for row in run_facts(root, ".", times=False).failures}
    lines = []
    for index in range(scenario.scenes):
        chain = scene_chain(scenario, index, sources)
        if chain.name in failed:
            continue
        report = (chain.report(),) if "report" in scenario.keep else ()
        wanted = [step.link for step in (*chain.steps, *report) if step.kind in scenario.keep]
        lacking = [link for link in wanted if not os.path.lexists(root / "scenes" / chain.name / link)]
        if lacking:
            more = f" and {len(lacking) - _SHOWN} more" if len(lacking) > _SHOWN else ""
            shown = ", ".join(lacking[:_SHOWN])
            lines.append(f"scenes/{chain.name}: no {shown}{more}: not made yet, or deleted; falsework run makes them")
    return lines
