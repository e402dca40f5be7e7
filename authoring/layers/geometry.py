"""Geometry layer: one Mesh a component, one PointInstancer a scatter, each bound once to a material by name."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, Vt

from authoring.layers.layer import new_layer
from authoring.layers.mesh_arrays import IndexedUV, MeshArrays, mesh_arrays, snapped
from authoring.layers.specs import apply_schemas, attribute, author, prim_spec
from authoring.layers.stand_in import is_heavy, stand_in
from authoring.looks.roles import sheet_material, sheet_numbers
from authoring.shapes.component import Component, Mesh, Scatter
from usd_schemas import tokens
from usd_schemas.apis import COMPONENT_API, ComponentFacts, apply_component, component_opinions

_TYPES = Sdf.ValueTypeNames
_BINDING_API = "MaterialBindingAPI"
_MOVED = Vt.TokenArray(["xformOp:translate"])
_TWO_FACED = "leaves"  # materials of cards, which have a face for each side
_LAND = ("Ground", "Ways")  # their pieces meet at shared vertices: of one origin, no renderer rounds them apart


@dataclass(frozen=True)
class Asset:
    """Where the parts of an asset stand in its layers.

    Attributes:
        root: Name of the root prim: `Bridge`, `Site` or `Background`.
        prefix: Put before the names of groups and materials, which more than one asset may use.
    """

    root: str
    prefix: str = ""

    @property
    def geometry(self) -> str:
        """Path of the Scope that holds the groups."""
        return f"/{self.root}/{self.root}Geom"

    @property
    def looks(self) -> str:
        """Path of the Scope that holds the materials."""
        return f"/{self.root}/{self.root}Looks"

    def group(self, name: str) -> str:
        """Path of a group.

        Args:
            name: `Component.group`.
        """
        return f"{self.geometry}/{self.prefix}{name}"

    def prim(self, piece: Component | Scatter) -> str:
        """Path of a component's or scatter's leaf prim.

        Args:
            piece: Component or scatter.
        """
        return f"{self.group(piece.group)}/{piece.name}"

    def material(self, role: str) -> str:
        """Path of a material.

        Args:
            role: Material role or recipe name.
        """
        return f"{self.looks}/{self.prefix}_{role}" if self.prefix else f"{self.looks}/{role}"


BRIDGE = Asset("Bridge")
SITE = Asset("Site", "Site")
BACKGROUND = Asset("Background", "Background")


def geometry_layer(asset: Asset, pieces: tuple[Component | Scatter, ...]) -> Sdf.Layer:
    """Author the geometry of an asset.

    Args:
        asset: Where it stands.
        pieces: Components in world space, and scatters.

    Returns:
        A layer in memory, to be written as `geometry.usdc`.
    """
    layer = new_layer(asset.root)
    sheets = sheet_numbers(pieces) if asset is BRIDGE else {}
    components = [piece for piece in pieces if isinstance(piece, Component)]
    with Sdf.ChangeBlock():
        _author_groups(layer, asset, pieces, sheets)
        meshes = [component.mesh for component in components]
        arrays = mesh_arrays(meshes, [component.group not in _LAND for component in components])
        for component, own in zip(components, arrays, strict=True):
            _author_component(layer, asset, component, own, sheets.get(component.instance_id, 0))
    if len(components) < len(pieces):
        stage = Usd.Stage.Open(layer, Usd.Stage.LoadAll)
        for piece in pieces:
            if isinstance(piece, Scatter):
                _author_scatter(stage, asset, piece)
    return layer


def roles_of(pieces: tuple[Component | Scatter, ...]) -> tuple[str, ...]:
    """List the material roles that some pieces use, sorted.

    Args:
        pieces: Components and scatters.
    """
    roles = {piece.role for piece in pieces if isinstance(piece, Component)}
    for piece in pieces:
        if isinstance(piece, Scatter):
            roles |= {role for prototype in piece.prototypes for role, _ in prototype}
    return tuple(sorted(roles))


def _author_groups(
    layer: Sdf.Layer, asset: Asset, pieces: tuple[Component | Scatter, ...], sheets: dict[int, int]
) -> None:
    groups = [prim_spec(layer, asset.group(name), "Xform") for name in sorted({piece.group for piece in pieces})]
    for piece in pieces:
        prim_spec(layer, asset.prim(piece), "Mesh" if isinstance(piece, Component) else "PointInstancer")
    _set_id(prim_spec(layer, f"/{asset.root}", "Xform"), asset.root)
    scope = prim_spec(layer, asset.geometry, "Scope")
    prim_spec(layer, asset.looks, "Scope")
    for group in groups:
        _set_id(group, group.name)
    if asset is BRIDGE:  # a model hierarchy must have no gaps: a bridge is an assembly, site and background a component
        scope.kind = Kind.Tokens.group
        for group in groups:
            group.kind = Kind.Tokens.component
    for role in roles_of(pieces):
        prim_spec(layer, asset.material(role), "Material")
    worn = {(piece.role, sheets.get(piece.instance_id, 0)) for piece in pieces if isinstance(piece, Component)}
    for role, number in sorted(worn):
        if number:  # the role's material with another sheet: whatever is made of the role holds for it too
            other = prim_spec(layer, asset.material(sheet_material(role, number)), "Material")
            other.specializesList.prependedItems = [Sdf.Path(asset.material(role))]


def _author_component(layer: Sdf.Layer, asset: Asset, component: Component, arrays: MeshArrays, sheet: int) -> None:
    prim = layer.GetPrimAtPath(asset.prim(component))
    apply_schemas(prim, (_BINDING_API, COMPONENT_API))
    _author_mesh(prim, component.mesh, arrays, component.double_sided)
    attribute(prim, "xformOp:translate", _TYPES.Double3, Gf.Vec3d(*arrays.origin.tolist()))
    attribute(prim, "xformOpOrder", _TYPES.TokenArray, _MOVED, uniform=True)
    _bind(prim, asset.material(sheet_material(component.role, sheet)))
    _set_id(prim, component.name)
    author(
        prim, component_opinions(ComponentFacts(component.kind, component.instance_id, parameters=component.parameters))
    )


def _author_scatter(stage: Usd.Stage, asset: Asset, scatter: Scatter) -> None:
    path = asset.prim(scatter)
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    targets = []
    for number, prototype in enumerate(scatter.prototypes):
        name = f"{scatter.name}_Prototype_{number:02d}"
        body = UsdGeom.Xform.Define(stage, f"{path}/{scatter.name}_Prototypes/{name}")
        targets.append(body.GetPath())
        parts = list(_parts(name, prototype))
        arrays = mesh_arrays([mesh for _, _, mesh, _ in parts], [False] * len(parts))
        for (leaf, role, mesh, purpose), own in zip(parts, arrays, strict=True):
            part = prim_spec(stage.GetRootLayer(), f"{body.GetPath()}/{leaf}", "Mesh")
            apply_schemas(part, (_BINDING_API,))
            _author_mesh(part, mesh, own, not role.startswith(_TWO_FACED))
            _bind(part, asset.material(role))
            if purpose:
                attribute(part, "purpose", _TYPES.Token, purpose, uniform=True)
    UsdGeom.Scope.Define(stage, f"{path}/{scatter.name}_Prototypes")
    instancer.CreatePrototypesRel().SetTargets(targets)
    count = len(scatter.positions)
    half = scatter.yaw / 2
    turns = snapped(np.column_stack([np.zeros((count, 2)), np.sin(half), np.cos(half)]))
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(scatter.prototype, np.int32)))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(snapped(scatter.positions)))
    instancer.CreateOrientationsAttr(Vt.QuathArray([Gf.Quath(*_half(turn)) for turn in turns.tolist()]))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(snapped(scatter.scales)))
    instancer.CreateIdsAttr(Vt.Int64Array(range(count)))
    extent = instancer.ComputeExtentAtTime(Usd.TimeCode.Default(), Usd.TimeCode.Default())
    instancer.CreateExtentAttr(extent)
    _set_id(stage.GetRootLayer().GetPrimAtPath(path), scatter.name)
    ids = scatter.instance_ids
    single = ids[0] if len(ids) == 1 else 0
    facts = ComponentFacts(scatter.kind, single, () if single else ids)
    apply_component(instancer.GetPrim(), facts)


def _parts(name: str, prototype: tuple[tuple[str, Mesh], ...]) -> Iterator[tuple[str, str, Mesh, str]]:
    """List the meshes of a prototype: name, material, mesh, purpose; heavy ones have a stand-in for viewports."""
    for row, (role, mesh) in enumerate(prototype):
        leaf = f"{name}_Part_{row:02d}"
        yield leaf, role, mesh, UsdGeom.Tokens.render if is_heavy(mesh) else ""
        if is_heavy(mesh):
            yield f"{leaf}_Proxy", role, stand_in(mesh), UsdGeom.Tokens.proxy


def _author_mesh(prim: Sdf.PrimSpec, mesh: Mesh, arrays: MeshArrays, double_sided: bool) -> None:
    attribute(prim, "points", _TYPES.Point3fArray, Vt.Vec3fArray.FromNumpy(arrays.points))
    attribute(prim, "faceVertexCounts", _TYPES.IntArray, _int_array(mesh.face_counts))
    attribute(prim, "faceVertexIndices", _TYPES.IntArray, _int_array(mesh.corners))
    attribute(prim, "extent", _TYPES.Float3Array, Vt.Vec3fArray.FromNumpy(arrays.extent))
    attribute(prim, "subdivisionScheme", _TYPES.Token, UsdGeom.Tokens.none, uniform=True)
    attribute(prim, "doubleSided", _TYPES.Bool, double_sided, uniform=True)
    normals = attribute(prim, "normals", _TYPES.Normal3fArray, Vt.Vec3fArray.FromNumpy(arrays.normals))
    normals.SetInfo(UsdGeom.Tokens.interpolation, UsdGeom.Tokens.faceVarying)
    _author_uv(prim, "primvars:st", arrays.st)
    if arrays.st1 is not None:
        _author_uv(prim, "primvars:st1", arrays.st1)


def _author_uv(prim: Sdf.PrimSpec, name: str, pairs: IndexedUV) -> None:
    uv = Sdf.AttributeSpec(prim, name, _TYPES.TexCoord2fArray)
    uv.SetInfo(UsdGeom.Tokens.interpolation, UsdGeom.Tokens.faceVarying)
    uv.default = Vt.Vec2fArray.FromNumpy(pairs.values)
    attribute(prim, f"{name}:indices", _TYPES.IntArray, Vt.IntArray.FromNumpy(pairs.indices))


def _bind(prim: Sdf.PrimSpec, material: str) -> None:
    binding = Sdf.RelationshipSpec(prim, UsdShade.Tokens.materialBinding, False, Sdf.VariabilityUniform)
    binding.targetPathList.explicitItems = [material]


def _set_id(prim: Sdf.PrimSpec, name: str) -> None:
    attribute(prim, tokens.USER_FALSEWORK_ID, _TYPES.String, name, custom=True)


def _int_array(values: NDArray[np.integer]) -> Vt.IntArray:
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, np.int32))


def _half(turn: list[float]) -> tuple[float, float, float, float]:
    x, y, z, w = turn
    return w, x, y, z
