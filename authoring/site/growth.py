"""Small natural shapes around their own origin: pebbles, trunks, opaque cores of crowns."""

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.component import Mesh

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
OCTANTS = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
ICOSAHEDRON = (
    *(0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1, 8),
    *(3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1),
)


def pebble(rng: np.random.Generator, level: int = 1) -> Mesh:
    """Make a stone about 1 m wide, half sunk in the ground.

    Args:
        rng: Random stream.
        level: Level of subdivision, as in `icosphere`.

    Returns:
        A closed mesh.
    """
    points, faces = icosphere(level)
    points = _bulge(points, 0.22, rng) * np.array([0.5, rng.uniform(0.34, 0.48), rng.uniform(0.22, 0.36)])
    points[:, 2] += 0.08
    return faceted(points, faces)


def stem(height: float, radius: float, sides: int, rng: np.random.Generator) -> Mesh:
    """Make a tapered trunk or pole with a slight lean, closed at the top, its foot at height 0.

    Args:
        height: Height [m].
        radius: Radius a little above the foot [m].
        sides: Corners of its section.
        rng: Random stream.

    Returns:
        The mesh; its foot is open and must be in the ground.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    rings, lean = [], rng.uniform(-0.02, 0.02, 2) * height
    for share, width in ((0.0, 1.35), (0.12, 0.95), (1.0, 0.45)):
        ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)]) * radius * width
        rings.append(ring + np.array([*(lean * share), share * height]))
    points = np.vstack([*rings, [*lean, height]])
    ahead = np.arange(sides)
    behind = (ahead + 1) % sides
    faces = []
    for low in (0, sides):
        high = low + sides
        faces += [np.column_stack([low + ahead, low + behind, high + behind])]
        faces += [np.column_stack([low + ahead, high + behind, high + ahead])]
    faces.append(np.column_stack([2 * sides + ahead, 2 * sides + behind, np.full(sides, 3 * sides)]))
    return faceted(points, np.concatenate(faces), 0.9)


def icosphere(level: int) -> tuple[F64, I64]:
    """Divide an icosahedron.

    Args:
        level: Number of divisions of every triangle into four.

    Returns:
        Positions on the unit sphere [1], shape (V, 3), float64, and triangles seen counter-clockwise from outside,
        shape (T, 3), int64.
    """
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    plane = [[-1.0, golden], [1.0, golden], [-1.0, -golden], [1.0, -golden]]
    turns = ((0, 1, 2), (2, 0, 1), (1, 2, 0))
    points = np.concatenate([np.column_stack([plane, np.zeros(4)])[:, turn] for turn in turns])
    faces = np.array(ICOSAHEDRON).reshape(-1, 3)
    for _ in range(level):
        ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        edges, inverse = np.unique(ends, axis=0, return_inverse=True)
        ab, bc, ca = (len(points) + inverse.reshape(3, -1))[:3]
        points = np.vstack([points, points[edges].mean(axis=1)])
        a, b, c = faces.T
        corners = ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
        faces = np.concatenate([np.stack(corner, axis=1) for corner in corners])
    return points / np.linalg.norm(points, axis=1, keepdims=True), faces


def faceted(points: F64, faces: I64, smooth: float = 0.6) -> Mesh:
    """Convert a natural shape to a mesh: normals between flat and smooth, and box-projected `st` in meters.

    Args:
        points: Positions [m], shape (V, 3), float64.
        faces: Triangles, shape (T, 3), int64.
        smooth: Share of the smooth normal [1].

    Returns:
        The mesh.
    """
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    total = np.zeros_like(points)
    for vertex in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(faces[:, vertex], normal[:, axis], len(points))
    flat = np.repeat(normal / np.linalg.norm(normal, axis=1, keepdims=True), 3, axis=0)
    size = np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    round_normals = (total / size)[faces.reshape(-1)]
    mixed = smooth * round_normals + (1.0 - smooth) * flat
    plane = np.repeat(np.argmax(np.abs(normal), axis=1), 3)
    at = points[faces.reshape(-1)]
    st = np.where((plane == 0)[:, None], at[:, [1, 2]], np.where((plane == 1)[:, None], at[:, [0, 2]], at[:, [0, 1]]))
    return Mesh(
        points=points,
        face_counts=np.full(len(faces), 3, np.int32),
        corners=faces.reshape(-1).astype(np.int32),
        normals=(mixed / np.linalg.norm(mixed, axis=1, keepdims=True)).astype(np.float32),
        st=st.astype(np.float32),
    )


def _bulge(points: F64, amount: float, rng: np.random.Generator) -> F64:
    """Displace the points of a unit sphere radially with a few random waves."""
    ways = rng.normal(size=(7, 3))
    waves = np.sin(points @ (2.4 * ways.T) + rng.uniform(0.0, 2 * np.pi, 7)).sum(axis=1) / np.sqrt(7.0)
    return points * (1.0 + amount * (0.6 * waves + 0.4 * rng.uniform(-1, 1, len(points))))[:, None]
