"""Header data of a glTF or GLB file, before its meshes are read: sizes, references, materials, author.

Source: Khronos Group, glTF 2.0 Specification (GLB container, accessors, materials, asset).
"""

import base64
import binascii
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from authoring.foreign.model_files import read_beside
from authoring.imported.mesh_soup import check_count
from authoring.imported.skin import Skin, image_skin
from groundwork.errors import InputError
from groundwork.foreign_file import parse_json, read_regular

_TRIANGLES, _STRIP = 4, 5
_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization", "KHR_texture_basisu")


@dataclass(frozen=True, eq=False)
class GltfFile:
    """A glTF file with its buffers.

    Attributes:
        file: Its path.
        header: Its JSON; each material's name is its number.
        buffers: Bytes of its buffers.
    """

    file: Path
    header: dict[str, Any]
    buffers: tuple[bytes, ...]

    @staticmethod
    def read(file: Path) -> "GltfFile":
        """Read header and buffers, and check every size and reference.

        Args:
            file: `.gltf` or `.glb` file.

        Raises:
            InputError: Not glTF 2, cut short, too large, packed by an unsupported extension, or with files elsewhere.
        """
        data = read_regular(file)
        text, chunk = _chunks(data, file) if file.suffix.lower() == ".glb" else (data, None)
        header = parse_json(text, file)
        try:
            _check_header(header, file)
            buffers = tuple(_buffer(entry, chunk, file) for entry in header.get("buffers", ()))
            _check_views(header, buffers, file)
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"invalid glTF ({type(error).__name__}: {error})", where=file) from None
        for number, material in enumerate(header.get("materials", ())):
            material["name"] = str(number)
        return GltfFile(file, header, buffers)

    @property
    def facts(self) -> dict[str, str]:
        """Metadata of the file."""
        asset = self.header["asset"]
        extras = asset.get("extras")
        said = {**(extras if isinstance(extras, dict) else {}), "author": asset.get("copyright")}
        return {
            name: " ".join(text.split())
            for name, text in sorted(said.items())
            if name in ("author", "license", "title", "source", "attribution") and isinstance(text, str) and text
        }

    def skin(self, material: int, cache: dict[int, Skin]) -> Skin | None:
        """Find the image of a material.

        Args:
            material: Its number.
            cache: Images read so far, by number.

        Raises:
            InputError: An image that is missing, or that is not an image.
        """
        surface = self.header["materials"][material].get("pbrMetallicRoughness", {}).get("baseColorTexture")
        if not isinstance(surface, dict):
            return None
        try:
            number = self.header["textures"][surface["index"]]["source"]
            entry = self.header["images"][number]
        except (KeyError, IndexError, TypeError):
            raise InputError(
                "names a texture that does not exist", where=self.file, field=f"material {material}"
            ) from None
        if number not in cache:
            uri, where = entry.get("uri", ""), f"{self.file}: image {number}"
            if "bufferView" in entry:
                data = self._view(entry["bufferView"])
            else:
                data = _inline(uri, where) if uri.startswith("data:") else read_beside(self.file, uri, "texture")
            cache[number] = image_skin(data, where if uri.startswith("data:") or not uri else f"{self.file}: {uri}")
        return cache[number]

    def color(self, material: int) -> NDArray[np.float64]:
        """Return the linear base color of a material [1], shape (3,), float64."""
        factor = self.header["materials"][material].get("pbrMetallicRoughness", {}).get("baseColorFactor", (1, 1, 1))
        return np.clip(np.array(factor[:3], np.float64), 0.0, 1.0)

    def bare(self) -> bytes:
        """Return a header without images, with buffers named by number: reading the meshes then opens no file."""
        buffers = [{"byteLength": len(data), "uri": str(number)} for number, data in enumerate(self.buffers)]
        kept = {key: value for key, value in self.header.items() if key not in ("images", "textures", "samplers")}
        plain = [{"name": material["name"]} for material in self.header.get("materials", ())]
        return json.dumps({**kept, "buffers": buffers, "materials": plain}).encode()

    def _view(self, number: int) -> bytes:
        view = self.header["bufferViews"][number]
        start = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][start : start + view["byteLength"]]


