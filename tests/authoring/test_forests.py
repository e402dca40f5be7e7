"""Forests on far hills and fields in valleys: where they stand, and what they keep clear of."""

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.backgrounds.countryside import FORESTS
from authoring.backgrounds.forests import CANOPY, Forests, draw_forests
from authoring.backgrounds.hillside import HillsideSettings
from authoring.backgrounds.lakeside import LakesideSettings
from authoring.backgrounds.registry import BackgroundSettings
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream

F64 = NDArray[np.float64]
LAYOUT = Layout(Alignment(7.0), (0.0, 18.0, 40.0), 11.5, 1.9)
INNER = (-60.0, 100.0, -80.0, 80.0)
FEW = BackgroundSettings(
    lakeside=LakesideSettings(reach=2500.0, villas=25, town_houses=6, trees=150, boats=8),
    hillside=HillsideSettings(reach=2500.0, houses=40, blocks=8, sheds=4, cranes=2, trees=150),
)


@pytest.fixture(scope="module")
def site() -> Site:
    """A site on a river."""
    return draw_site(SiteSettings(crossing="river", fine_spacing=1.6, coarse_spacing=5.0), LAYOUT, stream(7, "site"))


def places(count: int) -> tuple[F64, F64]:
    """Random stations and lefts round the site [m], each shape (N,)."""
    station, left = np.random.default_rng(4).uniform(-2200.0, 2200.0, (2, count))
    return station, left


def forests_of(site: Site) -> Forests:
    """Forests round it."""
    return draw_forests(site.land, INNER, FORESTS, stream(7, "background"))


def test_forests_stand_far_off_beside_river_and_roads(site: Site) -> None:
    """They fill a good part of the far land, none of the near land, and no way; the land carries them there alone."""
    forests, land = forests_of(site), site.land
    station, left = places(20_000)
    inside = forests.field(station, left)
    far = np.maximum(np.abs(station - 20.0) - 80.0, np.abs(left) - 80.0)
    assert (inside[far < FORESTS * 0.7] < 0.0).all()
    assert 0.25 < (inside[far > 1400.0] > 0.0).mean() < 0.9
    assert (inside[land.crossing.distance(station, left) < land.crossing.half_width + 20.0] < 0.0).all()
    for approach in land.approaches:
        on_road = (approach.along(station) > 0.0) & (np.abs(left - approach.center(station)) < 20.0)
        assert on_road.any()
        assert (inside[on_road] < 0.0).all()
    rise = forests.over(lambda x, y: 0.01 * x)(station, left) - 0.01 * station
    assert np.array_equal(rise > 1e-9, inside > 1e-3) or (np.abs(inside[(rise > 1e-9) != (inside > 1e-3)]) < 0.02).all()
    assert np.isclose(rise.max(), CANOPY)
