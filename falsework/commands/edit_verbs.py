"""The verb that imports edits made in a DCC program: `falsework scene import-edits`."""

from pathlib import Path
from typing import Any

import tyro

from falsework.children.products import ADDRESS_LIMIT, read_safely
from falsework.commands.answers import AsJson, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import stage_file
from groundwork.child import answer_parent
from groundwork.errors import InputError, MissingError
from groundwork.progress import Progress

JSON_VERSION = 2
_DRAWN = "drawn by all renderers; the renderer of Falsework draws it without shadows"
_LAMPS = ("SphereLight", "RectLight", "DiskLight")
_UNDRAWN = "drawn by other renderers only; the renderer of Falsework draws SphereLights, RectLights and DiskLights"
_SAID = {"moved": "moved", "reshaped": "reshaped", "recoloured": "recolored", "hidden": "hidden", "removed": "removed"}


def import_edits(
    edited: tyro.conf.Positional[Path],
    scene: tyro.conf.Positional[Path],
    *,
    label: tuple[str, ...] = (),
    remove: bool = False,
    allow_root: tuple[Path, ...] = (),
    as_json: AsJson = False,
) -> int:
    """Compare an export of Blender or another DCC program with its scene; write the changes as edits/user.usda.

    Moved, hidden and changed meshes, recolored materials, new meshes, solids, instances, cameras and lights, and the
    sun are imported. Each change that is not imported is listed. A camera can be flown by a survey of kind "stage".

    Args:
        edited: USD file that the DCC exported, with custom properties.
        scene: The scene's folder or root layer, with the look and background that were selected when the DCC opened it.
        label: Label of new objects: a component kind or class, or `pattern=kind` by name; default: their custom
            property `component`, else background.
        remove: Deactivate the parts that were deleted; without it they are only listed.
        allow_root: Further folders from which both files may load layers and textures.
        as_json: Print one JSON object instead of lines.
    """
    with ConsoleProgress() as progress:
        found = harvest(edited, stage_file(scene), label, remove, allow_root, progress)
    return tell({"version": JSON_VERSION, **found}, report_lines(found), as_json)


def harvest(
    edited: Path, scene: Path, label: tuple[str, ...], remove: bool, allow_roots: tuple[Path, ...], progress: Progress
) -> dict[str, Any]:
    """Write the edits layer of a scene in a child process, with limits.

    Args:
        edited: USD file that a DCC exported.
        scene: Root layer of the scene.
        label: Labels of new objects.
        remove: Deactivate deleted parts.
        allow_roots: Further folders from which both files may load files.
        progress: Listener, for warnings about the edited file.

    Returns:
        Names by kind of change: `moved`, `reshaped`, `recoloured`, `added` (name to label), `removed`, `missing`,
        `cameras` (name to number of poses), `lights` (name to type), `hidden`, `left_out`.

    Raises:
        InputError: Missing, not readable, not of this scene, or the scene is in a read-only store.
    """
    for path in (edited, scene):
        if path.is_dir():
            raise InputError("is a folder, not a USD file", where=path, hint="Name a file in it")
        if not path.is_file():
            raise MissingError("no such file", where=path)
    request = {
        "edited": str(edited),
        "scene": str(scene),
        "label": list(label),
        "remove": remove,
        "allow_roots": [str(root) for root in allow_roots],
    }
    return read_safely("falsework.commands.edit_verbs", request, edited, progress)


def report_lines(found: dict[str, Any]) -> list[str]:
    """Describe the changes, one line per kind.

    Args:
        found: Answer of `harvest`.
    """
    lines = [f"{said:<11} {', '.join(found[kind])}" for kind, said in _SAID.items() if found[kind]]
    if found["added"]:
        lines.append(f"{'added':<11} {', '.join(f'{name} ({label})' for name, label in found['added'].items())}")
    for name, poses in found["cameras"].items():
        lines.append(f'{"camera":<11} {name}, {poses} pose{"s" * (poses > 1)}: a flight for a survey of kind "stage"')
    for name, kind in found["lights"].items():
        lines.append(f"{'light':<11} {name}, a {kind}: {_DRAWN if kind in _LAMPS else _UNDRAWN}")
    lines = lines or ["no changes: edits/user.usda is empty"]
    if found["missing"]:
        lines.append(f"{'missing':<11} {', '.join(found['missing'])}: kept; --remove deactivates them")
    return lines + [f"{'left out':<11} {line}" for line in found["left_out"]]


def _answer(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    from dataclasses import asdict

    from authoring.edits.additions import Labeling
    from authoring.edits.harvest import harvest_edits
    from usd_schemas.guard.guard import check_stage, limit_memory

    limit_memory(ADDRESS_LIMIT)
    edited, scene = Path(request["edited"]), Path(request["scene"])
    said: dict[str, None] = {}
    for stage in (scene, edited):
        check_stage(stage, tuple(Path(root) for root in request["allow_roots"]), said.setdefault)
    for line in said:
        progress.note(line)
    return asdict(harvest_edits(edited, scene, Labeling.parse(request["label"]), request["remove"]))


if __name__ == "__main__":
    answer_parent(_answer)
