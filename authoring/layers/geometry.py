"""Geometry layer: one Mesh a component, one PointInstancer a scatter, each bound once to a material by name."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, Vt

from authoring.component import Component, Mesh, Scatter
from authoring.layers.layer import new_outlined_stage
from usd_schemas import tokens
from usd_schemas.apis import ComponentFacts, apply_component

F64 = NDArray[np.float64]

GRID = 1e-6  # [m], [1]: values are rounded to it before they are written, so that every CPU writes the same


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
    names = sorted({piece.group for piece in pieces})
    outline = {asset.group(name): "Xform" for name in names}
    for piece in pieces:
        outline[asset.prim(piece)] = "Mesh" if isinstance(piece, Component) else "PointInstancer"
    stage = new_outlined_stage(asset.root, outline)
    root = UsdGeom.Xform.Define(stage, f"/{asset.root}").GetPrim()
    _set_id(root, asset.root)
    # A model hierarchy must have no gaps: a bridge is an assembly of groups; site and background are one component.
    grouped = asset is BRIDGE
    scope = UsdGeom.Scope.Define(stage, asset.geometry).GetPrim()
    if grouped:
        Usd.ModelAPI(scope).SetKind(Kind.Tokens.group)
    UsdGeom.Scope.Define(stage, asset.looks)
    for role in roles_of(pieces):
        UsdShade.Material.Define(stage, asset.material(role))
    for name in names:
        group = UsdGeom.Xform.Define(stage, asset.group(name)).GetPrim()
        _set_id(group, group.GetName())
        if grouped:
            Usd.ModelAPI(group).SetKind(Kind.Tokens.component)
    for piece in pieces:
        if isinstance(piece, Component):
            _author_component(stage, asset, piece)
        else:
            _author_scatter(stage, asset, piece)
    return stage.GetRootLayer()


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


def _author_component(stage: Usd.Stage, asset: Asset, component: Component) -> None:
    # Points count from the middle of the component: a pivot that artists can use, and float32 to the micrometre.
    points = component.mesh.points
    origin = np.round((points.min(axis=0) + points.max(axis=0)) / 2, 3)
    mesh = _author_mesh(stage, asset.prim(component), component.mesh, origin, component.double_sided)
    mesh.AddTranslateOp().Set(Gf.Vec3d(*origin.tolist()))
    _bind(stage, mesh.GetPrim(), asset.material(component.role))
    _set_id(mesh.GetPrim(), component.name)
    apply_component(
        mesh.GetPrim(), ComponentFacts(component.kind, component.instance_id, parameters=component.parameters)
    )


def _author_scatter(stage: Usd.Stage, asset: Asset, scatter: Scatter) -> None:
    path = asset.prim(scatter)
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    targets = []
    for number, prototype in enumerate(scatter.prototypes):
        name = f"{scatter.name}_Prototype_{number:02d}"
        body = UsdGeom.Xform.Define(stage, f"{path}/{scatter.name}_Prototypes/{name}")
        targets.append(body.GetPath())
        for row, (role, mesh) in enumerate(prototype):
            part = _author_mesh(stage, f"{body.GetPath()}/{name}_Part_{row:02d}", mesh, np.zeros(3), True)
            _bind(stage, part.GetPrim(), asset.material(role))
    UsdGeom.Scope.Define(stage, f"{path}/{scatter.name}_Prototypes")
    instancer.CreatePrototypesRel().SetTargets(targets)
    count = len(scatter.positions)
    half = scatter.yaw / 2
    turns = _snap(np.column_stack([np.zeros((count, 2)), np.sin(half), np.cos(half)]))
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(scatter.prototype, np.int32)))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(_snap(scatter.positions)))
    instancer.CreateOrientationsAttr(Vt.QuathArray([Gf.Quath(*_half(turn)) for turn in turns.tolist()]))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(_snap(scatter.scales)))
    instancer.CreateIdsAttr(Vt.Int64Array(range(count)))
    extent = instancer.ComputeExtentAtTime(Usd.TimeCode.Default(), Usd.TimeCode.Default())
    instancer.CreateExtentAttr(extent)
    _set_id(instancer.GetPrim(), scatter.name)
    ids = scatter.instance_ids
    single = ids[0] if len(ids) == 1 else 0
    facts = ComponentFacts(scatter.kind, single, () if single else ids)
    apply_component(instancer.GetPrim(), facts)


def _author_mesh(stage: Usd.Stage, path: str, mesh: Mesh, origin: F64, double_sided: bool) -> UsdGeom.Mesh:
    prim = UsdGeom.Mesh.Define(stage, path)
    points = _snap(mesh.points - origin)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.face_counts, np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.corners, np.int32)))
    prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateDoubleSidedAttr(double_sided)
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(_snap(mesh.normals)))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)
    _author_uv(prim, "st", mesh.st)
    if len(mesh.st1):
        _author_uv(prim, "st1", mesh.st1)
    return prim


def _author_uv(prim: UsdGeom.Mesh, name: str, values: NDArray[np.float32]) -> None:
    snapped = _snap(values)
    _, first, indices = np.unique(snapped.view(np.uint64), return_index=True, return_inverse=True)
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
        name, Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    primvar.Set(Vt.Vec2fArray.FromNumpy(snapped[first]))
    primvar.SetIndices(Vt.IntArray.FromNumpy(indices.reshape(-1).astype(np.int32)))


def _bind(stage: Usd.Stage, prim: Usd.Prim, material: str) -> None:
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material(stage.GetPrimAtPath(material)))


def _set_id(prim: Usd.Prim, name: str) -> None:
    prim.CreateAttribute(tokens.USER_FALSEWORK_ID, Sdf.ValueTypeNames.String, True).Set(name)


def _snap(values: NDArray[np.floating]) -> NDArray[np.float32]:
    # Adding zero turns -0.0 into 0.0: equal values, equal bytes.
    return np.ascontiguousarray(np.round(np.asarray(values, np.float64) / GRID) * GRID + 0.0, dtype=np.float32)


def _half(turn: list[float]) -> tuple[float, float, float, float]:
    x, y, z, w = turn
    return w, x, y, z
