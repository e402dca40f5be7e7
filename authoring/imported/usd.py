"""Reading any USD stage as a world of meshes: checked before it is composed, then read as flat arrays."""

import re
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from authoring.foreign.model_files import UNSOUND, check_archive, check_file
from authoring.imported.mesh_city import city_of
from authoring.imported.mesh_soup import MeshSoup, centered, check_count, joined_soup
from authoring.imported.model import CityModel
from authoring.imported.skin import Skin, image_skin, palette_skin
from authoring.looks.encode import encode_srgb
from groundwork.errors import InputError, MissingError
from groundwork.foreign_file import read_regular
from usd_schemas.flat_scene import FlatScene, Material, Texture
from usd_schemas.guard.guard import check_stage
from usd_schemas.guard.layer_walk import Warn
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.stage_reader import read_stage
from usd_schemas.texels import placed

F64 = NDArray[np.float64]

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
_NO_TEXTURE = re.compile(r"there is no file .*\.(png|jpe?g|exr|hdr|tif|tiff|bmp|tga|webp|avif)$", re.IGNORECASE)
_SAID = ("author", "license", "title", "attribution", "copyright")


def read_usd(file: Path, warn: Warn, scale: float = 1.0) -> CityModel:
    """Read a stage as a world.

    Args:
        file: USD file; all files that it refers to must be in its folder or below.
        warn: Called with one line for each thing that is unusual or left out.
        scale: Factor for a stage whose unit is wrong [1].

    Returns:
        Buildings, ground and textured pieces in meters about their own origin.

    Raises:
        MissingError: There is no such file, or one that it refers to.
        InputError: Not readable, too large, circular, or with references outside its folder.
    """
    check_file(file)
    if file.suffix.lower() == ".usdz":
        with tempfile.TemporaryDirectory() as folder:
            model = read_usd(_unpacked(file, Path(folder)), warn, scale)
        return replace(model, attribution={**model.attribution, "source": file.name})
    missing: list[str] = []

    def look(line: str) -> None:
        (missing if _NO_TEXTURE.search(line) else []).append(line)
        warn(line)

    check_stage(file, (), look)
    if missing:
        raise MissingError(missing[0], where=file, hint="Copy the texture there")
    check_count(_face_count(file), file)
    scene = read_stage(file, choices=StageChoices(subdivision=0))  # polygons of a surveyed world are not refined
    for line in scene.warnings:
        warn(line)
    for material in scene.materials:
        if material.base_texture and not material.base_texture.is_plain:
            warn(f"{material.name}: scale and bias of the texture are left out")
    counts = scene.geometry.part_count[scene.draws.part].astype(np.int64)
    check_count(int(counts.sum()), file)
    cache: dict[str, Skin] = {}
    soup = joined_soup([_part(scene, row, cache, file) for row in range(len(counts))], _facts(file))
    return city_of(
        centered(MeshSoup(scale * soup.triangles, soup.st, soup.skin, soup.skins, soup.facts), file, warn), warn
    )


def _unpacked(file: Path, folder: Path) -> Path:
    """Unpack a package, whose first file is its root layer: because textures are read as files."""
    for entry in check_archive(file):
        if entry.compress_type != zipfile.ZIP_STORED:
            raise InputError("not a valid usdz package: a file in it is compressed", where=f"{file}: {entry.filename}")
    with zipfile.ZipFile(file) as package:
        names = package.namelist()
        if not names or Path(names[0]).suffix.lower() not in USD_SUFFIXES[:3]:
            raise InputError("not a valid usdz package: its first file is not a layer", where=file)
        try:
            package.extractall(folder)
        except UNSOUND as error:
            raise InputError(
                f"not a valid usdz package: {error}", where=file, hint="Check that the file is complete"
            ) from None
    return folder / names[0]


def _face_count(file: Path) -> int:
    stage = Usd.Stage.Open(str(file))
    counts = (UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get() for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    return sum(len(count or ()) for count in counts)


def _part(scene: FlatScene, row: int, cache: dict[str, Skin], file: Path) -> MeshSoup:
    geometry, draws = scene.geometry, scene.draws
    part, place = draws.part[row], draws.transform[row]
    first = int(geometry.part_first[part])
    corners = geometry.triangles[first : first + int(geometry.part_count[part])].astype(np.int64)
    if np.linalg.det(place[:3, :3]) < 0.0:
        corners = corners[:, ::-1]
    triangles = geometry.positions[corners].astype(np.float64) @ place[:3, :3].T + place[:3, 3]
    material = scene.materials[draws.material[row]]
    if material.base_texture is not None:
        skin = _image(material.base_texture, cache, file)
        sets = geometry.st1 if material.base_texture.uv_set else geometry.st
        return MeshSoup(
            triangles,
            placed(material.base_texture, sets[corners].astype(np.float64)),
            np.zeros(len(corners), np.int32),
            (skin,),
            {},
        )
    linear = _colors(material, geometry.colors[corners].mean(axis=1))
    if linear is None:
        return MeshSoup(triangles, np.zeros((len(corners), 3, 2)), np.full(len(corners), -1, np.int32), (), {})
    palette, st = palette_skin(encode_srgb(linear.astype(np.float32)))
    return MeshSoup(triangles, st, np.zeros(len(corners), np.int32), (palette,), {})


def _colors(material: Material, vertex: F64) -> F64 | None:
    """Return the linear color of each triangle; None where the stage has no color."""
    if material.use_display_color and not (vertex == 1.0).all():
        return np.asarray(vertex, np.float64)
    return None if not material.name.startswith("/") else np.tile(np.array(material.base_color), (len(vertex), 1))


def _image(texture: Texture, cache: dict[str, Skin], file: Path) -> Skin:
    if texture.file not in cache:
        image = Path(texture.file)
        check_file(image)
        cache[texture.file] = image_skin(read_regular(image), f"{file}: {image.name}")
    return cache[texture.file]


def _facts(file: Path) -> dict[str, str]:
    """Collect the metadata of the root layer: its custom data."""
    layer = Sdf.Layer.FindOrOpen(str(file))
    said = {name: layer.customLayerData.get(name) for name in _SAID}
    return {"source": file.name, **{name: text for name, text in said.items() if isinstance(text, str) and text}}
