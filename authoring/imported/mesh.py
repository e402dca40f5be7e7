"""Reading glTF, GLB, OBJ and PLY, and zips of them: formats of city tiles and photogrammetry."""

import io
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from authoring.foreign.model_files import check_file, read_beside, unpack
from authoring.imported.gltf import GltfFile
from authoring.imported.mesh_city import city_of
from authoring.imported.mesh_soup import MeshSoup, centered, check_count, joined_soup
from authoring.imported.model import CityModel
from authoring.imported.skin import Skin, image_skin, palette_skin
from authoring.looks.encode import encode_srgb
from authoring.shapes.topology import y_up_to_z_up
from groundwork.errors import InputError
from groundwork.foreign_file import read_regular
from usd_schemas.guard.layer_walk import Warn

F64 = NDArray[np.float64]

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply")
AXES = ("y", "z")
_HEAD = 65_536  # bytes in which a PLY header must end
_BROKEN = (  # errors of the library for inconsistent files, including unset variables
    ValueError,
    IndexError,
    KeyError,
    TypeError,
    AttributeError,
    AssertionError,
    OverflowError,
    RuntimeError,
    NameError,
    OSError,
)


def read_mesh(file: Path, warn: Warn, up: str = "", scale: float = 1.0) -> CityModel:
    """Read a world of meshes.

    Args:
        file: `.glb`, `.gltf`, `.obj` or `.ply` file, or a `.zip` with one of them and its textures.
        warn: Called with one line for each thing that is left out.
        up: Axis that points up, `y` or `z`; default: that of the format (glTF: y, others: z).
        scale: Length of one unit of the file [m].

    Returns:
        Buildings, ground and textured pieces in meters about their own origin.

    Raises:
        MissingError: There is no such file, or one that it refers to.
        InputError: Not readable, too large, inconsistent, or with references outside its folder.
    """
    if up not in ("", *AXES):
        raise InputError("unknown axis", field="--up", value=up, allowed=", ".join(AXES))
    if not np.isfinite(scale) or scale <= 0.0:
        raise InputError(
            "not a scale", field="--scale", value=scale, allowed="a number above 0: the length of one unit [m]"
        )
    if file.suffix.lower() == ".zip":
        with tempfile.TemporaryDirectory() as folder:
            return read_mesh(unpack(file, Path(folder), MESH_SUFFIXES), warn, up, scale)
    check_file(file)
    readers: dict[str, Callable[[Path], MeshSoup]] = {
        ".glb": read_gltf,
        ".gltf": read_gltf,
        ".obj": read_obj,
        ".ply": read_ply,
    }
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise InputError("unknown format", where=file, allowed=", ".join((*MESH_SUFFIXES, ".zip")))
    try:
        soup = reader(file)
    except InputError:
        raise
    except MemoryError:
        raise InputError("needs more memory than is available", where=file, hint="Cut out a smaller tile") from None
    except _BROKEN as error:
        problem = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise InputError(f"invalid ({problem})", where=file, hint="Check that the file is complete") from None
    triangles = scale * soup.triangles
    if (up or ("y" if file.suffix.lower() in (".glb", ".gltf") else "z")) == "y":
        triangles = y_up_to_z_up(triangles)
    facts = {"source": file.name, **soup.facts}
    return city_of(centered(MeshSoup(triangles, soup.st, soup.skin, soup.skins, facts), file, warn), warn)


def read_gltf(file: Path) -> MeshSoup:
    """Read the triangles of a glTF or GLB file, axes as they are.

    Args:
        file: The file.
    """
    held = GltfFile.read(file)
    buffers = {str(number): data for number, data in enumerate(held.buffers)}
    scene = _loaded(held.bare(), "gltf", buffers)
    images: dict[int, Skin] = {}
    parts = []
    for place, mesh in _placed(scene):
        name = getattr(getattr(mesh.visual, "material", None), "name", None)
        skin, color = None, np.ones(3)
        if name is not None and str(name).isdigit():
            skin, color = held.skin(int(name), images), held.color(int(name))
        parts.append(_part(mesh, place, skin, encode_srgb(color.astype(np.float32)), file))
    return joined_soup(parts, held.facts)


def read_obj(file: Path) -> MeshSoup:
    """Read the triangles of an OBJ file.

    Args:
        file: The file.
    """
    data = read_regular(file)
    _check_faces(data, file)
    table: dict[str, tuple[str, tuple[float, ...]]] = {}
    for line in re.findall(rb"^[ \t]*mtllib[ \t]+([^\r\n]+)", data, re.MULTILINE):
        table.update(_materials(read_beside(file, line.decode("utf-8", "replace").strip(), "material file")))
    names = "".join(f"newmtl {name}\n" for name in table).encode()
    plain = re.sub(rb"^[ \t]*mtllib[^\r\n]*", b"", data, flags=re.MULTILINE)
    scene = _loaded(b"mtllib all\n" + plain, "obj", {"all": names}, maintain_order=True)
    skins: dict[str, Skin] = {}
    parts = []
    for place, mesh in _placed(scene):
        image, diffuse = table.get(str(getattr(getattr(mesh.visual, "material", None), "name", "")), ("", ()))
        if image and image not in skins:
            skins[image] = image_skin(read_beside(file, image, "texture"), f"{file}: {image}")
        color = np.round(255.0 * np.clip(diffuse if len(diffuse) == 3 else (1.0, 1.0, 1.0), 0.0, 1.0))
        parts.append(_part(mesh, place, skins.get(image), color.astype(np.uint8), file))
    return joined_soup(parts, {})


