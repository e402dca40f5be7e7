"""What a camera and SIFT make of a surface: plates of materials, photographed by the real renderer."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from authoring.looks.material import MaterialRecipe
from groundwork.progress import SILENT
from render.gpu.context import open_context
from render.settings import RenderSettings
from render.views.prepare import Prepared, prepare
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.flat_scene import Detail, Dome, Material, Sun, Texture
from usd_schemas.pinhole import Pinhole, look_at

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

CAMERA = Pinhole(480, 360, 853.0, 853.0, 240.0, 180.0)  # middle of a 1280 px wide picture of the default lens
PLATE = 40.0  # [m]
_APART = 100.0  # [m]
_CORNERS = np.array(
    [[[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0]], [[-0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]]
)
_MEAN = 0.20  # linear mean that the picture is exposed to
_FAR = 1e9
_PEAK = 0.012  # OpenCV's threshold for the `peak_threshold` of 0.004 that [recon.sparse] has: times three layers
_HALVED = 3.0  # [px], standard deviation of a Gaussian that halves waves of 16 px: hills and valleys of 8 px


@dataclass(frozen=True)
class Seen:
    """One view of a plate.

    Attributes:
        light: Linear luminance over its mean [1], shape (H, W), float32.
        gray: The picture as a camera codes it, shape (H, W), uint8.
        pose: camera_to_world, shape (4, 4), float64.
    """

    light: F32
    gray: U8
    pose: F64


def flat_material(folder: Path, recipe: MaterialRecipe) -> Material:
    """A recipe as the renderer gets it, without its macro texture."""
    scale = (1 / recipe.sheet, 1 / recipe.sheet)

    def texture(file: str, srgb: bool) -> Texture | None:
        return Texture(str((folder / file).resolve()), srgb, scale) if file else None

    detail = Detail(str((folder / recipe.detail_file).resolve()), recipe.periods, recipe.amplitudes)
    return Material(
        recipe.name,
        recipe.color,
        base_texture=texture(recipe.albedo_file, True),
        roughness=recipe.roughness,
        normal_texture=texture(recipe.normal_file, False),
        detail=detail,
    )


@contextmanager
def plates(materials: list[Material]) -> Iterator[Prepared]:
    """Level plates of 40 m, one for each material, in sun and sky."""
    builder = SceneBuilder(materials=materials)
    for row in range(len(materials)):
        st = _CORNERS[..., :2] * PLATE + 3.7  # meters
        builder.add_mesh(_CORNERS, placed((_APART * row, 0, 0), (PLATE, PLATE, 1.0)), row + 1, material=row, st=st)
    scene = builder.build(np.eye(4)[None], CAMERA)
    lit = replace(scene, dome=Dome((0.3, 0.3, 0.32)), sun=Sun((0.35, 0.45, 0.82), (3.0, 3.0, 3.0)))
    gl = open_context()
    settings = RenderSettings(quality="fast", shadow_size=512, haze_distance=_FAR)
    try:
        yield prepare(gl, lit, settings, SILENT)
    finally:
        gl.close()


def photograph(prepared: Prepared, plate: int, distance: float, slant: float, aside: float = 0.0) -> Seen:
    """One picture of the middle of a plate.

    Args:
        prepared: The plates.
        plate: Which.
        distance: From the camera to the middle [m].
        slant: Angle between the view and the plate's normal [deg].
        aside: How far the camera stands to the right of that place [m].
    """
    angle = np.radians(slant)
    target = np.array([_APART * plate + 1.3 + aside, 0.7, 0.0])
    eye = target + distance * np.array([0.0, -np.sin(angle), np.cos(angle)])
    pose = look_at(eye, target, np.array([0.0, 1.0, 0.0]))
    view = prepared.painter(CAMERA, sharp=True).draw(pose, 0.02)
    linear = (view.code.astype(np.float64) / 65535) ** 2 @ np.array([0.2126, 0.7152, 0.0722])
    mean = float(linear.mean())
    exposed = np.clip(linear / mean * _MEAN, 0, 1)
    coded = np.where(exposed <= 0.0031308, 12.92 * exposed, 1.055 * exposed ** (1 / 2.4) - 0.055)
    return Seen((linear / mean).astype(np.float32), np.round(255 * coded).astype(np.uint8), pose)


def contrast(seen: Seen) -> float:
    """RMS contrast of what is 1 to 8 pixels large [1]."""
    return float((seen.light - cv2.GaussianBlur(seen.light, (0, 0), _HALVED)).std())


def keypoints(seen: Seen) -> float:
    """SIFT keypoints a megapixel."""
    return len(cv2.SIFT.create(contrastThreshold=_PEAK).detect(seen.gray, None)) / seen.gray.size * 1e6


def right_matches(one: Seen, two: Seen) -> float:
    """Share of the matches between two pictures that hit the same place within 1.5 px; 0 without matches."""
    sift = cv2.SIFT.create(contrastThreshold=_PEAK)
    (points, words), (other_points, other_words) = (sift.detectAndCompute(seen.gray, None) for seen in (one, two))
    if words is None or other_words is None or len(other_words) < 2:
        return 0.0
    pairs = [pair for pair in cv2.BFMatcher(cv2.NORM_L2).knnMatch(words, other_words, k=2) if len(pair) == 2]
    kept = [best for best, second in pairs if best.distance < 0.8 * second.distance]
    if not kept:
        return 0.0
    here = np.array([points[match.queryIdx].pt for match in kept]) + 0.5
    there = np.array([other_points[match.trainIdx].pt for match in kept]) + 0.5
    rays = np.column_stack([(here - [CAMERA.cx, CAMERA.cy]) / CAMERA.fx, np.ones(len(here))]) @ one.pose[:3, :3].T
    place = one.pose[:3, 3] - rays * (one.pose[2, 3] / rays[:, 2])[:, None]
    local = (place - two.pose[:3, 3]) @ two.pose[:3, :3]
    seen = local[:, :2] / local[:, 2:] * CAMERA.fx + [CAMERA.cx, CAMERA.cy]
    return float((np.linalg.norm(seen - there, axis=1) < 1.5).mean())
