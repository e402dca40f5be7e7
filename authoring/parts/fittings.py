"""Fittings of a road bridge: lamp posts, scuppers with drain pipes, conduits."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.idle_settings import Use
from authoring.parts.part import FURNITURE, Part
from authoring.parts.roadway import Roadway
from authoring.parts.spans import Spans
from authoring.shapes.component import F64
from authoring.shapes.sections import circle, rectangle
from authoring.solids.copies import LOCAL, copied, frames_along
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, joined, sweep
from groundwork.settings import Settings

_EMBEDDED = 0.005  # [m] embedment of grates in asphalt, of conduits and pipes in the deck's edge
CLEAR = 1.0  # [m] least distance between a lamp post and a support
_LAMP_BASE, _LAMP_SEAT = 0.22, 0.20  # [m] side of the base plate, and from its middle to the parapet's foot
_LEAST_VERGE = 0.33  # [m] least width beside the carriageway for a lamp post
_WIDE = 9.0  # [m] width of carriageway from which on it is lit from both sides
_GRATE = (0.45, 0.15)  # [m] along and across the road
_GRATE_LEFT = 0.10  # [m] from the kerb to the middle of a grate
_LEAST_SHOULDER = 0.28  # [m] least width between curb and edge line for a grate
_CONDUIT = 0.14  # [m] from the structural deck's top down to the middle of a conduit, or more to be below the outlets
_COVER = 0.008  # [m] from the structural deck's top down to the outlets
_STUB = 0.6  # diameter of an outlet over that of its drain pipe [1]
_BESIDE = 0.006  # [m] least distance between the conduit and the drain pipes
_PIPE_OUT = 0.16  # [m] from the deck's edge to the middle of a drain pipe, or more to be outside the conduit
_PIPE_BELOW = 0.15  # [m] depth of a drain pipe's end below the girders
PIPES_AND_CONDUITS = Use(  # a rule of the families whose decks have neither
    "",
    ("beam", "girder", "slab", "arch"),
    ("fittings.pipe_diameter", "fittings.conduits", "fittings.conduit_diameter"),
)


class FittingSettings(Settings):
    """Lamp posts, drainage and conduits of a road bridge; what is left out is drawn, profile paper has none."""

    uses: ClassVar = (
        Use("lamps", (True,), ("lamp_pitch", "lamp_height", "lamp_arm")),
        Use("drainage", (True,), ("scupper_pitch", "pipe_diameter")),
        Use("conduits", (True,), ("conduit_diameter",)),
    )
    lamps: bool | None = chosen({True: 60, False: 40}, "Lamp posts", paper={False: 1})
    lamp_pitch: float | None = drawn(25.0, 35.0, "Distance between lamp posts [m]", ge=10.0, le=60.0)
    lamp_height: float | None = drawn(8.0, 10.0, "Height of the lamps above the road [m]", ge=4.0, le=14.0)
    lamp_arm: float | None = drawn(1.2, 2.0, "Length of the lamp arms towards the road [m]", ge=0.5, le=3.0)
    drainage: bool | None = chosen({True: 85, False: 15}, "Scuppers and drain pipes", paper={False: 1})
    scupper_pitch: float | None = drawn(10.0, 20.0, "Distance between scuppers along a kerb [m]", ge=4.0, le=40.0)
    pipe_diameter: float | None = drawn(0.09, 0.13, "Outside diameter of the drain pipes [m]", ge=0.06, le=0.16)
    conduits: bool | None = chosen({True: 50, False: 50}, "A conduit along the deck's right edge", paper={False: 1})
    conduit_diameter: float | None = drawn(0.06, 0.09, "Diameter of the conduit [m]", ge=0.03, le=0.10)


@dataclass(frozen=True)
class Fittings:
    """Fittings of one bridge.

    Attributes:
        lamps: Whether there are lamp posts.
        lamp_pitch: Largest distance between them [m].
        lamp_height: Above the road [m].
        lamp_arm: Reach towards the road [m].
        drainage: Whether there are scuppers and drain pipes.
        scupper_pitch: Largest distance between scuppers along a kerb [m].
        pipe_diameter: Of the drain pipes [m].
        conduits: Whether a conduit runs along the deck's right edge.
        conduit_diameter: Of that conduit [m].
    """

    lamps: bool
    lamp_pitch: float
    lamp_height: float
    lamp_arm: float
    drainage: bool
    scupper_pitch: float
    pipe_diameter: float
    conduits: bool
    conduit_diameter: float


def draw_fittings(settings: FittingSettings, draws: Draws) -> Fittings:
    """Draw the fittings.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
    """
    lamps, drainage, conduits = (draw_option(settings, key, draws) for key in ("lamps", "drainage", "conduits"))
    return Fittings(
        lamps=lamps,
        lamp_pitch=draw(settings, "lamp_pitch", draws),
        lamp_height=draw(settings, "lamp_height", draws),
        lamp_arm=draw(settings, "lamp_arm", draws),
        drainage=drainage,
        scupper_pitch=draw(settings, "scupper_pitch", draws),
        pipe_diameter=draw(settings, "pipe_diameter", draws),
        conduits=conduits,
        conduit_diameter=draw(settings, "conduit_diameter", draws),
    )


@dataclass(frozen=True)
class FittedDeck:
    """A deck with fittings.

    Attributes:
        fittings: The fittings.
        roadway: Cross-section of the road, None on a railway.
        width: Overall deck width [m].
    """

    fittings: Fittings
    roadway: Roadway | None
    width: float


def fitting_parts(
    deck: FittedDeck, spans: Spans, soffit: float | None, place: Alignment, *, clear: float = CLEAR
) -> list[Part]:
    """Build the fittings of a road bridge; a railway has none.

    Args:
        deck: The deck.
        spans: Stations of the deck's pieces and joints.
        soffit: Lowest underside of the superstructure, above the finished surface [m]; None if the deck's edges are not
            free, so that nothing may be attached there.
        place: Axis of the bridge.
        clear: Least distance between a lamp post and a support [m]: the legs of pylons extend over the deck.
    """
    fittings, roadway, width = deck.fittings, deck.roadway, deck.width
    if roadway is None:
        return []
    parts = _lamp_parts(fittings, roadway, spans, place, clear) if fittings.lamps else []
    if fittings.drainage and roadway.shoulder >= _LEAST_SHOULDER:
        parts += _scupper_parts(fittings, roadway, spans, place)
        if soffit is not None:
            parts += _pipe_parts(fittings, roadway, width, spans, soffit, place)
    if fittings.conduits and soffit is not None:
        parts += _conduit_parts(fittings, roadway, width, spans, place)
    return parts


def fitting_stations(pitch: float, spans: Spans) -> F64:
    """Space fittings evenly over every span, at most a pitch apart and away from the joints.

    Args:
        pitch: Largest distance [m].
        spans: Stations.

    Returns:
        Stations [m], rising, shape (N,), float64.
    """
    found = []
    for low, high in zip(spans.supports[:-1], spans.supports[1:], strict=True):
        count = max(1, int(np.ceil((high - low) / pitch)))
        found.append(low + (high - low) * (np.arange(count) + 0.5) / count)
    return np.concatenate(found)


def lamp_stations(pitch: float, spans: Spans, clear: float = CLEAR) -> F64:
    """Space lamp posts evenly from end to end; one too close to a support is moved away from it.

    Args:
        pitch: Largest distance [m].
        spans: Stations.
        clear: Least distance from a support [m].

    Returns:
        Stations [m], rising, shape (N,), float64.
    """
    length = spans.supports[-1] - spans.supports[0]
    count = max(1, int(np.ceil(length / pitch)))
    stations = spans.supports[0] + length * (np.arange(count) + 0.5) / count
    for support in spans.supports:
        away = stations - support
        stations = np.where(np.abs(away) < clear, support + np.where(away < 0.0, -clear, clear), stations)
    return stations


def _lamp_parts(fittings: Fittings, roadway: Roadway, spans: Spans, place: Alignment, clear: float) -> list[Part]:
    verge = roadway.half_width - roadway.kerb_face
    if verge < _LEAST_VERGE:
        return []
    base = roadway.kerb_height - (0.006 if roadway.footway_width else 0.0)
    template = _lamp(fittings.lamp_height - base, fittings.lamp_arm)
    stations = lamp_stations(fittings.lamp_pitch, spans, clear)
    size: dict[str, object] = {"height": fittings.lamp_height - base, "arm": fittings.lamp_arm}
    sides = (("L", 1.0), ("R", -1.0)) if 2.0 * roadway.kerb_face > _WIDE else (("L", 1.0),)
    return [
        Part(f"LampPost_{number:03d}_{side}", "lamp_post", "Role_RailingSteel", FURNITURE, surface, dict(size))
        for side, sign in sides
        for number, surface in enumerate(
            _copies(template, stations, sign, roadway.half_width - _LAMP_SEAT, base, place)
        )
    ]


def _copies(
    template: Surface, stations: F64, sign: float, left: float, above: float, place: Alignment
) -> list[Surface]:
    """Place a template at stations of one side; its +y points away from the axis."""
    frames = frames_along(place, stations, sign * left, above, upright=True)
    frames[:, :3, :2] *= sign
    return [copied(template, frame) for frame in frames]


def _lamp(height: float, arm: float) -> Surface:
    """A tapered column on a base plate with an arm over the road and a flat luminaire, round its foot."""
    half = 0.5 * _LAMP_BASE
    plate = Prism(rectangle((-half, -half), (half, half)), -0.02, 0.02, "above", LOCAL, 0.004).surface
    column = sweep(
        np.stack([circle(0.17, 12), circle(0.17, 12), circle(0.15, 12), circle(0.08, 12)]),
        np.array([0.015, 0.9, 0.92, height]),
        "above",
        LOCAL,
    )
    rise = 0.12 * arm
    tube = sweep(
        np.stack([circle(d, 8) + np.array([0.0, z]) for d, z in ((0.05, height - 0.06 + rise), (0.06, height - 0.06))]),
        np.array([-arm, 0.0]),
        "left",
        LOCAL,
    )
    top = height - 0.06 + rise
    head = Prism(
        rectangle((-0.14, top - 0.05), (0.14, top + 0.05)), -arm - 0.62, -arm + 0.04, "left", LOCAL, 0.02
    ).surface
    return joined([plate, column, tube, head])


def _scupper_parts(fittings: Fittings, roadway: Roadway, spans: Spans, place: Alignment) -> list[Part]:
    length, width = _GRATE
    low, high = -0.004, 0.010
    rails = [
        Prism(rectangle((-0.5 * length, y - 0.015), (0.5 * length, y + 0.015)), low, high, "above", LOCAL).surface
        for y in (-0.5 * width + 0.015, 0.5 * width - 0.015)
    ]
    half = 0.5 * width - 0.028
    bars = [
        Prism(rectangle((x - 0.013, -half), (x + 0.013, half)), low, high - 0.002, "above", LOCAL).surface
        for x in np.linspace(-0.5 * length + 0.016, 0.5 * length - 0.016, 8)
    ]
    template = joined(rails + bars)
    stations = fitting_stations(fittings.scupper_pitch, spans)
    size: dict[str, object] = {"length": length, "width": width, "embedded_in": "surfacing"}
    parts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        frames = frames_along(place, stations, sign * (roadway.kerb_face - _GRATE_LEFT), 0.0, upright=False)
        parts += [
            Part(
                f"Scupper_{n:03d}_{side}",
                "scupper",
                "Role_RailingSteel",
                FURNITURE,
                copied(template, frame),
                dict(size),
            )
            for n, frame in enumerate(frames)
        ]
    return parts


def _pipe_parts(
    fittings: Fittings, roadway: Roadway, width: float, spans: Spans, soffit: float, place: Alignment
) -> list[Part]:
    """Build pipes from the deck's edge beside each scupper, which bend down past the girders."""
    outlet, out = -roadway.surfacing - _outlet(fittings), _pipe_out(fittings)
    length = outlet - soffit + _PIPE_BELOW
    d = fittings.pipe_diameter
    stub = Prism(circle(_STUB * d, 12), -2.0 * _EMBEDDED, out, "left", LOCAL).surface
    down = Prism(circle(d, 12) + np.array([0.0, out]), -length, 0.4 * d, "above", LOCAL, 0.008).surface
    template = joined([stub, down])
    size: dict[str, object] = {"diameter": d, "length": length}
    stations = fitting_stations(fittings.scupper_pitch, spans)
    return [
        Part(f"DrainPipe_{number:03d}_{side}", "drain_pipe", "Role_RailingSteel", FURNITURE, surface, dict(size))
        for side, sign in (("L", 1.0), ("R", -1.0))
        for number, surface in enumerate(_copies(template, stations, sign, 0.5 * width, outlet, place))
    ]


