"""Simple surfaces of other programs as flat materials: OmniPBR, and those of MaterialX.

Each input may be a constant or one texture. What a flat material cannot represent is left out with a warning.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pxr import UsdShade

from usd_schemas.flat_scene import Material, Texture
from usd_schemas.reading.labels import Warn
from usd_schemas.reading.shader_inputs import Source, asset_file, channel_of, find_source, number_of, pair_of, triple_of

Flat = tuple[Material, tuple[str, str]]
Triple = tuple[float, float, float]

_WHITE: Triple = (1.0, 1.0, 1.0)
_BLACK: Triple = (0.0, 0.0, 0.0)
_ZERO = (0.0, 0.0)
_IMAGES = ("ND_image_", "ND_tiledimage_", "ND_gltf_image", "ND_gltf_colorimage", "ND_gltf_normalmap")
_PASSED = ("ND_normalmap", "ND_convert_", "ND_extract_", "ND_separate")  # nodes that pass on their one texture
_MODES = {"clamp": "clamp", "mirror": "mirror", "constant": "black"}
_DEEPEST = 32  # largest number of nodes in a row
_NIT = 1e-3  # of emission_luminance [cd/m2]: a white surface outdoors has some thousands of cd/m2
_CLEAREST = 0.1  # opacity of a body that transmits all light: its reflections are still visible
_SOLID = 0.5  # opacity from which on a blended surface counts as opaque
_ORM_ROUGHNESS, _ORM_METALLIC = 1, 2  # channels of a texture of occlusion, roughness and metallic
_ALPHA = 3
_LINEAR_SPACES = ("raw", "lin_rec709", "lin_rec709_scene", "linear", "none", "data")


def read_foreign_material(material: UsdShade.Material, warn: Warn) -> Flat | None:
    """Read a material of OmniPBR, or of a surface of MaterialX.

    Args:
        material: Bound material.
        warn: Called with one line for each thing that is left out.

    Returns:
        The flat material and the primvars of its UV sets; None for any other surface.
    """
    path = str(material.GetPath())

    def note(text: str) -> None:
        warn(f"{path}: {text}")

    plain, _, _ = material.ComputeSurfaceSource()
    mdl, _, _ = material.ComputeSurfaceSource("mdl")
    for shader in (mdl, plain):
        if shader and _mdl_name(shader) == "OmniPBR":
            return _read_omni(path, shader, note), ("", "")
    other, _, _ = material.ComputeSurfaceSource("mtlx")
    for shader in (other, plain):
        if shader and shader.GetShaderId() in _SURFACES:
            return _read_mtlx(path, shader, _SURFACES[shader.GetShaderId()], note)
    return None


def _mdl_name(shader: UsdShade.Shader) -> str:
    name = shader.GetSourceAssetSubIdentifier("mdl")
    if name:
        return str(name)
    asset = shader.GetSourceAsset("mdl")
    return str(asset.path).rpartition("/")[2].removesuffix(".mdl") if asset else ""


def _read_omni(path: str, shader: UsdShade.Shader, note: Callable[[str], None]) -> Material:
    def source(name: str) -> Source:
        found = find_source(shader, name)
        if found.shader:
            note(f"{name} of OmniPBR comes from {found.shader.GetShaderId() or 'an unknown node'}, which is not read")
        return found

    def texture(name: str, srgb: bool) -> Texture | None:
        value = source(name).value
        file = asset_file(value)
        if value is not None and value.path and not file:
            note(f"no texture {value.path} for {name}: drawn without it")
        if not file:
            return None
        scale, turn = pair_of(source("texture_scale"), (1.0, 1.0)), number_of(source("texture_rotate"), 0.0)
        return Texture(file, srgb, scale, turn, pair_of(source("texture_translate"), (0.0, 0.0)))

    packed = bool(source("enable_ORM_texture").value)  # one texture of occlusion, roughness and metallic

    def number(constant: float, influence: str, own: str, channel: int) -> Texture | None:
        share = min(max(number_of(source(influence), 0.0), 0.0), 1.0)
        found = texture("ORM_texture" if packed else own, False) if share > 0.0 else None
        told = {"channel": channel if packed else 0, "gain": (share,) * 3, "bias": (constant * (1.0 - share),) * 3}
        return found and replace(found, **told)

    base, tint = texture("diffuse_texture", True), triple_of(source("diffuse_tint"), _WHITE)
    for name in ("project_uvw", "enable_opacity"):
        if source(name).value:
            note(f"{name} of OmniPBR is left out")
    rough, metal = number_of(source("reflection_roughness_constant"), 0.5), number_of(source("metallic_constant"), 0.0)
    color = triple_of(source("diffuse_color_constant"), (0.2, 0.2, 0.2))
    emissive, emissive_texture = (
        _omni_emission(source, texture, note) if source("enable_emission").value else (_BLACK, None)
    )
    return Material(
        name=path,
        base_color=_times(color, tint),
        base_texture=base and replace(base, gain=tint),
        roughness=rough,
        roughness_texture=number(
            rough, "reflection_roughness_texture_influence", "reflectionroughness_texture", _ORM_ROUGHNESS
        ),
        metallic=metal,
        metallic_texture=number(metal, "metallic_texture_influence", "metallic_texture", _ORM_METALLIC),
        normal_texture=texture("normalmap_texture", False),
        emissive=emissive,
        emissive_texture=emissive_texture,
    )


def _omni_emission(
    source: Callable[[str], Source], texture: Callable[[str, bool], Texture | None], note: Callable[[str], None]
) -> tuple[Triple, Texture | None]:
    """Read what OmniPBR emits: a color or its texture, times a mask, times an intensity."""
    glow = _gray(number_of(source("emissive_intensity"), 40.0))
    color = _times(triple_of(source("emissive_color"), (1.0, 0.1, 0.1)), glow)
    colored, mask = texture("emissive_color_texture", True), texture("emissive_mask_texture", True)
    if colored is not None and mask is not None:
        note("emissive_mask_texture of OmniPBR is left out beside an emissive_color_texture")
    if colored is not None:
        return color, replace(colored, gain=glow)
    return color, mask and replace(mask, gain=color)


@dataclass(frozen=True)
class _Surface:
    """Names of the inputs of a MaterialX surface, and their values if the material does not set them.

    `weight` multiplies `color`, `glow` multiplies `emission`; an empty name means no such input.
    """

    color: str
    roughness: str
    metallic: str
    normal: str
    emission: str
    opacity: str
    transmission: str = ""
    weight: str = ""
    glow: str = ""
    color_default: float = 0.8
    roughness_default: float = 0.2
    metallic_default: float = 0.0
    emission_default: float = 1.0
    glow_default: float = 0.0
    glow_unit: float = 1.0


_SURFACES = {
    "ND_standard_surface_surfaceshader": _Surface(
        "base_color",
        "specular_roughness",
        "metalness",
        "normal",
        "emission_color",
        "opacity",
        "transmission",
        "base",
        "emission",
    ),
    "ND_gltf_pbr_surfaceshader": _Surface(
        "base_color",
        "roughness",
        "metallic",
        "normal",
        "emissive",
        "alpha",
        "transmission",
        "",
        "emissive_strength",
        1.0,
        1.0,
        1.0,
        0.0,
        1.0,
    ),
    "ND_open_pbr_surface_surfaceshader": _Surface(
        "base_color",
        "specular_roughness",
        "base_metalness",
        "geometry_normal",
        "emission_color",
        "geometry_opacity",
        "transmission_weight",
        "base_weight",
        "emission_luminance",
        roughness_default=0.3,
        glow_unit=_NIT,
    ),
    "ND_UsdPreviewSurface_surfaceshader": _Surface(
        "diffuseColor",
        "roughness",
        "metallic",
        "normal",
        "emissiveColor",
        "opacity",
        color_default=0.18,
        roughness_default=0.5,
        emission_default=0.0,
        glow_default=1.0,
    ),
}


def _read_mtlx(path: str, shader: UsdShade.Shader, names: _Surface, note: Callable[[str], None]) -> Flat:
    def source(name: str) -> Source:
        return _constant(find_source(shader, name)) if name else Source()

    placed: dict[str, str] = {}

    def texture(name: str, is_color: bool) -> Texture | None:
        found = _image(source(name), is_color, name, note)
        if found is None:
            return None
        placed[name] = found[1]
        return found[0]

    weight, glow = number_of(source(names.weight), 1.0), number_of(source(names.glow), names.glow_default)
    glow *= names.glow_unit
    base, emission = texture(names.color, True), texture(names.emission, True) if glow else None
    rough, metal, normal = (texture(name, False) for name in (names.roughness, names.metallic, names.normal))
    opacity, cut, cut_by = _see_through(shader, source, names, note)
    if base is None and cut is not None:  # a constant color with the silhouette of a texture
        base = replace(cut, gain=(0.0, 0.0, 0.0), bias=_color_of(source(names.color), names.color_default))
        placed[names.color] = cut_by
    used = [name for name in dict.fromkeys(placed.values()) if name]
    second = used[1] if len(used) > 1 else ""
    for name in used[2:]:
        note(f"texture coordinates {name} are left out: a material has two sets of them")

    def numbered(name: str, one: Texture | None) -> Texture | None:
        return one and replace(one, uv_set=int(placed[name] == second != ""))

    if base is not None:
        if cut is not None and _mapping(cut) != _mapping(base):
            note("opacity and color are mapped differently: the mapping of the color is used for both")
        base = replace(base, gain=_times(base.gain, _gray(weight)), bias=_times(base.bias, _gray(weight)))
        base = base if cut is None else replace(base, alpha=cut.file, alpha_channel=cut.channel, alpha_gain=cut.gain[0])
    return Material(
        name=path,
        base_color=_times(_color_of(source(names.color), names.color_default), _gray(weight)),
        base_texture=numbered(names.color, base),
        roughness=number_of(source(names.roughness), names.roughness_default),
        roughness_texture=numbered(names.roughness, rough),
        metallic=number_of(source(names.metallic), names.metallic_default),
        metallic_texture=numbered(names.metallic, metal),
        normal_texture=numbered(names.normal, normal),
        emissive=_times(_color_of(source(names.emission), names.emission_default), _gray(glow)),
        emissive_texture=numbered(
            names.emission, emission and replace(emission, gain=_times(emission.gain, _gray(glow)))
        ),
        opacity_threshold=0.0 if cut is None else _SOLID,
        opacity=opacity,
        blends=opacity < 1.0 or cut is not None,
    ), (used[0] if used else "", second)


def _color_of(source: Source, default: float) -> Triple:
    return triple_of(source, _gray(default)) if source.shader is None else _gray(default)


def _constant(source: Source) -> Source:
    """Follow nodes that only hold a constant to its value."""
    for _ in range(_DEEPEST):
        if source.shader is None or not (source.shader.GetShaderId() or "").startswith("ND_constant_"):
            break
        source = find_source(source.shader, "value")
    return source


def _see_through(
    shader: UsdShade.Shader, source: Callable[[str], Source], names: _Surface, note: Callable[[str], None]
) -> tuple[float, Texture | None, str]:
    """Find the opacity of a surface, and if there is one its texture, with the primvar of its coordinates."""
    sent = number_of(source(names.transmission), 0.0)
    told = source(names.opacity)
    if names.opacity == "alpha" and int(number_of(find_source(shader, "alpha_mode"), 0.0)) == 0:
        told = Source()  # opaque, whatever the alpha
    opacity = 1.0 - (1.0 - _CLEAREST) * min(max(sent, 0.0), 1.0)
    if sent > 0.0:
        note(f"its transmission is drawn as opacity {opacity:.2g}")
    if told.shader is not None:
        found = _image(told, False, names.opacity, note)
        return (opacity, None, "") if found is None else (opacity, *found)
    value = told.value
    own = 1.0 if value is None else float(value) if isinstance(value, int | float) else sum(value) / 3
    return opacity * min(max(own, 0.0), 1.0), None, ""


def _image(source: Source, is_color: bool, name: str, note: Callable[[str], None]) -> tuple[Texture, str] | None:
    """Find the one texture that feeds an input, and the primvar of its coordinates."""
    shader, channel = source.shader, channel_of(source.output) or 0
    gain: Triple = _WHITE
    for _ in range(_DEEPEST):
        kind = (shader.GetShaderId() or "") if shader is not None else ""
        if shader is None or not kind.startswith((*_PASSED, "ND_multiply_")):
            break
        if kind.startswith("ND_extract_"):
            channel = int(number_of(find_source(shader, "index"), 0.0))
        ports = ("in1", "in2") if kind.startswith("ND_multiply_") else ("in",)
        feeding = [_constant(find_source(shader, port)) for port in ports]
        values = [one.value for one in feeding if one.shader is None and one.value is not None]
        for value in values if len(ports) > 1 else ():
            gain = _times(gain, _gray(float(value)) if isinstance(value, int | float) else _three(value))
        fed = [one for one in feeding if one.shader is not None]
        if len(fed) != 1:  # a product of textures, or none
            break
        inner = fed[0]
        shader, channel = inner.shader, channel or channel_of(inner.output) or 0
    if shader is None:
        return None
    kind = shader.GetShaderId() or "an unknown node"
    if not kind.startswith(_IMAGES) or not 0 <= channel <= _ALPHA:
        note(f"{name} comes from {kind}, which is not read")
        return None
    told = find_source(shader, "file")
    file = asset_file(told.value)
    if not file:
        note(f"no texture for {name}: drawn plain")
        return None
    srgb = is_color and told.color_space.lower() not in _LINEAR_SPACES
    found, varname = _placed(shader, note)
    return replace(found, file=file, srgb=srgb, channel=0 if is_color else channel, gain=gain), varname


def _mapping(texture: Texture) -> tuple[object, ...]:
    return texture.scale, texture.rotation, texture.translation, texture.wrap


def _three(value: Any) -> Triple:
    return float(value[0]), float(value[1]), float(value[2])


def _placed(shader: UsdShade.Shader, note: Callable[[str], None]) -> tuple[Texture, str]:
    """Read the mapping of a texture: its tiling, rotation, offset and wrap modes, and its primvar."""
    tiling, offset = (
        pair_of(find_source(shader, "uvtiling"), (1.0, 1.0)),
        pair_of(find_source(shader, "uvoffset"), _ZERO),
    )
    place = find_source(shader, "texcoord").shader
    linear, shift = np.diag(tiling), -np.array(offset)
    if place and (place.GetShaderId() or "").startswith("ND_place2d"):
        pivot, scale, moved = (
            np.array(pair_of(find_source(place, name), default))
            for name, default in (("pivot", _ZERO), ("scale", (1.0, 1.0)), ("offset", _ZERO))
        )
        angle = np.deg2rad(number_of(find_source(place, "rotate"), 0.0))  # clockwise
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        if int(number_of(find_source(place, "operationorder"), 0.0)):
            note("this operationorder of place2d is not supported: read as scale, rotate, translate")
        whole = turn @ np.diag(1.0 / np.where(scale == 0.0, 1.0, scale))
        shift = shift + np.diag(tiling) @ (pivot - moved - whole @ pivot)
        linear = np.diag(tiling) @ whole
        place = find_source(place, "texcoord").shader
    told = [str(find_source(shader, name).value or "") for name in ("uaddressmode", "vaddressmode")]
    across, down = (_MODES.get(mode, "repeat") for mode in told)
    turned = float(np.rad2deg(np.arctan2(linear[1, 0], linear[0, 0])))
    back = np.deg2rad(turned)
    scales = np.array([[np.cos(back), np.sin(back)], [-np.sin(back), np.cos(back)]]) @ linear
    varname = str(find_source(place, "geomprop").value or "") if place else ""
    scale = (float(scales[0, 0]), float(scales[1, 1]))
    return Texture("", False, scale, turned, (float(shift[0]), float(shift[1])), wrap=(across, down)), varname


def _gray(value: float) -> Triple:
    return value, value, value


def _times(one: Triple, other: Triple) -> Triple:
    return one[0] * other[0], one[1] * other[1], one[2] * other[2]
