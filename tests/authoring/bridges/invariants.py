"""What holds for every bridge of every family: each function lists what is wrong with one bridge, by name."""

import json
import re
from dataclasses import asdict

import numpy as np

from authoring.shapes.component import F64, FIRST_BRIDGE_ID, FIRST_SITE_ID
from groundwork.canonical import canonical_json
from tests.authoring.bridges.built import OPEN_KINDS, Bridge
from tests.authoring.bridges.kernels import common_faces, covered_twice, depth_in, winding
from usd_schemas.components import class_of
from usd_schemas.tokens import ROLES

EMBEDDED = 0.025  # [m] thickest sheet that two members may share on purpose: 20 mm, and what a grade adds
SHARED = 0.02  # [1] of the smaller member's volume that two members may share otherwise
LARGEST_EMBEDDED = 0.5  # [1] of the smaller member's volume that may be embedded at all
APART = 0.001  # [m] between parallel faces that both are seen
LEAST_FACE = 2e-4  # [m2] of common face that counts
_IN_FRONT = 0.005  # [m] of a face, where the eye is put: in no joint between pieces of a deck, 4 mm wide
_SAMPLES = 64
_ATLAS = 2048  # [px]
_LEAST_HEIGHT = 1e-5  # [m] of a triangle
_LEAST_DENSE = 0.95  # [1] of a member's area whose texels have the member's usual size


def closed_and_outward(bridge: Bridge) -> list[str]:
    """Each edge runs once each way, volume is positive; only sheets may be open."""
    found = []
    bridge.note("least_volume_m3", bridge.volumes[bridge.closed].min())
    for number, member in enumerate(bridge.members):
        if member.kind in OPEN_KINDS:
            continue
        counts, corners = member.mesh.face_counts, member.mesh.corners.astype(np.int64)
        following = np.arange(len(corners)) + 1
        ends = np.cumsum(counts)
        following[ends - 1] = ends - counts
        size = len(member.mesh.points)
        there, back = corners * size + corners[following], corners[following] * size + corners
        once = np.unique(there)
        if len(once) < len(there) or not np.array_equal(once, np.unique(back)):
            found.append(f"{member.name}: not closed, {len(np.setxor1d(there, back))} edges run one way only")
        if not bridge.volumes[number] > 0.0:
            found.append(f"{member.name}: volume {bridge.volumes[number]:g} m3")
    return found


def no_degenerate_triangle(bridge: Bridge) -> list[str]:
    """No triangle is flatter than a hundredth of a millimeter."""
    sides = np.linalg.norm(bridge.corners - np.roll(bridge.corners, 1, axis=1), axis=2).max(axis=1)
    height = np.linalg.norm(bridge.crossed, axis=1) / np.maximum(sides, 1e-30)
    bridge.note("least_height_of_a_triangle_m", height.min())
    flat = height < _LEAST_HEIGHT
    names = np.unique(bridge.owner[flat])
    return [
        f"{bridge.members[n].name}: {int(flat[bridge.owner == n].sum())} triangles without area, lowest height "
        f"{height[bridge.owner == n].min():.1e} m"
        for n in names
    ]


def honest_faces(bridge: Bridge) -> list[str]:
    """Faces are flat and convex; corner normals are unit vectors near their face's own."""
    found = []
    for number, member in enumerate(bridge.members):
        mesh, own = member.mesh, slice(bridge.first[number], bridge.first[number + 1])
        fans = mesh.face_counts - 2
        face = np.repeat(np.arange(len(fans)), fans)
        starts = np.concatenate([[0], np.cumsum(fans)[:-1]])
        total = np.add.reduceat(bridge.crossed[own], starts, axis=0)
        unit = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
        if np.any(np.sum(bridge.crossed[own] * unit[face], axis=1) < -1e-9):
            found.append(f"{member.name}: a face is not convex")
        heights = np.einsum("tkd,td->tk", bridge.corners[own] - bridge.corners[own][starts[face], :1], unit[face])
        bridge.note("largest_distance_from_a_plane_m", np.abs(heights).max())
        if np.abs(heights).max() > 1e-6:
            found.append(f"{member.name}: a face leaves its plane by {np.abs(heights).max():.1e} m")
        along = np.sum(mesh.normals * np.repeat(unit, mesh.face_counts, axis=0), axis=1)
        bridge.note("least_cosine_of_a_normal", along.min())
        if along.min() < 0.8 or np.abs(np.linalg.norm(mesh.normals, axis=1) - 1.0).max() > 1e-4:
            angle = np.degrees(np.arccos(np.clip(along.min(), -1.0, 1.0)))
            found.append(f"{member.name}: a corner's normal is {angle:.0f} degrees off")
    return found


