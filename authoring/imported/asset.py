"""An imported world on disk: a folder of layers that other programs can open, and that scenes use as surroundings."""

import hashlib
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom

from authoring.foreign.usd_file import safe_name
from authoring.imported.model import Building, CityModel, Textured, face_normals
from authoring.imported.skin import Skin, skin_recipes
from authoring.layers.assets import bake_surfaces, write_asset
from authoring.layers.background import background_layer
from authoring.layers.geometry import BACKGROUND
from authoring.layers.layer import export
from authoring.layers.provenance import author_provenance
from authoring.shapes.component import FIRST_BACKGROUND_ID, LAST_ID, Component, Mesh
from groundwork.errors import InputError, MissingError
from groundwork.foreign_file import parse_json, read_regular
from groundwork.slug import inside
from usd_schemas.apis import read_component

F64 = NDArray[np.float64]

MARK = "falsework:city"  # in the layer's custom data: contents of the world, and its owner
IMAGES = "falsework:cityImages"  # also there: role, suffix and mean color of each image
TEXELS = 512
_HEAD = 1 << 16  # [byte] length of the start of a layer with its custom data
_WALLS = ("brick", "plaster", "brick", "concrete", "plaster", "painted_metal")
_GROUND, _OBJECT = ("Ground", "ground", "Ground"), ("Object", "building", "Buildings")
_GROUPS = {"ground": "Ground"}
_FLAT_ROOF = 0.95  # rise of the normal above which a roof counts as flat [1]


def write_city(model: CityModel, folder: Path, name: str) -> Path:
    """Write a world into an empty folder.

    Args:
        model: Buildings and terrain.
        folder: Existing empty folder.
        name: Its name.

    Returns:
        Its root layer.

    Raises:
        InputError: It has more buildings than there are instance ids.
    """
    pieces = city_components(model, "City", FIRST_BACKGROUND_ID)
    textured = textured_components(model, "City", FIRST_BACKGROUND_ID + len(pieces))
    write_asset(BACKGROUND, (*pieces, *textured), folder)
    layer = background_layer(name, {**bake_surfaces(pieces, folder, TEXELS, 0), **skin_recipes(model.skins, folder)})
    images = [[skin.role, skin.suffix, *skin.color] for skin in model.skins]
    layer.customLayerData = {
        **layer.customLayerData,
        MARK: json.dumps(model.attribution, sort_keys=True),
        IMAGES: json.dumps(images),
    }
    path = folder / f"{name}.usda"
    export(author_provenance(layer, "/Background", model.attribution, is_ours=False), path)
    return path


def city_components(model: CityModel, prefix: str, first_id: int) -> tuple[Component, ...]:
    """Convert a world to components: walls and roof of every building, and the ground.

    Args:
        model: Buildings and terrain.
        prefix: Put before the names of its prims.
        first_id: Instance id of the first.

    Raises:
        InputError: It has more buildings than there are instance ids.
    """
    if first_id + 2 * len(model.buildings) + len(model.textured) > LAST_ID:
        raise InputError(
            f"too many buildings: {len(model.buildings) + len(model.textured)}",
            allowed=f"up to {(LAST_ID - first_id) // 2}",
            hint="Cut out a smaller tile",
        )
    rows: list[tuple[str, str, str, F64, dict[str, object]]] = []
    for number, building in enumerate(model.buildings):
        facts: dict[str, object] = {"building": building.name}
        wall, roof = _materials(building)
        for part, kind, role, triangles in (
            ("Walls", "building", wall, building.walls),
            ("Roof", "roof", roof, building.roofs),
        ):
            if len(triangles):
                rows.append((f"{prefix}_Building_{number:04d}_{part}", kind, role, triangles, facts))
    if len(model.terrain):
        rows.append((f"{prefix}_Ground", "ground", "grass", model.terrain, {}))
    return tuple(
        Component(prim, kind, role, _GROUPS.get(kind, "Buildings"), flat_mesh(triangles), first_id + k, facts)
        for k, (prim, kind, role, triangles, facts) in enumerate(rows)
    )


def textured_components(model: CityModel, prefix: str, first_id: int) -> tuple[Component, ...]:
    """Convert the textured pieces of a world to components.

    Args:
        model: The world.
        prefix: Put before the names of its prims.
        first_id: Instance id of the first.
    """
    made = []
    for number, piece in enumerate(model.textured):
        name, kind, group = _GROUND if piece.is_ground else _OBJECT
        facts: dict[str, object] = {"building": piece.owner, "skin": piece.skin}
        mesh, role = flat_mesh(piece.triangles, piece.st), model.skins[piece.skin].role
        made.append(Component(f"{prefix}_{name}_{number:05d}", kind, role, group, mesh, first_id + number, facts))
    return tuple(made)


