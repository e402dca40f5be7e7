"""Contact sheets of every family in every world and look: one sheet for each world, made by swapping layers."""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.registry import BACKGROUNDS
from authoring.families.registry import FAMILIES
from authoring.looks.roles import LOOKS
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from falsework.gallery.camera import EACH_FOR_ITSELF, seen_from
from falsework.gallery.contact_sheet import contact_sheet
from falsework.gallery.viewpoint import best_view
from falsework.scenario import scene_seed
from groundwork.files import write_bytes, write_text
from groundwork.progress import SILENT, Progress
from groundwork.settings import parse_settings
from render.capture import load_image, read_capture
from render.frames import render_scene
from render.gpu.camera import visible_boxes
from render.gpu.gpu_scene import draw_boxes
from render.settings import RenderSettings
from usd_schemas.flat_scene import Draws, FlatScene
from usd_schemas.pinhole import Pinhole
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

_WIDTH, _HEIGHT, _FOCAL = 480, 240, 480.0  # [px] of one picture, which a bridge fills in its width
_SAMPLES = 2  # pixels of a photograph along a side of a pixel of the picture: railings are thin
_TEXELS = 256
_VIEW = "air"  # over trees and houses, whichever world it is
_RENDER = {"quality": "standard", "shadow_size": 2048}
_LETTERS, _QUALITY = 0.55, 66  # of captions, of the JPEG


def write_combinations(
    folder: Path, seed: int, families: Sequence[str], worlds: Sequence[str], looks: Sequence[str], progress: Progress
) -> None:
    """Author one bridge of each family, and render it in each world and look: a row for each family, a column a look.

    Args:
        folder: Existing, empty folder.
        seed: Seed of a scenario, whose first scene has these bridges.
        families: Keys of the registry; empty for all.
        worlds: Names of procedural worlds; empty for all.
        looks: Names of looks; empty for all.
        progress: Listener.
    """
    families = families or tuple(sorted(FAMILIES))
    worlds = worlds or tuple(name for name in BACKGROUNDS if name != "none")
    looks = looks or tuple(LOOKS)
    progress.stage("gallery", len(families) * len(worlds) * len(looks))
    taken = dict[tuple[str, str, str], U8]()
    for family in families:
        for world, look, picture in photograph_combinations(family, seed, worlds, looks):
            taken[family, world, look] = picture
            progress.advance(len(taken))
    lines = ["# Gallery of combinations", "", f"Seed {seed}; from the left: {', '.join(looks)}."]
    for world in worlds:
        rows = [([f"{family} {seed}"], [taken[family, world, look] for look in looks]) for family in families]
        rows[0] = ([f"{families[0]} {seed}: {looks[0]}", *looks[1:]], rows[0][1])
        write_bytes(folder / f"{world}.jpg", contact_sheet(rows, letters=_LETTERS, quality=_QUALITY))
        lines += ["", f"## {world}", "", f"![{world}]({world}.jpg)"]
    write_text(folder / "index.md", "\n".join(lines) + "\n")


def photograph_combinations(
    family: str, seed: int, worlds: Sequence[str], looks: Sequence[str]
) -> Iterator[tuple[str, str, U8]]:
    """Author one bridge with worlds and looks as variants, and render an overview of every combination.

    The view of a world is the same in every look.

    Args:
        family: Key of the registry.
        seed: Seed of the scenario whose first scene has this bridge.
        worlds: Names of procedural worlds, at least one.
        looks: Names of looks, at least one.

    Yields:
        World, look, and the picture, shape (H, W, 3), uint8.
    """
    own = {"spans": []} if "spans" in FAMILIES[family].settings.model_fields else {}
    asked = {
        "bridge": {"family": family, family: own},
        "background": {"name": worlds[0]},
        "look": {"name": looks[0], "texels": _TEXELS},
        "survey": [{"kind": "global", "images": 8, "spacing": 50.0}],
        "variants": {"background": list(worlds), "look": list(looks)},
    }
    settings = parse_settings(AuthoringSettings, asked, "gallery")
    own_seed = scene_seed(seed, 0)
    views = dict[str, F64]()
    with tempfile.TemporaryDirectory() as scratch:
        stage = Path(scratch) / "stage"
        stage.mkdir()
        author_scene(settings, own_seed, stage, SILENT)
        for name, chosen in settings.variants.combinations().items():
            world, look = chosen["background"], chosen["look"]
            scene = read_stage(stage / f"variant_{name}.usda")
            if world not in views:
                views[world] = best_view(scene, _camera(), _VIEW)
            capture = Path(scratch) / name
            capture.mkdir()
            yield world, look, _photograph(scene, views[world], capture, own_seed)


def _photograph(scene: FlatScene, pose: F64, folder: Path, seed: int) -> U8:
    """Render one picture; shape (H, W, 3)."""
    camera = _camera()
    scene = seen_from(_in_view(scene, camera, pose), pose[None], camera)
    render = RenderSettings.model_validate({**_RENDER, "sensor": {**EACH_FOR_ITSELF, "noise": False}})
    render_scene(scene, folder, render, seed, SILENT)
    photograph = load_image(read_capture(folder), 0)
    return np.asarray(cv2.resize(photograph, (_WIDTH, _HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)


def _in_view(scene: FlatScene, camera: Pinhole, pose: F64) -> FlatScene:
    """Leave out what is beside or behind the view, which takes most of the time and shows only by its shadow."""
    rows = np.sort(visible_boxes(*draw_boxes(scene), camera, pose))
    return replace(scene, draws=Draws(**{name: values[rows] for name, values in vars(scene.draws).items()}))


def _camera() -> Pinhole:
    width, height, focal = _SAMPLES * _WIDTH, _SAMPLES * _HEIGHT, _SAMPLES * _FOCAL
    return Pinhole(width, height, focal, focal, 0.5 * width, 0.5 * height)
