"""Copying of textures from one folder to another."""

import re
from pathlib import Path

from pxr import Ar

from groundwork.errors import InputError
from groundwork.files import write_bytes
from groundwork.foreign_file import check_regular, read_regular

_TILES = re.compile(r"<UDIM>|<UVTILE>")


def copy_texture(path: str, textures: Path) -> str:
    """Copy a texture, or every tile of one, into a folder; equal files are stored once.

    Args:
        path: Resolved path, which may lead into a usdz package.
        textures: Folder that receives it.

    Returns:
        Its name there; empty if there is no such file.
    """
    if _TILES.search(path):
        pattern = _TILES.sub("*", Path(path).name)
        tiles = sorted(Path(path).parent.glob(pattern))
        for tile in tiles:
            _store(read_regular(tile), tile.name, textures)
        return Path(path).name if tiles else ""
    if "[" not in path and Path(path).exists():
        check_regular(Path(path))
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if asset is None:
        return ""
    with asset:
        content = bytes(asset.GetBuffer())
    return _store(content, path.rstrip("]").replace("[", "/").rpartition("/")[2], textures)


def _store(content: bytes, name: str, textures: Path) -> str:
    textures.mkdir(parents=True, exist_ok=True)
    stem, dot, suffix = name.rpartition(".")
    for number in range(10_000):
        own = textures / (f"{stem}_{number}{dot}{suffix}" if number else name)
        if not own.exists():
            write_bytes(own, content)
        if own.read_bytes() == content:
            return own.name
    raise InputError("too many textures of one name", where=textures, value=name)
