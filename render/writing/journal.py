"""Journal of an unfinished capture: one record for each finished frame, so that a killed renderer loses none of them.

The records are in `.frames/` inside the unfinished capture and are removed when it is finished. A frame is finished if
its record lists the hash of each of its files; records of another recipe are not used.
"""

import shutil
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from groundwork.canonical import file_digest
from groundwork.errors import InputError
from groundwork.files import read_json, sweep, write_bytes, write_json
from groundwork.locks import hold_lock
from groundwork.slug import inside
from render.light.light_volume import LightVolume

RECORD = "truth/render.json"
_NOTES = ".frames"
_RECIPE, _GAIN = "_recipe.json", "_gain.json"  # beside the records of frames; no image's name begins with `_`
_RESULTS = ("images", "truth")


class Journal:
    """The state of one unfinished capture."""

    def __init__(self, folder: Path, recipe: str) -> None:
        """Open the journal of an interrupted run of the same recipe, or remove that of another recipe.

        Args:
            folder: Capture folder: empty, or left by an interrupted run.
            recipe: Hash of everything that the capture's bytes depend on.
        """
        self._folder, self._notes, self._recipe = folder, folder / _NOTES, recipe
        if self.is_complete():
            return
        self._notes.mkdir(exist_ok=True)
        with hold_lock(self._notes / "lock"):
            if self._read(_RECIPE) == recipe:
                return
            for name in _RESULTS:
                shutil.rmtree(folder / name, ignore_errors=True)
            (folder / "cameras.json").unlink(missing_ok=True)
            for path in self._notes.iterdir():
                if path.name != "lock":
                    path.unlink(missing_ok=True)  # without locks, another worker may remove it, too
            write_json(self._notes / _RECIPE, recipe)

    def is_complete(self) -> bool:
        """Tell whether the whole capture is there: its record is written last."""
        path = self._folder / RECORD
        return path.is_file() and read_json(path).get("recipe") == self._recipe

    def facts(self, name: str) -> dict[str, Any] | None:
        """Return the facts of a finished frame; None if it is missing or incomplete.

        Args:
            name: Name of the image.
        """
        note = self._read(f"{name}.json")
        if note is None:
            return None
        for file, digest in note["files"].items():
            path = self._folder / file
            if not path.is_file() or file_digest(path) != digest:
                return None
        return note["facts"]

    def write_frame(self, name: str, files: dict[str, bytes], facts: dict[str, Any]) -> None:
        """Write every file of a frame atomically, and then its record.

        Args:
            name: Name of the image.
            files: Path from the capture's folder to content.
            facts: JSON facts of this frame for the capture's record.

        Raises:
            InputError: A name leads out of the folder.
        """
        for file, data in files.items():
            # Not forced to the disk one by one: hashes detect files lost in a power cut, and the finished folder is.
            write_bytes(inside(self._folder, file), data, durable=False)
        digests = {file: file_digest(self._folder / file) for file in files}
        write_json(inside(self._notes, f"{name}.json"), {"files": digests, "facts": facts})

    def gain(self) -> float | None:
        """Return the exposure that was metered for the survey [1], or None."""
        if self.is_complete():
            return read_json(self._folder / RECORD)["gain"]
        return self._read(_GAIN)

    def keep_gain(self, gain: float) -> None:
        """Store the exposure that was metered for the survey.

        Args:
            gain: Exposure gain [1].
        """
        write_json(self._notes / _GAIN, gain)

    def light_volume(self) -> LightVolume | None:
        """Return the light volume that was cast for the survey, or None."""
        try:
            with np.load(self._light, allow_pickle=False) as stored:
                return LightVolume(stored["lower"], float(stored["cell"]), stored["coefficients"])
        except (OSError, KeyError, ValueError, EOFError, BadZipFile):
            return None

    def keep_light_volume(self, volume: LightVolume) -> None:
        """Store the light volume for other workers, and for a later run.

        Args:
            volume: The light volume.
        """
        data = BytesIO()
        arrays = {"lower": volume.lower, "cell": np.array(volume.cell), "coefficients": volume.coefficients}
        np.savez(data, allow_pickle=False, **arrays)  # not atomic: into memory, and from there at once
        write_bytes(self._light, data.getvalue(), durable=False)

    @property
    def light_lock(self) -> Path:
        """Lock file that a worker holds while it casts the light volume."""
        return self._notes / "light.lock"

    @property
    def gain_lock(self) -> Path:
        """Lock file that a worker holds while it meters the survey."""
        return self._notes / "gain.lock"

    def close(self) -> None:
        """Remove the journal and leftovers of killed writers; the capture is complete."""
        sweep(self._folder)
        shutil.rmtree(self._notes, ignore_errors=True)

    @property
    def _light(self) -> Path:
        return self._notes / "light.npz"

    def _read(self, name: str) -> Any:
        path = self._notes / name
        try:
            return read_json(path) if path.is_file() else None
        except InputError:  # an incomplete record counts as missing
            return None
