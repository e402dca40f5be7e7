"""Compose the picture of the flights of a scene: each over the same bridge, its cameras and where they look.

Usage: python -m docs.flights_picture SCENE [picture.png]

SCENE is what `falsework author docs/gallery/flights.toml -o SCENE` wrote, or any scene with flights.
"""

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from groundwork.files import write_bytes
from groundwork.progress import SILENT
from recon.sampling.sample_mesh import sample_mesh
from recon.sampling.sampler_settings import MeshSettings
from usd_schemas.flat_scene import CameraTrack
from usd_schemas.pinhole import Pinhole, look_at, project
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

PICTURE = Path(__file__).resolve().parent / "images" / "flights.png"
PANEL, COLUMNS, GAP = (780, 430), 2, 6  # [px] of one flight; side by side; between two
EYE = np.array([-0.5, -0.8, 0.45])  # from the middle, in lengths of what is shown
POINTS = 300_000  # on the bridge
SIGHT = 2.0  # [m] length of a stroke that shows where a camera looks
INK, PALE = (40, 40, 40), 0.45  # of captions; how much of its color the bridge keeps


def main(scene: Path, picture: Path) -> None:
    """Write the picture.

    Args:
        scene: Folder of a scene with one flight or more.
        picture: PNG to write.
    """
    stage = read_stage(scene / "scene.usda")
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "mesh"
        out.mkdir()
        cloud = sample_mesh(stage, out, MeshSettings(points=POINTS, scope="bridge"), SILENT)
    palette = np.zeros((256, 3), np.uint8)
    for row in cloud.classes:
        palette[row.id] = row.color
    colors = (255 - PALE * (255.0 - palette[cloud.columns["segment"]])).astype(np.uint8)
    places = np.concatenate([cloud.columns["coord"], *(track.poses[:, :3, 3] for track in stage.cameras)])
    low, high = places.min(axis=0), places.max(axis=0)
    tracks = sorted(stage.cameras, key=lambda track: track.name)
    panels = [flight_panel(track, cloud.columns["coord"], colors, low, high) for track in tracks]
    panels += [np.full_like(panels[0], 255)] * (-len(panels) % COLUMNS)
    gap = np.full((PANEL[1], GAP, 3), 255, np.uint8)
    lines = [
        np.concatenate([part for panel in panels[k : k + COLUMNS] for part in (panel, gap)][:-1], axis=1)
        for k in range(0, len(panels), COLUMNS)
    ]
    _, data = cv2.imencode(".png", np.concatenate(lines)[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    write_bytes(picture, data.tobytes())


def flight_panel(track: CameraTrack, points: F64, colors: U8, low: F64, high: F64) -> U8:
    """Draw one flight over the bridge: cameras from first (blue) to last (red), each with a stroke along its view.

    Args:
        track: The flight.
        points: Points on the bridge [m], shape (N, 3), float64.
        colors: sRGB colors of them, shape (N, 3), uint8.
        low: Lower corner of what is shown [m], shape (3,), float64.
        high: Upper corner [m], shape (3,), float64.

    Returns:
        sRGB colors, shape (H, W, 3), uint8.
    """
    width, height = PANEL
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    camera = Pinhole(width, height, width * 0.8, width * 0.8, width / 2, height / 2)
    pose = look_at(middle + size * EYE, middle)
    image = np.full((height, width, 3), 255, np.uint8)
    pixels, depth = project(points, camera, pose)
    order = np.argsort(-depth)
    column, line = np.floor(np.clip(pixels[order], -1, [width, height])).astype(int).T
    seen = (column >= 0) & (column < width) & (line >= 0) & (line < height)
    image[line[seen], column[seen]] = colors[order][seen]
    centers = track.poses[:, :3, 3]
    eyes, _ = project(centers, camera, pose)
    ends, _ = project(centers + SIGHT * track.poses[:, :3, 2], camera, pose)
    level = np.linspace(20, 235, len(centers)).round().astype(np.uint8)
    turbo = cv2.applyColorMap(level[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1]
    for eye, end, color in zip(np.rint(eyes).astype(int), np.rint(ends).astype(int), turbo.tolist(), strict=True):
        cv2.line(image, eye.tolist(), end.tolist(), color, 1, cv2.LINE_AA)
        cv2.circle(image, eye.tolist(), 3, color, -1, cv2.LINE_AA)
    length = float(np.linalg.norm(np.diff(centers, axis=0), axis=1).sum())
    words = f"{track.name}: {len(centers):,} images, {length:,.0f} m of flight"
    cv2.putText(image, words, (10, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.6, INK, 1, cv2.LINE_AA)
    return image


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else PICTURE)
