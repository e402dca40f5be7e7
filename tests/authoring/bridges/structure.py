"""What an engineer checks on every bridge: what carries what, supports, cables, rails, headroom, symmetry."""

import numpy as np

from authoring.families.shared import SharedSettings
from authoring.parts.drawing import drawn_range
from authoring.shapes.component import F64
from tests.authoring.bridges.built import Bridge
from usd_schemas.components import class_of

GAUGE = {"default": 1.435, "paper": 1.400}  # [m] between the rails' inner faces; the paper's rails are 1.5 m apart
_GAUGE_TOLERANCE = 0.003  # [m] on a straight track; a curved one's chords add their sagitta
_GAUGE_DEPTH = 0.016  # [m] of the rail's head
_CARRIERS = frozenset(
    (
        "pier_cap",
        "cross_head",
        "abutment_wall",
        "anchor_block",
        "column",
        "wall_pier",
        "pier_footing",
        "pylon_leg",
        "pylon_beam",
        "tower_leg",
        "tower_beam",
        "arch_ring",
        "arch_rib",
        "spandrel_column",
    )
)
_CARRIED = frozenset(
    (
        "concrete_girder",
        "plate_girder",
        "box_girder",
        "edge_beam",
        "deck_slab",
        "deck_soffit",
        "floor_beam",
        "diaphragm",
        "arch_rib",
        "cross_frame",
        "stiffener",
    )
)
_DECKS = frozenset(
    (
        "deck_slab",
        "deck_top",
        "box_girder",
        "edge_beam",
        "wing_wall",
        "backwall",
        "abutment_wall",
        "anchor_block",
        "spandrel_wall",
        "ballast",
        "surfacing",
    )
)
_UPPER = frozenset(("saddle", "upper_anchorage", "cable_clamp"))
_LOWER = frozenset(("cable_socket", "cable_clamp", "anchor_block", "saddle"))

# Every kind on the left touches at least one of each set on the right.
NEIGHBORS: dict[str, tuple[frozenset[str], ...]] = {
    "pier_cap": (frozenset(("column", "wall_pier")),),
    "sleeper": (frozenset(("track_slab", "ballast", "deck_slab", "deck_top")), frozenset(("rail",))),
    "rail": (frozenset(("sleeper", "track_slab")),),
    "main_cable": (frozenset(("saddle",)), _LOWER),
    "stay": (frozenset(("upper_anchorage", "saddle")), frozenset(("cable_socket", "anchor_block"))),
    "hanger": (_UPPER | {"cable_socket"}, _LOWER - {"saddle"}),
    "saddle": (frozenset(("tower_leg", "tower_beam", "pylon_leg", "pylon_beam")), frozenset(("main_cable", "stay"))),
    "surfacing": (_DECKS - {"surfacing"},),
    "track_slab": (_DECKS,),
    "ballast": (_DECKS - {"ballast"},),
    "kerb": (_DECKS,),
    "parapet": (_DECKS - {"surfacing"} | {"footway"},),
    "parapet_coping": (frozenset(("parapet",)),),
    "railing_post": (_DECKS | {"parapet", "parapet_coping", "kerb", "footway"},),
    "railing": (frozenset(("railing_post", "parapet", "parapet_coping", "kerb", "footway")),),
}


def every_member_meets_its_neighbors(bridge: Bridge) -> list[str]:
    """A cap touches its columns, a kerb the deck, a cable both its ends, a rail its sleepers."""
    found = []
    for number, member in enumerate(bridge.members):
        kinds = {bridge.members[n].kind for n in bridge.neighbors[number]}
        bridge.note("members_that_must_touch", member.kind in NEIGHBORS)
        found += [
            f"{member.name}: touches none of {', '.join(sorted(wanted))}, only {', '.join(sorted(kinds)) or 'nothing'}"
            for wanted in NEIGHBORS.get(member.kind, ())
            if not kinds & wanted
        ]
    return found


def bearings_carry(bridge: Bridge) -> list[str]:
    """Plinth, pad and plates that touch each other are one bearing: it stands on something and carries something."""
    bearing = [class_of(member.kind) == "bearing" for member in bridge.members]
    seen: set[int] = set()
    found, count = [], 0
    for start in np.flatnonzero(bearing).tolist():
        if start in seen:
            continue
        stack, group, kinds = [start], [], set[str]()
        seen.add(start)
        while stack:
            number = stack.pop()
            group.append(bridge.members[number].name)
            for other in bridge.neighbors[number]:
                kinds.add(bridge.members[other].kind)
                if bearing[other] and other not in seen:
                    seen.add(other)
                    stack.append(other)
        count += 1
        if not kinds & _CARRIERS:
            found.append(f"{', '.join(sorted(group))}: stands on nothing, touches {', '.join(sorted(kinds))}")
        if not kinds & _CARRIED:
            found.append(f"{', '.join(sorted(group))}: carries nothing, touches {', '.join(sorted(kinds))}")
    bridge.note("bearings", count)
    return found


