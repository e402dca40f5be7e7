"""What bridges lead over: choices that suit them, land that rises to high abutments, water, rails, and refusals."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.track_section import GAUGE
from authoring.shapes.component import Component
from authoring.site.crossing import CrossingKind, choose_crossing
from authoring.site.land import draw_land
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.site.valley import HIGH, STEEPEST
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.conftest import Count

LOW = Layout(Alignment(7.6), (0.0, 18.0, 40.0), 10.0, 1.5)
TALL = Layout(Alignment(24.0, 0.01, 0.4), (0.0, 40.0, 90.0, 130.0), 11.0, 2.4)
WIDE = Layout(Alignment(17.0), (0.0, 80.0, 280.0, 360.0), 14.0, 2.6)
SKEWED = Layout(Alignment(16.0, skew=0.2), (0.0, 35.0, 70.0), 11.0, 2.2)
DEEP = Layout(Alignment(17.0), (0.0, 50.0), 11.0, 2.2)
KINDS: tuple[CrossingKind, ...] = ("river", "road", "rail", "valley", "harbour")
CASES = [
    ("river", LOW),
    ("rail", LOW),
    ("river", TALL),
    ("road", TALL),
    ("rail", TALL),
    ("valley", TALL),
    ("river", DEEP),
    ("valley", SKEWED),
    ("harbour", WIDE),
    ("valley", WIDE),
]


@pytest.fixture(scope="module", params=CASES, ids=[f"{kind}_{layout.supports[-1]:g}" for kind, layout in CASES])
def site(request: pytest.FixtureRequest) -> Site:
    """Draw one site of each case."""
    kind, layout = request.param
    return draw_site(SiteSettings(crossing=kind, relief=0.6), layout, stream(5, "site"))


def ground_at(site: Site, station: Any, left: Any) -> Any:
    """Find the height of the ground at bridge coordinates [m]."""
    station, left = np.broadcast_arrays(np.asarray(station, np.float64), np.asarray(left, np.float64))
    xy = site.land.layout.alignment.point(station.ravel(), left.ravel(), np.zeros(station.size))[:, :2]
    return site.ground(xy).reshape(station.shape)


def piece(site: Site, name: str) -> Component:
    """Find a component of the site."""
    return next(part for part in site.pieces if isinstance(part, Component) and part.name == name)


def test_ground_stays_under_the_deck_and_falls_to_the_crossing(site: Site) -> None:
    """Between the abutments' fronts no ground rises over the seats; under the longest span it lies by the crossing."""
    layout = site.land.layout
    station, left = np.meshgrid(
        np.linspace(layout.supports[0] + 2.0, layout.supports[-1] - 2.0, 301), np.linspace(-0.5, 0.5, 15) * layout.width
    )
    headroom = layout.alignment.height(station) - layout.depth - ground_at(site, station, left)
    assert headroom.min() > 0.5
    crossing = site.land.crossing
    middle = layout.alignment.height(np.array(crossing.station)) - layout.depth - crossing.level
    assert middle > 4.5
    assert abs(ground_at(site, crossing.station, 0.0) - crossing.level + crossing.depth) < 1.2


def test_land_comes_up_to_high_abutments(site: Site) -> None:
    """High bridges: the natural land at the abutments lies close under the seats; low ones stand on level land."""
    land = site.land
    layout, axis = land.layout, land.layout.alignment
    if float(axis.height(np.array(layout.supports)).max()) <= HIGH:
        assert land.valley is None
        return
    assert land.valley is not None
    for end, inward in ((0, 1.0), (-1, -1.0)):
        seat = float(axis.height(np.array(layout.supports[end]))) - layout.depth
        beside = ground_at(site, layout.supports[end] + inward * 1.5, [-30.0, 0.0, 30.0])
        assert np.all(seat - beside < 6.0)
        assert 0.7 < seat - beside[1] < 3.4
        fill = float(axis.height(np.array(layout.supports[end]))) - land.approaches[end].foot
        assert fill < HIGH
        behind = layout.supports[end] - inward * 9.0
        road = float(axis.height(np.array(behind)))
        assert road - ground_at(site, behind, 0.0) == pytest.approx(layout.underlay, abs=0.08)


