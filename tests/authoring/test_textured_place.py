"""Photographed ground round a site: clear of it, over the joining terrain, pixels and roofs as they were."""

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.plan_curve import Element
from authoring.imported.mesh_city import city_of
from authoring.imported.mesh_soup import MeshSoup
from authoring.imported.model import CityModel
from authoring.imported.place import choose_place
from authoring.imported.skin import image_skin
from authoring.imported.surroundings import build_city_world
from authoring.imported.textured_place import Clearance
from authoring.looks.encode import png
from authoring.shapes.component import Component, Scatter, triangle_corners
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from usd_schemas.components import class_of

F64 = NDArray[np.float64]

LAYOUT = Layout(Alignment(7.0, 0.015, 0.4), (0.0, 18.0, 40.0), 11.5, 1.9, "road", 8.0, 3.4)
SIDE, BLOCK = 900.0, 25.0  # [m]


def photograph(sheds: int = 0) -> CityModel:
    """A tile of 900 m: ground that rises by 1.5 % and waves, with blocks fused to it, about its own middle.

    Args:
        sheds: Further closed boxes without an image on it.
    """
    line = np.linspace(-0.5 * SIDE, 0.5 * SIDE, 181)
    rng = np.random.default_rng(6)
    corners = [(x, y) for x in range(-420, 400, 60) for y in range(-420, 400, 60) if rng.random() < 0.6]
    edges = np.array([v for x, y in corners for v in (x, y)], np.float64)
    line = np.unique(np.round(np.r_[line, edges - 0.3, edges, edges + BLOCK, edges + BLOCK + 0.3], 3))
    x, y = np.meshgrid(line, line, indexing="ij")
    z = 20.0 + 0.015 * x + 0.8 * np.sin(x / 70.0) * np.cos(y / 60.0)
    for a, b in corners:
        inside = (x >= a) & (x <= a + BLOCK) & (y >= b) & (y <= b + BLOCK)
        z[inside] = z[inside].max() + 9.0
    nodes = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    k = np.arange(len(nodes)).reshape(len(line), -1)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    triangles = nodes[faces]
    skin = image_skin(png(np.full((8, 8, 3), 120, np.uint8)), "image")
    shown = np.zeros(len(faces), np.int32)
    if sheds:
        plain = np.concatenate([box(*rng.uniform(-430.0, 430.0, 2)) for _ in range(sheds)])
        triangles, shown = np.concatenate([triangles, plain]), np.r_[shown, np.full(len(plain), -1, np.int32)]
    soup = MeshSoup(triangles, triangles[..., :2] / SIDE + 0.5, shown, (skin,), {})
    return city_of(soup, lambda line: None)


def box(x: float, y: float) -> F64:
    """A closed box of 14 x 11 m, 12 m high over the ground, its foot in it: triangles, shape (12, 3, 3)."""
    low, high = np.array([x, y, 10.0]), np.array([x + 14.0, y + 11.0, 42.0])
    corner = np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return corner[[triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]]


@pytest.fixture(scope="module")
def site() -> Site:
    """A site over a road."""
    return draw_site(SiteSettings(crossing="road"), LAYOUT, stream(7, "site"))


@pytest.fixture(scope="module")
def world() -> CityModel:
    """The photographed tile."""
    return photograph()


@pytest.fixture(scope="module")
def pieces(site: Site, world: CityModel) -> tuple[Component | Scatter, ...]:
    """The tile round the site."""
    return build_city_world(world, site, stream(3, "background"))


def textured(pieces: tuple[Component | Scatter, ...]) -> list[Component]:
    """Pick the pieces with an image."""
    return [piece for piece in pieces if isinstance(piece, Component) and "skin" in piece.parameters]


def test_the_site_stays_free(site: Site, world: CityModel, pieces: tuple[Component | Scatter, ...]) -> None:
    """No corner of any triangle lies in the keep-out volume or on a way; most of the tile is there; all is labeled."""
    found = textured(pieces)
    clearance = Clearance.of(site)
    for piece in found:
        assert class_of(piece.kind) == "background"
        assert clearance.free(piece.mesh.points[:, :2]).min() > -0.6, piece.name  # of 2.5 m
        assert not site.keep_out[0].contains(piece.mesh.points, margin=0.0).any(), piece.name
    corners, _ = triangle_corners(tuple(found))
    edges = (corners[:, 1:] - corners[:, :1])[..., :2]
    plan = 0.5 * np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]).sum()
    assert 0.75 * SIDE**2 < plan < 0.97 * SIDE**2
    ids = [number for p in pieces for number in (p.instance_ids if isinstance(p, Scatter) else (p.instance_id,))]
    assert len(set(ids)) == len(ids)