def nothing_floats(bridge: Bridge) -> list[str]:
    """Every member touches, within 5 mm, something that leads to the ground."""
    reached = bridge.in_ground.copy()
    front = np.flatnonzero(reached).tolist()
    while front:
        for other in bridge.neighbors[front.pop()]:
            if not reached[other]:
                reached[other] = True
                front.append(other)
    bridge.note("members_held", reached.sum())
    return [f"{bridge.members[n].name} floats, {_gap(bridge, int(n))}" for n in np.flatnonzero(~reached)]


def _gap(bridge: Bridge, number: int) -> str:
    """Tell how far the nearest other member is."""
    points = np.unique(bridge.corners[bridge.owner == number].reshape(-1, 3), axis=0)[:200]
    low, high = bridge.boxes[number, 0] - 1.0, bridge.boxes[number, 1] + 1.0
    near = np.flatnonzero(np.all((bridge.boxes[:, 0] <= high) & (bridge.boxes[:, 1] >= low), axis=1))
    gaps = [
        (float(depth_in(points, bridge.corners, bridge.first[n], bridge.first[n + 1]).min()), bridge.members[n].name)
        for n in near[near != number]
    ]
    return "about {:.3f} m from {}".format(*min(gaps)) if gaps else "more than 1 m from everything"


def no_collision(bridge: Bridge) -> list[str]:
    """Two members share a sheet no thicker than an embedment, or under 2 % of the smaller one."""
    found = []
    rng = np.random.default_rng(bridge.seed)
    bridge.note("pairs_of_solids", bridge.closed[bridge.contacts].all(axis=1).sum())
    for i, j in bridge.contacts[bridge.closed[bridge.contacts].all(axis=1)]:
        low = np.maximum(bridge.boxes[i, 0], bridge.boxes[j, 0])
        high = np.minimum(bridge.boxes[i, 1], bridge.boxes[j, 1])
        if _embedded(bridge, int(i), int(j)) or _embedded(bridge, int(j), int(i)):
            continue
        box, smaller = float(np.prod(np.maximum(high - low, 0.0))), min(bridge.volumes[i], bridge.volumes[j])
        if box <= SHARED * smaller:
            continue
        share, depth = _common(bridge, int(i), int(j), low + (high - low) * rng.random((_SAMPLES, 3)))
        if share * box > 0.5 * SHARED * smaller:  # close: look again, closer
            share, depth = _common(bridge, int(i), int(j), low + (high - low) * rng.random((8 * _SAMPLES, 3)))
        volume = share * box
        thick = "an_overlap" if depth > 0.5 * EMBEDDED + 1e-4 else "a_sheet"
        bridge.note(f"largest_share_of_{thick}", float(volume / smaller))
        if volume > SHARED * smaller and (depth > 0.5 * EMBEDDED + 1e-4 or volume > LARGEST_EMBEDDED * smaller):
            found.append(
                f"{bridge.members[i].name} and {bridge.members[j].name} share {volume:.4f} m3, "
                f"{volume / smaller:.0%} of the smaller, {2000.0 * depth:.0f} mm thick"
            )
    return found


