"""Simple surfaces of other programs as flat materials: OmniPBR, and MaterialX's standard_surface.

Each input may be a constant or one texture. What a flat material cannot hold is left out with a warning.
"""

from collections.abc import Callable
from dataclasses import replace

from pxr import UsdShade

from usd_schemas.flat_scene import Material, Texture
from usd_schemas.reading.labels import Warn
from usd_schemas.reading.shader_inputs import Source, asset_file, channel_of, find_source, number_of, pair_of, triple_of

Flat = tuple[Material, tuple[str, str]]
Triple = tuple[float, float, float]

_WHITE: Triple = (1.0, 1.0, 1.0)
_STANDARD = "ND_standard_surface_surfaceshader"
_IMAGES = ("ND_image_", "ND_tiledimage_")
_PASSED = ("ND_normalmap", "ND_convert_", "ND_extract_", "ND_separate")  # nodes that hand their one texture on
_STANDARD_MAPS = ("base_color", "specular_roughness", "metalness", "normal")
_ORM_ROUGHNESS, _ORM_METALLIC = 1, 2  # channels of a picture of occlusion, roughness and metallic
_ALPHA = 3
_LINEAR_SPACES = ("raw", "lin_rec709", "lin_rec709_scene", "linear", "none", "data")


def read_foreign_material(material: UsdShade.Material, warn: Warn) -> Flat | None:
    """Read an OmniPBR or standard_surface material.

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
        if shader and shader.GetShaderId() == _STANDARD:
            return _read_standard(path, shader, note)
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
            note(f"{name} of OmniPBR is fed by {found.shader.GetShaderId() or 'an unknown node'}, which is not read")
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

    packed = bool(source("enable_ORM_texture").value)  # one picture of occlusion, roughness and metallic

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
    glow = number_of(source("emissive_intensity"), 40.0) if source("enable_emission").value else 0.0
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
        emissive=_times(triple_of(source("emissive_color"), (1.0, 0.1, 0.1)), (glow, glow, glow)),
    )


def _read_standard(path: str, shader: UsdShade.Shader, note: Callable[[str], None]) -> Flat:
    def source(name: str) -> Source:
        return find_source(shader, name)

    names: dict[str, str] = {}

    def texture(name: str, is_color: bool) -> Texture | None:
        found = _image(source(name), is_color, name, note)
        if found is None:
            return None
        names[name] = found[1]
        return found[0]

    weight = number_of(source("base"), 1.0)
    maps = {name: texture(name, name == "base_color") for name in _STANDARD_MAPS}
    for name in ("emission_color", "opacity", "transmission"):
        if source(name).shader:
            note(f"a texture of {name} is left out")
    if number_of(source("transmission"), 0.0) > 0.0 or min(triple_of(source("opacity"), _WHITE)) < 1.0:
        note("is transparent: drawn opaque")
    glow = number_of(source("emission"), 0.0)
    used = [name for name in dict.fromkeys(names.values()) if name]
    second = used[1] if len(used) > 1 else ""
    base, rough, metal, normal = (
        one and replace(one, uv_set=int(names[name] == second != "")) for name, one in maps.items()
    )
    return Material(
        name=path,
        base_color=_times(triple_of(source("base_color"), (0.8, 0.8, 0.8)), (weight, weight, weight)),
        base_texture=base and replace(base, gain=(weight, weight, weight)),
        roughness=number_of(source("specular_roughness"), 0.2),
        roughness_texture=rough,
        metallic=number_of(source("metalness"), 0.0),
        metallic_texture=metal,
        normal_texture=normal,
        emissive=_times(triple_of(source("emission_color"), _WHITE), (glow, glow, glow)),
    ), (used[0] if used else "", second)


def _image(source: Source, is_color: bool, name: str, note: Callable[[str], None]) -> tuple[Texture, str] | None:
    """Find the one texture that feeds an input, and the primvar that places it."""
    shader, channel = source.shader, channel_of(source.output) or 0
    while shader is not None and (shader.GetShaderId() or "").startswith(_PASSED):
        if (shader.GetShaderId() or "").startswith("ND_extract_"):
            channel = int(number_of(find_source(shader, "index"), 0.0))
        inner = find_source(shader, "in")
        shader, channel = inner.shader, channel or channel_of(inner.output) or 0
    if shader is None:
        return None
    kind = shader.GetShaderId() or "an unknown node"
    if not kind.startswith(_IMAGES) or not 0 <= channel <= _ALPHA:
        note(f"{name} is fed by {kind}, which is not read")
        return None
    told = find_source(shader, "file")
    file = asset_file(told.value)
    if not file:
        note(f"no texture for {name}: drawn plain")
        return None
    space = told.color_space.lower()
    tiling = pair_of(find_source(shader, "uvtiling"), (1.0, 1.0))
    offset = pair_of(find_source(shader, "uvoffset"), (0.0, 0.0))
    placed = find_source(shader, "texcoord").shader
    varname = str(find_source(placed, "geomprop").value or "") if placed else ""
    srgb = is_color and space not in _LINEAR_SPACES
    return Texture(file, srgb, tiling, 0.0, offset, channel=0 if is_color else channel), varname


def _times(one: Triple, other: Triple) -> Triple:
    return one[0] * other[0], one[1] * other[1], one[2] * other[2]
