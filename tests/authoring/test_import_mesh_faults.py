"""Model files that are broken, too large, or lead elsewhere: each is refused by name, in one line, soon."""

import base64
import struct
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh
from trimesh.exchange.gltf import export_glb

from authoring.imported import mesh_soup
from groundwork.errors import InputError
from tests.authoring.mesh_files import gltf, obj, ply, read, sheet, town, usd

HTTP = "http:"  # apart from its slashes, so that no line names a host


def truncated_glb(folder: Path) -> Path:
    """A GLB file whose second half is missing."""
    data = export_glb(trimesh.Scene(town()[0]))
    (folder / "tile.glb").write_bytes(data[: len(data) // 2])
    return folder / "tile.glb"


def far_index(folder: Path) -> Path:
    """A face with a vertex number of a thousand million."""
    return obj(folder, extra="f 1/1 2/2 1000000000/1\n")


def far_index_gltf(folder: Path) -> Path:
    """The same in glTF."""
    data = struct.pack("<9f3I", *range(9), 0, 1, 1_000_000_000)
    return gltf(
        folder,
        materials=[],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        accessors=[
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
        bufferViews=[{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
        buffers=[{"byteLength": 48, "uri": "data:;base64," + base64.b64encode(data).decode()}],
    )


def count_beyond(folder: Path) -> Path:
    """An accessor of a thousand million values in a small buffer."""
    return gltf(
        folder, accessors=[{"bufferView": 0, "componentType": 5126, "count": 1_000_000_000, "type": "VEC3"}] * 3
    )


def crowd(folder: Path) -> Path:
    """A header that announces 20 million triangles."""
    (folder / "tile.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 20000000\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return folder / "tile.ply"


def crowd_of_nodes(folder: Path) -> Path:
    """A small mesh that many nodes draw."""
    return gltf(folder, nodes=[{"mesh": 0}] * 2000)


def short_ply(folder: Path) -> Path:
    """A header that announces more than the file holds."""
    file = ply(folder)
    text = file.read_text()
    file.write_text(text[: len(text) // 2])
    return file


def bomb(folder: Path) -> Path:
    """An archive that unpacks to a thousand times its size."""
    with zipfile.ZipFile(folder / "tile.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("tile.obj", b"0" * 50_000_000)
    return folder / "tile.zip"


def packed_package(folder: Path) -> Path:
    """A package whose layer is compressed."""
    with zipfile.ZipFile(folder / "tile.usdz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(usd(folder), "tile.usda")
    return folder / "tile.usdz"


def climbing(folder: Path) -> Path:
    """An archive with an entry above its folder."""
    with zipfile.ZipFile(folder / "tile.zip", "w") as archive:
        archive.writestr("../tile.obj", b"v 0 0 0\n")
    return folder / "tile.zip"


def circle(folder: Path) -> Path:
    """A stage that refers to itself."""
    head = '#usda 1.0\n(\n    defaultPrim = "A"\n)\n'
    (folder / "a.usda").write_text(head + 'def "A" (\n    references = @./b.usda@\n)\n{\n}\n')
    (folder / "b.usda").write_text(
        head + 'def "A"\n{\n    def "B" (\n        references = @./a.usda@\n    )\n    {\n    }\n}\n'
    )
    return folder / "a.usda"


def empty(folder: Path) -> Path:
    """Vertices without a face."""
    (folder / "tile.obj").write_text("v 0 0 0\nv 1 0 0\n")
    return folder / "tile.obj"


def nan(folder: Path) -> Path:
    """A vertex that is nowhere."""
    file = obj(folder)
    file.write_text(file.read_text().replace("v 0.0 0.0 0.0", "v nan 0.0 0.0", 1))
    return file


def enormous_image(folder: Path) -> Path:
    """An image that claims to be enormous."""
    file = obj(folder)
    data = sheet(folder)
    (folder / "sheet.png").write_bytes(data[:16] + struct.pack(">II", 100_000, 100_000) + data[24:])
    return file


BAD: dict[str, tuple[Callable[[Path], Path], str]] = {
    "truncated glb": (truncated_glb, "incomplete"),
    "truncated ply": (short_ply, "invalid|incomplete"),
    "index": (far_index, "invalid|does not exist"),
    "gltf index": (far_index_gltf, "names a vertex that does not exist"),
    "gltf count": (count_beyond, "at most|beyond its buffer"),
    "20 M triangles": (crowd, "holds 20000000 triangles.*decimate"),
    "many nodes": (crowd_of_nodes, "triangles.*decimate"),
    "not finite": (nan, "not finite|invalid"),
    "empty": (empty, "no triangles"),
    "zip bomb": (bomb, "times its size"),
    "compressed package": (packed_package, "is compressed"),
    "zip climbs": (climbing, "leads out of the archive"),
    "stage in a circle": (circle, "circle|cycle"),
    "image climbs": (lambda f: gltf(f, images=[{"uri": "../secret.png"}]), r"\.\./secret\.png leads out"),
    "image climbs coded": (lambda f: gltf(f, images=[{"uri": "%2e%2e/secret.png"}]), "leads out"),
    "image remote": (lambda f: gltf(f, images=[{"uri": f"{HTTP}//nowhere/a.png"}]), "is remote"),
    "image missing": (lambda f: gltf(f, images=[{"uri": "gone.png"}]), r"texture gone\.png is not there"),
    "buffer remote": (lambda f: gltf(f, buffers=[{"byteLength": 9, "uri": f"{HTTP}//nowhere/b.bin"}]), "is remote"),
    "buffer absolute": (lambda f: gltf(f, buffers=[{"byteLength": 9, "uri": "/etc/hostname"}]), "leads out"),
    "buffer short": (lambda f: gltf(f, buffers=[{"byteLength": 10**9, "uri": "data:;base64,AAAA"}]), "has only 3"),
    "gltf circle": (lambda f: gltf(f, nodes=[{"children": [1]}, {"children": [0]}]), "cycle"),
    "gltf packed": (lambda f: gltf(f, extensionsRequired=["KHR_draco_mesh_compression"]), "compressed with"),
    "mtl climbs": (lambda f: obj(f, library="../tile.mtl"), "leads out"),
    "mtl remote": (lambda f: obj(f, library=f"{HTTP}//nowhere/tile.mtl"), "is remote"),
    "map climbs": (lambda f: obj(f, image="../../sheet.png"), "leads out"),
    "map missing": (lambda f: obj(f, image="gone.jpg"), r"texture gone\.jpg is not there"),
    "usd map missing": (lambda f: usd(f, image="./gone.png"), r"gone\.png"),
    "enormous image": (enormous_image, "100000 x 100000"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_by_name(tmp_path: Path, case: str) -> None:
    """One line that says what is wrong, soon."""
    write, words = BAD[case]
    home = tmp_path / "in"
    home.mkdir()
    (tmp_path / "secret.png").write_bytes(b"secret")
    file = write(home)
    begin = time.monotonic()
    with pytest.raises(InputError, match=words) as caught:
        read(file)
    assert time.monotonic() - begin < 120.0  # reading it whole takes longer, or all memory
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("write", [obj, usd])
def test_too_many_triangles_are_counted_before_they_are_read(
    tmp_path: Path, write: Callable[[Path], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit holds for formats that do not say how many they hold."""
    monkeypatch.setattr(mesh_soup, "MOST_TRIANGLES", 100)
    with pytest.raises(InputError, match="at most 100"):
        read(write(tmp_path))
