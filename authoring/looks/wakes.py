"""Foam and wakes at piers that stand in a river, on the image of a site's stretch of it."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.looks.noise import Floats, Tile, fractal, ramp
from authoring.looks.shallows import BRIGHTEST, EDGE_FADE
from authoring.shapes.component import Component, Scatter, triangles
from authoring.site.roads import water_half
from authoring.site.site import Site

F64 = NDArray[np.float64]

KINDS = ("column", "wall_pier", "pier_footing", "pylon_leg", "tower_leg")  # members that stand in the water
_FOAM = (1.99, 1.94, 1.99)  # factors of foam: white bubbles, as far as the image can store it [1]
_STILL = 2.0  # [m] depth from which on the crossing is a harbour without a current; rivers are up to 1.4 m deep
_WET = (0.15, 0.6)  # [m] mean depth at a member from which on there is a wake, and from which on it is strongest
_BLOCKED = 0.5  # largest width of a member over that of the river [1]
_SIZE = (0.5, 3.5)  # [m] widths between which a wake grows with its pier
_SPREAD = 0.21  # of the V-shaped bow wave to either side for each meter downstream: 12 degrees [1]
_REACH = 9.0  # length of a wake over the width of its pier [1]
_SMOOTH = 0.32  # largest darkening of the water directly behind a pier [1]


@dataclass(frozen=True, eq=False)
class _Body:
    """A member's cross-section at the surface of the water.

    Attributes:
        middle: World position of its middle [m], shape (2,), float64.
        ahead: Unit vector downstream [1], shape (2,), float64.
        left: Its middle's distance to the left of the axis [m].
        side: Its middle's distance to the left of the river's middle, seen downstream [m].
        outline: Its convex outline, downstream and to the left of the middle, counter-clockwise [m], shape (K, 2).
        strength: 1 in deep water, less near the shore [1].
    """

    middle: F64
    ahead: F64
    left: float
    side: float
    outline: F64
    strength: float

    @property
    def width(self) -> float:
        """Width across the current that decides the size of the wake [m]."""
        return float(np.clip(np.ptp(self.outline[:, 1]), *_SIZE))


def with_wakes(factors: Floats, site: Site, bridge: Iterable[Component | Scatter], rng: np.random.Generator) -> Floats:
    """Draw foam and wakes on the image of a river. The current always flows to the left of the bridge's axis.

    Args:
        factors: Factors by `shallows` [1], shape (pixels, pixels, 3), float32.
        site: The site, with a river.
        bridge: Parts of the bridge.
        rng: Random stream, used only if a pier stands in the river.

    Returns:
        Factors [1], shape (pixels, pixels, 3), float32; the very same array where no pier stands in the river.
    """
    bodies = _bodies(site, bridge)
    if not bodies:
        return factors
    noises = _noises(site, len(factors), rng)
    foam, smooth = (np.zeros(factors.shape[:2], np.float32) for _ in range(2))
    for body in bodies:
        _draw(body, site, noises, (foam, smooth))
    drawn = factors * (1 - np.float32(_SMOOTH) * smooth)[..., None]
    drawn = drawn + foam[..., None] * (np.array(_FOAM, np.float32) - drawn)
    return np.clip(drawn, 0.2, BRIGHTEST).astype(np.float32)


def _bodies(site: Site, bridge: Iterable[Component | Scatter]) -> list[_Body]:
    """Find the members that stand in a river with a current and leave it room."""
    if site.land.crossing.depth > _STILL:
        return []
    standing = (piece for piece in bridge if isinstance(piece, Component) and piece.kind in KINDS)
    found = (_body(site, outline) for piece in standing if len(outline := _section(piece, site.land.crossing.level)))
    return [body for body in found if body.strength > 0.0 and _leaves_room(site, body)]


def _leaves_room(site: Site, body: _Body) -> bool:
    return float(np.ptp(body.outline[:, 1])) < _BLOCKED * 2.0 * site.land.crossing.half_width


def _section(piece: Component, level: float) -> F64:
    """Cut a member at a height: the convex outline in plan, counter-clockwise [m], shape (K, 2), or (0, 2) for none."""
    from scipy.spatial import ConvexHull

    corners = piece.mesh.points[triangles(piece.mesh)]
    one, other = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
    cut = (one[:, 2] > level) != (other[:, 2] > level)
    one, other = one[cut], other[cut]
    share = (level - one[:, 2]) / (other[:, 2] - one[:, 2])
    points = one[:, :2] + share[:, None] * (other[:, :2] - one[:, :2])
    if not len(points) or np.ptp(points, axis=0).min() < 1e-3:
        return np.zeros((0, 2))
    return points[ConvexHull(points).vertices]


def _body(site: Site, outline: F64) -> _Body:
    """Place a cross-section in the current."""
    crossing, axis = site.land.crossing, site.land.layout.alignment
    middle = 0.5 * (outline.min(axis=0) + outline.max(axis=0))
    station, left = axis.locate(middle[None])
    lefts = left + np.array([-0.5, 0.5])
    course = axis.point(crossing.center(lefts), lefts, np.zeros(2))[:, :2]
    ahead = (course[1] - course[0]) / np.linalg.norm(course[1] - course[0])
    frame = np.column_stack([ahead, (-ahead[1], ahead[0])])
    side = float((crossing.center(left) - station)[0] / crossing.stretch(left)[0])
    depth = float(np.mean(crossing.level - site.ground(outline)))
    strength = float(ramp(np.array([depth], np.float32), *_WET)[0]) if abs(side) < crossing.half_width else 0.0
    return _Body(middle, ahead, float(left[0]), side, (outline - middle) @ frame, strength)


@dataclass(frozen=True, eq=False)
class _Noises:
    """Random fields over the whole image, each with mean 0 and standard deviation 1.

    Attributes:
        bend: Slow sideways bends of the flow [1], shape (pixels, pixels), float32.
        streaks: Thin streaks along the flow [1], shape (pixels, pixels), float32.
        clumps: Clumps of foam [1], shape (pixels, pixels), float32.
    """

    bend: Floats
    streaks: Floats
    clumps: Floats


def _noises(site: Site, pixels: int, rng: np.random.Generator) -> _Noises:
    width, length = 2 * water_half(site.land.crossing), float(site.field.lefts[-1] - site.field.lefts[0])
    longer = width / length  # texels are longer along the river than across
    finest = max(0.15, 2.0 * max(width, length / 1.4) / pixels)  # [m] no detail that shows single texels
    tile = Tile(pixels, width, rng)
    return _Noises(
        bend=fractal(tile, 2.4, 0.8, slope=1.2, stretch=(2.5 * longer, 1.0)),
        streaks=fractal(tile, 1.1, finest, slope=1.0, stretch=(4.0 * longer, 1.0)),
        clumps=fractal(tile, 1.1, finest, slope=0.9, stretch=(1.4 * longer, 1.0)),
    )


def _draw(body: _Body, site: Site, noises: _Noises, images: tuple[Floats, Floats]) -> None:
    """Add the foam and the smooth water of one member to the images of both."""
    pixels, crossing, axis = len(images[0]), site.land.crossing, site.land.layout.alignment
    low, high = (float(value) for value in site.field.lefts[[0, -1]])
    half = water_half(crossing)
    around = float(np.abs(body.outline).max()) + 2.0
    across = around + _SPREAD * _REACH * body.width
    upstream = around + across  # the rows of a skewed bridge are shifted along the river by less than their distance
    columns = _window(body.left - upstream, body.left + upstream + _REACH * body.width, (low, high), pixels)
    rows = _window(-body.side - across, -body.side + across, (-half, half), pixels)
    if columns.start >= columns.stop or rows.start >= rows.stop:
        return
    steps = (np.arange(pixels) + 0.5) / pixels
    left, side = np.meshgrid(low + steps[columns] * (high - low), half - 2 * half * steps[rows])
    station = crossing.center(left) - side * crossing.stretch(left)
    plan = axis.point(station.ravel(), left.ravel(), np.zeros(station.size))[:, :2] - body.middle
    ahead = (plan @ body.ahead).reshape(left.shape)
    aside = (plan @ np.array([-body.ahead[1], body.ahead[0]])).reshape(left.shape)
    texel = (high - low) / pixels
    place = (ahead.astype(np.float32), aside.astype(np.float32), (side - body.side).astype(np.float32))
    local = _Noises(*(field[rows, columns] for field in (noises.bend, noises.streaks, noises.clumps)))
    foam, smooth = _wake(body, place, local, texel)
    ends = np.minimum(left - low, high - left).astype(np.float32)
    share = np.float32(body.strength) * ramp(ends, 0.0, EDGE_FADE)
    for image, own in zip(images, (foam, smooth), strict=True):
        np.maximum(image[rows, columns], share * own, out=image[rows, columns])


def _window(first: float, last: float, ends: tuple[float, float], pixels: int) -> slice:
    """Find the texels between two places on a side of the image."""
    low, high = ends
    start, stop = (int(np.floor((at - low) / (high - low) * pixels)) for at in (first, last))
    return slice(max(start, 0), min(stop + 1, pixels))


def _wake(body: _Body, place: tuple[Floats, Floats, Floats], noises: _Noises, texel: float) -> tuple[Floats, Floats]:
    """Draw one wake: foam, and the smooth water behind the pier; both 0 to 1.

    `place` is downstream and to the left of the pier's middle in a straight frame, and to the left along the bends of
    the river [m].
    """
    ahead, aside, bent = place
    width, half = body.width, 0.5 * float(np.ptp(body.outline[:, 1]))
    behind_nose = ahead - np.float32(body.outline[:, 0].min())
    behind_tail = ahead - np.float32(body.outline[:, 0].max())
    broken = ramp(0.75 * noises.streaks + 0.65 * noises.clumps, 0.0, 1.5)

    apart, facing = _distance(body.outline, ahead, aside)
    thick = max(float(np.clip(0.20 * width, 0.28, 0.6)), 1.3 * texel) * (1 + 0.30 * noises.clumps)
    rim = facing * ramp(apart, np.maximum(thick, 0.05), 0.0) * (0.55 + 0.45 * ramp(noises.clumps, -1.2, 0.8))

    swing = bent + 0.16 * width * noises.bend * ramp(behind_nose, 0.0, 3.0 * width)
    fade = ramp(behind_nose, _REACH * width, 0.5 * width) * ramp(behind_nose, -0.1 * width, 0.4 * width)
    off = np.abs(swing) - (half + 0.10 * width + _SPREAD * np.maximum(behind_nose, 0))
    arms = fade * ramp(np.abs(off), 0.10 * width + 0.045 * np.maximum(behind_nose, 0), 0.0)

    swing = bent + 0.20 * width * noises.bend * ramp(behind_tail, 0.0, 3.0 * width)
    edge = half * (1 - 0.15 * ramp(behind_tail, 0.0, width)) + 0.06 * np.maximum(behind_tail, 0)
    after = ramp(behind_tail, -0.2 * width, 0.2 * width)
    fade = after * ramp(behind_tail, _REACH * width, 0.0)
    layers = fade * ramp(np.abs(np.abs(swing) - edge), 0.22 * width + 0.04 * np.maximum(behind_tail, 0), 0.0)
    middle = fade * ramp(np.abs(swing), edge, 0.4 * edge)
    smooth = middle * ramp(behind_tail, 0.75 * _REACH * width, 0.3 * width)

    foam = np.maximum(rim, 0.80 * arms * (0.30 + 0.70 * broken))
    foam = np.maximum(foam, (0.85 * layers + 0.30 * middle) * broken)
    return foam.astype(np.float32), (smooth * (1 - foam)).astype(np.float32)


def _distance(outline: F64, ahead: Floats, aside: Floats) -> tuple[Floats, Floats]:
    """Measure the distance to a convex outline [m], and how far its nearest side faces upstream, 0 to 1."""
    step = np.roll(outline, -1, axis=0) - outline
    normals = np.column_stack([step[:, 1], -step[:, 0]]) / np.linalg.norm(step, axis=1)[:, None]
    apart = np.full(ahead.shape, -np.inf, np.float32)
    facing = np.zeros(ahead.shape, np.float32)
    for normal, corner in zip(normals, outline, strict=True):
        own = (ahead - np.float32(corner[0])) * np.float32(normal[0])
        own = own + (aside - np.float32(corner[1])) * np.float32(normal[1])
        nearer = own > apart
        apart = np.where(nearer, own, apart)
        facing = np.where(nearer, np.float32(np.clip(0.15 - normal[0], 0.0, 1.0)), facing)
    return apart.astype(np.float32), facing.astype(np.float32)
