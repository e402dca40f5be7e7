"""A small textured world of three planes, photographed without the renderer, as a capture on disk.

Each plane carries band-limited noise and is ray cast exactly, so that structure from motion runs for real, and every
true depth, label and distance is known in closed form.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray

from groundwork.canonical import canonical_json
from groundwork.progress import SILENT, Progress
from recon.reconstruct import reconstruct
from recon.settings import ReconSettings, SparseSettings
from tests.made_once import made_once
from usd_schemas.components import class_of, class_rows
from usd_schemas.pinhole import Pinhole, look_at, unproject

F64 = NDArray[np.float64]
CAMERA = Pinhole(320, 240, 280.0, 280.0, 160.0, 120.0)  # pixels are what each step costs
TEXELS = 768


@dataclass(frozen=True)
class Plane:
    """One textured rectangle: corner + a * along + b * across, a and b in 0 to 1 [m], each shape (3,), float64."""

    id: int
    component: str
    corner: F64
    along: F64
    across: F64


PLANES = (
    Plane(11, "ground", np.array([-8.0, -1.0, 0.0]), np.array([16.0, 0.0, 0.0]), np.array([0.0, 9.0, 0.0])),
    Plane(12, "abutment_wall", np.array([-5.0, 5.0, 0.0]), np.array([10.0, 0.0, 0.0]), np.array([0.0, 0.0, 4.0])),
    Plane(13, "parapet", np.array([-3.0, 3.0, 0.0]), np.array([3.0, 0.5, 0.0]), np.array([0.0, 0.0, 1.6])),
)


def poses_on_arc(count: int) -> F64:
    """Place cameras on a gentle arc before the wall: camera_to_world, shape (N, 4, 4), float64."""
    where = np.linspace(-3.0, 3.0, count)
    eyes = [np.array([x, -4.0 - 0.08 * x * x, 2.0 + 0.8 * np.sin(1.7 * x)]) for x in where]
    return np.stack([look_at(eye, np.array([0.5 * eye[0], 4.5, 1.5])) for eye in eyes])


def noise_texture(rng: np.random.Generator) -> NDArray[np.float32]:
    """Mix band-limited noise over four octaves: gray values 0 to 255, shape (TEXELS, TEXELS), float32."""
    total = np.zeros((TEXELS, TEXELS), np.float32)
    for sigma in (1.6, 3.2, 6.4, 12.8):
        octave = cv2.GaussianBlur(rng.normal(size=(TEXELS, TEXELS)).astype(np.float32), (0, 0), sigma)
        total += octave / octave.std()
    return np.clip(128 + 28 * total, 0, 255).astype(np.float32)


def see(camera: Pinhole, pose: F64, textures: list[NDArray[np.float32]]) -> tuple[NDArray[np.float32], F64, F64]:
    """Ray cast all planes: gray image (H, W), planar depth [m] (H, W), and instance id (H, W)."""
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64)
    eye = pose[:3, 3]
    rays = unproject(pixels, np.ones(len(pixels)), camera, pose) - eye
    depth, ids, gray = np.full(len(pixels), np.inf), np.zeros(len(pixels)), np.full(len(pixels), 225.0, np.float32)
    for plane, texture in zip(PLANES, textures, strict=True):
        normal = np.cross(plane.along, plane.across)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (plane.corner - eye) @ normal / (rays @ normal)
            hit = eye + rays * t[:, None] - plane.corner
            a, b = hit @ plane.along / (plane.along @ plane.along), hit @ plane.across / (plane.across @ plane.across)
            seen = (t > 0) & (t < depth) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)
        scale = TEXELS / np.linalg.norm(plane.along)
        x, y = (
            (v[seen] * np.linalg.norm(axis) * scale - 0.5).astype(np.float32)[None]
            for v, axis in ((a, plane.along), (b, plane.across))
        )
        gray[seen] = np.concatenate(
            [
                cv2.remap(texture, x[:, i : i + 30_000], y[:, i : i + 30_000], cv2.INTER_LINEAR, None, cv2.BORDER_WRAP)[
                    0
                ]
                for i in range(0, seen.sum(), 30_000)
            ]
        )
        depth[seen], ids[seen] = t[seen], plane.id
    shape = (camera.height, camera.width)
    return gray.reshape(shape), depth.reshape(shape), ids.reshape(shape)


def write_capture(folder: Path, poses: F64, seed: int = 1, textured: bool = True, camera: Pinhole = CAMERA) -> Path:
    """Photograph the planes from each pose and write a capture with truth."""
    rng = np.random.default_rng(seed)
    textures = [noise_texture(rng) if textured else np.full((TEXELS, TEXELS), 128, np.float32) for _ in PLANES]
    for name in ("images", "truth/depth", "truth/semantic", "truth/instance"):
        (folder / name).mkdir(parents=True)
    label_of_id = np.zeros(64, np.uint8)
    ids_of_class = {row.name: row.id for row in class_rows()}
    for plane in PLANES:
        label_of_id[plane.id] = ids_of_class[class_of(plane.component)]
    names = [f"{i:06d}" for i in range(len(poses))]
    for name, pose in zip(names, poses, strict=True):
        gray, depth, ids = see(camera, pose, textures)
        noisy = np.clip(gray + rng.normal(0, 1.5, gray.shape), 0, 255).astype(np.uint8)
        cv2.imwrite(
            str(folder / f"images/{name}.jpg"), cv2.merge([noisy, noisy, noisy]), [cv2.IMWRITE_JPEG_QUALITY, 95]
        )
        cv2.imwrite(str(folder / f"truth/depth/{name}.tiff"), depth.astype(np.float32))
        cv2.imwrite(str(folder / f"truth/instance/{name}.png"), ids.astype(np.uint16))
        cv2.imwrite(str(folder / f"truth/semantic/{name}.png"), label_of_id[ids.astype(int)])
    gps = poses[:, :3, 3] + rng.normal(0, 0.3, (len(poses), 3))
    write_cameras(folder, names, gps, camera)
    stated = [{"name": n, "camera_to_world": p.tolist()} for n, p in zip(names, poses, strict=True)]
    write(folder / "truth/poses.json", {"pinhole": camera.__dict__, "poses": stated})
    write_surface(folder, label_of_id)
    return folder


def write_cameras(folder: Path, names: list[str], gps: F64, camera: Pinhole) -> None:
    """State images, their fixes [m], shape (N, 3), and what is known of the camera."""
    write(
        folder / "cameras.json",
        {
            "format": "falsework.capture",
            "format_version": 1,
            "survey": "planes",
            "size": [camera.width, camera.height],
            "prior": {"model": "SIMPLE_RADIAL", "focal_px": camera.fx * 1.007, "cx": camera.cx, "cy": camera.cy},
            "gps_sigma": [0.3, 0.3, 0.3],
            "facts": {"kind": "local"},
            "images": [
                {"name": n, "file": f"images/{n}.jpg", "gps": g.tolist(), "time": None}
                for n, g in zip(names, gps, strict=True)
            ],
        },
    )


def write_surface(folder: Path, label_of_id: NDArray[np.uint8]) -> None:
    """Write the planes as instances, with their class by id, shape (64,), and as triangles."""
    write(
        folder / "truth/instances.json",
        {
            "classes": [{"id": row.id, "name": row.name, "color": list(row.color)} for row in class_rows()],
            "instances": [
                {
                    "id": p.id,
                    "path": f"/World/P{p.id}",
                    "component": p.component,
                    "class": class_of(p.component),
                    "parameters": {},
                }
                for p in PLANES
            ],
        },
    )
    count = len(PLANES)
    corners = [[p.corner, p.corner + p.along, p.corner + p.along + p.across, p.corner + p.across] for p in PLANES]
    np.savez(
        folder / "truth/surface.npz",
        positions=np.array(corners, np.float32).reshape(-1, 3),
        triangles=np.concatenate(
            [[[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]] for i in range(count)]
        ).astype(np.uint32),
        part_first=np.arange(count, dtype=np.int32) * 2,
        part_count=np.full(count, 2, np.int32),
        draw_part=np.arange(count, dtype=np.int32),
        draw_transform=np.tile(np.eye(4), (count, 1, 1)),
        draw_instance=np.array([p.id for p in PLANES], np.uint32),
        draw_label=label_of_id[[p.id for p in PLANES]],
    )


def in_larger_pixels(model: Path, folder: Path, camera: Pinhole) -> Path:
    """Write a COLMAP model of photographs by `CAMERA` as that of photographs by a larger camera of the same lens."""
    found = pycolmap.Reconstruction(model)
    for each in found.cameras.values():
        each.rescale(camera.width, camera.height)
    for point in (point for image in found.images.values() for point in image.points2D):
        point.xy *= camera.fx / CAMERA.fx
    found.write_binary(folder)
    return folder


def write(path: Path, value: object) -> None:
    """Write JSON."""
    path.write_text(json.dumps(value), encoding="utf-8")


@contextmanager
def in_this_process() -> Iterator[None]:
    """Let the steps of a reconstruction run here: the start of a child takes a second, and other tests wait for it."""
    threads, level = cv2.getNumThreads(), pycolmap.logging.minloglevel
    with pytest.MonkeyPatch.context() as patch:
        for module in ("recon.sfm.sparse", "recon.sfm.matching", "recon.dense.dense"):
            patch.setattr(import_module(module), "run_child", serve_here)
        count_no_rows(patch)
        yield
    cv2.setNumThreads(threads)
    pycolmap.logging.minloglevel = level


def count_no_rows(patch: pytest.MonkeyPatch) -> None:
    """Keep away from databases that COLMAP writes in this process.

    Python and COLMAP have an SQLite each, and locks on a file belong to the process: when one of the two closes it, the
    locks of the other end. Then a journal is deleted under it, and the process ends with a bus error.
    """
    patch.setattr("recon.sfm.sparse.count_rows", lambda *_: 0)
    patch.setattr("recon.sfm.matching._begun", lambda *_: 0)


def serve_here(module: str, request: dict[str, Any], *, progress: Progress = SILENT, **_limits: object) -> Any:
    """Do what a child would do, with the same JSON to and fro."""
    return json.loads(canonical_json(import_module(module).serve(json.loads(canonical_json(request)), progress)))


@pytest.fixture
def no_children() -> Iterator[None]:
    """Let the steps of a reconstruction run in this process."""
    with in_this_process():
        yield


@pytest.fixture(scope="session")
def plane_capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a capture of the three planes from ten cameras; read only."""
    return write_capture(tmp_path_factory.mktemp("planes") / "capture", poses_on_arc(10))


@pytest.fixture(scope="session")
def plane_settings() -> ReconSettings:
    """Give settings with which the planes are reconstructed in seconds."""
    return ReconSettings(mode="sparse", sparse=SparseSettings(max_features=1000))


@pytest.fixture(scope="session")
def plane_cloud(
    plane_capture: Path, plane_settings: ReconSettings, tmp_path_factory: pytest.TempPathFactory, worker_id: str
) -> Path:
    """Give the cloud of the planes; read only, and made by the first process that needs it."""

    def make(out: Path) -> None:
        out.mkdir(exist_ok=True)
        with in_this_process():
            reconstruct(plane_capture, out, plane_settings, SILENT)

    return made_once(tmp_path_factory, worker_id, "plane-cloud", make)


@pytest.fixture(scope="session")
def make_capture() -> Callable[..., Path]:
    """Give `write_capture(folder, poses, seed, textured)`."""
    return write_capture


@pytest.fixture(scope="session")
def arc() -> Callable[[int], F64]:
    """Give `poses_on_arc(count)`."""
    return poses_on_arc
