"""The beam bridge as a whole: closed members, no gaps and no collisions, ids, draws and bad input."""

import re
from dataclasses import asdict, fields
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np
import pytest

from authoring.axis.alignment import Layout
from authoring.families.beam import DrawnBeam
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import DrawnBridge, build_bridge
from authoring.parts.drawing import drawn_range
from authoring.shapes.component import F64, FIRST_BRIDGE_ID, FIRST_SITE_ID, Component, triangles
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import Settings, parse_settings
from tests.conftest import Count
from usd_schemas.components import class_of
from usd_schemas.tokens import ROLES

CLASSES = {"abutment", "bearing", "column", "deck", "girder", "parapet", "pier_cap"}
SEEDS = (0, 3, 8)


def rolling_ground(xy: F64) -> F64:
    """Ground that rises and falls by 0.4 m."""
    return 0.4 * np.sin(xy[:, 0] / 7.0) * np.cos(xy[:, 1] / 5.0)


def make(seed: int, **settings: Any) -> tuple[Layout, DrawnBridge, tuple[Component, ...]]:
    """Draw and build one straight road bridge with concrete parapets."""
    straight = {"kind": "straight", "skew": 0.0, "profile": "grade"}
    settings = {
        "service": "road",
        "alignment": straight,
        **settings,
        "parapet": {"shape": "wall", **settings.get("parapet", {})},
    }
    layout, drawn = draw_layout(parse_settings(BridgeSettings, settings, "test"), stream(seed, "bridge"))
    built = build_bridge(layout, drawn, rolling_ground)
    assert all(isinstance(part, Component) for part in built)
    return layout, drawn, tuple(part for part in built if isinstance(part, Component))


def corners_of(component: Component) -> F64:
    """Triangle corners [m], shape (T, 3, 3)."""
    return component.mesh.points[triangles(component.mesh)]


def volume(component: Component) -> float:
    """Signed volume by the divergence theorem [m3]."""
    a, b, c = np.moveaxis(corners_of(component) - component.mesh.points.mean(axis=0), 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_member_is_a_closed_solid_with_honest_normals(seed: int) -> None:
    """Each edge runs once each way, faces are flat and convex, volumes positive, corner normals near the face's."""
    for component in make(seed)[2]:
        mesh = component.mesh
        starts = np.cumsum(mesh.face_counts) - mesh.face_counts
        edges: set[tuple[int, int]] = set()
        for start, count in zip(starts, mesh.face_counts, strict=True):
            ring = mesh.corners[start : start + count]
            for edge in zip(ring.tolist(), np.roll(ring, -1).tolist(), strict=True):
                assert edge not in edges
                edges.add(edge)
            points = mesh.points[ring]
            side = np.roll(points, -1, axis=0) - points
            newell = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)
            unit = newell / np.linalg.norm(newell)
            assert np.abs((points - points[0]) @ unit).max() < 1e-6, component.name
            assert np.all(np.cross(side, np.roll(side, -1, axis=0)) @ unit > -1e-9), component.name
            assert np.all(mesh.normals[start : start + count] @ unit > 0.85), component.name
        assert edges == {(b, a) for a, b in edges}, component.name
        assert volume(component) > 0.0
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)
        assert len(mesh.st) == len(mesh.st1) == len(mesh.corners)


