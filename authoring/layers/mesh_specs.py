"""Writes a mesh into a layer: its arrays, its material, and its stable id."""

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, UsdGeom, UsdShade, Vt

from authoring.layers.mesh_arrays import IndexedUV, MeshArrays
from authoring.layers.specs import attribute
from authoring.shapes.component import Mesh
from usd_schemas import tokens

BINDING_API = "MaterialBindingAPI"

_TYPES = Sdf.ValueTypeNames


def author_mesh(prim: Sdf.PrimSpec, mesh: Mesh, arrays: MeshArrays, double_sided: bool) -> None:
    """Author the arrays of a mesh.

    Args:
        prim: A Mesh without attributes.
        mesh: Its faces.
        arrays: Its values, rounded and indexed.
        double_sided: Back faces are visible.
    """
    attribute(prim, "points", _TYPES.Point3fArray, Vt.Vec3fArray.FromNumpy(arrays.points))
    attribute(prim, "faceVertexCounts", _TYPES.IntArray, int_array(mesh.face_counts))
    attribute(prim, "faceVertexIndices", _TYPES.IntArray, int_array(mesh.corners))
    attribute(prim, "extent", _TYPES.Float3Array, Vt.Vec3fArray.FromNumpy(arrays.extent))
    attribute(prim, "subdivisionScheme", _TYPES.Token, UsdGeom.Tokens.none, uniform=True)
    attribute(prim, "doubleSided", _TYPES.Bool, double_sided, uniform=True)
    normals = attribute(prim, "normals", _TYPES.Normal3fArray, Vt.Vec3fArray.FromNumpy(arrays.normals))
    normals.SetInfo(UsdGeom.Tokens.interpolation, UsdGeom.Tokens.faceVarying)
    _author_uv(prim, "primvars:st", arrays.st)
    if arrays.st1 is not None:
        _author_uv(prim, "primvars:st1", arrays.st1)


def bind(prim: Sdf.PrimSpec, material: str) -> None:
    """Bind a prim to a material.

    Args:
        prim: A Mesh with `BINDING_API`.
        material: Path of the material.
    """
    binding = Sdf.RelationshipSpec(prim, UsdShade.Tokens.materialBinding, False, Sdf.VariabilityUniform)
    binding.targetPathList.explicitItems = [material]


def set_id(prim: Sdf.PrimSpec, name: str) -> None:
    """Author the id by which a prim is identified after another program has renamed or moved it.

    Args:
        prim: Any prim.
        name: Its name, unique in the stage.
    """
    attribute(prim, tokens.USER_FALSEWORK_ID, _TYPES.String, name, custom=True)


def int_array(values: NDArray[np.integer]) -> Vt.IntArray:
    """Copy whole numbers into an array of USD.

    Args:
        values: Numbers, shape (N,), any integer type.

    Returns:
        The numbers, shape (N,), int.
    """
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, np.int32))


def _author_uv(prim: Sdf.PrimSpec, name: str, pairs: IndexedUV) -> None:
    uv = Sdf.AttributeSpec(prim, name, _TYPES.TexCoord2fArray)
    uv.SetInfo(UsdGeom.Tokens.interpolation, UsdGeom.Tokens.faceVarying)
    uv.default = Vt.Vec2fArray.FromNumpy(pairs.values)
    attribute(prim, f"{name}:indices", _TYPES.IntArray, Vt.IntArray.FromNumpy(pairs.indices))
