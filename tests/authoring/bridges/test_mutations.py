"""The invariants can fail: each is shown a bridge that was sound until one member was broken."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from authoring.shapes.component import Component
from tests.authoring.bridges.built import STRAIGHT, Bridge, make_bridge
from tests.authoring.bridges.conftest import INVARIANTS, judge

Break = Callable[[Component], Component]


@pytest.fixture(scope="module")
def sound() -> Bridge:
    """A small beam bridge with piers."""
    return make_bridge(
        "beam", 3, service="road", **STRAIGHT, beam={"spans": [12.0, 14.0]}, roadway={"lanes": 2, "footway": True}
    )


def with_mesh(**changes: Callable[[Component], np.ndarray]) -> Break:
    """Break arrays of a member's mesh."""
    return lambda c: replace(c, mesh=replace(c.mesh, **{key: change(c) for key, change in changes.items()}))


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Break:
    """Move a member [m]."""
    return with_mesh(points=lambda c: c.mesh.points + np.array([x, y, z]))


def scaled(factor: float) -> Break:
    """Blow a member up about its middle."""
    return with_mesh(
        points=lambda c: c.mesh.points.mean(axis=0) + factor * (c.mesh.points - c.mesh.points.mean(axis=0))
    )


def one_face_turned(component: Component) -> np.ndarray:
    """Turn the first face round."""
    corners = component.mesh.corners.copy()
    count = component.mesh.face_counts[0]
    corners[:count] = corners[:count][::-1]
    return corners


def inside_out(component: Component) -> np.ndarray:
    """Turn every face round."""
    ends = np.cumsum(component.mesh.face_counts)
    return np.concatenate([part[::-1] for part in np.split(component.mesh.corners, ends[:-1])])


def one_vertex_moved(component: Component) -> np.ndarray:
    """Pull one vertex out of its faces' planes."""
    points = component.mesh.points.copy()
    points[0] += (0.03, 0.02, 0.01)
    return points


def vertices_merged(component: Component) -> np.ndarray:
    """Lay the first vertex upon its neighbor."""
    points = component.mesh.points.copy()
    first, second = component.mesh.corners[:2]
    points[first] = points[second]
    return points


MUTATIONS: dict[str, tuple[str, Break, str]] = {
    "a face turned round": ("Deck_000", with_mesh(corners=one_face_turned), "closed_and_outward"),
    "a member inside out": ("Pier_001_Cap", with_mesh(corners=inside_out), "closed_and_outward"),
    "an edge collapsed": ("Deck_000", with_mesh(points=vertices_merged), "no_degenerate_triangle"),
    "a face bent": ("Deck_000", with_mesh(points=one_vertex_moved), "honest_faces"),
    "normals reversed": ("Deck_000", with_mesh(normals=lambda c: -c.mesh.normals), "honest_faces"),
    "posts lifted by 8 cm": ("Post_000_L", moved(z=0.08), "every_member_meets_its_neighbors"),
    "a marking lifted by 4 cm": ("Marking_001_00", moved(z=0.04), "nothing_floats"),
    "a bearing lifted by 2 cm": ("Bearing_000_0_00", moved(z=0.02), "bearings_carry"),
    "a bearing lowered by 2 cm": ("Bearing_000_0_00", moved(z=-0.02), "bearings_carry"),
    "a bearing 60 cm aside": ("Bearing_001_0_00", moved(y=0.6), "bearings_carry"),
    "a girder raised by 30 cm": ("Girder_000_01", moved(z=0.3), "no_collision"),
    "a cap grown by a third": ("Pier_001_Cap", scaled(1.33), "no_collision"),
    "a kerb shrunk by half": ("Kerb_000_L", scaled(0.5), "declared_sizes"),
    "a footway level with its kerb": (
        "Footway_000_L",
        with_mesh(points=lambda c: c.mesh.points + np.array([0.0, -0.03, 0.006])),
        "no_common_faces",
    ),
    "an id used twice": ("Deck_000", lambda c: replace(c, instance_id=c.instance_id + 1), "named_and_numbered"),
    "a name used twice": ("Deck_000", lambda c: replace(c, name="Deck_001"), "named_and_numbered"),
    "a parameter that is no JSON": (
        "Deck_000",
        lambda c: replace(c, parameters={"width": np.nan}),
        "named_and_numbered",
    ),
    "a texture stretched": (
        "Deck_000",
        with_mesh(st=lambda c: c.mesh.st * np.array([1.6, 1.0], np.float32)),
        "even_texels",
    ),
    "a chart over all others": (
        "Deck_000",
        with_mesh(st1=lambda c: c.mesh.st1 * np.float32(0.5) + np.float32(0.2)),
        "atlas_without_overlap",
    ),
    "a chart out of the atlas": (
        "Deck_000",
        with_mesh(st1=lambda c: c.mesh.st1 + np.float32(1.0)),
        "atlas_without_overlap",
    ),
    "a length that is not there": (
        "Deck_000",
        lambda c: replace(c, parameters=c.parameters | {"length": 99.0}),
        "declared_sizes",
    ),
    "a deck under the clearance": ("Girder_000_00", moved(z=-3.0), "headroom"),
}


def broken(bridge: Bridge, name: str, change: Break) -> Bridge:
    """Break one member of a bridge."""
    members = tuple(change(member) if member.name == name else member for member in bridge.members)
    assert [a is b for a, b in zip(members, bridge.members, strict=True)].count(False) == 1
    return replace(bridge, members=members)


def test_the_sound_bridge_passes(sound: Bridge) -> None:
    """Nothing is wrong before anything is broken."""
    assert judge(sound)[0] == {}


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_a_broken_member_is_found(sound: Bridge, mutation: str) -> None:
    """The right invariant complains, and names the member."""
    name, change, invariant = MUTATIONS[mutation]
    found = {wanted.__name__: wanted for wanted in INVARIANTS}[invariant](broken(sound, name, change))
    assert any(name.rsplit("_", 1)[0] in line or line.startswith(("instance", "the atlas")) for line in found), found
