"""One mesh or native gprim of a stage as triangles with values on welded vertices."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from usd_schemas.reading.shapes import SHAPES, read_shape
from usd_schemas.reading.strands import STRANDS, read_strands
from usd_schemas.reading.subdivision import Cage, refine, smooth_normals
from usd_schemas.reading.traversal import EARLIEST, UnreadableMeshError, numbers_of, table_of
from usd_schemas.triangulate import cross, face_normals, triangulate

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

PLAIN_ST = "st"
ATLAS_ST = "st1"
_SMOOTH = ("catmullClark", "loop")
_MOST_CORNERS = 4_000_000  # of a refined mesh
_FARTHEST = 1e15  # [stage units]; farther points give areas that overflow in single precision
_SHORT = 1e-12  # a normal of this length or less has no direction [1]
_UV_TYPES = ("texCoord2f[]", "texCoord2d[]", "texCoord2h[]")
_UV_LIKE = (*_UV_TYPES, "float2[]", "double2[]", "half2[]")


@dataclass(frozen=True)
class FlatMesh:
    """One mesh in its own space.

    Attributes:
        positions: Positions [stage units], shape (V, 3), float32.
        normals: Unit normals [1], shape (V, 3), float32.
        st: First UV set [1], shape (V, 2), float32.
        st1: Second UV set [1], shape (V, 2), float32.
        colors: Linear displayColor [1], shape (V, 3), float32.
        triangles: Vertex numbers, counter-clockwise from outside, shape (T, 3), int64.
        face: Face of each triangle, shape (T,), int64.
        double_sided: Back faces are visible.
        colored: displayColor is authored.
        notes: What could not be read as authored.
    """

    positions: F32
    normals: F32
    st: F32
    st1: F32
    colors: F32
    triangles: I64
    face: I64
    double_sided: bool
    colored: bool
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Values:
    """Values at face corners: `data[index]`, shapes (K, W) and (C,)."""

    data: F64
    index: I64


@dataclass(frozen=True)
class _Faces:
    """Topology: `owner` is the face of each corner, shape (C,); `lost` are faces with invalid points."""

    points: F64
    counts: I64
    corners: I64
    owner: I64
    lost: tuple[int, ...] = ()


def read_mesh(
    prim: Usd.Prim,
    uv_names: tuple[str, str],
    time: Usd.TimeCode = EARLIEST,
    level: int = 1,
    color_name: str = "displayColor",
) -> FlatMesh:
    """Read a mesh, a native gprim, curves or points.

    Args:
        prim: A Mesh, or a gprim of a type in `SHAPES` or `STRANDS`.
        uv_names: Primvars that the bound material reads as first and second UV set; either may be empty.
        time: Time code at which it is read.
        level: How many times a subdivision surface is refined.
        color_name: Primvar of its colors.

    Raises:
        UnreadableMeshError: Points or face arrays are wrong.
    """
    notes: list[str] = []
    faces, normals, (st, st1, colors) = _read_values(prim, uv_names, color_name, time, notes)
    level = 0 if faces.lost else level
    left_handed = UsdGeom.Gprim(prim).GetOrientationAttr().Get(EARLIEST) == UsdGeom.Tokens.leftHanded
    cage, parent = faces, np.arange(len(faces.counts))
    if normals is None and level and prim.IsA(UsdGeom.Mesh) and _scheme(prim) == UsdGeom.Tokens.catmullClark:
        faces, parent, (st, st1, colors), normals = _refined(prim, faces, (st, st1, colors), left_handed, level, notes)
    elif prim.IsA(UsdGeom.Mesh) and _scheme(prim) == UsdGeom.Tokens.loop:
        notes.append("a Loop subdivision surface is drawn as its control mesh")
    normals = _complete_normals(prim, normals, faces, left_handed)
    triangles, face = triangulate(faces.points, faces.counts, faces.corners)
    face = parent[face]
    corner = faces.points[faces.corners[triangles]]
    area = cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    solid = np.any(area != 0.0, axis=1) & ~_holes(prim, cage, face, time) & ~np.isin(face, cage.lost)
    triangles, face = triangles[solid], face[solid]
    nothing = np.zeros((1, 2)), np.zeros(len(faces.corners), np.int64)
    white = _Values(np.ones((1, 3)), nothing[1])
    uv = [values or _Values(*nothing) for values in (st, st1)]
    vertex, (points, normal, first, second, color) = _weld(faces, [normals, *uv, colors or white])
    return FlatMesh(
        points,
        normal,
        first,
        second,
        color,
        vertex[triangles[:, ::-1] if left_handed else triangles],
        face,
        bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get(EARLIEST)),
        colors is not None,
        tuple(notes),
    )


def _read_values(
    prim: Usd.Prim, uv_names: tuple[str, str], color_name: str, time: Usd.TimeCode, notes: list[str]
) -> tuple[_Faces, _Values | None, tuple[_Values | None, _Values | None, _Values | None]]:
    """Read the topology as authored; normals, both UV sets and colors where there are any."""
    if prim.GetTypeName() in STRANDS:
        strands = read_strands(prim, time, color_name, notes)
        faces = _Faces(strands.points, strands.counts, strands.corners, _owners(strands.counts))
        colors = None if strands.colors is None else _Values(strands.colors, strands.corners)
        return faces, _Values(strands.normals, strands.corners), (None, None, colors)
    if prim.GetTypeName() in SHAPES:
        with np.errstate(invalid="ignore"):
            shape = read_shape(prim, time)
        if not _is_near(shape.points).all():
            raise UnreadableMeshError("its size is not finite")
        faces = _Faces(shape.points, shape.face_counts, shape.corners, _owners(shape.face_counts))
        number = np.arange(len(shape.corners))
        normals, st, st1 = _Values(shape.normals, number), _Values(shape.st, number), None
    else:
        faces = _read_faces(UsdGeom.Mesh(prim), time)
        normals = _read_normals(UsdGeom.Mesh(prim), faces, time, notes)
        st, st1 = (_read_primvar(prim, name, faces, 2, time, notes) for name in choose_uv(prim, uv_names))
        if faces.lost:
            notes.append(f"points that are not finite: {len(faces.lost)} of {len(faces.counts)} faces are left out")
    return faces, normals, (st, st1, _read_primvar(prim, color_name, faces, 3, time, notes))


def _refined(
    prim: Usd.Prim, faces: _Faces, values: tuple[_Values | None, ...], left_handed: bool, level: int, notes: list[str]
) -> tuple[_Faces, I64, tuple[_Values | None, ...], _Values]:
    """Refine a subdivision surface: its faces, the control face of each, the values at corners, and normals."""
    while level and len(faces.corners) * 4 ** (level - 1) > _MOST_CORNERS:
        level -= 1
    if not level:
        notes.append("a subdivision surface is drawn as its control mesh, which is fine enough")
    if UsdGeom.Mesh(prim).GetInterpolateBoundaryAttr().Get(EARLIEST) == UsdGeom.Tokens.none and _is_open(faces):
        notes.append("interpolateBoundary none is read as edgeAndCorner: the faces at its boundary are drawn")
    told = [None if one is None else one.data[one.index] for one in values]
    cage, refined = _cage(prim, faces), [one for one in told if one is not None]
    for _ in range(level):
        cage, refined = refine(cage, refined)
    finer = _Faces(cage.points, cage.counts, cage.corners, _owners(cage.counts))
    areas = face_normals(finer.points, finer.counts, finer.corners) * (-1.0 if left_handed else 1.0)
    total, group = smooth_normals(cage, areas)
    fresh = iter(refined)
    number = np.arange(len(cage.corners))
    spread = tuple(None if one is None else _Values(next(fresh), number) for one in told)
    return finer, cage.parent, spread, _Values(_unit(total), group)


def _is_open(faces: _Faces) -> bool:
    """Tell whether an edge has only one face."""
    number, first = np.arange(len(faces.corners)), np.repeat(np.cumsum(faces.counts) - faces.counts, faces.counts)
    ahead = first + (number - first + 1) % np.repeat(faces.counts, faces.counts)
    ends = np.sort(np.stack([faces.corners, faces.corners[ahead]], axis=1), axis=1)
    return bool((np.unique(ends, axis=0, return_counts=True)[1] == 1).any())


def _cage(prim: Usd.Prim, faces: _Faces) -> Cage:
    mesh, count = UsdGeom.Mesh(prim), len(faces.points)

    def whole(attribute: Usd.Attribute) -> I64:
        found = numbers_of(attribute.Get(EARLIEST))
        return np.zeros(0, np.int64) if found is None else found

    def decimal(attribute: Usd.Attribute) -> F64:
        return np.array(attribute.Get(EARLIEST) or [], np.float64).reshape(-1)

    lengths, along = whole(mesh.GetCreaseLengthsAttr()), whole(mesh.GetCreaseIndicesAttr())
    sharp, edges = decimal(mesh.GetCreaseSharpnessesAttr()), np.maximum(lengths - 1, 0)
    by_edge = len(sharp) == edges.sum() and len(sharp) != len(lengths)  # one value for each edge, not for each crease
    pairs, strengths, place, edge = [], [], 0, 0
    for number, (length, steps) in enumerate(zip(lengths.tolist(), edges.tolist(), strict=True)):
        chain = along[place : place + length]
        own = sharp[edge : edge + steps] if by_edge else sharp[number : number + 1]
        place, edge = place + length, edge + steps
        if steps and len(chain) == length and chain.min() >= 0 and chain.max() < count and len(own):
            pairs.append(np.sort(np.stack([chain[:-1], chain[1:]], axis=1), axis=1))
            strengths.append(np.broadcast_to(own, steps))
    corner, corner_sharp = whole(mesh.GetCornerIndicesAttr()), decimal(mesh.GetCornerSharpnessesAttr())
    fixed = np.zeros(count)
    if len(corner) == len(corner_sharp) and len(corner) and 0 <= corner.min() <= corner.max() < count:
        fixed[corner] = corner_sharp
    return Cage(
        faces.points,
        faces.counts,
        faces.corners,
        np.concatenate([np.zeros((0, 2), np.int64), *pairs]),
        np.concatenate([np.zeros(0), *strengths]),
        fixed,
        mesh.GetInterpolateBoundaryAttr().Get(EARLIEST) != UsdGeom.Tokens.edgeOnly,
        np.arange(len(faces.counts)),
    )


def choose_uv(prim: Usd.Prim, uv_names: tuple[str, str]) -> tuple[str, str]:
    """Decide which primvars are the two UV sets of a mesh.

    Args:
        prim: The mesh.
        uv_names: Primvars that the bound material reads; either may be empty.

    Returns:
        Names of the first and second set: what the material reads, else `st` and `st1`; for the first set, else the
        first texture coordinates found; empty for none.
    """
    api = UsdGeom.PrimvarsAPI(prim)
    known = {str(p.GetPrimvarName()): str(p.GetTypeName()) for p in api.GetPrimvarsWithValues()}
    known = {name: kind for name, kind in known.items() if kind in _UV_LIKE}
    others = [name for name in sorted(known) if name != ATLAS_ST and known[name] in _UV_TYPES]
    first = next((name for name in (uv_names[0], PLAIN_ST, *others) if name in known), "")
    second = next((name for name in (uv_names[1], ATLAS_ST) if name in known), "")
    return first, second


def _read_faces(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> _Faces:
    points = table_of(mesh.GetPointsAttr().Get(time), 3)
    counts = numbers_of(mesh.GetFaceVertexCountsAttr().Get(time))
    corners = numbers_of(mesh.GetFaceVertexIndicesAttr().Get(time))
    if points is None or counts is None or corners is None:
        name = "points" if points is None else "faceVertexCounts" if counts is None else "faceVertexIndices"
        raise UnreadableMeshError(f"its {name} have a wrong type")
    if np.any(counts < 0) or counts.sum() != len(corners):
        raise UnreadableMeshError("faceVertexCounts and faceVertexIndices do not fit together")
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        raise UnreadableMeshError("faceVertexIndices name points that do not exist")
    owner, bad = _owners(counts), ~_is_near(points)
    lost = np.unique(owner[bad[corners]]).tolist() if len(corners) else []
    if bad.any() and len(lost) == np.count_nonzero(counts):
        raise UnreadableMeshError("its points are not finite")
    points[bad] = points[~bad].mean(axis=0) if bad.any() else 0.0
    return _Faces(points, counts, corners, owner, tuple(lost))


def _is_near(points: F64) -> NDArray[np.bool_]:
    return np.max(np.abs(points), axis=1, initial=0.0) < _FARTHEST  # False for NaN


def _owners(counts: I64) -> I64:
    return np.repeat(np.arange(len(counts)), counts)


def _read_normals(mesh: UsdGeom.Mesh, faces: _Faces, time: Usd.TimeCode, notes: list[str]) -> _Values | None:
    # primvars:normals has priority where both are authored, as specified for UsdGeomPointBased.
    found = _read_primvar(mesh.GetPrim(), "normals", faces, 3, time, notes)
    attribute = mesh.GetNormalsAttr()
    if found is not None or not attribute.HasAuthoredValue():
        return found
    values = table_of(attribute.Get(time), 3)
    if values is None:
        notes.append("normals have a wrong type: ignored")
        return None
    return _on_corners("normals", values, None, str(mesh.GetNormalsInterpolation()), faces, notes)


def _read_primvar(
    prim: Usd.Prim, name: str, faces: _Faces, width: int, time: Usd.TimeCode, notes: list[str]
) -> _Values | None:
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name) if name else None
    if not primvar or not primvar.HasValue():
        return None
    value = primvar.Get(time)
    data = table_of([value] if _is_row(value, width) else value, width)
    indices = numbers_of(primvar.GetIndices(time)) if primvar.IsIndexed() else None
    if data is None or not len(data) or (primvar.IsIndexed() and indices is None):
        notes.append(f"primvars:{name} is empty or has a wrong type: ignored")
        return None
    return _on_corners(f"primvars:{name}", data, indices, str(primvar.GetInterpolation()), faces, notes)


def _is_row(value: object, width: int) -> bool:
    """Tell whether a value is one row, which some programs write instead of an array of one row."""
    return np.shape(value) == (width,) and not isinstance(value, str)  # pyright: ignore[reportCallIssue, reportArgumentType]


def _on_corners(
    name: str, data: F64, index: I64 | None, interpolation: str, faces: _Faces, notes: list[str]
) -> _Values | None:
    """Convert values of any interpolation to values at face corners; None where sizes do not fit."""
    corner = {
        UsdGeom.Tokens.constant: np.zeros(len(faces.corners), np.int64),
        UsdGeom.Tokens.uniform: faces.owner,
        UsdGeom.Tokens.vertex: faces.corners,
        UsdGeom.Tokens.varying: faces.corners,
        UsdGeom.Tokens.faceVarying: np.arange(len(faces.corners)),
    }.get(interpolation)
    rows = len(data) if index is None else len(index)
    if corner is None:
        notes.append(f"{name} has an unknown interpolation: ignored")
        return None
    if (len(corner) and corner.max() >= rows) or (
        index is not None and len(index) and (index.min() < 0 or index.max() >= len(data))
    ):
        notes.append(f"{name} has too few values for interpolation {interpolation}: ignored")
        return None
    if not np.isfinite(data).all():
        notes.append(f"{name} is not finite: ignored")
        return None
    return _Values(data, corner if index is None else index[corner])


def _complete_normals(prim: Usd.Prim, normals: _Values | None, faces: _Faces, left_handed: bool) -> _Values:
    """Compute normals where there are none: flat for polygons, smooth for subdivision cages; replace zero normals."""
    if normals is not None and np.einsum("ki,ki->k", normals.data, normals.data).min(initial=1.0) > _SHORT**2:
        return _Values(_unit(normals.data), normals.index)
    areas = face_normals(faces.points, faces.counts, faces.corners) * (-1.0 if left_handed else 1.0)
    if normals is None and prim.IsA(UsdGeom.Mesh) and _scheme(prim) in _SMOOTH:
        total = [np.bincount(faces.corners, areas[faces.owner, axis], len(faces.points)) for axis in range(3)]
        return _Values(_unit(np.array(total, np.float64).T), faces.corners)
    if normals is None:
        return _Values(_unit(areas), faces.owner)
    short = np.linalg.norm(normals.data, axis=1) <= _SHORT
    index = np.where(short[normals.index], len(normals.data) + faces.owner, normals.index)
    return _Values(_unit(np.concatenate([normals.data, areas])), index)


def _unit(vectors: F64) -> F64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.tile([0.0, 0.0, 1.0], (len(vectors), 1)), where=length > 0)


def _scheme(prim: Usd.Prim) -> str:
    return str(UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr().Get(EARLIEST))


def _holes(prim: Usd.Prim, faces: _Faces, face: I64, time: Usd.TimeCode) -> NDArray[np.bool_]:
    """Mark the triangles of faces that are holes of a subdivision surface."""
    numbers = numbers_of(UsdGeom.Mesh(prim).GetHoleIndicesAttr().Get(time)) if prim.IsA(UsdGeom.Mesh) else None
    if numbers is None or not len(numbers) or _scheme(prim) == UsdGeom.Tokens.none:
        return np.zeros(len(face), bool)
    open_faces = np.zeros(len(faces.counts), bool)
    open_faces[numbers[(numbers >= 0) & (numbers < len(open_faces))]] = True
    return open_faces[face]


def _weld(faces: _Faces, values: list[_Values]) -> tuple[I64, list[F32]]:
    """Merge corners with the same point and equal values into one vertex.

    Returns:
        Vertex of each corner, shape (C,), and the arrays of the vertices: points, then each of the values.
    """
    key = faces.corners
    for value in values:
        if len(value.data) > 1 and not np.array_equal(value.index, faces.corners):
            key = _ranks(key * len(value.data) + _ranks_of_rows(value.data)[value.index])
    _, representative, vertex = np.unique(key, return_index=True, return_inverse=True)
    points = faces.points[faces.corners[representative]]
    arrays = [points, *(value.data[value.index[representative]] for value in values)]
    return vertex, [np.ascontiguousarray(array, np.float32) for array in arrays]


def _ranks(keys: NDArray[np.generic]) -> I64:
    return np.unique(keys, return_inverse=True)[1]


def _ranks_of_rows(data: F64) -> I64:
    """Number the rows of a table, shape (K, W), W over 1, so that equal rows, as float32, have equal numbers."""
    plain = np.ascontiguousarray(data, np.float32) + np.float32(0.0)  # -0.0 is 0.0
    ranks = _ranks(np.ascontiguousarray(plain[:, :2]).view(np.int64)[:, 0])
    return ranks if plain.shape[1] == 2 else _ranks(ranks * len(plain) + _ranks(plain[:, 2]))
