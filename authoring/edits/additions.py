"""What was added: new objects and their materials, labelled, numbered, and kept together under one prim."""

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdSemantics, UsdShade

from authoring.edits.materials import bound_name
from authoring.edits.shapes import flat_normals, read_surface, write_normals, write_points, write_topology, write_uv
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.apis import ComponentFacts, apply_component, apply_labels, direct_label
from usd_schemas.components import class_rows, component_classes
from usd_schemas.reading.materials import asset_file
from usd_schemas.reading.stage_reader import stage_to_world

F64 = NDArray[np.float64]

ADDITIONS = tokens.ADDITIONS
LOOKS = f"{ADDITIONS}/AdditionsLooks"
FIRST_EDIT_ID = 60_000  # [1] beyond what bridges, sites and backgrounds use, and still within 16 bits


@dataclass(frozen=True)
class Labelling:
    """What new objects are called.

    Attributes:
        rules: Pattern of object names and component kind or class; the first that fits counts.
    """

    rules: tuple[tuple[str, str], ...] = ()

    @classmethod
    def parse(cls, words: Iterable[str]) -> "Labelling":
        """Read `kind` or `pattern=kind` words; a bare kind stands for every object.

        Args:
            words: What the user said.

        Raises:
            InputError: Neither a component kind nor a class.
        """
        rules = []
        known = sorted({*component_classes(), *(row.name for row in class_rows())})
        for word in words:
            pattern, sign, kind = word.rpartition("=")
            if kind not in known:
                raise InputError("no such component or class", field="--label", value=word, allowed=", ".join(known))
            rules.append((pattern if sign else "*", kind))
        return cls(tuple(sorted(rules, key=lambda rule: rule[0] == "*")))

    def label(self, name: str, prim: Usd.Prim) -> str:
        """Choose the label of a new object: a rule, else what the object says itself, else background.

        Args:
            name: Name of the object.
            prim: Its mesh in the edited stage.
        """
        for pattern, kind in self.rules:
            if fnmatchcase(name, pattern):
                return kind
        known = {*component_classes(), *(row.name for row in class_rows())}
        for holder in (prim, prim.GetParent()):
            for taxonomy in (tokens.COMPONENT_TAXONOMY, tokens.CLASS_TAXONOMY):
                if (own := direct_label(holder, taxonomy)) in known:
                    return own
        return "background"


def write_addition(layer: Sdf.Layer, name: str, prim: Usd.Prim, label: str, number: int, scene: Usd.Stage) -> None:
    """Author a new mesh in the scene's units under `/World/Additions`.

    Args:
        layer: Layer to write into.
        name: Name that no other prim of the scene has.
        prim: Mesh of the edited stage.
        label: Component kind or class.
        number: Instance id.
        scene: The scene.
    """
    _root(layer)
    spec = Sdf.CreatePrimInLayer(layer, Sdf.Path(f"{ADDITIONS}/{name}"))
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Mesh"
    surface = read_surface(prim)
    write_points(spec, surface.points)
    write_topology(spec, surface)
    write_normals(spec, surface.normals if len(surface.normals) else flat_normals(surface))
    for uv, values in surface.uvs.items():
        write_uv(spec, uv, values)
    mesh = UsdGeom.Mesh(prim)
    scheme = Sdf.AttributeSpec(spec, "subdivisionScheme", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform)
    scheme.default = UsdGeom.Tokens.none
    sides = Sdf.AttributeSpec(spec, "doubleSided", Sdf.ValueTypeNames.Bool, Sdf.VariabilityUniform)
    sides.default = bool(mesh.GetDoubleSidedAttr().Get())
    _place(spec, _world(prim, scene))
    _label(layer, name, label, number)


def write_binding(layer: Sdf.Layer, path: Sdf.Path, material: Sdf.Path) -> None:
    """Bind a prim to a material.

    Args:
        layer: Layer to write into.
        path: Where in the layer.
        material: Composed path of the material.
    """
    spec = Sdf.CreatePrimInLayer(layer, path)
    schemas = spec.GetInfo("apiSchemas") if spec.HasInfo("apiSchemas") else Sdf.TokenListOp()
    listed = [*schemas.prependedItems, "MaterialBindingAPI"]
    spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=list(dict.fromkeys(listed))))
    binding = spec.relationships.get("material:binding") or Sdf.RelationshipSpec(spec, "material:binding", False)
    binding.targetPathList.explicitItems = [material]


