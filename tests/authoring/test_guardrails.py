"""Guardrails and lines of the approaches: where the beam runs, what it stands in, and that a bridge's lines go on."""

import numpy as np
import pytest

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.road_section import RoadSection
from authoring.shapes.component import Component, triangles
from authoring.site.guardrails import LENGTH, TOP, beam_face
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from usd_schemas.components import class_of

LINES = ((-3.4, False), (-0.3, False), (0.3, False), (3.4, False))
HALF = 4.0  # [m] of the asphalt


def site_of(*, footway: bool, service: str = "road") -> Site:
    """A site whose bridge has a level road with a painted median."""
    road = RoadSection(LINES, (2.0, 3.0), 0.15, 6.0 if footway else 4.5, footway, 6.5)
    layout = Layout(
        Alignment(7.0, 0.0, 0.4), (0.0, 30.0), 13.0 if footway else 10.0, 1.9, "road", 2.0 * HALF, 3.4, road=road
    )
    return draw_site(SiteSettings(crossing="river"), layout, stream(3, "site"))


def named(site: Site, begin: str) -> list[Component]:
    """Components whose names begin so."""
    return [piece for piece in site.pieces if isinstance(piece, Component) and piece.name.startswith(begin)]


@pytest.mark.parametrize("footway", [False, True])
def test_guardrails_lead_to_the_parapets(footway: bool) -> None:
    """Four; the beam is 0.75 m over the road beside it, ends in the ground, and no steel lies over the asphalt."""
    site = site_of(footway=footway)
    rails = named(site, "Site_Guardrail_")
    assert len(rails) == 4
    road = site.land.layout.road
    assert road is not None
    for rail in rails:
        assert class_of(rail.kind) == "background"
        points = rail.mesh.points
        assert len(np.unique(points, axis=0)) == len(points)  # no seam of doubled vertices along the beam
        station, left = site.land.layout.alignment.locate(points)
        approach = site.land.approaches[0 if station.mean() < 0.0 else 1]
        along, aside = approach.along(station), np.abs(left - approach.center(station))
        assert aside.min() == pytest.approx(beam_face(road, HALF), abs=1e-3)
        assert aside.max() < HALF + 1.2  # on the level strip beside the road
        assert along.min() == pytest.approx(road.walls - (0.0 if footway else 0.9), abs=1e-6)
        assert along.max() == pytest.approx(road.walls + LENGTH, abs=0.1)
        over = points[:, 2] - approach.level(site.land.layout, lambda s, _: np.zeros_like(s), station)
        middle = (along > road.walls + 5.0) & (along < road.walls + LENGTH - 5.0)
        assert over[middle].max() <= TOP + 1e-6
        assert over[middle].max() > TOP - 0.11  # the road's crossfall
        end = along > road.walls + LENGTH - 0.5
        assert (points[end, 2] < site.ground(points[end, :2])).all()
        feet = points[middle & (over < -0.4)]
        assert len(feet) > 8
        assert (feet[:, 2] < site.ground(feet[:, :2]) - 0.2).all()


def test_guardrails_face_outward() -> None:
    """The traffic's side of the beam looks at the road, on either side of either approach."""
    site = site_of(footway=False)
    for rail in named(site, "Site_Guardrail_"):
        mesh = rail.mesh
        corners = mesh.points[triangles(mesh)]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        middle = corners.mean(axis=1)
        axis = site.land.layout.alignment
        station, left = axis.locate(middle)
        approach = site.land.approaches[0 if station.mean() < 0.0 else 1]
        offset = left - approach.center(station)
        inward = axis.point(station, left - 0.01 * np.sign(offset), np.zeros(len(left))) - axis.point(
            station, left, np.zeros(len(left))
        )
        road = site.land.layout.road
        assert road is not None
        front = np.abs(offset) < beam_face(road, HALF) + 0.001
        assert front.sum() > 20
        assert (np.sum(normal[front] * inward[front], axis=1) > 0.0).all()


def test_the_lines_of_the_bridge_go_on() -> None:
    """Painted vertices of an approach lie on the bridge's four lines, and on each of them."""
    site = site_of(footway=False)
    for piece in named(site, "Site_ApproachMarking_"):
        station, left = site.land.layout.alignment.locate(piece.mesh.points)
        approach = site.land.approaches[0 if station.mean() < 0.0 else 1]
        near = approach.along(station) < 30.0
        offset = (left - approach.center(station))[near]
        away = np.abs(offset[:, None] - np.array([line for line, _ in LINES]))
        assert away.min(axis=1).max() == pytest.approx(0.075, abs=1e-6)
        assert set(away.argmin(axis=1)) == {0, 1, 2, 3}


def test_railways_and_bridges_without_a_section_have_none() -> None:
    """A layout that says nothing of its road gets no guardrail."""
    layout = Layout(Alignment(7.0), (0.0, 30.0), 10.0, 1.9, "road", 8.0, 3.4)
    assert not named(draw_site(SiteSettings(crossing="river"), layout, stream(3, "site")), "Site_Guardrail_")
