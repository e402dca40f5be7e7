"""Content of a folder for the viewer: a stage, its captures and its clouds."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from groundwork.errors import InputError, MissingError

ALLOWED = "a scene of a run (OUT/scenes/0000), a scene folder, a .usda file, a capture, or a cloud"
USD = (".usda", ".usdc", ".usd", ".usdz")


@dataclass(frozen=True)
class Subject:
    """A stage, captures and clouds that are shown together.

    Attributes:
        name: Name of the subject.
        stage: Root layer, or None.
        captures: Folder of each capture by its name.
        clouds: Folder of each cloud by its name; the part before a + is the name of its capture.
    """

    name: str
    stage: Path | None
    captures: Mapping[str, Path]
    clouds: Mapping[str, Path]

    def capture_of(self, cloud: str) -> Path | None:
        """Find the capture of a cloud, if it exists.

        Args:
            cloud: Name of the cloud.
        """
        own = self.captures.get(cloud.partition("+")[0])
        return own if own is not None or cloud else next(iter(self.captures.values()), None)


def find_subject(place: Path) -> Subject:
    """Find the stage, captures and clouds of a folder.

    Args:
        place: Folder or USD file.

    Raises:
        MissingError: There is no such folder or file.
        InputError: It contains nothing that can be shown.
    """
    if not place.exists():
        raise MissingError("no such file or folder", where=place, hint="Check the path")
    name = place.absolute().name
    if place.is_file():
        if place.suffix not in USD:
            raise InputError("nothing that can be shown", where=place, allowed=ALLOWED)
        return Subject(name, place, {}, {})
    if (place / "cloud.json").is_file():
        return Subject(name, None, {}, {name: place})
    if (place / "cameras.json").is_file():
        return Subject(name, None, {name: place}, {})
    if (place / "scene.usda").is_file():
        return Subject(name, place / "scene.usda", {}, {})
    stage = place / "stage" / "scene.usda"
    captures = {path.parent.name: path.parent for path in sorted(place.glob("capture/*/cameras.json"))}
    clouds = {path.parent.name: path.parent for path in sorted(place.glob("cloud/*/cloud.json"))}
    if not (stage.is_file() or captures or clouds):
        raise InputError("nothing that can be shown", where=place, allowed=ALLOWED)
    return Subject(name, stage if stage.is_file() else None, captures, clouds)
