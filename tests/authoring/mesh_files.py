"""Model files for tests: a town without colors as trimesh exports it, and a photographed tile in every format."""

import base64
import json
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, Vt

from authoring.imported.mesh import read_mesh
from authoring.imported.model import CityModel
from authoring.imported.usd import read_usd
from authoring.looks.material import MaterialRecipe, author_material

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

SIDE, SPACING = 300.0, 36.0  # of the town and between its houses [m]
UTM = np.array([691500.25, 5334200.75, 412.0])
PIXELS = np.kron(
    np.array([[[200, 40, 40], [40, 200, 40]], [[40, 40, 200], [200, 200, 40]]], np.uint8),
    np.ones((32, 32, 1), np.uint8),
)  # RGB, four quarters, the first row on top


def quiet(line: str) -> None:
    """Let a note pass."""


def height(xy: F64) -> F64:
    """Height of the town's ground: a slope of 3 % [m]."""
    return 0.03 * xy[..., 0]


def town(offset: F64 | None = None) -> tuple[list[trimesh.Trimesh], float, int]:
    """Meshes of a town: a ground of 10 m cells, and boxes that stand 0.5 m in it; their volume, and their number."""
    rng = np.random.default_rng(4)
    line = np.arange(0.0, SIDE + 1.0, 10.0)
    x, y = np.meshgrid(line, line, indexing="ij")
    nodes = np.stack([x, y, height(np.stack([x, y], axis=-1))], axis=-1).reshape(-1, 3)
    k = np.arange(len(nodes)).reshape(len(line), -1)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    meshes, volume = [trimesh.Trimesh(nodes, faces, process=False)], 0.0
    for i in range(1, 8):
        for j in range(1, 8):
            size = np.array([rng.uniform(8, 18), rng.uniform(8, 18), rng.uniform(5, 25)])
            center = np.array([i * SPACING, j * SPACING, 0.0])
            center[2] = height(center) + 0.5 * size[2] - 0.5
            box = trimesh.creation.box(size)
            box.apply_translation(center)
            meshes.append(box)
            volume += float(size.prod())
    for mesh in meshes:
        mesh.apply_translation(np.zeros(3) if offset is None else offset)
    return meshes, volume, len(meshes) - 1


def plan_areas(triangles: F64) -> F64:
    """Area of each triangle in plan [m2], shape (T,)."""
    edges = (triangles[:, 1:] - triangles[:, :1])[..., :2]
    return 0.5 * np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])


def decoded(data: bytes) -> U8:
    """Decode an image: RGB, shape (H, W, 3)."""
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return np.asarray(picture[..., ::-1], np.uint8)


def sheet(folder: Path) -> bytes:
    """Write the four-colored image beside a model."""
    data = cv2.imencode(".png", PIXELS[..., ::-1])[1].tobytes()
    (folder / "sheet.png").write_bytes(data)
    return data


def photographed(cells: int = 30) -> tuple[F64, NDArray[np.int64], F64]:
    """A fused surface as photogrammetry makes it: 300 m of ground with one block of 40 x 40 x 12 m in its middle.

    Returns:
        Vertices [m], z up; faces; texture coordinates, v upwards, u along x and v along y.
    """
    line = np.linspace(0.0, SIDE, cells + 1)
    line = np.unique(np.r_[line, 130.0 - 0.5, 130.0, 170.0, 170.0 + 0.5])
    x, y = np.meshgrid(line, line, indexing="ij")
    z = np.where((x >= 130.0) & (x <= 170.0) & (y >= 130.0) & (y <= 170.0), 12.0, 0.0)
    nodes = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    k = np.arange(len(nodes)).reshape(len(line), -1)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    return nodes, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]), nodes[:, :2] / SIDE


