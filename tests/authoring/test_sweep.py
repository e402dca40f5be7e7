"""Sections, sweeps and their texture coordinates, against closed forms."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from authoring.axis.alignment import Alignment
from authoring.shapes.component import F64
from authoring.shapes.sections import area, circle, cut_corners, inset, is_convex, mirrored, rectangle, triangulate
from authoring.solids.extrusion import GROOVE_DEPTH, Prism
from authoring.solids.sweep import Axis, Surface, joined, sweep, turned

LEVEL = Alignment(7.0, 0.0, 0.4)
GRADED = Alignment(7.0, 0.03, -0.7)
AXES: tuple[Axis, ...] = ("station", "left", "above")
I_SECTION = mirrored([(0.3, 0.0), (0.3, 0.2), (0.1, 0.35), (0.1, 0.9), (0.25, 1.0), (0.25, 1.2)])
OUTLINES = {
    "rectangle": rectangle((1.0, 2.0), (2.5, 2.8)),
    "chamfered": cut_corners(rectangle((1.0, 2.0), (2.5, 2.8)), 0.05),
    "round": circle(1.2, 40),
    "i": cut_corners(I_SECTION, np.array([0.02, 0.01] + [0.0] * 8 + [0.01, 0.02])),
}


def faces_of(surface: Surface) -> list[tuple[F64, F64, F64]]:
    """List (points, st, normals) of every face."""
    ends = np.cumsum(surface.face_counts)
    return [
        (surface.points[surface.corners[a:b]], surface.st[a:b], surface.normals[a:b])
        for a, b in zip(ends - surface.face_counts, ends, strict=True)
    ]


def solid(surface: Surface) -> trimesh.Trimesh:
    """Triangulate a surface by fans."""
    ends = np.cumsum(surface.face_counts)
    fans = [
        (surface.corners[a], surface.corners[k], surface.corners[k + 1])
        for a, b in zip(ends - surface.face_counts, ends, strict=True)
        for k in range(a + 1, b - 1)
    ]
    return trimesh.Trimesh(surface.points, np.array(fans), process=False)


def inset_area(outline: F64, distance: float) -> float:
    """Area inside a parallel outline: A - P t + t^2 * sum(tan(turn / 2)), the turn signed."""
    side = np.roll(outline, -1, axis=0) - outline
    turn = np.angle(np.exp(1j * np.diff(np.angle(side @ [1, 1j]), append=np.angle(side[0] @ [1, 1j]))))
    return float(area(outline) - np.linalg.norm(side, axis=1).sum() * distance + distance**2 * np.tan(turn / 2).sum())


def bevel_volume(outline: F64, depth: float) -> float:
    """Volume of a layer `depth` thick whose outline shrinks by `depth`: Simpson's rule, exact for a quadratic."""
    return depth / 6.0 * (area(outline) + 4.0 * inset_area(outline, depth / 2.0) + inset_area(outline, depth))


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("place", [LEVEL, GRADED])
def test_prism_is_closed_and_has_the_volume_of_its_formula(name: str, axis: Axis, place: Alignment) -> None:
    """Grade and heading keep volume: one is a shear, the other a turn. Chamfers and grooves take what they should."""
    outline, chamfer = OUTLINES[name], 0.008
    mesh = solid(Prism(outline, -2.0, 9.0, axis, place, chamfer, grooves=(1.0, 4.0)).surface)
    layers = 2.0 * bevel_volume(outline, chamfer) + 4.0 * bevel_volume(outline, GROOVE_DEPTH)
    expected = area(outline) * (11.0 - 2.0 * chamfer - 4.0 * GROOVE_DEPTH) + layers
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("chamfer", [0.0, 0.008])
def test_texture_is_an_isometry_of_every_face(name: str, axis: Axis, chamfer: float) -> None:
    """Every distance between two corners of a face is the same in st, and no face is mirrored.

    At corners that point inward a groove's or chamfer's ring is longer than the side that it belongs to: there texture
    is squeezed by about the groove's depth, so that neighboring sides share none.
    """
    squeeze = 0.0 if is_convex(OUTLINES[name]) else 1.1 * GROOVE_DEPTH  # two such corners on a side
    surface = Prism(OUTLINES[name], -2.0, 9.0, axis, LEVEL, chamfer, grooves=(1.0, 4.0)).surface
    for face in faces_of(surface) + faces_of(turned(surface)):
        points, texture, normals = face
        in_space = np.linalg.norm(points[:, None] - points[None], axis=2)
        in_texture = np.linalg.norm(texture[:, None] - texture[None], axis=2)
        np.testing.assert_allclose(in_texture, in_space, rtol=1e-6, atol=max(squeeze, 1e-9))
        assert area(texture) > 0.0
        flat = np.cross(points[1] - points[0], points[2] - points[1])
        assert np.all(normals @ flat > 0.0)


