"""The output of generators: a closed mesh with its component kind, material role and instance id."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]

FIRST_BRIDGE_ID = 1
FIRST_SITE_ID = 40_000
FIRST_BACKGROUND_ID = 45_000
FIRST_EDIT_ID = 60_000  # first id of objects added by users: above those of bridges, sites and backgrounds
LAST_ID = 65_535  # so that instance images need 16 bits


@dataclass(frozen=True)
class Mesh:
    """A polygon mesh with values on its face corners.

    Attributes:
        points: Positions [m], shape (V, 3), float64.
        face_counts: Corners of each face, shape (F,), int32.
        corners: Vertex number of each face corner, counter-clockwise from outside, shape (C,), int32.
        normals: Unit normal at each corner [1], shape (C, 3), float32.
        st: First UV set [m], u along the member, v round its section, shape (C, 2), float32.
        st1: Second UV set, a 0 to 1 atlas without overlap [1], shape (C, 2), float32, or shape (0, 2) for none.
    """

    points: F64
    face_counts: I32
    corners: I32
    normals: F32
    st: F32
    st1: F32 = field(default_factory=lambda: np.zeros((0, 2), np.float32))


@dataclass(frozen=True)
class Component:
    """One labeled part of a bridge, site or background.

    Attributes:
        name: Leaf prim name, unique in the stage, e.g. `Girder_000_02`.
        kind: Component kind, a row of the component table.
        role: Material role (`Role_…`) on a bridge, material recipe (`grass`, `brick` …) elsewhere.
        group: Name of its parent Xform, e.g. `Superstructure`.
        mesh: Its surface, in world space.
        instance_id: Instance id, over 0, unique in the stage.
        parameters: Dimensions and other JSON facts.
        double_sided: Back faces are visible (sheets such as foliage only; solids are closed).
    """

    name: str
    kind: str
    role: str
    group: str
    mesh: Mesh
    instance_id: int
    parameters: dict[str, object] = field(default_factory=dict)
    double_sided: bool = False


@dataclass(frozen=True)
class Scatter:
    """Many small repeats of a few meshes: native instances or a PointInstancer.

    Attributes:
        name: Leaf prim name, unique in the stage.
        kind: Component kind of every repeat.
        group: Name of its parent Xform.
        prototypes: Meshes around their own origin; each is a tuple of (material recipe or role, mesh) pieces.
        prototype: Prototype of each repeat, shape (N,), int32.
        positions: Origin of each repeat [m], shape (N, 3), float64.
        yaw: Rotation of each repeat about z [rad], shape (N,), float64.
        scales: Size of each repeat [1], shape (N, 3), float64.
        instance_ids: One id for each repeat, or a single id for the run.
    """

    name: str
    kind: str
    group: str
    prototypes: tuple[tuple[tuple[str, Mesh], ...], ...]
    prototype: I32
    positions: F64
    yaw: F64
    scales: F64
    instance_ids: tuple[int, ...]


def triangles(mesh: Mesh) -> I32:
    """Split every face into a fan of triangles; faces must be convex.

    Args:
        mesh: Polygon mesh.

    Returns:
        Vertex numbers, shape (T, 3), int32.
    """
    starts = np.cumsum(mesh.face_counts) - mesh.face_counts
    fans = mesh.face_counts - 2
    face = np.repeat(np.arange(len(fans)), fans)
    step = np.arange(len(face)) - np.repeat(np.cumsum(fans) - fans, fans)
    first = starts[face]
    return mesh.corners[np.stack([first, first + step + 1, first + step + 2], axis=1)].astype(np.int32)


def triangle_corners(components: tuple[Component, ...]) -> tuple[F64, I32]:
    """Collect the triangles of several components.

    Args:
        components: Components in world space.

    Returns:
        Corner positions [m], shape (T, 3, 3), float64, and the instance id of each triangle, shape (T,), int32.
    """
    corners, ids = [np.zeros((0, 3, 3))], [np.zeros(0, np.int32)]
    for component in components:
        faces = triangles(component.mesh)
        corners.append(component.mesh.points[faces])
        ids.append(np.full(len(faces), component.instance_id, np.int32))
    return np.concatenate(corners), np.concatenate(ids)
