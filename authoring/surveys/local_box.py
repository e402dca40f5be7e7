"""The box of a local survey: a stretch of the bridge, from the ground to above its deck."""

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.box import OrientedBox, oriented_box
from authoring.surveys.settings import LocalSettings
from authoring.surveys.subject import Subject
from authoring.surveys.whole import bearing_lines
from groundwork.errors import InputError

F64 = NDArray[np.float64]

_SLICE = 2.0  # [m] length of the slices whose middles are points of the axis
_FOOT = 0.5  # [m] height of the box's bottom above the lowest ground


def draw_local_box(settings: LocalSettings, subject: Subject, rng: np.random.Generator) -> OrientedBox:
    """Draw a stretch of the bridge, more often near a support, and compute its box along the bridge's direction there.

    Source: Shi 2024, local scenario; the size of the box is unknown, the default is ours.

    Args:
        settings: Length of the box, margins, and probability of a support.
        subject: Bridge and site.
        rng: Stream `survey/<id>`.

    Raises:
        InputError: The requested box contains no part of a bridge.
    """
    whole = oriented_box(subject.bridge.reshape(-1, 3))
    centers = whole.to_local(subject.bridge.mean(axis=1))
    station = _draw_station(settings, whole, subject, rng)
    half = 0.5 * settings.length
    if not len(_within(subject.bridge, whole.axes, float(whole.center @ whole.axes[0]) + station, half)):
        raise InputError(
            "the box contains no part of the bridge",
            field="survey.station",
            value=station,
            allowed=f"{-whole.half[0]:.1f} to {whole.half[0]:.1f} m from the bridge's middle",
        )
    axes = _turned(whole, _direction(centers, station, half))
    middle = whole.to_world(np.array([[station, 0.0, 0.0]]))[0] @ axes.T
    local = _within(subject.bridge, axes, float(middle[0]), half)
    low, high = local.min(axis=0), local.max(axis=0)
    low[0], high[0] = middle[0] - half, middle[0] + half
    low[1], high[1] = low[1] - settings.beside, high[1] + settings.beside
    plan = np.array([[x, y, 0.0] for x in np.linspace(low[0], high[0], 9) for y in np.linspace(low[1], high[1], 9)])
    ground = subject.ground_height((plan @ axes)[:, :2])
    ground = ground[np.isfinite(ground)]
    low[2] = (float(ground.min()) if len(ground) else low[2]) + _FOOT
    high[2] += settings.above
    return OrientedBox(0.5 * (low + high) @ axes, axes, 0.5 * (high - low))


def _within(triangles: F64, axes: F64, middle: float, half: float) -> F64:
    """Clip the edges of triangles to a slab across the bridge; returns them in its axes [m], shape (N, 3)."""
    local = triangles @ axes.T
    first, last = local.reshape(-1, 3), np.roll(local, -1, axis=1).reshape(-1, 3)
    run = last[:, 0] - first[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (middle + np.array([[-half], [half]]) - first[:, 0]) / run
    level = np.abs(run) < 1e-12
    inside = np.abs(first[:, 0] - middle) <= half
    low = np.where(level, np.where(inside, 0.0, 2.0), np.clip(ends.min(axis=0), 0.0, None))
    high = np.where(level, 1.0, np.clip(ends.max(axis=0), None, 1.0))
    kept = low <= high
    first, last, low, high = first[kept], last[kept], low[kept, None], high[kept, None]
    return np.concatenate([first + low * (last - first), first + high * (last - first)])


def _draw_station(settings: LocalSettings, whole: OrientedBox, subject: Subject, rng: np.random.Generator) -> float:
    """Draw the middle of the box along the bridge, always with the same number of random numbers."""
    at_support, which, along = rng.random(), rng.random(), rng.random()
    if settings.station is not None:
        return settings.station
    if settings.target is not None:
        own = subject.bridge[subject.bridge_ids == settings.target].reshape(-1, 3)
        if not len(own):
            ids = np.unique(subject.bridge_ids)
            raise InputError(
                "no component of the bridge has this id",
                field="survey.target",
                value=settings.target,
                allowed=f"{len(ids)} ids from {ids[0]} to {ids[-1]}",
                hint="falsework scene info SCENE --members lists them",
            )
        return float(whole.to_local(0.5 * (own.min(axis=0) + own.max(axis=0))[None])[0, 0])
    reach = max(float(whole.half[0]) - 0.5 * settings.length, 0.0)
    if len(subject.seats) and at_support < settings.at_support:
        lines = bearing_lines(whole.to_local(subject.seats))[:, 0]
        near = lines[int(which * len(lines))] + (along - 0.5) * 0.5 * settings.length
        return round(float(np.clip(near, -whole.half[0], whole.half[0])), 3)
    return round(float((2.0 * along - 1.0) * reach), 3)


def _direction(centers: F64, station: float, half: float) -> F64:
    """Find the direction of the bridge at a station from points shortly before and behind it, shape (2,)."""
    ends = []
    for at in (station - half, station + half):
        at = float(np.clip(at, centers[:, 0].min() + _SLICE, centers[:, 0].max() - _SLICE))
        own = centers[np.abs(centers[:, 0] - at) < _SLICE]
        if len(own):
            ends.append([at, 0.5 * (own[:, 1].min() + own[:, 1].max())])
    run = np.array(ends[-1]) - np.array(ends[0]) if len(ends) == 2 else np.zeros(2)
    length = float(np.linalg.norm(run))
    return run / length if length > 0.25 * half else np.array([1.0, 0.0])


def _turned(box: OrientedBox, direction: F64) -> F64:
    along = direction[0] * box.axes[0] + direction[1] * box.axes[1]
    return np.asarray(np.round(np.stack([along, np.cross(box.axes[2], along), box.axes[2]]), 12), np.float64)
