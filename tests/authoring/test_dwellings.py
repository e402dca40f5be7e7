"""Designs of houses and blocks: windows lie on outer walls, a roof covers every part, a door leads in."""

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.backgrounds import hillside, lakeside
from authoring.backgrounds.dwellings import Design, Parts, Style, draw_designs
from authoring.shapes.component import triangles
from authoring.site.ways import merged
from authoring.streams import stream

F64 = NDArray[np.float64]
STYLES = {"warm": hillside.WARM, "house": hillside.HOUSE, "block": hillside.BLOCK, "villa": lakeside.VILLA}


@pytest.fixture(scope="module", params=sorted(STYLES))
def style(request: pytest.FixtureRequest) -> Style:
    """A family of buildings."""
    return STYLES[request.param]


def corners(parts: Parts, *roles: str) -> F64:
    """Triangles of the pieces with one of some roles, all where none is named, shape (T, 3, 3)."""
    mesh = merged([mesh for role, mesh in parts if not roles or role in roles])
    return mesh.points[triangles(mesh)]


def winding(solid: F64, points: F64) -> F64:
    """Generalized winding numbers of points about closed triangles: 0 outside, at least 1 inside, shape (N,).

    Source: A. Van Oosterom, J. Strackee, The solid angle of a plane triangle, 1983.
    """
    a, b, c = np.moveaxis(solid[None] - points[:, None, None], 2, 0)
    x, y, z = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    volume = np.einsum("nti,nti->nt", a, np.cross(b, c))
    sums = x * y * z + (a * b).sum(-1) * z + (b * c).sum(-1) * x + (c * a).sum(-1) * y
    return np.arctan2(volume, sums).sum(axis=1) / (2.0 * np.pi)


def designs(style: Style) -> tuple[Design, ...]:
    """Some designs of it."""
    return draw_designs(style, 12, stream(5, "designs"))


def test_windows_lie_on_outer_walls(style: Style) -> None:
    """Behind every pane is a wall of the house, and before it is air: none is hidden in a wing or hangs beside it."""
    for design in designs(style):
        body = corners(design.walls[1][:1])
        pane = corners(design.windows[1])
        out = np.cross(pane[:, 1] - pane[:, 0], pane[:, 2] - pane[:, 0])
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        assert (winding(body, pane.mean(axis=1) + 0.4 * out) < 0.5).all()
        assert (winding(body, pane.mean(axis=1) - 0.4 * out) > 0.5).all()


def test_a_roof_covers_every_part(style: Style) -> None:
    """Above every place within the walls is a roof; the walls take up the whole footprint, end to end."""
    rng = np.random.default_rng(1)
    for design in designs(style):
        body, roof = corners(design.walls[1][:1]), corners(design.roof[1])
        np.testing.assert_allclose(np.abs(body[..., :2]).max(axis=(0, 1)), design.half, atol=1e-6)
        places = rng.uniform(-1.0, 1.0, (60, 2)) * np.array(design.half)
        inside = winding(body, np.column_stack([places, np.full(60, 0.5)])) > 0.5
        assert inside.sum() > 30
        for place in places[inside]:
            ahead = np.roll(roof, -1, axis=1)[..., :2] - roof[..., :2]
            offset = place - roof[..., :2]
            turn = ahead[..., 0] * offset[..., 1] - ahead[..., 1] * offset[..., 0]
            assert (turn > -1e-9).all(axis=1).any()  # within a triangle that faces up


def test_a_door_leads_in_from_the_front(style: Style) -> None:
    """Each design has one door, on the front, from the floor to 2.2 m; no window overlaps it."""
    for design in designs(style):
        for walls, windows in zip(design.walls, design.windows, strict=True):
            door = corners(walls, "metal_panel").reshape(-1, 3)
            door = door[door[:, 2] > -0.1]
            assert door[:, 1].max() < 0.0
            assert 2.0 < door[:, 2].max() < 2.3
            low, high = door.min(axis=0), door.max(axis=0)
            pane = corners(windows).mean(axis=1)
            assert not ((pane > low - 0.2) & (pane < high + 0.2)).all(axis=1).any()


def test_houses_of_a_slope_are_no_cubes() -> None:
    """Of the houses on terraces, most have a lower wing; seen from the front their outline has several heights."""
    stepped = 0
    for design in designs(hillside.WARM):
        body = corners(design.walls[1][:1]).reshape(-1, 3)
        ends = [body[np.abs(body[:, 0] - side * design.half[0]) < 1e-6, 2].max() for side in (-1.0, 1.0)]
        stepped += int(abs(ends[0] - ends[1]) > 1.5)
        assert {role for role, _ in design.roof[1]} & {"roof_tile", "roof_grey"}
    assert stepped >= 6
