"""Baking of skinned meshes to time-sampled points, in memory; the files do not change."""

from pxr import Gf, Usd, UsdSkel

from usd_schemas.reading.labels import Warn
from usd_schemas.reading.traversal import COMPOSED, MISTYPED


def bake_skins(stage: Usd.Stage, warn: Warn) -> None:
    """Bake every skinned mesh of a stage, at all times at which its skeleton is animated.

    The result is written to the session layer. Instances that contain a skeleton become separate prims there.

    Args:
        stage: Composed stage; its edit target becomes the session layer.
        warn: Called with one line for each skeleton that cannot be baked.
    """
    roots = [prim for prim in Usd.PrimRange.Stage(stage, COMPOSED) if prim.IsA(UsdSkel.Root)]
    if not roots:
        return
    stage.SetEditTarget(stage.GetSessionLayer())
    _free_instances(stage, roots)
    for root in [prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Root)]:
        path = root.GetPath()
        try:
            baked = UsdSkel.BakeSkinning(UsdSkel.Root(root), Gf.Interval.GetFullInterval())
        except MISTYPED:
            baked = False
        if not baked:
            warn(f"{path}: its skeleton cannot be read: its meshes are drawn undeformed")


def _free_instances(stage: Usd.Stage, roots: list[Usd.Prim]) -> None:
    """Make instances that share a prototype with a skeleton into separate prims."""
    for root in roots:
        while root.IsInstanceProxy():
            holder = root
            while holder.IsInstanceProxy():
                holder = holder.GetParent()
            holder.SetInstanceable(False)
            root = stage.GetPrimAtPath(root.GetPath())
        if root.IsInstance():
            root.SetInstanceable(False)
