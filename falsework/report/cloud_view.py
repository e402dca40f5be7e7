"""Compact data of the interactive 3D view of points and cameras on a page."""

import base64
import colorsys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from falsework.report.flight import Flight, flight_data
from falsework.report.page import script_json
from falsework.report.scene_tables import unit_of
from usd_schemas.components import UNLABELED, ClassRow

if TYPE_CHECKING:
    from recon.cloud import Cloud

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

MOST_VIEWS = 8  # of a page: browsers of phones draw no more at once, and drop the first ones
SHOWN_POINTS = 40_000  # largest number of points of one cloud
SHOWN_VIEWS = 4  # largest number of images listed for a point
UNKNOWN = 255  # level of an unknown uncertainty
_LEVELS = 255  # number of levels of known ones
_FINEST, _COARSEST = 1e-3, 10.0  # [m] ends of the color scale
_GRAY = (154, 160, 166)
_MARGIN = 0.02  # margin of the initial box, as a share of its size
_STRAY = 3.0  # [extents of 98 % of the points] farther points are drawn at this distance
_GOLDEN = 0.618033988749895  # consecutive hues are far apart


@dataclass(frozen=True)
class Shown:
    """Limits of the data of a cloud on a page.

    Attributes:
        points: Largest number of points.
        views: Largest number of images listed for each point.
        whole: Start with all points in view, not with the bridge and its flight.
    """

    points: int = SHOWN_POINTS
    views: int = SHOWN_VIEWS
    whole: bool = False


@dataclass(frozen=True)
class Surfaces:
    """Triangles to draw with the points.

    Attributes:
        corners: Corner positions [m], shape (T, 3, 3), float64.
        colors: sRGB color of each triangle, shape (T, 3), uint8.
    """

    corners: F64
    colors: U8


