"""Free disk space in a run's folder: leftovers of killed runs and, on request, results that no scene uses."""

import json
import os
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from falsework.execution.chain import Chain, Step, read_sources, scene_chain
from falsework.platform import MACHINE
from falsework.scenario import load_scenario
from falsework.stages import STAGES
from falsework.store.artefact import file_faults, read_manifest
from falsework.store.failures import read_failure
from falsework.store.leftovers import (
    KEY,
    Leftover,
    abandoned,
    bytes_freed,
    refuse_in_use,
    remove_leftover,
    unshared_textures,
)
from groundwork.canonical import digest
from groundwork.errors import InputError
from groundwork.files import MANIFEST, space_errors
from groundwork.progress import Progress


@dataclass
class Cleaning:
    """Report of what was removed, or would be.

    Attributes:
        removed: What was removed, one line each.
        left: What is kept although it is not needed, one line each, with the reason.
        freed: Size of what was removed [bytes].
    """

    removed: list[Leftover] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    freed: int = 0


@dataclass(frozen=True)
class TaskRecord:
    """A task as recorded in a file of the store: the result's manifest, or the record of an eviction or failure.

    Attributes:
        key: Key of the task.
        inputs: Name of each input to its key.
        leftover: Files to remove if no scene needs the task.
        strange: Files in it that Falsework did not write, one line each; if there are any, it is kept.
    """

    key: str
    inputs: dict[str, str]
    leftover: Leftover
    strange: tuple[str, ...] = ()


Traces = dict[str, list[TaskRecord]]  # by their stage and settings


def clean(root: Path, progress: Progress, *, unused: bool = False, dry_run: bool = False) -> Cleaning:
    """Remove what is not needed, except files of a running process and files that Falsework did not write.

    Args:
        root: Output folder of a run.
        progress: Listener.
        unused: Also remove results that no scene of its `scenario.toml` uses, on this machine or another one with this
            version of Falsework and of its packages.
        dry_run: Only report what would be removed.

    Returns:
        The report.

    Raises:
        InputError: A run is working in the folder, and unused results are asked for; or its scenario cannot be read.
    """
    done = Cleaning()
    found = abandoned(root)
    if unused:
        found += _unused(root, progress, done)
        found += unshared_textures(root, found)
        refuse_in_use(root)
    done.freed = bytes_freed(found)
    with space_errors(root):
        for leftover in found:
            size = bytes_freed([leftover])
            if dry_run or remove_leftover(root, leftover):
                done.removed.append(leftover)
            else:
                done.left.append(f"{leftover.paths[0].relative_to(root)}: in use by a process")
                done.freed -= size
    return done


def _unused(root: Path, progress: Progress, done: Cleaning) -> list[Leftover]:
    """Find the results and records that no scene uses."""
    scenario = load_scenario(root / "scenario.toml")
    sources, traces = read_sources(scenario, progress), _traces(root)
    used: set[str] = set()
    for index in range(scenario.scenes):
        used |= _used_by(scene_chain(scenario, index, sources), traces)
    lost = [trace for alike in traces.values() for trace in alike if trace.key not in used]
    done.left += [f"{trace.leftover.paths[0].relative_to(root)}/{line}" for trace in lost for line in trace.strange]
    return [trace.leftover for trace in lost if not trace.strange]


def _used_by(chain: Chain, traces: Traces) -> set[str]:
    """List the keys of a scene's results; those of other machines differ only by processor and GL driver."""
    keys: dict[str, set[str]] = {}
    for step in chain.steps:
        keys[step.input_name] = {step.task.key}
        for trace in _alike(step, traces):
            if trace.inputs.keys() == step.task.inputs.keys() and all(
                key in (keys[step.parents[name].input_name] if name in step.parents else {step.task.inputs[name]})
                for name, key in trace.inputs.items()
            ):
                keys[step.input_name].add(trace.key)
    report = chain.report()
    keys.setdefault("stage", {report.task.inputs.get("stage", "")})
    last = {  # without the flights that have no result
        trace.key
        for trace in _alike(report, traces)
        if all(key in keys.get(name, ()) for name, key in trace.inputs.items())
    }
    return last.union(*keys.values())


def _alike(step: Step, traces: Traces) -> list[TaskRecord]:
    return traces.get(_likeness(step.task.record), [])


def _likeness(task: dict[str, Any]) -> str:
    settings = dict(task["settings"])
    platform = settings.pop("platform", None)
    # Other versions of packages are no other machine, but this one before an upgrade.
    facts = platform if isinstance(platform, dict) else {}
    packages = {name: value for name, value in facts.items() if name not in MACHINE}
    return digest([task["stage"], task["version"], settings, packages])


def _traces(root: Path) -> Traces:
    """Read all records of tasks; damaged and foreign files are left to `verify`."""
    found: Traces = defaultdict(list)
    links = _links(root)
    for stage in STAGES:
        for path in sorted((root / "store" / stage).glob(f"*/{MANIFEST}")):
            folder, task = path.parent, _task_of(path)
            if folder.is_symlink() or task is None or (task["key"], task["stage"]) != (folder.name, stage):
                continue
            faults = file_faults(folder, task["files"], None)
            strange = tuple(line for line in faults if line.endswith("not in the manifest"))
            about = "of an earlier version" if task["version"] < STAGES[stage].version else "that no scene uses"
            goes = Leftover(f"{stage} {about}", (folder, *links[folder]), folder.name, True)
            found[_likeness(task)].append(TaskRecord(folder.name, task["inputs"], goes, strange))
        for path in sorted((root / "evicted" / stage).glob("*.json")):
            task = _task_of(path)
            if task is not None and (task["key"], task["stage"]) == (path.stem, stage):
                goes = Leftover(f"record of a {stage} that no scene uses", (path,), path.stem)
                found[_likeness(task)].append(TaskRecord(path.stem, task["inputs"], goes))
    for path in sorted(root.glob("failed/*.json")):
        if KEY.fullmatch(path.stem) and read_failure(path) is not None:
            task = json.loads(path.read_text(encoding="utf-8"))
            if task.keys() >= {"stage", "version", "settings", "inputs"}:
                goes = Leftover("record of a failure that no scene uses", (path,), path.stem)
                found[_likeness(task)].append(TaskRecord(path.stem, task["inputs"], goes))
    return found


def _task_of(manifest: Path) -> dict[str, Any] | None:
    try:
        return read_manifest(manifest)
    except InputError:
        return None


def _links(root: Path) -> dict[Path, list[Path]]:
    """List the links of the scenes by the result that they point to."""
    found: dict[Path, list[Path]] = defaultdict(list)
    for folder, folders, files in os.walk(root / "scenes"):
        for path in sorted(Path(folder, name) for name in (*folders, *files)):
            if path.is_symlink():
                target = Path(os.path.normpath(path.parent / path.readlink()))
                parts = Path(os.path.relpath(target, root / "store")).parts
                found[root / "store" / "/".join(parts[:2])].append(path)
    return found
