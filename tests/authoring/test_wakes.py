"""Wakes of piers in a river: foam at the upstream face and downstream, and nothing at all without such piers."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.backgrounds.solids import Frame, box
from authoring.looks.shallows import shallows
from authoring.looks.wakes import with_wakes
from authoring.shapes.component import Component
from authoring.site.roads import water_half
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream

PIXELS = 512
WIDTH, LENGTH = 1.6, 3.0  # of the pier, across and along the current [m]


@pytest.fixture(scope="module", params=(0.0, 0.4))
def site(request: pytest.FixtureRequest) -> Site:
    """A bridge of two spans over a river, square and skewed."""
    layout = Layout(Alignment(8.0, skew=request.param), (0.0, 48.0, 96.0), 10.0, 1.5)
    coarse = SiteSettings(crossing="river", fine_spacing=2.0, coarse_spacing=4.0)
    return draw_site(coarse, layout, stream(5, "site"))


def pier(site: Site, aside: float = 0.0, height: float = 6.0, width: float = WIDTH) -> Component:
    """Put a wall of concrete, in line with the current, below the axis at a distance from the river's middle."""
    crossing, axis = site.land.crossing, site.land.layout.alignment
    left = np.array([-0.5, 0.0, 0.5])
    line = axis.point(crossing.center(left), left, np.zeros(3))[:, :2]
    ahead = (line[2] - line[0]) / np.linalg.norm(line[2] - line[0])
    beside = line[1] + aside * np.array([-ahead[1], ahead[0]])
    frame = Frame(float(beside[0]), float(beside[1]), crossing.level, float(np.arctan2(ahead[1], ahead[0])))
    mesh = box(frame, (0.0, 0.0, 0.5 * height - 1.5), (0.5 * LENGTH, 0.5 * width, 0.5 * height + 1.5))
    return Component("Pier", "wall_pier", "Role_PierConcrete", "Substructure", mesh, 1)


def places(site: Site) -> NDArray[np.float64]:
    """List distances of texels downstream and to the left of the axis' middle of the river [m], shape (P, P, 2)."""
    crossing, axis, lefts = site.land.crossing, site.land.layout.alignment, site.field.lefts
    steps, half = (np.arange(PIXELS) + 0.5) / PIXELS, water_half(site.land.crossing)
    left, side = np.meshgrid(lefts[0] + steps * (lefts[-1] - lefts[0]), half - 2 * half * steps)
    station = crossing.center(left) - side * crossing.stretch(left)
    world = axis.point(station.ravel(), left.ravel(), np.zeros(left.size))[:, :2]
    line = axis.point(crossing.center(np.array([-0.5, 0.0, 0.5])), np.array([-0.5, 0.0, 0.5]), np.zeros(3))[:, :2]
    ahead = (line[2] - line[0]) / np.linalg.norm(line[2] - line[0])
    offset = world - line[1]
    return np.stack([offset @ ahead, offset @ np.array([-ahead[1], ahead[0]])], -1).reshape(PIXELS, PIXELS, 2)


def test_foam_lies_downstream_of_a_pier_and_at_its_upstream_face(site: Site) -> None:
    """Upstream there is only a narrow rim; downstream, foam spreads to both sides alike and ends; behind it is calm."""
    bed = shallows(site, PIXELS, stream(5, "surface/shallows"))
    total = np.zeros(bed.shape[:2])
    for seed in range(4):  # their mean has less noise
        total += (with_wakes(bed, site, (pier(site),), stream(seed, "surface/wakes")) - bed)[..., 1] / 4
    ahead, aside = np.moveaxis(places(site), -1, 0)
    beside = np.abs(aside) < 0.5 * WIDTH
    upstream = ahead < -0.5 * LENGTH
    assert total[upstream & (ahead > -0.5 * LENGTH - 0.15) & beside].mean() > 0.2
    assert not total[ahead < -0.5 * LENGTH - 1.2].any()
    behind = (ahead > 0.5 * LENGTH) & (ahead < 0.5 * LENGTH + 6.0 * WIDTH)
    assert total[behind & (np.abs(aside) < 3.0 * WIDTH)].max() > 0.2
    assert not total[ahead > 0.5 * LENGTH + 10.0 * WIDTH].any()
    calm = (ahead > 0.5 * LENGTH + 0.4) & (ahead < 0.5 * LENGTH + 1.5 * WIDTH) & (np.abs(aside) < 0.2 * WIDTH)
    assert np.median(total[calm]) < -0.1
    foam = np.maximum(total, 0.0)
    left, right = (foam[behind & (sign * aside > 0.6 * WIDTH)].sum() for sign in (1.0, -1.0))
    assert 0.6 < left / right < 1.6
    spread = np.abs(aside)[(total > 0.05) & (ahead > 0.0)]
    assert spread.max() < 0.5 * WIDTH + 0.35 * (0.5 * LENGTH + 9.0 * WIDTH)


def test_a_river_without_piers_in_it_keeps_its_picture(site: Site) -> None:
    """Piers on a bank, under the surface, or as wide as the river, and water without a current, change no bit."""
    bed = shallows(site, 64, stream(5, "surface/shallows"))
    half = site.land.crossing.half_width
    dry = (pier(site, aside=half + 3.0), pier(site, height=-0.5), pier(site, width=1.2 * half))
    for bridge in ((), *((piece,) for piece in dry)):
        rng = stream(5, "surface/wakes")
        assert with_wakes(bed, site, bridge, rng) is bed
        assert rng.random() == stream(5, "surface/wakes").random()
    harbor = replace(site, land=replace(site.land, crossing=replace(site.land.crossing, depth=6.0)))
    assert with_wakes(bed, harbor, (pier(site),), stream(5, "surface/wakes")) is bed
    assert not np.array_equal(with_wakes(bed, site, (pier(site),), stream(5, "surface/wakes")), bed)
