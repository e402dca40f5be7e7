"""A river's color by its depth: the picture of its bed lies where the bed lies, and ends in deep water."""

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.looks.shallows import shallows
from authoring.shapes.component import Component
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream


@pytest.fixture(scope="module")
def site() -> Site:
    """A bridge of two spans over a river."""
    layout = Layout(Alignment(8.0), (0.0, 32.0, 64.0), 10.0, 1.5)
    return draw_site(SiteSettings(crossing="river"), layout, stream(5, "site"))


def water_of(site: Site) -> Component:
    """Find the site's stretch of river."""
    return next(part for part in site.pieces if isinstance(part, Component) and part.kind == "water")


def test_the_picture_lies_on_the_water_once(site: Site) -> None:
    """Every corner has a place of its own on it, from bank to bank and from edge to edge of the site."""
    mesh = water_of(site).mesh
    assert mesh.st1.min() == 0.0
    assert mesh.st1.max() == 1.0
    places = {(corner, *place) for corner, place in zip(mesh.corners.tolist(), mesh.st1.tolist(), strict=True)}
    assert len(places) == len(mesh.points) == len({place[1:] for place in places})


def test_shallow_water_shows_its_bed_and_deep_water_does_not(site: Site) -> None:
    """Where the charts say that a texel lies, the depth of the ground below tells its color; the edges show none."""
    pixels = 256
    picture = shallows(site, pixels, stream(5, "surface/shallows"))
    mesh, crossing = water_of(site).mesh, site.land.crossing
    order = np.argsort(mesh.corners, kind="stable")[np.searchsorted(np.sort(mesh.corners), np.arange(len(mesh.points)))]
    chart, row = mesh.st1[order], len(mesh.points) // 3
    for rows in (slice(0, row), slice(row, 2 * row)):  # along the left bank, and along the middle
        at = np.minimum((chart[rows] * pixels).astype(int), pixels - 1)
        depth = crossing.level - site.ground(mesh.points[rows, :2])
        red = picture[pixels - 1 - at[:, 1], at[:, 0], 0]
        inside = np.abs(chart[rows, 0] - 0.5) < 0.35
        shallow = red[inside & (depth < 0.0)]
        assert not len(shallow) or np.median(shallow) > 1.5
        assert (red[inside & (depth > 1.0)] < 1.25).all()
        assert np.any(inside)
    np.testing.assert_allclose(picture[:, [0, -1]], 1.0, atol=0.02)
    assert picture.min() > 0.0
    assert picture.max() < 2.0
    deep = picture[pixels // 2, pixels // 4 : 3 * pixels // 4]
    assert np.ptp(deep.mean(axis=-1)) < 0.3
