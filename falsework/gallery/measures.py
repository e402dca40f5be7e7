"""Measures of visible faults in a picture of a background."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from render.gpu.camera import visible_boxes
from render.gpu.gpu_scene import draw_boxes
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole

B8 = NDArray[np.bool_]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]

THINGS: dict[str, tuple[str, ...]] = {
    "ground": ("ground", "embankment", "riverbank", "rock"),
    "water": ("water",),
    "road": ("road",),
    "railway": ("rail_bed",),
    "building": ("building", "roof", "window"),
    "tree": ("tree",),
    "shrub": ("shrub", "vegetation"),
    "vehicle": ("vehicle",),
    "vessel": ("vessel",),
    "pole": ("pole", "lamp_post", "traffic_sign"),
    "fence": ("fence", "wall_retaining"),
}
_BLOCK = 24  # [px] side of the patches that must have structure
_DEAD = 0.6  # [of 255] standard deviation of luminance
_EARTH = 6.371e6  # [m] radius
_SEEN = 1e-4  # least share of a picture for a kind of thing to count
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class Measures:
    """Measures of one picture.

    Attributes:
        sky_below: Number of downward rays that hit nothing.
        flat_patches: Share of the patches of 24 x 24 px without structure, sky excluded [1].
        luminance: Median code outside the sky [of 255].
        things: Visible kinds of background things.
        triangles: Number of triangles that the renderer draws.
    """

    sky_below: int
    flat_patches: float
    luminance: float
    things: tuple[str, ...]
    triangles: int


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture with its truth.

    Attributes:
        image: Photograph, shape (H, W, 3), uint8.
        depth: Planar depth [m], +inf for sky, shape (H, W), float32.
        instance: Instance ids, shape (H, W), uint32.
        pose: camera_to_world [m], shape (4, 4), float64.
        camera: Intrinsics.
    """

    image: U8
    depth: F32
    instance: U32
    pose: F64
    camera: Pinhole


def measure_picture(picture: Picture, kinds: dict[int, str], ground: float) -> Measures:
    """Measure one picture, except its triangles.

    Args:
        picture: The picture.
        kinds: Component of each instance of the background.
        ground: Lowest height of the land or water near by [m].
    """
    image, depth, instance, pose = picture.image, picture.depth, picture.instance, picture.pose
    sky = ~np.isfinite(depth)
    code = image.astype(np.float64) @ _LUMINANCE
    ids, counts = np.unique(instance, return_counts=True)
    pixels = dict.fromkeys(THINGS, 0)
    for number, count in zip(ids.tolist(), counts.tolist(), strict=True):
        for thing, members in THINGS.items():
            pixels[thing] += count * (kinds.get(number, "") in members)
    things = tuple(thing for thing, count in pixels.items() if count >= _SEEN * image.shape[0] * image.shape[1])
    down = _downward(picture.camera, pose) > horizon_dip(float(pose[2, 3] - ground))
    return Measures(int((sky & down).sum()), dead_share(code, sky), float(np.median(code[~sky])), things, 0)


def dead_share(code: F64, sky: B8) -> float:
    """Compute the share of patches without structure among those without sky.

    Args:
        code: Luminance [of 255], shape (H, W), float64.
        sky: Where there is sky, shape (H, W), bool.

    Returns:
        Share of the patches [1]; 0 if all contain sky.
    """
    high, wide = (size // _BLOCK for size in code.shape)
    if not high or not wide:
        return 0.0
    blocks = code[: high * _BLOCK, : wide * _BLOCK].reshape(high, _BLOCK, wide, _BLOCK)
    free = ~sky[: high * _BLOCK, : wide * _BLOCK].reshape(high, _BLOCK, wide, _BLOCK).any(axis=(1, 3))
    return float((blocks.std(axis=(1, 3))[free] < _DEAD).mean()) if free.any() else 0.0


def horizon_dip(height: float) -> float:
    """Compute the dip of the horizon of the round earth as seen from a height [m]: rays above it see sky [1].

    Args:
        height: Of the eye over the land [m].
    """
    return float(np.sqrt(2.0 * max(height, 1.0) / _EARTH))


def visible_triangles(scene: FlatScene, camera: Pinhole, poses: F64) -> NDArray[np.int64]:
    """Count the triangles that the renderer draws for each picture: those of every draw whose box is in the frustum.

    Args:
        scene: The scene.
        camera: Intrinsics.
        poses: camera_to_world [m], shape (N, 4, 4), float64.

    Returns:
        Counts, shape (N,), int64.
    """
    lower, upper = draw_boxes(scene)
    size = scene.geometry.part_count[scene.draws.part].astype(np.int64)
    return np.array([int(size[visible_boxes(lower, upper, camera, pose)].sum()) for pose in poses])


def _downward(camera: Pinhole, pose: F64) -> F64:
    """Compute the downward component of each pixel's unit ray [1], shape (H, W)."""
    column, row = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    rays = np.stack([(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy, np.ones_like(row)], axis=-1)
    return -(rays @ pose[:3, :3].T)[..., 2] / np.linalg.norm(rays, axis=-1)
