"""The land beyond the site bends with the axis: buildings keep their walls square, and nothing grows into them."""

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.plan_curve import Element
from authoring.backgrounds.countryside import CountrysideSettings, build_countryside
from authoring.shapes.component import Component, Scatter, triangles
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream


@pytest.fixture(scope="module")
def land() -> tuple[Site, tuple[Component | Scatter, ...]]:
    """A site and its countryside on a tight skewed arc."""
    axis = Alignment(7.0, 0.01, 0.5, plan=(Element(60.0, 1 / 90.0, 1 / 90.0),), skew=0.4)
    site = draw_site(
        SiteSettings(fine_spacing=1.6, coarse_spacing=5.0),
        Layout(axis, (0.0, 30.0, 60.0), 11.5, 1.9),
        stream(1, "site"),
    )
    return site, build_countryside(CountrysideSettings(), site, stream(1, "background"))


def test_buildings_have_square_corners(land: tuple[Site, tuple[Component | Scatter, ...]]) -> None:
    """Upright walls stand square to each other, and no two buildings stand within each other's reach."""
    walls = [p for p in land[1] if isinstance(p, Component) and p.group == "Buildings" and p.kind == "building"]
    middles, angles = {}, 0
    for wall in walls:
        corner = wall.mesh.points[triangles(wall.mesh)]
        face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        face /= np.linalg.norm(face, axis=1, keepdims=True)
        upright = face[np.abs(face[:, 2]) < 1e-6]
        turns = np.degrees(np.arctan2(upright[:, 1], upright[:, 0])) % 90.0
        spread = np.abs((turns - turns[0] + 45.0) % 90.0 - 45.0) if len(turns) else np.zeros(0)
        angles += int((spread < 1e-3).sum())
        assert len(turns) == 0 or np.median(spread) < 1e-3, wall.name
        middles.setdefault(wall.name.split("_")[2], wall.mesh.points[:, :2].mean(axis=0))
    assert angles > 100
    assert len(middles) > 8
    places = np.array(list(middles.values()))
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert apart[~np.eye(len(places), dtype=bool)].min() > 15.0


def test_nothing_of_it_stands_on_the_site(land: tuple[Site, tuple[Component | Scatter, ...]]) -> None:
    """Trees, poles, hedges and buildings leave the bent strip free."""
    site, pieces = land
    field = site.field
    for piece in pieces:
        if isinstance(piece, Scatter) or piece.group == "Buildings":
            plan = piece.positions if isinstance(piece, Scatter) else piece.mesh.points
            station, left = site.land.layout.alignment.locate(plan)
            inside = (station > field.stations[0]) & (station < field.stations[-1])
            assert not (inside & (np.abs(left) < field.lefts[-1])).any(), piece.name