def cables_end_in_fittings(bridge: Bridge) -> list[str]:
    """The lowest and the highest end of every stay and hanger lie in two different fittings."""
    bridge.note("stays_and_hangers", sum(member.kind in ("stay", "hanger") for member in bridge.members))
    found = []
    for number, member in enumerate(bridge.members):
        if member.kind not in ("stay", "hanger"):
            continue
        points = member.mesh.points
        rise = points[:, 2] - points[:, 2].min()
        thick = float(np.sort(np.ptp(points, axis=0))[0]) + 0.05
        ends = [points[rise <= 0.02], points[rise >= rise.max() - 0.02]]
        holders = []
        for end in ends:
            middle = end.mean(axis=0)
            near = [
                n
                for n in bridge.neighbors[number]
                if bridge.members[n].kind in _UPPER | _LOWER
                and np.all(bridge.boxes[n, 0] - thick <= middle)
                and np.all(bridge.boxes[n, 1] + thick >= middle)
            ]
            holders.append(set(near))
        if not holders[0] or not holders[1] or holders[0] | holders[1] <= holders[0] & holders[1]:
            where = "lower" if not holders[0] else "upper"
            found.append(f"{member.name}: nothing holds its {where} end")
    return found


def supports_have_bearings(bridge: Bridge) -> list[str]:
    """Each support has bearings, and a pier, a pylon or an abutment; masonry and fixed supports are declared."""
    found = []
    carriers = {"abutment", "column", "pier_cap"}
    bridge.note("supports", len(bridge.layout.supports))
    for support, station in enumerate(bridge.layout.supports):
        own = [m for m in bridge.members if m.parameters.get("support") == support]
        classes = {class_of(m.kind) for m in own}
        if not classes & carriers:
            found.append(f"support {support} at {station:g} m has no pier and no abutment")
        if "bearing" not in classes and support not in bridge.without_bearings:
            found.append(f"support {support} at {station:g} m has no bearing")
    return found


def headroom(bridge: Bridge) -> list[str]:
    """Between the supports, deck and girders keep the least clearance above z = 0 that is ever drawn."""
    least = drawn_range(SharedSettings, "clearance", bridge.profile)[0]
    first, last = bridge.layout.supports[0], bridge.layout.supports[-1]
    found = []
    for member, place in zip(bridge.members, bridge.bridge_coordinates, strict=True):
        if class_of(member.kind) in ("deck", "girder", "beam"):
            lowest = place[(place[:, 0] > first) & (place[:, 0] < last), 2]
            if len(lowest):
                bridge.note("least_height_above_what_is_drawn_m", lowest.min() - least)
            if len(lowest) and lowest.min() < least - 0.01:
                found.append(f"{member.name}: {lowest.min():.2f} m above z = 0, less than {least:g} m")
    return found


def rails_at_gauge(bridge: Bridge) -> list[str]:
    """The inner faces of a track's two rails are 1.435 m apart, close under their tops."""
    tracks: dict[object, list[tuple[float, float, str, F64]]] = {}
    for member, points in zip(bridge.members, bridge.bridge_coordinates, strict=True):
        if member.kind == "rail":
            where = float(points[:, 0].min()), float(points[:, 1].mean())
            tracks.setdefault(member.parameters.get("track"), []).append((*where, member.name, points))
    found = []
    bridge.note("tracks", len(tracks))
    for track, rails in tracks.items():
        rails.sort(key=lambda rail: rail[0])
        found += [] if len(rails) % 2 == 0 else [f"track {track}: {len(rails)} rails"]
        for pair in zip(rails[::2], rails[1::2], strict=False):
            (start, _, name, right), (other_start, _, _, left) = sorted(pair, key=lambda rail: rail[1])
            gauge = _head_edge(left, -1.0) - _head_edge(right, 1.0)
            bridge.note("largest_error_of_the_gauge_m", abs(gauge - GAUGE[bridge.profile]))
            if abs(gauge - GAUGE[bridge.profile]) > _GAUGE_TOLERANCE or abs(start - other_start) > 0.3:
                found.append(f"{name}: gauge {gauge:.4f} m, begins {abs(start - other_start):.2f} m beside its twin")
    return found


def _head_edge(rail: F64, side: float) -> float:
    """Where the inner face of a rail's head lies, at its first end [m]."""
    end = rail[rail[:, 0] <= rail[:, 0].min() + 0.02]
    head = end[end[:, 2] >= end[:, 2].max() - _GAUGE_DEPTH]
    return float(side * np.max(side * head[:, 1]))


def mirrored_about_the_axis(bridge: Bridge) -> list[str]:
    """Every member has a twin of the same kind and volume on the other side, or lies on the axis.

    For a straight, level-crossed bridge whose family is symmetric.
    """
    rows = []
    for number, points in enumerate(bridge.bridge_coordinates):
        rows.append([*points.min(axis=0), *points.max(axis=0), bridge.volumes[number]])
    table = np.array(rows)
    twin = table.copy()
    twin[:, 1], twin[:, 4] = -table[:, 4], -table[:, 1]
    kinds = np.array([m.kind for m in bridge.members])
    found = []
    for number, member in enumerate(bridge.members):
        near = (np.abs(table - twin[number]) < 2e-3 * np.maximum(1.0, np.abs(table))).all(axis=1)
        if not (near & (kinds == member.kind)).any():
            found.append(f"{member.name}: has no twin across the axis")
    return found
