"""Rivers with piers in them: how often, round which piers, and that every other river keeps every byte."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.families.bridge_settings import draw_layout
from authoring.families.registry import build_bridge
from authoring.looks.shallows import shallows
from authoring.looks.wakes import with_wakes
from authoring.site.land import draw_land
from authoring.site.river_piers import BANK, ON_LAND, SHARE, WIDEST
from authoring.site.shape import Land
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from groundwork.errors import InputError
from tests.authoring.bridges.built import settings_of
from tests.authoring.test_site import fingerprint

SEEDS = 40
COARSE = SiteSettings(crossing="river", fine_spacing=2.0, coarse_spacing=8.0)
LONG = Layout(Alignment(8.0), (0.0, 20.0, 42.0, 64.0, 86.0, 106.0), 11.0, 1.6, river_piers=True)
SKEWED = replace(LONG, alignment=Alignment(8.0, skew=0.45))
HIGH = Layout(Alignment(14.0), (0.0, 34.0, 76.0, 118.0, 152.0), 12.0, 2.2, river_piers=True)


def river(layout: Layout, seed: int) -> Land:
    """Draw the land of one river."""
    return draw_land("river", 1.0, layout, 60.0, stream(seed, "site"))


def without(layout: Layout) -> Layout:
    """The same bridge, which keeps out of rivers."""
    return replace(layout, river_piers=False)


@pytest.mark.parametrize("layout", [LONG, SKEWED, HIGH], ids=["long", "skewed", "high"])
def test_piers_in_the_water_and_all_other_supports_dry(layout: Layout) -> None:
    """Under the whole deck the water reaches past its piers, and keeps from the next piers and both abutments."""
    left, last, counts = np.linspace(-0.5, 0.5, 31) * layout.width, len(layout.supports) - 1, Counter[int]()
    for seed in range(300):
        crossing, narrow = river(layout, seed).crossing, river(without(layout), seed).crossing
        counts[len(crossing.piers)] += 1
        if not crossing.piers:
            assert crossing == narrow
            continue
        assert narrow.half_width < crossing.half_width <= 0.5 * WIDEST
        assert crossing.piers == tuple(range(crossing.piers[0], crossing.piers[-1] + 1))
        assert (crossing.swing, crossing.phase, crossing.level) == (narrow.swing, narrow.phase, narrow.level)
        assert 0.9 <= crossing.depth <= 1.4
        for number, station in enumerate(layout.supports):
            beyond = crossing.distance(np.array(station), left) - crossing.half_width
            if number in crossing.piers:
                assert beyond.max() <= -3.0
            else:
                assert beyond.min() >= (BANK if number in (0, last) else ON_LAND)
    assert (1.0 - counts[0] / 300.0) == pytest.approx(SHARE, abs=0.1)
    assert (counts[2] > 0) == (last >= 5)


@pytest.mark.parametrize("family", ["slab", "beam", "girder"])
def test_some_rivers_have_piers_and_all_others_are_unchanged(family: str) -> None:
    """Over many bridges; those with fewer than three spans, over no river or of profile `paper` never have any."""
    wet = dry = 0
    for seed in range(SEEDS):
        layout, _ = draw_layout(settings_of(family), stream(seed, "bridge"))
        paper, _ = draw_layout(settings_of(family, profile="paper"), stream(seed, "bridge"))
        assert layout.river_piers
        assert not paper.river_piers
        try:
            land = draw_land(None, 1.0, layout, 60.0, stream(seed, "site"))
        except InputError:
            continue
        other = draw_land(None, 1.0, without(layout), 60.0, stream(seed, "site"))
        assert land.approaches[0].bend == other.approaches[0].bend
        assert land.crossing.level == other.crossing.level
        if land.crossing.piers:
            wet += 1
            assert land.crossing.kind == "river"
            assert len(layout.supports) >= 4
        else:
            dry += 1
            assert (land.crossing, land.valley) == (other.crossing, other.valley)
    assert wet >= 2
    assert dry > wet


@pytest.mark.parametrize("family", ["arch", "cable_stayed", "suspension"])
def test_other_families_keep_out_of_rivers(family: str) -> None:
    """Towers and arches never stand in a river."""
    for seed in range(6):
        assert not draw_layout(settings_of(family), stream(seed, "bridge"))[0].river_piers


def test_a_river_that_is_not_widened_keeps_every_byte() -> None:
    """The whole site; and one that is widened differs."""
    dry, wet = (next(s for s in range(40) if bool(river(LONG, s).crossing.piers) == piers) for piers in (False, True))
    same = [fingerprint(draw_site(COARSE, layout, stream(dry, "site")).pieces) for layout in (LONG, without(LONG))]
    assert same[0] == same[1]
    other = [fingerprint(draw_site(COARSE, layout, stream(wet, "site")).pieces) for layout in (LONG, without(LONG))]
    assert other[0] != other[1]


@pytest.mark.parametrize("layout", [LONG, HIGH], ids=["long", "high"])
def test_what_is_drawn_is_what_can_be_fixed(layout: Layout) -> None:
    """Asking for piers in the river gives those that are drawn; refusing them gives the river between supports."""
    for seed in range(30):
        drawn, between = river(layout, seed).crossing, river(without(layout), seed).crossing
        told = [draw_land("river", 1.0, layout, 60.0, stream(seed, "site"), told).crossing for told in (True, False)]
        assert told[0].piers
        assert told[1] == between
        assert drawn == told[0 if drawn.piers else 1]
    assert not draw_land("road", 1.0, layout, 60.0, stream(1, "site"), True).crossing.piers


def test_piers_in_a_river_make_wakes() -> None:
    """The image of the river's bed has wakes where a drawn bridge has a pier in the water, and none elsewhere."""
    seen = {True: 0, False: 0}
    for seed in range(SEEDS):
        layout, drawn = draw_layout(settings_of("slab"), stream(seed, "bridge"))
        wet = bool(river(layout, seed).crossing.piers)
        if len(layout.supports) < 4 or seen[wet]:
            continue
        site = draw_site(COARSE, layout, stream(seed, "site"))
        bed = shallows(site, 256, stream(seed, "surface/shallows"))
        foam = with_wakes(bed, site, build_bridge(layout, drawn, site.ground), stream(seed, "surface/wakes"))
        assert (foam is not bed) == wet
        assert (np.abs(foam - bed).max() > 0.2) == wet
        seen[wet] += 1
    assert seen == {True: 1, False: 1}