@pytest.mark.parametrize("spans", [[18.0, 22.0], [12.0], [9.0, 14.0, 30.0, 11.0, 8.0, 25.0, 16.0, 45.0]])
def test_names_ids_kinds_roles_and_counts(spans: list[float]) -> None:
    """Any number of spans: what an engineer would count is there, once, under its own name and id."""
    fixed = {"bearing": {"kind": "pad"}} | ({"pier": {"kind": "multi"}} if len(spans) > 1 else {})
    layout, drawn, bridge = make(1, beam={"spans": spans, "continuous": False}, **fixed)
    beam = drawn.record
    assert layout.supports == tuple(np.round(np.cumsum([0.0, *spans]), 3))
    ids = [component.instance_id for component in bridge]
    assert ids == list(range(FIRST_BRIDGE_ID, FIRST_BRIDGE_ID + len(bridge)))
    assert ids[-1] < FIRST_SITE_ID
    names = [component.name for component in bridge]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[A-Z][A-Za-z]*(_([0-9]{3}|[0-9]{2}|[0-9]|L|R|[A-Z][a-z]+))+", name) for name in names)
    assert {component.role for component in bridge} <= set(ROLES)
    assert {component.group for component in bridge} == {"Superstructure", "Substructure", "Furniture"}
    assert {class_of(component.kind) for component in bridge} - {"background"} == CLASSES - (
        {"pier_cap", "column"} if len(spans) == 1 else set()
    )
    count = {kind: sum(component.kind == kind for component in bridge) for kind in {c.kind for c in bridge}}
    lines = len(beam.girders.lines)
    assert count["concrete_girder"] == lines * len(spans)
    assert count["bearing_pad"] == count["bearing_plinth"] == 2 * lines * len(spans)
    rows = sum(2 + (length > 20.0) + (length > 30.0) for length in spans)
    assert count["diaphragm"] == rows * (lines - 1)
    assert count["deck_slab"] == len(spans)
    assert count["parapet"] - 4 == count["parapet_coping"] == 2 * (len(spans) + 2)  # and a block at each end
    assert count.get("pier_cap", 0) == count.get("pier_footing", 0) == len(spans) - 1
    assert count.get("column", 0) == beam.piers.columns * (len(spans) - 1)
    assert (count["abutment_wall"], count["backwall"], count["wing_wall"]) == (2, 2, 4)


def expected_volumes(beam: DrawnBeam) -> dict[str, float]:
    """Volumes [m3] of members without chamfers, from their dimensions alone (two spans, level, T girders)."""
    low, high = beam.spans.ends(0)
    length, g, p, road = high - low, beam.girders, beam.piers, beam.top.roadway
    assert road is not None
    stem = (g.depth - g.top_thickness) * (g.bottom_width + 0.02)
    fillet = (g.top_thickness - 0.01) * 0.5 * (g.bottom_width + 0.04 + g.top_width)
    flat = max(p.column_lines) + 0.5 * p.column_width + 0.10
    taper = (p.cap_depth - p.cap_end_depth) * (0.5 * p.cap_length - flat)
    height = beam.levels.seat
    return {
        "Girder_000_00": (stem + fillet + 0.02 * g.top_width) * (length - 0.024),
        "Deck_000": beam.top.width * beam.slab * length,
        "Pier_001_Cap": (p.cap_length * p.cap_depth - taper) * p.cap_width,
        "Abutment_000_Backwall": (beam.top.width - 0.024)
        * (-height - road.surfacing + 0.017)
        * (1.22 - beam.spans.backwall),
        "Surfacing_001": (2.0 * road.kerb_face + 0.01)
        * (road.surfacing + 0.005)
        * (length - road.joint_width + beam.spans.gap + 0.01),
    }


def test_volumes_follow_the_dimensions() -> None:
    """With chamfers set to zero each kind of member has the volume that a quantity surveyor would write down."""
    layout, drawn, bridge = make(
        2,
        grade=0.0,
        parapet={"chamfer": 0.0},
        pier={
            "kind": "multi",
            "cap": "tapered",
            "chamfer": 0.0,
            "column_shape": "round",
            "footing_depth": 0.5,
            "battered": False,
        },
        abutment={"chamfer": 0.0, "battered": False},
        beam={
            "spans": [18.0, 22.0],
            "continuous": False,
            "edge": {"groove": 0.0, "chamfer": 0.0},
            "girder": {"shape": "t", "chamfer": 0.0, "haunch": 0.0},
        },
    )
    beam = drawn.record
    found = {component.name: component for component in bridge}
    expected = expected_volumes(beam)
    for name, value in expected.items():
        assert volume(found[name]) == pytest.approx(value, rel=1e-9), name
    column = found["Pier_001_Column_00"]
    n, radius = 48, 0.5 * beam.piers.column_width
    circle = 0.5 * n * radius**2 * np.sin(2.0 * np.pi / n)
    height = column.parameters["height"]
    assert isinstance(height, float)
    assert volume(column) == pytest.approx(circle * (height + 0.02), rel=1e-9)
    for name in ("Abutment_000_Wall", "Abutment_002_Wing_L", "Pier_001_Footing"):
        size = found[name].parameters
        sides = [size[key] for key in ("length", "thickness" if "thickness" in size else "width", "height")]
        assert volume(found[name]) == pytest.approx(np.prod(np.array(sides, float)), rel=1e-9), name
    assert layout.depth == pytest.approx(-beam.levels.seat)


