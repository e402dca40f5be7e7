"""The site follows the axis: where bridge and land meet on a curved, skewed, superelevated bridge nothing gapes."""

from dataclasses import dataclass

import numpy as np
import pytest

from authoring.axis.alignment import Layout
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import build_bridge
from authoring.shapes.component import F64, Component, triangle_corners, triangles
from authoring.site.covers import to_world, turn
from authoring.site.shape import WING_WALL
from authoring.site.site import Site, SiteSettings, draw_site
from authoring.streams import stream
from authoring.surveys.subject import LAND, piece_corners
from groundwork.settings import parse_settings
from usd_schemas.raycast import RayScene

AXES = {
    "arc": {"kind": "arc", "turn": "left", "radius": 90.0, "skew": 25.0, "superelevation": 0.06, "profile": "crest"},
    "clothoid": {"kind": "clothoid", "turn": "right", "radius": 110.0, "skew": -20.0, "profile": "sag"},
    "s": {"kind": "s", "radius": 120.0, "skew": 15.0, "superelevation": 0.03, "profile": "grade"},
    "skewed": {"kind": "straight", "skew": -30.0, "profile": "crest"},
}


@dataclass(frozen=True)
class Scene:
    """A bridge on its site."""

    layout: Layout
    site: Site
    bridge: tuple[Component, ...]


@pytest.fixture(scope="module", params=list(AXES))
def scene(request: pytest.FixtureRequest) -> Scene:
    """A road bridge of two spans."""
    settings = {
        "service": "road",
        "heading": 30.0,
        "beam": {"spans": [18.0, 24.0]},
        "roadway": {"lanes": 2},
        "alignment": AXES[request.param],
    }
    layout, drawn = draw_layout(parse_settings(BridgeSettings, settings, "test"), stream(4, "bridge"))
    site = draw_site(SiteSettings(), layout, stream(4, "site"))
    parts = build_bridge(layout, drawn, site.ground)
    return Scene(layout, site, tuple(part for part in parts if isinstance(part, Component)))


def rays(components: tuple[Component, ...]) -> RayScene:
    """Triangles of components, ready for ray casting."""
    corners, ids = triangle_corners(components)
    return RayScene(corners, ids.astype(np.uint32))


def height(scene: RayScene, plan: F64, top: float = 60.0) -> F64:
    """First surface from above [m]; -inf where there is none."""
    down = np.tile([0.0, 0.0, -1.0], (len(plan), 1))
    return top - scene.cast(np.column_stack([plan, np.full(len(plan), top)]), down)[0]


@pytest.mark.parametrize("end", [0, 1])
def test_approach_road_meets_the_asphalt_of_the_deck(scene: Scene, end: int) -> None:
    """Across the whole carriageway both surfaces lie on the finished surface, within 10 mm, and no gap is open."""
    axis, sign = scene.layout.alignment, (-1.0, 1.0)[end]
    asphalt = rays(tuple(part for part in scene.bridge if part.kind == "surfacing"))
    ways = [p for p in scene.site.pieces if isinstance(p, Component) and p.role == "asphalt" and "Approach" in p.name]
    road = rays(tuple(ways))
    back = (scene.layout.supports[0], scene.layout.supports[-1])[end] + sign * ABUTMENT_BACK
    half = 0.5 * scene.layout.carriageway - 0.05
    left = np.linspace(-half, half, 81)
    for surface, beside in ((asphalt, -0.002), (road, 0.002)):
        station = np.full(81, back + sign * beside)
        found = axis.point(station, left, np.zeros(81))
        assert np.abs(height(surface, found[:, :2]) - found[:, 2]).max() < 0.010
    inside = np.linspace(0.05, WING_WALL - 0.2, 12)
    station, across = (g.ravel() for g in np.meshgrid(back + sign * inside, left))
    ideal = axis.point(station, across, np.zeros(station.size))
    below = ideal[:, 2] - height(road, ideal[:, :2])
    assert below.min() > -0.010
    assert below.max() < 0.02 * half + 0.015  # the crown of the approach grows by 2 %


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("side", ["L", "R"])
def test_ground_meets_the_wing_walls(scene: Scene, end: int, side: str) -> None:
    """Beside and behind every wing wall the ground lies between its foot and its top: the fill shows no hole."""
    axis, sign, aside = scene.layout.alignment, (-1.0, 1.0)[end], 1.0 if side == "L" else -1.0
    number = (0, len(scene.layout.supports) - 1)[end]
    wing = next(part for part in scene.bridge if part.name == f"Abutment_{number:03d}_Wing_{side}")
    station, left = axis.locate(wing.mesh.points)
    back = (scene.layout.supports[0], scene.layout.supports[-1])[end] + sign * ABUTMENT_BACK
    assert np.abs(left).max() == pytest.approx(0.5 * scene.layout.width, abs=1e-6)
    assert (sign * (station - back)).min() == pytest.approx(0.0, abs=1e-6)
    along = back + sign * np.linspace(0.6, sign * float((station[np.argmax(sign * station)]) - back) - 0.05, 15)
    ground = rays(tuple(p for p in scene.site.pieces if isinstance(p, Component) and p.kind in LAND))
    for beyond in (-0.75, 0.05):  # on the fill behind the wall, and in front of its outer face
        place = axis.point(along, np.full(15, aside * (0.5 * scene.layout.width + beyond)), np.zeros(15))
        found = height(ground, place[:, :2])
        foot = wing.mesh.points[:, 2].min()
        assert found.min() > foot + 0.2
        assert (place[:, 2] - found).min() > 0.02
    edge = axis.point(along, np.full(15, aside * (0.5 * scene.layout.width - 0.75)), np.zeros(15))
    assert (edge[:, 2] - height(ground, edge[:, :2])).max() < 0.35


