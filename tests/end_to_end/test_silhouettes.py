"""How far the edges of a photograph are from 8x8 supersampling, on six views of a bridge."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from authoring.families.bridge_settings import draw_layout
from authoring.scene import author_scene
from authoring.settings import AuthoringSettings
from authoring.site.site import draw_site
from authoring.streams import stream
from falsework.gallery.world_views import world_views
from groundwork.progress import SILENT
from groundwork.settings import parse_settings
from render.gpu.context import open_context
from render.settings import RenderSettings
from render.views.passes import Painter
from render.views.prepare import prepare
from tests.conftest import Count, RecordProof
from usd_schemas.pinhole import Pinhole, look_at
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]
Bools = NDArray[np.bool_]

SEED = 7
BRIDGE = {
    "bridge": {"family": "girder", "service": "road"},
    "background": {"name": "none"},
    "look": {"name": "clean", "texels": 256},
    "light": {"sky_height": 64},
    "site": {"half_width": 40, "run_out": 40, "scatter": {"tufts": 60, "stones": 40, "shrubs": 5, "reeds": 5}},
    "survey": [{"kind": "global", "images": 8, "spacing": 50.0}],
}
VIEWS = ("eye height", "under the deck", "5 m from a pier", "air", "beside the parapet", "on the deck")
_MEAN = 0.2  # linear mean that a view is exposed to


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


def coded(light: F64, exposure: float) -> F64:
    """Linear light as an sRGB code [255]."""
    light = np.clip(light * exposure, 0, 1)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def supersampled(painter: Painter, camera: Pinhole, pose: F64, count: int) -> tuple[F64, F64, Bools]:
    """Light of one sample a pixel and of count x count, shape (H, W, 3); pixels that show several draws, (H, W)."""
    painter._coverage_layer = None  # neither ribbons nor smooth edges
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


def test_silhouettes_are_close_to_8x8_samples(tmp_path: Path, proof_count: Count, record_proof: RecordProof) -> None:
    """Over the pixels that show several parts: the RMS difference in codes of 255, less than of single samples.

    A quick run looks at two views of 240 x 180 against 4x4 samples, a proof at all six at 960 x 720 against 8x8.
    """
    settings = parse_settings(AuthoringSettings, BRIDGE, "silhouettes")
    author_scene(settings, SEED, tmp_path, SILENT)
    width, count = proof_count(240, 960), proof_count(4, 8)
    height = width * 3 // 4
    camera = Pinhole(width, height, width * 24 / 36, width * 24 / 36, width / 2, height / 2)
    render = RenderSettings(shadow_size=proof_count(1024, 4096), volume_probes=1500, volume_rays=32, haze_distance=1e9)
    poses, figures, left = six_views(settings), {}, []
    gl = open_context()
    try:
        ready = prepare(gl, read_stage(tmp_path / "scene.usda"), render, SILENT)
        squares = ready.shadow_squares(poses, camera)
        for number in (range(4, 6), range(6))[proof_count(0, 1)]:
            ready.sharpen_shadows(squares, number)
            painter = ready.painter(camera, sharp=True)
            shown = (painter.draw(poses[number], 0.1).code / 65535.0) ** 2
            sampled, truth, mixed = supersampled(painter, camera, poses[number], count)
            exposure = _MEAN / float(truth.mean())
            goal = coded(truth, exposure)[mixed]
            errors = [
                float(np.sqrt(np.mean((coded(image, exposure)[mixed] - goal) ** 2))) for image in (shown, sampled)
            ]
            name = VIEWS[number].replace(" ", "_")
            figures |= {f"{name}_codes": round(errors[0], 2), f"{name}_single_samples_codes": round(errors[1], 2)}
            left.append(errors)
    finally:
        gl.close()
    after, before = np.sqrt((np.array(left) ** 2).mean(axis=0))
    assert after < 0.75 * before, left
    figures |= {"all_views_codes": round(float(after), 2), "all_views_single_samples_codes": round(float(before), 2)}
    record_proof("render/silhouettes against 8x8 samples", len(left), SEED, figures)