def test_valley_sides_are_no_cliffs(site: Site) -> None:
    """The land at large rises no steeper than said, and is level beyond both ends."""
    valley = site.land.valley
    if valley is None:
        return
    stations = np.linspace(-60.0, site.land.layout.supports[-1] + 60.0, 4001)
    heights = valley(stations, np.zeros(4001))
    assert np.abs(np.diff(heights) / np.diff(stations)).max() <= STEEPEST + 1e-3
    assert (heights[0], heights[-1]) == pytest.approx(valley.ends)
    assert np.all(np.diff(valley.stations) > 0.0)


def test_harbour_covers_most_of_the_main_span() -> None:
    """Water over 72 to 86 % of the main span, its bed below it, both main piers and the banks dry."""
    site = draw_site(SiteSettings(crossing="harbour", relief=0.6), WIDE, stream(8, "site"))
    crossing = site.land.crossing
    assert 0.72 * 200.0 <= 2.0 * crossing.half_width <= 0.86 * 200.0
    assert crossing.station == pytest.approx(180.0)
    inside = np.linspace(crossing.station - 0.85 * crossing.half_width, crossing.station + 0.85 * crossing.half_width)
    bed = ground_at(site, inside, 0.0)
    assert bed.max() < crossing.level - 1.0
    assert ground_at(site, [80.0, 280.0], 0.0).min() > crossing.level + 0.5
    water = piece(site, "Site_Water").mesh.points
    np.testing.assert_allclose(water[:, 2], crossing.level)


@pytest.mark.parametrize("layout", [LOW, TALL])
def test_railway_has_its_gauge_and_lies_on_its_bed(layout: Layout) -> None:
    """Two tracks: rails at gauge under the bridge, level on the axis, over ballast that ends in the ground."""
    site = draw_site(SiteSettings(crossing="rail"), layout, stream(3, "site"))
    axis, rails = layout.alignment, piece(site, "Site_Rails").mesh.points
    assert len(np.unique(rails, axis=0)) == len(rails)  # no seam of doubled vertices along a rail
    station, left = axis.locate(rails)
    heights = rails[:, 2]
    near = np.abs(left) < 8.0
    away = site.land.crossing.distance(station, left)[near]
    top = heights[near] > heights[near].max() - 0.012  # their tops
    outside = 0.5 * (GAUGE + 0.072) + 0.027  # from a track's axis to the farther edge of a rail's level top
    assert away[top].min() == pytest.approx(2.0 - outside, abs=1e-3)
    assert away[top].max() == pytest.approx(2.0 + outside, abs=1e-3)
    assert heights.max() == pytest.approx(site.land.crossing.level, abs=1e-6)
    bed = piece(site, "Site_RailBed").mesh.points
    ends = site.ground(bed[:, :2]) - bed[:, 2]
    crown = bed[:, 2] > heights.max() - 0.4
    assert ends[crown].max() < -0.3
    assert ends[~crown].min() > 0.1
    assert {part.kind for part in site.pieces if "Sleepers" in part.name} == {"rail_bed"}


def test_feet_of_an_arch_find_their_land() -> None:
    """Where a bridge asks for land at a foot, the land is there; without the wish it is not."""
    layout = Layout(Alignment(34.0), (0.0, 160.0), 11.0, 2.0, feet=((25.0, 14.0), (135.0, 14.0)))
    site = draw_site(SiteSettings(crossing="valley", relief=0.0), layout, stream(2, "site"))
    np.testing.assert_allclose(ground_at(site, [25.8, 134.2], 0.0), 14.0, atol=0.8)


def test_choices_suit_the_bridge(proof_count: Count) -> None:
    """Each kind is drawn where it fits and nowhere else; a low short bridge never crosses a harbour or a valley."""
    count = proof_count(200, 1000)
    seen = {
        name: Counter(choose_crossing(layout, stream(seed, "site")) for seed in range(count))
        for name, layout in (("low", LOW), ("tall", TALL), ("wide", WIDE))
    }
    assert set(seen["low"]) == {"river", "road", "rail"}
    assert set(seen["tall"]) == {"river", "road", "rail", "valley"}
    assert set(seen["wide"]) == {"valley", "harbour"}
    assert min(min(counter.values()) for counter in seen.values()) > 0.1 * count
    tiny = Layout(Alignment(4.0), (0.0, 6.0), 8.0, 1.0)
    assert choose_crossing(tiny, stream(1, "site")) == "river"


