"""A new object as a mesh of the scene: its faces, colors, texture coordinates, and the materials of its faces."""

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

from authoring.edits.shapes import (
    UV_SETS,
    flat_normals,
    read_surface,
    write_normals,
    write_points,
    write_topology,
    write_uv,
)
from usd_schemas.reading.subsets import subset_faces

_TYPES = Sdf.ValueTypeNames
_COLORS = ("displayColor", "displayOpacity")
_FAMILY = "materialBind"
_TIME = Usd.TimeCode.EarliestTime()


def write_body(spec: Sdf.PrimSpec, prim: Usd.Prim) -> None:
    """Author the mesh of an object, without its placement.

    Args:
        spec: A mesh in a layer.
        prim: Mesh or solid of the edited stage.
    """
    surface = read_surface(prim)
    write_points(spec, surface.points)
    write_topology(spec, surface)
    write_normals(spec, surface.normals if len(surface.normals) else flat_normals(surface))
    for uv, values in surface.uvs.items():
        write_uv(spec, uv, values)
    _write_primvars(spec, prim)
    _uniform(spec, "subdivisionScheme", _TYPES.Token, UsdGeom.Tokens.none)
    gprim = UsdGeom.Gprim(prim)
    _uniform(spec, "doubleSided", _TYPES.Bool, bool(gprim.GetDoubleSidedAttr().Get()))
    if gprim.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        _uniform(spec, "orientation", _TYPES.Token, UsdGeom.Tokens.leftHanded)
    for subset, family, faces in _subsets(prim):
        child = Sdf.CreatePrimInLayer(spec.layer, spec.path.AppendChild(subset.GetName()))
        child.specifier, child.typeName = Sdf.SpecifierDef, "GeomSubset"
        _uniform(child, "elementType", _TYPES.Token, UsdGeom.Tokens.face)
        _uniform(child, "familyName", _TYPES.Token, family)
        Sdf.AttributeSpec(child, "indices", _TYPES.IntArray).default = Vt.IntArray.FromNumpy(faces.astype(np.int32))
        _uniform(spec, f"subsetFamily:{_FAMILY}:familyType", _TYPES.Token, UsdGeom.Tokens.nonOverlapping)


def bound_materials(prim: Usd.Prim) -> dict[str, UsdShade.Material]:
    """Find the materials of an object: name of a subset of faces, empty for the object itself, to the material.

    Args:
        prim: Body of a stage.
    """
    found = {"": UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]}
    for subset, _, _ in _subsets(prim):
        found[subset.GetName()] = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()[0]
    return {name: material for name, material in found.items() if material}


def _subsets(prim: Usd.Prim) -> list[tuple[Usd.Prim, str, NDArray[np.int64]]]:
    rows = subset_faces(prim) if prim.IsA(UsdGeom.Mesh) else []
    return [row for row in rows if row[1] == _FAMILY]


def _write_primvars(spec: Sdf.PrimSpec, prim: Usd.Prim) -> None:
    """Copy colors, and texture coordinates of other names, unchanged; a solid has one color."""
    for primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        name, kind = primvar.GetPrimvarName(), primvar.GetTypeName()
        is_uv = kind in (_TYPES.TexCoord2fArray, _TYPES.Float2Array) and name not in UV_SETS
        if not (name in _COLORS or (is_uv and prim.IsA(UsdGeom.Mesh))):
            continue
        values, spread = primvar.ComputeFlattened(_TIME), primvar.GetInterpolation()
        if not values:
            continue
        if not prim.IsA(UsdGeom.Mesh):
            values, spread = type(values)([values[0]]), UsdGeom.Tokens.constant
        attribute = Sdf.AttributeSpec(spec, f"primvars:{name}", kind)
        attribute.default = values
        attribute.SetInfo("interpolation", spread)


def _uniform(spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, value: object) -> None:
    attribute = spec.attributes.get(name) or Sdf.AttributeSpec(spec, name, kind, Sdf.VariabilityUniform)
    attribute.default = value