def test_texture_on_a_grade_follows_arc_length_and_girth() -> None:
    """On a grade u grows by the length of the inclined edge, v by the girth of the section."""
    surface = Prism(rectangle((-1.0, -0.3), (1.0, 0.0)), 0.0, 20.0, "station", GRADED).surface
    for points, texture, _ in faces_of(surface)[:4]:
        length = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
        run = np.abs(np.roll(texture, -1, axis=0) - texture)
        np.testing.assert_allclose(run.max(axis=1), length, rtol=1e-6)
        np.testing.assert_allclose(run.min(axis=1), 0.0, atol=1e-9)
    assert np.ptp(surface.st[:16, 0]) == pytest.approx(20.0 * np.hypot(1.0, 0.03), rel=1e-9)
    assert np.ptp(surface.st[:16, 1]) == pytest.approx(4.6, rel=1e-9)


def test_turned_texture_runs_across_on_the_sides_only() -> None:
    """A cap swept along the bridge gets its u across the bridge on all faces."""
    surface = turned(Prism(rectangle((-5.0, 0.0), (5.0, 1.0)), -0.7, 0.7, "station", LEVEL).surface)
    left = LEVEL.locate(surface.points[surface.corners])[1]
    top_and_bottom = [face for face in range(4) if face in (0, 2)]
    for face in [*top_and_bottom, 4, 5]:
        corners = slice(4 * face, 4 * face + 4)
        assert np.ptp(surface.st[corners, 0]) == pytest.approx(np.ptp(left[corners]), rel=1e-9)


def test_round_sides_are_smooth_and_their_ends_flat() -> None:
    """Normals of a cylinder's side point away from its axis; those of its ends along it."""
    surface = Prism(circle(1.0, 48), 0.0, 3.0, "above", Alignment(0.0)).surface
    side = np.repeat(surface.chart == 0, surface.face_counts)
    radial = surface.points[surface.corners][side] * (2.0, 2.0, 0.0)
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    np.testing.assert_allclose(surface.normals[side], radial, atol=1e-9)
    np.testing.assert_allclose(np.abs(surface.normals[~side]), np.broadcast_to([0.0, 0.0, 1.0], (96, 3)), atol=1e-9)


def test_tapering_sweep_splits_twisted_quads_and_stays_closed() -> None:
    """Where a web thickens, no face leaves its plane."""
    thick = mirrored([(0.3, 0.0), (0.3, 0.2), (0.22, 0.35), (0.22, 0.9), (0.25, 1.0), (0.25, 1.2)])
    surface = sweep(np.stack([thick, thick, I_SECTION]), np.array([0.0, 1.0, 2.0]), "station", GRADED)
    assert solid(surface).is_watertight
    assert area(I_SECTION) + area(thick) < solid(surface).volume < 2.0 * area(thick)
    for points, _, _ in faces_of(surface):
        centered = points - points.mean(axis=0)
        assert np.linalg.svd(centered, compute_uv=False)[-1] < 1e-7
    assert 3 in surface.face_counts