def _embedded(bridge: Bridge, one: int, other: int) -> bool:
    """Whether a member says that it lies in the other, as a sleeper lies in its ballast."""
    return bridge.members[one].parameters.get("embedded_in") == bridge.members[other].kind


def _common(bridge: Bridge, i: int, j: int, points: F64) -> tuple[float, float]:
    """Share of the points that lie in both members [1], and how deep the deepest lies [m]."""
    both = points
    for n in (i, j):
        both = both[winding(both, bridge.corners, bridge.first[n], bridge.first[n + 1]) > 0] if len(both) else both
    if len(both) == 0:
        return 0.0, 0.0
    some = both[:_SAMPLES]
    depths = [depth_in(some, bridge.corners, bridge.first[n], bridge.first[n + 1]) for n in (i, j)]
    return len(both) / len(points), float(np.minimum(*depths).max())


def no_common_faces(bridge: Bridge) -> list[str]:
    """No two members show faces in one plane on top of each other, where the eye could see them."""
    rows, finds = common_faces(
        bridge.corners,
        bridge.normals,
        bridge.low,
        bridge.high,
        bridge.first,
        bridge.boxes,
        bridge.contacts,
        APART,
        LEAST_FACE,
    )
    bridge.note("contacts", len(bridge.contacts))
    found: dict[tuple[str, str], float] = {}
    for row, find in zip(rows, finds, strict=True):
        i, j = bridge.contacts[row]
        eye = (find[:3] + _IN_FRONT * find[3:6])[None]
        boxes = np.all((bridge.boxes[:, 0] <= eye) & (bridge.boxes[:, 1] >= eye), axis=1) & bridge.closed
        if any(
            winding(eye, bridge.corners, bridge.first[n], bridge.first[n + 1])[0] > 0 for n in np.flatnonzero(boxes)
        ):
            continue
        names = (bridge.members[i].name, bridge.members[j].name)
        found[names] = found.get(names, 0.0) + float(find[6])
    return [f"{one} and {two} show {area:.4f} m2 in one plane" for (one, two), area in found.items()]


def named_and_numbered(bridge: Bridge) -> list[str]:
    """Ids and names are unique, kinds and roles known, parameters and the record of the draw JSON."""
    found = []
    bridge.note("members", len(bridge.members))
    ids, names = [m.instance_id for m in bridge.members], [m.name for m in bridge.members]
    if ids != list(range(FIRST_BRIDGE_ID, FIRST_BRIDGE_ID + len(ids))) or ids[-1] >= FIRST_SITE_ID:
        found.append("instance ids do not count from the first bridge id")
    try:
        canonical_json(asdict(bridge.drawn))
    except (TypeError, ValueError) as error:
        found.append(f"the record of the draw is not JSON ({error})")
    found += [f"{name}: name used twice" for name in sorted({n for n in names if names.count(n) > 1})]
    for member in bridge.members:
        class_of(member.kind)
        if not re.fullmatch(r"[A-Z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", member.name):
            found.append(f"{member.name}: not a prim name of ours")
        if member.role not in ROLES:
            found.append(f"{member.name}: role {member.role} is unknown")
        try:
            json.dumps(member.parameters, allow_nan=False)
        except (TypeError, ValueError) as error:
            found.append(f"{member.name}: parameters are not JSON ({error})")
    return found