def write_material(layer: Sdf.Layer, material: UsdShade.Material) -> tuple[Sdf.Path, dict[str, str]]:
    """Copy a material that the scene lacks, with its network.

    Args:
        layer: Layer to write into.
        material: Material of the edited stage.

    Returns:
        Path of the copy, and destination below the layer's folder to source of each texture to copy.

    Raises:
        InputError: A texture of it is not there; the line names the material.
    """
    _root(layer)
    looks = Sdf.CreatePrimInLayer(layer, Sdf.Path(LOOKS))
    looks.specifier, looks.typeName = Sdf.SpecifierDef, "Scope"
    name = f"Added_{material.GetPrim().GetName()}"
    path = Sdf.Path(LOOKS).AppendChild(name)
    if layer.GetPrimAtPath(path):
        return path, {}
    Sdf.CopySpec(material.GetPrim().GetStage().Flatten(False), material.GetPath(), layer, path)
    copies = {}
    for prim in Usd.PrimRange(material.GetPrim()):
        spec = layer.GetPrimAtPath(prim.GetPath().ReplacePrefix(material.GetPath(), path))
        for attribute in prim.GetAttributes():
            if attribute.GetName().startswith("userProperties:blender"):
                spec.RemoveProperty(spec.attributes[attribute.GetName()])
            if attribute.GetTypeName() != Sdf.ValueTypeNames.Asset or attribute.Get() is None:
                continue
            file = asset_file(attribute.Get())
            if not file:
                raise InputError("a texture is missing", where=str(material.GetPath()), value=attribute.Get().path)
            target = f"textures/{name}_{prim.GetName()}{Path(file).suffix.lower()}"
            spec.attributes[attribute.GetName()].default = Sdf.AssetPath(f"./{target}")
            copies[target] = file
    return path, copies


def material_name(prim: Usd.Prim) -> str:
    """Find what material a new mesh wears: its own, or that of its first subset of faces.

    Args:
        prim: Mesh of the edited stage.
    """
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    return bound_name(prim) or next((bound_name(subset.GetPrim()) for subset in subsets), "")


def _world(prim: Usd.Prim, scene: Usd.Stage) -> F64:
    to_scene = np.linalg.inv(stage_to_world(scene)) @ stage_to_world(prim.GetStage())
    world = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.EarliestTime())
    return np.round(to_scene @ np.array(world).T, 6)


def _root(layer: Sdf.Layer) -> None:
    root = Sdf.CreatePrimInLayer(layer, Sdf.Path(ADDITIONS))
    root.specifier, root.typeName = Sdf.SpecifierDef, "Xform"
    root.SetInfo("kind", Kind.Tokens.component)


def _place(spec: Sdf.PrimSpec, transform: F64) -> None:
    matrix = Sdf.AttributeSpec(spec, "xformOp:transform", Sdf.ValueTypeNames.Matrix4d)
    matrix.default = Gf.Matrix4d(*transform.T.ravel().tolist())
    order = Sdf.AttributeSpec(spec, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
    order.default = ["xformOp:transform"]


def _label(layer: Sdf.Layer, name: str, label: str, number: int) -> None:
    stage = Usd.Stage.Open(layer)
    prim = stage.GetPrimAtPath(f"{ADDITIONS}/{name}")
    component = label if label in component_classes() else ""
    if component:
        apply_labels(prim, component, number)
    else:
        UsdSemantics.LabelsAPI.Apply(prim, tokens.CLASS_TAXONOMY).CreateLabelsAttr([label])
        prim.CreateAttribute(tokens.USER_CLASS, Sdf.ValueTypeNames.String, True).Set(label)
        prim.CreateAttribute(tokens.USER_INSTANCE_ID, Sdf.ValueTypeNames.Int, True).Set(number)
    apply_component(prim, ComponentFacts(component, number))
    prim.CreateAttribute(tokens.USER_FALSEWORK_ID, Sdf.ValueTypeNames.String, True).Set(name)