def test_pixels_lie_where_they_lay(site: Site, world: CityModel, pieces: tuple[Component | Scatter, ...]) -> None:
    """At the chosen place, every corner still looks up the pixel that showed that place."""
    place = choose_place(world, site, stream(3, "background"))
    for piece in textured(pieces):
        corners = piece.mesh.points[piece.mesh.corners]
        np.testing.assert_allclose(place.to_city(corners[:, :2]) / SIDE + 0.5, piece.mesh.st, atol=2e-6)


def test_terrain_lies_under_the_photograph(pieces: tuple[Component | Scatter, ...]) -> None:
    """At 400 random places of the photographed ground the joining terrain lies below, and close beside the site."""
    ground = [piece for piece in textured(pieces) if piece.kind == "ground"]
    corners, _ = triangle_corners(tuple(ground))
    rng = np.random.default_rng(0)
    picked = corners[rng.integers(len(corners), size=400)]
    share = rng.dirichlet((1.0, 1.0, 1.0), size=400)
    spots = np.einsum("nk,nkc->nc", share, picked)
    plain = tuple(
        p for p in pieces if isinstance(p, Component) and p.group in ("Ground", "Ways") and "skin" not in p.parameters
    )
    under, _ = triangle_corners(plain)
    gaps = []
    for spot in spots:
        a, b, c = np.moveaxis(under[..., :2] - spot[:2], 1, 0)
        sides = np.stack([u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] for u, v in ((b, c), (c, a), (a, b))], axis=1)
        total = sides.sum(axis=1)
        hit = ((sides >= 0).all(axis=1) | (sides <= 0).all(axis=1)) & (np.abs(total) > 1e-9)
        if hit.any():
            weights = sides[hit] / total[hit][:, None]
            gaps.append(spot[2] - float(np.einsum("nk,nk->n", weights, under[hit][..., 2]).max()))
    assert len(gaps) > 380
    assert min(gaps) > 0.01
    assert max(gaps) < 6.0
    assert np.percentile(gaps, 85) > 0.7  # deep in the tile it keeps well below


def test_roofs_stay_level(pieces: tuple[Component | Scatter, ...]) -> None:
    """A small object is not bent above its foot, wherever it stands."""
    blocks = [piece for piece in textured(pieces) if piece.kind == "building"]
    assert len(blocks) > 60
    for block in blocks:
        points = block.mesh.points
        tops = points[points[:, 2] > points[:, 2].max() - 2.0, 2]
        assert np.ptp(tops) < 0.01, block.name


@pytest.mark.slow
@pytest.mark.proof_only
def test_a_bent_skewed_bridge_in_a_mixed_world() -> None:
    """Objects with and without an image round a bend: free site, roofs level, blank ones painted, no id twice."""
    axis = Alignment(8.5, 0.01, 0.7, plan=(Element(60.0, 1 / 150.0, 1 / 150.0),), skew=0.25)
    bend = draw_site(SiteSettings(crossing="road"), Layout(axis, (0.0, 30.0, 60.0), 11.5, 1.9), stream(2, "site"))
    pieces = build_city_world(photograph(70), bend, stream(4, "background"))
    clearance = Clearance.of(bend)
    shown = textured(pieces)
    blank = [p for p in pieces if isinstance(p, Component) and p.kind in ("building", "roof") and p not in shown]
    assert len(shown) > 20
    assert len(blank) > 40
    for piece in (*shown, *blank):
        # Images keep 2.5 m away, measured along the bend; buildings without one stay out of the volume itself.
        assert clearance.free(piece.mesh.points[:, :2]).min() > -2.5, piece.name
        assert piece.group == "Ground" or not bend.keep_out[0].contains(piece.mesh.points, margin=0.0).any(), piece.name
    corners, _ = triangle_corners(tuple(p for p in pieces if isinstance(p, Component) and p.group == "Ground"))
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert (up > -1e-6).mean() > 0.999
    for piece in blank:
        if piece.kind == "roof":
            assert np.ptp(piece.mesh.points[:, 2]) < 0.01, piece.name
    ids = [number for p in pieces for number in (p.instance_ids if isinstance(p, Scatter) else (p.instance_id,))]
    assert len(set(ids)) == len(ids)
