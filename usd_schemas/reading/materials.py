"""UsdPreviewSurface networks as flat materials; a warning for each input that these cannot represent."""

from dataclasses import dataclass, replace

import numpy as np
from pxr import Sdf, Usd, UsdShade

from usd_schemas.flat_scene import MOST_OCTAVES, Detail, Material, Texture
from usd_schemas.reading.foreign_materials import read_foreign_material
from usd_schemas.reading.labels import Warn
from usd_schemas.reading.meshes import ATLAS_ST
from usd_schemas.reading.shader_inputs import (
    Source,
    asset_file,
    channel_of,
    find_source,
    number_of,
    pair_of,
    shine_by_ior,
    triple_of,
)

GRAY = (0.5, 0.5, 0.5)
PLAIN_COLOR = "displayColor"
_DEFAULT_DIFFUSE = (0.18, 0.18, 0.18)
_DEFAULT_ROUGHNESS = 0.5
_WRAPS = ("mirror", "clamp", "black")  # wrap modes other than repeating
_CODED_NORMAL = ((2.0, 2.0, 2.0), (-1.0, -1.0, -1.0))  # from a picture's 0 to 1 to a vector's -1 to 1
_SOLID = 0.5  # opacity from which on a blended surface counts as opaque [1]
_ALPHA = 3  # channel
_CONTEXTS = ("mtlx", "mdl", "ri", "glslfx", "arnold", "cycles")


_Four = tuple[float, float, float, float]


@dataclass(frozen=True)
class ReadMaterial:
    """A material, and the primvars that it reads.

    Attributes:
        material: The flat material; None where only displayColor or gray can replace it.
        uv_names: Primvar names of its first and second UV set; empty where it names none.
        color_name: Primvar of colors that it reads.
    """

    material: Material | None
    uv_names: tuple[str, str] = ("", "")
    color_name: str = PLAIN_COLOR


@dataclass(frozen=True)
class _Sampled:
    """A texture whose UV set has not been numbered yet."""

    texture: Texture
    varname: str
    output: str


def read_material(material: UsdShade.Material, warn: Warn) -> ReadMaterial:
    """Read one material.

    Args:
        material: Bound material.
        warn: Called with one line for each thing that is left out.
    """
    path = str(material.GetPath())
    surface, _, _ = material.ComputeSurfaceSource()
    kind = surface.GetShaderId() if surface else ""
    if kind != "UsdPreviewSurface":
        foreign = read_foreign_material(material, warn)
        if foreign is not None:
            return ReadMaterial(*foreign)
        others = (material.ComputeSurfaceSource(context)[0] for context in _CONTEXTS)
        names = (other.GetShaderId() or other.GetPrim().GetName() for other in others if other)
        named = kind or next(names, "no surface")
        warn(f"{path}: a material without a UsdPreviewSurface ({named}): drawn in displayColor or gray")
        return ReadMaterial(None)
    return _read_preview(path, material, surface, warn)


def _read_preview(path: str, material: UsdShade.Material, surface: UsdShade.Shader, warn: Warn) -> ReadMaterial:
    def note(text: str) -> None:
        warn(f"{path}: {text}")

    base, color, colored_by = _read_color(find_source(surface, "diffuseColor"), note)
    rough, metal = (_read_number(surface, name, note) for name in ("roughness", "metallic"))
    normal = _read_normal(find_source(surface, "normal"), note)
    glow = _read_plain(surface, "emissiveColor", note)
    by_specular = bool(number_of(find_source(surface, "useSpecularWorkflow"), 0.0))
    shine = _read_plain(surface, "specularColor", note) if by_specular else None
    told = triple_of(find_source(surface, "specularColor"), (0.0, 0.0, 0.0)) if by_specular else shine_by_ior(surface)
    _note_unread(surface, note)
    detail = _read_detail(material.GetPrim(), note)
    opacity = _read_opacity(surface, note)
    base, threshold = _see_through(base, color, opacity, note)
    used = (base, rough, metal, normal, glow, shine)
    names = _uv_names([sampled.varname for sampled in used if sampled], note)

    def numbered(sampled: _Sampled | None) -> Texture | None:
        return replace(sampled.texture, uv_set=int(sampled.varname == names[1] != "")) if sampled else None

    return ReadMaterial(
        Material(
            name=path,
            base_color=color,
            use_display_color=bool(colored_by),
            base_texture=numbered(base),
            roughness=number_of(find_source(surface, "roughness"), _DEFAULT_ROUGHNESS),
            roughness_texture=numbered(rough),
            metallic=0.0 if by_specular else number_of(find_source(surface, "metallic"), 0.0),
            metallic_texture=None if by_specular else numbered(metal),
            normal_texture=numbered(normal),
            emissive=triple_of(find_source(surface, "emissiveColor"), (0.0, 0.0, 0.0)),
            opacity_threshold=threshold,
            detail=detail,
            emissive_texture=numbered(glow),
            specular=told,
            specular_texture=numbered(shine),
            opacity=opacity.value,
            blends=opacity.blends,
        ),
        names,
        colored_by or PLAIN_COLOR,
    )