def read_city(file: Path) -> CityModel:
    """Read a world back.

    Args:
        file: Root layer that `write_city` wrote, or its folder.

    Raises:
        MissingError: There is no such file.
        InputError: It is not an imported world.
    """
    path = _root_layer(file)
    if not path.is_file():
        raise MissingError(
            "no such imported world", where=file, hint="Make it: falsework background import FILE -o DIR"
        )
    try:
        layer = Sdf.Layer.FindOrOpen(str(path.resolve()))
    except Tf.ErrorException:  # not USD at all
        layer = None
    if layer is None or MARK not in layer.customLayerData:
        raise InputError(
            "is not an imported world", where=path, hint="Make one: falsework background import FILE -o DIR"
        )
    walls: dict[str, list[F64]] = {}
    roofs: dict[str, list[F64]] = {}
    ground = [np.zeros((0, 3, 3))]
    textured: dict[int, Textured] = {}
    stage = Usd.Stage.Open(layer)
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        facts, triangles = read_component(prim), _triangles(UsdGeom.Mesh(prim))
        if "skin" in facts.parameters:
            owner, skin = str(facts.parameters["building"]), int(str(facts.parameters["skin"]))
            textured[facts.instance_id] = Textured(owner, facts.kind == "ground", triangles, _coordinates(prim), skin)
        elif facts.kind == "ground":
            ground.append(triangles)
        else:
            (roofs if facts.kind == "roof" else walls).setdefault(str(facts.parameters["building"]), []).append(
                triangles
            )
    none = [np.zeros((0, 3, 3))]
    buildings = tuple(
        Building(name, np.concatenate(walls.get(name, none)), np.concatenate(roofs.get(name, none)))
        for name in sorted({*walls, *roofs})
    )
    attribution = parse_json(str(layer.customLayerData[MARK]), path)
    pieces = tuple(textured[number] for number in sorted(textured))
    return CityModel(buildings, np.concatenate(ground), attribution, pieces, _images(layer, path.parent))


def is_city(file: Path) -> bool:
    """Check whether a path leads to an imported world.

    Args:
        file: Any path.
    """
    path = _root_layer(file)
    if not path.is_file():
        return False
    try:
        layer = Sdf.Layer.FindOrOpen(str(path.resolve()))
    except Tf.ErrorException:
        return False
    return layer is not None and MARK in layer.customLayerData


def claims_city(file: Path) -> bool:
    """Check whether a file claims to be the root layer of an imported world, without parsing or validating it.

    Args:
        file: A regular file.
    """
    with file.open("rb") as layer:
        return MARK.encode() in layer.read(_HEAD)


def world_name(file: Path) -> str:
    """Return the name of an imported world in scenes.

    Args:
        file: Its root layer or folder.
    """
    return safe_name(_root_layer(file).stem)


def _root_layer(file: Path) -> Path:
    return file / f"{file.name}.usda" if file.is_dir() else file


def flat_mesh(triangles: F64, st: F64 | None = None) -> Mesh:
    """Weld triangles into a mesh of flat faces; `st` counts meters along and up each face unless it is given.

    Args:
        triangles: Corners [m], shape (T, 3, 3), float64.
        st: Texture coordinates of the corners [1], shape (T, 3, 2), float64.
    """
    points, corners = np.unique(np.round(triangles.reshape(-1, 3), 4), axis=0, return_inverse=True)
    normals = face_normals(triangles)
    level = np.stack([-normals[:, 1], normals[:, 0], np.zeros(len(normals))], axis=1)
    flat = np.abs(normals[:, 2]) > 0.99
    level[flat] = (1.0, 0.0, 0.0)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    up = np.cross(normals, level)
    if st is None:
        st = np.stack([np.sum(triangles * axis[:, None], axis=2) for axis in (level, up)], axis=2)
    return Mesh(
        points=points,
        face_counts=np.full(len(triangles), 3, np.int32),
        corners=corners.reshape(-1).astype(np.int32),
        normals=np.repeat(normals, 3, axis=0).astype(np.float32),
        st=st.reshape(-1, 2).astype(np.float32),
    )


def _materials(building: Building) -> tuple[str, str]:
    """Choose wall and roof materials of a building, independent of its position."""
    share = int.from_bytes(hashlib.sha256(building.name.encode()).digest()[:4], "little")
    rise = np.median(face_normals(building.roofs)[:, 2]) if len(building.roofs) else 1.0
    return _WALLS[share % len(_WALLS)], "gravel" if rise > _FLAT_ROOF else "roof_tile"


def _images(layer: Sdf.Layer, folder: Path) -> tuple[Skin, ...]:
    """Read the images of a world, in the order of `write_city`."""
    skins = []
    for role, suffix, red, green, blue in parse_json(str(layer.customLayerData.get(IMAGES, "[]")), folder):
        image = inside(folder / "textures", f"{role}{suffix}", where=folder)
        if not image.is_file():
            raise MissingError("no such texture of the imported world", where=image, hint="Import the world again")
        skins.append(Skin(role, read_regular(image), suffix, (red, green, blue)))
    return tuple(skins)


def _coordinates(prim: Usd.Prim) -> F64:
    """Read `st` at the corners of triangles [1], shape (T, 3, 2), float64."""
    values = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st").ComputeFlattened()
    return np.array(values, np.float64).reshape(-1, 3, 2)


def _triangles(mesh: UsdGeom.Mesh) -> F64:
    """Read the triangles of a mesh in world space [m], shape (T, 3, 3), float64."""
    points = np.array(mesh.GetPointsAttr().Get(), np.float64)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(), np.int64)
    to_world = np.array(mesh.ComputeLocalToWorldTransform(Usd.TimeCode.Default()), np.float64)
    placed = points @ to_world[:3, :3] + to_world[3, :3]
    return placed[corners].reshape(-1, 3, 3)
