"""Tiled textures (UDIM): one image for each unit square of the texture coordinates."""

import re
from dataclasses import replace
from pathlib import Path
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import Material, Texture
from usd_schemas.reading.packages import unpacked

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]

MARK = "<UDIM>"
_FIRST, _ACROSS, _LAST = 1001, 10, 1999  # tiles are numbered row by row from the origin
_MAPS = (
    "base_texture",
    "roughness_texture",
    "metallic_texture",
    "normal_texture",
    "emissive_texture",
    "specular_texture",
)


def tiles_of(pattern: str) -> dict[int, str]:
    """List the existing tiles.

    Args:
        pattern: Absolute path, possibly into a usdz package, with `MARK` in place of a tile's number.

    Returns:
        Path of each tile by its number, ascending.
    """
    package, _, inner = pattern.partition("[") if pattern.endswith("]") else ("", "", "")
    name = inner.removesuffix("]") if package else Path(pattern).name
    form = re.compile(re.escape(name).replace(MARK, r"(\d{4})"))
    try:
        if package:
            with ZipFile(package) as archive:
                names = archive.namelist()
        else:
            names = [file.name for file in Path(pattern).parent.iterdir() if file.is_file()]
    except (OSError, ValueError, BadZipFile):
        return {}
    found = {int(match[1]): one for one in sorted(names) if (match := form.fullmatch(one))}
    home = Path(pattern).parent
    paths = {
        number: unpacked(f"{package}[{one}]") if package else str((home / one).resolve())
        for number, one in sorted(found.items())
        if _FIRST <= number <= _LAST
    }
    return {number: path for number, path in paths.items() if path}


def tile_materials(material: Material) -> tuple[Material, dict[int, Material]]:
    """Split a material with tiled textures.

    Args:
        material: A material.

    Returns:
        The material outside the tiles, and that of each tile; the material itself and no tiles, if it has no tiled
        texture.
    """
    known = {file: tiles_of(file) for one in material.textures() for file in (one.file, one.alpha) if MARK in file}
    if not known:
        return material, {}
    numbers = sorted({number for tiles in known.values() for number in tiles})
    return _on_tile(material, known, 0), {number: _on_tile(material, known, number) for number in numbers}


def _on_tile(material: Material, known: dict[str, dict[int, str]], number: int) -> Material:
    def texture(one: Texture | None) -> Texture | None:
        if one is None or not {one.file, one.alpha} & set(known):
            return one
        file = known.get(one.file, {0: "", number: one.file}).get(number, "")
        alpha = known.get(one.alpha, {number: one.alpha}).get(number, "")
        if not file:
            return None
        if one.scale != (1.0, 1.0) or one.rotation:
            return replace(one, file=file, alpha=alpha)
        up, across = divmod(number - _FIRST, _ACROSS)
        moved = one.translation[0] - across, one.translation[1] - up
        return replace(one, file=file, alpha=alpha, translation=moved, wrap=("clamp", "clamp"))

    return replace(material, **{name: texture(getattr(material, name)) for name in _MAPS})


def tile_numbers(st: F32, triangles: I64) -> I64:
    """Find the tile in which each triangle lies.

    Args:
        st: Texture coordinates [1], shape (V, 2), float32.
        triangles: Vertex numbers, shape (T, 3), int64.

    Returns:
        Number of each triangle's tile, shape (T,), int64; 0 where there is none.
    """
    across, up = np.floor(st[triangles].mean(axis=1)).astype(np.int64).T
    inside = (across >= 0) & (across < _ACROSS) & (up >= 0)
    return np.where(inside, _FIRST + across + _ACROSS * up, 0)
