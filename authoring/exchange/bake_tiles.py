"""Baking fine detail into tiled textures: a tile is enlarged until it contains nearly whole periods of the detail."""

from functools import partial

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdShade

from authoring.exchange.bake_lookup import TextureLookup
from authoring.exchange.bake_stains import detail_factors
from authoring.exchange.baking import Baking
from authoring.looks.encode import encode_srgb, png
from groundwork.files import write_bytes
from usd_schemas.flat_scene import Detail, Texture
from usd_schemas.reading.materials import read_material

F32 = NDArray[np.float32]

DETAIL = "FalseworkDetailAPI"
LONGEST = 26.0  # [m] side of a tile: two or three longest periods of our detail, which changes by a few percent
PATCHES = 130.0  # [m] side of a tile with patches, as wide as those of the land beside the site
_BRIGHTEST = np.float32(0.95)  # albedo, as in our renderer


def bake_tile(baking: Baking, path: Sdf.Path, texels: int, patched: bool) -> None:
    """Bake the detail of a material into a larger tile; one without a tiled base texture is unchanged.

    Args:
        baking: Stage and textures.
        path: A material with detail.
        texels: Texels along a side of the tile [px].
        patched: Its macro texture is repeated in tiles, too, and is baked into this one.
    """
    stage = baking.stage
    material = UsdShade.Material(stage.GetPrimAtPath(path))
    flat = read_material(material, baking.warn).material
    surface, _, _ = material.ComputeSurfaceSource()
    texture = flat.base_texture if flat is not None else None
    reader = _source(surface, "diffuseColor") if surface else None
    placement = _source(reader, "st") if reader else None
    if flat is None or texture is None or texture.uv_set or reader is None or placement is None:
        return
    if placement.GetShaderId() != "UsdTransform2d" or texture.rotation or any(texture.translation):
        return
    repeats = _repeats(1 / max(texture.scale), flat.detail.periods, PATCHES if patched else 0.0)
    image = _tile(flat.detail, texture, repeats, texels, patched, baking.textures)
    file = f"./{path.GetParentPath().name}_{path.name}_baked.png"
    write_bytes(baking.folder / file, png(encode_srgb(image)))
    larger = path.AppendChild("BakedPlacement")
    Sdf.CopySpec(stage.GetRootLayer(), placement.GetPath(), stage.GetRootLayer(), larger)
    place = UsdShade.Shader(stage.GetPrimAtPath(larger))
    place.CreateInput("scale", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(*(value / repeats for value in texture.scale)))
    reader.GetInput("st").ConnectToSource(place.CreateOutput("result", Sdf.ValueTypeNames.Float2))
    reader.GetInput("file").Set(Sdf.AssetPath(file))
    mean = [round(float(value), 4) for value in image.mean(axis=(0, 1))]
    reader.CreateInput("fallback", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*mean, 1.0))
    remove_detail(material.GetPrim())


def remove_detail(prim: Usd.Prim) -> None:
    """Remove the detail of a material.

    Args:
        prim: A material.
    """
    prim.RemoveAPI(DETAIL)
    for attribute in prim.GetPropertiesInNamespace("falsework:detail"):
        prim.RemoveProperty(attribute.GetName())


def whole_periods(periods: tuple[float, ...], side: float) -> tuple[int, ...]:
    """Count how many times each period fits into a tile, rounded.

    Args:
        periods: Periods of the detail [m].
        side: Side of the tile [m].
    """
    return tuple(max(round(side / period), 1) for period in periods)


def _repeats(sheet: float, periods: tuple[float, ...], wanted: float) -> int:
    """Choose how many sheets a tile has along a side: close to a given side, else with the least distorted periods."""
    if wanted:
        return max(round(wanted / sheet), 1)

    def bend(repeats: int) -> float:
        side = repeats * sheet
        counts = whole_periods(periods, side)
        return max((abs(side / count / period - 1) for count, period in zip(counts, periods, strict=True)), default=0.0)

    return min(range(1, max(int(LONGEST / sheet), 1) + 1), key=bend)


def _tile(detail: Detail, texture: Texture, repeats: int, texels: int, patched: bool, textures: TextureLookup) -> F32:
    """Multiply base texture, detail and patches over one tile, linear, shape (H, H, 3), float32."""
    steps = (np.arange(texels, dtype=np.float32) + np.float32(0.5)) / np.float32(texels)
    across, up = np.meshgrid(steps, 1 - steps)
    unit = np.stack([across, up], axis=-1).reshape(-1, 2)
    color = textures.colors(texture.file, unit * np.float32(repeats), repeats / texels, texture.srgb)
    octaves = _octaves(detail, unit, texture.scale, repeats, texels, textures)
    macro = partial(_macro, detail.macro_file, unit, texels, textures) if patched and detail.macro_file else None
    color *= detail_factors(octaves, macro)
    return np.minimum(color, _BRIGHTEST).reshape(texels, texels, 3)


def _macro(file: str, unit: F32, texels: int, textures: TextureLookup, shift: F32) -> F32:
    return textures.colors(file, unit + shift, 1 / texels, False)


def _octaves(
    detail: Detail, unit: F32, scale: tuple[float, float], repeats: int, texels: int, textures: TextureLookup
) -> list[F32]:
    """Compute the deviation from 1 of each octave's factor over one tile [1], shape (N, 1) each, float32."""
    found = []
    counts = [whole_periods(detail.periods, repeats / one) for one in scale]
    for across, up, amplitude in zip(*counts, detail.amplitudes, strict=True) if detail.file else ():
        gray = textures.levels(detail.file, unit * np.array([across, up], np.float32), max(across, up) / texels)
        found.append(np.float32(amplitude) * (2 * gray - 1))
    return found


def _source(shader: UsdShade.Shader, name: str) -> UsdShade.Shader | None:
    """Find the shader that is connected to an input."""
    entry = shader.GetInput(name)
    attributes = entry.GetValueProducingAttributes() if entry else []
    fed = attributes and UsdShade.Output.IsOutput(attributes[0])
    return UsdShade.Shader(attributes[0].GetPrim()) if fed else None
