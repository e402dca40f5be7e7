"""Names the shared prototypes of native instances, in a fixed order."""

from pxr import Sdf

_FLATTENED, _SHARED = "Flattened_Prototype_", "Prototype_"  # their names in USD, and ours


def name_prototypes(layer: Sdf.Layer) -> None:
    """Number the prototypes of native instances in the order of the namespace: USD's order depends on its threads.

    Args:
        layer: A flattened stage.
    """
    roots = {prim.path: prim for prim in layer.rootPrims if prim.name.startswith(_FLATTENED)}
    order: dict[Sdf.Path, Sdf.Path] = {}
    holders: list[tuple[Sdf.PrimSpec, Sdf.Reference]] = []
    waiting = [prim for prim in layer.rootPrims if prim.path not in roots]
    while waiting:
        prim = waiting.pop(0)
        shared = [one for one in prim.referenceList.GetAppliedItems() if one.primPath in roots]
        for one in shared:
            holders.append((prim, one))
            if one.primPath not in order:
                order[one.primPath] = Sdf.Path(f"/{_SHARED}{len(order) + 1:04d}")
                waiting.append(roots[one.primPath])
        waiting[:0] = list(prim.nameChildren)
    for prim, one in holders:
        prim.referenceList.ReplaceItemEdits(one, Sdf.Reference(primPath=order[one.primPath]))
    for old, new in order.items():
        Sdf.CopySpec(layer, old, layer, new)
    for path in roots:
        del layer.rootPrims[path.name]
