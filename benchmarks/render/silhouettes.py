"""Compare the edges of photographs with 8x8 samples in every pixel, on six views of a bridge, and write the page.

Usage: python -m benchmarks.render.silhouettes.
"""

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from authoring.families.bridge_settings import draw_layout
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from authoring.site.site import draw_site
from authoring.streams import stream
from benchmarks.page import write_page
from benchmarks.speed_unit import this_machine
from falsework.gallery.world_views import world_views
from groundwork.progress import SILENT
from groundwork.settings import parse_settings
from render.gpu.context import Gl, open_context
from render.settings import RenderSettings
from render.views.passes import Painter, ViewOptions
from render.views.prepare import Prepared, prepare
from usd_schemas.pinhole import Pinhole, look_at
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
Bools = NDArray[np.bool_]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "silhouettes.md"
SEED = 7
VIEWS = ("eye height", "under the deck", "5 m from a pier", "air", "beside the parapet", "on the deck")
BRIDGE = {
    "bridge": {"family": "girder", "service": "road"},
    "background": {"name": "none"},
    "look": {"name": "clean", "texels": 256},
    "light": {"sky_height": 64},
    "site": {"half_width": 40, "run_out": 40, "scatter": {"tufts": 60, "stones": 40, "shrubs": 5, "reeds": 5}},
    "survey": [{"kind": "global", "images": 8, "spacing": 50.0}],
}
_BENT = "for a lens that distorts"
WAYS = (
    ("`standard`: smooth edges", {"quality": "standard", "edge_samples": 0}),
    *(
        (f"`standard`, {count} edge samples", {"quality": "standard", "edge_samples": count})
        for count in (5, 10, 17, 26, 37)
    ),
    (f"`standard`, {_BENT}", {"quality": "standard", "edge_samples": 0}),
    (f"`standard`, {_BENT}, 17 edge samples", {"quality": "standard", "edge_samples": 17}),
    ("`fine` without edge samples: 2x2", {"quality": "fine", "edge_samples": 0}),
    ("`fine`: 2x2, 17 edge samples", {"quality": "fine"}),
)
_WIDTH, _HEIGHT = 960, 720
_MEAN = 0.2  # linear mean that a view is exposed to
_FINER = 4  # ids along a side of a pixel, as through a lens
_DRAWN = 3  # times; the least time counts


@dataclass(frozen=True)
class Bridge:
    """A bridge that is ready to draw, the cameras of `VIEWS`, and what they look through."""

    ready: Prepared
    poses: F64
    camera: Pinhole

    def painter(self, view: int, changes: dict[str, object], *, bent: bool = False) -> Painter:
        """Create a painter for one view with other settings; or one for a lens that distorts."""
        self.ready.sharpen_shadows(self.ready.shadow_squares(self.poses, self.camera), view)
        settings = self.ready.settings.model_copy(update=changes)
        ready = replace(self.ready, settings=settings)
        if not bent:
            return ready.painter(self.camera, sharp=True)
        options = ViewOptions(settings.quality, "TRIANGLES", _FINER, edge_samples=settings.samples_on_edges)
        return Painter(ready.gl, ready.programs, ready.gpu, ready.lamps, self.camera, options)


def prepare_bridge(gl: Gl, folder: Path, quality: str = "standard") -> Bridge:
    """Author the bridge, and prepare it for drawing.

    Args:
        gl: Open context.
        folder: Where its stage goes; one that is there is used.
        quality: Whose textures it needs.
    """
    settings = parse_settings(AuthoringSettings, BRIDGE, "silhouettes")
    if not (folder / "scene.usda").is_file():
        author_scene(settings, SEED, folder, SILENT)
    focal = _WIDTH * 24 / 36
    camera = Pinhole(_WIDTH, _HEIGHT, focal, focal, _WIDTH / 2, _HEIGHT / 2)
    render = {"shadow_size": 4096, "volume_probes": 1500, "volume_rays": 32, "haze_distance": 1e9, "quality": quality}
    ready = prepare(
        gl, read_stage(folder / "scene.usda"), parse_settings(RenderSettings, render, "silhouettes"), SILENT
    )
    return Bridge(ready, six_views(settings), camera)


def six_views(settings: AuthoringSettings) -> F64:
    """Place the cameras of `VIEWS`, shape (6, 4, 4)."""
    layout, _ = draw_layout(settings.bridge, stream(SEED, "bridge"))
    four = world_views(layout, draw_site(settings.site, layout, stream(SEED, "site")))
    middle, side = 0.5 * (layout.supports[0] + layout.supports[-1]), 0.5 * layout.width

    def at(station: float, left: float, above: float) -> F64:
        return layout.alignment.point(np.array([station]), np.array([left]), np.array([above]))[0]

    drone = look_at(at(middle - 8, side + 7, 2.0), at(middle + 4, side, -0.5))
    walker = look_at(at(middle - 6, -0.4 * side, 1.7), at(middle + 10, 0.2 * side, 0.8))
    return np.concatenate([four, [drone, walker]])