def test_ground_heights_are_those_of_the_mesh(scene: Scene) -> None:
    """What piers and abutments are told of the ground is the mesh's own height, within 15 mm round the bridge."""
    corners, ids = piece_corners(tuple(p for p in scene.site.pieces if p.group == "Ground"))
    ground, axis = RayScene(corners, ids.astype(np.uint32)), scene.layout.alignment
    rng = np.random.default_rng(1)
    plan = axis.point(rng.uniform(2.0, 40.0, 500), rng.uniform(-9.0, 9.0, 500), np.zeros(500))[:, :2]
    assert np.abs(height(ground, plan) - scene.site.ground(plan)).max() < 0.015


def test_keep_out_box_holds_the_strip(scene: Scene) -> None:
    """Every node of the border lies in the box, and the box hugs it."""
    box, edge = scene.site.keep_out[0], scene.site.edge
    assert box.contains(edge, -1e-6).all()
    assert not box.contains(edge, 0.01).all()
    assert np.abs(edge[:, :2] - np.roll(edge[:, :2], 1, axis=0)).max() < 6.0


def test_ground_faces_look_up_and_normals_follow_them(scene: Scene) -> None:
    """No triangle is folded over, and corner normals are those of the surface in the world."""
    for piece in scene.site.pieces:
        if isinstance(piece, Component) and piece.group == "Ground":
            corner = piece.mesh.points[triangles(piece.mesh)]
            face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            assert face[:, 2].min() > 0.0
            gentle = face[:, 2] > 0.8 * np.linalg.norm(face, axis=1)
            face /= np.linalg.norm(face, axis=1, keepdims=True)
            normal = piece.mesh.normals.reshape(-1, 3, 3)[gentle]
            cosine = np.einsum("tkc,tc->tk", normal, face[gentle])
            assert np.median(cosine) > 0.998, piece.name
            assert np.quantile(cosine, 0.02) > 0.85, piece.name


def test_turned_normals_are_square_to_a_turned_slope(scene: Scene) -> None:
    """A plane in bridge coordinates has, in the world, the normal of its two images' cross product."""
    axis, rng = scene.layout.alignment, np.random.default_rng(2)
    places = np.column_stack([rng.uniform(-40.0, 80.0, 200), rng.uniform(-70.0, 70.0, 200), rng.uniform(0.0, 5.0, 200)])
    slope, step = rng.uniform(-0.4, 0.4, (200, 2)), 1e-5
    normals = np.column_stack([-slope, np.ones(200)]) / np.sqrt(1.0 + np.sum(slope**2, axis=1))[:, None]
    moved = []
    for k in range(2):
        shift = np.zeros((200, 3))
        shift[:, k], shift[:, 2] = step, step * slope[:, k]
        moved.append((to_world(axis, places + shift) - to_world(axis, places - shift)) / (2.0 * step))
    exact = np.cross(*moved)
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    np.testing.assert_allclose(turn(axis, places, normals), exact, atol=1e-5)


def test_crossing_keeps_its_width(scene: Scene) -> None:
    """The river is as wide in the world as drawn, square to its own course, within a tenth under the bridge."""
    crossing, axis = scene.site.land.crossing, scene.layout.alignment
    left = np.linspace(-30.0, 30.0, 241)
    center = axis.point(crossing.center(left), left, np.zeros(241))[:, :2]
    course = np.gradient(center, axis=0)
    course /= np.linalg.norm(course, axis=1, keepdims=True)
    for side in (-1.0, 1.0):
        bank = axis.point(crossing.center(left) + side * crossing.half_width * crossing.stretch(left), left, left)[
            :, :2
        ]
        gap = np.linalg.norm(bank[None] - center[:, None], axis=2)[20:-20].min(axis=1)
        assert np.abs(gap / crossing.half_width - 1.0).max() < 0.15
