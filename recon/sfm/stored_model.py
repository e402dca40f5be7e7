"""A structure-from-motion model in a separate folder, so that several clouds can be made from it.

The folder holds `model.json` and the COLMAP model beside it, in the model's own units, and no truth.
"""

import shutil
from pathlib import Path
from typing import Any

from groundwork.canonical import file_digest, folder_digest
from groundwork.errors import InputError, MissingError
from groundwork.files import read_json, sync, write_json
from recon.sfm.colmap_model import read_model
from recon.sfm.sparse import Sparse
from render.capture import Capture

MODEL = "model"
"""Folder of the model beside the cloud that was made with it."""
FORMAT, FORMAT_VERSION = "falsework-model", 1
_FILE, _COLMAP = "model.json", "sparse"


def write_stored_model(folder: Path, sparse: Sparse, capture: Capture) -> None:
    """Write a model for later reconstructions.

    Args:
        folder: Existing folder; gains `model.json` and `sparse/`.
        sparse: The model.
        capture: The photographs that it was made from.
    """
    (folder / _COLMAP).mkdir()
    for path in sorted(sparse.folder.iterdir()):
        shutil.copyfile(path, folder / _COLMAP / path.name)  # inside an atomic folder
        sync(folder / _COLMAP / path.name)
    write_json(
        folder / _FILE,
        {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "recipe": sparse.recipe,
            "reasons": dict(sparse.reasons),
            "photographs": _hashes(capture),
            "facts": sparse.facts,
        },
    )


def read_stored_model(place: Path, capture: Capture) -> Sparse:
    """Read a model, and check that it is complete and was made from these photographs.

    Args:
        place: Folder of a model, or of a cloud that holds one.
        capture: The photographs.

    Raises:
        MissingError: No model is there.
        InputError: It is damaged, of another version, or of other photographs.
    """
    folder = next((path for path in (place, place / MODEL) if (path / _FILE).is_file()), None)
    if folder is None:
        raise MissingError(f"holds no {_FILE}", where=place, hint="Name a model, or a cloud with its own model")
    stored = read_json(folder / _FILE)
    found = (stored.get("format"), stored.get("format_version")) if isinstance(stored, dict) else None
    if found != (FORMAT, FORMAT_VERSION):
        raise InputError(
            "not a model of this version",
            where=folder / _FILE,
            field="format",
            value=found,
            allowed=f"{FORMAT}, version {FORMAT_VERSION}",
            hint="Reconstruct again",
        )
    if not _is_whole(stored):
        raise InputError("a key is missing or of a wrong kind", where=folder / _FILE, hint="Reconstruct again")
    if stored["photographs"] != _hashes(capture):
        raise InputError(
            "was made from other photographs",
            where=folder,
            hint=f"Leave the model out, or check that it belongs to {capture.folder}",
        )
    colmap, names = folder / _COLMAP, {image.file for image in capture.images}
    model = read_model(colmap)
    if folder_digest(colmap) != stored["facts"].get("model_sha256") or not names.issuperset(model.names):
        raise InputError("was changed after it was written", where=colmap, hint="Reconstruct again")
    return Sparse(model, colmap, stored["recipe"], stored["reasons"], stored["facts"])


def _hashes(capture: Capture) -> dict[str, str]:
    return {image.file: file_digest(capture.folder / image.file) for image in capture.images}


def _is_whole(stored: dict[str, Any]) -> bool:
    reasons = stored.get("reasons")
    return (
        isinstance(stored.get("recipe"), str)
        and isinstance(stored.get("facts"), dict)
        and isinstance(reasons, dict)
        and all(isinstance(reason, str) for reason in reasons.values())
    )
