"""Matching of prims of an edited stage and of the scene: by stable id, independent of paths and names."""

from collections.abc import Iterator
from dataclasses import dataclass

from pxr import Sdf, Usd, UsdGeom, UsdLux

from authoring.edits.shapes import is_body
from usd_schemas import tokens

DCC_ROOT = "root"  # Blender's exporter puts everything under a prim of this name
OBJECT_NAME = "userProperties:blender:object_name"
DATA_NAME = "userProperties:blender:data_name"


@dataclass(frozen=True)
class Matches:
    """The prims that an edited stage and a scene have in common.

    Attributes:
        pairs: Path in the scene to the prim of the edited stage.
        missing: Visible prims of the scene that the edited stage lacks, sorted; programs may import only these.
        added: Bodies of the edited stage that the scene lacks, those inside instances too, by name, sorted.
    """

    pairs: dict[Sdf.Path, Usd.Prim]
    missing: tuple[Sdf.Path, ...]
    added: dict[str, Usd.Prim]


def match_stages(scene: Usd.Stage, edited: Usd.Stage) -> Matches:
    """Match two stages by `userProperties:falseworkId`.

    Copies have the id of their original: the prim that kept the name is the original, others are new.
    A mesh that lost its id, as Blender's modifiers and triangulation make it, is matched by its object's name.
    Prims inside instancers and instances are skipped, because other programs export them as copies; only a copy of a
    whole native instance is new.

    Args:
        scene: The scene without earlier edits.
        edited: The same stage as exported by another program.
    """
    ours = {identity: prim.GetPath() for prim in _scene_prims(scene) if (identity := stable_id(prim))}
    candidates: dict[str, list[Usd.Prim]] = {}
    for prim in edited.Traverse():
        if (identity := stable_id(prim)) in ours:
            candidates.setdefault(identity, []).append(prim)
    pairs = {}
    for identity, found in candidates.items():
        home = ours[identity]
        pairs[home] = min(found, key=lambda prim: (object_name(prim) != home.name, str(prim.GetPath())))
    lost = [path for path in ours.values() if path not in pairs and _is_thing(scene.GetPrimAtPath(path))]
    pairs |= _by_name(lost, edited)
    missing = [path for path in lost if path not in pairs and is_visible(scene.GetPrimAtPath(path))]
    return Matches(pairs, tuple(sorted(missing)), dict(_added(scene, edited, pairs)))


def expand_instances(stage: Usd.Stage) -> None:
    """Replace every native instance of a stage by separate prims, only in the session layer.

    Args:
        stage: An edited stage.
    """
    stage.SetEditTarget(stage.GetSessionLayer())
    while instances := [prim for prim in stage.Traverse() if prim.IsInstance()]:
        for prim in instances:
            prim.SetInstanceable(False)


def stable_id(prim: Usd.Prim) -> str:
    """Read the id that other programs preserve.

    Args:
        prim: Any prim.

    Returns:
        The id, or an empty string.
    """
    value = prim.GetAttribute(tokens.USER_FALSEWORK_ID).Get()
    return value if isinstance(value, str) else ""


def object_name(prim: Usd.Prim) -> str:
    """Find the name of a prim in other programs: Blender nests `X/X`, and the outer one has the object's name.

    Args:
        prim: Prim of an edited stage.
    """
    holder = prim.GetParent() if _nests(prim) else prim
    name = holder.GetAttribute(OBJECT_NAME).Get()
    return name if isinstance(name, str) else holder.GetName()


def is_visible(prim: Usd.Prim) -> bool:
    """Check whether a prim is shown, if it can be, at its first time.

    Args:
        prim: Any prim.
    """
    body = UsdGeom.Imageable(prim)
    return not body or body.ComputeVisibility(Usd.TimeCode.EarliestTime()) != UsdGeom.Tokens.invisible


def has_faces(prim: Usd.Prim) -> bool:
    """Check whether a mesh has faces and points at its first time; loose points and edges have none.

    Args:
        prim: A mesh.
    """
    body, time = UsdGeom.Mesh(prim), Usd.TimeCode.EarliestTime()
    return bool(body.GetPointsAttr().Get(time)) and bool(body.GetFaceVertexCountsAttr().Get(time))


def is_blender(stage: Usd.Stage) -> bool:
    """Check whether Blender exported a stage: the absence of things that Blender never writes is then no edit.

    Args:
        stage: An edited stage.
    """
    return str(stage.GetRootLayer().documentation).startswith("Blender")


