"""Compose the picture of docs/sampling.md: one bridge as five clouds, by color and by class, from above and below.

Usage: python -m docs.sampling_picture demo-out
"""

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from groundwork.files import write_bytes
from groundwork.progress import SILENT
from recon.cloud import Cloud, read_cloud
from recon.sampling.sample_lidar import sample_lidar
from recon.sampling.sample_mesh import sample_mesh
from recon.sampling.sampler_settings import MeshSettings, MobileSettings, TerrestrialSettings
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole, look_at, project
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

PICTURE = Path(__file__).resolve().parent / "images" / "sampling.png"
PANEL = (520, 300)  # [px]
GAP = 6  # [px]
EYES = (np.array([-0.5, -0.88, 0.5]), np.array([0.17, -0.6, -0.02]))  # from the middle, in lengths of the bridge


def main(run: Path) -> None:
    """Write the picture.

    Args:
        run: Output folder of a run with one scene.
    """
    home = run / "scenes" / "0000"
    scene = read_stage(home / "stage" / "scene.usda")
    with tempfile.TemporaryDirectory() as folder:
        clouds = {"reconstructed from photographs": read_cloud(next(iter(sorted(home.glob("cloud/*")))))}
        clouds |= _samples(scene, Path(folder))
    mesh = clouds["mesh, uniform by area"]
    bridge = mesh.columns["coord"][mesh.columns["segment"] != 0]
    low, high = bridge.min(axis=0), bridge.max(axis=0)
    rows = []
    for title, cloud in clouds.items():
        palette = np.zeros((256, 3), np.uint8)
        for row in cloud.classes:
            palette[row.id] = row.color
        paints = (cloud.columns["color"], palette[cloud.columns["segment"]])
        views = [draw(cloud.columns["coord"], paint, eye, low, high) for eye in EYES for paint in paints]
        text = f"{title}: {len(cloud):,} points"
        cv2.putText(views[0], text, (10, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (40, 40, 40), 1, cv2.LINE_AA)
        gap = np.full((PANEL[1], GAP, 3), 255, np.uint8)
        rows.append(np.concatenate([part for view in views for part in (view, gap)][:-1], axis=1))
    rule = np.full((GAP, rows[0].shape[1], 3), 225, np.uint8)
    sheet = np.concatenate([part for row in rows for part in (row, rule)][:-1])
    _, data = cv2.imencode(".png", sheet[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    write_bytes(PICTURE, data.tobytes())


def draw(points: F64, colors: U8, eye: F64, low: F64, high: F64) -> U8:
    """Draw points, nearer ones over farther ones.

    Args:
        points: Positions [m], shape (N, 3), float64.
        colors: sRGB colors, shape (N, 3), uint8.
        eye: Where to look from, from the middle of the bridge, in lengths of its diagonal [1], shape (3,), float64.
        low: Lower corner of the bridge [m], shape (3,), float64.
        high: Upper corner [m], shape (3,), float64.

    Returns:
        sRGB colors, shape (H, W, 3), uint8.
    """
    width, height = PANEL
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    camera = Pinhole(width, height, width * 0.9, width * 0.9, width / 2, height / 2)
    pixels, depth = project(points, camera, look_at(middle + size * eye, middle))
    order = np.argsort(-depth)
    order = order[depth[order] > 0.5]
    image = np.full((height, width, 3), 255, np.uint8)
    column, line = np.floor(np.clip(pixels[order], -1, [width, height])).astype(int).T
    seen = (column >= 0) & (column < width) & (line >= 0) & (line < height)
    image[line[seen], column[seen]] = colors[order][seen]
    return image


def _samples(scene: FlatScene, folder: Path) -> dict[str, Cloud]:
    """Sample a stage in every way that there is."""
    ways = {
        "mesh, uniform by area": MeshSettings(points=400_000),
        "mesh, what the flight sees, 5 mm noise": MeshSettings(points=400_000, min_views=1, normal_noise=0.005),
        "laser on a tripod": TerrestrialSettings(),
        "laser on a vehicle": MobileSettings(),
    }
    clouds = {}
    for number, (title, settings) in enumerate(ways.items()):
        out = folder / str(number)
        out.mkdir()
        if isinstance(settings, MeshSettings):
            clouds[title] = sample_mesh(scene, out, settings, SILENT)
        else:
            clouds[title] = sample_lidar(scene, out, settings, SILENT)
    return clouds


if __name__ == "__main__":
    main(Path(sys.argv[1]))
