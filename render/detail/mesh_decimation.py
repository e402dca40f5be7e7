"""Decimation of small meshes by edge collapse with quadric error metrics.

Source: Garland and Heckbert, Surface simplification using quadric error metrics, SIGGRAPH 1997; in each round, edges
that do not touch are collapsed together.

Our own implementation, because Open3D's `simplify_quadric_decimation` drops texture coordinates (stated by version
0.20), which our levels keep at the corners. On a wavy sheet of 1152 triangles ours had a smaller error at each of the
twelve levels from 805 to 14 triangles, 0.060 m instead of 0.133 m at 14. Also, the bytes of captures would depend
on Open3D's version.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from render.detail.leaf_cards import cards_of, fewer_cards, single_sheets
from render.detail.soup import Soup

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_AT_ONCE = 0.2  # share of the triangles that one round removes
_STEP = 0.7  # ratio of the number of triangles of a level to that of the level before
_RIM = 4.0  # weight of the planes that keep an open edge in place
_HOLD = 1e-3  # [1] weight of the middle of an edge for its new vertex, which flat ground does not determine
_CLOSEST, _MOST_CLOSE = 8, 128  # nearest triangles tried: at first, and for points far from these
_FAR = 0.7  # of the greatest distance


def coarser_levels(soup: Soup) -> Iterator[Soup]:
    """Make successively coarser levels with 0.7 of the triangles of the one before: down to two, or a few cards.

    Cards of two sheets that are lit alike are first replaced by cards of one.

    Args:
        soup: Triangles; corners at the same position count as connected.

    Yields:
        The next level; nothing is computed ahead.
    """
    card = cards_of(soup)
    if len(card):
        single = single_sheets(soup, card)
        if single is not None:
            soup, card = single
            yield soup
        yield from fewer_cards(soup, card)
        return
    places, rows = np.unique(soup.corners.reshape(-1, 3), axis=0, return_inverse=True)
    mesh = _Mesh(places, rows.reshape(-1, 3).astype(np.int64), np.arange(len(soup)))
    quadrics = _quadrics(mesh)
    goal = int(_STEP * len(soup))
    while goal >= 2:
        found = _collapse(mesh, quadrics, max(1, min(int(_AT_ONCE * len(mesh.triangles)), len(mesh.triangles) - goal)))
        if len(found.triangles) == len(mesh.triangles):
            return
        mesh = found
        if len(mesh.triangles) <= goal:
            if len(mesh.triangles) < 2:
                return
            yield _dressed(soup, mesh)
            goal = int(_STEP * len(mesh.triangles))


def deviation(one: Soup, other: Soup) -> float:
    """Bound the two-sided distance of two surfaces from above, at corners, midpoints of edges and centers of triangles.

    Args:
        one: Triangles.
        other: Triangles.

    Returns:
        Greatest distance [stage units]; not less than the true distance of any of these points.
    """
    return max(_farthest(one.corners, other.corners), _farthest(other.corners, one.corners))


@dataclass(frozen=True)
class _Mesh:
    """Positions, shape (P, 3); their rows by triangle, shape (T, 3); each triangle's row in the soup, shape (T,)."""

    places: F64
    triangles: I64
    origin: I64


