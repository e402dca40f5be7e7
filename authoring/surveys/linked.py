"""Prediction of the images of a flight that a reconstruction will link, from their common surfaces."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from authoring.surveys.framing import Eye
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]

COLUMNS, ROWS = 24, 18  # rays of an image
NEIGHBORS = 12  # nearest images that each is compared with, besides the next ones in the order of flight
AHEAD = 4
TURNED = 30.0  # [deg], largest angle at which features of a surface are still recognized
# Shares of an image's surfaces that a partner must see alike [1]. How much a mapper needs depends on the texture, which
# is not known yet: the prediction is the mean over these. Both they and the number of partners are fitted to
# docs/benchmarks/registration.md.
SHARED = (0.1, 0.2, 0.3)
SCALED = 2.0  # largest ratio of two distances to a surface
PARTNERS = 3  # fewest partners of a registered image
LEAST_SEEN = 0.25  # least share of an image with a surface instead of sky [1]
FARTHEST = 150.0  # [m] up to which surfaces have features for matching


def linked_share(poses: F64, eye: Eye, obstacles: RayScene) -> tuple[float, float]:
    """Predict the share of a flight's images that a reconstruction registers in one model.

    Args:
        poses: camera_to_world in the order of flight [m], shape (N, 4, 4), float64.
        eye: The camera.
        obstacles: Bridge and site.

    Returns:
        Mean overlap of each image with the next [1], and the predicted share of registered images [1].
    """
    count = len(poses)
    seen = [_seen(pose, eye, obstacles) for pose in poses]
    useful = np.array([len(points) >= LEAST_SEEN * COLUMNS * ROWS for points in seen])
    pairs, alike, following = _pairs(poses[:, :3, 3]), [], np.zeros(max(count - 1, 1))
    for first, second in pairs:
        overlap, forth = _shared(seen[first], poses[first], poses[second], eye, obstacles)
        _, back = _shared(seen[second], poses[second], poses[first], eye, obstacles)
        if second == first + 1:
            following[first] = overlap
        alike.append(min(forth, back) if useful[first] and useful[second] else 0.0)
    links = [np.array(pairs)[np.array(alike) >= share] for share in SHARED] if pairs else []
    return float(following.mean()), float(np.mean([_hanging_together(link, count) for link in links] or [0.0]))


def _hanging_together(links: NDArray[np.int64], count: int) -> float:
    """Find the share of images with enough partners in the largest connected part [1]."""
    graph = sparse.coo_matrix((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    degree = np.asarray((graph + graph.T).sum(axis=0)).ravel()
    _, part = connected_components(graph, directed=False)
    return float(np.bincount(part, weights=degree >= min(PARTNERS, count - 1)).max() / count)


def _pairs(centers: F64) -> list[tuple[int, int]]:
    count = len(centers)
    _, near = KDTree(centers).query(centers, k=min(NEIGHBORS + 1, count))
    rows = np.asarray(near).reshape(count, -1)
    pairs = {(min(i, int(j)), max(i, int(j))) for i in range(count) for j in rows[i] if i != j}
    pairs |= {(i, i + k) for k in range(1, AHEAD + 1) for i in range(count - k)}
    return sorted(pairs)


def _seen(pose: F64, eye: Eye, obstacles: RayScene) -> F64:
    """Cast the rays of an image: the surfaces that it sees [m], shape (M, 3), float64."""
    x = (np.arange(COLUMNS) + 0.5) / COLUMNS * eye.camera.width
    y = (np.arange(ROWS) + 0.5) / ROWS * eye.camera.height
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    directions = eye.rays(pixels) @ pose[:3, :3].T
    reach, _, _ = obstacles.cast(np.broadcast_to(pose[:3, 3], directions.shape), directions)
    near = reach < FARTHEST
    return pose[:3, 3] + directions[near] * reach[near, None]


def _shared(points: F64, own: F64, other: F64, eye: Eye, obstacles: RayScene) -> tuple[float, float]:
    """Find the share of an image's surfaces that another image sees, and of those similar enough to match."""
    if not len(points):
        return 0.0, 0.0
    framed = points[eye.framed(points, other)]
    here, there = own[:3, 3] - framed, other[:3, 3] - framed
    reach, _, _ = obstacles.cast(np.broadcast_to(other[:3, 3], there.shape), -there)
    here, there = here[reach > 0.99], there[reach > 0.99]
    near, far = np.linalg.norm(here, axis=1), np.linalg.norm(there, axis=1)
    turned = np.degrees(np.arccos(np.clip(np.sum(here * there, axis=1) / np.maximum(near * far, 1e-12), -1.0, 1.0)))
    known = (turned <= TURNED) & (near < SCALED * far) & (far < SCALED * near)
    return len(here) / len(points), float(known.sum()) / len(points)
