"""Public stages by others: how many are drawn like their thumbnails.

Usage: python -m benchmarks.render.stages FOLDER [--sheets OUT]

FOLDER is a checkout of the public repository usd-wg/assets, which is not committed. Every stage with a thumbnail of its
own name is read as `falsework render` reads it, drawn small, and laid beside its thumbnail on contact sheets in OUT.
Where a stage's own camera sees next to nothing of it, one that sees everything draws it, so that there is something to
compare. Whoever looks at the sheets writes what is wrong into `benchmarks/render/stages.toml`; the page counts.
"""

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.page import write_page
from groundwork.errors import FalseworkError
from groundwork.files import write_bytes
from groundwork.progress import SILENT
from groundwork.settings import read_toml
from render.detail.surveyed_scene import product_camera
from render.gpu.context import open_context
from render.light.illumination import BRIGHTEST
from render.sensor.sensor import Metering, Sensor, meter
from render.settings import RenderSettings, SensorSettings
from render.views.prepare import prepare
from usd_schemas.flat_scene import FlatScene
from usd_schemas.guard.guard import check_stage
from usd_schemas.reading.cameras import framing_camera
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.flat_geometry import world_bounds
from usd_schemas.reading.scene_cache import load_scene

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "stages.md"
VERDICTS = Path(__file__).with_name("stages.toml")
MOST_OF_A_FOLDER = 3  # twenty frame rates of one stage show no more than three
PARTS = ("_geom", "_look", "_payload", "_Geometry", "_Materials", "_Payload")  # layers that are no stage by themselves
WIDTH, HEIGHT = 256, 192  # [px]
LEAST_SEEN = 0.002  # share of an image below which there is nothing to compare
ACROSS = 4  # stages beside each other on a sheet
ROWS = 6

Image = NDArray[np.uint8]
SETTINGS = RenderSettings(
    quality="standard",
    shadow_size=1024,
    volume_probes=3000,
    volume_rays=32,
    sensor=SensorSettings(noise=False, image_format="png"),
)


@dataclass(frozen=True)
class Drawn:
    """What became of a stage.

    Attributes:
        name: Its path in the folder.
        said: Why there is not an image; empty where there is one.
        warnings: How many lines name what is drawn otherwise than authored.
    """

    name: str
    said: str
    warnings: int


