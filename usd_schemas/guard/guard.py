"""Checks of an untrusted stage before it is composed: the files that it reads, and its size."""

import resource
from pathlib import Path

from pxr import Usd, UsdGeom, UsdUtils

from groundwork.errors import InputError, MissingError
from usd_schemas.guard.composed_size import ComposedSize
from usd_schemas.guard.layer_walk import Bounds, Warn, walk_layers
from usd_schemas.reading.traversal import EARLIEST
from usd_schemas.registration import register_schemas

register_schemas()

MOST_PRIMS = 1_000_000  # a bridge has some thousands; reading takes about 0.1 ms a prim
MOST_INSTANCES = 10_000_000  # of PointInstancers
MOST_BYTES = 4_000_000_000  # of layer files


def check_stage(path: Path, allow_roots: tuple[Path, ...], warn: Warn, most_prims: int = MOST_PRIMS) -> None:
    """Check an untrusted stage before it is composed.

    Call it in a child process with limits: even reading a layer may exceed the memory.

    Args:
        path: USD file.
        allow_roots: Further folders from which the stage may load files.
        warn: Called with one line for each unusual but allowed feature.
        most_prims: Largest number of composed prims.

    Raises:
        MissingError: There is no such file.
        InputError: It uses files outside the allowed folders, is not readable, has circular references, or is too
            large.
    """
    if not path.is_file():
        raise MissingError("no such file", where=path, hint="Name a .usda, .usdc, .usd or .usdz file")
    file = path.resolve()
    bounds = Bounds(file.parent, (file.parent, *(root.resolve() for root in allow_roots)))
    quiet = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        layers = walk_layers(file, bounds, warn)
        size = sum(layer.stat().st_size for layer in layers)
        if size > MOST_BYTES:
            raise InputError(
                f"its layers hold {size / 1e9:.1f} GB", where=path, allowed=f"up to {MOST_BYTES / 1e9:.0f} GB"
            )
        if file.suffix != ".usdz":
            ComposedSize(bounds, most_prims, warn).count(file)
        _check_composed(Usd.Stage.Open(str(file)), most_prims, warn)
    except RecursionError:
        raise InputError("prims or references are nested too deeply", where=path, hint="Flatten the stage") from None
    finally:
        del quiet


def limit_memory(gigabytes: float) -> None:
    """Limit the memory of this process, so that one huge array fails at once.

    Args:
        gigabytes: Address space [GB].
    """
    most = int(gigabytes * 1e9)
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _check_composed(stage: Usd.Stage, most_prims: int, warn: Warn) -> None:
    """Report prims of unknown type or selected variant; prims of packages are counted only here."""
    instances = 0
    for number, prim in enumerate(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())):
        if number >= most_prims:
            raise InputError(f"composes to more than {most_prims} prims", where=prim.GetPath())
        if prim.IsA(UsdGeom.PointInstancer):
            instances += len(UsdGeom.PointInstancer(prim).GetProtoIndicesAttr().Get(EARLIEST) or ())
            if instances > MOST_INSTANCES:
                raise InputError(f"draws more than {MOST_INSTANCES} instances", where=prim.GetPath())
        kind = prim.GetTypeName()
        if kind and Usd.SchemaRegistry.GetTypeFromSchemaTypeName(kind).isUnknown:
            warn(
                f"{prim.GetPath()}: type {kind} needs a schema plugin that is not installed: it is not drawn, and its "
                f"transform is not applied to the prims below it"
            )
        sets = prim.GetVariantSets()
        for name in sets.GetNames():
            chosen = sets.GetVariantSelection(name)
            if chosen and chosen not in (known := sets.GetVariantSet(name).GetVariantNames()):
                warn(
                    f"{prim.GetPath()}: variant set {name} has no variant {chosen!r}; it has {', '.join(sorted(known))}"
                )