def gltf(folder: Path, **changes: Any) -> Path:
    """Write the fused surface as glTF, y up, far away, with its image beside it."""
    sheet(folder)
    nodes, faces, uv = photographed()
    up = np.stack([nodes[:, 0], nodes[:, 2], -nodes[:, 1]], axis=1).astype("<f4")
    blobs = [
        up.tobytes(),
        np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1).astype("<f4").tobytes(),
        faces.astype("<u4").tobytes(),
    ]
    starts = np.cumsum([0, *(len(blob) for blob in blobs)])
    place = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, UTM[0], UTM[2], -UTM[1], 1]
    data = base64.b64encode(b"".join(blobs)).decode()
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "copyright": "City of Nowhere", "extras": {"license": "CC0"}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": place}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "sheet.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(nodes), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": len(nodes), "type": "VEC2"},
            {"bufferView": 2, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(a), "byteLength": len(blob)} for a, blob in zip(starts, blobs, strict=False)
        ],
        "buffers": [{"byteLength": int(starts[-1]), "uri": f"data:;base64,{data}"}],
        **changes,
    }
    file = folder / "tile.gltf"
    file.write_text(json.dumps(document))
    return file


def obj(folder: Path, image: str = "sheet.png", library: str = "tile.mtl", extra: str = "") -> Path:
    """Write the fused surface as OBJ with a material file."""
    sheet(folder)
    nodes, faces, uv = photographed()
    (folder / "tile.mtl").write_text(f"newmtl skin\nKd 1 1 1\nmap_Kd -s 1 1 1 {image}\n")
    rows = [
        f"mtllib {library}",
        *(f"v {x} {y} {z}" for x, y, z in nodes),
        *(f"vt {u} {v}" for u, v in uv),
        "usemtl skin",
    ]
    rows += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in faces + 1]
    file = folder / "tile.obj"
    file.write_text("\n".join(rows) + "\n" + extra)
    return file


def ply(folder: Path) -> Path:
    """Write the fused surface as PLY with its image named in a comment."""
    sheet(folder)
    nodes, faces, uv = photographed()
    head = ["ply", "format ascii 1.0", "comment TextureFile sheet.png", f"element vertex {len(nodes)}"]
    head += [f"property double {name}" for name in "xyz"] + [f"property float {name}" for name in "st"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [f"{x} {y} {z} {s} {t}" for (x, y, z), (s, t) in zip(nodes, uv, strict=True)]
    file = folder / "tile.ply"
    file.write_text("\n".join([*head, *rows, *(f"3 {a} {b} {c}" for a, b, c in faces)]) + "\n")
    return file


def usd(folder: Path, image: str = "./sheet.png") -> Path:
    """Write the fused surface as a stage: y up, centimeters, moved by a transform."""
    sheet(folder)
    nodes, faces, uv = photographed()
    file = folder / "tile.usda"
    stage = Usd.Stage.CreateNew(str(file))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    mesh = UsdGeom.Mesh.Define(stage, "/Tile/Mesh")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/Tile"))
    up = 100.0 * np.stack([nodes[:, 0], nodes[:, 2], -nodes[:, 1]], axis=1)
    mesh.AddTranslateOp().Set(Gf.Vec3d(100.0 * UTM[0], 100.0 * UTM[2], -100.0 * UTM[1]))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(up.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(faces)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32).ravel()))
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    primvar.Set(Vt.Vec2fArray.FromNumpy(uv.astype(np.float32)))
    material = author_material(stage, "/Tile/Skin", MaterialRecipe("skin", image, sheet=1.0))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.GetRootLayer().customLayerData = {"license": "CC0"}
    stage.Save()
    return file


def usdz(folder: Path) -> Path:
    """Pack the stage as a package."""
    file = folder / "tile.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(usd(folder)), str(file))
    return file


def zipped(folder: Path) -> Path:
    """Pack the OBJ file with its material and its image."""
    obj(folder)
    file = folder / "tile.zip"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("tile.obj", "tile.mtl", "sheet.png"):
            archive.write(folder / name, f"export/{name}")
    return file


def read(file: Path) -> CityModel:
    """Read a world of either kind."""
    return read_usd(file, quiet) if file.suffix.startswith(".usd") else read_mesh(file, quiet)