def main() -> None:
    """Draw the stages, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sheets", type=Path, default=None)
    parser.add_argument("--only", default="")
    asked = parser.parse_args()
    pairs = [pair for pair in stages_of(asked.folder) if asked.only in str(pair[0])]
    drawn, cells = [], []
    for stage, thumbnail in pairs:
        name = stage.relative_to(asked.folder).as_posix()
        image, one = draw(stage, name, asked.folder)
        drawn.append(one)
        print(f"{len(drawn)}/{len(pairs)} {name}: {one.said or f'{one.warnings} lines'}", flush=True)  # noqa: T201
        cells.append(cell(image, thumbnail, f"{len(drawn)} {name}"))
    if asked.sheets is not None:
        asked.sheets.mkdir(parents=True, exist_ok=True)
        for number, first in enumerate(range(0, len(cells), ACROSS * ROWS)):
            write_bytes(asked.sheets / f"sheet_{number}.png", sheet(cells[first : first + ACROSS * ROWS]))
    if not asked.only:
        write_page(PAGE, page(drawn, read_toml(VERDICTS)), __file__)


def stages_of(folder: Path) -> list[tuple[Path, Path]]:
    """List stages with a thumbnail, a few of each folder.

    Args:
        folder: Where to look.

    Returns:
        Each stage and its thumbnail, sorted.
    """
    found: list[tuple[Path, Path]] = []
    for stage in sorted(folder.rglob("*")):
        if stage.suffix not in (".usd", ".usda", ".usdc", ".usdz") or stage.stem.endswith(PARTS):
            continue
        pictures = [
            picture
            for place in ("thumbnails", "screenshots")
            for picture in sorted((stage.parent / place).glob(f"{stage.stem}*"))
            if picture.suffix in (".png", ".jpg", ".jpeg")
        ]
        same = sum(other.parent == stage.parent for other, _ in found)
        if pictures and same < MOST_OF_A_FOLDER and not stage.name.startswith("_"):
            found.append((stage, pictures[0]))
    return found


def draw(stage: Path, name: str, folder: Path) -> tuple[Image | None, Drawn]:
    """Draw the first image of a stage's first camera.

    Args:
        stage: The stage.
        name: What to call it.
        folder: From where it may take files.
    """
    try:
        check_stage(stage, (folder,), lambda line: None)
        scene = load_scene(stage, choices=StageChoices(width=WIDTH, height=HEIGHT))
        image, share = photograph(scene)
        if share < LEAST_SEEN:
            image, _ = photograph(framed(scene))
        return image, Drawn(name, "", len(scene.warnings))
    except FalseworkError as error:
        return None, Drawn(name, str(error).rpartition(f"{name}: ")[2], 0)


def framed(scene: FlatScene) -> FlatScene:
    """Give a scene one camera that sees everything.

    Args:
        scene: The scene.
    """
    moments = scene.cameras[scene.products[0].camera].moments[:1]
    track, product = framing_camera(*world_bounds(scene))
    product = replace(product, width=WIDTH, height=HEIGHT)
    return replace(scene, cameras=(replace(track, moments=moments),), products=(product,))


def photograph(scene: FlatScene) -> tuple[Image, float]:
    """Take the first image of a scene as the renderer does, in this process.

    Args:
        scene: The scene.

    Returns:
        Blue, green, red [0 to 255], shape (H, W, 3), uint8; and the share of its pixels that show anything [1].
    """
    product = scene.products[0]
    track = scene.cameras[product.camera]
    scene = scene.at_moment(track.moments[0]) if track.moments else scene
    camera = product_camera(track, product.width, product.height)
    gl = open_context()
    try:
        prepared = prepare(gl, replace(scene, moments=()), SETTINGS, SILENT)
        view, cards = (
            prepared.painter(camera, sharp=True, cards=cards).draw(track.poses[0], track.near)
            for cards in (False, True)
        )
    finally:
        gl.close()
    light, card = (
        ((one.code.astype(np.float32)[..., 1][one.draw > 0] / 65535) ** 2 * BRIGHTEST).astype(np.float32)
        for one in (view, cards)
    )
    sensor = Sensor(SETTINGS.sensor, Metering(meter(light, card)), BRIGHTEST, view.depth.shape, 1)
    image = sensor.develop(view.code, sensor.expose(0, view.code))
    return np.ascontiguousarray(image[..., ::-1]), float((view.draw > 0).mean())


def cell(image: Image | None, thumbnail: Path, name: str) -> Image:
    """Lay a picture beside a thumbnail, with its name below.

    Args:
        image: The picture, shape (H, W, 3), or None.
        thumbnail: File of the thumbnail.
        name: What to write.

    Returns:
        The cell, shape (H + 16, 2 W, 3), uint8.
    """
    pictures = []
    for one in (image, cv2.imread(str(thumbnail))):
        square = np.full((HEIGHT, WIDTH, 3), 60, np.uint8)
        if one is not None:
            scale = min(WIDTH / one.shape[1], HEIGHT / one.shape[0])
            small = cv2.resize(
                one,
                (max(1, int(one.shape[1] * scale)), max(1, int(one.shape[0] * scale))),
                interpolation=cv2.INTER_AREA,
            )
            square[: small.shape[0], : small.shape[1]] = small
        pictures.append(square)
    words = np.zeros((16, 2 * WIDTH, 3), np.uint8)
    cv2.putText(words, name[-64:], (2, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1, cv2.LINE_AA)
    return np.concatenate([np.concatenate(pictures, axis=1), words])


def sheet(cells: list[Image]) -> bytes:
    """Lay cells on a sheet.

    Args:
        cells: Cells of one size.

    Returns:
        A PNG file.
    """
    rows = math.ceil(len(cells) / ACROSS)
    height, width = cells[0].shape[:2]
    whole = np.zeros((rows * height, ACROSS * width, 3), np.uint8)
    for number, one in enumerate(cells):
        top, left = number // ACROSS * height, number % ACROSS * width
        whole[top : top + height, left : left + width] = one
    return cv2.imencode(".png", whole)[1].tobytes()


def page(drawn: list[Drawn], verdicts: dict[str, Any]) -> str:
    """Write the page.

    Args:
        drawn: What became of each stage.
        verdicts: What eyes found, path of the stage = reason: `wrong`; `nothing`, which rightly shows nothing;
            `noted`, right although the thumbnail differs; `missing`, which cannot be judged.
    """
    wrong, nothing, noted, missing = (verdicts.get(name, {}) for name in ("wrong", "nothing", "noted", "missing"))
    judged = [one for one in drawn if one.name not in missing]
    bad = [one for one in judged if one.name in wrong or (one.said and one.name not in nothing)]
    empty = [one for one in judged if one.name in nothing and one.said]
    right = len(judged) - len(bad)
    lines = [
        "# Stages from other sources",
        "",
        "Made by `python -m benchmarks.render.stages FOLDER`; FOLDER is a checkout of the public repository "
        "usd-wg/assets. Every picture was looked at beside the thumbnail of the stage; light and point of view are "
        "others. Right means the same shapes, in the same places, in the same colors, as far as another light lets",
        "one tell. ",
        "| | stages |",
        "|---|---|",
        f"| looked at | {len(judged)} |",
        f"| right | {right} ({100.0 * right / max(len(judged), 1):.0f} %) |",
        f"| of these with a picture | {right - len(empty)} of {len(judged) - len(empty)} |",
        f"| of these rightly without a picture | {len(empty)} |",
        f"| wrong or visibly limited | {len(bad)} |",
        "",
    ]
    told = {one.name: one.said for one in drawn}
    for title, rows in (
        ("wrong or limited", {one.name: wrong.get(one.name) or one.said for one in bad}),
        ("rightly without a picture", {one.name: nothing[one.name] for one in empty}),
        ("right, though the thumbnail shows something else", {name: noted[name] for name in noted if name in told}),
        ("not counted", {name: missing[name] for name in missing if name in told}),
    ):
        if rows:
            lines += [f"| {title} | why |", "|---|---|", *(f"| `{name}` | {why} |" for name, why in rows.items()), ""]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