def home_path(prim: Usd.Prim) -> Sdf.Path:
    """Revert the changes of Blender's exporter to a path: the prefix `/root`, and `X/X` for `X`.

    Args:
        prim: Prim of an edited stage.
    """
    path = prim.GetPath()
    root = Sdf.Path.absoluteRootPath.AppendChild(DCC_ROOT)
    if path.HasPrefix(root) and path != root:
        path = path.ReplacePrefix(root, Sdf.Path.absoluteRootPath)
    return path.GetParentPath() if _nests(prim) else path


def _nests(prim: Usd.Prim) -> bool:
    # The outer Xform is named after the object, the inner mesh after its data.
    parent = prim.GetParent()
    held = prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Camera) or prim.HasAPI(UsdLux.LightAPI)
    if not held or not parent.IsA(UsdGeom.Xform):
        return False
    return parent.HasAttribute(OBJECT_NAME) or parent.GetName() == prim.GetName()


def _scene_prims(scene: Usd.Stage) -> Iterator[Usd.Prim]:
    prims = iter(scene.Traverse())
    for prim in prims:
        yield prim
        if _expanded(prim):
            prims.PruneChildren()


def _is_thing(prim: Usd.Prim) -> bool:
    return prim.IsA(UsdGeom.Gprim) or prim.IsInstance()


def _expanded(prim: Usd.Prim) -> bool:
    return prim.IsA(UsdGeom.PointInstancer) or prim.IsInstance()


def _by_name(lost: list[Sdf.Path], edited: Usd.Stage) -> dict[Sdf.Path, Usd.Prim]:
    plain: dict[str, list[Usd.Prim]] = {}
    for prim in edited.Traverse():
        if prim.IsA(UsdGeom.Gprim) and not stable_id(prim):
            plain.setdefault(object_name(prim), []).append(prim)
    return {path: plain[path.name][0] for path in lost if len(plain.get(path.name, ())) == 1}


def _added(scene: Usd.Stage, edited: Usd.Stage, pairs: dict[Sdf.Path, Usd.Prim]) -> Iterator[tuple[str, Usd.Prim]]:
    kept = {prim.GetPath() for prim in pairs.values()}
    copied = {prim.GetPath() for prim in _scene_prims(scene) if _expanded(prim)}
    instances = {stable_id(prim) for prim in _scene_prims(scene) if prim.IsInstance()} - {""}
    # Names of prototypes, and of prims without ids in a background from another source.
    known = {prim.GetName() for prim in Usd.PrimRange.Stage(scene, Usd.TraverseInstanceProxies()) if _anonymous(prim)}
    taken = {prim.GetName() for prim in scene.Traverse()}
    for prim in sorted(_bodies(edited), key=lambda one: (object_name(one), str(one.GetPath()))):
        if prim.GetPath() in kept:
            continue
        holder = _holder(prim)
        if holder and stable_id(holder) in instances:
            if holder.GetPath() in kept or UsdGeom.Imageable(prim).ComputePurpose() == UsdGeom.Tokens.proxy:
                continue
            wanted = f"{object_name(holder)}_{object_name(prim).rpartition('_Prototype_')[2]}"
        elif _is_brought(prim, copied, known):
            continue
        else:
            wanted = object_name(prim)
        name = free_name(wanted, taken)
        taken.add(name)
        yield name, prim


def _is_brought(prim: Usd.Prim, copied: set[Sdf.Path], known: set[str]) -> bool:
    """Check whether an object without an id is one of the scene: inside an instance, or in an imported world."""
    if any(path in copied for path in home_path(prim).GetPrefixes()):
        return True
    return not stable_id(prim) and (prim.GetAttribute(DATA_NAME).Get() or prim.GetName()) in known


def _holder(prim: Usd.Prim) -> Usd.Prim | None:
    """Find the prim above a body, or the body itself, that has a stable id."""
    while prim and not prim.IsPseudoRoot():
        if stable_id(prim):
            return prim
        prim = prim.GetParent()
    return None


def _bodies(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Walk the meshes and solids of a stage, including those inside instances, but not prototypes of instancers."""
    prims = iter(stage.Traverse())
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
        elif is_body(prim) and (not prim.IsA(UsdGeom.Mesh) or has_faces(prim)):
            yield prim


def _anonymous(prim: Usd.Prim) -> bool:
    return is_body(prim) and not stable_id(prim)


def free_name(wanted: str, taken: set[str]) -> str:
    """Convert an object's name to a unique prim name.

    Args:
        wanted: Name of the object in the other program.
        taken: Names in use.
    """
    plain = "".join(letter if letter.isascii() and (letter.isalnum() or letter == "_") else "_" for letter in wanted)
    plain = plain if plain[:1].isalpha() or plain[:1] == "_" else f"Object_{plain}"
    name, number = plain, 2
    while name in taken:
        name, number = f"{plain}_{number}", number + 1
    return name
