"""Cut a height field along the borders of its covers: grass, banks, fills … meet along curves with shared vertices."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.shapes.component import Mesh
from authoring.site.grid import HeightField
from authoring.site.shape import Shape

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
CHUNK = 3000  # largest number of triangles of a piece of ground, so that renderers can skip pieces out of view
SNAP = 0.04  # a border this close to a vertex goes through the vertex [m]


@dataclass(frozen=True)
class Cover:
    """One kind of ground cover.

    Attributes:
        name: Name of the field that bounds it.
        prim: Leaf prim name of its piece.
        kind: Component kind.
        role: Material recipe.
    """

    name: str
    prim: str
    kind: str
    role: str


COVERS = (
    Cover("verge", "Verge", "ground", "gravel"),
    Cover("shoulder", "Shoulder", "ground", "gravel"),
    Cover("shore", "Shore", "riverbank", "gravel"),
    Cover("embankment", "Embankment", "embankment", "grass"),
    Cover("bank", "Riverbank", "riverbank", "soil"),
    Cover("worn", "UnderDeck", "ground", "soil"),
    Cover("ploughed", "Ploughed", "ground", "furrows"),
    Cover("crop", "Crop", "ground", "crop"),
    Cover("ripe", "RipeCrop", "ground", "ripe_crop"),
    Cover("hay", "Hay", "ground", "hay"),
    Cover("lot_asphalt", "Yard", "ground", "asphalt"),
    Cover("lot_paved", "PavedYard", "ground", "pavement"),
    Cover("lot_gravel", "GravelYard", "ground", "gravel"),
    Cover("patch", "TallGrass", "ground", "meadow"),
)
REMAINDER = Cover("", "Grass", "ground", "grass")


@dataclass(frozen=True)
class Soup:
    """Triangles that share vertices, each vertex a row of numbers.

    Attributes:
        rows: Station, left, height [m], normal (3), then one column for each cover, shape (V, 6 + C), float64.
        faces: Vertex numbers, shape (T, 3), int64.
        covers: The covers of the columns, the first in the list has priority.
        plan: World positions in plan [m], shape (V, 2), float64, if the axis is curved: cuts must be straight in the
            world, because a cut that is straight along a curved axis folds the remaining triangles. Else None.
    """

    rows: F64
    faces: I64
    covers: tuple[Cover, ...]
    plan: F64 | None = None


_COVER_NAMES = {cover.prim: cover.name for cover in COVERS}


def cover_name(piece: str) -> str:
    """Find the name of the cover that a piece of a site's ground belongs to; empty for the remaining grass.

    Args:
        piece: Name of its prim, such as `Site_Ploughed_Near0_2`.
    """
    return _COVER_NAMES.get(piece.split("_")[1], "")


def soup_of(
    nodes: F64,
    normals: F64,
    faces: I64,
    shape: Shape,
    covers: tuple[Cover, ...] = COVERS,
    axis: Alignment | None = None,
) -> Soup:
    """Collect ground triangles with their covers.

    Args:
        nodes: Station, left and world height of each node [m], shape (V, 3), float64.
        normals: Unit normals in bridge coordinates [1], shape (V, 3), float64.
        faces: Node numbers, shape (T, 3), int64.
        shape: The covers, each field holding V values.
        covers: Covers to look for, in order of priority.
        axis: Axis of the nodes, if it may be curved.

    Returns:
        The triangles.
    """
    present = tuple(cover for cover in covers if cover.name in shape.covers)
    values = [shape.covers[cover.name].reshape(-1, 1) for cover in present]
    columns = [np.where(np.abs(value) < SNAP, 0.0, value) for value in values]
    plan = None if axis is None or axis.curve is None else to_world(axis, nodes)[:, :2]
    return Soup(np.hstack([nodes, normals, *columns]), faces, present, plan)


def covered(soup: Soup) -> list[tuple[Cover, Soup]]:
    """Cut the ground into its covers.

    Args:
        soup: Triangles of the whole ground.

    Returns:
        Every cover that occurs, with its triangles; the rest comes last.
    """
    pieces: list[tuple[Cover, Soup]] = []
    for column, cover in enumerate(soup.covers):
        inside, soup, born = cut(soup, column)
        pieces = [
            (earlier, split_edges(replace(piece, rows=soup.rows, plan=soup.plan), born)) for earlier, piece in pieces
        ]
        if len(inside.faces):
            pieces.append((cover, inside))
    return [*pieces, (REMAINDER, soup)] if len(soup.faces) else pieces


def chunked(name: str, soup: Soup) -> list[tuple[str, Soup]]:
    """Divide a large stretch of ground into compact pieces, halving it along its longer side.

    Args:
        name: Leaf prim name of the whole.
        soup: Its triangles.

    Returns:
        Name and triangles of each piece; the whole under its own name if it is small.
    """
    middle = soup.rows[soup.faces, :2].mean(axis=1)
    done, waiting = [], [np.arange(len(soup.faces))]
    while waiting:
        rows = waiting.pop()
        if len(rows) <= CHUNK:
            done.append(rows)
            continue
        axis = int(np.argmax(np.ptp(middle[rows], axis=0)))
        order = rows[np.argsort(middle[rows, axis], kind="stable")]
        waiting += [np.sort(order[len(order) // 2 :]), np.sort(order[: len(order) // 2])]
    if len(done) == 1:
        return [(name, soup)]
    return [(f"{name}_{number}", replace(soup, faces=soup.faces[rows])) for number, rows in enumerate(done)]


def cut(soup: Soup, column: int) -> tuple[Soup, Soup, I64]:
    """Cut triangles where a cover's field is zero.

    Args:
        soup: Triangles.
        column: Number of the cover.

    Returns:
        The part inside the cover (positive), the part outside, and of each new vertex the two ends of its edge and its
        own number, shape (N, 3), int64: the first two rising.
    """
    value = soup.rows[:, 6 + column]
    sign = np.sign(value)[soup.faces]
    above, below = (sign > 0).any(axis=1), (sign < 0).any(axis=1)
    crossing = above & below
    whole = soup.rows if soup.plan is None else np.hstack([soup.rows, soup.plan])
    rows, plus, minus, born = _split(whole, soup.faces[crossing], value, soup.rows.shape[1])
    plan = None if soup.plan is None else rows[:, soup.rows.shape[1] :]
    rows = rows[:, : soup.rows.shape[1]]
    inside = np.concatenate([soup.faces[above & ~below], plus])
    outside = np.concatenate([soup.faces[~above], minus])
    return Soup(rows, inside, soup.covers, plan), Soup(rows, outside, soup.covers, plan), born


def split_edges(soup: Soup, born: I64) -> Soup:
    """Give triangles the vertices that cuts of their neighbors put on shared edges: without them, light shines through.

    Args:
        soup: Triangles with all vertices.
        born: Both ends of an edge, rising, and the vertex on it, shape (N, 3), int64, sorted by the ends.

    Returns:
        The same surface, its triangles halved where an edge has such a vertex.
    """
    faces, done = soup.faces, []
    scale = len(soup.rows)
    keys = born[:, 0] * scale + born[:, 1]
    while len(faces) and len(keys):
        ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
        wanted = ends[..., 0] * scale + ends[..., 1]
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        hit = keys[place] == wanted
        some = hit.any(axis=1)
        done.append(faces[~some])
        which = np.argmax(hit[some], axis=1)
        row = np.arange(len(which))
        a, b, c = (faces[some][row, (which + step) % 3] for step in range(3))
        middle = born[place[some][row, which], 2]
        faces = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return replace(soup, faces=np.concatenate([*done, faces]))


def drape(soup: Soup, alignment: Alignment, atlas: F64) -> Mesh:
    """Convert triangles to a mesh in world space; `st` counts meters along the axis and to its left.

    Args:
        soup: Triangles.
        alignment: Axis of the bridge.
        atlas: `st1` at each corner of each triangle [1], shape (3 * T, 2), float64.

    Returns:
        The mesh.
    """
    used, corners = np.unique(soup.faces, return_inverse=True)
    rows = soup.rows[used]
    corners = corners.reshape(-1)
    bent = None if soup.plan is None else np.column_stack([soup.plan[used], rows[:, 2]])
    return Mesh(
        points=to_world(alignment, rows[:, :3]) if bent is None else bent,
        face_counts=np.full(len(soup.faces), 3, np.int32),
        corners=corners.astype(np.int32),
        normals=turn(alignment, rows[corners, :3], _unit(rows[corners, 3:6])).astype(np.float32),
        st=rows[corners, :2].astype(np.float32),
        st1=atlas.astype(np.float32),
    )


def strip_atlas(soup: Soup, field: HeightField) -> F64:
    """Map a strip to 0 to 1 along and across its axis.

    Args:
        soup: Triangles of the strip.
        field: The strip.

    Returns:
        `st1` at each corner of each triangle [1], shape (3 * T, 2), float64.
    """
    low = np.array([field.stations[0], field.lefts[0]])
    size = np.array([field.stations[-1], field.lefts[-1]]) - low
    return (soup.rows[soup.faces.reshape(-1), :2] - low) / size


def to_world(alignment: Alignment, points: F64) -> F64:
    """Convert bridge coordinates with world heights to world positions.

    Args:
        alignment: Axis of the bridge.
        points: Station, left and world height [m], shape (N, 3), float64.

    Returns:
        World positions [m], shape (N, 3), float64.
    """
    world = alignment.point(points[:, 0], points[:, 1], np.zeros(len(points)))
    world[:, 2] = points[:, 2]
    return world


def turn(alignment: Alignment, points: F64, normals: F64) -> F64:
    """Rotate the normals of a surface from bridge coordinates to world axes.

    Args:
        alignment: Axis of the bridge.
        points: Station, left and height of their positions [m], shape (N, 3), float64.
        normals: Unit normals in bridge coordinates [1], shape (N, 3), float64.

    Returns:
        Unit normals [1], shape (N, 3), float64.
    """
    x, y, z = normals.T
    if alignment.square:
        cosine, sine = np.cos(alignment.heading), np.sin(alignment.heading)
        return np.stack([x * cosine - y * sine, x * sine + y * cosine, z], axis=1)
    (ahead_x, ahead_y), (aside_x, aside_y) = (slope.T for slope in alignment.slopes(points[:, 0], points[:, 1]))
    area = ahead_x * aside_y - ahead_y * aside_x
    return _unit(np.stack([(x * aside_y - y * ahead_y) / area, (y * ahead_x - x * aside_x) / area, z], axis=1))


def _unit(vectors: F64) -> F64:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _split(rows: F64, faces: I64, value: F64, fields: int) -> tuple[F64, I64, I64, I64]:
    """Split triangles that have corners on both sides; new vertices are shared by the two triangles of an edge.

    The last result holds the new vertices, as `cut` returns them.

    Columns 6 up to `fields` are those of covers.
    """
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    crossed = value[ends[:, 0]] * value[ends[:, 1]] < 0
    upward = value[ends[:, 0]] > 0
    pairs = np.where(upward[:, None], ends, ends[:, ::-1])  # from inside to outside, for either direction
    unique, inverse = np.unique(pairs[crossed], axis=0, return_inverse=True)
    share = value[unique[:, 0]] / (value[unique[:, 0]] - value[unique[:, 1]]) if len(unique) else np.zeros(0)
    born = rows[unique[:, 0]] + share[:, None] * (rows[unique[:, 1]] - rows[unique[:, 0]])
    born[:, 6:fields][np.abs(born[:, 6:fields]) < SNAP] = 0.0
    middle = np.full(len(ends), -1, np.int64)
    middle[crossed] = len(rows) + inverse.reshape(-1)
    middle = middle.reshape(-1, 3)
    plus: list[I64] = []
    minus: list[I64] = []
    for turn_by in range(3):
        a, b, c = (np.roll(faces, -turn_by, axis=1)[:, i] for i in range(3))
        ab, _, ca = (np.roll(middle, -turn_by, axis=1)[:, i] for i in range(3))
        lone = (ab >= 0) & (ca >= 0)  # the first corner is the only one on its side
        pair = (ab >= 0) & (value[c] == 0)  # the border leaves through the third corner
        for chosen, tip, rest in (
            (lone, [[a, ab, ca]], [[ab, b, c], [ab, c, ca]]),
            (pair, [[a, ab, c]], [[ab, b, c]]),
        ):
            for side, wanted in ((plus, True), (minus, False)):
                near = chosen & ((value[a] > 0) == wanted)
                far = chosen & ((value[a] > 0) != wanted)
                side.extend(np.stack(tri, axis=1)[near] for tri in tip)
                side.extend(np.stack(tri, axis=1)[far] for tri in rest)
    numbered = np.column_stack([np.sort(unique, axis=1), len(rows) + np.arange(len(unique))]).astype(np.int64)
    numbered = numbered[np.lexsort((numbered[:, 1], numbered[:, 0]))]
    return np.vstack([rows, born]), np.concatenate(plus), np.concatenate(minus), numbered
