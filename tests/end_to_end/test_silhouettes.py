"""How far the edges of a photograph are from 8x8 supersampling, on six views of a bridge."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
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
from render.views.prepare import Prepared, prepare
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


@dataclass(frozen=True)
class Bridge:
    """A bridge that is ready to draw, the cameras of `VIEWS`, and what they look through."""

    ready: Prepared
    poses: F64
    camera: Pinhole


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory, proof_count: Count) -> Iterator[Bridge]:
    """Author and prepare the bridge once for all views."""
    if not proof_count(0, 1):
        pytest.skip("runs with --proof only (make proof): `tests/render/test_edges.py` is the quick one")
    folder = tmp_path_factory.mktemp("silhouettes")
    settings = parse_settings(AuthoringSettings, BRIDGE, "silhouettes")
    author_scene(settings, SEED, folder, SILENT)
    width = 960
    height = width * 3 // 4
    camera = Pinhole(width, height, width * 24 / 36, width * 24 / 36, width / 2, height / 2)
    render = RenderSettings(shadow_size=4096, volume_probes=1500, volume_rays=32, haze_distance=1e9)
    gl = open_context()
    yield Bridge(prepare(gl, read_stage(folder / "scene.usda"), render, SILENT), six_views(settings), camera)
    gl.close()


@pytest.mark.parametrize("view", VIEWS)
def test_silhouettes_are_closer_to_8x8_samples(view: str, bridge: Bridge, record_proof: RecordProof) -> None:
    """Over pixels that show several parts: RMS difference in codes of 255, below 3/4 of that of single samples."""
    pose = bridge.poses[VIEWS.index(view)]
    bridge.ready.sharpen_shadows(bridge.ready.shadow_squares(bridge.poses, bridge.camera), VIEWS.index(view))
    painter = bridge.ready.painter(bridge.camera, sharp=True)
    shown = (painter.draw(pose, 0.1).code / 65535.0) ** 2
    sampled, truth, mixed = supersampled(painter, bridge.camera, pose, 8)
    exposure = _MEAN / float(truth.mean())
    goal = coded(truth, exposure)[mixed]
    after, before = (float(np.sqrt(np.mean((coded(image, exposure)[mixed] - goal) ** 2))) for image in (shown, sampled))
    assert after < 0.75 * before
    figures = {"rms_codes": round(after, 2), "single_samples_rms_codes": round(before, 2)}
    record_proof(f"render/silhouettes against 8x8 samples: {view}", int(mixed.sum()), SEED, figures)
