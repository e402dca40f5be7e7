"""Bridge interface: what other programs show before the payloads are loaded, with the looks as a variant set."""

from pxr import Kind, Sdf, UsdGeom, Vt

from authoring.layers.identity import name_asset
from authoring.layers.layer import add_sublayers, new_layer, new_stage
from authoring.layers.parameters import parameter_opinions
from authoring.layers.specs import author
from groundwork.canonical import canonical_json
from usd_schemas.apis import PARAMETERS_API


def bridge_layer(
    family: str, spans: tuple[float, ...], width: float, drawn: dict[str, object], looks: dict[str, str]
) -> Sdf.Layer:
    """Author the interface layer of the bridge: facts, the variant set `look`, and the payload.

    Args:
        family: Bridge family.
        spans: Span lengths along the axis [m].
        width: Deck width [m].
        drawn: Every drawn parameter; as JSON and also as separate typed attributes.
        looks: File of each look, relative to this layer; the first is selected.

    Returns:
        A layer in memory, to be written as `bridge/bridge.usda`.
    """
    stage = new_stage("Bridge")
    prim = UsdGeom.Xform.Define(stage, "/Bridge").GetPrim()
    prim.ApplyAPI("FalseworkBridgeAPI")
    prim.GetAttribute("falsework:bridge:family").Set(family)
    prim.GetAttribute("falsework:bridge:spans").Set(Vt.DoubleArray(spans))
    prim.GetAttribute("falsework:bridge:width").Set(width)
    prim.GetAttribute("falsework:bridge:parameters").Set(canonical_json(drawn))
    prim.ApplyAPI(PARAMETERS_API)
    layer = stage.GetRootLayer()
    del stage, prim
    spec = layer.GetPrimAtPath("/Bridge")
    author(spec, parameter_opinions(drawn))
    name_asset(layer, "/Bridge", f"{family}_bridge", "bridge.usda")
    spec.SetInfo("kind", Kind.Tokens.assembly)
    spec.payloadList.prependedItems = [Sdf.Payload("./payload.usda")]
    spec.variantSetNameList.prependedItems = ["look"]
    spec.variantSelections["look"] = next(iter(looks))
    variants = Sdf.VariantSetSpec(spec, "look")
    for name, file in sorted(looks.items()):
        filled = Sdf.PrimSpec(Sdf.VariantSpec(variants, name).primSpec, "BridgeLooks", Sdf.SpecifierOver)
        filled.referenceList.prependedItems = [Sdf.Reference(file)]
    return layer


def payload_layer() -> Sdf.Layer:
    """Author the layer that joins semantics and geometry under one payload."""
    layer = new_layer("Bridge")
    add_sublayers(layer, ["./semantics.usda", "./geometry.usdc"])
    return layer
