"""The axis of a bridge: position of a station in space, and the directions left and up there."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from authoring.axis.plan_curve import Element, PlanCurve
from authoring.axis.road_section import UNDERLAY, RoadSection
from authoring.axis.track_section import TrackSection

F64 = NDArray[np.float64]

NEAR, FAR = 24.0, 60.0  # [m] from the axis: `left` is along the supports up to NEAR, normal to the chord beyond FAR
SAG = 0.005  # [m] between a curve and its chords where a sweep follows the axis
RAMP_STEP = 0.0015  # [1] of crossfall from ring to ring: twisted faces of a 25 m wide deck deviate by less than 1 cm
_WIDE = 12.0  # [m] distance from the axis up to which the sag is kept
_ROUNDS, _HALVINGS = 60, 30
_RESIDUAL = 1e-10  # [m]


@dataclass(frozen=True)
class VerticalCurve:
    """A parabola in the profile between two stations.

    Attributes:
        begin: Station where it begins [m].
        end: Station where it ends [m].
        radius: Radius of curvature [m]; positive for a crest, negative for a sag.
    """

    begin: float
    end: float
    radius: float


@dataclass(frozen=True)
class Alignment:
    """Bridge coordinates: station along the axis, left of it, above the finished surface on it.

    Stations count from the first abutment's bearing line. A line of constant station is straight and lies along the
    supports up to `NEAR` from the axis; farther out its direction turns to the chord's normal, so that the mapping does
    not fold.

    Attributes:
        level: Height of the finished deck surface on the axis at station 0 [m].
        grade: Rise per meter of station [1].
        heading: Direction of the axis, or of its chord, in plan, counter-clockwise from +x [rad].
        plan: Elements of the axis between the abutments, straight on beyond them; empty for a straight axis.
        skew: Angle of the supports, clockwise from the perpendicular to the axis [rad].
        crest: Parabola in the profile, or None.
        falls: Station [m] and rise to the left [1] where the crossfall changes its rate; empty for none.
        origin: World position of station 0 [m].
    """

    level: float
    grade: float = 0.0
    heading: float = 0.0
    plan: tuple[Element, ...] = ()
    skew: float = 0.0
    crest: VerticalCurve | None = None
    falls: tuple[tuple[float, float], ...] = ()
    origin: tuple[float, float] = (0.0, 0.0)

    @property
    def square(self) -> bool:
        """Whether the axis is straight in plan and the supports are perpendicular to it."""
        return not self.plan and self.skew == 0.0

    @property
    def affine(self) -> bool:
        """Whether parallel lines stay parallel: no curve in plan or profile, one crossfall, no skew."""
        return self.square and self.crest is None and len(self.falls) <= 1

    @property
    def fall(self) -> float:
        """Rise to the left [1] of a road with one crossfall everywhere."""
        return self.falls[0][1] if self.falls else 0.0

    @cached_property
    def curve(self) -> PlanCurve | None:
        """The axis in plan if it is not straight."""
        return PlanCurve(self.plan, self.heading) if self.plan else None

    def point(self, station: F64, left: F64, above: F64) -> F64:
        """Find world positions from bridge coordinates.

        Args:
            station: Distance along the axis in plan [m], shape (N,), float64, or any that broadcasts with the others.
            left: Distance to the left of the axis [m], shape (N,), float64.
            above: Height above the finished deck surface on the axis [m], shape (N,), float64; where the road is
                superelevated, everything rises with the crossfall, and webs stay vertical.

        Returns:
            World positions [m], shape (N, 3), float64.
        """
        x, y = self._plan_position(station, left)
        height = self.height(station) + above
        height = height + left * self.crossfall(station) if self.falls else height
        points = np.empty((*np.broadcast_shapes(np.shape(x), np.shape(height)), 3))
        points[..., 0], points[..., 1], points[..., 2] = x, y, height
        return points

    def locate(self, points: F64) -> tuple[F64, F64]:
        """Find the station and the distance to the left of world positions.

        Args:
            points: World positions [m], shape (N, 2) or (N, 3), float64.

        Returns:
            Stations [m], shape (N,), and distances to the left [m], shape (N,), float64.
        """
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        x, y = points[..., 0] - self.origin[0], points[..., 1] - self.origin[1]
        station, left = x * cosine + y * sine, y * cosine - x * sine
        if self.curve is not None:
            return self._located(points[..., :2], station, left)
        return (station - np.tan(self.skew) * _near_part(left) if self.skew else station), left

    def height(self, station: F64) -> F64:
        """Find the height of the finished surface on the axis.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Heights [m], the same shape (...), float64.
        """
        line = self.level + self.grade * station
        if self.crest is None:
            return line
        length = self.crest.end - self.crest.begin
        inside = np.clip(station - self.crest.begin, 0.0, length)
        beyond = np.maximum(station - self.crest.end, 0.0)
        return line - (0.5 * inside * inside + length * beyond) / self.crest.radius

    def grade_at(self, station: F64) -> F64:
        """Find the rise of the axis per meter.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Rise for each meter [1], the same shape (...), float64.
        """
        if self.crest is None:
            return np.full(np.shape(station), self.grade)
        inside = np.clip(station - self.crest.begin, 0.0, self.crest.end - self.crest.begin)
        return self.grade - inside / self.crest.radius

    def crossfall(self, station: F64) -> F64:
        """Find the rise of the road per meter to the left.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Rise for each meter [1], the same shape (...), float64.
        """
        if not self.falls:
            return np.zeros(np.shape(station))
        return np.interp(station, *np.array(self.falls).T)

    def heading_at(self, station: F64) -> F64:
        """Find the direction of the axis, counter-clockwise from +x.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Headings [rad], the same shape (...), float64.
        """
        if self.curve is None:
            return np.full(np.shape(station), self.heading)
        return self.curve.headings(np.asarray(station, np.float64))

    def slopes(self, station: F64, left: F64) -> tuple[F64, F64]:
        """Compute the derivatives of world positions in plan by bridge coordinates.

        Args:
            station: Distance along the axis [m], shape (N,), float64.
            left: Distance to the left of the axis [m], shape (N,), float64.

        Returns:
            Change of the position for each meter of station and for each meter to the left [1], shapes (N, 2), float64.
        """
        heading = self.heading_at(station)
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        aside = _quarter(ahead)
        lean = np.tan(self.skew)
        share = skew_blend(left)[..., None]
        normal = np.array([-np.sin(self.heading), np.cos(self.heading)])
        by_left = share * (aside + lean * ahead) + (1.0 - share) * normal
        if self.curve is None:
            return ahead, by_left
        bend = (self.curve.curvatures(station) * _near_part(left))[..., None]
        return ahead + bend * (lean * aside - ahead), by_left

    def steps(self, low: float, high: float) -> F64:
        """List the rings that a sweep along the axis needs between two stations, so that chords stay within `SAG`.

        Every sweep takes its rings from the same list, so that neighboring parts meet.

        Args:
            low: Station where it begins [m].
            high: Station where it ends [m].

        Returns:
            Stations, rising [m], shape (K,), float64; none where axis, profile and crossfall are straight.
        """
        return self._rings[(self._rings > low) & (self._rings < high)]

    def frame_at(self, station: float, left: float = 0.0, *, turn: float = 0.0, tilted: bool = False) -> "Alignment":
        """Compute a straight, right-angled frame around one place: objects there keep their right angles.

        Station and left of the place, and heights above it, are the same in the frame as here.

        Args:
            station: Station of the place [m].
            left: Distance of the place to the left of the axis [m].
            turn: Rotation of the frame from the axis there, counter-clockwise [rad]; `-skew` follows the supports.
            tilted: Keep the grade and the crossfall of the place; else the frame is level.
        """
        height, grade, fall, ahead = self._standing(station)
        level = height + (0.0 if tilted else left * fall)
        frame = Alignment(level - (grade * station if tilted else 0.0), grade if tilted else 0.0, self.heading)
        if tilted and fall:
            frame = replace(frame, falls=((station, fall),))
        if self.square and turn == 0.0:
            return replace(frame, origin=self.origin)
        x, y = (float(value[0]) for value in self._plan_position(np.array([station]), np.array([left])))
        heading = ahead + turn
        cosine, sine = float(np.cos(heading)), float(np.sin(heading))
        origin = (x - station * cosine + left * sine, y - station * sine - left * cosine)
        return replace(frame, heading=heading, origin=origin)

    def straight_at(self, station: float) -> "Alignment":
        """Compute a straight frame without grade along the support line at a station; crossfall and skew stay.

        On the support line itself positions are the same as here, so that what is built in the frame meets the girders.

        Args:
            station: Station of the support [m].
        """
        frame = self.frame_at(station)
        fall = self._standing(station)[2]
        return replace(frame, skew=self.skew, falls=((station, fall),) if fall else ())

    @cached_property
    def _standing(self) -> Callable[[float], tuple[float, float, float, float]]:
        """Height, grade, crossfall and heading on the axis at a station; the last results are cached."""
        return lru_cache(maxsize=64)(self._upright_at)

    def _upright_at(self, station: float) -> tuple[float, float, float, float]:
        at = np.array([station])
        height, grade, fall, heading = (
            float(measure(at)[0]) for measure in (self.height, self.grade_at, self.crossfall, self.heading_at)
        )
        return height, grade, fall, heading

    @cached_property
    def _rings(self) -> F64:
        """Stations that sweeps need, rising [m], shape (K,), float64."""
        knots = [] if self.curve is None else self.curve.knots.tolist()
        knots += [] if self.crest is None else [self.crest.begin, self.crest.end]
        turns = [station for station, _ in self.falls] if len(self.falls) > 1 else []  # a single one applies everywhere
        knots = np.unique(np.round([*knots, *turns], 6))
        rings = [knots]
        for low, high in pairwise(knots):
            middle = np.array([low + 1e-6, 0.5 * (low + high), high - 1e-6])
            bend = 0.0 if self.curve is None else float(np.abs(self.curve.curvatures(middle)).max())
            bend *= 1.0 + _WIDE * bend
            if self.crest is not None and self.crest.begin <= middle[1] <= self.crest.end:
                bend = max(bend, 1.0 / abs(self.crest.radius))
            ramp = float(np.ptp(self.crossfall(middle)))
            count = max(int(np.ceil((high - low) * np.sqrt(bend / (8.0 * SAG)))), int(np.ceil(ramp / RAMP_STEP)), 1)
            rings.append(np.linspace(low, high, count + 1)[1:-1])
        return np.sort(np.concatenate(rings))

    def _plan_position(self, station: F64, left: F64) -> tuple[F64, F64]:
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        x0, y0 = self.origin
        if self.curve is None:
            along = station + np.tan(self.skew) * _near_part(left) if self.skew else station
            x, y = along * cosine - left * sine, along * sine + left * cosine
            return (x + x0, y + y0) if x0 or y0 else (x, y)
        station = np.asarray(station, np.float64)
        axis, ahead = (rows.reshape(*station.shape, 2) for rows in self.curve.frames(station.ravel()))
        near = _near_part(left)
        by_skew = near * np.tan(self.skew)
        x = axis[..., 0] + by_skew * ahead[..., 0] - near * ahead[..., 1] - (left - near) * sine
        y = axis[..., 1] + by_skew * ahead[..., 1] + near * ahead[..., 0] + (left - near) * cosine
        return x + x0, y + y0

    def _located(self, points: F64, station: F64, left: F64) -> tuple[F64, F64]:
        """Solve for bridge coordinates by Newton's method; each step is halved until it reduces the error.

        The map has no fold, so that the iteration cannot end before the solution.
        """
        shape, goal = station.shape, points.reshape(-1, 2)
        place = np.stack([station.ravel(), left.ravel()], axis=1)
        open_rows = np.arange(len(place))
        for _ in range(_ROUNDS):
            miss = self._miss(place[open_rows], goal[open_rows])
            error = np.hypot(*miss.T)
            open_rows, miss, error = open_rows[error > _RESIDUAL], miss[error > _RESIDUAL], error[error > _RESIDUAL]
            if len(open_rows) == 0:
                break
            by_station, by_left = self.slopes(*place[open_rows].T)
            area = by_station[:, 0] * by_left[:, 1] - by_station[:, 1] * by_left[:, 0]
            step = np.stack(
                [
                    (miss[:, 1] * by_left[:, 0] - miss[:, 0] * by_left[:, 1]) / area,
                    (miss[:, 0] * by_station[:, 1] - miss[:, 1] * by_station[:, 0]) / area,
                ],
                axis=1,
            )
            share = np.ones(len(open_rows))
            for _ in range(_HALVINGS):
                tried = self._miss(place[open_rows] + share[:, None] * step, goal[open_rows])
                far = np.hypot(*tried.T) > (1.0 - 0.2 * share) * error + 1e-13
                if not far.any():
                    break
                share[far] *= 0.5
            place[open_rows] += share[:, None] * step
        return place[:, 0].reshape(shape), place[:, 1].reshape(shape)

    def _miss(self, place: F64, goal: F64) -> F64:
        return np.stack(self._plan_position(place[:, 0], place[:, 1]), axis=1) - goal


def skew_blend(left: F64) -> F64:
    """Find the degree to which lines of constant station follow the supports: 1 near the axis, 0 beyond `FAR`.

    Args:
        left: Distance to the left of the axis [m], shape (N,), float64.

    Returns:
        Shares [1], shape (N,), float64.
    """
    share = np.clip((np.abs(left) - NEAR) / (FAR - NEAR), 0.0, 1.0)
    return 1.0 - share * share * (3.0 - 2.0 * share)


def _near_part(left: F64) -> F64:
    """Integrate `skew_blend` from the axis [m], same shape as `left`, float64."""
    size = np.abs(left)
    if np.all(size <= NEAR):
        return left
    share = np.clip((size - NEAR) / (FAR - NEAR), 0.0, 1.0)
    inner = np.minimum(size, FAR) - (FAR - NEAR) * share * share * share * (1.0 - 0.5 * share)
    return np.copysign(inner, left)


def _quarter(ahead: F64) -> F64:
    return np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)


@dataclass(frozen=True)
class Layout:
    """Data about a bridge that the site needs before the bridge is built.

    Attributes:
        alignment: Axis of the bridge and its approaches.
        supports: Stations of the bearing lines, abutments first and last [m].
        width: Overall deck width [m].
        depth: From the finished deck surface down to the bearing seats [m].
        service: `road` or `rail`.
        carriageway: Width of the asphalt from kerb to kerb [m]; 0 when not known.
        edge_line: From the axis to the middle of the road's edge lines [m]; 0 when not known.
        underlay: From the finished surface, or from the rails' top, down to the ground under the approaches [m].
        track: Cross-section of a railway, None for a road.
        road: Part of a road's cross-section that the approaches continue; None for a railway, or with their own one.
        feet: Springings of arches on a valley's sides: station and height of the land there [m].
        river_piers: Whether some of its piers may stand in a river.
        anchorages: From the abutments' back faces to the rears of anchor blocks beside the approaches [m]; 0 without.
        wings: Length of the wing walls behind the abutments' back faces [m]; 0 when not known.
        blocks: Rectangles of the ground beside the deck that parts cover: lowest and highest station and left [m].
        soffit: From the finished surface down to the lowest underside, of arches at mid-span [m]; 0: that of `depth`.
    """

    alignment: Alignment
    supports: tuple[float, ...]
    width: float
    depth: float
    service: str = "road"
    carriageway: float = 0.0
    edge_line: float = 0.0
    underlay: float = UNDERLAY
    track: TrackSection | None = None
    road: RoadSection | None = None
    feet: tuple[tuple[float, float], ...] = ()
    river_piers: bool = False
    anchorages: float = 0.0
    wings: float = 0.0
    blocks: tuple[tuple[float, float, float, float], ...] = ()
    soffit: float = 0.0