def stack_at(xy: tuple[float, float], bridge: tuple[Component, ...]) -> dict[str, tuple[float, float]]:
    """Cast one vertical line: the lowest and highest crossing with every member that it meets [m]."""
    found = {}
    for component in bridge:
        if not (
            np.ptp(np.sign(component.mesh.points[:, 0] - xy[0]))
            and np.ptp(np.sign(component.mesh.points[:, 1] - xy[1]))
        ):
            continue
        t = corners_of(component)
        a, b = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
        d = np.array(xy) - t[:, 0, :2]
        det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        upright = np.abs(det) < 1e-12
        det = np.where(upright, 1.0, det)
        u = (d[:, 0] * b[:, 1] - d[:, 1] * b[:, 0]) / det
        v = (a[:, 0] * d[:, 1] - a[:, 1] * d[:, 0]) / det
        hit = ~upright & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        if hit.any():
            z = t[hit, 0, 2] + u[hit] * a[hit, 2] + v[hit] * b[hit, 2]
            found[component.name] = (float(z.min()), float(z.max()))
    return found


@pytest.mark.parametrize("seed", SEEDS)
def test_load_path_has_no_gap(seed: int) -> None:
    """Deck, girder, pad, plinth, cap or wall, column, footing, ground: each rests in the next, none floats."""
    layout, drawn, bridge = make(
        seed,
        pier={"kind": "multi"},
        bearing={"kind": "pad"},
        beam={"spans": [18.0, 22.0], "continuous": False, "girder": {"shape": "i"}},
    )
    beam = drawn.record
    for span in range(beam.spans.count):
        for end, station in enumerate(beam.spans.bearing_lines(span)):
            support = span + end
            below = "Abutment_{:03d}_Wall" if support in (0, beam.spans.count) else "Pier_{:03d}_Cap"
            for line, left in enumerate(beam.girders.lines):
                x, y, _ = layout.alignment.point(np.array([station + 0.011]), np.array([left + 0.013]), np.zeros(1))[0]
                stack = stack_at((x, y), bridge)
                where = f"{span:03d}_{end}_{line:02d}"
                chain = [below.format(support), f"Plinth_{where}", f"Bearing_{where}"]
                chain += [f"Girder_{span:03d}_{line:02d}", f"Deck_{span:03d}"]
                for lower, upper in pairwise(chain):
                    gap = stack[upper][0] - stack[lower][1]
                    assert -0.035 <= gap <= 0.0, (lower, upper, gap)
    for support in range(1, beam.spans.count):
        for number, left in enumerate(beam.piers.column_lines):
            place = np.array([beam.spans.supports[support] + 0.01]), np.array([left + 0.01]), np.zeros(1)
            x, y, _ = layout.alignment.point(*place)[0]
            stack = stack_at((x, y), bridge)
            footing, column = stack[f"Pier_{support:03d}_Footing"], stack[f"Pier_{support:03d}_Column_{number:02d}"]
            assert footing[1] - column[0] == pytest.approx(0.010, abs=1e-6)
            assert column[1] - stack[f"Pier_{support:03d}_Cap"][0] == pytest.approx(0.010, abs=1e-6)
            ground = rolling_ground(np.array([[x, y]]))[0]
            assert footing[0] < footing[1] - 0.4
            assert footing[1] < ground - 0.25  # it does not lie on the ground like a plank
            assert column[1] - column[0] > 2.0


