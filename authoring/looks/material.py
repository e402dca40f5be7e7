"""One material on a stage: a UsdPreviewSurface network and the detail that it cannot express."""

from dataclasses import dataclass, field

from pxr import Gf, Sdf, Usd, UsdShade, Vt

from authoring.looks.library import SheetFiles
from authoring.looks.roles import sheet_material
from usd_schemas.reading.shader_inputs import GLASS
from usd_schemas.registration import register_schemas

register_schemas()

_TYPES = Sdf.ValueTypeNames
_SOLID = 0.5  # opacity from which on a cut-out surface is visible [1]


@dataclass(frozen=True)
class MaterialRecipe:
    """The parts of one material; files are given relative to the layer that holds it, as `./textures/x.png`.

    Attributes:
        name: Name of the surface, e.g. `board_concrete`.
        albedo_file: Tileable base color, sRGB; empty for none.
        color: Linear base color [1] where there is no `albedo_file`; the mean of the file where there is one.
        roughness_file: Tileable roughness, gray; empty for none.
        roughness: Roughness [1], the mean of the file where there is one.
        normal_file: Tileable tangent-space normals; empty for none.
        metallic: Metallic [1].
        ior: Refractive index [1]: 1 for surfaces without any shine.
        sheet: Length of the sheet's sides along `st` [m].
        detail_file: Tileable gray detail, mean 0.5; empty for none.
        periods: Size of one tile of the detail for each octave [m].
        amplitudes: Contrast of each octave [1].
        macro_file: RGB texture on `st1`, mean 0.5; empty for none.
        cut_out: The opacity of `albedo_file` cuts out the visible part.
        others: Further sheets of the same surface by their number.
    """

    name: str
    albedo_file: str = ""
    color: tuple[float, float, float] = (0.5, 0.5, 0.5)
    roughness_file: str = ""
    roughness: float = 0.7
    normal_file: str = ""
    metallic: float = 0.0
    ior: float = GLASS
    sheet: float = 4.0
    detail_file: str = ""
    periods: tuple[float, ...] = ()
    amplitudes: tuple[float, ...] = ()
    macro_file: str = ""
    cut_out: bool = False
    others: dict[int, SheetFiles] = field(default_factory=dict)


def author_material(stage: Usd.Stage, path: str, recipe: MaterialRecipe) -> UsdShade.Material:
    """Define a material: preview surface, textures looked up at `st` / sheet size, and `FalseworkDetailAPI`.

    Args:
        stage: Stage whose edit target receives it; that layer must lie beside the recipe's `textures` folder.
        path: Path of the material prim.
        recipe: Its parts.
    """
    material = UsdShade.Material.Define(stage, path)
    surface = _shader(material, "Surface", "UsdPreviewSurface")
    surface.CreateInput("metallic", _TYPES.Float).Set(recipe.metallic)
    if recipe.ior != GLASS:
        surface.CreateInput("ior", _TYPES.Float).Set(recipe.ior)
    placed = _placement(material, recipe) if recipe.albedo_file or recipe.roughness_file or recipe.normal_file else None
    color = surface.CreateInput("diffuseColor", _TYPES.Color3f)
    if recipe.albedo_file and placed:
        texture = _texture(material, "BaseColor", recipe.albedo_file, "sRGB", placed)
        texture.CreateInput("fallback", _TYPES.Float4).Set(Gf.Vec4f(*recipe.color, 1.0))
        color.ConnectToSource(texture.CreateOutput("rgb", _TYPES.Float3))
        if recipe.cut_out:
            opacity = surface.CreateInput("opacity", _TYPES.Float)
            opacity.ConnectToSource(texture.CreateOutput("a", _TYPES.Float))
            surface.CreateInput("opacityThreshold", _TYPES.Float).Set(_SOLID)
    else:
        color.Set(Gf.Vec3f(*recipe.color))
    roughness = surface.CreateInput("roughness", _TYPES.Float)
    if recipe.roughness_file and placed:
        texture = _texture(material, "Roughness", recipe.roughness_file, "raw", placed)
        roughness.ConnectToSource(texture.CreateOutput("r", _TYPES.Float))
    else:
        roughness.Set(recipe.roughness)
    if recipe.normal_file and placed:
        texture = _texture(material, "Normal", recipe.normal_file, "raw", placed)
        texture.CreateInput("scale", _TYPES.Float4).Set(Gf.Vec4f(2, 2, 2, 1))
        texture.CreateInput("bias", _TYPES.Float4).Set(Gf.Vec4f(-1, -1, -1, 0))
        normal = surface.CreateInput("normal", _TYPES.Normal3f)
        normal.ConnectToSource(texture.CreateOutput("rgb", _TYPES.Float3))
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", _TYPES.Token))
    _author_detail(material, recipe)
    return material