def _chunks(data: bytes, file: Path) -> tuple[bytes, bytes | None]:
    if len(data) < 20 or data[:4] != b"glTF" or int.from_bytes(data[4:8], "little") != 2:
        raise InputError("not GLB, version 2", where=file)
    found, place = [], 12
    while place + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, place)
        if place + 8 + length > len(data):
            raise InputError("is incomplete", where=file, hint="Check that the file is complete")
        found.append((kind, data[place + 8 : place + 8 + length]))
        place += 8 + length
    text = next((chunk for kind, chunk in found if kind == 0x4E4F534A), b"")
    return text, next((chunk for kind, chunk in found if kind == 0x004E4942), None)


def _buffer(entry: dict[str, Any], chunk: bytes | None, file: Path) -> bytes:
    uri, length = entry.get("uri"), int(entry["byteLength"])
    if uri is None:
        data = chunk or b""
    elif uri.startswith("data:"):
        data = _inline(uri, str(file))
    else:
        data = read_beside(file, uri, "buffer")
    if len(data) < length:
        raise InputError(
            f"a buffer of {length} bytes has only {len(data)}", where=file, hint="Check that the file is complete"
        )
    return data


def _inline(uri: str, where: str) -> bytes:
    try:
        return base64.b64decode(uri.partition(",")[2], validate=True)
    except (binascii.Error, ValueError) as error:
        raise InputError(f"embedded data are not base64: {error}", where=where) from None


def _check_header(header: Any, file: Path) -> None:
    version = header["asset"].get("version", "")
    if not str(version).startswith("2"):
        raise InputError("unknown version", where=file, field="asset.version", value=version, allowed="2.0")
    required = [name for name in header.get("extensionsRequired", ()) if name in _PACKED]
    if required:
        raise InputError(
            f"is compressed with {', '.join(required)}",
            where=file,
            hint="Decompress it first, e.g. with gltf-transform copy",
        )
    nodes = header.get("nodes", [])
    children = [child for node in nodes for child in node.get("children", ())]
    if len(set(children)) != len(children) or any(not 0 <= child < len(nodes) for child in children):
        raise InputError("a node has two parents, or does not exist", where=file, field="nodes")
    _check_roots(nodes, set(children), file)
    counts = [sum(_triangle_count(header, p) for p in mesh["primitives"]) for mesh in header.get("meshes", ())]
    check_count(sum(counts[node["mesh"]] for node in nodes if "mesh" in node), file)


def _check_roots(nodes: list[dict[str, Any]], children: set[int], file: Path) -> None:
    """Visit the nodes from those without a parent; nodes not reached form a cycle."""
    pending, seen = [k for k in range(len(nodes)) if k not in children], 0
    while pending:
        seen += 1
        pending += nodes[pending.pop()].get("children", ())
    if seen < len(nodes):
        raise InputError("nodes form a cycle", where=file, field="nodes")


def _triangle_count(header: dict[str, Any], primitive: dict[str, Any]) -> int:
    mode = primitive.get("mode", _TRIANGLES)
    if mode not in (_TRIANGLES, _STRIP):
        return 0
    accessor = primitive.get("indices", primitive["attributes"]["POSITION"])
    count = int(header["accessors"][accessor]["count"])
    return count // 3 if mode == _TRIANGLES else count


def _check_views(header: dict[str, Any], buffers: tuple[bytes, ...], file: Path) -> None:
    views = header.get("bufferViews", [])
    for number, view in enumerate(views):
        start, length = view.get("byteOffset", 0), view["byteLength"]
        if start < 0 or length < 0 or start + length > len(buffers[view["buffer"]]):
            raise InputError("reaches beyond its buffer", where=file, field=f"bufferViews {number}")
    for number, accessor in enumerate(header.get("accessors", ())):
        count, size = accessor["count"], _BYTES[accessor["componentType"]] * _WIDTH[accessor["type"]]
        if "bufferView" not in accessor:
            room = 0 if "sparse" in accessor or count == 0 else -1
            if room < 0 or count > 50_000_000:
                raise InputError("an accessor has no data", where=file, field=f"accessors {number}")
            continue
        view = views[accessor["bufferView"]]
        room = view["byteLength"] - accessor.get("byteOffset", 0)
        stride = view.get("byteStride", size)
        if count < 0 or accessor.get("byteOffset", 0) < 0 or (count and (count - 1) * stride + size > room):
            raise InputError("reaches beyond its buffer", where=file, field=f"accessors {number}")
