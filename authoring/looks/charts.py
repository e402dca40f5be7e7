"""The point of the bridge at each texel of the `st1` atlas."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.looks.noise import I32, Floats
from authoring.shapes.component import Component, triangles

_SUBTEXEL = 4  # bits behind the point in the rasteriser's coordinates


@dataclass(frozen=True)
class Charts:
    """Triangles of many components in an atlas.

    Attributes:
        triangle: Number of the triangle at each texel, -1 outside all charts, shape (pixels, pixels), int32.
        owner: Number of the component of each triangle, shape (T,), int32.
        normal: Unit normal of each triangle, world axes [1], shape (T, 3), float32.
        place: World position at the atlas corner (0, 0) in texels, extrapolated from the triangle [m], shape (T, 3).
        across: Change of the position by texel to the right [m], shape (T, 3), float32.
        down: Change of the position by texel downwards [m], shape (T, 3), float32.
    """

    triangle: I32
    owner: I32
    normal: Floats
    place: Floats
    across: Floats
    down: Floats


def draw_charts(components: list[Component], pixels: int) -> Charts:
    """Rasterise the atlas of some components.

    Args:
        components: Components with `st1`.
        pixels: Texels along a side of the atlas.
    """
    uv, points, normals, owner = _gather(components)
    texel = np.stack([uv[..., 0] * pixels, (1 - uv[..., 1]) * pixels], axis=-1)
    one, two = texel[:, 1] - texel[:, 0], texel[:, 2] - texel[:, 0]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    kept = np.abs(area) > 1e-6
    texel, points, normals, owner, area = texel[kept], points[kept], normals[kept], owner[kept], area[kept]
    one, two = one[kept], two[kept]
    first, second = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    across = (first * two[:, 1:] - second * one[:, 1:]) / area[:, None]
    down = (second * one[:, :1] - first * two[:, :1]) / area[:, None]
    place = points[:, 0] - across * texel[:, 0, :1] - down * texel[:, 0, 1:]
    return Charts(
        _fill(texel, pixels),
        owner,
        normals.astype(np.float32),
        place.astype(np.float32),
        across.astype(np.float32),
        down.astype(np.float32),
    )


def spread(image: Floats, covered: NDArray[np.bool_]) -> Floats:
    """Fill the gaps between charts with the nearest value, so that filters do not mix in other values.

    Args:
        image: Values [any unit], shape (H, W, 3), float32.
        covered: Texels that hold a value, shape (H, W), bool.

    Returns:
        The image, all of its texels filled [any unit], shape (H, W, 3), float32.
    """
    import cv2

    if covered.all() or not covered.any():
        return image
    gaps = (~covered).astype(np.uint8)
    found = cv2.distanceTransformWithLabels(gaps, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
    label = np.asarray(found[1], np.int32)
    nearest = np.zeros(int(label.max()) + 1, np.int64)
    nearest[label[covered]] = np.flatnonzero(covered)
    filled, texels = image.reshape(-1, 3).copy(), np.flatnonzero(gaps)
    filled[texels] = filled[nearest[label.ravel()[texels]]]
    return filled.reshape(image.shape)


def _gather(components: list[Component]) -> tuple[np.ndarray, np.ndarray, np.ndarray, I32]:
    uv, points, normals, owner = (
        [np.zeros((0, 3, 2))],
        [np.zeros((0, 3, 3))],
        [np.zeros((0, 3))],
        [np.zeros(0, np.int32)],
    )
    for number, component in enumerate(components):
        mesh = component.mesh
        corner = triangles(replace(mesh, corners=np.arange(len(mesh.corners), dtype=np.int32)))
        uv.append(mesh.st1[corner].astype(np.float64))
        points.append(mesh.points[mesh.corners[corner]])
        normals.append(mesh.normals[corner].astype(np.float64).sum(axis=1))
        owner.append(np.full(len(corner), number, np.int32))
    normal = np.concatenate(normals)
    length = np.sqrt(np.maximum((normal * normal).sum(axis=1, keepdims=True), 1e-12))
    return np.concatenate(uv), np.concatenate(points), normal / length, np.concatenate(owner)


def _fill(texel: np.ndarray, pixels: int) -> I32:
    import cv2

    image = np.zeros((pixels, pixels), np.int32)
    corners = np.round((texel - 0.5) * (1 << _SUBTEXEL)).astype(np.int32)
    for number, corner in enumerate(corners):
        cv2.fillConvexPoly(image, corner, number + 1, cv2.LINE_8, _SUBTEXEL)
    return image - 1
