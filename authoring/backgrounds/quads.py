"""Flat-faced town shapes as four-cornered faces: collected as arrays, then converted to meshes with `st` in meters."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from authoring.shapes.component import Mesh

F64 = NDArray[np.float64]

# Corners of each side of a box, counter-clockwise from outside, as choices of low (0) or high (1) for x, y and z.
_SIDES = {
    "x": ((0, 1, 0), (0, 0, 0), (0, 0, 1), (0, 1, 1)),
    "X": ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)),
    "y": ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)),
    "Y": ((1, 1, 0), (0, 1, 0), (0, 1, 1), (1, 1, 1)),
    "z": ((0, 1, 0), (1, 1, 0), (1, 0, 0), (0, 0, 0)),
    "Z": ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
}
WALLS = "xXyY"
ALL = "xXyYzZ"


def boxes(low: ArrayLike, high: ArrayLike, sides: str = ALL) -> F64:
    """Make the sides of upright boxes.

    Args:
        low: Lowest corner of each box [m], shape (N, 3) or (3,), float64.
        high: Highest corner of each box [m], the same shape (N, 3) or (3,), float64.
        sides: Sides wanted: small letters face along the negative axis, capitals along the positive one.

    Returns:
        Faces [m], shape (N * len(sides), 4, 3), float64.
    """
    ends = np.stack([np.atleast_2d(np.asarray(end, np.float64)) for end in (low, high)])
    picks = np.array([_SIDES[side] for side in sides])
    axes = np.arange(3)
    return ends[picks, :, axes].transpose(3, 0, 1, 2).reshape(-1, 4, 3)


def ring(inner: F64, outer: F64, levels: tuple[float, float], sides: str = "oud") -> F64:
    """Make a rectangular band round a block: its outer faces, upper side and underside, and faces towards the middle.

    Args:
        inner: Low x, high x, low y and high y of its inner edge [m], shape (4,), float64.
        outer: The same of its outer edge [m], shape (4,), float64.
        levels: Its foot and its top [m].
        sides: `o` outer faces, `u` upper side, `d` underside, `i` inner faces.

    Returns:
        Faces [m], shape (4 * len(sides), 4, 3), float64.
    """
    corners = [np.array([[e[0], e[2]], [e[1], e[2]], [e[1], e[3]], [e[0], e[3]]], np.float64) for e in (inner, outer)]
    foot, top = levels
    low_in, low_out = (np.column_stack([edge, np.full(4, foot)]) for edge in corners)
    high_in, high_out = (np.column_stack([edge, np.full(4, top)]) for edge in corners)
    quads = {
        "o": (low_out, np.roll(low_out, -1, 0), np.roll(high_out, -1, 0), high_out),
        "u": (high_out, np.roll(high_out, -1, 0), np.roll(high_in, -1, 0), high_in),
        "d": (low_in, np.roll(low_in, -1, 0), np.roll(low_out, -1, 0), low_out),
        "i": (np.roll(low_in, -1, 0), low_in, high_in, np.roll(high_in, -1, 0)),
    }
    return np.concatenate([np.stack(quads[side], axis=1) for side in sides])


def prism(outline: F64, low: float, high: float) -> F64:
    """Extrude an outline in x and z along y, as a vehicle's body.

    Args:
        outline: Convex corners x and z, counter-clockwise seen from low y [m], shape (P, 2), float64; P even.
        low: Its lower end [m].
        high: Its higher end [m].

    Returns:
        Faces of the mantle and of both ends [m], shape (F, 4, 3), float64.
    """
    count = len(outline)
    near = np.column_stack([outline[:, 0], np.full(count, low), outline[:, 1]])
    far = np.column_stack([outline[:, 0], np.full(count, high), outline[:, 1]])
    mantle = np.stack([near, far, np.roll(far, -1, 0), np.roll(near, -1, 0)], axis=1)
    fans = [[0, k, k + 1, k + 2] for k in range(1, count - 2, 2)]
    ends = [near[fan] for fan in fans] + [far[fan[::-1]] for fan in fans]
    return np.concatenate([mantle, np.stack(ends)])


def placed(faces: F64, spot: tuple[float, float, float], heading: float) -> F64:
    """Rotate local faces about z and translate them.

    Args:
        faces: Local faces [m], shape (F, 4, 3), float64.
        spot: World position of the local origin [m].
        heading: Direction of local x, counter-clockwise from +x [rad].

    Returns:
        World faces [m], shape (F, 4, 3), float64.
    """
    cosine, sine = np.cos(heading), np.sin(heading)
    turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return faces @ turn + np.asarray(spot)


def quad_mesh(faces: F64, shade: float | None = None) -> Mesh:
    """Convert faces to a mesh: flat normals, and `st` in meters along and up each face.

    Args:
        faces: Faces, counter-clockwise from outside [m], shape (F, 4, 3), float64.
        shade: A place on the palette [m] that every corner uses as its `st`, or None.

    Returns:
        The mesh; corners that several faces share are one vertex.
    """
    normal = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    flat = np.abs(normal[:, 2]) > 0.97
    along = np.stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))], axis=1)
    along = np.where(flat[:, None], [1.0, 0.0, 0.0], along)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    up = np.cross(normal, along)
    st = np.stack([np.einsum("fck,fk->fc", faces, along), np.einsum("fck,fk->fc", faces, up)], axis=-1)
    if shade is not None:
        st = np.full_like(st, shade)
    points, corners = np.unique(np.round(faces.reshape(-1, 3), 4), axis=0, return_inverse=True)
    return Mesh(
        points=points,
        face_counts=np.full(len(faces), 4, np.int32),
        corners=corners.reshape(-1).astype(np.int32),
        normals=np.repeat(normal, 4, axis=0).astype(np.float32),
        st=st.reshape(-1, 2).astype(np.float32),
    )
