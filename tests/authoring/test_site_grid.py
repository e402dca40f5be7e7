"""Grid lines, exact interpolation and cutting along covers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from authoring.site.covers import Cover, cut, soup_of
from authoring.site.grid import HeightField, graded_lines, growing_steps, surface_normals
from authoring.site.relief import draw_relief, smooth_minimum
from authoring.site.shape import Shape


@given(st.floats(20, 90), st.floats(0.3, 1.5), st.lists(st.floats(-15, 15), max_size=4), st.floats(1.6, 6.0))
def test_graded_lines_keep_their_promises(reach: float, spacing: float, inner: list[float], coarse: float) -> None:
    """Fixed lines exist, the middle is fine, nothing is coarser than asked, and the ends are exact."""
    lines = graded_lines((-reach, *inner, reach), (-16.0, 16.0), spacing, coarse)
    steps = np.diff(lines)
    assert (lines[0], lines[-1]) == pytest.approx((-reach, reach), abs=1e-4)
    assert all(np.abs(lines - value).min() <= 1e-4 for value in inner)
    assert steps.min() > 0
    assert steps.max() <= coarse + 1e-3
    assert steps[(lines[:-1] > -15.99) & (lines[1:] < 15.99)].max() <= spacing + 2e-4


@given(st.floats(0.5, 2000), st.floats(0.2, 5), st.floats(5, 60))
def test_growing_steps_end_where_they_should(reach: float, first: float, largest: float) -> None:
    """The last distance is the reach, no step is larger than allowed, and steps never shrink."""
    steps = np.diff(growing_steps(reach, first, largest), prepend=0.0)
    assert steps.sum() == pytest.approx(reach)
    assert steps.max() <= largest * (1 + 1e-9)
    assert (np.diff(steps) > -1e-6).all()


def bumpy(seed: int) -> HeightField:
    """A small height field with uneven lines."""
    rng = np.random.default_rng(seed)
    stations, lefts = np.cumsum(rng.uniform(0.4, 1.5, 14)), np.cumsum(rng.uniform(0.4, 1.5, 11))
    return HeightField(stations, lefts, rng.normal(size=(14, 11)))


@given(st.integers(0, 1000))
def test_interpolation_is_exact_on_triangles(seed: int) -> None:
    """A point made from a triangle's corners has the height made from them."""
    field = bumpy(seed)
    corner = field.nodes()[field.triangles()]
    share = np.random.default_rng(seed).dirichlet((1, 1, 1), len(corner))
    points = np.einsum("ti,tij->tj", share, corner)
    np.testing.assert_allclose(field(points[:, 0], points[:, 1]), points[:, 2], atol=1e-9)


@given(st.integers(0, 1000))
def test_a_cut_keeps_area_and_shares_its_border(seed: int) -> None:
    """Both parts together have the whole plan area, lie on their sides, and meet in the same vertices."""
    field = bumpy(seed)
    rng = np.random.default_rng(seed)
    value = rng.normal(size=field.heights.shape).round(1)  # many exact zeros
    shape = Shape(field.heights, {"x": value})
    normals = surface_normals(field.nodes(), field.triangles())
    soup = soup_of(field.nodes(), normals, field.triangles(), shape, (Cover("x", "X", "ground", "grass"),))
    inside, outside, _ = cut(soup, 0)
    areas = []
    for part in (soup, inside, outside):
        corner = part.rows[part.faces][:, :, :2]
        a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        areas.append(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert all(area.min() > 1e-6 for area in areas if len(area))
    assert areas[1].sum() + areas[2].sum() == pytest.approx(areas[0].sum())
    middle = [part.rows[part.faces][:, :, 6].mean(axis=1) for part in (inside, outside)]
    assert (middle[0] > 0).all()
    assert (middle[1] <= 0).all()
    border = [np.unique(part.faces[part.rows[part.faces][:, :, 6] == 0]) for part in (inside, outside)]
    born = np.arange(len(soup.rows), len(inside.rows))
    assert all(np.isin(born, numbers).all() for numbers in border)
    heights = field(inside.rows[:, 0], inside.rows[:, 1])
    np.testing.assert_allclose(heights, inside.rows[:, 2], atol=1e-9)


def test_relief_is_smooth_and_bounded() -> None:
    """Noise stays within its amplitude and has no steps; the rounded minimum is never above the true one."""
    relief = draw_relief(((10.0, 2.0), (3.0, 0.5)), np.random.default_rng(5))
    x = np.linspace(-500, 500, 200_001)
    z = relief(x, 0.3 * x)
    assert np.abs(z).max() <= 2.5
    assert np.abs(np.diff(z)).max() < 0.02
    one, other = np.random.default_rng(6).normal(size=(2, 1000))
    low = smooth_minimum(one, other, 0.5)
    assert (low <= np.minimum(one, other)).all()
    assert (np.minimum(one, other) - low).max() <= 0.125