def _check_faces(data: bytes, file: Path) -> None:
    """Refuse too many faces, and numbers out of range: a large one would fill the memory."""
    faces = re.findall(rb"^[ \t]*f[ \t]([^\r\n]*)", data, re.MULTILINE)
    check_count(len(faces), file)
    most = max(len(re.findall(rb"^[ \t]*" + kind + rb"[ \t]", data, re.MULTILINE)) for kind in (b"v", b"vt", b"vn"))
    farthest = max((max(map(abs, map(int, line.replace(b"/", b" ").split())), default=0) for line in faces), default=0)
    if farthest > most:
        raise InputError("names a vertex that does not exist", where=file, value=farthest, allowed=f"1 to {most}")


def read_ply(file: Path) -> MeshSoup:
    """Read the triangles of a PLY file.

    Args:
        file: The file.
    """
    data = read_regular(file)
    head, found, _ = data[:_HEAD].partition(b"end_header")
    body = data[len(head) + len(found) :]
    if not data.startswith(b"ply") or not found:
        raise InputError("not PLY", where=file, hint="Check that the file is complete")
    counts = {name.decode(): int(text) for name, text in re.findall(rb"^element[ \t]+(\w+)[ \t]+(\d+)", head, re.M)}
    check_count(counts.get("face", 0), file)
    rows = counts.get("vertex", 0) + counts.get("face", 0)
    if rows > (body.rstrip().count(b"\n") if b"format ascii" in head else len(body)):
        raise InputError("is incomplete", where=file, hint="Check that the file is complete")
    image = re.search(rb"^comment[ \t]+TextureFile[ \t]+([^\r\n]+)", head, re.MULTILINE)
    skin = None
    if image:
        name = image[1].decode("utf-8", "replace").strip()
        skin = image_skin(read_beside(file, name, "texture"), f"{file}: {name}")
    scene = _loaded(data, "ply", fix_texture=False)  # without its texture first: indices out of range fail here
    if skin is not None:
        scene = _loaded(data, "ply", fix_texture=True)
    parts = [_part(mesh, place, skin, np.full(3, 255, np.uint8), file) for place, mesh in _placed(scene)]
    return joined_soup(parts, {})


def _loaded(data: bytes, kind: str, beside: dict[str, bytes] | None = None, **options: Any) -> Any:
    import trimesh

    return trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=beside or {}, process=False, **options)


def _placed(scene: Any) -> list[tuple[F64, Any]]:
    """List meshes with their transforms; points and lines are left out."""
    rows = []
    for node in sorted(scene.graph.nodes_geometry):
        place, name = scene.graph[node]
        mesh = scene.geometry[name]
        if len(getattr(mesh, "faces", ())):
            rows.append((np.asarray(place, np.float64), mesh))
    return rows


def _part(mesh: Any, place: F64, skin: Skin | None, color: NDArray[np.uint8], where: Path) -> MeshSoup:
    faces, vertices = np.asarray(mesh.faces, np.int64), np.asarray(mesh.vertices, np.float64)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(
            "names a vertex that does not exist",
            where=where,
            value=int(faces.max()),
            allowed=f"0 to {len(vertices) - 1}",
        )
    triangles = (vertices @ place[:3, :3].T + place[:3, 3])[faces]
    if np.linalg.det(place[:3, :3]) < 0.0:
        triangles, faces = triangles[:, ::-1], faces[:, ::-1]
    uv = getattr(mesh.visual, "uv", None)
    if skin is not None and uv is not None and len(uv) == len(vertices):
        return MeshSoup(triangles, np.asarray(uv, np.float64)[faces], np.zeros(len(faces), np.int32), (skin,), {})
    colors = _colors(mesh, color)
    if colors is None:
        return MeshSoup(triangles, np.zeros((len(faces), 3, 2)), np.full(len(faces), -1, np.int32), (), {})
    palette, st = palette_skin(colors)
    return MeshSoup(triangles, st, np.zeros(len(faces), np.int32), (palette,), {})


def _colors(mesh: Any, color: NDArray[np.uint8]) -> NDArray[np.uint8] | None:
    """Find the color of each triangle: of its corners or itself, or else of its material unless that is white."""
    visual = mesh.visual
    if getattr(visual, "kind", None) in ("vertex", "face"):
        return np.asarray(visual.face_colors, np.uint8)[:, :3]
    return None if (color == 255).all() else np.tile(color, (len(mesh.faces), 1))


def _materials(data: bytes) -> dict[str, tuple[str, tuple[float, ...]]]:
    """Read texture and diffuse color of the materials of an MTL file, by name."""
    found: dict[str, tuple[str, tuple[float, ...]]] = {}
    name = ""
    for line in data.decode("utf-8", "replace").splitlines():
        key, _, rest = line.strip().partition(" ")
        if key.lower() == "newmtl":
            name = " ".join(rest.split())
            found[name] = ("", ())
        elif key.lower() == "map_kd" and name:
            found[name] = (_file_of(rest.strip()), found[name][1])
        elif key.lower() == "kd" and name:
            found[name] = (found[name][0], tuple(float(value) for value in rest.split()[:3]))
    return found


def _file_of(text: str) -> str:
    """Leave out the options before a texture's name: each is a word with a dash and its numbers or on/off."""
    return re.sub(r"^(-\w+(\s+(on|off|[-+.\deE]+))+\s+)+", "", text)
