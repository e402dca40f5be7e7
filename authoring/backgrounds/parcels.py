"""Fields: a patchwork of ploughed land, crops and pasture, divided by hedges."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.backgrounds.terrain import Terrain
from authoring.site.covers import Cover
from authoring.site.fields import BEHIND_FENCE

F64 = NDArray[np.float64]
NEAR = 500.0  # distance from the site beyond which fields are larger, and need no finer mesh [m]
_PAIRS = 1 << 19  # places and objects whose distances are computed at once [1]
ROADSIDE, ROW = 24.0, 68.0  # distance from the axis to a border between the first rows of fields, and their width [m]
BALK = 1.0  # half the width of the uncultivated strip between two fields [m]
CROPS = (
    Cover("ploughed", "Ploughed", "ground", "furrows"),
    Cover("crop", "Crop", "ground", "crop"),
    Cover("ripe", "RipeCrop", "ground", "ripe_crop"),
    Cover("hay", "Hay", "ground", "hay"),
)


@dataclass(frozen=True)
class Parcel:
    """A rectangular field.

    Attributes:
        center: Station and left of its middle [m].
        heading: Direction of its first side from the axis [rad].
        half: Half the lengths of its sides [m].
        crop: Name of its cover, or `` for pasture.
        side: 1 for only its part to the left of the axis, -1 for that to the right, 0 for all of it [1].
    """

    center: tuple[float, float]
    heading: float
    half: tuple[float, float]
    crop: str
    side: float = 0.0

    def inside(self, station: F64, left: F64) -> F64:
        """Compute the distance of positions to its border, inside.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.

        Returns:
            Depths within, negative outside [m], the same shape (...), float64.
        """
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        east, north = station - self.center[0], left - self.center[1]
        across, along = np.abs(east * cosine + north * sine), np.abs(north * cosine - east * sine)
        depth = np.minimum(self.half[0] - across, self.half[1] - along)
        return np.minimum(depth, self.side * left) if self.side else depth

    def outline(self, step: float) -> F64:
        """List places along its border.

        Args:
            step: Distance between places [m].

        Returns:
            Stations and lefts [m], shape (N, 2), float64.
        """
        (a, b), corners = self.half, []
        for start, stop in (((-a, -b), (a, -b)), ((a, -b), (a, b)), ((a, b), (-a, b)), ((-a, b), (-a, -b))):
            count = max(int(np.hypot(stop[0] - start[0], stop[1] - start[1]) / step), 1)
            corners.append(np.linspace(start, stop, count, endpoint=False))
        local = np.concatenate(corners)
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        line = np.asarray(self.center) + local @ np.array([[cosine, sine], [-sine, cosine]])
        return line[self.side * line[:, 1] >= 0.0]


def draw_parcels(
    terrain: Terrain, rng: np.random.Generator, reach: tuple[float, float] = (620.0, 560.0)
) -> tuple[Parcel, ...]:
    """Divide the land round a site into fields, in two blocks with different headings.

    Args:
        terrain: The terrain.
        rng: Random stream.
        reach: Extent of the blocks along the axis and to its sides [m].

    Returns:
        Fields that do not overlap; roads, river and site may lie on them, but not on crops (`crop_fields`).
    """
    parcels: list[Parcel] = []
    middle = (terrain.inner[0] + terrain.inner[1]) / 2
    for side in (-1.0, 1.0):
        heading = rng.uniform(-0.22, 0.22)
        # The rows are turned from the axis; the first ones begin beyond it, so that no wedge beside it stays empty.
        depth = side * (ROADSIDE - ROW * np.ceil((ROADSIDE + reach[0] * np.tan(abs(heading))) / ROW))
        while abs(depth) < reach[1]:
            farther = 1.0 + max(abs(depth) - NEAR, 0.0) / NEAR
            width = ROW if side * depth <= ROADSIDE else farther * rng.uniform(70.0, 130.0)
            at = -reach[0]
            while at < reach[0]:
                length = rng.uniform(80.0, 190.0) * max(farther, abs(at) / NEAR)
                crop = ("ploughed", "crop", "crop", "ripe", "ripe", "hay", "")[rng.integers(0, 7)]
                local = np.array([at + length / 2, depth + side * width / 2])
                turned = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]) @ local
                half = (length / 2 - BALK, width / 2 - BALK)
                parcel = Parcel((float(turned[0] + middle), float(turned[1])), heading, half, crop, side)
                if len(parcel.outline(length)):  # none of it is left where all corners are across the axis
                    parcels.append(parcel)
                at += length
            depth += side * width
    return tuple(parcels)


def uncropped(parcels: tuple[Parcel, ...], taken: F64) -> tuple[Parcel, ...]:
    """Turn fields with buildings on them into pasture.

    Args:
        parcels: The fields.
        taken: Station, left and radius of each building [m], shape (K, 3), float64.

    Returns:
        The fields, some without their crop.
    """
    kept = []
    for parcel in parcels:
        built = (parcel.inside(taken[:, 0], taken[:, 1]) > -taken[:, 2]).any()
        kept.append(replace(parcel, crop="") if built else parcel)
    return tuple(kept)


def crop_fields(terrain: Terrain, parcels: tuple[Parcel, ...]) -> tuple[tuple[Cover, F64], ...]:
    """Evaluate the extents of crops, for cutting the terrain.

    Args:
        terrain: The terrain.
        parcels: The fields.

    Returns:
        Each cover with its signed field at the terrain's nodes [m], shape (S, L).
    """
    station, left = terrain.nodes()
    free = open_land(terrain, station, left)
    covers = []
    for cover in CROPS:
        best = np.full(station.shape, -30.0)
        for parcel in parcels:
            if parcel.crop == cover.name:
                best = np.maximum(best, parcel.inside(station, left))
        covers.append((cover, np.minimum(best, free)))
    return tuple(covers)


def clear_of(axis: Alignment, places: F64, taken: F64, gap: float) -> NDArray[np.bool_]:
    """Find which places keep a distance from existing objects; distances are measured in world coordinates.

    Args:
        axis: Axis of the bridge.
        places: Stations and lefts [m], shape (N, 2), float64.
        taken: Station, left and radius of existing objects [m], shape (K, 3), float64.
        gap: Distance to keep beyond the radius [m].

    Returns:
        Whether they do, shape (N,), bool.
    """
    plan, stand = (axis.point(rows[:, 0], rows[:, 1], np.zeros(len(rows)))[:, :2] for rows in (places, taken))
    far = taken[:, 2] + gap
    free = np.ones(len(places), bool)
    step = max(1, _PAIRS // max(1, len(taken)))
    for start in range(0, len(places), step):
        some = plan[start : start + step, None]
        away = np.hypot(some[..., 0] - stand[:, 0], some[..., 1] - stand[:, 1])
        free[start : start + step] = (away > far).all(axis=1)
    return free


def open_land(terrain: Terrain, station: F64, left: F64) -> F64:
    """Measure the distance to site, river and roads, minus a margin.

    Args:
        terrain: The terrain.
        station: Distance along the axis [m], shape (...), float64.
        left: Distance to the left of the axis [m], the same shape (...), float64.

    Returns:
        Distances, negative on them [m], the same shape (...), float64.
    """
    land = terrain.land
    free = np.minimum(np.minimum(terrain.beyond(station, left), terrain.clear(station, left)) - 9.0, 60.0)
    free = np.minimum(free, land.crossing.distance(station, left) - land.crossing.half_width - 13.0)
    for approach, fences in zip(land.approaches, land.fences, strict=True):
        beside = left - approach.center(station)
        aside = np.abs(beside) - approach.half_width - 15.0
        aside = np.minimum(aside, np.abs(beside) - np.where(beside > 0.0, *fences) - BEHIND_FENCE)
        free = np.minimum(free, np.where(approach.along(station) > -20.0, aside, 60.0))
    return free