def _outlet(fittings: Fittings) -> float:
    """Find the depth of the outlets' axes below the structural deck's top [m]."""
    return _COVER + 0.5 * _STUB * fittings.pipe_diameter


def _pipe_out(fittings: Fittings) -> float:
    """Find the distance from the deck's edge to the middle of a drain pipe [m]: the conduit runs inside it."""
    conduit = fittings.conduit_diameter - _EMBEDDED if fittings.conduits else 0.0
    return max(_PIPE_OUT, conduit + _BESIDE + 0.5 * fittings.pipe_diameter)


def _conduit_depth(fittings: Fittings) -> float:
    """Find the depth of the conduit's axis below the structural deck's top [m]: under the outlets, which cross it."""
    if not fittings.drainage:
        return _CONDUIT
    outlets = _outlet(fittings) + 0.5 * _STUB * fittings.pipe_diameter
    return max(_CONDUIT, outlets + _BESIDE + 0.5 * fittings.conduit_diameter)


def _conduit_parts(fittings: Fittings, roadway: Roadway, width: float, spans: Spans, place: Alignment) -> list[Part]:
    d = fittings.conduit_diameter
    middle = np.array([-0.5 * width - 0.5 * d + _EMBEDDED, -roadway.surfacing - _conduit_depth(fittings)])
    parts = []
    for number, (low, high) in enumerate(spans.pieces):
        surface = Prism(circle(d, 12) + middle, low + 0.03, high - 0.03, "station", place)
        size: dict[str, object] = {"diameter": d, "length": high - low - 0.06}
        parts.append(Part(f"Conduit_{number:03d}", "conduit", "Role_RailingSteel", FURNITURE, surface, size))
    return parts
