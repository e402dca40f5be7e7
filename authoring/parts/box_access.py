"""Access to the box of a cable-supported deck, and its attachments: hatches in its soffit, services."""

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.box_decks import CableDeck
from authoring.parts.part import FURNITURE, Part
from authoring.parts.spans import Levels
from authoring.shapes.sections import circle, cut_corners, rectangle
from authoring.solids.extrusion import Prism, extruded
from authoring.solids.sweep import joined

_HATCH = (0.90, 0.70)  # [m] along and across: wide enough for a stretcher
_FROM_END = 5.0  # [m] from the deck's ends to a hatch: in front of the abutment's seat, above a ladder
_INTO, _BELOW = 0.004, 0.030  # [m] embedment of the frame in the soffit, and height below it
_COVER, _DEEPER = 0.06, 0.012  # [m] clearance of the cover in its frame, and depth below it
_PIPE, _HUNG = 0.16, 0.09  # [m] diameter of the services' pipe, and depth of its top below the cantilever
_LEAST = 0.75  # [m] least cantilever for services
_STRAP, _STRAP_PITCH = 0.05, 4.0  # [m] width of the straps that hold the pipe, and between them
_END = 0.6  # [m] distance of services from the deck's ends


def box_access_parts(deck: CableDeck, low: float, high: float, levels: Levels, place: Alignment) -> list[Part]:
    """Build hatches and services of a box; none for decks without a box, or without details of their edges.

    Args:
        deck: Cross-section.
        low: Station of the deck's first end [m].
        high: Station of its last end [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    if not deck.chamfered or deck.kind not in ("concrete_box", "steel_box"):
        return []
    parts = [_hatch_part(f"Hatch_{n}", s, levels, place) for n, s in enumerate((low + _FROM_END, high - _FROM_END))]
    if deck.cantilever >= _LEAST:
        left = 0.5 * deck.width - deck.cantilever + 0.32
        parts += [_service_part(f"Service_{side}", sign * left, low, high, levels, place) for side, sign in _SIDES]
    return parts


_SIDES = (("L", 1.0), ("R", -1.0))


def _hatch_part(name: str, station: float, levels: Levels, place: Alignment) -> Part:
    half, soffit = 0.5 * np.array(_HATCH), levels.girder_soffit
    frame = cut_corners(
        rectangle((-half[1], soffit - _BELOW), (half[1], soffit + _INTO)), np.array([0.01, 0.01, 0.0, 0.0])
    )
    cover = rectangle((-half[1] + _COVER, soffit - _BELOW - _DEEPER), (half[1] - _COVER, soffit - _BELOW + _INTO))
    solids = [
        Prism(frame, station - half[0], station + half[0], "station", place),
        Prism(cover, station - half[0] + _COVER, station + half[0] - _COVER, "station", place),
    ]
    size: dict[str, object] = {"length": _HATCH[0], "width": _HATCH[1]}
    return Part(name, "access_hatch", "Role_RailingSteel", FURNITURE, joined(extruded(solids)), size)


def _service_part(name: str, left: float, low: float, high: float, levels: Levels, place: Alignment) -> Part:
    middle = np.array([left, levels.soffit - _HUNG - 0.5 * _PIPE])
    begin, end = low + _END, high - _END
    solids = [Prism(circle(_PIPE, 16) + middle, begin, end, "station", place)]
    strap = rectangle((left - 0.03, middle[1]), (left + 0.03, levels.soffit + _INTO))
    count = int(np.ceil((end - begin) / _STRAP_PITCH))
    solids += [
        Prism(strap, float(s) - 0.5 * _STRAP, float(s) + 0.5 * _STRAP, "station", place)
        for s in begin + (np.arange(count) + 0.5) * (end - begin) / count
    ]
    size: dict[str, object] = {"diameter": _PIPE, "length": end - begin}
    return Part(name, "conduit", "Role_RailingSteel", FURNITURE, joined(extruded(solids)), size)
