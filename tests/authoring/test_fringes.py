"""Tall grass along borders: each tuft has a border of a field within reach, found by looking all round it."""

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.shapes.component import Scatter
from authoring.site.fringes import BORDERED
from authoring.site.land import no_hills
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream

F64 = NDArray[np.float64]
LAYOUT = Layout(Alignment(7.0, 0.0, 0.4), (0.0, 18.0, 40.0), 11.5, 1.9)
REACH = 0.6  # [m] over what a place may be off the border, 0.48


def site_of(crossing: str, tufts: int) -> Site:
    """Draw a site."""
    asked = {"crossing": crossing, "scatter": {"tufts": tufts}}
    return draw_site(SiteSettings.model_validate(asked), LAYOUT, stream(3, "site"))


def fringe(site: Site) -> F64:
    """Give station and left of its tufts along borders, shape (N, 2)."""
    (run,) = [piece for piece in site.pieces if isinstance(piece, Scatter) and piece.name == "Site_Fringes"]
    return np.column_stack(site.land.layout.alignment.locate(run.positions))


@pytest.mark.parametrize("crossing", ["river", "road"])
def test_every_tuft_stands_at_a_border(crossing: str) -> None:
    """A disk of 0.6 m round it holds places inside a cover and places outside of all."""
    site = site_of(crossing, 1200)
    places = fringe(site)
    assert len(places) > 150
    steps = np.linspace(-REACH, REACH, 13)
    disk = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    disk = disk[np.hypot(*disk.T) <= REACH]
    round_each = places[:, None] + disk
    covers = site.land.shape(round_each[..., 0], round_each[..., 1], no_hills).covers
    inside = np.max([covers[name] for name in BORDERED if name in covers], axis=0) > 0.0
    at_border = inside.any(axis=1) & ~inside.all(axis=1)
    assert at_border.mean() > 0.99
    middle = site.land.shape(places[:, 0], places[:, 1], no_hills).covers
    assert all((middle[name] < 0.0).all() for name in BORDERED if name in middle)


def test_most_stand_near_the_bridge_and_without_tufts_none() -> None:
    """Half of them lie within a third of the site's width, and the setting of tufts sets their number, too."""
    places = fringe(site_of("road", 1200))
    assert (np.abs(places[:, 1]) < 0.5 * LAYOUT.width + 20.0).mean() > 0.5
    bare = site_of("road", 0)
    assert not {"Site_Fringes", "Site_Tufts"} & {piece.name for piece in bare.pieces}