def even_texels(bridge: Bridge) -> list[str]:
    """One meter of texture is one meter of surface: 20 % in the mean of both ways, 50 % in either, over a member."""
    st = np.concatenate([m.mesh.st.astype(np.float64)[_fan(m.mesh.face_counts)] for m in bridge.members])
    one, two = bridge.corners[:, 1] - bridge.corners[:, 0], bridge.corners[:, 2] - bridge.corners[:, 0]
    p, q = st[:, 1] - st[:, 0], st[:, 2] - st[:, 0]
    # Singular values of the map from the triangle's plane to the texture, by its metric tensors.
    e, f, g = np.sum(one * one, axis=1), np.sum(one * two, axis=1), np.sum(two * two, axis=1)
    a, b, c = np.sum(p * p, axis=1), np.sum(p * q, axis=1), np.sum(q * q, axis=1)
    det = np.maximum(e * g - f * f, 1e-30)
    trace, product = (a * g - 2.0 * b * f + c * e) / det, np.maximum((a * c - b * b) / det, 0.0)
    root = np.sqrt(np.maximum(0.25 * trace * trace - product, 0.0))
    least, most = np.sqrt(np.maximum(0.5 * trace - root, 0.0)), np.sqrt(0.5 * trace + root)
    density = product**0.25
    bad = (density < 0.8) | (density > 1.2) | (least < 1.0 / 1.5) | (most > 1.5)
    area = 0.5 * np.linalg.norm(bridge.crossed, axis=1)
    share = np.add.reduceat(np.where(bad, area, 0.0), bridge.first[:-1]) / np.add.reduceat(area, bridge.first[:-1])
    found = []
    bridge.note("least_even_share", 1.0 - share.max())
    for n in np.flatnonzero(share > 1.0 - _LEAST_DENSE):
        own = (bridge.owner == n) & bad
        found.append(
            f"{bridge.members[n].name}: on {share[n]:.0%} of its area a metre of surface has {least[own].min():.2f} to "
            f"{most[own].max():.2f} m of texture"
        )
    return found


def _fan(counts: np.ndarray) -> np.ndarray:
    """Corner numbers of each triangle of a fan, shape (T, 3)."""
    fans = counts - 2
    first = np.repeat(np.cumsum(counts) - counts, fans)
    step = np.arange(int(fans.sum())) - np.repeat(np.cumsum(fans) - fans, fans)
    return np.stack([first, first + step + 1, first + step + 2], axis=1)


def atlas_without_overlap(bridge: Bridge) -> list[str]:
    """The second UV set lies in the unit square, and no texel shows two places."""
    charts = np.concatenate([m.mesh.st1.astype(np.float64)[_fan(m.mesh.face_counts)] for m in bridge.members])
    found = []
    bridge.note("least_margin_of_the_atlas", min(charts.min(), 1.0 - charts.max()))
    if charts.min() < 0.0 or charts.max() > 1.0:
        found.append(f"the atlas reaches from {charts.min():.3f} to {charts.max():.3f}")
    earlier, later = covered_twice(charts, _ATLAS)
    owners = {(int(bridge.owner[a]), int(bridge.owner[b])) for a, b in zip(earlier, later, strict=True)}
    pairs = {(bridge.members[a].name, bridge.members[b].name) for a, b in owners}
    return found + [f"{one} and {two} share texels" for one, two in sorted(pairs)]


def declared_sizes(bridge: Bridge) -> list[str]:
    """No declared dimension exceeds the member, and the largest tells at least half of it; the deck's width is true."""
    found = []
    for number, member in enumerate(bridge.members):
        span = bridge.boxes[number, 1] - bridge.boxes[number, 0]
        keys = ("length", "width", "height", "thickness", "depth", "diameter", "arms")
        declared = {key: value for key in keys if isinstance(value := member.parameters.get(key), int | float)}
        # Along the axis a length counts in stations, round a curve.
        along = np.ptp(bridge.bridge_coordinates[number], axis=0)
        diagonal = float(max(np.linalg.norm(span), np.linalg.norm(along)))
        for value in declared.values():
            bridge.note("largest_declared_of_what_is_allowed", value / (1.02 * diagonal + 0.05))
        if "length" in declared:
            bridge.note("least_declared_of_the_length", max(declared.values()) / float(span.max()))
        found += [
            f"{member.name}: {key} {value:g} m, but its box's diagonal is {diagonal:.3f} m"
            for key, value in declared.items()
            if not 0.0 < value <= 1.02 * diagonal + 0.05
        ]
        if "length" in declared and max(declared.values()) < 0.5 * float(span.max()):
            found.append(f"{member.name}: no declared dimension reaches half of its {span.max():.3f} m")
    return found
