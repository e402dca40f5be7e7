"""Repeated objects: native instances of shared prototypes where users select single ones, else a PointInstancer."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, Vt

from authoring.layers.mesh_arrays import mesh_arrays, snapped
from authoring.layers.mesh_specs import BINDING_API, author_mesh, bind, int_array, set_id
from authoring.layers.specs import apply_schemas, attribute, author, prim_spec
from authoring.layers.stand_in import is_heavy, stand_in
from authoring.shapes.component import Component, Mesh, Scatter
from usd_schemas.apis import COMPONENT_API, ComponentFacts, apply_component, component_opinions
from usd_schemas.tokens import ROLES

MOST_INSTANCES = 500  # [1] of a run: above it, users do not select single ones, and outliners and readers slow down
GROUND_COVER = ("vegetation", "shrub", "rock")  # kinds in large numbers, which users do not select individually

_TYPES = Sdf.ValueTypeNames
_TWO_FACED = "leaves"  # materials of cards, which have a face for each side
_PLACED = Vt.TokenArray(["xformOp:translate", "xformOp:rotateZ", "xformOp:scale"])


def are_instances(scatter: Scatter) -> bool:
    """Check whether the copies of a run are written as native instances.

    This is the case if there are at most `MOST_INSTANCES`, each has its own id, none is ground cover, and their meshes
    have neither an atlas (`st1`), which differs for each body, nor a role whose material a look defines.

    Args:
        scatter: The run.
    """
    alone = len(scatter.instance_ids) == len(scatter.positions) <= MOST_INSTANCES
    parts = [part for prototype in scatter.prototypes for part in prototype]
    plain = not any(len(mesh.st1) or role in ROLES for role, mesh in parts)
    return alone and plain and scatter.kind not in GROUND_COVER


def with_own_ids(pieces: tuple[Component | Scatter, ...], last: int) -> tuple[Component | Scatter, ...]:
    """Give every copy that may be a native instance its own id, after all others.

    Args:
        pieces: Components, and scatters of one id for the run or one for each repeat.
        last: Highest id allowed; runs that would need higher ones keep theirs.
    """
    used = [piece.instance_ids if isinstance(piece, Scatter) else (piece.instance_id,) for piece in pieces]
    number = 1 + max((max(ids, default=0) for ids in used), default=0)
    numbered: list[Component | Scatter] = []
    for piece in pieces:
        if isinstance(piece, Scatter) and len(piece.instance_ids) == 1:
            own = replace(piece, instance_ids=tuple(range(number, number + len(piece.positions))))
            if number + len(piece.positions) - 1 <= last and are_instances(own):
                number, piece = number + len(piece.positions), own
        numbered.append(piece)
    return tuple(numbered)


def instance_name(scatter: Scatter, row: int) -> str:
    """Name the prim of one native instance.

    Args:
        scatter: A run of native instances.
        row: Its row.
    """
    return f"{scatter.name}_{row:03d}"


def author_instances(layer: Sdf.Layer, path: str, scatter: Scatter, material: Callable[[str], str]) -> None:
    """Author a run as native instances: labeled, movable prims that inherit from the classes of their shapes.

    Args:
        layer: Layer in memory that has the prim.
        path: Path of the run, an Xform.
        scatter: The run.
        material: Returns the path of a material by its role or recipe.
    """
    shapes = f"{path}/{scatter.name}_Prototypes"
    prim_spec(layer, shapes, "Scope").specifier = Sdf.SpecifierClass
    for number, prototype in enumerate(scatter.prototypes):
        name = f"{scatter.name}_Prototype_{number:02d}"
        body = prim_spec(layer, f"{shapes}/{name}", "Xform").path
        _author_prototype(layer, body, prototype, material)
    set_id(layer.GetPrimAtPath(path), scatter.name)
    places, scales = snapped(scatter.positions).astype(np.float64), snapped(scatter.scales)
    turns = snapped(np.degrees(scatter.yaw))
    for row, number in enumerate(scatter.prototype.tolist()):
        name = instance_name(scatter, row)
        prim = prim_spec(layer, f"{path}/{name}", "Xform")
        prim.SetInfo("instanceable", True)
        prim.kind = Kind.Tokens.subcomponent
        prim.inheritPathList.prependedItems = [Sdf.Path(f"{shapes}/{scatter.name}_Prototype_{number:02d}")]
        apply_schemas(prim, (COMPONENT_API,))
        attribute(prim, "xformOp:translate", _TYPES.Double3, Gf.Vec3d(*places[row].tolist()))
        attribute(prim, "xformOp:rotateZ", _TYPES.Float, float(turns[row]))
        attribute(prim, "xformOp:scale", _TYPES.Float3, Gf.Vec3f(*scales[row].tolist()))
        attribute(prim, "xformOpOrder", _TYPES.TokenArray, _PLACED, uniform=True)
        set_id(prim, name)
        author(prim, component_opinions(ComponentFacts(scatter.kind, scatter.instance_ids[row])))


def author_instancer(stage: Usd.Stage, path: str, scatter: Scatter, material: Callable[[str], str]) -> None:
    """Author a run as a PointInstancer.

    Args:
        stage: Stage of a layer in memory.
        path: Path of the run.
        scatter: The run.
        material: Returns the path of a material by its role or recipe.
    """
    layer = stage.GetRootLayer()
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    targets = []
    for number, prototype in enumerate(scatter.prototypes):
        name = f"{scatter.name}_Prototype_{number:02d}"
        body = UsdGeom.Xform.Define(stage, f"{path}/{scatter.name}_Prototypes/{name}").GetPath()
        _author_prototype(layer, body, prototype, material)
        targets.append(body)
    UsdGeom.Scope.Define(stage, f"{path}/{scatter.name}_Prototypes")
    instancer.CreatePrototypesRel().SetTargets(targets)
    count = len(scatter.positions)
    half = scatter.yaw / 2
    turns = snapped(np.column_stack([np.zeros((count, 2)), np.sin(half), np.cos(half)]))
    instancer.CreateProtoIndicesAttr(int_array(scatter.prototype))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(snapped(scatter.positions)))
    instancer.CreateOrientationsAttr(Vt.QuathArray([Gf.Quath(*_half(turn)) for turn in turns.tolist()]))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(snapped(scatter.scales)))
    instancer.CreateIdsAttr(Vt.Int64Array(range(count)))
    extent = instancer.ComputeExtentAtTime(Usd.TimeCode.Default(), Usd.TimeCode.Default())
    instancer.CreateExtentAttr(extent)
    set_id(layer.GetPrimAtPath(path), scatter.name)
    ids = scatter.instance_ids
    single = ids[0] if len(ids) == 1 else 0
    facts = ComponentFacts(scatter.kind, single, () if single else ids)
    apply_component(instancer.GetPrim(), facts)


def _author_prototype(
    layer: Sdf.Layer, path: Sdf.Path, prototype: tuple[tuple[str, Mesh], ...], material: Callable[[str], str]
) -> None:
    parts = list(_parts(path.name, prototype))
    arrays = mesh_arrays([mesh for _, _, mesh, _ in parts], [False] * len(parts))
    for (leaf, role, mesh, purpose), own in zip(parts, arrays, strict=True):
        part = prim_spec(layer, f"{path}/{leaf}", "Mesh")
        apply_schemas(part, (BINDING_API,))
        author_mesh(part, mesh, own, not role.startswith(_TWO_FACED))
        bind(part, material(role))
        if purpose:
            attribute(part, "purpose", _TYPES.Token, purpose, uniform=True)


def _parts(name: str, prototype: tuple[tuple[str, Mesh], ...]) -> Iterator[tuple[str, str, Mesh, str]]:
    """List the meshes of a prototype: name, material, mesh, purpose; heavy ones have a stand-in for viewports."""
    for row, (role, mesh) in enumerate(prototype):
        leaf = f"{name}_Part_{row:02d}"
        yield leaf, role, mesh, UsdGeom.Tokens.render if is_heavy(mesh) else ""
        if is_heavy(mesh):
            yield f"{leaf}_Proxy", role, stand_in(mesh), UsdGeom.Tokens.proxy


def _half(turn: list[float]) -> tuple[float, float, float, float]:
    x, y, z, w = turn
    return w, x, y, z