def _uv_names(used: list[str], note: Warn) -> tuple[str, str]:
    """Assign the primvars that textures read to the two UV sets: `st1` is always the second."""
    first = [name for name in dict.fromkeys(used) if name and name != ATLAS_ST]
    second = ATLAS_ST if ATLAS_ST in used else (first[1] if len(first) > 1 else "")
    for name in first[1:]:
        if name != second:
            note(f"texture coordinates {name} are left out: a material has two sets of them")
    return (first[0] if first else ""), second


def _read_color(source: Source, note: Warn) -> tuple[_Sampled | None, tuple[float, float, float], str]:
    """Read the diffuse color: its texture, else a constant, else the primvar of its colors."""
    if source.shader is None:
        return None, triple_of(source, _DEFAULT_DIFFUSE), ""
    if source.shader.GetShaderId() == "UsdPrimvarReader_float3":
        fallback = triple_of(find_source(source.shader, "fallback"), GRAY)  # for meshes without such a primvar
        return None, fallback, str(find_source(source.shader, "varname").value or PLAIN_COLOR)
    sampled = _read_texture(source, True, "diffuseColor", note)
    if sampled and sampled.output in ("rgb", ""):
        return sampled, GRAY, ""
    if sampled:
        note(f"diffuseColor from output {sampled.output} of a texture is left out: drawn plain gray")
    return None, GRAY, ""


def _read_number(surface: UsdShade.Shader, name: str, note: Warn) -> _Sampled | None:
    sampled = _read_texture(find_source(surface, name), False, name, note)
    if sampled is None:
        return None
    channel = channel_of(sampled.output)
    if channel is None:
        note(f"{name} from output {sampled.output} of a texture is left out")
        return None
    gain, bias = (values[channel] for values in _gain_and_bias(find_source(surface, name).shader))
    texture = replace(sampled.texture, channel=channel, gain=(gain,) * 3, bias=(bias,) * 3)
    return replace(sampled, texture=texture)


def _read_normal(source: Source, note: Warn) -> _Sampled | None:
    sampled = _read_texture(source, False, "normal", note)
    if sampled is None:
        return None
    scale, bias = (values[:3] for values in _gain_and_bias(source.shader))
    if (scale, bias) == ((1.0,) * 3, (0.0,) * 3):  # often not authored; an 8-bit normal map without them is never meant
        scale, bias = _CODED_NORMAL
    gain, shift = tuple(value / 2 for value in scale), tuple((value + 1) / 2 for value in bias)
    texture = replace(sampled.texture, gain=_three(gain), bias=_three(shift))
    return replace(sampled, texture=texture)


def _three(values: tuple[float, ...]) -> tuple[float, float, float]:
    red, green, blue = values
    return red, green, blue


def _read_plain(surface: UsdShade.Shader, name: str, note: Warn) -> _Sampled | None:
    """Read a texture of a color that is used unchanged."""
    sampled = _read_texture(find_source(surface, name), True, name, note)
    if sampled and sampled.output not in ("rgb", ""):
        note(f"{name} from output {sampled.output} of a texture is left out")
        return None
    return sampled


def _note_unread(surface: UsdShade.Shader, note: Warn) -> None:
    """Name the inputs of a preview surface that change its look and cannot be represented in a flat material."""
    for name in ("clearcoat", "displacement"):
        source = find_source(surface, name)
        if source.shader or number_of(source, 0.0) != 0.0:
            note(f"{name} is left out")


def _read_texture(source: Source, is_color: bool, name: str, note: Warn) -> _Sampled | None:
    shader = source.shader
    if shader is None:
        return None
    if shader.GetShaderId() != "UsdUVTexture":
        note(f"{name} comes from {shader.GetShaderId() or 'an unknown node'}, which is not read")
        return None
    value = find_source(shader, "file").value
    file = asset_file(value)
    if not file:
        note(f"no texture {value.path if isinstance(value, Sdf.AssetPath) else '(none)'} for {name}: drawn plain gray")
        return None
    gain, bias = _gain_and_bias(shader)
    told = [str(find_source(shader, edge).value or "") for edge in ("wrapS", "wrapT")]
    across, down = (wrap if wrap in _WRAPS else "repeat" for wrap in told)
    space = str(find_source(shader, "sourceColorSpace").value or "auto")
    placed = find_source(shader, "st")
    scale, rotation, translation = (1.0, 1.0), 0.0, (0.0, 0.0)
    if placed.shader and placed.shader.GetShaderId() == "UsdTransform2d":
        scale = pair_of(find_source(placed.shader, "scale"), scale)
        rotation = number_of(find_source(placed.shader, "rotation"), 0.0)
        translation = pair_of(find_source(placed.shader, "translation"), translation)
        placed = find_source(placed.shader, "in")
    varname = ""
    if placed.shader and placed.shader.GetShaderId() == "UsdPrimvarReader_float2":
        varname = str(find_source(placed.shader, "varname").value or "")
    # `auto` depends on the file: color textures are sRGB and data textures are not, whatever their header states.
    srgb = space == "sRGB" or (space == "auto" and is_color)
    placed_texture = Texture(
        file, srgb, scale, rotation, translation, gain=gain[:3], bias=bias[:3], wrap=(across, down)
    )
    return _Sampled(placed_texture, varname, source.output)


