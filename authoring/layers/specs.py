"""Prims and attributes written directly into a layer: for many prims, because a stage recomposes after each step."""

from collections.abc import Iterable
from functools import lru_cache

from pxr import Sdf

from usd_schemas.apis import Opinion


def prim_spec(layer: Sdf.Layer, path: str, kind: str = "") -> Sdf.PrimSpec:
    """Write a prim; missing parents are created as overrides.

    Args:
        layer: Layer in memory.
        path: Path of the prim.
        kind: Its type; an empty one makes an override.
    """
    spec = Sdf.CreatePrimInLayer(layer, path)
    if kind:
        spec.specifier, spec.typeName = Sdf.SpecifierDef, kind
    return spec


def apply_schemas(prim: Sdf.PrimSpec, names: Iterable[str]) -> None:
    """Apply API schemas to a prim that has none yet.

    Args:
        prim: Prim in a layer.
        names: Schemas, each with its instance name if it has one.
    """
    prim.SetInfo("apiSchemas", _applied(tuple(names)))


@lru_cache(maxsize=64)
def _applied(names: tuple[str, ...]) -> Sdf.TokenListOp:
    applied = Sdf.TokenListOp()
    applied.prependedItems = list(names)
    return applied


def attribute(
    prim: Sdf.PrimSpec,
    name: str,
    kind: Sdf.ValueTypeName,
    value: object,
    *,
    custom: bool = False,
    uniform: bool = False,
) -> Sdf.AttributeSpec:
    """Write an attribute that does not change with time.

    Args:
        prim: Prim in a layer.
        name: Name of an attribute that it does not have yet.
        kind: Type of its value.
        value: Its value.
        custom: Whether no schema declares it.
        uniform: Whether it must not change with time.
    """
    variability = Sdf.VariabilityUniform if uniform else Sdf.VariabilityVarying
    spec = Sdf.AttributeSpec(prim, name, kind, variability, custom)
    spec.default = value
    return spec


def author(prim: Sdf.PrimSpec, opinions: Iterable[Opinion]) -> None:
    """Write the value that a schema's accessor gives.

    Args:
        prim: Prim in a layer.
        opinions: From `usd_schemas.apis`.
    """
    for opinion in opinions:
        attribute(prim, opinion.name, opinion.kind, opinion.value, custom=opinion.custom, uniform=opinion.uniform)