@given(st.integers(5, 14), st.integers(0, 10_000))
def test_triangulation_covers_a_star_exactly(corners: int, seed: int) -> None:
    """Ears of a random star-shaped polygon: all counter-clockwise, areas adding up to the whole."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi / corners, corners) + np.arange(corners) * 2.0 * np.pi / corners)
    outline = (rng.uniform(0.3, 1.0, corners) * np.array([np.cos(angle), np.sin(angle)])).T
    pieces = [area(outline[ear]) for ear in triangulate(outline)]
    assert len(pieces) == corners - 2
    assert min(pieces) > -1e-12
    assert sum(pieces) == pytest.approx(area(outline), rel=1e-9)


@given(st.integers(4, 10), st.integers(0, 10_000))
def test_corners_on_straight_sides_make_no_flat_triangle(corners: int, seed: int) -> None:
    """Where every side has a corner in its middle, clipping cuts flat ears; flips make other triangles of them."""
    rng = np.random.default_rng(seed)
    angle = np.arange(corners) * 2.0 * np.pi / corners
    few = (rng.uniform(0.5, 1.0, corners) * np.array([np.cos(angle), np.sin(angle)])).T
    outline = np.stack([few, 0.5 * (few + np.roll(few, -1, axis=0))], axis=1).reshape(-1, 2)
    pieces = [area(outline[ear]) for ear in triangulate(outline)]
    assert len(pieces) == 2 * corners - 2
    assert min(pieces) > 1e-4
    assert sum(pieces) == pytest.approx(area(outline), rel=1e-9)


def test_corners_in_line_by_chance_make_no_sliver() -> None:
    """A girder's section whose far corners lie in one line, to ten micrometers: no triangle joins those three."""
    foot = [(0.2355, 0.0), (0.2625, 0.027), (0.2625, 0.1155), (0.258731578, 0.141963371)]
    neck = [(0.2325, 0.2322), (0.2325, 0.7048), (0.294613764, 0.756375842), (0.305, 0.7785), (0.305, 0.87)]
    outline = mirrored([*foot, *neck])
    triangles = triangulate(outline)
    assert sum(area(outline[t]) for t in triangles) == pytest.approx(area(outline), rel=1e-12)
    assert min(area(outline[t]) for t in triangles) > 1e-4
    for here in triangles:
        for there in triangles:  # across every inner side the angles sum up to 180 degrees at most
            shared = set(here) & set(there)
            if len(shared) == 2:
                tips = [next(k for k in t if k not in shared) for t in (here, there)]
                angles = []
                for tip in tips:
                    a, b = (outline[k] - outline[tip] for k in sorted(shared))
                    angles.append(np.arctan2(abs(a[0] * b[1] - a[1] * b[0]), a @ b))
                assert tips[0] == tips[1] or sum(angles) <= np.pi + 1e-6


@given(st.floats(0.001, 0.02))
def test_inset_and_cut_corners_have_the_areas_of_their_formulas(size: float) -> None:
    """Parallel outlines and cut corners, convex or not."""
    for outline in OUTLINES.values():
        assert area(inset(outline, size * 0.4)) == pytest.approx(inset_area(outline, size * 0.4), rel=1e-9)
    box = rectangle((0.0, 0.0), (2.0, 1.0))
    assert area(cut_corners(box, size)) == pytest.approx(2.0 - 4.0 * size**2 / 2.0, rel=1e-12)
    assert is_convex(cut_corners(box, size))
    assert not is_convex(I_SECTION)


def test_joined_solids_keep_their_volumes_and_charts() -> None:
    """Two boxes in one surface: twice the volume, six charts, still closed."""
    box = rectangle((0.0, 0.0), (1.0, 1.0))
    both = joined([Prism(box, 0.0, 1.0, "station", LEVEL).surface, Prism(box, 3.0, 5.0, "station", LEVEL).surface])
    assert solid(both).is_watertight
    assert solid(both).volume == pytest.approx(3.0, rel=1e-9)
    assert sorted(set(both.chart.tolist())) == [0, 1, 2, 3, 4, 5]
