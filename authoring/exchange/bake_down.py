"""Baking: the effect of `FalseworkDetailAPI` is written into plain textures, for renderers that do not support it."""

from collections import defaultdict
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade

from authoring.exchange.atlas_raster import AtlasRaster
from authoring.exchange.bake_lookup import TextureLookup
from authoring.exchange.bake_stains import detail_factors
from authoring.exchange.bake_tiles import DETAIL, bake_tile, remove_detail
from authoring.exchange.baking import Baking
from authoring.exchange.flatten import flatten_scene
from authoring.layers.layer import export
from authoring.looks.encode import encode_srgb, png
from groundwork.errors import InputError
from groundwork.files import write_bytes
from usd_schemas import tokens
from usd_schemas.flat_scene import Detail, Material
from usd_schemas.guard.layer_walk import Warn
from usd_schemas.reading.materials import read_material
from usd_schemas.texels import placed

F32 = NDArray[np.float32]

ATLAS = "st1"
MACRO = "falsework:detail:macroTexture"
SUFFIX = "_Baked"
MOST_SHARED = 0.02  # share of the texels that may belong to two meshes, because charts meet along their edges
_BRIGHTEST = np.float32(0.95)  # albedo, as in our renderer


@dataclass
class _Group:
    """Materials that share an atlas: those of the bridge, of a square of ground, or of the land of site or background.

    Attributes:
        name: Name of the scope that holds them, and of the macro texture on their atlas.
        meshes: Meshes with charts on the atlas, by the path of their material.
    """

    name: str
    meshes: dict[Sdf.Path, list[Usd.Prim]] = field(default_factory=lambda: defaultdict(list))


def bake_down(scene: Path, folder: Path, texels: int, warn: Warn) -> Path:
    """Write a flattened copy of a scene whose weathering and fine detail are in its base textures.

    A mesh with its own charts on the atlas `st1` gets one baked texture for its whole asset, a quarter of the allowed
    size of a package. Tiled materials stay tiled, in larger tiles that contain nearly whole periods of the detail.

    Args:
        scene: Root layer; its selected variants are used.
        folder: Empty folder to fill.
        texels: Texels along a side of each baked atlas [px]; tiles have half of it, those of a background a quarter.
        warn: Called with one line that names materials that are still procedural.

    Returns:
        Root layer of the copy.
    """
    if not 64 <= texels <= 16384:
        raise InputError("out of range", field="texels", value=texels, allowed="64 to 16384")
    root = folder / "scene.usdc"
    flatten_scene(scene, root)
    stage = Usd.Stage.Open(str(root))
    baking = Baking(stage, folder, TextureLookup(), warn)
    patched = {path for group in _groups(stage) for path in _bake_group(baking, group, texels)}
    for path in _still_procedural(stage):
        far = path.HasPrefix(tokens.BACKGROUND) and path not in patched
        bake_tile(baking, path, texels // (4 if far else 2), path in patched)
    kept = [path.name for path in _still_procedural(stage)]
    if kept:
        warn(
            "these materials lose their detail in other renderers, because they have no texture to bake it into: "
            f"{', '.join(kept)}"
        )
    baked = folder / "baked.usdc"
    export(stage.GetRootLayer(), baked)
    del stage, baking
    baked.replace(root)
    Sdf.Layer.FindOrOpen(str(root)).Reload(force=True)
    return root


def _groups(stage: Usd.Stage) -> list[_Group]:
    groups: dict[tuple[Sdf.Path, str], _Group] = {}
    for prim in stage.Traverse():
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(ATLAS) if prim.IsA(UsdGeom.Mesh) else None
        if not primvar or not primvar.HasValue():
            continue
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        if material and material.GetPrim().HasAPI(DETAIL):
            scope = material.GetPath().GetParentPath()
            macro = material.GetPrim().GetAttribute(MACRO).Get()
            file = Path(macro.path).stem if macro else ""
            group = groups.setdefault((scope, file), _Group("_".join(filter(None, (scope.name, file)))))
            group.meshes[material.GetPath()].append(prim)
    return [groups[key] for key in sorted(groups)]


def _bake_group(baking: Baking, group: _Group, texels: int) -> list[Sdf.Path]:
    """Bake an atlas; return the materials of a group whose meshes share texels, such as land with a tiled atlas."""
    stage, order = baking.stage, sorted(group.meshes)
    raster = AtlasRaster(texels)
    for number, path in enumerate(order):
        for prim in group.meshes[path]:
            mesh = UsdGeom.Mesh(prim)
            raster.draw(_corners(mesh, ATLAS), _corners(mesh, "st"), number)
            if raster.shared > MOST_SHARED:
                return order
    image = np.zeros((texels, texels, 3), np.float32)
    for number, path in enumerate(order):
        flat = read_material(UsdShade.Material(stage.GetPrimAtPath(path)), baking.warn).material
        if flat is not None:
            _shade(image, raster, number, flat, baking.textures)
    file = f"./{group.name}_baked.png"
    write_bytes(baking.folder / file, png(encode_srgb(raster.fill_gutters(image))))
    mean = image[raster.owner >= 0].mean(axis=0) if (raster.owner >= 0).any() else np.full(3, 0.5)
    for path in order:
        baked = _copy_material(stage, path, file, [round(float(value), 4) for value in mean])
        for prim in group.meshes[path]:
            UsdShade.MaterialBindingAPI.Apply(prim).Bind(baked)
    worn = _worn(stage)
    for path in order:
        if path not in worn:
            stage.RemovePrim(path)
    return []


def _still_procedural(stage: Usd.Stage) -> list[Sdf.Path]:
    """Find the used materials that only our renderer draws completely."""
    return sorted(path for path in _worn(stage) if stage.GetPrimAtPath(path).HasAPI(DETAIL))


def _worn(stage: Usd.Stage) -> set[Sdf.Path]:
    """Find the materials that anything is bound to, including the prototypes of native instances."""
    binding = (UsdShade.MaterialBindingAPI(prim).GetDirectBindingRel() for prim in stage.TraverseAll())
    return {target for relation in binding for target in relation.GetTargets()}


def _corners(mesh: UsdGeom.Mesh, name: str) -> F32:
    """Gather a UV set at the corners of a fan of triangles, shape (T, 3, 2), float32."""
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get())
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar(name)
    values = np.asarray(primvar.ComputeFlattened(), np.float32)
    if primvar.GetInterpolation() != UsdGeom.Tokens.faceVarying:
        values = values[np.asarray(mesh.GetFaceVertexIndicesAttr().Get())]
    first = np.repeat(np.cumsum(counts) - counts, counts - 2)
    step = np.concatenate([np.arange(1, count - 1) for count in counts])
    return values[np.stack([first, first + step, first + step + 1], axis=1)]


