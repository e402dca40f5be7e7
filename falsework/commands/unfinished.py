"""Results that a run's scenes should have and lack: never made, or deleted."""

import os
from pathlib import Path

from falsework.execution.chain import read_sources, scene_chain
from falsework.execution.run_facts import STAGES, run_facts
from falsework.execution.run_folder import is_run
from falsework.scenario import load_scenario
from groundwork.errors import InputError, MissingError
from groundwork.progress import Progress

_SHOWN = 3  # results of a scene that its line names


def unfinished_scenes(root: Path, progress: Progress) -> list[str]:
    """List the scenes of a run that lack results without a record of a failure before them.

    Results are sought by their names in `scenes/`, so that a run of another machine can be checked, too.

    Args:
        root: Output folder of a run.
        progress: Listener for what cannot be checked.

    Returns:
        One line for each scene; empty for other folders with a store.

    Raises:
        InputError: The scenario is missing or not readable.
    """
    path = root / "scenario.toml"
    if (root / "scenes").is_dir() and not path.is_file():
        raise InputError("missing, so that nobody knows what the run should make", where=path)
    if not is_run(root):
        return []
    try:
        scenario = load_scenario(path)
        sources = read_sources(scenario, progress)
    except MissingError as error:
        progress.note(f"scenes are not checked for missing results, since an input of the run is not here: {error}")
        return []
    failed: dict[str, int] = {}  # the first failed stage of each scene
    for row in run_facts(root, ".", times=False).failures:
        stage = STAGES.index(row.stage) if row.stage in STAGES else 0
        failed[row.scene] = min(stage, failed.get(row.scene, stage))
    lines = []
    for index in range(scenario.scenes):
        chain = scene_chain(scenario, index, sources)
        report = (chain.report(),) if "report" in scenario.keep else ()
        kept = [step for step in (*chain.steps, *report) if step.kind in scenario.keep]
        before = failed.get(chain.name, len(STAGES))
        wanted = [step.link for step in kept if STAGES.index(step.kind) < before]
        lacking = [link for link in wanted if not os.path.lexists(root / "scenes" / chain.name / link)]
        if lacking:
            more = f" and {len(lacking) - _SHOWN} more" if len(lacking) > _SHOWN else ""
            shown = ", ".join(lacking[:_SHOWN])
            lines.append(f"scenes/{chain.name}: no {shown}{more}: not made yet, or deleted; falsework run makes them")
    return lines