def _gain_and_bias(texture: UsdShade.Shader | None) -> tuple[_Four, _Four]:
    """Read `scale` and `bias` of a UsdUVTexture, red to alpha."""
    found: list[_Four] = []
    for name, default in (("scale", 1.0), ("bias", 0.0)):
        value = find_source(texture, name).value if texture else None
        red, green, blue, alpha = (default,) * 4 if value is None else (float(number) for number in value)
        found.append((red, green, blue, alpha))
    return found[0], found[1]


@dataclass(frozen=True)
class _Opacity:
    """Opacity of a surface: a number, or a channel of a texture times `gain` plus `bias`; 0 for no threshold."""

    value: float = 1.0
    blends: bool = False
    threshold: float = 0.0
    sampled: _Sampled | None = None
    channel: int = 3
    gain: float = 1.0
    bias: float = 0.0

    def over(self, texture: Texture) -> Texture:
        """Give a texture this opacity."""
        file = self.sampled.texture.file if self.sampled else ""
        opacity = {"alpha": file, "alpha_channel": self.channel, "alpha_gain": self.gain, "alpha_bias": self.bias}
        return replace(texture, **opacity)


def _read_opacity(surface: UsdShade.Shader, note: Warn) -> _Opacity:
    threshold = number_of(find_source(surface, "opacityThreshold"), 0.0)
    source = find_source(surface, "opacity")
    if source.shader is None:
        value = min(max(number_of(source, 1.0), 0.0), 1.0)
        if threshold > 0.0:
            return _Opacity() if value >= threshold else _Opacity(0.0, True)
        return _Opacity(value, value < 1.0)
    sampled = _read_texture(source, False, "opacity", note)
    channel = channel_of(sampled.output) if sampled else None
    if sampled is None or channel is None:
        return _Opacity()
    gain, bias = (values[channel] for values in _gain_and_bias(source.shader))
    return _Opacity(1.0, threshold <= 0.0, threshold if threshold > 0.0 else _SOLID, sampled, channel, gain, bias)


def _see_through(
    base: _Sampled | None, color: tuple[float, float, float], opacity: _Opacity, note: Warn
) -> tuple[_Sampled | None, float]:
    """Combine opacity with the base texture, and find the threshold at which it counts as opaque."""
    if opacity.sampled is None:
        return base, 0.0
    cut = opacity.sampled.texture
    if base is None:  # a constant color with the silhouette of a texture
        plain = replace(opacity.over(cut), gain=(0.0, 0.0, 0.0), bias=color)
        return replace(opacity.sampled, texture=plain, output="rgb"), opacity.threshold
    own = base.texture
    for what, one, other in (
        ("texture transforms", (cut.scale, cut.rotation, cut.translation), (own.scale, own.rotation, own.translation)),
        ("wrap modes", cut.wrap, own.wrap),
        ("texture coordinates", opacity.sampled.varname, base.varname),
    ):
        if one != other:
            note(f"opacity and diffuseColor have different {what}: those of diffuseColor are used for both")
    if cut.file == own.file and (opacity.channel, opacity.gain, opacity.bias) == (_ALPHA, 1.0, 0.0):
        return base, opacity.threshold
    return replace(base, texture=opacity.over(own)), opacity.threshold


def _read_detail(prim: Usd.Prim, note: Warn) -> Detail:
    files = []
    for name in ("falsework:detail:texture", "falsework:detail:macroTexture"):
        attribute = prim.GetAttribute(name)
        value = attribute.Get() if attribute else None
        files.append(asset_file(value))
        if value is not None and value.path and not files[-1]:
            note(f"no texture {value.path} for {name}: left out")
    periods, amplitudes = (
        tuple(float(value) for value in (attribute.Get() if attribute else None) or ())
        for attribute in map(prim.GetAttribute, ("falsework:detail:periods", "falsework:detail:amplitudes"))
    )
    if len(periods) != len(amplitudes):
        note("detail:periods and detail:amplitudes differ in length: fine detail is left out")
    possible = all(0.0 < period < np.inf for period in periods) and np.isfinite(amplitudes).all()
    if not possible:
        note("detail:periods that are not positive, or numbers that are not finite: fine detail is left out")
    if not files[0] or len(periods) != len(amplitudes) or not possible:
        return Detail(macro_file=files[1])
    if len(periods) > MOST_OCTAVES:
        note(f"detail beyond {MOST_OCTAVES} octaves is left out")
    return Detail(files[0], periods[:MOST_OCTAVES], amplitudes[:MOST_OCTAVES], files[1])
