"""Moved prims: transforms that differ by more than errors of single precision."""

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdLux

from authoring.edits.matching import is_visible
from usd_schemas.reading.stage_reader import stage_to_world

F64 = NDArray[np.float64]

MOVED = 1e-4  # [m] the error of single precision is 1e-5 m at 1 km
TURNED = 1e-5  # [1] entries of the linear part
_DECIMALS = 6  # results are rounded to a micrometer


def moved_prims(scene: Usd.Stage, edited: Usd.Stage, pairs: dict[Sdf.Path, Usd.Prim]) -> dict[Sdf.Path, F64]:
    """Find the prims with another transform.

    The children of a moved group move with it, and do not count as moved themselves.

    Args:
        scene: The scene.
        edited: The same stage as exported by another program, in any unit and up axis.
        pairs: Path in the scene to the prim of the edited stage.

    Returns:
        New local transform of each moved prim, in the scene's units [stage units], shape (4, 4), float64, for column
        vectors.
    """
    ours, theirs = UsdGeom.XformCache(), UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    to_scene = np.linalg.inv(stage_to_world(scene)) @ stage_to_world(edited)
    worlds: dict[Sdf.Path, F64] = {Sdf.Path.absoluteRootPath: np.eye(4)}
    moved: dict[Sdf.Path, F64] = {}
    for prim in scene.Traverse():
        path, above = prim.GetPath(), worlds[prim.GetPath().GetParentPath()]
        before = np.array(ours.GetLocalTransformation(prim)[0]).T if prim.IsA(UsdGeom.Xformable) else np.eye(4)
        worlds[path] = above @ before
        if path not in pairs or not _movable(prim):
            continue
        world = to_scene @ np.array(theirs.GetLocalToWorldTransform(pairs[path])).T
        after = np.linalg.inv(above) @ world
        if differs(before, after):
            moved[path] = _snapped(before, after)
            worlds[path] = above @ moved[path]
    return moved


def differs(before: F64, after: F64) -> bool:
    """Check whether two transforms differ by more than the errors of an export and import.

    Args:
        before: Transform [stage units], shape (4, 4), float64.
        after: Transform [stage units], shape (4, 4), float64.
    """
    apart = np.abs(after - before)
    return bool(apart[:3, 3].max() > MOVED or apart[:3, :3].max() > TURNED)


def write_transform(layer: Sdf.Layer, path: Sdf.Path, prim: Usd.Prim, transform: F64) -> None:
    """Author a local transform: only the translation if it has nothing else.

    Args:
        layer: Layer to write into.
        path: Path in the layer.
        prim: The prim of the scene.
        transform: Local transform for column vectors [stage units], shape (4, 4), float64.
    """
    spec = Sdf.CreatePrimInLayer(layer, path)
    order = [str(name) for name in prim.GetAttribute("xformOpOrder").Get() or ()]
    before = np.array(UsdGeom.Xformable(prim).GetLocalTransformation()).T
    if order[:1] == ["xformOp:translate"] and np.array_equal(transform[:3, :3], before[:3, :3]):
        shift = Sdf.AttributeSpec(spec, "xformOp:translate", Sdf.ValueTypeNames.Double3)
        shift.default = tuple(transform[:3, 3].tolist())
        return
    matrix = Sdf.AttributeSpec(spec, "xformOp:transform", Sdf.ValueTypeNames.Matrix4d)
    matrix.default = matrix.typeName.type.pythonClass(*transform.T.ravel().tolist())
    written = Sdf.AttributeSpec(spec, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
    written.default = ["xformOp:transform"]


def hidden_prims(scene: Usd.Stage, pairs: dict[Sdf.Path, Usd.Prim]) -> dict[Sdf.Path, bool]:
    """Find the prims that were hidden or shown; children of a hidden group do not count as hidden.

    Args:
        scene: The scene.
        pairs: Path in the scene to the exported prim.

    Returns:
        Whether each such prim is visible now.
    """
    changed: dict[Sdf.Path, bool] = {}
    for path, prim in sorted(pairs.items()):
        ours, theirs = (is_visible(one) for one in (scene.GetPrimAtPath(path), prim))
        if ours != theirs and not any(above in changed for above in path.GetPrefixes()[:-1]):
            changed[path] = theirs
    return changed


def write_visibility(layer: Sdf.Layer, path: Sdf.Path, visible: bool) -> None:
    """Author the visibility of a prim.

    Args:
        layer: Layer to write into.
        path: Path in the layer.
        visible: Whether it is visible.
    """
    spec = Sdf.CreatePrimInLayer(layer, path)
    attribute = Sdf.AttributeSpec(spec, "visibility", Sdf.ValueTypeNames.Token)
    attribute.default = UsdGeom.Tokens.inherited if visible else UsdGeom.Tokens.invisible


def _movable(prim: Usd.Prim) -> bool:
    # Surveys are time-sampled and lights have a direction only: they are handled by other modules.
    if prim.IsA(UsdGeom.Camera) or prim.HasAPI(UsdLux.LightAPI) or prim.IsA(UsdGeom.PointInstancer):
        return False
    return prim.IsA(UsdGeom.Xformable)


def _snapped(before: F64, after: F64) -> F64:
    """Keep the exact old value of every entry that did not change, and round the others."""
    limit = np.full((4, 4), TURNED)
    limit[:3, 3] = MOVED
    return np.where(np.abs(after - before) <= limit, before, np.round(after, _DECIMALS))
