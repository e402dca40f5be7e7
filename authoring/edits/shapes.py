"""Reshaped meshes: points, topology, normals and texture coordinates of meshes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, Vt

from usd_schemas.reading.shapes import SHAPES, read_shape

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

SHIFTED = 1e-5  # [m] a larger distance counts as a change
BENT = 0.01  # [1] Blender stores normals in 16 bits, with errors of 0.003
SLID = 1e-5  # [1] texture coordinates
UV_SETS = ("st", "st1")


@dataclass(frozen=True)
class Surface:
    """A mesh as plain arrays.

    Attributes:
        points: Local positions [stage units], shape (N, 3), float32.
        counts: Corners of each face [1], shape (F,), int32.
        indices: Point of each corner [1], shape (C,), int32.
        normals: Normal of each corner [1], shape (C, 3) or empty, float32.
        uvs: Texture coordinates [1] of each corner by primvar name, shape (C, 2), float32.
    """

    points: F32
    counts: I32
    indices: I32
    normals: F32
    uvs: dict[str, F32]


def is_body(prim: Usd.Prim) -> bool:
    """Check whether a prim is a mesh, or a solid of USD, which a mesh can replace.

    Args:
        prim: Any prim.
    """
    return prim.IsA(UsdGeom.Mesh) or prim.GetTypeName() in SHAPES


def read_surface(prim: Usd.Prim) -> Surface:
    """Read a mesh at its earliest time, or a solid as the mesh with which our renderer draws it.

    Args:
        prim: A Mesh, Cube, Sphere, Cylinder, Cone, Capsule or Plane.
    """
    mesh, time = UsdGeom.Mesh(prim), Usd.TimeCode.EarliestTime()
    if not mesh:
        shape = read_shape(prim, time)
        return Surface(
            shape.points.astype(np.float32),
            shape.face_counts.astype(np.int32),
            shape.corners.astype(np.int32),
            shape.normals.astype(np.float32),
            {"st": shape.st.astype(np.float32)},
        )
    points = np.array(mesh.GetPointsAttr().Get(time) or [], np.float32).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], np.int32)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], np.int32)
    primvars = UsdGeom.PrimvarsAPI(prim)
    own = primvars.GetPrimvar("normals")
    values = own.ComputeFlattened(time) if own and own.HasValue() else mesh.GetNormalsAttr().Get(time)
    spread = own.GetInterpolation() if own and own.HasValue() else mesh.GetNormalsInterpolation()
    normals = _corners(np.array(values or [], np.float32).reshape(-1, 3), spread, counts, indices)
    uvs = {}
    for name in UV_SETS:
        primvar = primvars.GetPrimvar(name)
        if primvar and primvar.HasValue():
            flat = np.array(primvar.ComputeFlattened(time), np.float32).reshape(-1, 2)
            uvs[name] = _corners(flat, primvar.GetInterpolation(), counts, indices)
    return Surface(points, counts, indices, normals, uvs)


def write_reshaped(layer: Sdf.Layer, path: Sdf.Path, before: Surface, after: Surface) -> bool:
    """Author the differences between two states of a mesh.

    Args:
        layer: Layer to write into.
        path: Path in the layer.
        before: The mesh in the scene.
        after: The mesh in the edited stage.

    Returns:
        Whether anything was written.
    """
    remade = not (np.array_equal(before.counts, after.counts) and np.array_equal(before.indices, after.indices))
    shifted = remade or _apart(before.points, after.points) > SHIFTED
    normals = after.normals if remade else _whole(before.normals, after.normals)
    bent = len(normals) > 0 and (remade or _apart(before.normals, normals) > BENT)
    slid = [
        name for name, uv in after.uvs.items() if remade or _apart(before.uvs.get(name, np.zeros((0, 2))), uv) > SLID
    ]
    if not (shifted or bent or slid):
        return False
    spec = Sdf.CreatePrimInLayer(layer, path)
    if shifted:
        write_points(spec, after.points)
    if remade:
        write_topology(spec, after)
    if bent:
        write_normals(spec, normals)
    for name in slid:
        write_uv(spec, name, after.uvs[name])
    return True


def write_points(spec: Sdf.PrimSpec, points: F32) -> None:
    """Author points and the extent that follows from them.

    Args:
        spec: Prim of a layer.
        points: Local positions [stage units], shape (N, 3), float32.
    """
    _array(spec, "points", Sdf.ValueTypeNames.Point3fArray, points)
    _array(spec, "extent", Sdf.ValueTypeNames.Float3Array, np.stack([points.min(axis=0), points.max(axis=0)]))


def write_topology(spec: Sdf.PrimSpec, surface: Surface) -> None:
    """Author the faces of a mesh.

    Args:
        spec: Prim of a layer.
        surface: The mesh.
    """
    for name, values in (("faceVertexCounts", surface.counts), ("faceVertexIndices", surface.indices)):
        attribute = Sdf.AttributeSpec(spec, name, Sdf.ValueTypeNames.IntArray)
        attribute.default = Vt.IntArray.FromNumpy(np.ascontiguousarray(values))


def write_normals(spec: Sdf.PrimSpec, normals: F32) -> None:
    """Author the normal of every corner.

    Args:
        spec: Prim of a layer.
        normals: Normals [1], shape (C, 3), float32.
    """
    attribute = _array(spec, "normals", Sdf.ValueTypeNames.Normal3fArray, normals)
    attribute.SetInfo("interpolation", UsdGeom.Tokens.faceVarying)


def write_uv(spec: Sdf.PrimSpec, name: str, values: F32) -> None:
    """Author texture coordinates as distinct values and an index for every corner.

    Args:
        spec: Prim of a layer.
        name: Primvar name.
        values: Coordinates [1] of each corner, shape (C, 2), float32.
    """
    distinct, indices = np.unique(values, axis=0, return_inverse=True)
    attribute = Sdf.AttributeSpec(spec, f"primvars:{name}", Sdf.ValueTypeNames.TexCoord2fArray)
    attribute.default = Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(distinct, np.float32))
    attribute.SetInfo("interpolation", UsdGeom.Tokens.faceVarying)
    corners = Sdf.AttributeSpec(spec, f"primvars:{name}:indices", Sdf.ValueTypeNames.IntArray)
    corners.default = Vt.IntArray.FromNumpy(np.ascontiguousarray(indices.reshape(-1), np.int32))


def _whole(before: F32, after: F32) -> F32:
    """Use the former normals where there are none: for slivers, Blender writes nearly zero."""
    if before.shape != after.shape:
        return after
    return np.where(np.linalg.norm(after, axis=1, keepdims=True) > 0.5, after, before)


def flat_normals(surface: Surface) -> F32:
    """Compute the normal of every face, for meshes without normals.

    Args:
        surface: The mesh.

    Returns:
        Normals [1] of the corners, shape (C, 3), float32.
    """
    face = np.repeat(np.arange(len(surface.counts)), surface.counts)
    here = surface.points[surface.indices].astype(np.float64)
    ends = np.cumsum(surface.counts)
    follower = np.arange(len(face)) + 1
    follower[ends - 1] = ends - surface.counts
    areas = np.zeros((len(surface.counts), 3))
    np.add.at(areas, face, np.cross(here, here[follower]))  # Newell: the fan about the origin sums to twice the area
    lengths = np.linalg.norm(areas, axis=1, keepdims=True)
    return np.where(lengths > 0, areas / np.maximum(lengths, 1e-30), [0.0, 0.0, 1.0]).astype(np.float32)[face]


def _array(spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, values: F32) -> Sdf.AttributeSpec:
    attribute = Sdf.AttributeSpec(spec, name, kind)
    attribute.default = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))
    return attribute


def _apart(before: NDArray[np.floating], after: NDArray[np.floating]) -> float:
    return float(np.abs(after - before).max(initial=0.0)) if before.shape == after.shape else np.inf


def _corners(values: F32, interpolation: str, counts: I32, indices: I32) -> F32:
    """Expand values of any interpolation to the corners."""
    match interpolation:
        case UsdGeom.Tokens.vertex | UsdGeom.Tokens.varying:
            return values[indices] if len(values) else values
        case UsdGeom.Tokens.uniform:
            return np.repeat(values, counts, axis=0)
        case UsdGeom.Tokens.constant:
            return np.repeat(values[:1], len(indices), axis=0)
        case _:
            return values
