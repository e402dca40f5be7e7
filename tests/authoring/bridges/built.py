"""One random bridge of a family with everything that the invariants look at."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from authoring.axis.alignment import Layout
from authoring.families.arch_masonry import DrawnMasonry
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import FAMILIES, DrawnBridge, build_bridge
from authoring.parts.piers import Ground
from authoring.shapes.component import F64, Component, triangles
from authoring.streams import stream
from groundwork.settings import parse_settings
from tests.authoring.bridges.kernels import I64, Bools, touching

TOUCH = 0.005  # [m] members closer than this touch
STRAIGHT: dict[str, Any] = {
    "alignment": {"kind": "straight", "profile": "grade", "skew": 0.0},
    "fittings": {"lamps": False, "conduits": False},
}
OPEN_KINDS = frozenset(("road_marking", "traffic_sign", "water", "ground", "tree", "shrub", "vegetation"))


Figures = dict[str, float]


def join_figures(figures: Figures, others: Figures) -> None:
    """Join figures with others: the least of each that begins with `least`, the most of `largest`, else the sum.

    Args:
        figures: Changed in place.
        others: Figures of other members or bridges.
    """
    for key, value in others.items():
        join = min if key.startswith("least") else max if key.startswith("largest") else float.__add__
        figures[key] = join(figures[key], float(value)) if key in figures else float(value)


def rolling_ground(xy: F64) -> F64:
    """Ground that rises and falls by 0.4 m."""
    return 0.4 * np.sin(xy[:, 0] / 7.0) * np.cos(xy[:, 1] / 5.0)


@dataclass
class Bridge:
    """A bridge, and its triangles in one heap.

    Attributes:
        family: Key of the registry.
        seed: Its seed.
        layout: What the site knows of it.
        drawn: What was drawn.
        members: Its components.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
        profile: Profile that it was drawn with.
        measured: What was measured on it, as `join_figures` joins it.
    """

    family: str
    seed: int
    layout: Layout
    drawn: DrawnBridge
    members: tuple[Component, ...]
    ground: Ground = rolling_ground
    profile: str = "default"
    measured: Figures = field(default_factory=Figures)

    def note(self, key: str, value: float) -> None:
        """Note a measured value.

        Args:
            key: What it is; `join_figures` tells how values of the same key are joined.
            value: The value.
        """
        join_figures(self.measured, {key: value})

    @cached_property
    def first(self) -> I64:
        """Row of each member's first triangle, and the number of triangles, shape (N + 1,)."""
        counts = [int(np.sum(member.mesh.face_counts - 2)) for member in self.members]
        return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)

    @cached_property
    def corners(self) -> F64:
        """Triangle corners [m], shape (T, 3, 3)."""
        return np.concatenate([member.mesh.points[triangles(member.mesh)] for member in self.members])

    @cached_property
    def owner(self) -> I64:
        """Number of the member that each triangle belongs to, shape (T,)."""
        return np.repeat(np.arange(len(self.members)), np.diff(self.first))

    @cached_property
    def crossed(self) -> F64:
        """Twice the area of each triangle along its normal [m2], shape (T, 3)."""
        c = self.corners
        return np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])

    @cached_property
    def normals(self) -> F64:
        """Unit normal of each triangle [1], shape (T, 3)."""
        length = np.linalg.norm(self.crossed, axis=1, keepdims=True)
        return self.crossed / np.maximum(length, 1e-30)

    @cached_property
    def low(self) -> F64:
        """Least corner of each triangle [m], shape (T, 3)."""
        return self.corners.min(axis=1)

    @cached_property
    def high(self) -> F64:
        """Largest corner of each triangle [m], shape (T, 3)."""
        return self.corners.max(axis=1)

    @cached_property
    def boxes(self) -> F64:
        """Least and largest corner of each member [m], shape (N, 2, 3)."""
        low = np.minimum.reduceat(self.low, self.first[:-1])
        return np.stack([low, np.maximum.reduceat(self.high, self.first[:-1])], axis=1)

    @cached_property
    def volumes(self) -> F64:
        """Signed volume of each member by the divergence theorem [m3], shape (N,)."""
        middle = self.boxes.mean(axis=1)[self.owner]
        cones = np.sum((self.corners[:, 0] - middle) * self.crossed, axis=1) / 6.0
        return np.add.reduceat(cones, self.first[:-1])

    @cached_property
    def near(self) -> I64:
        """Pairs of members whose boxes come within TOUCH of each other, shape (P, 2)."""
        low, high = self.boxes[:, 0] - TOUCH, self.boxes[:, 1]
        order = np.argsort(low[:, 0], kind="stable")
        pairs = [np.zeros((0, 2), np.int64)]
        for position, i in enumerate(order):
            last = int(np.searchsorted(low[order, 0], high[i, 0], side="right"))
            others = order[position + 1 : last]
            meet = np.all((low[i, 1:] <= high[others, 1:]) & (high[i, 1:] >= low[others, 1:]), axis=1)
            pairs.append(np.stack([np.full(int(meet.sum()), i), others[meet]], axis=1))
        found = np.sort(np.concatenate(pairs), axis=1)
        return np.ascontiguousarray(found[np.lexsort((found[:, 1], found[:, 0]))])

    @cached_property
    def contacts(self) -> I64:
        """Pairs of members that touch, shape (P, 2)."""
        near: Bools = touching(self.corners, self.low, self.high, self.first, self.boxes, self.near, TOUCH)
        return np.ascontiguousarray(self.near[near])

    @cached_property
    def neighbors(self) -> list[list[int]]:
        """Members that touch each member."""
        found: list[list[int]] = [[] for _ in self.members]
        for i, j in self.contacts.tolist():
            found[i].append(j)
            found[j].append(i)
        return found

    @cached_property
    def closed(self) -> Bools:
        """Members that have to be closed, shape (N,)."""
        return np.array([member.kind not in OPEN_KINDS for member in self.members])

    @cached_property
    def in_ground(self) -> Bools:
        """Members that reach down to the ground, shape (N,)."""
        points = self.corners.reshape(-1, 3)
        below = (points[:, 2] <= self.ground(points[:, :2]) + TOUCH).reshape(-1, 3).any(axis=1)
        return np.logical_or.reduceat(below, self.first[:-1])

    @cached_property
    def without_bearings(self) -> frozenset[int]:
        """Supports that have none: all of a masonry arch bridge."""
        masonry = isinstance(getattr(self.drawn.record, "arch", None), DrawnMasonry)
        return frozenset(range(len(self.layout.supports)) if masonry else ())

    @cached_property
    def bridge_coordinates(self) -> list[F64]:
        """Vertices of each member as (station, left, height) [m], shape (V, 3) each."""
        points = np.concatenate([member.mesh.points for member in self.members])
        located = np.column_stack([*self.layout.alignment.locate(points), points[:, 2]])
        return np.split(located, np.cumsum([len(member.mesh.points) for member in self.members])[:-1])


