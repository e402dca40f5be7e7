"""Draw the pictures of `docs/blender.md`: a scene on its way through the real Blender and back.

Usage: FALSEWORK_BPY_PYTHON=.venv-dcc/bin/python .venv/bin/python -m tests.dcc.pictures
"""

import json
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import docs
from authoring.variants.add import set_choices
from falsework.gallery.camera import seen_from
from falsework.report.pictures import paint_labels
from groundwork.files import write_bytes
from groundwork.progress import SILENT
from render.capture import load_image, read_capture, read_truth
from render.frames import render_scene
from render.settings import RenderSettings
from tests.dcc.blender import run_in_blender
from tests.dcc.round_trip import SMALL, Edit, copy_scene, harvest, small_scene, trip
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole, look_at
from usd_schemas.reading.stage_reader import read_stage

U8 = NDArray[np.uint8]

FOLDER = Path(docs.__file__).resolve().parent / "images" / "blender"
SEED = 7
SETTINGS = {**SMALL, "look": {"texels": 1024}, "background": {"name": "countryside"}}
CAMERA = Pinhole(640, 360, 560.0, 560.0, 320.0, 180.0)
EYE, TARGET = np.array([2.0, -26.0, 7.0]), np.array([15.0, 0.0, 3.0])  # [m]
FAR_EYE = np.array([-30.0, -52.0, 16.0])  # [m] from where the tower of `world_scene.py` is seen, too
CHANGES: tuple[Edit, ...] = (
    ("move", "Pier_001", [3.0, 0.0, 0.0]),
    ("push_vertex", "Deck_000", 0, [0.0, 0.0, 0.3]),
    ("paint", "Role_PierConcrete", [0.6, 0.1, 0.1]),
    ("add_cube", "Truck", [8.0, -2.5, 8.0], 2.6),
)


def main() -> None:
    """Go the whole way, and draw each step."""
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        original = small_scene(work / "original", SETTINGS, SEED)
        authored = read_stage(original)
        save("1_authored", draw(authored, work / "a")[0])
        exported, _ = trip(original, work / "blender", CHANGES)
        foreign = read_stage(exported)
        save("2_exported", draw(foreign, work / "b")[0])
        scene = copy_scene(original, work / "home")
        harvest(scene, exported, "Truck=vehicle")
        picture, labels = draw(read_stage(scene), work / "c")
        save("3_edited", picture)
        save("4_labels", labels)
        set_choices(scene, {"look": "clean"}, lambda line: None)
        save("5_clean", draw(read_stage(scene), work / "d")[0])
        town = work / "town.usdc"
        run_in_blender(
            "world_scene.py", json.dumps({"out": str(town), "options": {}, "image": str(work / "brick.png")})
        )
        before = copy_scene(original, work / "before_town")
        set_choices(before, {"background": str(town)}, lambda line: None)
        save("6_town", draw(read_stage(before), work / "e", FAR_EYE)[0])


def draw(scene: FlatScene, folder: Path, eye: NDArray[np.float64] = EYE) -> tuple[U8, U8]:
    """Photograph a scene with a camera of our own.

    Args:
        scene: Any scene with a camera.
        folder: Folder to write the capture to; must not exist.
        eye: Position of the camera [m], shape (3,), float64.

    Returns:
        Photograph and painted labels, each shape (H, W, 3), uint8.
    """
    folder.mkdir()
    settings = RenderSettings.model_validate({"quality": "fine", "sensor": {"noise": False}})
    render_scene(seen_from(scene, look_at(eye, TARGET)[None], CAMERA), folder, settings, SEED, SILENT)
    capture = read_capture(folder)
    truth = read_truth(capture)
    assert truth is not None
    return load_image(capture, 0), paint_labels(truth.semantic(0), truth.classes)


def save(name: str, pixels: U8) -> None:
    """Write a picture of the page.

    Args:
        name: Stem of the file.
        pixels: Shape (H, W, 3), uint8.
    """
    _, data = cv2.imencode(".png", pixels[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    write_bytes(FOLDER / f"{name}.png", data.tobytes())


if __name__ == "__main__":
    main()
