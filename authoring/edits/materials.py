"""Changes of color: surface values and textures of materials, and the material of a mesh."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdShade

from authoring.edits.matching import DATA_NAME
from groundwork.canonical import file_digest
from usd_schemas.reading.materials import asset_file

Place = Callable[[Sdf.Path], Sdf.Path]

TINTED = 1e-4  # [1] a larger difference counts as a change
_SURFACE = "UsdPreviewSurface"
_DEFAULTS: dict[str, float | tuple[float, ...]] = {
    "diffuseColor": (0.18, 0.18, 0.18),
    "emissiveColor": (0.0, 0.0, 0.0),
    "metallic": 0.0,
    "roughness": 0.5,
    "opacity": 1.0,
    "normal": (0.0, 0.0, 1.0),
}
_TYPES = {
    "diffuseColor": Sdf.ValueTypeNames.Color3f,
    "emissiveColor": Sdf.ValueTypeNames.Color3f,
    "normal": Sdf.ValueTypeNames.Normal3f,
}


@dataclass(frozen=True)
class Feed:
    """Value or texture of an input of a surface.

    Attributes:
        value: Its constant value [1].
        file: Its texture; empty for none.
        shader: Path of the shader that reads the texture.
    """

    value: tuple[float, ...] = ()
    file: str = ""
    shader: Sdf.Path = Sdf.Path.emptyPath


class Textures:
    """The textures of a scene by file name: programs that collect them in one folder confuse equal names."""

    def __init__(self, folder: Path) -> None:
        """Collect names only; files are read when they are used.

        Args:
            folder: Scene folder.
        """
        self._files: dict[str, list[Path]] = {}
        for path in sorted(folder.rglob("*")):
            if path.suffix.lower() in (".png", ".jpg", ".jpeg", ".exr", ".tif", ".tiff", ".tga", ".hdr"):
                self._files.setdefault(path.name, []).append(path)

    def knows(self, file: str, named: str) -> bool:
        """Check whether a file is a texture of the scene, under its own name or that of the one it would replace.

        Args:
            file: Texture of the edited stage.
            named: Texture of the scene.
        """
        digest = file_digest(Path(file))
        if named and digest == file_digest(Path(named)):
            return True
        same = Path(file).name == Path(named).name
        return same and any(digest == file_digest(path) for path in self._files.get(Path(file).name, []))


def materials_by_name(stage: Usd.Stage) -> dict[str, UsdShade.Material]:
    """List the materials of a stage by the name that other programs show.

    Args:
        stage: Any stage.
    """
    found = {}
    for prim in stage.Traverse():
        if prim.IsA(UsdShade.Material):
            found.setdefault(name_of(UsdShade.Material(prim)), UsdShade.Material(prim))
    return found


def bound_name(prim: Usd.Prim) -> str:
    """Find the name of the material bound to a prim.

    Args:
        prim: A Gprim.

    Returns:
        The name, or an empty string.
    """
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    return name_of(material) if material else ""


def name_of(material: UsdShade.Material) -> str:
    """Find the name of a material in other programs.

    Args:
        material: Material of any stage.
    """
    return str(material.GetPrim().GetAttribute(DATA_NAME).Get() or material.GetPrim().GetName())


def taken_inputs() -> frozenset[str]:
    """List the inputs of a surface that are compared."""
    return frozenset(f"inputs:{name}" for name in _DEFAULTS)


def changed_inputs(before: UsdShade.Material, after: UsdShade.Material, textures: Textures) -> dict[str, Feed]:
    """Find the surface inputs with another value or texture.

    Args:
        before: Material of the scene.
        after: The same material of the edited stage.
        textures: Textures of the scene.
    """
    ours, theirs = _surface(before), _surface(after)
    if ours is None or theirs is None:
        return {}
    changed = {}
    for name in _DEFAULTS:
        old, new = _feed(ours, name), _feed(theirs, name)
        if new.file:
            same = bool(old.file) and textures.knows(new.file, old.file)
        else:
            same = not old.file and all(abs(a - b) <= TINTED for a, b in zip(old.value, new.value, strict=True))
        if not same and (new.file or name != "normal"):
            changed[name] = new
    return changed


def write_inputs(
    layer: Sdf.Layer, place: Place, material: UsdShade.Material, changed: dict[str, Feed]
) -> dict[str, str]:
    """Author changed surface inputs over a material.

    Args:
        layer: Layer to write into.
        place: Path in the layer at which a prim of the scene is written.
        material: Material of the scene.
        changed: New feed of each changed input.

    Returns:
        Destination below the layer's folder to source of each texture to copy.
    """
    surface = _surface(material)
    assert surface is not None
    copies: dict[str, str] = {}
    for name, feed in changed.items():
        spec = Sdf.CreatePrimInLayer(layer, place(surface.GetPath()))
        if not feed.file:
            attribute = _input(spec, name)
            attribute.connectionPathList.ClearEditsAndMakeExplicit()  # an explicit empty list disconnects the texture
            attribute.default = feed.value[0] if len(feed.value) == 1 else Gf.Vec3f(*feed.value)
            continue
        target = f"textures/{material.GetPrim().GetName()}_{name}{Path(feed.file).suffix.lower()}"
        copies[target] = feed.file
        old = _feed(surface, name)
        if old.file:
            reader = Sdf.CreatePrimInLayer(layer, place(old.shader))
        else:
            reader = _new_reader(layer, place, material, name, spec)
        file = Sdf.AttributeSpec(reader, "inputs:file", Sdf.ValueTypeNames.Asset)
        file.default = Sdf.AssetPath(f"./{target}")
    return copies


def _new_reader(
    layer: Sdf.Layer, place: Place, material: UsdShade.Material, name: str, surface: Sdf.PrimSpec
) -> Sdf.PrimSpec:
    """Define a texture, read at `st`, for an input that had a constant."""
    color = name in ("diffuseColor", "emissiveColor")
    path = place(material.GetPath().AppendChild(f"Edited_{name}"))
    coordinates = _shader(layer, place(material.GetPath().AppendChild("Edited_St")), "UsdPrimvarReader_float2")
    varname = Sdf.AttributeSpec(coordinates, "inputs:varname", Sdf.ValueTypeNames.String)
    varname.default = "st"
    Sdf.AttributeSpec(coordinates, "outputs:result", Sdf.ValueTypeNames.Float2)
    reader = _shader(layer, path, "UsdUVTexture")
    Sdf.AttributeSpec(reader, "inputs:sourceColorSpace", Sdf.ValueTypeNames.Token).default = "sRGB" if color else "raw"
    for axis in ("wrapS", "wrapT"):
        Sdf.AttributeSpec(reader, f"inputs:{axis}", Sdf.ValueTypeNames.Token).default = "repeat"
    st = Sdf.AttributeSpec(reader, "inputs:st", Sdf.ValueTypeNames.Float2)
    st.connectionPathList.explicitItems = [_composed(coordinates.path.AppendProperty("outputs:result"))]
    output = "outputs:rgb" if color or name == "normal" else "outputs:r"
    kind = Sdf.ValueTypeNames.Float3 if output == "outputs:rgb" else Sdf.ValueTypeNames.Float
    Sdf.AttributeSpec(reader, output, kind)
    _input(surface, name).connectionPathList.explicitItems = [_composed(path.AppendProperty(output))]
    return reader


def _composed(path: Sdf.Path) -> Sdf.Path:
    # Targets of connections are composed prims, never prims inside a variant.
    return path.StripAllVariantSelections()


def _shader(layer: Sdf.Layer, path: Sdf.Path, kind: str) -> Sdf.PrimSpec:
    spec = Sdf.CreatePrimInLayer(layer, path)
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Shader"
    if "info:id" not in spec.attributes:
        Sdf.AttributeSpec(spec, "info:id", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform).default = kind
    return spec


def _input(spec: Sdf.PrimSpec, name: str) -> Sdf.AttributeSpec:
    return Sdf.AttributeSpec(spec, f"inputs:{name}", _TYPES.get(name, Sdf.ValueTypeNames.Float))


def _surface(material: UsdShade.Material) -> UsdShade.Shader | None:
    surface, _, _ = material.ComputeSurfaceSource()
    return surface if surface and surface.GetShaderId() == _SURFACE else None


def _feed(surface: UsdShade.Shader, name: str) -> Feed:
    source = surface.GetInput(name)
    attributes = source.GetValueProducingAttributes() if source else []
    if attributes and UsdShade.Output.IsOutput(attributes[0]):
        shader = UsdShade.Shader(attributes[0].GetPrim())
        file = shader.GetInput("file")
        found = asset_file(file.Get()) if file else ""
        return Feed(_plain(_DEFAULTS[name]), found, shader.GetPath())
    value = attributes[0].Get() if attributes else None
    return Feed(_plain(_DEFAULTS[name] if value is None else value))


def _plain(value: object) -> tuple[float, ...]:
    return (float(value),) if isinstance(value, int | float) else tuple(float(part) for part in value)  # type: ignore[union-attr]
