"""Lines of the terrain that end outwards: nothing torn, nothing folded, nothing missed by more than is allowed."""

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.backgrounds.terrain import SLACK, Terrain, grow_terrain, rolling_hills
from authoring.backgrounds.terrain_lines import Demands, Middle, interpolated_heights, outer_triangles, thin_out
from authoring.site.grid import HeightField
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
LINES = np.concatenate(
    [-np.cumsum(1.3 ** np.arange(14))[::-1] - 10.0, np.arange(-10.0, 10.5, 0.5), 10.0 + np.cumsum(1.3 ** np.arange(14))]
)
MIDDLE = Middle((14, 54), (14, 54))


def borders(faces: I64) -> set[tuple[int, int]]:
    """Directed edges that no other triangle runs the other way."""
    edges = {(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    assert len(edges) == 3 * len(faces)  # no edge twice the same way: no fold, no double
    return {(a, b) for a, b in edges if (b, a) not in edges}


def coarse(heights: F64, slack: float) -> tuple[HeightField, NDArray[np.bool_]]:
    """Thin a square field out."""
    field = HeightField(LINES, LINES, heights)
    even = np.full(heights.shape, slack)
    nothing = np.zeros(0, np.int64)
    return field, thin_out(field, MIDDLE, Demands(heights, even, (), even), (nothing, nothing))


def test_mesh_is_whole_and_keeps_what_shows() -> None:
    """The ring round the site is closed, faces upwards, and a ridge keeps its lines while the plain loses them."""
    x, y = np.meshgrid(LINES, LINES, indexing="ij")
    heights = np.where(np.abs(x - 3.0) < 0.6, 2.0, 0.0) + 0.001 * y
    field, kept = coarse(heights, 0.01)
    faces = outer_triangles(MIDDLE, kept)
    place = np.stack([x, y], axis=-1).reshape(-1, 2)
    one, two, three = (place[faces[:, k]] for k in range(3))
    area = (two - one)[:, 0] * (three - one)[:, 1] - (two - one)[:, 1] * (three - one)[:, 0]
    assert (area > 0.0).all()
    assert 0.5 * area.sum() == pytest.approx((LINES[-1] - LINES[0]) ** 2 - 20.0**2)
    rim = {node for edge in borders(faces) for node in edge}
    inner = np.arange(heights.size).reshape(heights.shape)[14:55, 14:55]
    ring = {*inner[0].tolist(), *inner[-1].tolist(), *inner[:, 0].tolist(), *inner[:, -1].tolist()}
    assert ring <= rim
    assert all(np.abs(place[node]).max() == pytest.approx(np.abs(LINES).max()) for node in rim - ring)
    assert len(faces) < 0.7 * 2 * (68 * 68 - 40 * 40)
    ridge = np.flatnonzero(np.abs(LINES - 3.0) < 0.6)
    assert kept[[ridge[0] - 1, ridge[0], ridge[-1], ridge[-1] + 1], -1].all()
    assert kept[14:55, -1].sum() < 15
    level = interpolated_heights(heights, field, MIDDLE, kept)
    assert np.abs(level - heights).max() <= 0.01 + 1e-4
    np.testing.assert_allclose(level[kept], heights[kept], atol=1e-4)


def test_flat_land_needs_few_lines() -> None:
    """On a plain the spacing of lines grows with the distance; where nothing may be missed every line goes on."""
    _, kept = coarse(np.zeros((len(LINES), len(LINES))), 0.01)
    counts = kept[14:55, 54:].sum(axis=0)
    assert counts[0] == 41
    assert counts[-1] < 12
    assert (np.diff(counts) <= 0).all()
    rough = np.random.default_rng(1).normal(size=(len(LINES), len(LINES)))
    assert coarse(rough, 1e-9)[1].all()


@pytest.mark.parametrize("crossing", ["river", "road"])
def test_terrain_misses_no_more_than_it_may(crossing: str) -> None:
    """Along every line that ended the land lies within the slack of its distance of what was drawn."""
    layout = Layout(Alignment(9.0), (0.0, 30.0, 60.0), 11.5, 1.9)
    site = draw_site(SiteSettings.model_validate({"crossing": crossing}), layout, stream(4, "site"))
    own = site.field
    inner = (float(own.stations[0]), float(own.stations[-1]), float(own.lefts[0]), float(own.lefts[-1]))
    hills = rolling_hills(site.land, inner, 42.0, np.random.default_rng(3))
    terrain: Terrain = grow_terrain(site, hills, 1500.0)
    station, left = terrain.nodes()
    drawn = site.land.shape(station, left, hills).height
    away = terrain.beyond(station, left)
    allowed = np.minimum(SLACK[0] + SLACK[1] * away, SLACK[2])
    outside = away > 0.0
    assert (np.abs(terrain.field.heights - drawn)[outside] <= allowed[outside] + 2e-4).all()
    assert terrain.kept[outside].mean() < 0.6
