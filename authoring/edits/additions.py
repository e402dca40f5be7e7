"""Additions: new objects and their materials, labeled, numbered, and grouped under one prim."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdSemantics, UsdShade

from authoring.edits.bodies import write_body
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.apis import ComponentFacts, apply_component, apply_labels, direct_label
from usd_schemas.components import class_rows, component_classes
from usd_schemas.reading.materials import asset_file
from usd_schemas.reading.stage_reader import stage_to_world

F64 = NDArray[np.float64]

ADDITIONS = tokens.ADDITIONS
LOOKS = f"{ADDITIONS}/AdditionsLooks"


@dataclass(frozen=True)
class Labeling:
    """Labels of new objects.

    Attributes:
        rules: Pattern of object names and component kind or class; the first that matches is used.
    """

    rules: tuple[tuple[str, str], ...] = ()

    @classmethod
    def parse(cls, words: Iterable[str]) -> "Labeling":
        """Read `kind` or `pattern=kind` words; a kind without a pattern applies to every object.

        Args:
            words: The user's words.

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
        """Choose the label of a new object: that of a rule, else its own or its parent's, else background.

        Args:
            name: Name of the object.
            prim: Its body in the edited stage; rules also match the names of its parents.
        """
        above = list(_upwards(prim))
        for pattern, kind in self.rules:
            if any(fnmatchcase(one, pattern) for one in (name, *(holder.GetName() for holder in above))):
                return kind
        known = {*component_classes(), *(row.name for row in class_rows())}
        for holder in above:
            for taxonomy in (tokens.COMPONENT_TAXONOMY, tokens.CLASS_TAXONOMY):
                if (own := direct_label(holder, taxonomy)) in known:
                    return own
        return "background"


def write_addition(layer: Sdf.Layer, name: str, prim: Usd.Prim, label: str, number: int, scene: Usd.Stage) -> None:
    """Author a new body as a mesh in the scene's units under `/World/Additions`.

    Args:
        layer: Layer to write into.
        name: Name that no other prim of the scene has.
        prim: Mesh or solid of the edited stage.
        label: Component kind or class.
        number: Instance id.
        scene: The scene.
    """
    _root(layer)
    spec = Sdf.CreatePrimInLayer(layer, Sdf.Path(f"{ADDITIONS}/{name}"))
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Mesh"
    write_body(spec, prim)
    _place(spec, _world(prim, scene))
    _label(layer, name, label, number)


def write_binding(layer: Sdf.Layer, path: Sdf.Path, material: Sdf.Path) -> None:
    """Bind a prim to a material.

    Args:
        layer: Layer to write into.
        path: Path in the layer.
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
        InputError: A texture of it is missing; the message names the material.
    """
    _root(layer)
    looks = Sdf.CreatePrimInLayer(layer, Sdf.Path(LOOKS))
    looks.specifier, looks.typeName = Sdf.SpecifierDef, "Scope"
    name = f"Added_{material.GetPrim().GetName()}"
    path = Sdf.Path(LOOKS).AppendChild(name)
    if layer.GetPrimAtPath(path):
        return path, {}
    copies: dict[str, str] = {}
    for prim in Usd.PrimRange(material.GetPrim()):
        spec = Sdf.CreatePrimInLayer(layer, prim.GetPath().ReplacePrefix(material.GetPath(), path))
        spec.specifier, spec.typeName = Sdf.SpecifierDef, prim.GetTypeName()
        for attribute in prim.GetAuthoredAttributes():
            if not attribute.GetName().startswith("userProperties:blender"):
                _copy_input(spec, attribute, material.GetPath(), path, copies)
    return path, copies


def _copy_input(
    spec: Sdf.PrimSpec, attribute: Usd.Attribute, home: Sdf.Path, path: Sdf.Path, copies: dict[str, str]
) -> None:
    """Copy the value of an attribute of a material's network and its connections, including its texture."""
    name, value = attribute.GetName(), attribute.Get(Usd.TimeCode.EarliestTime())
    if isinstance(value, Sdf.AssetPath):
        file = asset_file(value)
        if not file:
            raise InputError("a texture is missing", where=str(home), value=value.path)
        stem = (
            f"{path.name}_{spec.name}"
            if name == "inputs:file"
            else f"{path.name}_{spec.name}_{attribute.GetBaseName()}"
        )
        target = f"textures/{stem}{Path(file).suffix.lower()}"
        copies[target], value = file, Sdf.AssetPath(f"./{target}")
    copy = Sdf.AttributeSpec(spec, name, attribute.GetTypeName(), attribute.GetVariability(), attribute.IsCustom())
    if value is not None:
        copy.default = value
    if attribute.HasAuthoredMetadata("colorSpace"):
        copy.SetInfo("colorSpace", attribute.GetColorSpace())
    if sources := attribute.GetConnections():
        copy.connectionPathList.explicitItems = [source.ReplacePrefix(home, path) for source in sources]


def _upwards(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    while prim and not prim.IsPseudoRoot():
        yield prim
        prim = prim.GetParent()


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