def _quadrics(mesh: _Mesh) -> F64:
    """Sum of squared distances from the planes around each position, as a form of (x, y, z, 1), shape (P, 4, 4)."""
    corners = mesh.places[mesh.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(area, 1e-30)[:, None]
    result = np.zeros((len(mesh.places), 4, 4))
    for corner in range(3):
        np.add.at(result, mesh.triangles[:, corner], _planes(unit, corners[:, corner], area))
    low_high = np.sort(np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    _, row, count = np.unique(low_high, axis=0, return_inverse=True, return_counts=True)
    rim = np.flatnonzero(count[row.ravel()] == 1)
    triangle = rim // 3
    along = mesh.places[low_high[rim, 1]] - mesh.places[low_high[rim, 0]]
    across = np.cross(along, unit[triangle])
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-30)[:, None]
    wall = _planes(across, mesh.places[low_high[rim, 0]], _RIM * np.einsum("ij,ij->i", along, along))
    for end in range(2):
        np.add.at(result, low_high[rim, end], wall)
    return result


def _planes(unit: F64, point: F64, weight: F64) -> F64:
    plane = np.concatenate([unit, -np.einsum("ij,ij->i", unit, point)[:, None]], axis=1)
    return weight[:, None, None] * plane[:, :, None] * plane[:, None, :]


def _collapse(mesh: _Mesh, quadrics: F64, fewer: int) -> _Mesh:
    """Collapse the edges of lowest cost that do not touch, removing about `fewer` triangles; adds to `quadrics`."""
    ends = np.sort(np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    place, cost = _targets(mesh.places, edges, quadrics)
    places, joined = mesh.places.copy(), np.arange(len(mesh.places))
    taken: set[int] = set()
    for row in np.lexsort((np.arange(len(edges)), cost)).tolist():
        keep, drop = edges[row].tolist()
        if keep in taken or drop in taken:
            continue
        taken |= {keep, drop}
        places[keep], joined[drop] = place[row], keep
        quadrics[keep] += quadrics[drop]
        fewer -= int(count[row])
        if fewer <= 0:
            break
    triangles = joined[mesh.triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    _, single = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)  # one side of a folded pair is enough
    kept = np.intersect1d(np.flatnonzero(whole), single)
    return _Mesh(places, triangles[kept], mesh.origin[kept])


def _targets(places: F64, edges: I64, quadrics: F64) -> tuple[F64, F64]:
    """Compute the best position of each collapsed edge, shape (E, 3), and its cost, shape (E,)."""
    total = quadrics[edges[:, 0]] + quadrics[edges[:, 1]]
    middle = (places[edges[:, 0]] + places[edges[:, 1]]) / 2
    hold = _HOLD * np.trace(total[:, :3, :3], axis1=1, axis2=2) + 1e-30
    form = total[:, :3, :3] + hold[:, None, None] * np.eye(3)
    place = np.linalg.solve(form, (hold[:, None] * middle - total[:, :3, 3])[..., None])[..., 0]
    point = np.concatenate([place, np.ones((len(place), 1))], axis=1)
    cost = np.einsum("ei,eij,ej->e", point, total, point)
    apart = np.linalg.norm(places[edges[:, 0]] - places[edges[:, 1]], axis=1)
    return place, np.maximum(cost, 0.0) + 1e-6 * hold * apart**2  # of edges without cost, short ones first


def _dressed(soup: Soup, mesh: _Mesh) -> Soup:
    """Assign the former attributes to the corners of triangles; normals of flat ones are rotated with them."""
    corners, old = mesh.places[mesh.triangles], soup.corners[mesh.origin]
    normals = soup.normals[mesh.origin].copy()
    before, after = (np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (old, corners))
    flat = (np.abs(normals - normals[:, :1]).max(axis=(1, 2)) < 1e-3) & (np.linalg.norm(after, axis=1) > 0)
    side = np.where(np.einsum("ij,ij->i", before, normals[:, 0]) < 0, -1.0, 1.0)
    turned = (side / np.maximum(np.linalg.norm(after, axis=1), 1e-30))[:, None] * after
    normals[flat] = turned[flat, None]
    return replace(soup, corners=corners, normals=normals, carried=soup.carried[mesh.origin])


def _farthest(source: F64, target: F64) -> float:
    """Compute the greatest distance of points of triangles from the nearest other triangles."""
    middles = (source + np.roll(source, -1, axis=1)) / 2
    points = np.unique(np.concatenate([source.reshape(-1, 3), middles.reshape(-1, 3), source.mean(axis=1)]), axis=0)
    tree, most = KDTree(target.mean(axis=1)), min(_MOST_CLOSE, len(target))
    least, settled = np.empty(len(points)), np.zeros(len(points), bool)
    rows, count = np.arange(len(points)), min(_CLOSEST, most)
    while True:  # more triangles, only for points that are far from all so far
        near = tree.query(points[rows], count)[1].reshape(len(rows), count)
        least[rows] = _distances(points[rows, None], target[near]).min(axis=1)
        settled[rows] = count == most
        if settled[np.argmax(least)]:
            return float(least.max())
        rows, count = np.flatnonzero(~settled & (least > _FAR * least.max())), most


def _distances(point: F64, corners: F64) -> F64:
    """Distance of points, shape (N, 1, 3), from triangles, shape (N, K, 3, 3)."""
    normal = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    length = np.linalg.norm(normal, axis=-1)
    unit = normal / np.maximum(length, 1e-30)[..., None]
    above = np.einsum("nki,nki->nk", point - corners[..., 0, :], unit)
    inside, least = length > 0, np.full(above.shape, np.inf)
    for corner in range(3):
        start, along = corners[..., corner, :], corners[..., (corner + 1) % 3, :] - corners[..., corner, :]
        away = point - start
        inside &= np.einsum("nki,nki->nk", np.cross(along, away), unit) >= 0
        share = np.einsum("nki,nki->nk", away, along) / np.maximum(np.einsum("nki,nki->nk", along, along), 1e-30)
        least = np.minimum(least, np.linalg.norm(away - np.clip(share, 0, 1)[..., None] * along, axis=-1))
    return np.where(inside, np.abs(above), least)
