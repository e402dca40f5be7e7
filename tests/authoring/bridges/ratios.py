"""Proportions that engineers go by, each with its band and its source, measured on what was built."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from authoring.shapes.component import F64
from tests.authoring.bridges.built import Bridge

_ROUNDED = 0.02  # [1] of a band's ends that rounding to centimeters may take
_COLUMNS = frozenset(("column", "wall_pier"))


@dataclass(frozen=True)
class Ratio:
    """One proportion of one family.

    Attributes:
        name: What is divided by what, or a distance [m].
        low: Least value.
        high: Largest value.
        source: Who says so.
        measure: Finds the proportions on a bridge; none where it has no such member.
    """

    name: str
    low: float
    high: float
    source: str
    measure: Callable[[Bridge], list[float]]


def _above(bridge: Bridge, *kinds: str) -> list[F64]:
    """Bridge coordinates of all members of some kinds, heights over the road: (station, left, above) [m], (V, 3)."""
    axis, found = bridge.layout.alignment, []
    for member, place in zip(bridge.members, bridge.bridge_coordinates, strict=True):
        if member.kind in kinds:
            station, left, height = place.T
            above = height - axis.height(station) - left * axis.crossfall(station)
            found.append(np.stack([station, left, above], axis=1))
    return found


def _depths(bridge: Bridge, *kinds: str) -> list[float]:
    return [float(np.ptp(points[:, 2])) for points in _above(bridge, *kinds)]


def _spans(bridge: Bridge) -> F64:
    return np.diff(np.array(bridge.layout.supports))


def _side_share(bridge: Bridge) -> list[float]:
    spans = _spans(bridge)
    return [float(min(spans[0], spans[-1]) / spans[1:-1].max())] if len(spans) > 2 else []


def _column_slenderness(bridge: Bridge) -> list[float]:
    found = []
    for member in bridge.members:
        size = {key: member.parameters.get(key) for key in ("height", "length", "width", "diameter", "thickness")}
        sides = [value for key, value in size.items() if key != "height" and isinstance(value, int | float)]
        if member.kind in _COLUMNS and isinstance(size["height"], int | float) and sides:
            found.append(float(size["height"]) / min(sides))
    return found


def _slab(bridge: Bridge) -> list[float]:
    usual = {("road", False): 22.0, ("road", True): 25.0, ("rail", False): 15.0, ("rail", True): 17.0}
    spans = bridge.drawn.record.spans
    depth = max(_depths(bridge, "deck_slab"))
    return [float(_spans(bridge).max()) / depth / usual[bridge.layout.service, spans.continuous]]


def _lines(bridge: Bridge, *kinds: str) -> F64:
    """Middles of the lines of girders of the first span, rising [m]."""
    rows = [points for points in _above(bridge, *kinds) if points[:, 0].min() < bridge.layout.supports[0] + 1.0]
    return np.sort([0.5 * float(np.min(p[:, 1]) + np.max(p[:, 1])) for p in rows])


def _beam_depth(bridge: Bridge) -> list[float]:
    depths = _depths(bridge, "concrete_girder")
    return [float(_spans(bridge).max()) / (depths[0] - 0.010)] if depths else []


def _beam_spacing(wide: bool) -> Callable[[Bridge], list[float]]:
    def measure(bridge: Bridge) -> list[float]:
        fits = (bridge.drawn.record.girders.shape in ("u", "box")) == wide
        return np.diff(_lines(bridge, "concrete_girder")).tolist() if fits else []

    return measure


def _beam_overhang(bridge: Bridge) -> list[float]:
    lines = _lines(bridge, "concrete_girder")
    return [0.5 * bridge.layout.width - float(lines[-1])] if len(lines) else []


def _steel_depth(haunched: bool) -> Callable[[Bridge], list[float]]:
    def measure(bridge: Bridge) -> list[float]:
        if (bridge.drawn.record.steel.haunch != "none") != haunched:
            return []
        first = bridge.layout.supports[0] + 0.2  # at an abutment no haunch has begun
        ends = [p[p[:, 0] < first, 2] for p in _above(bridge, "plate_girder", "box_girder") if p[:, 0].min() < first]
        return [float(_spans(bridge).max()) / (float(np.ptp(end)) - 0.010) for end in ends]

    return measure


def _haunch(bridge: Bridge) -> list[float]:
    steel = bridge.drawn.record.steel
    if steel.haunch == "none":
        return []
    deepest = max(_depths(bridge, "plate_girder", "box_girder"))
    return [(deepest - 0.010) / steel.depth]


def _steel_spacing(bridge: Bridge) -> list[float]:
    if bridge.drawn.record.steel.arrangement != "multi":
        return []
    return np.diff(_lines(bridge, "plate_girder")).tolist()


def _box_span(bridge: Bridge) -> list[float]:
    return [float(_spans(bridge).max())] if bridge.drawn.record.steel.arrangement == "box" else []


def _arch_sizes(bridge: Bridge, *arrangements: str) -> list[F64]:
    """Ring or first rib of an arch, where its arrangement is one of these."""
    kinds = ("arch_ring", "arch_rib")
    return _above(bridge, *kinds)[:1] if bridge.drawn.record.arrangement in arrangements else []


def _arch_rise(*arrangements: str) -> Callable[[Bridge], list[float]]:
    def measure(bridge: Bridge) -> list[float]:
        found = []
        for points in _arch_sizes(bridge, *arrangements):
            record = bridge.drawn.record.arch
            axis = record.viaduct.ring.axis if hasattr(record, "viaduct") else record.rib.axis
            built = float(np.ptp(points[:, 0]))  # faces reach a little beyond the axis's ends
            assert 0.0 <= built - axis.span <= 0.15 * axis.span
            found.append(axis.span / axis.rise)
        return found

    return measure


def _arch_depth(bridge: Bridge) -> list[float]:
    if bridge.drawn.record.arrangement == "masonry":
        return []
    rib, points = bridge.drawn.record.arch.rib, _arch_sizes(bridge, bridge.drawn.record.arrangement)[0]
    crown = points[np.abs(points[:, 0] - rib.middle) < 0.03 * rib.axis.span, 2]
    assert float(np.ptp(crown)) >= 0.99 * rib.depth
    return [rib.axis.span / rib.depth]


def _arch_growth(bridge: Bridge) -> list[float]:
    if bridge.drawn.record.arrangement == "masonry":
        return []
    rib = bridge.drawn.record.arch.rib
    return [rib.springing_depth / rib.depth]


def _arch_bays(bridge: Bridge) -> list[float]:
    """Span over the distance of the spandrel columns, from the columns themselves."""
    if bridge.drawn.record.arrangement != "deck":
        return []
    stations = np.unique([round(float(p[:, 0].mean()), 2) for p in _above(bridge, "spandrel_column")])
    return [bridge.drawn.record.arch.rib.axis.span / float(np.diff(stations).max())]


def _hanger_pitch(bridge: Bridge) -> list[float]:
    stations = np.unique([round(float(p[:, 0].mean()), 2) for p in _above(bridge, "hanger")])
    return [] if len(stations) < 3 else [float(np.min(np.diff(stations)))]


def _masonry_ring(bridge: Bridge) -> list[float]:
    if bridge.drawn.record.arrangement != "masonry":
        return []
    ring = bridge.drawn.record.arch.viaduct.ring
    return [ring.axis.span / ring.depth]


def _masonry_pier(bridge: Bridge) -> list[float]:
    if bridge.drawn.record.arrangement != "masonry" or len(bridge.layout.supports) < 3:
        return []
    viaduct = bridge.drawn.record.arch.viaduct
    return [viaduct.pier / viaduct.ring.axis.span]


def _main(bridge: Bridge) -> float:
    return float(bridge.drawn.record.choice.main)


def _sag(bridge: Bridge) -> list[float]:
    """Sag over main span, between the towers, from both main cables."""
    low, high = bridge.drawn.record.cables.towers
    found = []
    for points in _above(bridge, "main_cable"):
        hung = points[(points[:, 0] >= low - 0.1) & (points[:, 0] <= high + 0.1), 2]
        if len(hung):
            found.append((float(np.ptp(hung)) - bridge.drawn.record.choice.cable) / _main(bridge))
    return found


def _side_suspension(suspended: bool) -> Callable[[Bridge], list[float]]:
    def measure(bridge: Bridge) -> list[float]:
        low, high = bridge.drawn.record.cables.towers
        fits = bridge.drawn.record.choice.suspended == suspended
        return [(low - bridge.layout.supports[0]) / (high - low)] if fits else []

    return measure


def _cable(bridge: Bridge) -> list[float]:
    return [_main(bridge) / bridge.drawn.record.choice.cable]


def _deck_depth(bridge: Bridge) -> list[float]:
    points = np.concatenate(_above(bridge, "deck_slab", "box_girder", "plate_girder", "edge_beam"))
    return [_main(bridge) / float(np.ptp(points[:, 2]))]


def _tower(bridge: Bridge) -> list[float]:
    top = max(float(points[:, 2].max()) for points in _above(bridge, "tower_leg", "tower_beam"))
    return [top / _main(bridge)]


def _pylon(pylons: int) -> Callable[[Bridge], list[float]]:
    def measure(bridge: Bridge) -> list[float]:
        if bridge.drawn.record.choice.pylons != pylons:
            return []
        legs = _above(bridge, "pylon_leg", "pylon_head", "pylon_beam")
        return [max(float(points[:, 2].max()) for points in legs) / _main(bridge)]

    return measure


def _side_stayed(pylons: int) -> Callable[[Bridge], list[float]]:
    def measure(bridge: Bridge) -> list[float]:
        choice = bridge.drawn.record.choice
        return [choice.side / choice.main] if choice.pylons == pylons else []

    return measure


def _stay_angle(bridge: Bridge) -> list[float]:
    """Slopes of the stays [deg], from their meshes."""
    found = []
    for points in _above(bridge, "stay"):
        low, high = points[np.argmin(points[:, 2])], points[np.argmax(points[:, 2])]
        found.append(float(np.degrees(np.arctan2(high[2] - low[2], np.hypot(*(high - low)[:2])))))
    return found


_PIER = Ratio(
    "pier height / least side", 0.0, 14.0, "Shi, Kim, Narazaki: piers 0.8 to 2.4 m; practice", _column_slenderness
)
RATIOS: dict[str, tuple[Ratio, ...]] = {
    "slab": (
        Ratio("span / depth over 22, 25, 15 or 17", 0.85, 1.15, "WSDOT; Network Rail", _slab),
        Ratio("end span / inner span", 0.75, 1.0, "practice", _side_share),
        _PIER,
    ),
    "beam": (
        Ratio("span / girder depth", 16.0, 22.0, "AASHTO 0.045 L, 0.040 L", _beam_depth),
        Ratio("girder spacing [m]", 1.8, 3.0, "TxDOT 2.74 m", _beam_spacing(False)),
        Ratio("U and box spacing [m]", 3.0, 5.0, "practice", _beam_spacing(True)),
        Ratio("overhang [m]", 0.6, 1.8, "TxDOT 0.91 m", _beam_overhang),
        Ratio("end span / inner span", 0.75, 1.0, "practice", _side_share),
        _PIER,
    ),
    "girder": (
        Ratio("span / steel depth", 20.0, 28.0, "AASHTO 0.033 L", _steel_depth(False)),
        Ratio("span / haunched steel depth at mid-span", 25.0, 35.0, "practice", _steel_depth(True)),
        Ratio("depth over a pier / at mid-span", 1.5, 2.0, "practice", _haunch),
        Ratio("girder spacing [m]", 2.2, 3.6, "practice", _steel_spacing),
        Ratio("span of boxes [m]", 30.0, 180.0, "Khan table 1.2", _box_span),
        Ratio("end span / inner span", 0.72, 1.0, "practice", _side_share),
        _PIER,
    ),
    "arch": (
        Ratio("span / rise, deck arch", 3.0, 8.0, "Shi, Kim, Narazaki", _arch_rise("deck")),
        Ratio("span / rise above a deck", 3.5, 5.5, "practice", _arch_rise("through", "half_through", "tied")),
        Ratio("span / rise, masonry", 2.0, 4.6, "practice", _arch_rise("masonry")),
        Ratio("span / depth at the crown", 45.0, 70.0, "Shi, Kim, Narazaki", _arch_depth),
        Ratio("depth at the springing / crown", 1.0, 1.5, "Shi, Kim, Narazaki", _arch_growth),
        Ratio("span / spandrel pitch", 7.5, 14.0, "Shi, Kim, Narazaki", _arch_bays),
        Ratio("hanger pitch [m]", 3.6, 8.8, "practice", _hanger_pitch),
        Ratio("span / ring, masonry", 17.0, 26.5, "practice", _masonry_ring),
        Ratio("pier / span, masonry", 0.155, 0.26, "practice", _masonry_pier),
        Ratio("pier height / least side", 0.0, 20.0, "practice", _column_slenderness),
    ),
    "suspension": (
        # As measured between the highest and the lowest vertex: 4 % less than the axis of a thick cable sags.
        Ratio("sag / main span", 0.96 / 12.0, 1.0 / 8.0, "Structural Steel Designer's Handbook 15", _sag),
        Ratio("side / main span, straight", 0.20, 0.34, "the same", _side_suspension(False)),
        Ratio("side / main span, suspended", 0.32, 0.50, "the same", _side_suspension(True)),
        Ratio("tower over the deck / main span", 1.0 / 12.0, 0.20, "sag, and 2 to 4 m", _tower),
        Ratio("main span / cable", 250.0, 2000.0, "practice; short bridges have thicker cables", _cable),
        Ratio("main span / depth", 30.0, 300.0, "practice; short decks as deep as buildable", _deck_depth),
        Ratio("hanger pitch [m]", 2.5, 20.0, "practice", _hanger_pitch),
        _PIER,
    ),
    "cable_stayed": (
        Ratio("side / main span, two pylons", 0.35, 0.45, "Jorquera 2016", _side_stayed(2)),
        Ratio("side / main span, one pylon", 0.65, 1.0, "practice", _side_stayed(1)),
        Ratio("pylon over the deck / main span, two", 0.20, 0.25, "practice", _pylon(2)),
        Ratio("pylon over the deck / main span, one", 0.40, 0.45, "practice", _pylon(1)),
        Ratio("main span / depth", 25.0, 250.0, "practice; short decks as deep as buildable", _deck_depth),
        Ratio("slope of stays [deg]", 20.0, 80.0, "practice", _stay_angle),
        _PIER,
    ),
}


def ratios_in_bands(bridge: Bridge) -> list[str]:
    """Every proportion lies in its band; profile `paper` keeps the proportions of its generator, whatever they are."""
    found = []
    for ratio in RATIOS[bridge.family] if bridge.profile == "default" else ():
        low, high = ratio.low * (1.0 - _ROUNDED), ratio.high * (1.0 + _ROUNDED)
        values = ratio.measure(bridge)
        bridge.note("proportions", len(values))
        for value in values:
            bridge.note("least_room_in_a_band", min(value - low, high - value) / (high - low))
        found += [
            f"{ratio.name}: {value:.3f}, not {ratio.low:.3g} to {ratio.high:.3g} ({ratio.source})"
            for value in values
            if not low <= value <= high
        ]
    return found
