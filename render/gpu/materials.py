"""Materials in the shader's format, and the variant of the shader that each of them needs."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.textures import ChannelPair, TextureKey, TextureSlot
from usd_schemas.flat_scene import MOST_OCTAVES, Material, Texture
from usd_schemas.texels import rotation

F32 = NDArray[np.float32]

_MIRROR_ROUGHNESS = 0.35  # rougher surfaces show no image of the sky

# One row of the shader's materials; the order of material_row.glsl.
ROW = np.dtype(
    [
        ("base", "4f4"),  # color, roughness
        ("emissive", "4f4"),  # color, metallic
        ("albedo", "(2,4)f4"),  # rows of the affine map of (s, t, 1) and (layer, uv set)
        ("roughness", "(2,4)f4"),
        ("normal", "(2,4)f4"),
        ("metallic", "(2,4)f4"),
        ("frequencies", "4f4"),  # detail: tiles per meter of each octave, layer
        ("amplitudes", "4f4"),  # detail: contrast of each octave, macro layer
        ("options", "4f4"),  # opacity threshold, takes the vertex color, opacity
        ("emission", "(2,4)f4"),
        ("specular", "4f4"),  # specular color at normal incidence
    ]
)
_AVERAGED = {
    "fast": ("roughness", "metallic", "specular"),
    "standard": ("roughness", "specular"),
    "fine": ("specular",),
}
_KINDS: dict[str, Literal["color", "vector", "number"]] = {
    "albedo": "color",
    "roughness": "number",
    "normal": "vector",
    "metallic": "number",
    "emission": "color",
    "specular": "color",
}
_REPEATS = ("repeat", "repeat")
_UNREAD = {"fast": ("normal",), "standard": (), "fine": ()}
SLOTS = ("albedo", "roughness", "normal", "detail", "macro", "metallic", "emission")


@dataclass(frozen=True)
class Variant:
    """The features of the shader that a material needs; materials of one variant are drawn together.

    Attributes:
        features: Names that the shader is compiled with.
        arrays: Texture array of each of `SLOTS`, shape (side, side, layers), uint8, or None.
        wraps: Wrap modes of each along s and t; None if it repeats.
        mostly_transparent: Its opacity is below 0.5: it is neither in the truth nor in shadows.
    """

    features: tuple[str, ...]
    arrays: tuple[moderngl.TextureArray | None, ...]
    wraps: tuple[tuple[str, str] | None, ...] = (None,) * len(SLOTS)
    mostly_transparent: bool = False


@dataclass(frozen=True)
class MaterialTable:
    """Every material of a scene, ready for the shader.

    Attributes:
        rows: Shader rows, shape (M,), dtype `ROW`.
        variants: Variant of each material.
        means: Mean linear base color of each material [1], shape (M, 3), float64.
    """

    rows: NDArray[np.void]
    variants: tuple[Variant, ...]
    means: NDArray[np.float64]


def texture_keys(materials: tuple[Material, ...], quality: str) -> tuple[list[TextureKey], list[TextureKey]]:
    """List the textures of materials.

    Args:
        materials: Materials.
        quality: As for `tabulate_materials`.

    Returns:
        Those that are looked up at pixels, and those of which only the mean is used.
    """
    named = [item for material in materials for item in _keys(material).items() if item[0] not in _UNREAD[quality]]
    return (
        [key for name, key in named if name not in _AVERAGED[quality]],
        [key for name, key in named if name in _AVERAGED[quality]],
    )


def channel_pairs(materials: tuple[Material, ...]) -> list[ChannelPair]:
    """List which roughness may be stored in the opacity of which color: one look-up then finds both.

    Args:
        materials: Materials.
    """
    packable: list[ChannelPair] = []
    for material in materials:
        keys, albedo, roughness = _keys(material), material.base_texture, material.roughness_texture
        cut_out = material.opacity_threshold > 0  # blended ones have an opacity, too
        if "albedo" in keys and cut_out:
            packable.append((keys["albedo"], None))
        packable += [(None, keys[name]) for name in ("metallic", "detail") if name in keys]
        if "roughness" in keys and roughness is not None:
            alike = albedo is not None and np.array_equal(_placement(albedo, 0), _placement(roughness, 0))
            packable.append((keys.get("albedo") if alike and not cut_out else None, keys["roughness"]))
    return packable


def tabulate_materials(
    materials: tuple[Material, ...], slots: dict[TextureKey, TextureSlot], quality: str
) -> MaterialTable:
    """Turn materials into shader rows and variants.

    Args:
        materials: Materials.
        slots: Textures that could be loaded; for a missing one the constant is used.
        quality: `fast` leaves out normal maps and images of the sky, and uses the mean of metallic textures; only
            `fine` looks up the roughness at each pixel, else its mean is used: the reflections of concrete, soil and
            grass are too weak to show the difference.
    """
    rows = np.zeros(len(materials), ROW)
    variants = []
    means = np.zeros((len(materials), 3))
    for number, material in enumerate(materials):
        found = {name: slots[key] for name, key in _keys(material).items() if key in slots}
        roughness = found["roughness"].mean[0] if "roughness" in found else material.roughness
        _fill(rows[number], material, found)
        metallic = found["metallic"].mean[0] if "metallic" in found else material.metallic
        rows[number]["base"][3], rows[number]["emissive"][3] = roughness, metallic
        found = {name: slot for name, slot in found.items() if slot.array is not None}
        features = []
        if "roughness" in found and found["roughness"].channel:
            features.append("ROUGHNESS_IN_ALBEDO")
            found.pop("roughness")
        for name in _AVERAGED[quality]:
            found.pop(name, None)
        features += [f"HAS_{name.upper()}" for name in SLOTS if name in found]
        if "albedo" in found and material.opacity_threshold > 0 and found["albedo"].cut_out:
            features.append("CUT_OUT")
        if material.is_matt:
            features.append("MATT")
        else:
            if quality != "fast" and (roughness < _MIRROR_ROUGHNESS or metallic > 0.5 or "metallic" in found):
                features.append("MIRROR")
            if material.specular is not None:
                features.append("SPECULAR")
        if material.blends:
            features.append("BLEND")
        found = {name: slot for name, slot in found.items() if name in SLOTS}
        arrays = tuple(found[name].array if name in found else None for name in SLOTS)
        variants.append(Variant(tuple(features), arrays, _wraps(material, found), material.is_mostly_transparent))
        means[number] = found["albedo"].mean if "albedo" in found else material.base_color
    return MaterialTable(rows, tuple(variants), means)


def _maps(material: Material) -> dict[str, Texture | None]:
    return {
        "albedo": material.base_texture,
        "roughness": None if material.is_matt else material.roughness_texture,
        "normal": material.normal_texture,
        "metallic": material.metallic_texture,
        "emission": material.emissive_texture,
        "specular": material.specular_texture,
    }


def _wraps(material: Material, found: dict[str, TextureSlot]) -> tuple[tuple[str, str] | None, ...]:
    """List the wrap modes of the texture of each slot; None where it repeats."""
    maps = _maps(material)
    told = (texture.wrap if (texture := maps.get(name)) and name in found else _REPEATS for name in SLOTS)
    return tuple(None if wrap == _REPEATS else wrap for wrap in told)


def _keys(material: Material) -> dict[str, TextureKey]:
    keys: dict[str, TextureKey] = {}
    for name, texture in _maps(material).items():
        if texture is not None and texture.file:
            texture = _relative(texture)[0] if name == "emission" else texture
            channel = texture.channel if _KINDS[name] == "number" else 0
            keys[name] = TextureKey(
                texture.file,
                texture.srgb,
                _KINDS[name],
                channel,
                texture.gain,
                texture.bias,
                texture.alpha,
                texture.alpha_channel,
                texture.alpha_gain,
                texture.alpha_bias,
            )
    if material.detail.file and material.detail.periods:
        keys["detail"] = TextureKey(material.detail.file, False, "number")
    if material.detail.macro_file:
        keys["macro"] = TextureKey(material.detail.macro_file, False, "vector")
    return keys


def _relative(texture: Texture) -> tuple[Texture, tuple[float, float, float]]:
    """Divide a texture by the brightest color that it can have, so that 8 bits hold it; returns that color too."""
    peaks = [max(gain, 0.0) + bias for gain, bias in zip(texture.gain, texture.bias, strict=True)]
    red, green, blue = (peak if peak > 0.0 else 1.0 for peak in peaks)
    gain = texture.gain[0] / red, texture.gain[1] / green, texture.gain[2] / blue
    bias = texture.bias[0] / red, texture.bias[1] / green, texture.bias[2] / blue
    return replace(texture, gain=gain, bias=bias), (red, green, blue)


def placed_textures(material: Material) -> Iterator[tuple[TextureKey, float, int]]:
    """List the textures of a material with their scale.

    Args:
        material: A material.

    Yields:
        Key, least number of times that the texture repeats along a unit of its UV set [1], and the number of that set.
    """
    maps = _maps(material)
    for name, key in _keys(material).items():
        texture = maps.get(name)
        if texture is not None:
            yield key, min(abs(scale) for scale in texture.scale), texture.uv_set
        elif name == "macro":
            yield key, 1.0, 1
        else:
            yield key, 1.0 / max(material.detail.periods[:MOST_OCTAVES]), 0


def _fill(row: NDArray[np.void], material: Material, found: dict[str, TextureSlot]) -> None:
    row["base"] = (*material.base_color, material.roughness)
    glow = material.emissive_texture
    emissive = _relative(glow)[1] if glow is not None and "emission" in found else material.emissive
    row["emissive"] = (*emissive, material.metallic)
    specular = found["specular"].mean if "specular" in found else material.specular or (0.0, 0.0, 0.0)
    row["specular"] = (*specular, 0.0)
    for name, texture in _maps(material).items():
        if texture is not None and name in found and name != "specular":
            row[name] = _placement(texture, found[name].layer)
    octaves = min(MOST_OCTAVES, len(material.detail.periods), len(material.detail.amplitudes))
    for octave in range(octaves):
        row["frequencies"][octave] = 1.0 / material.detail.periods[octave]
        row["amplitudes"][octave] = material.detail.amplitudes[octave]
    row["frequencies"][3] = found["detail"].layer if "detail" in found else 0
    row["amplitudes"][3] = found["macro"].layer if "macro" in found else 0
    row["options"] = (material.opacity_threshold, float(material.use_display_color), material.opacity, 0)


def _placement(texture: Texture, layer: int) -> F32:
    """Scale, then rotate, then translate (s, t), as UsdTransform2d does; shape (2, 4), float32."""
    placement = np.zeros((2, 4), np.float32)
    placement[:, :2] = rotation(texture) @ np.diag(texture.scale)
    placement[:, 2] = texture.translation
    placement[:, 3] = (layer, texture.uv_set)
    return placement
