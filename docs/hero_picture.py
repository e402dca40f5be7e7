"""Compose the picture of six families in four worlds: each as a photograph, by class, and as a reconstructed cloud.

Usage: python -m docs.hero_picture RUNS [picture.jpg]

RUNS is a folder that keeps the runs of `docs.hero_bridges`; what is missing there is made. Each bridge is checked out,
its world is swapped, one picture of it is taken, and its dense cloud is drawn from the same place: the cloud was made
in the countryside, from photographs of another flight.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from authoring.scenes.checkout import checkout_scene
from authoring.variants.add import set_choices
from docs.hero_bridges import BRIDGES, reconstruct
from falsework.commands.console import ConsoleProgress
from falsework.gallery.camera import EACH_FOR_ITSELF, seen_from
from falsework.gallery.viewpoint import best_view
from falsework.report.pictures import paint_labels
from groundwork.files import write_bytes
from groundwork.progress import Progress
from recon.cloud import SFM_DENSE, Cloud, read_cloud
from render.capture import load_image, read_capture, read_truth
from render.frames import render_scene
from render.settings import RenderSettings
from usd_schemas.components import BACKGROUND, ClassRow
from usd_schemas.pinhole import Pinhole, project
from usd_schemas.reading.scene_cache import load_scene

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

PICTURE = Path(__file__).resolve().parent / "images" / "hero.jpg"
VIEW = "air"  # key of `falsework.gallery.viewpoint.VIEWS`
COLUMNS, TILE, GAP = 3, (620, 400), 6  # side by side; size of one; between two [px]
FINER = 2  # drawn that many times as large, and made smaller
FOCAL = 32.0 / 36.0  # of the width, as in `falsework preview`
CUTS, LEAN = (0.43, 0.66), 0.14  # of a tile's width: the middles of its cuts, and how far one runs to its head
PAPER, DIM, PALE = 250, 178, 0.5  # gray behind a cloud; of its ground; how much of the gray photograph is left
QUALITY = 88  # of the JPEG


def main(runs: Path, picture: Path) -> None:
    """Write the picture.

    Args:
        runs: Folder that keeps the runs.
        picture: JPEG to write.
    """
    tiles = list[U8]()
    with ConsoleProgress() as progress:
        for bridge in BRIDGES:
            scene = reconstruct(bridge, runs, progress)
            with tempfile.TemporaryDirectory() as scratch:
                tiles.append(tile(scene, bridge.world, Path(scratch), progress))
    gap = np.full((TILE[1], GAP, 3), 255, np.uint8)
    lines = [
        np.concatenate([part for each in tiles[k : k + COLUMNS] for part in (each, gap)][:-1], axis=1)
        for k in range(0, len(tiles), COLUMNS)
    ]
    line = np.full((GAP, lines[0].shape[1], 3), 255, np.uint8)
    sheet = np.concatenate([part for each in lines for part in (each, line)][:-1])
    _, data = cv2.imencode(".jpg", sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    write_bytes(picture, data.tobytes())


def tile(scene: Path, world: str, scratch: Path, progress: Progress) -> U8:
    """Show one bridge three times over, cut along two slanted lines.

    Args:
        scene: Folder of the scene in a run.
        world: Background that it gets.
        scratch: Empty folder.
        progress: Listener.

    Returns:
        sRGB colors, shape (height, width, 3), uint8.
    """
    own, shots = scratch / "scene", scratch / "shots"
    checkout_scene(scene / "stage", own)
    set_choices(own / "scene.usda", {"background": world}, progress.note)
    flat = load_scene(own / "scene.usda")
    width, height = FINER * TILE[0], FINER * TILE[1]
    camera = Pinhole(width, height, FOCAL * width, FOCAL * width, 0.5 * width, 0.5 * height)
    pose = best_view(flat, camera, VIEW)
    seen = seen_from(flat, pose[None], camera)
    track = replace(seen.cameras[0], near=0.1, distortion=type(seen.cameras[0].distortion)(), readout_time=0.0)
    shots.mkdir()
    settings = RenderSettings.model_validate({"quality": "fine", "sensor": EACH_FOR_ITSELF})
    render_scene(replace(seen, cameras=(track,), moments=()), shots, settings, 7, progress)
    capture = read_capture(shots)
    truth = read_truth(capture)
    assert truth is not None
    clouds = [read_cloud(path.parent) for path in sorted(scene.glob("cloud/*/cloud.json"))]
    cloud = next(each for each in clouds if each.source == SFM_DENSE)
    photograph = load_image(capture, 0)
    labels = painted(photograph, truth.semantic(0), truth.classes)
    whole = wiped([photograph, labels, cloud_from(cloud, camera, pose)])
    return cv2.resize(whole, TILE, interpolation=cv2.INTER_AREA).astype(np.uint8)


def painted(photograph: U8, labels: U8, classes: tuple[ClassRow, ...]) -> U8:
    """Paint what is bridge by class over a photograph without color.

    Args:
        photograph: sRGB colors, shape (H, W, 3), uint8.
        labels: Class ids, shape (H, W), uint8.
        classes: Class table.

    Returns:
        sRGB colors, shape (H, W, 3), uint8.
    """
    gray = PAPER - PALE * (PAPER - photograph.mean(axis=2, keepdims=True))
    return np.where((labels == BACKGROUND)[..., None], gray, paint_labels(labels, classes)).astype(np.uint8)


def cloud_from(cloud: Cloud, camera: Pinhole, pose: F64) -> U8:
    """Draw the points of a cloud by class as a camera sees them, nearer ones over farther ones.

    Args:
        cloud: A cloud.
        camera: Intrinsics.
        pose: camera_to_world [m], shape (4, 4), float64.

    Returns:
        sRGB colors, shape (height, width, 3), uint8.
    """
    palette = np.zeros((256, 3), np.uint8)
    for row in cloud.classes:
        palette[row.id] = row.color
    palette[BACKGROUND] = DIM
    pixels, depth = project(cloud.columns["coord"], camera, pose)
    rows = np.argsort(-depth)
    rows = rows[depth[rows] > 0]
    image = np.full((camera.height, camera.width, 3), PAPER, np.uint8)
    for across in range(-1, FINER):
        for down in range(-1, FINER):
            column, line = np.floor(pixels[rows] + [across, down]).astype(int).T
            inside = (column >= 0) & (column < camera.width) & (line >= 0) & (line < camera.height)
            image[line[inside], column[inside]] = palette[cloud.columns["segment"][rows[inside]]]
    return image


def wiped(images: list[U8]) -> U8:
    """Cut pictures of one view along slanted lines, and show a part of each.

    Args:
        images: From the left to the right, each of shape (H, W, 3), uint8.

    Returns:
        One picture, shape (H, W, 3), uint8.
    """
    height, width = images[0].shape[:2]
    found = images[0].copy()
    for image, middle in zip(images[1:], CUTS, strict=True):
        foot = width * (middle - LEAN / 2)
        edge = (foot + LEAN * width * (1.0 - np.arange(height) / height))[:, None]
        column = np.arange(width)[None]
        found = np.where((column > edge)[..., None], image, found)
        found[np.abs(column - edge) <= FINER] = 255
    return found


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else PICTURE)
