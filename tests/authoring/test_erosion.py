"""Gullies of eroded hills, and the lattice noise that hills are made of."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.erosion import BRANCHES, draw_gullies, eroded
from authoring.backgrounds.lakeside_land import draw_crests, draw_spurs
from authoring.site.relief import LATTICE, draw_relief

F64 = NDArray[np.float64]


def places(count: int, reach: float = 3000.0) -> tuple[F64, F64]:
    """Random stations and lefts, each shape (N,)."""
    x, y = np.random.default_rng(3).uniform(-reach, reach, (2, count))
    return x, y


def test_gullies_cut_and_never_fill() -> None:
    """Eroded land lies nowhere above the hills, nowhere deeper than all gullies; where spared it is the hills."""
    hills = draw_relief(((900.0, 400.0),), np.random.default_rng(1))
    worn = eroded(hills, draw_gullies(np.random.default_rng(2)), lambda x, y: np.where(x > 0.0, 1.0, 0.0))
    x, y = places(4000)
    cut = hills(x, y) - worn(x, y)
    assert (cut >= -1e-9).all()
    assert cut.max() <= sum(depth for _, depth in BRANCHES)
    assert (cut[x <= 0.0] == 0.0).all()
    assert cut[x > 0.0].max() > 30.0


def test_gullies_run_downhill() -> None:
    """On an even slope the land is rougher along the contour than down the slope, in whatever direction it falls."""
    for turn in (0.0, 0.7, 2.1, 4.0):
        fall = 0.6 * np.array([np.cos(turn), np.sin(turn)])

        def plane(x: F64, y: F64, fall: F64 = fall) -> F64:
            return fall[0] * x + fall[1] * y

        worn = eroded(plane, draw_gullies(np.random.default_rng(5))[:1], lambda x, y: np.ones_like(x))
        x, y = places(3000)
        step, (down_x, down_y) = 4.0, fall / 0.6

        here = worn(x, y) - plane(x, y)
        down, along = (
            np.sqrt(np.mean((worn(*place) - plane(*place) - here) ** 2))
            for place in ((x + step * down_x, y + step * down_y), (x - step * down_y, y + step * down_x))
        )
        assert along > 2.5 * down


def test_land_at_large_depends_on_nothing_but_the_place() -> None:
    """Any shape of arrays, and a place alone, give the same heights to the last bit."""
    hills = draw_relief(((700.0, 300.0), (200.0, 40.0)), np.random.default_rng(1))
    worn = eroded(hills, draw_gullies(np.random.default_rng(2)), lambda x, y: np.ones_like(x))
    x, y = places(60)
    whole = worn(x.reshape(6, 10), y.reshape(6, 10)).ravel()
    assert np.array_equal(whole, [float(worn(x[k : k + 1], y[k : k + 1])[0]) for k in range(60)])


def test_lattice_noise_is_its_slow_twin() -> None:
    """Place by place, in plain arithmetic: the same number to the last bit, far to both sides of zero."""
    relief = draw_relief(((37.0, 2.5),), np.random.default_rng(8))
    nodes = relief.octaves[0].nodes
    x, y = places(300)

    def fade(t: float) -> float:
        return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)

    for place_x, place_y, found in zip(x, y, relief(x, y), strict=True):
        u, v = float(place_x) / 37.0, float(place_y) / 37.0
        i, j = int(np.floor(u)), int(np.floor(v))
        s, t = fade(u - i), fade(v - j)
        a, b = (float(nodes[(i + k) % LATTICE, j % LATTICE]) for k in (0, 1))
        c, d = (float(nodes[(i + k) % LATTICE, (j + 1) % LATTICE]) for k in (0, 1))
        below, above = a + s * (b - a), c + s * (d - c)
        assert found == 2.5 * (below + t * (above - below))


def test_crests_and_spurs_stay_in_their_range() -> None:
    """Crests lie between -0.2 and 1, spurs within 0.54 of 1; drawing spurs leaves the stream as it was."""
    rng = np.random.default_rng(6)
    crest = draw_crests(rng)
    before = rng.bit_generator.state["state"]
    spurs = draw_spurs(rng)
    assert rng.bit_generator.state["state"] == before
    places = np.random.default_rng(1).uniform(-5000.0, 5000.0, (2, 20000))
    values = crest(*places)
    assert values.min() >= -0.2  # where both large reliefs are far from their zero lines
    assert 0.8 < values.max() <= 1.0
    assert np.abs(spurs(*places) - 1.0).max() <= 0.54
