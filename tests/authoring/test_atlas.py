"""The atlas: no two faces of a bridge share a spot, and all have one scale."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from authoring.axis.alignment import Alignment
from authoring.families.alignments import AlignmentSettings
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import build_bridge
from authoring.shapes.component import F64, I32, Component, triangles
from authoring.shapes.sections import circle, rectangle
from authoring.solids.atlas import MARGIN, pack_atlas
from authoring.solids.extrusion import Prism
from authoring.streams import stream
from tests.conftest import Count


def corner_rows(component: Component) -> I32:
    """Find the row of each triangle's corners in the face-corner arrays, shape (T, 3)."""
    mesh = component.mesh
    rows = np.arange(len(mesh.corners), dtype=np.int32)
    return triangles(type(mesh)(mesh.points, mesh.face_counts, rows, mesh.normals, mesh.st, mesh.st1))


def signed_doubles(corners: F64) -> F64:
    """Twice the signed area of 2D triangles, shape (T,)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def test_no_two_faces_of_a_bridge_overlap_in_the_atlas(proof_count: Count) -> None:
    """Random points inside triangles (with --proof: of each) lie in no other triangle: brute force over all pairs."""
    layout, drawn = draw_layout(
        BridgeSettings(service="road", alignment=AlignmentSettings(kind="straight", skew=0.0)), stream(0, "bridge")
    )
    bridge = build_bridge(layout, drawn, lambda xy: np.zeros(len(xy)))
    uv, metric = [], []
    for component in bridge:
        assert isinstance(component, Component)
        uv.append(component.mesh.st1.astype(np.float64)[corner_rows(component)])
        metric.append(component.mesh.st.astype(np.float64)[corner_rows(component)])
    corners = np.concatenate(uv)
    assert corners.min() >= 0.0
    assert corners.max() <= 1.0
    double = signed_doubles(corners)
    assert np.all(double > 0.0)  # neither mirrored nor degenerate
    areas = np.abs(signed_doubles(np.concatenate(metric)))
    scale = np.sqrt(double / areas)
    large = areas > 1e-3  # smaller ones drown in float32
    np.testing.assert_allclose(scale[large], np.median(scale), rtol=2e-2)
    assert double.sum() / 2.0 > 0.55  # most of the square is used
    weights = np.random.default_rng(1).dirichlet((2.0, 2.0, 2.0), len(corners))
    inner = np.einsum("tk,tkd->td", weights, corners)[:: proof_count(8, 1)]
    for points in np.array_split(inner, 60):
        inside = np.ones((len(points), len(corners)), bool)
        for k in range(3):
            start, edge = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
            inside &= edge[:, 0] * (points[:, 1:] - start[:, 1]) - edge[:, 1] * (points[:, :1] - start[:, 0]) > 0.0
        assert inside.sum(axis=1).max() <= 1


@given(st.lists(st.tuples(st.floats(0.05, 30.0), st.floats(0.05, 3.0)), min_size=1, max_size=25))
def test_charts_keep_their_distance(sizes: list[tuple[float, float]]) -> None:
    """The boxes of any two charts are two margins apart, and one margin from the border."""
    place = Alignment(0.0)
    solids = [
        Prism(rectangle((0.0, 0.0), (side, side)), 0.0, length, "station", place).surface for length, side in sizes
    ]
    boxes = []
    for surface, atlas in zip(solids, pack_atlas(solids), strict=True):
        chart = np.repeat(surface.chart, surface.face_counts)
        boxes += [(atlas[chart == k].min(axis=0), atlas[chart == k].max(axis=0)) for k in range(3)]
    low, high = np.array([box[0] for box in boxes]), np.array([box[1] for box in boxes])
    assert low.min() > 0.4 * MARGIN
    assert high.max() < 1.0 - 0.4 * MARGIN
    for k in range(len(boxes)):
        apart = np.maximum(low[k] - high, low - high[k]).max(axis=1)
        assert np.delete(apart, k).min() > 0.8 * MARGIN


def test_packing_is_deterministic() -> None:
    """The same solids give the same bytes, and what another processor's last digits do moves no chart."""
    solids = [Prism(circle(1.0 + k // 2, 12), 0.0, 5.0, "above", Alignment(0.0)).surface for k in range(6)]
    rng = np.random.default_rng(5)
    noisy = [replace(solid, st=solid.st + rng.uniform(-1e-12, 1e-12, solid.st.shape)) for solid in solids]
    for one, two, other in zip(pack_atlas(solids), pack_atlas(solids), pack_atlas(noisy), strict=True):
        assert one.tobytes() == two.tobytes()
        np.testing.assert_allclose(one, other, atol=1e-9)
