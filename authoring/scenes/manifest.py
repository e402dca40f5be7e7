"""`manifest.json` of a scene folder: the recipe of its authoring, and the hash of every file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd

from authoring.settings import AuthoringSettings
from groundwork.canonical import digest, file_digest
from groundwork.errors import InputError
from groundwork.files import MANIFEST, read_json, write_json
from groundwork.marks import content_files
from groundwork.settings import parse_settings

FORMAT = "falsework.scene"
FORMAT_VERSION = 1
NAME = "manifest.json"
EDITED = "edited"  # set when anything was selected, planned or added after authoring
_NOT_OURS = {NAME, MANIFEST}


@dataclass(frozen=True)
class SceneRecipe:
    """The inputs of a scene's authoring.

    Attributes:
        settings: Settings of the scenario.
        seed: Seed of the scene.
    """

    settings: AuthoringSettings
    seed: int


def write_scene_manifest(recipe: SceneRecipe, folder: Path) -> None:
    """Write the manifest of a finished scene folder.

    Args:
        recipe: The inputs of the scene's authoring.
        folder: Scene folder.
    """
    record = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "seed": recipe.seed,
        "settings": recipe.settings,
        "versions": {"usd": ".".join(str(part) for part in Usd.GetVersion()), "numpy": np.__version__},
    }
    write_json(folder / NAME, {**record, **_hashes(folder)})


def refresh_manifest(folder: Path) -> None:
    """Update the hashes after files were added or changed; a folder without a manifest gets none.

    Args:
        folder: Scene folder.
    """
    if (folder / NAME).is_file():
        write_json(folder / NAME, {**_read(folder / NAME), EDITED: True, **_hashes(folder)})


def read_recipe(folder: Path) -> SceneRecipe:
    """Read the inputs of a scene's authoring.

    Args:
        folder: Scene folder.

    Raises:
        InputError: It has no manifest, or one of another format.
    """
    path = folder / NAME
    if not path.is_file():
        raise InputError("has no manifest.json, so nothing can be added to it", where=folder)
    record = _read(path)
    if record.get("format") != FORMAT or record.get("format_version") != FORMAT_VERSION:
        raise InputError(
            "unknown format",
            where=path,
            value=f"{record.get('format')} {record.get('format_version')}",
            allowed=f"{FORMAT} {FORMAT_VERSION}",
        )
    settings, seed = record.get("settings"), record.get("seed")
    if not isinstance(settings, dict) or not isinstance(seed, int) or seed < 0:
        raise InputError("has no recipe (settings and a seed)", where=path, field="seed", value=seed)
    return SceneRecipe(parse_settings(AuthoringSettings, settings, path), seed)


def changed_files(folder: Path) -> list[str]:
    """Compare a scene folder with its manifest.

    Args:
        folder: Scene folder.

    Returns:
        One line for each file that is missing, new or changed; empty without a manifest.
    """
    if not (folder / NAME).is_file():
        return []
    then, now = _read(folder / NAME)["files"], _hashes(folder)["files"]
    lines = {name: "missing" for name in then.keys() - now.keys()}
    lines |= {name: "new" for name in now.keys() - then.keys()}
    lines |= {name: "changed" for name in then.keys() & now.keys() if then[name] != now[name]}
    return [f"{name}: {what}" for name, what in sorted(lines.items())]


def is_as_written(folder: Path, name: str) -> bool:
    """Compare one file of a scene folder with its manifest.

    Args:
        folder: Scene folder.
        name: The file, relative to that folder.
    """
    file = folder / name
    return file.is_file() and _read(folder / NAME)["files"].get(name) == file_digest(file)


def edits_since(folder: Path) -> list[str]:
    """List the changes that a new authoring of a scene folder would remove.

    Args:
        folder: Scene folder.

    Returns:
        One line for each file changed by hand, and one for additions to the scene; empty without a manifest.
    """
    if not (folder / NAME).is_file():
        return []
    added = ["choices, flights or edits were added"] if _read(folder / NAME).get(EDITED) else []
    return [*changed_files(folder), *added]


def _read(path: Path) -> dict[str, Any]:
    """Read a manifest and check that it has a table of files."""
    record = read_json(path)
    if not isinstance(record, dict) or not isinstance(record.get("files"), dict):
        raise InputError("not the manifest of a scene: it has no table of files", where=path, field="files")
    return record


def _hashes(folder: Path) -> dict[str, Any]:
    paths = [path for path in content_files(folder) if path.name not in _NOT_OURS]
    files = {path.relative_to(folder).as_posix(): file_digest(path) for path in paths}
    return {"files": files, "scene": digest(files)}
