"""Users' surfaces on a bridge: the roles that a family fits, and its maps as the texture files of a material."""

import struct
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from authoring.looks.encode import encode_normals, jpeg, png
from authoring.looks.library import SheetFiles
from authoring.looks.user_maps import MapSet, Picture, find_sets
from groundwork.errors import InputError
from groundwork.files import write_bytes
from groundwork.png_chunks import SIGNATURE, is_whole_png
from usd_schemas.texels import srgb_to_linear
from usd_schemas.tokens import ROLES

U8 = NDArray[np.uint8]

_MOST_PIXELS = 300_000_000
_RELIEF = 0.01  # [m] between the lowest and the highest value of a height map
_ROUGHNESS = 0.8  # of a surface without a roughness map [1]

_CONCRETE = tuple(role for role in ROLES if "Concrete" in role)
_STEEL = ("Role_GirderSteel", "Role_RailingSteel", "Role_CableSteel")
# Words of a family's or a set's name, and the roles that it fits. Source: materials by component in the Random
# Bridge Generator.
FAMILIES: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = (
    (("asphalt", "pavement", "road", "tarmac"), ("Role_DeckAsphalt",)),
    (("concrete", "cement", "plaster"), _CONCRETE),
    (("brick", "stone", "masonry", "rock", "marble", "granite"), ("Role_Masonry", "Role_AbutmentConcrete")),
    (("ballast", "gravel"), ("Role_Ballast",)),
    (("wood", "timber", "plank", "bark"), ("Role_SleeperTimber",)),
    (("paint",), _STEEL),
    (("metal", "steel", "iron", "rust", "corrugated"), (*_STEEL, "Role_RailSteel")),
    (("rubber",), ("Role_BearingRubber",)),
)


def suitable(sets: Iterable[MapSet]) -> dict[str, tuple[MapSet, ...]]:
    """Group surfaces by the roles that they fit.

    Args:
        sets: Users' surfaces.

    Returns:
        Sets of each role for which there is one, in the order of `usd_schemas.tokens.ROLES`.
    """
    suits = [(one, _roles(one)) for one in sets]
    found = {role: tuple(one for one, roles in suits if role in roles) for role in ROLES}
    return {role: mine for role, mine in found.items() if mine}


def read_sets(folders: Iterable[Path]) -> dict[str, tuple[MapSet, ...]]:
    """Find the surfaces of some folders, sorted by role.

    Args:
        folders: Users' folders or zips.

    Raises:
        InputError: A folder holds no set, or none of a known family.
    """
    sets: list[MapSet] = []
    for folder in folders:
        mine = find_sets(folder)
        if not suitable(mine):
            known = ", ".join(word for words, _ in FAMILIES for word in words)
            raise InputError(
                "no family of surfaces is known",
                where=folder,
                value=mine[0].family or mine[0].name,
                allowed=known,
                hint="Name the folder above the sets after their material",
            )
        sets += mine
    return suitable(sets)


