"""Replicator compatibility layer: the labels again, in the older `SemanticsAPI` that preceded LabelsAPI."""

from pxr import Sdf, Usd

from authoring.layers.layer import new_layer
from usd_schemas import tokens
from usd_schemas.apis import direct_label
from usd_schemas.reading.labels import read_taxonomy
from usd_schemas.taxonomies import Taxonomy

_LABELS = "SemanticsLabelsAPI:"


def replicator_layer(stage: Usd.Stage) -> Sdf.Layer:
    """Write every LabelsAPI label of a stage as a label of the older schema.

    The class is written from the active table, because the older schema has no tables. Labels of a background are
    inside its own variant, so that they are only present with it.

    Args:
        stage: Composed stage; its session layer is used and left empty.

    Returns:
        A layer in memory.
    """
    layer = new_layer("World")
    table = read_taxonomy(stage, lambda line: None)
    background = stage.GetPrimAtPath(tokens.BACKGROUND)
    for prim in stage.Traverse():
        if not background or prim == background or not prim.GetPath().HasPrefix(background.GetPath()):
            _copy_labels(prim, layer, prim.GetPath(), table)
    variants = background.GetVariantSet("background") if background else None
    if variants is None:
        return layer
    stage.SetEditTarget(stage.GetSessionLayer())
    for name in sorted(variants.GetVariantNames()):
        variants.SetVariantSelection(name)
        inside = background.GetPath().AppendVariantSelection("background", name)
        for prim in list(Usd.PrimRange(background))[1:]:
            _copy_labels(prim, layer, prim.GetPath().ReplacePrefix(background.GetPath(), inside), table)
    stage.GetSessionLayer().Clear()
    return layer


def _copy_labels(prim: Usd.Prim, layer: Sdf.Layer, path: Sdf.Path, table: Taxonomy) -> None:
    schemas = [name for name in prim.GetAppliedSchemas() if name.startswith(_LABELS)]
    labels = {name.removeprefix(_LABELS): direct_label(prim, name.removeprefix(_LABELS)) for name in schemas}
    labels = {taxonomy: label for taxonomy, label in labels.items() if label}
    if not labels:
        return
    if tokens.CLASS_TAXONOMY in labels:
        component = labels.get(tokens.COMPONENT_TAXONOMY, "")
        labels[tokens.CLASS_TAXONOMY] = table.class_of(component, labels[tokens.CLASS_TAXONOMY])
    spec = Sdf.CreatePrimInLayer(layer, path)
    applied = Sdf.TokenListOp()
    applied.prependedItems = [f"SemanticsAPI:{taxonomy}" for taxonomy in sorted(labels)]
    spec.SetInfo("apiSchemas", applied)
    for taxonomy, label in sorted(labels.items()):
        for name, value in (("semanticType", taxonomy), ("semanticData", label)):
            attribute = Sdf.AttributeSpec(spec, f"semantic:{taxonomy}:params:{name}", Sdf.ValueTypeNames.String)
            attribute.default = value
