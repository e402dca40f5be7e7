"""A contact sheet of looks: one girder bridge in each look, from eye height to half a meter from its concrete."""

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from authoring.families.bridge_settings import draw_layout
from authoring.looks.roles import LOOKS
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from authoring.site.site import draw_site
from authoring.streams import stream
from falsework.gallery.camera import EACH_FOR_ITSELF, seen_from
from falsework.gallery.contact_sheet import contact_sheet
from falsework.gallery.world_views import VIEWS, world_views
from falsework.scenario import scene_seed
from groundwork.files import write_bytes, write_text
from groundwork.progress import SILENT, Progress
from groundwork.settings import parse_settings
from render.capture import load_image, read_capture
from render.frames import render_scene
from render.settings import RenderSettings
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.pinhole import Pinhole, look_at
from usd_schemas.raycast import RayScene
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

PIER = VIEWS.index("5 m from a pier")
_WIDTH, _HEIGHT, _FOCAL = 400, 250, 267.0  # [px]
_CLOSE = 0.5  # [m]
_LETTERS, _QUALITY = 0.45, 80  # of captions, of the JPEG
_FEET = ("column", "wall_pier", "abutment_wall")  # components for the close-up


def write_looks(folder: Path, seed: int, texels: int, progress: Progress) -> None:
    """Render one girder bridge in every look, one row for each.

    Args:
        folder: Existing, empty folder.
        seed: Seed of the scenario whose first scene has this bridge.
        texels: Texels along a side of a sheet [px].
        progress: Listener.
    """
    progress.stage("gallery", len(LOOKS))
    rows = []
    for number, look in enumerate(LOOKS):
        rows.append((f"{look} {seed}", photograph_look(look, seed, texels)))
        progress.advance(number + 1)
    write_bytes(folder / "looks.jpg", contact_sheet(rows, letters=_LETTERS, quality=_QUALITY))
    seen = "from the side, under the deck, 5 m from a pier, half a meter from its concrete"
    write_text(folder / "index.md", f"# Gallery of looks\n\nSeed {seed}; {seen}.\n\n![looks](looks.jpg)\n")


def photograph_look(look: str, seed: int, texels: int) -> tuple[U8, ...]:
    """Author a girder bridge in a look and render its four pictures, each shape (H, W, 3), uint8.

    Args:
        look: Name of the look.
        seed: Seed of the scenario whose first scene has this bridge.
        texels: Texels along a side of a sheet [px].
    """
    asked = {
        "bridge": {"family": "girder"},
        "look": {"name": look, "texels": texels},
        "survey": [{"kind": "global", "images": 8, "spacing": 50.0}],
    }
    settings = parse_settings(AuthoringSettings, asked, "gallery")
    own_seed = scene_seed(seed, 0)
    layout, _ = draw_layout(settings.bridge, stream(own_seed, "bridge"))
    poses = world_views(layout, draw_site(settings.site, layout, stream(own_seed, "site")))
    camera = Pinhole(_WIDTH, _HEIGHT, _FOCAL, _FOCAL, 0.5 * _WIDTH, 0.5 * _HEIGHT)
    with tempfile.TemporaryDirectory() as scratch:
        stage, capture = Path(scratch) / "stage", Path(scratch) / "capture"
        stage.mkdir()
        capture.mkdir()
        author_scene(settings, own_seed, stage, SILENT)
        scene = read_stage(stage / "scene.usda")
        poses = np.concatenate([poses[: PIER + 1], close_to_concrete(scene, poses[PIER])[None]])
        render = RenderSettings.model_validate({"quality": "fine", "sensor": EACH_FOR_ITSELF})
        render_scene(seen_from(scene, poses, camera), capture, render, own_seed, SILENT)
        taken = read_capture(capture)
        return tuple(load_image(taken, row) for row in range(len(poses)))


def close_to_concrete(scene: FlatScene, pose: F64) -> F64:
    """Move a camera close to the pier that it sees, or to the surface in its center if it sees none.

    Args:
        scene: The scene.
        pose: camera_to_world [m], shape (4, 4), float64.

    Returns:
        camera_to_world half a meter before a surface [m], shape (4, 4), float64.
    """
    feet = {row.id for row in scene.instances if row.component in _FEET}
    corners, ids, _ = world_triangles(scene)
    eye = pose[:3, 3]
    across, down = np.meshgrid(np.linspace(-0.7, 0.7, 41), np.linspace(-0.35, 0.35, 21))
    rays = np.stack([across.ravel(), down.ravel(), np.ones(across.size)], axis=1) @ pose[:3, :3].T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    tracer = RayScene(corners, np.zeros(len(corners), np.uint32))
    distance, triangle, _ = tracer.cast(np.tile(eye, (len(rays), 1)), rays)
    wanted = np.array([row >= 0 and int(ids[row]) in feet for row in triangle])
    wanted = wanted if wanted.any() else triangle >= 0
    aim = rays[wanted].mean(axis=0)
    best = int(np.argmin(np.where(wanted, np.linalg.norm(rays - aim, axis=1), np.inf)))
    place = eye + distance[best] * rays[best]
    return look_at(place - _CLOSE * rays[best], place)
