"""Choice of a place for a bridge in an imported world: random, with almost no buildings to remove."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.imported.model import CityModel
from authoring.site.covers import to_world
from authoring.site.site import Site
from groundwork.errors import InputError

F64 = NDArray[np.float64]

CELL = 0.5  # [m] of the map of built land
BESIDE = 5.0  # [m] beside the deck that belong to the bridge's own area
MOST_BUILT = 0.02  # share of that area that buildings may cover [1]
TRIES = 4000
AROUND = 130.0  # [m] beyond the site, where the building density must be about that of the whole world
_FAIR = 1.2  # least ratio of the density there to that of the world [1]
_MARGIN = 20.0  # [m] around the map


@dataclass(frozen=True, eq=False)
class BuiltMap:
    """Built-up land.

    Attributes:
        corner: Plan position of the first cell's corner [m], shape (2,), float64.
        built: Whether a cell lies under a building, rows along y, shape (H, W), bool.
    """

    corner: F64
    built: NDArray[np.bool_]

    def at(self, xy: F64) -> NDArray[np.bool_]:
        """Find which positions are built up; outside the map, none is.

        Args:
            xy: Plan positions in the world's own coordinates [m], shape (..., 2), float64.

        Returns:
            Whether a building covers them, shape (...), bool.
        """
        cell = np.floor((xy - self.corner) / CELL).astype(np.int64)
        column, row = np.moveaxis(cell, -1, 0)
        inside = (column >= 0) & (row >= 0) & (column < self.built.shape[1]) & (row < self.built.shape[0])
        return inside & self.built[np.where(inside, row, 0), np.where(inside, column, 0)]


@dataclass(frozen=True)
class CityPlace:
    """A place in an imported world.

    Attributes:
        center: Position under the middle of the bridge, in the world's own coordinates [m].
        yaw: Direction there of the scene's x axis, counter-clockwise [rad].
        middle: The middle of the bridge in the scene [m].
        built: Share of the bridge's own area that buildings cover [1].
    """

    center: tuple[float, float]
    yaw: float
    middle: tuple[float, float]
    built: float

    def to_city(self, xy: F64) -> F64:
        """Convert positions of the scene to the world.

        Args:
            xy: Plan positions in the scene [m], shape (..., 2), float64.

        Returns:
            Plan positions in the world's own coordinates [m], shape (..., 2), float64.
        """
        return (xy - np.asarray(self.middle)) @ _turn(self.yaw).T + np.asarray(self.center)

    def to_scene(self, xy: F64) -> F64:
        """Convert positions of the world to the scene.

        Args:
            xy: Plan positions in the world's own coordinates [m], shape (..., 2), float64.

        Returns:
            Plan positions in the scene [m], shape (..., 2), float64.
        """
        return (xy - np.asarray(self.center)) @ _turn(self.yaw) + np.asarray(self.middle)


def built_map(model: CityModel) -> BuiltMap:
    """Rasterize the map of built land.

    Args:
        model: The world.
    """
    import cv2

    low, high = model.extent + np.array([[-_MARGIN], [_MARGIN]])
    width, height = np.ceil((high - low) / CELL).astype(int)
    built = np.zeros((height, width), np.uint8)
    plan = (model.built[:, :, :2] - low) / CELL - 0.5
    for triangle in np.round(16.0 * plan).astype(np.int32):
        cv2.fillConvexPoly(built, triangle, 1, shift=4)
    return BuiltMap(low, built.astype(bool))


def choose_place(model: CityModel, site: Site, rng: np.random.Generator) -> CityPlace:
    """Choose a random place and direction: the bridge's own area almost free, its surroundings built up.

    Source: Shi 2024 puts its bridges at random places of imported cities; the rule itself is unknown, this one is ours.

    Args:
        model: The world.
        site: The site to be placed; all of it must lie in the world.
        rng: Random stream `background`.

    Returns:
        The first place that meets both conditions; if there is none, the freest one with the densest surroundings.

    Raises:
        InputError: No place was found.
    """
    corridor, around, outline = _corridor(site), _surroundings(site), site.extent
    middle = corridor.mean(axis=0)
    built, (low, high) = built_map(model), model.extent
    fair = _FAIR * float(built.built.mean())
    best, found = 1.0, None
    for x, y, turn in rng.random((TRIES, 3)):
        center = low + (x, y) * (high - low)
        place = CityPlace((float(center[0]), float(center[1])), float(2.0 * np.pi * turn), _pair(middle), 0.0)
        edge = place.to_city(outline)
        if (edge < low).any() or (edge > high).any():
            continue
        share = float(built.at(place.to_city(corridor)).mean())
        best = min(best, share)
        if share <= MOST_BUILT:
            density = float(built.at(place.to_city(around)).mean())
            if found is None or density > found[0]:
                found = density, replace(place, built=share)
            if density >= fair:
                break
    if found is not None:
        return found[1]
    raise InputError(
        f"no place for this bridge: buildings cover {100.0 * best:.0f} % of the best of {TRIES} places tried",
        field="background.name",
        value=model.attribution.get("source", ""),
        allowed=f"up to {100.0 * MOST_BUILT:g} %",
        hint="Choose a shorter bridge, a smaller site, or a larger world",
    )


def _corridor(site: Site) -> F64:
    """Distribute points over the deck and its close surroundings, about every meter [m], shape (N, 2), float64."""
    layout = site.land.layout
    stations = np.arange(layout.supports[0] - BESIDE, layout.supports[-1] + BESIDE, 1.0)
    half = 0.5 * layout.width + BESIDE
    s, left = np.meshgrid(stations, np.linspace(-half, half, int(2 * half)), indexing="ij")
    return to_world(layout.alignment, np.column_stack([s.ravel(), left.ravel(), np.zeros(s.size)]))[:, :2]


def _surroundings(site: Site) -> F64:
    """Distribute points over the surroundings of a site [m], shape (N, 2), float64."""
    low, high = site.extent.min(axis=0) - AROUND, site.extent.max(axis=0) + AROUND
    x, y = (grid.ravel() for grid in np.meshgrid(*(np.arange(low[k], high[k], 5.0) for k in (0, 1))))
    spots = np.column_stack([x, y])
    return spots[~site.keep_out[0].contains(np.column_stack([spots, np.full(len(spots), site.keep_out[0].center[2])]))]


def _turn(angle: float) -> F64:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def _pair(values: F64) -> tuple[float, float]:
    return float(values[0]), float(values[1])
