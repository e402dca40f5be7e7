"""When a stage is read, and which of its prims count."""

from collections.abc import Iterator

from pxr import Usd, UsdGeom

# The first sample where there are samples, else the default: what a still picture of the stage shows.
EARLIEST = Usd.TimeCode.EarliestTime()

COMPOSED = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


def composed_prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Walk every active, defined, loaded prim, those inside instances too, but not the prototypes of instancers.

    Args:
        stage: Composed stage.
    """
    prims = iter(Usd.PrimRange.Stage(stage, COMPOSED))
    for prim in prims:
        yield prim
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