def _shade(image: F32, raster: AtlasRaster, number: int, material: Material, textures: TextureLookup) -> None:
    rows, columns = np.nonzero(raster.owner == number)
    st, meters, texels = raster.st[rows, columns], raster.footprint(number), len(raster.owner)
    st1 = np.stack([(columns + 0.5) / texels, 1 - (rows + 0.5) / texels], axis=-1).astype(np.float32)
    color = np.tile(np.array(material.base_color, np.float32), (len(rows), 1))
    texture = material.base_texture
    if texture:
        tiles = 1 / texels if texture.uv_set else meters
        place = placed(texture, st1 if texture.uv_set else st).astype(np.float32)
        color = textures.colors(texture.file, place, tiles * max(texture.scale), texture.srgb)
    image[rows, columns] = np.minimum(color * _detail(material.detail, st, st1, meters, textures), _BRIGHTEST)


def _detail(detail: Detail, st: F32, st1: F32, meters: float, textures: TextureLookup) -> F32:
    octaves = [
        np.float32(amplitude) * (2 * textures.levels(detail.file, st / np.float32(period), meters / period) - 1)
        for period, amplitude in (zip(detail.periods, detail.amplitudes, strict=True) if detail.file else ())
    ]
    macro = partial(_macro, detail.macro_file, st1, textures) if detail.macro_file else None
    return detail_factors(octaves, macro)


def _macro(file: str, st1: F32, textures: TextureLookup, shift: F32) -> F32:
    return textures.colors(file, st1 + shift, 0.0, False)


def _copy_material(stage: Usd.Stage, path: Sdf.Path, file: str, mean: list[float]) -> UsdShade.Material:
    """Copy a material beside itself, with the baked texture at `st1` and without the detail."""
    layer = stage.GetRootLayer()
    target = path.ReplaceName(path.name + SUFFIX)
    Sdf.CopySpec(layer, path, layer, target)
    material = UsdShade.Material(stage.GetPrimAtPath(target))
    remove_detail(material.GetPrim())
    reader = UsdShade.Shader.Define(stage, target.AppendChild("AtlasReader"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(ATLAS)
    texture = UsdShade.Shader.Define(stage, target.AppendChild("BakedColor"))
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(file))
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    texture.CreateInput("fallback", Sdf.ValueTypeNames.Float4).Set((*mean, 1.0))
    coordinates = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(coordinates)
    surface, _, _ = material.ComputeSurfaceSource()
    color = texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    surface.GetInput("diffuseColor").ConnectToSource(color)
    stage.RemovePrim(target.AppendChild("BaseColor"))
    return material
