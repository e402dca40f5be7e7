"""Contact sheets of random bridges of each family: photographs, and pictures in the colors of the classes."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Layout
from authoring.families.bridge_settings import draw_layout
from authoring.families.registry import FAMILIES, build_bridge
from authoring.parts.piers import Ground
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from authoring.shapes.component import Component, Scatter
from authoring.site.site import draw_site
from authoring.streams import stream
from falsework.gallery.camera import EACH_FOR_ITSELF, seen_from
from falsework.gallery.contact_sheet import contact_sheet
from falsework.report.pictures import paint_labels
from falsework.scenario import scene_seed
from groundwork.files import write_bytes, write_text
from groundwork.progress import SILENT, Progress
from groundwork.settings import parse_settings
from render.capture import load_image, read_capture, read_truth
from render.frames import render_scene
from render.settings import RenderSettings
from usd_schemas.pinhole import Pinhole, look_at
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

_WIDTH, _HEIGHT = 640, 400  # [px] of one picture
_SAMPLES = 2  # pixels of a photograph along a side of a pixel of the picture: railings and cables are thin
_TEXELS = 1024  # the close-up needs them
_WORLD = "countryside"
_HALF_VIEW = np.radians(24.0)  # half the horizontal field of view
_EYE_OVER_GROUND = 1.8  # [m] at least
_LETTERS, _QUALITY = 0.7, 78  # of captions, of the JPEG


@dataclass(frozen=True)
class Views:
    """Pictures of one bridge.

    Attributes:
        caption: Family, and the seed of a scenario.
        pictures: Overview, overview in the colors of the classes, close-up, each shape (H, W, 3), uint8.
    """

    caption: str
    pictures: tuple[U8, U8, U8]


def write_gallery(folder: Path, count: int, seed: int, families: tuple[str, ...], progress: Progress) -> None:
    """Author and render random bridges of some families, one sheet for each family.

    Args:
        folder: Existing, empty folder.
        count: Bridges of each family.
        seed: Seed of the first, as a scenario would say it; the others follow.
        families: Keys of the registry; empty for all.
        progress: Listener.
    """
    names = families or tuple(sorted(FAMILIES))
    progress.stage("gallery", len(names) * count)
    lines = ["# Gallery of families", "", f"Seeds {seed} to {seed + count - 1}, profile `default`."]
    for number, name in enumerate(names):
        rows = []
        for step in range(count):
            rows.append(photograph(name, seed + step))
            progress.advance(number * count + step + 1)
        data = contact_sheet([(row.caption, row.pictures) for row in rows], letters=_LETTERS, quality=_QUALITY)
        write_bytes(folder / f"{name}.jpg", data)
        lines += ["", f"## {name}", "", f"![{name}]({name}.jpg)"]
    write_text(folder / "index.md", "\n".join(lines) + "\n")


def photograph(family: str, seed: int) -> Views:
    """Author one random bridge on its site and render its pictures.

    Args:
        family: Key of the registry.
        seed: Seed of the scenario whose first scene has this bridge.
    """
    own_seed = scene_seed(seed, 0)
    own = {"spans": []} if "spans" in FAMILIES[family].settings.model_fields else {}
    settings = parse_settings(
        AuthoringSettings,
        {
            "bridge": {"family": family, family: own},
            "background": {"name": _WORLD},
            "look": {"texels": _TEXELS},
            "survey": [{"kind": "global", "images": 8, "spacing": 50.0}],
        },
        "gallery",
    )
    layout, drawn = draw_layout(settings.bridge, stream(own_seed, "bridge"))
    site = draw_site(settings.site, layout, stream(own_seed, "site"))
    poses = np.stack([_overview(layout, build_bridge(layout, drawn, site.ground)), _close_up(layout, site.ground)])
    with tempfile.TemporaryDirectory() as scratch:
        stage, capture = Path(scratch) / "stage", Path(scratch) / "capture"
        stage.mkdir()
        capture.mkdir()
        author_scene(settings, own_seed, stage, SILENT)
        scene = read_stage(stage / "scene.usda")
        render = RenderSettings.model_validate({"quality": "standard", "sensor": {**EACH_FOR_ITSELF, "noise": False}})
        render_scene(seen_from(scene, poses, _camera()), capture, render, own_seed, SILENT)
        taken = read_capture(capture)
        truth = read_truth(taken)
        assert truth is not None
        labels = paint_labels(truth.semantic(0), truth.classes)
        whole, classes, close = (_smaller(picture) for picture in (load_image(taken, 0), labels, load_image(taken, 1)))
        return Views(f"{family} {seed}", (whole, classes, close))


def _overview(layout: Layout, pieces: tuple[Component | Scatter, ...]) -> F64:
    """Place a camera beside and above, far enough away to show every visible member."""
    points = np.concatenate([piece.mesh.points for piece in pieces if isinstance(piece, Component)])
    points[:, 2] = np.maximum(points[:, 2], 0.0)  # members below the ground are not visible
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    heading = layout.alignment.heading
    turn = np.array([[np.cos(heading), -np.sin(heading), 0.0], [np.sin(heading), np.cos(heading), 0.0], [0, 0, 1.0]])
    direction = turn @ np.array([-0.42, -0.85, 0.34])
    direction /= np.linalg.norm(direction)
    local = (points - middle) @ look_at(middle + direction, middle)[:3, :3]
    slope = np.tan(_HALF_VIEW) * np.array([1.0, _HEIGHT / _WIDTH])
    distance = float(np.max(np.abs(local[:, :2]) / slope - local[:, 2:]))
    return look_at(middle + 1.04 * distance * direction, middle)


def _close_up(layout: Layout, ground: Ground) -> F64:
    """Place a camera beside the first pier, or the first abutment, looking up at it."""
    station = layout.supports[min(1, len(layout.supports) - 2)]
    width, place = layout.width, layout.alignment

    def at(along: float, left: float, above: float) -> F64:
        return place.point(np.array([station + along]), np.array([left]), np.array([above]))[0]

    # A pier is shown from the span before it, the abutment of a single span from below the span.
    back = -1.0 if len(layout.supports) > 2 else 1.0
    eye = at(back * 1.1 * width, -1.3 * width, -layout.depth - 2.0)
    eye[2] = max(eye[2], float(ground(eye[None, :2])[0]) + _EYE_OVER_GROUND)
    return look_at(eye, at(-back * 0.1 * width, 0.0, -layout.depth))


def _camera() -> Pinhole:
    width, height = _SAMPLES * _WIDTH, _SAMPLES * _HEIGHT
    focal = 0.5 * width / float(np.tan(_HALF_VIEW))
    return Pinhole(width, height, focal, focal, 0.5 * width, 0.5 * height)


def _smaller(picture: U8) -> U8:
    """Average the pixels of a photograph that lie in one of the picture; shape (H, W, 3)."""
    return np.asarray(cv2.resize(picture, (_WIDTH, _HEIGHT), interpolation=cv2.INTER_AREA), np.uint8)