def cloud_view(
    cloud: "Cloud", flight: Flight | None = None, shown: Shown | None = None, surfaces: Surfaces | None = None
) -> dict[str, Any]:
    """Make the data of a cloud and its cameras for the page.

    Args:
        cloud: A cloud; if all colors are black, coloring by photographs is not offered.
        flight: Poses of its images, or None.
        shown: Limits of the data.
        surfaces: Surfaces to draw with it.

    Returns:
        `classes`: rows with their number of points; the choices of coloring; `scale`: colors of the uncertainty;
        `data`: JSON that is safe in a script element.
    """
    shown = shown or Shown()
    every = max(-(-len(cloud) // shown.points), 1)
    columns = {name: cloud.columns[name][::every] for name in ("coord", "color", "segment", "instance", "uncertainty")}
    levels = uncertainty_levels(columns["uncertainty"])
    counts = np.bincount(cloud.columns["segment"], minlength=256)
    rows = [row for row in cloud.classes if counts[row.id]]
    rows += (
        [ClassRow(UNLABELED, "unlabelled", _GRAY)]
        if counts[UNLABELED] and all(row.id != UNLABELED for row in rows)
        else []
    )
    whole = _framed(columns["coord"], np.ones(len(columns["coord"])) if shown.whole else columns["segment"], flight)
    origin = np.round(np.mean(whole, axis=0))  # single precision is too coarse far from 0
    box = np.array(whole) - origin
    data = {
        "every": every,
        **_points(cloud, columns, every, origin),
        "classes": {row.id: {"name": row.name, "color": list(row.color)} for row in rows},
        "levels": [*uncertainty_scale().tolist(), list(_GRAY)],
        "ends": [_FINEST, _COARSEST],
        "flight": flight_data(flight, origin),
        "origin": origin.tolist(),
        "unit": unit_of(cloud),
        "box": box.round(3).tolist(),
        "along": _along(columns["coord"], columns["segment"]),
        "seen": _seen(cloud, every, shown.views),
        "mesh": None if surfaces is None else _mesh(surfaces, origin),
    }
    known = bool((levels != UNKNOWN).any())
    paints = ["photo"] if columns["color"].any() else []
    paints += ["class", "instance", *(["uncertainty"] if known else [])]
    return {
        "classes": [{"id": r.id, "name": r.name, "color": r.color, "points": int(counts[r.id])} for r in rows],
        "paints": paints,
        "first_paint": paints[0],
        "has_uncertainty": known,
        "has_unknown": known and bool((levels == UNKNOWN).any()),
        "scale": [tuple(color) for color in uncertainty_scale()[:: _LEVELS // 15].tolist()],
        "cameras": 0 if flight is None else len(flight.poses),
        "has_pictures": flight is not None and flight.sheet is not None,
        "has_mesh": surfaces is not None,
        "data": script_json(data),
    }


def uncertainty_levels(uncertainty: NDArray[np.float32]) -> U8:
    """Quantize uncertainties on a logarithmic scale.

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
    """Return the color of each known level, from blue to red, shape (255, 3), uint8."""
    level = np.linspace(0, 255, _LEVELS).round().astype(np.uint8)
    # One column: what OpenCV returns for an array of one dimension differs between its versions.
    return cv2.applyColorMap(level[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1].astype(np.uint8)


def instance_color(number: int) -> tuple[int, int, int]:
    """Return the color of a component, the same in every cloud of the bridge.

    Args:
        number: Component id; 0 for none.
    """
    if not number:
        return _GRAY
    red, green, blue = colorsys.hls_to_rgb(number * _GOLDEN % 1.0, (0.42, 0.55, 0.68)[number % 3], 0.65)
    return round(255 * red), round(255 * green), round(255 * blue)


def _points(cloud: "Cloud", columns: Mapping[str, NDArray[Any]], every: int, origin: F64) -> dict[str, Any]:
    """Encode the shown points."""
    places = columns["coord"] - origin
    low, step, place = _quantized(places, _box_of_most(places))
    numbers, first, instance = np.unique(columns["instance"], return_index=True, return_inverse=True)
    kinds = cloud.columns["component"][::every]
    of_numbers = [
        cloud.components[int(kinds[row])] if number else "" for number, row in zip(numbers, first, strict=True)
    ]
    return {
        "count": len(columns["coord"]),
        "low": low,
        "step": step,
        "place": place,
        "color": _packed(columns["color"]),
        "segment": _packed(columns["segment"]),
        "level": _packed(uncertainty_levels(columns["uncertainty"])),
        "instance": _packed((instance.reshape(-1) % 65536).astype("<u2")),
        "instances": [
            {"id": int(number), "kind": kind, "color": list(instance_color(int(number)))}
            for number, kind in zip(numbers[:65536], of_numbers[:65536], strict=True)
        ],
    }


def _seen(cloud: "Cloud", every: int, most: int) -> dict[str, Any] | None:
    """Encode which images saw each shown point, and at which pixel; None if no image did."""
    start, image, uv = (cloud.observations[name] for name in ("start", "image", "uv"))
    if not len(image) or not most:
        return None
    begin, views = start[:-1][::every], np.diff(start)[::every]
    taken = np.minimum(views, most)
    ends = np.cumsum(taken)
    rows = np.repeat(begin - (ends - taken), taken) + np.arange(int(taken.sum()))
    step = max(float(uv[rows].max(initial=1.0)), 1.0) / 65535
    return {
        "views": _packed(taken.astype("u1")),
        "of": _packed(np.minimum(views, 65535).astype("<u2")),
        "image": _packed(image[rows].astype("<u2")),
        "uv": _packed(np.clip(uv[rows] / step, 0, 65535).round().astype("<u2")),
        "step": step,
        "names": [str(camera["name"]) for camera in cloud.cameras],
    }


def _mesh(surfaces: Surfaces, origin: F64) -> dict[str, Any]:
    corners = surfaces.corners.reshape(-1, 3) - origin
    low, step, place = _quantized(corners, _box(corners))
    return {"low": low, "step": step, "place": place, "color": _packed(surfaces.colors)}


def _quantized(places: F64, box: tuple[F64, F64]) -> tuple[list[float], list[float], str]:
    """Quantize positions to 1/65,535 of a box: its corner, the step, and the quantized positions."""
    low, high = box
    step = np.maximum((high - low) / 65535, 1e-9)
    return low.tolist(), step.tolist(), _packed(((np.clip(places, low, high) - low) / step).round().astype("<u2"))


def _box_of_most(places: F64) -> tuple[F64, F64]:
    """Find a box that stray points do not enlarge: they are drawn at its border."""
    low, high = _box(places)
    if len(places):
        first = np.quantile(places, 0.01, axis=0, method="higher")
        last = np.quantile(places, 0.99, axis=0, method="lower")
        room = _STRAY * (last - first) + 1.0
        low, high = np.maximum(low, first - room), np.minimum(high, last + room)
    return low, high


def _framed(coord: F64, segment: NDArray[Any], flight: Flight | None) -> tuple[F64, F64]:
    """Find the initial box of the view: the bridge with its flight, without distant land."""
    bridge = coord[(segment != 0) & (segment != 255)]
    if len(bridge):
        low, high = np.percentile(bridge, [0.5, 99.5], axis=0)
    else:
        low, high = np.percentile(coord, [2, 98], axis=0) if len(coord) else (np.zeros(3), np.ones(3))
    if flight is not None and len(flight.poses):
        places = flight.poses[:, :3, 3]
        low, high = np.minimum(low, places.min(axis=0)), np.maximum(high, places.max(axis=0))
    room = _MARGIN * (high - low) + 0.2
    return low - room, high + room


def _along(coord: F64, segment: U8) -> float:
    """Find the longest direction of the bridge in plan [rad]."""
    bridge = coord[(segment != 0) & (segment != 255)][:, :2]
    if len(bridge) < 3:
        return 0.0
    _, axes = np.linalg.eigh(np.cov((bridge - bridge.mean(axis=0)).T))
    x, y = axes[:, 1] * (1.0 if axes[0, 1] >= 0.0 else -1.0)
    return round(float(np.arctan2(y, x)), 4)


def _box(coord: F64) -> tuple[F64, F64]:
    return (coord.min(axis=0), coord.max(axis=0)) if len(coord) else (np.zeros(3), np.ones(3))


def _packed(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()


def first_views(parts: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Keep the first views of a page; a part without says where to see it.

    Args:
        parts: What the template shows of each cloud.
    """
    views = [row for row, part in enumerate(parts) if part["view"]][MOST_VIEWS:]
    return [{**part, "view": None, "unseen": MOST_VIEWS} if row in views else part for row, part in enumerate(parts)]
