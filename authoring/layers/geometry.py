"""Geometry layer: one Mesh per component, instances for repeated objects, each mesh bound to one material by name."""

from dataclasses import dataclass

from pxr import Gf, Kind, Sdf, Usd, Vt

from authoring.layers.layer import new_layer
from authoring.layers.mesh_arrays import MeshArrays, mesh_arrays
from authoring.layers.mesh_specs import BINDING_API, author_mesh, bind, set_id
from authoring.layers.repeats import are_instances, author_instancer, author_instances
from authoring.layers.specs import apply_schemas, attribute, author, prim_spec
from authoring.looks.roles import sheet_material, sheet_numbers
from authoring.shapes.component import Component, Scatter
from usd_schemas.apis import COMPONENT_API, ComponentFacts, component_opinions

_TYPES = Sdf.ValueTypeNames
_MOVED = Vt.TokenArray(["xformOp:translate"])
_LAND = ("Ground", "Ways")  # their pieces share vertices: with one origin, rounding does not separate them


@dataclass(frozen=True)
class Asset:
    """Paths of the parts of an asset in its layers.

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
        asset: Paths of its parts.
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
        for piece in pieces:
            if isinstance(piece, Scatter) and are_instances(piece):
                author_instances(layer, asset.prim(piece), piece, asset.material)
    crowds = [piece for piece in pieces if isinstance(piece, Scatter) and not are_instances(piece)]
    if crowds:
        stage = Usd.Stage.Open(layer, Usd.Stage.LoadAll)
        for crowd in crowds:
            author_instancer(stage, asset.prim(crowd), crowd, asset.material)
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
        prim_spec(layer, asset.prim(piece), _type_of(piece))
    set_id(prim_spec(layer, f"/{asset.root}", "Xform"), asset.root)
    scope = prim_spec(layer, asset.geometry, "Scope")
    prim_spec(layer, asset.looks, "Scope")
    for group in groups:
        set_id(group, group.name)
    if asset is BRIDGE:  # a model hierarchy must have no gaps: a bridge is an assembly, site and background a component
        scope.kind = Kind.Tokens.group
        for group in groups:
            group.kind = Kind.Tokens.component
    for role in roles_of(pieces):
        prim_spec(layer, asset.material(role), "Material")
    worn = {(piece.role, sheets.get(piece.instance_id, 0)) for piece in pieces if isinstance(piece, Component)}
    for role, number in sorted(worn):
        if number:  # the role's material with another sheet: overrides of the role apply to it too
            other = prim_spec(layer, asset.material(sheet_material(role, number)), "Material")
            other.specializesList.prependedItems = [Sdf.Path(asset.material(role))]


def _author_component(layer: Sdf.Layer, asset: Asset, component: Component, arrays: MeshArrays, sheet: int) -> None:
    prim = layer.GetPrimAtPath(asset.prim(component))
    apply_schemas(prim, (BINDING_API, COMPONENT_API))
    author_mesh(prim, component.mesh, arrays, component.double_sided)
    attribute(prim, "xformOp:translate", _TYPES.Double3, Gf.Vec3d(*arrays.origin.tolist()))
    attribute(prim, "xformOpOrder", _TYPES.TokenArray, _MOVED, uniform=True)
    bind(prim, asset.material(sheet_material(component.role, sheet)))
    set_id(prim, component.name)
    author(
        prim, component_opinions(ComponentFacts(component.kind, component.instance_id, parameters=component.parameters))
    )


def _type_of(piece: Component | Scatter) -> str:
    if isinstance(piece, Component):
        return "Mesh"
    return "Xform" if are_instances(piece) else "PointInstancer"
