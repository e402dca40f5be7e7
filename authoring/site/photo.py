"""Squares of ground near the bridge with separate images: their positions, and the charts on them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.site.covers import Soup
from authoring.site.grid import HeightField

F64 = NDArray[np.float64]

LARGEST = 81.6  # side of a square [m]: with 2048 texels, slightly less than 4 cm per texel
GUTTER = 0.4  # margin of an image beyond its square [m]
MARK = "_Photo"


@dataclass(frozen=True)
class PhotoSquare:
    """A stretch of ground with one image, in bridge coordinates.

    Attributes:
        number: Its number.
        stations: First and last station [m].
        lefts: Lowest and highest left [m].
        side: Side of the image, with the stretch in its middle [m].
    """

    number: int
    stations: tuple[float, float]
    lefts: tuple[float, float]
    side: float

    @property
    def corner(self) -> tuple[float, float]:
        """Station and left of the image's lower left corner [m]."""
        return sum(self.stations) / 2 - self.side / 2, sum(self.lefts) / 2 - self.side / 2

    def atlas(self, soup: Soup) -> F64:
        """Map triangles to the image.

        Args:
            soup: Triangles within the stretch.

        Returns:
            `st1` at each corner of each triangle [1], shape (3 * T, 2), float64.
        """
        return (soup.rows[soup.faces.reshape(-1), :2] - np.array(self.corner)) / self.side


def photo_squares(field: HeightField, half: float, ends: tuple[float, float], reach: float) -> tuple[PhotoSquare, ...]:
    """Place squares along a bridge; their borders are lines of the ground's grid.

    Args:
        field: The ground.
        half: Half the deck's width [m].
        ends: Stations of the bridge's ends [m].
        reach: Distance from the bridge that they cover [m]; less beside very wide decks.

    Returns:
        The squares, one after the other along the axis.
    """
    aside = min(half + reach, LARGEST / 2 - GUTTER)
    low, high = _lines(field.lefts, -aside, aside)
    first, last = _lines(field.stations, ends[0] - reach, ends[1] + reach)
    count = int(np.ceil((last - first) / (LARGEST - 2 * GUTTER - _widest(field.stations))))
    borders = [float(_nearest(field.stations, at)) for at in np.linspace(first, last, count + 1)]
    side = max(high - low, *np.diff(borders)) + 2 * GUTTER
    return tuple(
        PhotoSquare(number, (borders[number], borders[number + 1]), (low, high), float(side)) for number in range(count)
    )


def by_square(soup: Soup, squares: tuple[PhotoSquare, ...]) -> list[tuple[PhotoSquare | None, Soup]]:
    """Divide ground by squares.

    Args:
        soup: Triangles, none across the border of a square.
        squares: The squares.

    Returns:
        The triangles of each square that has any, and with None the others.
    """
    station, left = soup.rows[soup.faces, :2].mean(axis=1).T
    found, rest = [], np.ones(len(soup.faces), bool)
    for square in squares:
        inside = (station > square.stations[0]) & (station < square.stations[1])
        inside &= (left > square.lefts[0]) & (left < square.lefts[1])
        rest &= ~inside
        if inside.any():
            found.append((square, replace(soup, faces=soup.faces[inside])))
    return [*found, (None, replace(soup, faces=soup.faces[rest]))] if rest.any() else found


def photo_role(role: str, square: PhotoSquare) -> str:
    """Name the material of a surface on a square: that of the surface, with the square's image.

    Args:
        role: Material recipe.
        square: The square.
    """
    return f"{role}{MARK}{square.number}"


def surface_of(role: str) -> tuple[str, int | None]:
    """Split a material's name into its surface and the number of its square, None outside all.

    Args:
        role: Name of a material of a site.
    """
    surface, mark, number = role.partition(MARK)
    return surface, int(number) if mark else None


def _lines(lines: F64, low: float, high: float) -> tuple[float, float]:
    """Find the first and last line within a range."""
    within = lines[(lines >= low - 1e-6) & (lines <= high + 1e-6)]
    return float(within[0]), float(within[-1])


def _nearest(lines: F64, at: float) -> float:
    return float(lines[np.argmin(np.abs(lines - at))])


def _widest(lines: F64) -> float:
    return float(np.diff(lines).max())