def place_set(one: MapSet, folder: Path, meters: float, texels: int) -> tuple[SheetFiles, float]:
    """Write a user's surface beside a look's layer, as square images with a power of two as side.

    Args:
        one: The surface.
        folder: Folder of the look; receives `textures/`.
        meters: Length of the pictures' sides [m].
        texels: Largest side; larger ones are reduced [px].

    Returns:
        Its files, and its metallic value [1].

    Raises:
        InputError: A picture that cannot be read.
    """
    color = _squared(_decode(one.maps["albedo"]), texels)
    coarse = (color.reshape(-1, 3)[::16] / 255.0).astype(np.float64)
    linear = srgb_to_linear(coarse)
    red, green, blue = (round(float(value), 4) for value in linear.mean(axis=0))
    files = {"albedo.jpg": jpeg(color)}
    arm = _decode(one.maps["arm"]) if "arm" in one.maps else None
    rough = _gray(_decode(one.maps["roughness"])) if "roughness" in one.maps else None
    rough = arm[..., 1].copy() if rough is None and arm is not None else rough
    rough = None if rough is None else _squared(rough, texels // 2)
    if rough is not None:
        files["roughness.png"] = png(rough)
    if "normal" in one.maps:
        files["normal.png"] = png(_squared(_decode(one.maps["normal"]), texels // 2))
    elif "height" in one.maps:
        relief = _squared(_gray(_decode(one.maps["height"])), texels).astype(np.float32)
        files["normal.png"] = png(encode_normals(relief * np.float32(_RELIEF / 255), meters))
    shine = _gray(_decode(one.maps["metallic"])) if "metallic" in one.maps else None
    shine = arm[..., 2] if shine is None and arm is not None else shine
    stem = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in f"{one.family}_{one.name}")
    (folder / "textures").mkdir(parents=True, exist_ok=True)
    for file, data in files.items():
        write_bytes(folder / "textures" / f"{stem}_{file}", data)
    names = {file.partition(".")[0]: f"./textures/{stem}_{file}" for file in files}
    mean = _ROUGHNESS if rough is None else round(float(rough.mean()) / 255, 3)
    metallic = 0.0 if shine is None else round(float(shine.mean()) / 255, 2)
    placed = SheetFiles(names["albedo"], names.get("roughness", ""), names.get("normal", ""), (red, green, blue), mean)
    return placed, metallic


def _roles(one: MapSet) -> tuple[str, ...]:
    """List the roles that a family's name suggests; otherwise those that the set's own name suggests."""
    for name in (one.family.lower(), one.name.lower()):
        for words, roles in FAMILIES:
            if any(word in name for word in words):
                return roles
    return ()


def _decode(picture: Picture) -> U8:
    """Decode an image as RGB values, shape (H, W, 3), uint8."""
    import cv2

    data = picture.read()
    if Path(picture.name).suffix.lower() == ".exr":
        return _decode_exr(data, picture.where)
    size = _stated_size(data)
    if size and size[0] * size[1] > _MOST_PIXELS:
        raise InputError(f"too large a picture: {size[0]} x {size[1]} px", where=picture.where, allowed="up to 300 Mpx")
    try:
        found = None if _cut_short(data) else cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        found = None
    if found is None:
        raise InputError("the picture cannot be read", where=picture.where, hint="Check that the file is complete")
    return np.ascontiguousarray(found[..., ::-1]).astype(np.uint8, copy=False)


def _decode_exr(data: bytes, where: str) -> U8:
    """Decode an OpenEXR image of numbers from 0 to 1, as Poly Haven stores normals and roughness."""
    import OpenEXR

    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "picture.exr"
        write_bytes(path, data)
        try:
            with OpenEXR.File(str(path), header_only=True) as file:
                low, high = file.header()["dataWindow"]
            if (high[0] - low[0] + 1) * (high[1] - low[1] + 1) > _MOST_PIXELS:
                raise InputError("too large a picture", where=where, allowed="up to 300 Mpx")
            with OpenEXR.File(str(path), separate_channels=True) as file:
                channels = {name: np.asarray(one.pixels, np.float32) for name, one in file.channels().items()}
        except (RuntimeError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"the picture cannot be read: {error}", where=where, hint="Check that the file is complete"
            ) from None
    names = ("R", "G", "B") if "G" in channels else (next(iter(sorted(channels))),) * 3
    if any(name not in channels for name in names):
        raise InputError("the picture has no colors", where=where)
    values = np.stack([channels[name] for name in names], axis=-1)
    return np.clip(np.nan_to_num(values) * 255 + 0.5, 0, 255).astype(np.uint8)


def _stated_size(data: bytes) -> tuple[int, int] | None:
    """Read width and height from a PNG header before anything is decoded."""
    return struct.unpack(">II", data[16:24]) if data[:4] == b"\x89PNG" and len(data) > 24 else None


def _cut_short(data: bytes) -> bool:
    """Tell whether an image lacks its end marker: decoders fill the missing rows of a truncated image with gray."""
    if data.startswith(SIGNATURE):
        return not is_whole_png(data)
    return data[:2] == b"\xff\xd8" and b"\xff\xd9" not in data[-1024:]


def _gray(picture: U8) -> U8:
    return picture[..., 0].copy()


def _squared(picture: U8, most: int) -> U8:
    import cv2

    side = min(1 << round(np.log2(max(picture.shape[:2]))), most)
    if picture.shape[:2] == (side, side):
        return picture
    shrink = max(picture.shape[:2]) > side
    resized = cv2.resize(picture, (side, side), interpolation=cv2.INTER_AREA if shrink else cv2.INTER_LINEAR)
    return np.asarray(resized, np.uint8)
