"""Contact sheets of backgrounds: random bridges in each, with varying look and light."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.registry import BACKGROUNDS
from authoring.families.bridge_settings import draw_layout
from authoring.looks.roles import LOOKS
from authoring.scene import NO_FILES, GivenFiles, author_scene
from authoring.settings import AuthoringSettings
from authoring.shapes.component import FIRST_SITE_ID
from authoring.site.site import draw_site
from authoring.streams import stream
from falsework.gallery.camera import EACH_FOR_ITSELF, seen_from
from falsework.gallery.contact_sheet import contact_sheet
from falsework.gallery.measures import Measures, Picture, measure_picture, visible_triangles
from falsework.gallery.world_views import VIEWS, world_views
from falsework.scenario import scene_seed
from groundwork.files import write_bytes, write_text
from groundwork.progress import SILENT, Progress
from groundwork.settings import parse_settings
from render.capture import load_image, read_capture, read_truth
from render.frames import render_scene
from render.settings import RenderSettings
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

LIGHTS: dict[str, dict[str, Any]] = {
    "noon": {},
    "overcast": {"cloud_cover": 1.0},
    "evening": {"date": "2024-06-21T18:15", "turbidity": 4.0},
    "winter": {"date": "2024-12-21T10:30", "turbidity": 6.0, "cloud_cover": 0.6},
}

_WIDTH, _HEIGHT = 320, 200  # [px] of one picture
_FOCAL = 24.0 / 36.0  # of the width
_TEXELS = 1024  # fewer blur the stains of a pier 5 m away
_MOST_VIEWS = 0.95
_LETTERS, _QUALITY = 0.45, 66  # of captions, of the JPEG


@dataclass(frozen=True)
class WorldShots:
    """Pictures of one seed on a sheet.

    Attributes:
        caption: World, seed of a scenario, look and light.
        pictures: One for each of `VIEWS`, each shape (H, W, 3), uint8.
        measures: Their numbers.
        total: Instanced triangles of the whole scene.
    """

    caption: str
    pictures: tuple[U8, ...]
    measures: tuple[Measures, ...]
    total: int


def write_worlds(folder: Path, count: int, seed: int, worlds: tuple[str, ...], progress: Progress) -> None:
    """Render random bridges in some backgrounds, one sheet for each, with a table of measures.

    Args:
        folder: Existing, empty folder.
        count: Seeds of each world.
        seed: The first, as a scenario would say it; the others follow.
        worlds: Names of procedural worlds; empty for all.
        progress: Listener.
    """
    names = worlds or tuple(name for name in BACKGROUNDS if name != "none")
    progress.stage("gallery", len(names) * count)
    lines = ["# Gallery of worlds", "", f"Seeds {seed} to {seed + count - 1}; from the left: {', '.join(VIEWS)}."]
    for number, name in enumerate(names):
        rows = []
        for step in range(count):
            rows.append(photograph_world(name, seed + step))
            progress.advance(number * count + step + 1)
        data = contact_sheet([(row.caption, row.pictures) for row in rows], letters=_LETTERS, quality=_QUALITY)
        write_bytes(folder / f"{name}.jpg", data)
        lines += ["", f"## {name}", "", f"![{name}]({name}.jpg)", "", *world_table(rows)]
    write_text(folder / "index.md", "\n".join(lines) + "\n")


def photograph_world(world: str, seed: int, given: GivenFiles = NO_FILES, **said: Any) -> WorldShots:
    """Author one random bridge in a background and render its pictures; look and light depend on the seed.

    Args:
        world: Name of a procedural background, or of one in `given`.
        seed: Seed of the scenario whose first scene is shown.
        given: Imported worlds and other files of the user.
        said: Further sections of the scenario.
    """
    own_seed = scene_seed(seed, 0)
    look = tuple(LOOKS)[seed % len(LOOKS)]
    light = tuple(LIGHTS)[(seed + seed // len(LIGHTS)) % len(LIGHTS)]
    asked = {
        "background": {"name": world},
        "look": {"name": look, "texels": _TEXELS},
        "light": LIGHTS[light],
        "survey": [{"kind": "global", "images": 8, "spacing": 50.0}],
        **said,
    }
    settings = parse_settings(AuthoringSettings, asked, "gallery")
    layout, _ = draw_layout(settings.bridge, stream(own_seed, "bridge"))
    site = draw_site(settings.site, layout, stream(own_seed, "site"))
    camera = Pinhole(_WIDTH, _HEIGHT, _FOCAL * _WIDTH, _FOCAL * _WIDTH, 0.5 * _WIDTH, 0.5 * _HEIGHT)
    with tempfile.TemporaryDirectory() as scratch:
        stage, capture = Path(scratch) / "stage", Path(scratch) / "capture"
        stage.mkdir()
        capture.mkdir()
        author_scene(settings, own_seed, stage, SILENT, given)
        scene = seen_from(read_stage(stage / "scene.usda"), world_views(layout, site), camera)
        pictures, measures = _take(scene, camera, capture, own_seed, float(site.field.heights.min()))
    total = int(scene.geometry.part_count[scene.draws.part].sum())
    return WorldShots(f"{world} {seed}: {look}, {light}", pictures, measures, total)


def _take(
    scene: FlatScene, camera: Pinhole, folder: Path, seed: int, ground: float
) -> tuple[tuple[U8, ...], tuple[Measures, ...]]:
    settings = RenderSettings.model_validate({"quality": "fine", "sensor": EACH_FOR_ITSELF})
    render_scene(scene, folder, settings, seed, SILENT)
    taken = read_capture(folder)
    truth = read_truth(taken)
    assert truth is not None
    kinds = {row.id: row.component for row in scene.instances if row.id >= FIRST_SITE_ID}
    poses = scene.cameras[0].poses
    drawn = visible_triangles(scene, camera, poses)
    pictures = tuple(load_image(taken, row) for row in range(len(poses)))
    measures = (
        measure_picture(Picture(picture, truth.depth(row), truth.instance(row), poses[row], camera), kinds, ground)
        for row, picture in enumerate(pictures)
    )
    return pictures, tuple(
        replace(measure, triangles=int(count)) for measure, count in zip(measures, drawn, strict=True)
    )


def world_table(rows: list[WorldShots]) -> list[str]:
    """Format the measures of the pictures of one background as a table, with a line about their triangles.

    Args:
        rows: Its pictures, seed by seed.
    """
    lines = [
        "| seed, look, light | view | kinds of things | rays below the horizon without a hit | flat patches [%] "
        "| median | triangles |",
        "|---|---|---|---|---|---|---|",
    ]
    for shots in rows:
        for view, found in zip(VIEWS, shots.measures, strict=True):
            lines.append(
                f"| {shots.caption} | {view} | {len(found.things)}: {', '.join(found.things)} | {found.sky_below} | "
                f"{100 * found.flat_patches:.1f} | {found.luminance:.0f} | {found.triangles:,} of {shots.total:,} |"
            )
    views = np.array([[found.triangles for found in shots.measures] for shots in rows])
    people = views[:, : VIEWS.index("air")]
    every, low = (float(np.quantile(counts, _MOST_VIEWS)) for counts in (views, people))
    return [
        *lines,
        "",
        f"Triangles of a view: {every:,.0f} in 95 % of them ({low:,.0f} in 95 % of those from the ground), "
        f"{views.max():,} at most; in a whole scene {max(shots.total for shots in rows):,} at most.",
    ]
