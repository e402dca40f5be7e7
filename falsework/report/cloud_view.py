"""The cloud to turn around: what the page's script needs to paint and filter it, in as few bytes as will do."""

import base64
import colorsys
import json
from typing import Any

import cv2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from usd_schemas.components import ClassRow

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

SHOWN_POINTS = 40_000
UNKNOWN = 255  # level of an uncertainty that is not known
_LEVELS = 255  # of those that are known
_FINEST, _COARSEST = 1e-3, 10.0  # [m] ends of the colour scale
_GREY = (154, 160, 166)
_ROOM = 5.0  # [m] around what is framed
_GOLDEN = 0.618033988749895  # hues that follow each other are far apart


def cloud_view(columns: dict[str, NDArray[Any]], classes: tuple[ClassRow, ...], centres: F64) -> dict[str, Any]:
    """Describe a cloud and its cameras for the page.

    Args:
        columns: `coord` [m], shape (N, 3), `color`, shape (N, 3), uint8, `segment`, shape (N,), uint8, `instance`,
            shape (N,), and `uncertainty` [m], shape (N,), float32; NaN where it is not known.
        classes: Class table.
        centres: Camera centres [m], shape (M, 3), float64; none of a sampled cloud.

    Returns:
        `classes`, rows with their number of points, `has_uncertainty`, `has_unknown`, `scale`, colours from fine to
        coarse, and `data`: JSON that may stand in a script element.
    """
    every = -(-len(columns["coord"]) // SHOWN_POINTS)
    part = {name: values[:: max(every, 1)] for name, values in columns.items()}
    levels = uncertainty_levels(part["uncertainty"])
    counts = np.bincount(columns["segment"], minlength=256)
    rows = [row for row in classes if counts[row.id]]
    numbers, instance = np.unique(part["instance"], return_inverse=True)
    origin = np.round(np.mean(_box(part["coord"]), axis=0))  # single precision draws nothing fine far from 0
    coord, cameras = part["coord"] - origin, centres - origin
    low, high = _box(coord)
    step = np.maximum((high - low) / 65535, 1e-9)
    data = {
        "count": len(coord),
        "every": max(every, 1),
        "low": low.tolist(),
        "step": step.tolist(),
        "place": _packed(((coord - low) / step).round().astype("<u2")),
        "color": _packed(part["color"]),
        "segment": _packed(part["segment"]),
        "level": _packed(levels),
        "instance": _packed((instance.reshape(-1) % 65536).astype("<u2")),
        "classes": {row.id: list(row.color) for row in rows},
        "instances": [list(instance_color(int(number))) for number in numbers[:65536]],
        "levels": [*uncertainty_scale().tolist(), list(_GREY)],
        "ends": [_FINEST, _COARSEST],
        "cameras": cameras.round(2).tolist(),
        "ranges": _ranges(cameras if len(cameras) else coord),
    }
    return {
        "classes": [
            {"id": row.id, "name": row.name, "color": row.color, "points": int(counts[row.id])} for row in rows
        ],
        "has_uncertainty": bool((levels != UNKNOWN).any()),
        "has_unknown": bool((levels == UNKNOWN).any()),
        "scale": [tuple(color) for color in uncertainty_scale()[:: _LEVELS // 15].tolist()],
        "data": script_json(data),
    }


def uncertainty_levels(uncertainty: NDArray[np.float32]) -> U8:
    """Place uncertainties on a logarithmic scale.

    Args:
        uncertainty: Uncertainty of each point [m], shape (N,), float32.

    Returns:
        0 for 1 mm and less to 254 for 10 m and more, 255 where unknown, shape (N,), uint8.
    """
    known = ~np.isnan(uncertainty)
    log = np.log(np.clip(np.where(known, uncertainty, _COARSEST), _FINEST, _COARSEST) / _FINEST)
    level = np.round(log / np.log(_COARSEST / _FINEST) * (_LEVELS - 1))
    return np.where(known, level, UNKNOWN).astype(np.uint8)


def uncertainty_scale() -> U8:
    """Give the color of each known level, from blue to red, shape (255, 3), uint8."""
    level = np.linspace(0, 255, _LEVELS).round().astype(np.uint8)
    # One column: what OpenCV returns for an array of one dimension differs between its versions.
    return cv2.applyColorMap(level[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1].astype(np.uint8)


def instance_color(number: int) -> tuple[int, int, int]:
    """Give a component the color that it has in every cloud of the bridge.

    Args:
        number: Component id; 0 for none.
    """
    if not number:
        return _GREY
    red, green, blue = colorsys.hls_to_rgb(number * _GOLDEN % 1.0, (0.42, 0.55, 0.68)[number % 3], 0.65)
    return round(255 * red), round(255 * green), round(255 * blue)


def script_json(value: object) -> Markup:
    """Spell JSON that may stand in a script element: names from files cannot end it.

    Args:
        value: Plain lists, tables, numbers and strings.
    """
    text = json.dumps(value, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _box(coord: F64) -> tuple[F64, F64]:
    return (coord.min(axis=0), coord.max(axis=0)) if len(coord) else (np.zeros(3), np.ones(3))


def _ranges(framed: F64) -> list[list[float]]:
    """What the plot frames: the box of the cameras, since what they look at stands in it, and a little more."""
    low, high = _box(framed)
    low, high = low - _ROOM, high + _ROOM
    return [[float(low[axis]) - (3.0 if axis == 2 else 0.0), float(high[axis])] for axis in range(3)]


def _packed(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()
