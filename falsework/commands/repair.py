"""Repair a run's folder: remake damaged results, results made from them and their inputs, with the same bytes."""

import os
from pathlib import Path

from falsework.execution.chain import read_sources, scene_chain
from falsework.execution.needs import rejected_steps
from falsework.pipeline import run_scenario
from falsework.scenario import Scenario, load_scenario
from falsework.store.foreign import move_away, move_foreign
from falsework.store.leftovers import KEY, refuse_in_use
from falsework.store.store import Store
from falsework.store.verification import Findings, inspect
from falsework.store.workroom import remove, set_aside, work_folder
from groundwork.canonical import canonical_json
from groundwork.files import MANIFEST, space_errors, write_text
from groundwork.progress import Progress


def repair(root: Path, progress: Progress) -> list[str]:
    """Remake the results that `verify` finds damaged, and compare them with the originals.

    Args:
        root: Output folder of a run; its `scenario.toml` describes how its results are made.
        progress: Listener.

    Returns:
        Remaining faults, one line each; empty if everything is intact.

    Raises:
        InputError: A run is working in the folder, or its scenario is not readable.
    """
    refuse_in_use(root, unknown=False)
    findings = inspect(root)
    if not findings.lines:
        return []
    refuse_in_use(root, unknown=False)
    scenario = load_scenario(root / "scenario.toml")
    scenes = sorted(int(path.name) for path in (root / "scenes").glob("*") if path.name.isdecimal())
    scenes = [index for index in scenes if index < scenario.scenes]
    with space_errors(root):
        for place, true in findings.misplaced.items():
            _move_home(root, place, true)
        for path in findings.broken:
            remove(path)
        for path in findings.foreign:
            move_away(root, path)
        unlinked = {path.relative_to(root).as_posix() for path in findings.foreign}
        forgotten = {path.stem for path in findings.broken if path.parent.name == "failed"}
        findings = inspect(root)
        ours = _made_here(scenario, scenes, Store(root), progress)
        gone = _with_descendants(findings) & {place for made in ours.values() for place in made}
        former = {place: findings.manifests[place]["files"] for place in gone if place in findings.manifests}
        for place in sorted(gone):
            _clear(root, place, findings)
    incomplete = [
        index
        for index, made in ours.items()
        if gone & made.keys() or unlinked & set(made.values()) or forgotten & {place[-64:] for place in made}
    ]
    if incomplete:  # others may be of an earlier version, and a run would remake them all
        run_scenario(scenario, root, progress, incomplete)
    after = inspect(root)
    for place in after.manifests:  # results in the store were not evicted
        kind = place.partition("/")[0].replace("sample", "cloud")  # samples are kept if clouds are
        if kind in scenario.keep:
            (root / "evicted" / f"{place}.json").unlink(missing_ok=True)
    for folder in (*(root / "evicted").glob("*"), root / "evicted"):
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
    lines = list(after.lines)
    for place, files in sorted(former.items()):
        now = after.manifests.get(place, {}).get("files")
        if now is None and not (root / "evicted" / f"{place}.json").is_file():
            lines.append(f"store/{place}: not made again")
        elif now is not None and canonical_json(now) != canonical_json(files):
            lines.append(f"store/{place}: made again, but its bytes differ from the former ones")
    return lines


def _made_here(scenario: Scenario, scenes: list[int], store: Store, progress: Progress) -> dict[int, dict[str, str]]:
    """List the results of each scene on this machine, with their links; others cannot be remade."""
    sources, found = read_sources(scenario, progress), {}
    for index in scenes:
        chain = scene_chain(scenario, index, sources)
        report = (chain.report(rejected_steps(chain, store)),) if "report" in scenario.keep else ()
        steps = (*chain.steps, *report)
        found[index] = {f"{step.task.stage}/{step.task.key}": f"scenes/{chain.name}/{step.link}" for step in steps}
    return found


def _with_descendants(findings: Findings) -> set[str]:
    """Add all results made from damaged ones, because they may have been made from damaged bytes."""
    found = set(findings.damaged)
    while True:
        keys = {place.partition("/")[2] for place in found}
        more = {place for place, manifest in findings.manifests.items() if keys & set(manifest["inputs"].values())}
        if more <= found:
            return found
        found |= more


def _move_home(root: Path, place: str, true: str) -> None:
    folder, home = root / "store" / place, root / "store" / true
    if not os.path.lexists(home) and (root / "store" / true.partition("/")[0]).is_dir():
        folder.rename(home)
    elif KEY.fullmatch(folder.name):
        move_foreign(root, place)
        _remove_result(root, place)
    else:
        move_away(root, folder)  # a copy that the user named


def _clear(root: Path, place: str, findings: Findings) -> None:
    """Remove a result; files in it that Falsework did not write are moved to `OUT/foreign`."""
    folder = root / "store" / place
    if not os.path.lexists(folder):
        return
    move_foreign(root, place)
    if place in findings.manifests and not place.startswith("report/"):
        record = root / "evicted" / f"{place}.json"  # written first, so that its hashes survive a kill
        record.parent.mkdir(parents=True, exist_ok=True)
        write_text(record, (folder / MANIFEST).read_text(encoding="utf-8"))
    _remove_result(root, place)


def _remove_result(root: Path, place: str) -> None:
    with work_folder(root, place.partition("/")[2]) as work:
        set_aside(root / "store" / place, work)
