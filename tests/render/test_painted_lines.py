"""Lines painted on a road: as bright and as wide as many samples show them, from near and from far."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.gpu.bars import find_bars
from render.gpu.context import Gl
from render.gpu.ribbons import level_bars
from render.settings import RenderSettings
from render.views.passes import Painter
from render.views.prepare import prepare
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.flat_scene import Dome, Draws, FlatScene, Material, Sun
from usd_schemas.pinhole import Pinhole, look_at

F64 = NDArray[np.float64]

CAMERA = Pinhole(128, 96, 300.0, 300.0, 64.0, 48.0)
WIDTH, EDGE = 0.12, 1.75  # [m], and horizontal over vertical of a line's long edges
BELOW, ABOVE = 0.005, 0.006  # [m] of the road's surface
RUNS = (0.0, 0.25, 3.0, 6.0)  # [m] ends of the segments: the first one is hardly longer than the line is wide


def stripe() -> F64:
    """A line along x as our roads have them: a closed strip, wider at its foot, shape (T, 3, 3)."""
    foot, top = WIDTH / 2 + BELOW * EDGE, WIDTH / 2 - ABOVE * EDGE
    outline = np.array([[-foot, -BELOW], [foot, -BELOW], [top, ABOVE], [-top, ABOVE]])
    rings = np.array([[[x, y, z] for y, z in outline] for x in RUNS])
    faces = []
    for one, two in pairwise(rings):
        for k in range(4):
            m = (k + 1) % 4
            faces += [[one[k], two[m], two[k]], [one[k], one[m], two[m]]]
    for ring, way in ((rings[0], 1), (rings[-1], -1)):
        faces += [ring[[0, 3, 1][::way]], ring[[1, 3, 2][::way]]]
    return np.array(faces)


def painted() -> FlatScene:
    """A dark road with a white line, in low sun from the side."""
    builder = SceneBuilder(materials=[Material("asphalt", (0.05, 0.05, 0.05)), Material("paint", (0.7, 0.7, 0.7))])
    builder.add_box(placed((3.0, 0.0, -0.5), (40.0, 40.0, 1.0)), 1)
    corners = stripe()
    builder.add_mesh(corners, np.eye(4), 2, 2, 1)
    edge = (np.abs(builder.normals[-1][:, 2]) < 0.99) & (builder.normals[-1][:, 2] > 0.4)
    builder.normals[-1][edge] = [0.0, 0.0, 1.0]  # the long edges have the normals of the top
    scene = builder.build(np.eye(4)[None], CAMERA)
    return replace(scene, dome=Dome((0.2, 0.2, 0.2)), sun=Sun((0.1, 0.9, 0.42), (4.0, 4.0, 4.0)))


def linear(painter: Painter, pose: F64) -> F64:
    """The green light of a view, shape (H, W)."""
    return (painter.draw(pose, 0.1).code[..., 1] / 65535.0) ** 2


@pytest.mark.parametrize(("width", "most"), [(7.0, 0.25), (4.0, 0.25), (2.0, 0.5), (0.7, 0.25)])
def test_a_line_is_as_bright_as_its_samples(
    width: float, most: float, gl: Gl, small: RenderSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """7 to 0.7 px wide at 20 degrees: light within 10 % of 8x8 samples, a quarter of the error of single samples.

    Half of it at 2 px, where surface and ribbon share the line.
    """
    settings = small.model_copy(update={"normals": False, "haze_distance": 1e9, "shadow_size": 1024})
    away = CAMERA.fx * WIDTH * np.sin(np.radians(20.0)) / width
    eye = np.array([2.6, -away * np.cos(np.radians(20.0)), away * np.sin(np.radians(20.0))])
    pose = look_at(eye, np.array([3.0, 0.0, 0.0]), np.array([0.06, 0.0, 1.0]))
    painter = prepare(gl, painted(), settings, SILENT).painter(CAMERA, sharp=True)
    shown = linear(painter, pose)
    monkeypatch.setattr(painter, "_coverage_layer", None)
    sampled, truth = linear(painter, pose), np.zeros(shown.shape)
    for row in range(8):
        for column in range(8):
            x, y = ((place + 0.5) / 8 - 0.5 for place in (column, row))
            monkeypatch.setattr(painter, "_camera", replace(CAMERA, cx=CAMERA.cx - x, cy=CAMERA.cy - y))
            truth += linear(painter, pose) / 64
    band, road = (slice(30, 66), slice(45, 84)), np.median(truth)
    assert (shown[band] - road).sum() == pytest.approx((truth[band] - road).sum(), rel=0.10)
    left = [np.sqrt(((image - truth)[band] ** 2).mean()) for image in (shown, sampled)]
    assert left[0] < most * left[1]


def test_a_line_is_one_flat_bar() -> None:
    """All of its sections have its width at half its height, and its thickness, the short piece at its end too."""
    bars = find_bars(painted())
    assert len(bars.part) >= 2
    width = WIDTH + EDGE * (BELOW - ABOVE)
    np.testing.assert_allclose(2 * np.linalg.norm(bars.first, axis=-1), width, atol=0.025)
    np.testing.assert_allclose(2 * np.linalg.norm(bars.second, axis=-1), BELOW + ABOVE, atol=1e-4)


def test_a_line_may_be_invisible_at_first() -> None:
    """A part without a draw in the first image lies on nothing; others keep their tops."""
    scene = painted()
    bars = find_bars(scene)
    parts = np.unique(bars.part)
    found, tops = level_bars(scene, bars, parts)
    assert found[parts].all()
    assert np.abs(tops).max() > 0
    rest = Draws(**{name: values[scene.draws.part != parts[0]] for name, values in vars(scene.draws).items()})
    found, tops = level_bars(replace(scene, draws=rest), bars, parts)
    assert not found.any()
    assert not tops.any()
