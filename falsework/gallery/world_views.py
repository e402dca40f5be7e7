"""Viewpoints of a background's contact sheet: from eye height, under the deck, beside a pier, from the air."""

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Layout
from authoring.site.site import Site
from usd_schemas.pinhole import look_at

F64 = NDArray[np.float64]

VIEWS = ("eye height", "under the deck", "5 m from a pier", "air")

_EYE = 1.7  # [m] over ground or water
_TO_PIER = 5.0  # [m]
_SIDES = (26.0, -26.0, 38.0, -38.0, 18.0, -18.0, 55.0, -55.0)  # [m] left of the axis, candidate standpoints
_ALONG = (0.35, 0.65, 0.5, 0.2, 0.8, 0.05, 0.95)  # share of the bridge


def world_views(layout: Layout, site: Site) -> F64:
    """Place the four cameras of `VIEWS`.

    Args:
        layout: The bridge.
        site: Its site.

    Returns:
        camera_to_world [m], shape (4, 4, 4), float64.
    """
    return np.stack(
        [_from_aside(layout, site), _from_below(layout, site), _by_a_pier(layout, site), _from_above(layout)]
    )


def _from_aside(layout: Layout, site: Site) -> F64:
    """Place a camera on dry land beside the bridge, or on the water in front of its middle if there is none."""
    first, last = layout.supports[0], layout.supports[-1]
    places = [(first + share * (last - first), side) for side in _SIDES for share in _ALONG]
    dry = [place for place in places if not _wet(site, *place)]
    station, left = (dry or places)[0]
    target = _point(layout, 0.5 * (station + 0.5 * (first + last)), 0.0, -0.5 * layout.depth)
    return look_at(_standing(layout, site, station, left), target)


def _from_below(layout: Layout, site: Site) -> F64:
    """Place a camera under the deck where there is most room, looking along it."""
    spans = list(zip(layout.supports[:-1], layout.supports[1:], strict=True))
    places = [start + share * (end - start) for start, end in spans for share in (0.3, 0.5, 0.7)]
    room = [_room(layout, site, place) - 3.0 * _wet(site, place, 0.0) for place in places]
    station = places[int(np.argmax(room))]
    middle = 0.5 * (layout.supports[0] + layout.supports[-1])
    ahead = 1.0 if station <= middle else -1.0
    eye = _standing(layout, site, station, 0.2 * layout.width)
    return look_at(eye, _point(layout, station + ahead * 14.0, -0.1 * layout.width, -layout.depth - 0.2))


def _by_a_pier(layout: Layout, site: Site) -> F64:
    """Place a camera 5 m from the middle pier, or from the abutment of a single span, looking at it."""
    inner = layout.supports[1:-1]
    support = inner[len(inner) // 2] if inner else layout.supports[0]
    back = -1.0 if inner else 1.0
    aside = 0.5 * layout.width
    eye = _standing(layout, site, support + back * 0.8 * _TO_PIER, aside + 0.6 * _TO_PIER)
    target = _point(layout, support, 0.5 * aside, 0.0)
    target[2] = min(eye[2] + 2.0, target[2] - layout.depth)
    return look_at(eye, target)


def _from_above(layout: Layout) -> F64:
    """Place a camera beside and above the bridge at the distance at which it fills the picture."""
    first, last = layout.supports[0], layout.supports[-1]
    length = last - first
    middle = _point(layout, 0.5 * (first + last), 0.0, 0.0)
    eye = _point(layout, 0.5 * (first + last) - 0.35 * length - 20.0, -0.7 * length - 30.0, 0.22 * length + 18.0)
    return look_at(eye, middle)


def _point(layout: Layout, station: float, left: float, above: float) -> F64:
    return layout.alignment.point(np.array([station]), np.array([left]), np.array([above]))[0]


def _standing(layout: Layout, site: Site, station: float, left: float) -> F64:
    eye = _point(layout, station, left, 0.0)
    eye[2] = max(float(site.ground(eye[None, :2])[0]), _water(site)) + _EYE
    return eye


def _room(layout: Layout, site: Site, station: float) -> float:
    below = _standing(layout, site, station, 0.0)[2]
    return float(_point(layout, station, 0.0, -layout.depth)[2] - below)


def _wet(site: Site, station: float, left: float) -> bool:
    place = site.land.layout.alignment.point(np.array([station]), np.array([left]), np.zeros(1))
    return float(site.ground(place[:, :2])[0]) < _water(site) + 0.1


def _water(site: Site) -> float:
    crossing = site.land.crossing
    return crossing.level if crossing.depth > 0 else -np.inf
