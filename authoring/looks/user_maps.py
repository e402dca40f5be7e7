"""Pictures of surfaces in users' folders and zips, found by the file names of common collections."""

import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from authoring.foreign.model_files import UNSOUND, check_archive, check_file
from groundwork.errors import InputError, MissingError

_PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".exr")
_DEEPEST = 4  # folders below the one that was named
_MOST_FILES = 20_000
MOST_PICTURE_BYTES = 256_000_000

# Last word of a file's name that states its kind. Sources: ambientCG (Rock029_2K-JPG_Color), Poly Haven
# (rock_05_diff_2k), the Random Bridge Generator (albedo, roughness, height, metallic).
_WORDS: dict[str, str] = {
    "albedo": "albedo",
    "color": "albedo",
    "colour": "albedo",
    "basecolor": "albedo",
    "diffuse": "albedo",
    "diff": "albedo",
    "col": "albedo",
    "roughness": "roughness",
    "rough": "roughness",
    "height": "height",
    "displacement": "height",
    "disp": "height",
    "metallic": "metallic",
    "metalness": "metallic",
    "metal": "metallic",
    "normal": "normal",
    "normalgl": "normal",
    "normaldx": "",
    "arm": "arm",
}


@dataclass(frozen=True)
class Picture:
    """One picture file.

    Attributes:
        file: The file, or the zip that holds it.
        member: Its name in the zip; empty for a separate file.
    """

    file: Path
    member: str = ""

    @property
    def where(self) -> str:
        """Its name in errors."""
        return f"{self.file}: {self.member}" if self.member else str(self.file)

    @property
    def name(self) -> str:
        """Its file name."""
        return Path(self.member or self.file.name).name

    def read(self) -> bytes:
        """Read its bytes; a picture of more than `MOST_PICTURE_BYTES` is refused.

        Raises:
            InputError: Damaged, encrypted, or too large.
        """
        if not self.member:
            check_file(self.file)
            if self.file.stat().st_size > MOST_PICTURE_BYTES:
                raise _too_large(self.where)
            return self.file.read_bytes()
        try:
            with zipfile.ZipFile(self.file) as packed, packed.open(self.member) as source:
                data = source.read(MOST_PICTURE_BYTES + 1)
        except UNSOUND as error:
            raise InputError(
                f"cannot be unpacked: {error}", where=self.where, hint="Check that the file is complete"
            ) from None
        if len(data) > MOST_PICTURE_BYTES:
            raise _too_large(self.where)
        return data


@dataclass(frozen=True)
class MapSet:
    """The maps of one surface.

    Attributes:
        family: Name of the folder above it; empty where it stands alone.
        name: Its own name.
        maps: Picture of each kind: albedo, and those of roughness, height, metallic, normal, arm that exist.
    """

    family: str
    name: str
    maps: dict[str, Picture]


def find_sets(root: Path) -> tuple[MapSet, ...]:
    """Look for surfaces in a folder or zip.

    Args:
        root: `family/name/{albedo, roughness, …}` folders, folders of zips, one set, or one zip.

    Returns:
        Sets with an albedo, sorted by family and name.

    Raises:
        MissingError: There is no such file or folder.
        InputError: An unsafe zip, too many files, or no set at all.
    """
    if not root.exists():
        raise MissingError("no such folder of textures", where=root, hint="Check the path")
    groups: dict[tuple[str, str], dict[str, list[Picture]]] = {}
    for family, name, picture in _pictures(root):
        kind = _kind(picture.name)
        if kind:
            groups.setdefault((family, name), {}).setdefault(kind, []).append(picture)
    sets = tuple(
        MapSet(family, name, {kind: _best(found) for kind, found in sorted(kinds.items())})
        for (family, name), kinds in sorted(groups.items())
        if "albedo" in kinds
    )
    if not sets:
        raise InputError(
            "has no surface with a color picture",
            where=root,
            allowed="family/name/{albedo|color|diffuse, roughness, height, metallic}, or ambientCG and Poly Haven zips",
        )
    return sets


def _pictures(root: Path) -> Iterator[tuple[str, str, Picture]]:
    """List every picture with its family and its set."""
    if root.is_file():
        yield from _packed("", root)
        return
    home, count = root.resolve(), 0
    for path in sorted(root.rglob("*")):
        parts = path.relative_to(root).parts
        if not path.is_file() or len(parts) > _DEEPEST:
            continue
        count += 1
        if count > _MOST_FILES:
            raise InputError("contains too many files", where=root, allowed=f"up to {_MOST_FILES}")
        if not path.resolve().is_relative_to(home):
            raise InputError("a link leads out of the named folder", where=path, allowed="files below the named folder")
        if path.suffix.lower() == ".zip":
            yield from _packed(parts[-2] if len(parts) > 1 else root.name, path)
        elif path.suffix.lower() in _PICTURES:
            above = [root.name, *parts[:-1]]
            above = above[:-1] if above[-1].lower() == "textures" and len(above) > 1 else above
            yield above[-2] if len(above) > 1 else "", above[-1], Picture(path)


def _packed(family: str, archive: Path) -> Iterator[tuple[str, str, Picture]]:
    for entry in check_archive(archive):
        if Path(entry.filename).suffix.lower() in _PICTURES:
            yield family, archive.stem, Picture(archive, entry.filename)


def _kind(name: str) -> str:
    """Find the kind of an image from the last known word of its name; empty if it is not used."""
    words = [word for word in re.split(r"[^a-z0-9]+", Path(name).stem.lower()) if word]
    if "nor" in words:
        return "normal" if "gl" in words else ""
    return next((_WORDS[word] for word in reversed(words) if word in _WORDS), "")


def _best(found: list[Picture]) -> Picture:
    """Choose one of several images: not OpenEXR if possible, and the first by name."""
    return min(found, key=lambda picture: (Path(picture.name).suffix.lower() == ".exr", picture.where))


def _too_large(where: str) -> InputError:
    return InputError("picture is too large", where=where, allowed=f"up to {MOST_PICTURE_BYTES / 1e6:.0f} MB")