def light_of(painter: Painter, pose: F64) -> F64:
    """Linear light of a view over the brightest one [1], shape (H, W, 3)."""
    return (painter.draw(pose, 0.1).code / 65535.0) ** 2


def supersampled(painter: Painter, camera: Pinhole, pose: F64, count: int) -> tuple[F64, F64, Bools]:
    """Light of one sample a pixel and of count x count, shape (H, W, 3); pixels that show several draws, (H, W).

    Args:
        painter: Of `standard`; it draws single samples from now on.
        camera: Its intrinsics.
        pose: Camera pose [m], shape (4, 4), float64.
        count: Samples along each side of a pixel.
    """
    painter._coverage_layer = painter._edge_samples = None  # neither ribbons nor smooth edges
    one, total = painter.draw(pose, 0.1), np.zeros((camera.height, camera.width, 3))
    mixed = np.zeros(one.draw.shape, bool)
    for row in range(count):
        for column in range(count):
            x, y = ((place + 0.5) / count - 0.5 for place in (column, row))
            painter._camera = replace(camera, cx=camera.cx - x, cy=camera.cy - y)
            view = painter.draw(pose, 0.1)
            total += (view.code / 65535.0) ** 2
            mixed |= view.draw != one.draw
    return (one.code / 65535.0) ** 2, total / count**2, mixed


def rms_codes(light: F64, truth: F64, mixed: Bools) -> float:
    """RMS difference of two views over some pixels, as sRGB codes [255].

    Args:
        light: Linear light, shape (H, W, 3).
        truth: What it is compared with, shape (H, W, 3); it decides the exposure.
        mixed: The pixels, shape (H, W).
    """
    exposure = _MEAN / float(truth.mean())
    return float(np.sqrt(np.mean((_coded(light[mixed], exposure) - _coded(truth[mixed], exposure)) ** 2)))


def _coded(light: F64, exposure: float) -> F64:
    light = np.clip(light * exposure, 0, 1)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def _seconds(painter: Painter, pose: F64) -> float:
    """Processor time of a view [s], the least of a few."""
    taken = []
    for _ in range(_DRAWN):
        start = time.process_time()
        painter.draw(pose, 0.1)
        taken.append(time.process_time() - start)
    return min(taken)


def main() -> None:
    """Draw all views in all ways, and write the page."""
    errors: dict[str, list[float]] = {name: [] for name in ("one sample", *(name for name, _ in WAYS))}
    seconds = {name: 0.0 for name, _ in WAYS}
    share = []
    gl = open_context()
    with tempfile.TemporaryDirectory() as scratch:
        bridge = prepare_bridge(gl, Path(scratch), "fine")
        for view, pose in enumerate(bridge.poses):
            single, truth, mixed = supersampled(bridge.painter(view, {"quality": "standard"}), bridge.camera, pose, 8)
            errors["one sample"].append(rms_codes(single, truth, mixed))
            share.append(float(mixed.mean()))
            for name, changes in WAYS:
                painter = bridge.painter(view, {"edge_samples": None, **changes}, bent=_BENT in name)
                errors[name].append(rms_codes(light_of(painter, pose), truth, mixed))
                seconds[name] += _seconds(painter, pose)
    gl.close()
    write_page(PAGE, _page(errors, seconds, share), __file__)


def _page(errors: dict[str, list[float]], seconds: dict[str, float], share: list[float]) -> str:
    usual = seconds[WAYS[0][0]]
    rows = [
        f"| {name} | "
        + " | ".join(f"{error:.1f}" for error in found)
        + (f" | {seconds[name] / len(VIEWS):.2f} | {seconds[name] / usual:.1f} |" if name in seconds else " | | |")
        for name, found in errors.items()
    ]
    return f"""# Edges of photographs

Written by `python -m benchmarks.render.silhouettes`. {this_machine()}; {_WIDTH} x {_HEIGHT} px.
How far photographs are from 8x8 samples in every pixel: RMS of the difference [codes of 255], over the pixels
in which these samples show several parts ({min(share):.1%} to {max(share):.1%} of a view). A bridge of girders on its
site, without a world. Processor time of drawing a view, without sensor and encoding: the mean of the views, each
the least of {_DRAWN}.

| photograph | {" | ".join(VIEWS)} | processor [s] | times `standard` |
|---|{"---|" * len(VIEWS)}---|---|
{chr(10).join(rows)}

For a lens that distorts, ids are {_FINER} times as fine as pixels, and are most of the cost; the image is then
resampled, which is not counted. The 8x8 samples have noise of their own. In a world with trees more pixels show
several parts, and edge samples cost more.
"""


if __name__ == "__main__":
    main()
