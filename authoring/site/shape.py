"""The shape of the ground: natural relief, the cutting of the crossing, and the fills of the approach roads."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment, Layout
from authoring.axis.road_section import ABUTMENT_BACK, UNDERLAY
from authoring.site.fields import ASIDE, BEHIND_FENCE, CLEAR, TOE, VERGE, Plots
from authoring.site.relief import Relief, smooth_minimum, smoothstep
from authoring.site.valley import Valley

F64 = NDArray[np.float64]
Hills = Callable[[F64, F64], F64]

WING_WALL = 6.0  # length of the wing walls behind that face, along the axis [m]
ABUTMENT_FRONT = 0.6  # from the bearing line forward to the natural ground at the abutment's foot [m]
FILL_SLOPE = 1.75  # horizontal meters for each meter of height of a fill
CUT_SLOPE = 1.5
BANK_SLOPE = 2.0
RAIL_UNDERLAY = 0.75  # depth of the ground below the top of the crossing railway's rails [m]
_BANK_TOP = 1.2  # height up to which a river's banks have a constant slope [m]
SHOULDER = 1.2  # level strip beside a carriageway [m]
WALL_STEP = (0.05, 0.35)  # distances from a wall's face between which the ground drops, hidden in the wall [m]
STEEP = 0.2  # slope from which on land is not tilled, mown or paved [1]
_ROOM = 25.0  # distance to the border of a plot for a slope that is less steep by 1 [m]
_STEP = 3.0  # half the length over which steepness is measured [m]
MAX_APPROACH_GRADE = 0.045
BEND_LENGTH = 260.0  # length over which an approach road's swing turns by one radian [m]


@dataclass(frozen=True)
class Crossing:
    """The obstacle under the bridge: a curved line across the axis.

    Attributes:
        kind: `river`, `road` or `rail`.
        station: Where it meets the axis [m].
        swing: Largest sideways swing of its center line [m].
        wavelength: Length over which the swing turns by one radian [m].
        phase: Phase of the swing on the axis [rad].
        half_width: Half the water surface, the carriageway or the ballast [m].
        level: Height of the water surface, of the carriageway's crown or of the rails' top on the axis [m].
        depth: Depth of the water; 0 on land [m].
        axis: Axis of the bridge, whose skew and curvature lengthen cuts along it; None for straight without skew.
        piers: Numbers of the supports that stand in the water.
    """

    kind: str
    station: float
    swing: float
    wavelength: float
    phase: float
    half_width: float
    level: float
    depth: float
    axis: Alignment | None = None
    piers: tuple[int, ...] = ()

    def center(self, left: F64) -> F64:
        """Find the station of its center line.

        Args:
            left: Distance to the left of the axis [m], shape (...), float64.

        Returns:
            Stations [m], the same shape (...), float64.
        """
        return self.station + self.swing * (np.sin(left / self.wavelength + self.phase) - np.sin(self.phase))

    def distance(self, station: F64, left: F64) -> F64:
        """Compute the distance of positions from its center line, perpendicular to it.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.

        Returns:
            Distances [m], the same shape (...), float64.
        """
        return np.abs(station - self.center(left)) / self.stretch(left)

    def stretch(self, left: F64) -> F64:
        """Compute the ratio of a cut through it along the axis to its width.

        Args:
            left: Distance to the left of the axis [m], shape (...), float64.

        Returns:
            Lengths for each meter of width [1], the same shape (...), float64.
        """
        slope = self.swing / self.wavelength * np.cos(left / self.wavelength + self.phase)
        if self.axis is None or self.axis.square:
            return np.sqrt(1.0 + slope * slope)
        return _stretch(self.axis, self.center(left), left, (slope, np.ones_like(left)))


@dataclass(frozen=True)
class Approach:
    """The road from one end of the bridge into the land.

    Attributes:
        back: Station of the abutment's back face [m].
        sign: -1 before the first abutment, +1 behind the last.
        straight: Length on which it continues the bridge's axis [m].
        bend: Sideways swing beyond that, positive to the left [m].
        foot: Height of the road above the hills at its lowest [m].
        half_width: Half the asphalt surface [m].
        axis: Axis of the bridge; None for straight without skew.
    """

    back: float
    sign: int
    straight: float
    bend: float
    foot: float
    half_width: float
    axis: Alignment | None = None

    def along(self, station: F64) -> F64:
        """Measure the distance behind the back face, negative towards the bridge.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Distances [m], the same shape (...), float64.
        """
        return self.sign * (station - self.back)

    def center(self, station: F64) -> F64:
        """Find the distance of its center line to the left.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Distances to the left of the axis [m], the same shape (...), float64.
        """
        beyond = np.maximum(self.along(station) - self.straight, 0.0)
        return self.bend * (1.0 - np.cos(beyond / BEND_LENGTH))

    def stretch(self, station: F64) -> F64:
        """Compute the ratio of a cut through it perpendicular to the axis to its width.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Lengths for each meter of width [1], the same shape (...), float64.
        """
        beyond = np.maximum(self.along(station) - self.straight, 0.0)
        slope = self.bend / BEND_LENGTH * np.sin(beyond / BEND_LENGTH)
        if self.axis is None or self.axis.square:
            return np.sqrt(1.0 + slope * slope)
        slope = self.sign * slope
        return _stretch(self.axis, station, self.center(station), (np.ones_like(slope), slope))

    def level(self, layout: Layout, hills: Hills, station: F64) -> F64:
        """Find the height of the road's crown.

        Args:
            layout: The bridge; at its abutments the road continues its deck.
            hills: Large-scale height of the land [m], the same shape.
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            World heights [m], the same shape (...), float64.
        """
        along = np.maximum(self.along(station), 0.0)
        deck = layout.alignment.height(station)
        land = self.foot + hills(station, self.center(station))
        drop = abs(float(layout.alignment.height(np.array(self.back))) - self.foot)
        share = smoothstep(0.0, max(1.5 * drop / MAX_APPROACH_GRADE, 60.0), along - 4.0)
        return deck + share * (land - deck)


def _stretch(axis: Alignment, station: F64, left: F64, course: tuple[F64, F64]) -> F64:
    """Compute the ratio of a cut along one coordinate to a cut perpendicular to a line."""
    by_station, by_left = axis.slopes(station, left)
    ahead = course[0][..., None] * by_station + course[1][..., None] * by_left
    area = by_station[..., 0] * by_left[..., 1] - by_station[..., 1] * by_left[..., 0]
    return np.hypot(ahead[..., 0], ahead[..., 1]) / area


def verge_fall(across: F64, half_road: float) -> F64:
    """Compute the drop of the verge beside a road's edge.

    Args:
        across: Distance from the center line [m], shape (...), float64.
        half_road: Half the road's width [m].

    Returns:
        Drops [m], the same shape (...), float64.
    """
    return 0.12 * np.clip(across - half_road, 0.0, SHOULDER)


def crossfall(along: F64, across: F64) -> F64:
    """Compute the drop of an approach road's surface below its crown; 0 where it meets the deck.

    Args:
        along: Distance behind the abutment's back face [m], shape (...), float64.
        across: Distance from the center line [m], the same shape (...), float64.

    Returns:
        Drop [m], the same shape (...), float64.
    """
    return 0.02 * np.abs(across) * smoothstep(0.0, 12.0, along)


@dataclass(frozen=True)
class Shape:
    """Ground heights and the fields of ground cover: each is positive inside its cover.

    Attributes:
        height: World heights [m], shape (...), float64.
        covers: Signed fields [m], roughly distances, of the same shape (...), float64.
    """

    height: F64
    covers: dict[str, F64]


@dataclass(frozen=True)
class Land:
    """Everything that shapes the ground, in bridge coordinates; also beyond the site's edge.

    Attributes:
        layout: The bridge.
        crossing: River or road under it.
        approaches: The roads before the first and behind the last abutment.
        relief: Natural relief about height 0.
        ragged: Noise that makes natural borders irregular [m].
        patches: Positive where taller grass grows [m].
        valley: Rise of the land towards the abutments of a high bridge, or None.
        plots: Use of the site's land; None beyond it.
        fences: From the center line of either approach to the fences to its left and right, 0 for none [m].
    """

    layout: Layout
    crossing: Crossing
    approaches: tuple[Approach, Approach]
    relief: Relief
    ragged: Relief
    patches: Relief
    valley: Valley | None = None
    plots: Plots | None = None
    fences: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))

    def shape(self, station: F64, left: F64, hills: Hills) -> Shape:
        """Compute the ground.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.
            hills: Large-scale height of the land [m], the same shape, 0 on the site.

        Returns:
            Heights and covers.
        """
        height, covers = self._ground(station, left, hills)
        if self.plots is not None:
            covers |= self._used(self.plots, station, left, height, hills)
        return Shape(height, covers)

    def steepness(self, station: F64, left: F64, hills: Hills) -> F64:
        """Measure the slope of the ground over 6 m in both directions.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.
            hills: Large-scale height of the land [m], the same shape, 0 on the site.

        Returns:
            Rise for each meter [1], the same shape (...), float64.
        """
        rises = [
            self._ground(station + ahead, left + aside, hills)[0]
            - self._ground(station - ahead, left - aside, hills)[0]
            for ahead, aside in ((_STEP, 0.0), (0.0, _STEP))
        ]
        return np.hypot(*rises) / (2.0 * _STEP)

    def _ground(self, station: F64, left: F64, hills: Hills) -> tuple[F64, dict[str, F64]]:
        """Compute heights, and the covers of what is built or grows by itself."""
        noise = self.ragged(station, left)
        natural = self.relief(station, left) + hills(station, left)
        if self.valley is not None:
            natural = natural + self.valley(station, self.crossing.center(left) - self.crossing.station)
        carve = self._river if self.crossing.kind == "river" else self._cutting
        height, covers = carve(station, left, natural, hills, noise)
        covers["patch"] = np.clip(self.patches(station, left) - 0.6, -6.0, 6.0)
        covers["worn"] = self._under_deck(station, left) + 0.5 * noise
        for approach in self.approaches:
            height = self._approach(approach, station, left, height, hills, covers)
        return height, covers

    def plot_room(self, station: F64, left: F64, hills: Hills) -> F64:
        """Measure the distance to what bounds plots: ways, fills, the deck, steep ground and the site's border.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.
            hills: Large-scale height of the land [m], the same shape, 0 on the site.

        Returns:
            Distances, negative where there is no plot [m], the same shape (...), float64.
        """
        assert self.plots is not None
        return self._room(self.plots, station, left, self._ground(station, left, hills)[0], hills)

    def _room(self, plots: Plots, station: F64, left: F64, height: F64, hills: Hills) -> F64:
        room = self.crossing.distance(station, left) - self.crossing.half_width
        room = room - plots.aside - plots.bend(left, np.where(station > self.crossing.center(left), ASIDE, -ASIDE))
        room = np.minimum(room, plots.within(station, left))
        room = np.minimum(room, np.abs(left) - self.layout.width / 2 - CLEAR - plots.shift(station, left))
        room = np.minimum(room, (STEEP - self.steepness(station, left, hills)) * _ROOM)
        for approach, fences in zip(self.approaches, self.fences, strict=True):
            along, center = approach.along(station), approach.center(station)
            across = np.abs(left - center) / approach.stretch(station)
            crown = approach.level(self.layout, hills, approach.back + approach.sign * np.maximum(along, 0.0))
            aside = np.hypot(np.maximum(across - self.layout.width / 2, 0.0), np.maximum(-along, 0.0))
            room = np.minimum(room, aside - FILL_SLOPE * np.abs(crown - height) - TOE)
            room = np.minimum(room, np.where(along > -10.0, across - approach.half_width - VERGE, 9.0))
            beyond = np.abs(left - center) - np.where(left > center, *fences) - BEHIND_FENCE
            room = np.minimum(room, np.where(along > WING_WALL, beyond, 9.0))
        return room

    def _used(self, plots: Plots, station: F64, left: F64, height: F64, hills: Hills) -> dict[str, F64]:
        """Place plots between roads and rivers, beside the toes of embankments, where the ground is not steep."""
        room = np.minimum(self._room(plots, station, left, height, hills), plots.split_room(station, left))
        return plots.fields(station > self.crossing.center(left), station, left, room)

    def _under_deck(self, station: F64, left: F64) -> F64:
        first, last = self.layout.supports[0], self.layout.supports[-1]
        inside = np.minimum(station - first + 1.0, last - station + 1.0)
        return np.minimum(inside, self.layout.width / 2 - 1.0 - np.abs(left))

    def _river(self, station: F64, left: F64, natural: F64, hills: Hills, noise: F64) -> tuple[F64, dict[str, F64]]:
        """Cut the channel; its banks rise at 1:2 from the bed."""
        crossing = self.crossing
        distance = crossing.distance(station, left)
        bed = crossing.level - crossing.depth
        foot = crossing.half_width - crossing.depth * BANK_SLOPE
        channel = bed + np.maximum(distance - foot, 0.0) / BANK_SLOPE + 0.12 * noise
        if self.valley is not None:  # above its banks, a river does not cut a valley's side
            channel = channel + np.maximum(channel - _BANK_TOP, 0.0) * BANK_SLOPE
        height = smooth_minimum(natural, channel, 0.6)
        shore = crossing.half_width + 0.55 + 0.6 * noise - distance
        bank = crossing.half_width + 1.9 + 1.1 * noise - distance
        return height, {"shore": shore, "bank": bank}

    def _cutting(self, station: F64, left: F64, natural: F64, hills: Hills, noise: F64) -> tuple[F64, dict[str, F64]]:
        """Level the ground under the crossing road and its shoulders, and batter it up or down to the land."""
        crossing = self.crossing
        distance = crossing.distance(station, left)
        formation = crossing.half_width + SHOULDER
        underlay = RAIL_UNDERLAY if crossing.kind == "rail" else UNDERLAY
        level = crossing.level + hills(crossing.center(left), left) - underlay
        level = level - 0.02 * np.minimum(distance, formation)
        outside = np.maximum(distance - formation, 0.0)
        height = np.clip(natural, level - outside / FILL_SLOPE, level + outside / CUT_SLOPE)
        return height, {"verge": formation + 0.15 * noise - distance}

    def _approach(
        self, approach: Approach, station: F64, left: F64, natural: F64, hills: Hills, covers: dict[str, F64]
    ) -> F64:
        """Fill up to the road behind the wing walls, and round their ends in a quarter cone."""
        along, across = approach.along(station), np.abs(left - approach.center(station)) / approach.stretch(station)
        crest, axis = self.layout.width / 2, self.layout.alignment
        beside = np.clip(left - approach.center(station), -crest, crest)
        walled = _ramp(along + sum(WALL_STEP), WALL_STEP) * _ramp(crest - across, WALL_STEP)
        behind = approach.back + approach.sign * np.maximum(along, WING_WALL)
        formation = approach.level(self.layout, hills, station) - self.layout.underlay
        formation = formation - crossfall(along, np.minimum(across, crest))
        formation = formation - verge_fall(across, approach.half_width) + beside * axis.crossfall(station)
        crown = approach.level(self.layout, hills, behind) - self.layout.underlay - 0.02 * crest
        crown = crown - verge_fall(np.full_like(across, crest), approach.half_width) + beside * axis.crossfall(behind)
        outside = np.maximum(across - crest, 0.0)
        reach = WING_WALL + ABUTMENT_BACK + ABUTMENT_FRONT
        rise = np.maximum(crown - natural, 0.1)
        ahead = np.maximum(WING_WALL - along, 0.0) / reach * rise
        cone = crown - np.hypot(ahead, outside / FILL_SLOPE)
        road = np.clip(natural, formation - outside / FILL_SLOPE, formation + outside / CUT_SLOPE)
        spill = np.maximum(natural, cone)
        retained = spill + walled * (formation - spill)
        height = np.where(along >= WING_WALL, road, retained)
        fill = (height - natural - 0.12) * FILL_SLOPE
        covers["embankment"] = np.maximum(covers.get("embankment", np.full_like(fill, -9.0)), np.clip(fill, -9.0, 9.0))
        verge = np.minimum(approach.half_width + SHOULDER - across, along - 0.2)
        covers["shoulder"] = np.maximum(covers.get("shoulder", np.full_like(fill, -9.0)), np.clip(verge, -9.0, 9.0))
        return height


def _ramp(value: F64, step: tuple[float, float]) -> F64:
    return np.clip((value - step[0]) / (step[1] - step[0]), 0.0, 1.0)