def author_sheets(stage: Usd.Stage, path: str, recipe: MaterialRecipe) -> None:
    """Define a material for each further sheet: the same as the first one, with other files.

    It specializes the first, so that overrides of a role in a stronger layer apply to all of its sheets.

    Args:
        stage: Stage whose edit target receives it.
        path: Path of the material of the first sheet.
        recipe: Its parts.
    """
    for number, files in sorted(recipe.others.items()):
        place = sheet_material(path, number)
        UsdShade.Material.Define(stage, place).GetPrim().GetSpecializes().AddSpecialize(path)
        color = Gf.Vec4f(*files.color, 1.0)
        for name, file in (("BaseColor", files.albedo), ("Roughness", files.roughness), ("Normal", files.normal)):
            if file:
                prim = stage.OverridePrim(f"{place}/{name}")
                prim.CreateAttribute("inputs:file", _TYPES.Asset).Set(Sdf.AssetPath(file))
        prim = stage.OverridePrim(f"{place}/BaseColor")
        prim.CreateAttribute("inputs:fallback", _TYPES.Float4).Set(color)


def _shader(material: UsdShade.Material, name: str, kind: str) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(material.GetPrim().GetStage(), material.GetPath().AppendChild(name))
    shader.CreateIdAttr(kind)
    return shader


def _placement(material: UsdShade.Material, recipe: MaterialRecipe) -> UsdShade.Output:
    reader = _shader(material, "StReader", "UsdPrimvarReader_float2")
    reader.CreateInput("varname", _TYPES.String).Set("st")
    transform = _shader(material, "StPlacement", "UsdTransform2d")
    source = reader.CreateOutput("result", _TYPES.Float2)
    transform.CreateInput("in", _TYPES.Float2).ConnectToSource(source)
    transform.CreateInput("scale", _TYPES.Float2).Set(Gf.Vec2f(1 / recipe.sheet))
    return transform.CreateOutput("result", _TYPES.Float2)


def _texture(material: UsdShade.Material, name: str, file: str, space: str, placed: UsdShade.Output) -> UsdShade.Shader:
    texture = _shader(material, name, "UsdUVTexture")
    texture.CreateInput("file", _TYPES.Asset).Set(Sdf.AssetPath(file))
    texture.CreateInput("sourceColorSpace", _TYPES.Token).Set(space)
    texture.CreateInput("wrapS", _TYPES.Token).Set("repeat")
    texture.CreateInput("wrapT", _TYPES.Token).Set("repeat")
    texture.CreateInput("st", _TYPES.Float2).ConnectToSource(placed)
    return texture


def _author_detail(material: UsdShade.Material, recipe: MaterialRecipe) -> None:
    if not (recipe.detail_file or recipe.macro_file):
        return
    prim = material.GetPrim()
    prim.ApplyAPI("FalseworkDetailAPI")
    uniform = Sdf.VariabilityUniform
    if recipe.detail_file:
        prim.CreateAttribute("falsework:detail:texture", _TYPES.Asset, False, uniform).Set(
            Sdf.AssetPath(recipe.detail_file)
        )
        prim.CreateAttribute("falsework:detail:periods", _TYPES.FloatArray, False, uniform).Set(
            Vt.FloatArray(recipe.periods)
        )
        prim.CreateAttribute("falsework:detail:amplitudes", _TYPES.FloatArray, False, uniform).Set(
            Vt.FloatArray(recipe.amplitudes)
        )
    if recipe.macro_file:
        prim.CreateAttribute("falsework:detail:macroTexture", _TYPES.Asset, False, uniform).Set(
            Sdf.AssetPath(recipe.macro_file)
        )
