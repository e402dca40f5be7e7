"""Corrections of omissions and deviations in imported files, where the meaning is clear."""

from collections.abc import Iterator

from pxr import Kind, Sdf, Sdr, Usd, UsdGeom, UsdLux, UsdShade

_TEXTS = {Sdf.ValueTypeNames.Token, Sdf.ValueTypeNames.String}


def correct(layer: Sdf.Layer) -> None:
    """Correct a flattened layer in place; its appearance is unchanged.

    - Kinds: a background is a component, so that models in it become subcomponents, and groups get no kind.
    - Extents: missing ones are computed from points or dimensions.
    - Bindings: bound prims get the API schema of the binding; a binding to nothing is removed.
    - Types: an input of a shader with a value of the right type in another role (`float3` for `color3f`) is converted.

    Args:
        layer: Flattened layer in memory, its root prim a component.
    """
    stage = Usd.Stage.Open(layer, Usd.Stage.LoadAll)
    for prim in _prims(stage):
        _correct_kind(prim)
        _correct_extent(prim)
        _correct_binding(prim)
        if prim.IsA(UsdShade.Shader):
            _correct_types(UsdShade.Shader(prim))


def _prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Visit every prim that the layer defines, including prototypes; parents before children."""
    yield from Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate)


def _correct_kind(prim: Usd.Prim) -> None:
    kind, model = Usd.ModelAPI(prim).GetKind(), Kind.Registry
    if not kind or prim.GetPath().IsRootPrimPath() or not model.IsA(kind, Kind.Tokens.model):
        return
    if model.IsA(kind, Kind.Tokens.component):
        Usd.ModelAPI(prim).SetKind(Kind.Tokens.subcomponent)
    else:
        prim.ClearMetadata("kind")


def _correct_extent(prim: Usd.Prim) -> None:
    body = UsdGeom.Boundable(prim)
    if not body or prim.HasAPI(UsdLux.LightAPI) or body.GetExtentAttr().HasAuthoredValue():
        return
    points = prim.GetAttribute("points")
    codes = points.GetTimeSamples() if points else []
    for code in codes or [Usd.TimeCode.Default()]:
        extent = UsdGeom.Boundable.ComputeExtentFromPlugins(body, Usd.TimeCode(code))
        if extent:
            body.CreateExtentAttr().Set(extent, code)


def _correct_binding(prim: Usd.Prim) -> None:
    word = UsdShade.Tokens.materialBinding
    for binding in (one for one in prim.GetAuthoredRelationships() if one.GetName().startswith(word)):
        if not binding.GetTargets():
            prim.RemoveProperty(binding.GetName())
        elif not prim.HasAPI(UsdShade.MaterialBindingAPI):
            UsdShade.MaterialBindingAPI.Apply(prim)


def _correct_types(shader: UsdShade.Shader) -> None:
    node = Sdr.Registry().GetShaderNodeByIdentifier(shader.GetShaderId() or "")
    for name in node.GetShaderInputNames() if node else ():
        attribute = shader.GetPrim().GetAttribute(f"inputs:{name}")
        asked = node.GetShaderInput(name).GetTypeAsSdfType().GetSdfType()
        if not attribute or not asked or attribute.GetTypeName() == asked:
            continue
        if attribute.GetTypeName().type == asked.type:
            attribute.SetTypeName(asked)
        elif attribute.HasAuthoredConnections():  # its own value is not used
            attribute.Clear()
            attribute.SetTypeName(asked)
        elif {attribute.GetTypeName(), asked} == _TEXTS:
            text = attribute.Get()
            attribute.SetTypeName(asked)
            attribute.Set(text or "")