def test_what_is_drawn_is_what_can_be_fixed() -> None:
    """Fixing the crossing that would be drawn changes nothing, fixing another one leaves relief and roads alone."""
    drawn = draw_land(None, 1.0, TALL, 60.0, stream(4, "site"))
    lands = {kind: draw_land(kind, 1.0, TALL, 60.0, stream(4, "site")) for kind in KINDS[:4]}
    assert drawn.crossing in [land.crossing for land in lands.values()]
    place = np.linspace(-40.0, 170.0, 50), np.linspace(-60.0, 60.0, 50)
    for land in lands.values():
        np.testing.assert_array_equal(land.relief(*place), drawn.relief(*place))
        assert land.crossing.swing == drawn.crossing.swing


@pytest.mark.parametrize(
    ("kind", "layout", "words"),
    [
        ("valley", LOW, r"site\.crossing: .*seats are only 6\.1 m.*at least 7 m high"),
        (
            "rail",
            Layout(Alignment(4.6), (0.0, 20.0), 8.0, 1.2),
            r"site\.crossing: .*under bearing seats at least 5 m high",
        ),
        (
            "road",
            Layout(Alignment(4.6), (0.0, 20.0), 8.0, 1.2),
            r"site\.crossing: .* only 3\.4 m above .*bridges at least 3\.6 m high",
        ),
        (
            "harbour",
            Layout(Alignment(5.5), (0.0, 90.0), 8.0, 1.2, soffit=1.6),
            r"site\.crossing: .* only 3\.9 m above .*bridges at least 4 m high",
        ),
        ("harbour", TALL, r"site\.crossing: no room.*at least 60 m"),
        ("rail", Layout(Alignment(9.0), (0.0, 10.0), 8.0, 1.2), r"site\.crossing: no room"),
        ("river", Layout(Alignment(0.2), (0.0, 120.0), 8.0, 1.2), r"bridge\.clearance: the ground .* above the deck"),
    ],
)
def test_what_does_not_fit_is_refused(kind: CrossingKind, layout: Layout, words: str) -> None:
    """One line with the key, the rule and what would fit."""
    with pytest.raises(InputError, match=words):
        draw_site(SiteSettings(crossing=kind, relief=1.5), layout, stream(1, "site"))


@pytest.mark.parametrize(
    ("kind", "layout"),
    [
        ("road", Layout(Alignment(7.0), (0.0, 20.0), 8.0, 6.2, soffit=1.4)),  # a masonry arch: its seats are springings
        ("road", Layout(Alignment(4.9), (0.0, 20.0), 8.0, 1.2)),
        ("harbour", Layout(Alignment(5.7), (0.0, 90.0), 8.0, 1.2, soffit=1.6)),
    ],
)
def test_enough_headroom_is_accepted(kind: CrossingKind, layout: Layout) -> None:
    """A road under 3.6 m and a harbour under 4 m are built, whatever the height of the seats."""
    assert draw_land(kind, 0.0, layout, 60.0, stream(1, "site")).crossing.station == layout.supports[-1] / 2


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"river_piers": True, "crossing": "road"}, r"river_piers has no effect, because crossing is 'road'"),
        ({"river_piers": True, "crossing": "valley"}, r"allowed: crossing = 'river'"),
        (
            {"fine_spacing": 1.5, "coarse_spacing": 1.0},
            r"coarse_spacing 1 is less than fine_spacing 1\.5.*at least 1\.5 m",
        ),
    ],
)
def test_values_without_effect_are_refused(values: dict[str, Any], words: str) -> None:
    """Piers in a river that is none, and a coarse mesh finer than the fine one, are refused in one line."""
    with pytest.raises(InputError, match=words) as caught:
        parse_settings(SiteSettings, values, "test")
    assert "\n" not in str(caught.value)
    values.popitem()
    parse_settings(SiteSettings, values, "test")
    parse_settings(SiteSettings, {"river_piers": False, "crossing": "road"}, "test")  # what is not there has no piers


def test_the_coarse_spacing_bounds_the_ground_of_long_bridges() -> None:
    """The fine mesh becomes coarser under long bridges, but no coarser than the largest spacing."""
    layout = Layout(Alignment(8.0), tuple(np.linspace(0.0, 1000.0, 21).tolist()), 10.0, 1.5)
    site = draw_site(
        SiteSettings(crossing="river", coarse_spacing=1.2, half_width=40.0, run_out=30.0), layout, stream(5, "site")
    )
    assert np.diff(site.field.stations).max() <= 1.2 + 1e-4
    assert np.diff(site.field.lefts).max() <= 1.2 + 1e-4
