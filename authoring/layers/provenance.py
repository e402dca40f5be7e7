"""Author and inputs of an asset: `UsdMedia.AuthorshipAPI` on its root prim."""

from importlib.metadata import PackageNotFoundError, version

from pxr import Sdf, Vt

INSTANCE = "generator"
PACKAGE = "falsework"
SOURCE_TYPE = "algorithmicMedia"  # IPTC: made by an algorithm, not from sampled media


def author_provenance(layer: Sdf.Layer, prim: str, inputs: dict[str, str], *, is_ours: bool = True) -> Sdf.Layer:
    """Record on a root prim that Falsework wrote it; without time and host, which would differ in a second run.

    The attributes are written directly, so that a USD older than the schema keeps them.

    Args:
        layer: Layer in memory that holds the prim.
        prim: Path of the root prim.
        inputs: Its inputs: seed, hash of the settings, name of a file.
        is_ours: Falsework generated the content; for imported content no author is stated.

    Returns:
        The same layer.
    """
    spec = layer.GetPrimAtPath(prim)
    schemas = spec.GetInfo("apiSchemas") if spec.HasInfo("apiSchemas") else Sdf.TokenListOp()
    schemas.prependedItems = [*schemas.prependedItems, f"AuthorshipAPI:{INSTANCE}"]
    spec.SetInfo("apiSchemas", schemas)
    pairs = [text for pair in sorted(inputs.items()) for text in pair]
    values = [
        ("softwarePackage", Sdf.ValueTypeNames.String, PACKAGE),
        ("softwareVersion", Sdf.ValueTypeNames.String, software_version()),
        ("inputs", Sdf.ValueTypeNames.StringArray, Vt.StringArray(pairs)),
    ]
    if is_ours:
        values.insert(2, ("digitalSourceType", Sdf.ValueTypeNames.String, SOURCE_TYPE))
    for name, kind, value in values:
        attribute = Sdf.AttributeSpec(spec, f"authorship:{INSTANCE}:{name}", kind, Sdf.VariabilityUniform)
        attribute.default = value
    return layer


def software_version() -> str:
    """Return the version of Falsework, or `unknown` where it is not installed."""
    try:
        return version(PACKAGE)
    except PackageNotFoundError:
        return "unknown"