def inside(points: F64, component: Component) -> np.ndarray:
    """Tell which points lie inside a solid, by the generalized winding number, shape (N,), bool."""
    a, b, c = (corners_of(component)[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    numerator = np.sum(a * np.cross(b, c), axis=2)
    dot = [np.sum(p * q, axis=2) for p, q in ((a, b), (b, c), (c, a))]
    solid_angle = np.arctan2(numerator, la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb)
    return solid_angle.sum(axis=1) > np.pi


@pytest.mark.parametrize("seed", SEEDS[:2])
def test_members_overlap_by_no_more_than_their_embedment(seed: int, proof_count: Count) -> None:
    """What two members share is a sheet thinner than 35 mm, or under 2 % of the smaller one."""
    bridge = make(seed, grade=0.0, beam={"spans": [12.0, 14.0]}, roadway={"lanes": 1})[2]
    rng = np.random.default_rng(seed)
    low = np.array([component.mesh.points.min(axis=0) for component in bridge])
    high = np.array([component.mesh.points.max(axis=0) for component in bridge])
    size = proof_count(60, 2000)
    checked = 0
    for i, one in enumerate(bridge):
        near = np.all((low[i] < high[i + 1 :]) & (high[i] > low[i + 1 :]), axis=1)
        for j in np.nonzero(near)[0] + i + 1:
            box = np.maximum(low[i], low[j]), np.minimum(high[i], high[j])
            points = rng.uniform(*box, size=(size, 3))
            both = points[inside(points, one)]
            both = both[inside(both, bridge[j])] if len(both) else both
            checked += 1
            if len(both) < 2:
                continue
            shared = len(both) / size * float(np.prod(box[1] - box[0]))
            thin = float(np.ptp(both, axis=0).min()) < 0.035
            assert thin or shared < 0.02 * min(volume(one), volume(bridge[j])), (one.name, bridge[j].name)
    assert checked > 100


@pytest.mark.parametrize("seed", SEEDS[:2])
def test_no_two_members_show_faces_in_one_plane(seed: int) -> None:
    """Faces of different members that look the same way in the same plane do not cover each other."""
    bridge = make(seed, roadway={"lanes": 1}, beam={"spans": [8.0, 9.0]})[2]
    corners = np.concatenate([corners_of(component) for component in bridge])
    owner = np.repeat(np.arange(len(bridge)), [len(triangles(component.mesh)) for component in bridge])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    weights = np.random.default_rng(0).dirichlet((1.0, 1.0, 1.0), (len(corners), 4))
    samples = np.einsum("tsk,tkd->tsd", weights, corners)
    offset = np.sum(corners[:, 0] * normal, axis=1)
    for rows in np.array_split(np.arange(len(corners)), 12):
        near = (owner[rows, None] < owner) & (normal[rows] @ normal.T > 0.9999)
        near &= np.abs(corners[rows, 0] @ normal.T - offset) < 1e-3
        row, other = np.nonzero(near)
        row = rows[row]
        sides = [
            np.sum(
                np.cross(corners[other, (k + 1) % 3] - corners[other, k], samples[row, s] - corners[other, k])
                * normal[other],
                axis=1,
            )
            for k in range(3)
            for s in range(samples.shape[1])
        ]
        inside_by = np.array(sides).reshape(3, samples.shape[1], -1).min(axis=0).max(axis=0)
        covered = [(bridge[owner[r]].name, bridge[owner[o]].name) for r, o in zip(row, other, strict=True)]
        assert not [pair for pair, depth in zip(covered, inside_by, strict=True) if depth > 1e-9]


def test_one_seed_is_one_bridge_and_sections_do_not_disturb_each_other() -> None:
    """Same seed, same bytes; another seed differs; a fixed parameter changes no other draw."""
    first, second, third = make(5), make(5), make(6)
    for one, two in zip(first[2], second[2], strict=True):
        assert one.mesh.points.tobytes() == two.mesh.points.tobytes()
        assert one.mesh.st1.tobytes() == two.mesh.st1.tobytes()
        assert (one.name, one.instance_id, one.parameters) == (two.name, two.instance_id, two.parameters)
    assert asdict(first[1]) != asdict(third[1])
    fixed = asdict(make(5, parapet={"height": 1.3}, beam={"slab": 0.3})[1])
    before = asdict(first[1])
    for key in ("height", "concrete"):  # a wall's concrete is as high as the parapet
        assert fixed["record"]["top"]["parapets"].pop(key) == 1.3
        before["record"]["top"]["parapets"].pop(key)
    assert fixed["record"].pop("slab") == 0.3
    before["record"].pop("slab")
    assert fixed == before


def drawn_fields(model: type[Settings]) -> list[str]:
    """Names of the fields that are drawn when left out."""
    extras = {key: field.json_schema_extra for key, field in model.model_fields.items()}
    return [key for key, extra in extras.items() if isinstance(extra, dict) and "drawn" in extra]


def test_every_drawn_value_lies_in_its_range_and_is_rounded(proof_count: Count) -> None:
    """Every value that is kept under its own name, over many seeds; and both halves of the range occur."""
    shared = {
        "parapet": "top.parapets",
        "bearing": "bearings",
        "abutment": "abutments",
        "pier": "piers",
        "roadway": "top.roadway",
    }
    derived = {("pier", "cap_depth"), ("pier", "diameter"), ("bearing", "pad_height")}
    derived |= {("bearing", "pad_width"), ("bearing", "pad_length")}  # a pot has its own
    below: dict[tuple[str, str], set[bool]] = {}
    straight = {"kind": "straight", "skew": 0.0, "profile": "grade"}
    road = {"service": "road", "alignment": straight, "parapet": {"shape": "wall"}}
    straight_road = parse_settings(BridgeSettings, road, "test")
    for seed in range(proof_count(60, 1000)):
        layout, drawn = draw_layout(straight_road, stream(seed, "bridge"))
        for section, attribute in shared.items():
            model = type(getattr(BridgeSettings(), section))
            record: Any = attrgetter(attribute)(drawn.record)
            names = {field.name for field in fields(record)}
            for key in [key for key in drawn_fields(model) if key in names and (section, key) not in derived]:
                value, (low, high) = getattr(record, key), drawn_range(model, key)
                if value == 0.0 and key in ("footway_width", "median", "footing_toe", "footing_top", "batter"):
                    continue  # an option that was not drawn
                if key == "kerb_width" and record.footway_width == 0.0:
                    low, high = drawn_range(model, "verge_width")
                assert low <= value <= high, (section, key, value)
                assert value == round(value, 3)
                below.setdefault((section, key), set()).add(value < 0.5 * (low + high))
        girders, longest = drawn.record.girders, float(np.diff(layout.supports).max())
        spacing, wide = np.diff(girders.lines), girders.shape in ("u", "box")
        assert spacing.min() >= (2.99 if wide else 1.79)
        assert spacing.max() <= (5.01 if wide else 3.01)
        assert longest / 22.0 - 0.01 <= girders.depth <= longest / 16.0 + 0.01
        assert -0.025 <= layout.alignment.grade <= 0.025
        soffits = layout.alignment.height(np.array(layout.supports)) + drawn.record.levels.girder_soffit
        assert 5.0 - 1e-3 <= min(soffits) <= 7.0 + 1e-3
        bearings = drawn.record.bearings
        assert bearings.kind == "pot" or (bearings.pad_width >= 0.36 and bearings.pad_height <= 0.12)
    assert len(below) > 20
    assert all(len(halves) == 2 for halves in below.values())


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"beam": {"spans": [18.0, 90.0]}}, "bridge.beam.spans"),
        ({"beam": {"girder": {"count": 2}}, "roadway": {"lanes": 4}}, "bridge.beam.girder.count"),
        ({"bearing": {"kind": "pad", "pad_width": 0.8}}, "bridge.bearing.pad_width"),
        ({"beam": {"spans": [10.0] * 21}}, "beam.spans"),
        ({"parapet": {"heigth": 1.0}}, "parapet.heigth"),
    ],
)
def test_bad_input_names_the_field(settings: dict[str, Any], field: str) -> None:
    """One line that names the key."""
    with pytest.raises(InputError, match=re.escape(field)) as caught:
        make(0, **settings)
    assert "\n" not in str(caught.value)


def test_texture_offsets_differ_between_neighbors() -> None:
    """No two girders show the same stretch of texture."""
    starts = [c.mesh.st.min(axis=0) for c in make(0)[2] if c.kind == "concrete_girder"]
    apart = np.linalg.norm(np.array(starts)[:, None] - np.array(starts)[None], axis=2)
    assert apart[~np.eye(len(starts), dtype=bool)].min() > 0.1