def settings_of(family: str, **changes: Any) -> BridgeSettings:
    """Make settings that leave everything open.

    Args:
        family: Key of the registry.
        changes: Values to fix, as in a scenario's section `[bridge]`.
    """
    own = {"spans": []} if "spans" in FAMILIES[family].settings.model_fields else {}
    values = {"family": family, **changes}
    values[family] = own | values.get(family, {})
    return parse_settings(BridgeSettings, values, "test")


def make_bridge(family: str, seed: int, **changes: Any) -> Bridge:
    """Draw and build one bridge.

    Args:
        family: Key of the registry.
        seed: Seed of the bridge.
        changes: Values to fix, as in a scenario's section `[bridge]`.
    """
    layout, drawn = draw_layout(settings_of(family, **changes), stream(seed, "bridge"))
    bridge = build_on(family, seed, layout, drawn, rolling_ground)
    bridge.profile = changes.get("profile", "default")
    return bridge


def build_on(family: str, seed: int, layout: Layout, drawn: DrawnBridge, ground: Ground) -> Bridge:
    """Build what was drawn.

    Args:
        family: Key of the registry.
        seed: Seed of the bridge.
        layout: Axis, supports and deck.
        drawn: What was drawn.
        ground: Height of the ground.
    """
    built = build_bridge(layout, drawn, ground)
    members = tuple(part for part in built if isinstance(part, Component))
    return Bridge(family, seed, layout, drawn, members, ground)
