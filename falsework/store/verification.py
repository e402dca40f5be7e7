"""Verification of a run's folder: all files of all results, and all references to them."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from falsework.store.artefact import Hashes, file_faults, read_manifest
from falsework.store.failures import read_failure
from falsework.store.leftovers import KEY, TEMPORARY_NAME
from falsework.store.textures import POOL, pool_faults
from groundwork.errors import InputError
from groundwork.files import MANIFEST
from groundwork.settings import read_toml

# The first part of an input's name is the stage that made it.
REFERRED = ("stage", "capture", "model", "cloud", "sample", "noise", "pieces", "training")
RECORD_NAME = re.compile(rf"{KEY.pattern}\.json|{TEMPORARY_NAME.pattern}")


@dataclass
class Findings:
    """Faults of a run's folder.

    Attributes:
        lines: One line for each fault.
        damaged: `<stage>/<key>` of each result that is missing or changed.
        manifests: `<stage>/<key>` to the manifest of each result with an intact manifest.
        misplaced: `<stage>/<key>` of each intact manifest in a wrong place, to its right place.
        broken: Records and shared textures that are invalid.
        foreign: Files, folders and links where only records and links of ours may be.
    """

    lines: list[str] = field(default_factory=list)
    damaged: set[str] = field(default_factory=set)
    manifests: dict[str, dict[str, Any]] = field(default_factory=dict)
    misplaced: dict[str, str] = field(default_factory=dict)
    broken: list[Path] = field(default_factory=list)
    foreign: list[Path] = field(default_factory=list)

    def add(self, line: str, result: str = "") -> None:
        """Add a fault.

        Args:
            line: The fault and its place.
            result: `<stage>/<key>` of the damaged result, or empty.
        """
        self.lines.append(line)
        if result:
            self.damaged.add(result)

    def add_record(self, path: Path, line: str) -> None:
        """Add something that is not a valid record of a failure or an eviction.

        Args:
            path: Its path: ours if it has the name of a record.
            line: The fault and its place.
        """
        self.lines.append(line)
        ours = RECORD_NAME.fullmatch(path.name) and path.is_file() and not path.is_symlink()
        (self.broken if ours else self.foreign).append(path)


def verify(root: Path) -> list[str]:
    """Verify all stored results against their manifests and against links and records.

    Args:
        root: Output folder of a run.

    Returns:
        One line per fault.
    """
    return inspect(root).lines


def inspect(root: Path) -> Findings:
    """Inspect a whole store, and all references to it; what a run removes meanwhile is no fault.

    Args:
        root: Output folder of a run.
    """
    findings, hashes = Findings(), Hashes()
    for folder in _results(root, findings):
        _inspect_result(root, folder, findings, hashes)
    for path, line in pool_faults(root, hashes):
        findings.add(line)
        findings.broken += [path] if line.endswith("changed") and KEY.fullmatch(path.name) else []
    _inspect_inputs(root, findings)
    _inspect_links(root, findings)
    for path in _children(root / "failed"):
        if (path.suffix != ".json" or read_failure(path) is None) and os.path.lexists(path):
            findings.add_record(path, f"{path.relative_to(root)}: not a record of a failure")
    for path in (path for stage in _folders(root, "evicted", findings) for path in _children(stage)):
        try:
            told = read_manifest(path)
            if path.name != f"{told['key']}.json" or path.parent.name != told["stage"]:
                findings.add(f"{path.relative_to(root)}: misplaced")
        except InputError as error:
            findings.add_record(path, f"{path.relative_to(root)}: {str(error).removeprefix(f'{path}: ')}")
    findings.lines = list(dict.fromkeys(findings.lines))
    return findings


def _results(root: Path, findings: Findings) -> Iterator[Path]:
    for stage in _children(root / "store"):
        if stage.name == POOL:
            continue
        if stage.is_symlink() or not stage.is_dir():
            findings.add(f"{stage.relative_to(root)}: foreign")
            continue
        for folder in _children(stage):
            if folder.is_dir() and not folder.is_symlink():
                yield folder
            elif os.path.lexists(folder):
                findings.add(f"{folder.relative_to(root)}: foreign")


def _inspect_result(root: Path, folder: Path, findings: Findings, hashes: Hashes) -> None:
    name, place = folder.relative_to(root).as_posix(), f"{folder.parent.name}/{folder.name}"
    try:
        manifest = read_manifest(folder / MANIFEST)
    except InputError as error:
        if not folder.is_dir():  # removed meanwhile
            return
        findings.add(f"{name}/{MANIFEST}: {str(error).removeprefix(f'{folder / MANIFEST}: ')}", place)
        return
    true = f"{manifest['stage']}/{manifest['key']}"
    if true != place:
        findings.add(f"{name}: misplaced: it belongs to store/{true}", place)
        findings.misplaced[place] = true
        return
    lines = file_faults(folder, manifest["files"], hashes)
    if not folder.is_dir():  # removed meanwhile
        return
    findings.manifests[place] = manifest
    for line in lines:
        findings.add(f"{name}/{line}", place)


def _inspect_inputs(root: Path, findings: Findings) -> None:
    """Check that the inputs of every result exist; external stages are not checked."""
    foreign_stage = _starts_from_a_stage(root)
    for place, manifest in sorted(findings.manifests.items()):
        for name, key in sorted(manifest["inputs"].items()):
            stage = name.partition("/")[0]
            if stage not in REFERRED or (stage == "stage" and foreign_stage):
                continue
            wanted = f"{stage}/{key}"
            if not (root / "store" / wanted).is_dir() and not _evicted(root, stage, key):
                findings.add(f"store/{wanted}: missing, but store/{place} was made from it", wanted)


def _inspect_links(root: Path, findings: Findings) -> None:
    for scene in _folders(root, "scenes", findings):
        for folder, folders, files in os.walk(scene):
            for path in sorted(Path(folder, name) for name in (*folders, *files)):
                name = path.relative_to(root)
                try:
                    target = Path(os.path.normpath(path.parent / path.readlink()))
                except OSError:  # not a link, or removed meanwhile
                    if path.is_file():
                        findings.add(f"{name}: foreign")
                    continue
                inside = Path(os.path.relpath(target, root / "store")).parts
                if len(inside) < 2 or not KEY.fullmatch(inside[1]) or ".." in inside:
                    findings.add(f"{name}: leads out of the store")
                    findings.foreign.append(path)
                elif not path.exists() and path.is_symlink():
                    place = f"{inside[0]}/{inside[1]}"
                    findings.add(f"{name}: leads to store/{place}, which is missing", place)


def _evicted(root: Path, stage: str, key: str) -> bool:
    """Tell whether a result was evicted after others had been made from it."""
    try:
        return read_manifest(root / "evicted" / stage / f"{key}.json")["key"] == key
    except InputError:
        return False


def _starts_from_a_stage(root: Path) -> bool:
    try:
        return "stage" in read_toml(root / "scenario.toml")
    except InputError:
        return False


def _folders(root: Path, name: str, findings: Findings) -> Iterator[Path]:
    """List the folders of a folder; what a link of the user leads to is not ours."""
    for path in _children(root / name):
        if path.is_symlink():
            findings.add(f"{path.relative_to(root)}: foreign")
        elif path.is_dir():
            yield path


def _children(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []
