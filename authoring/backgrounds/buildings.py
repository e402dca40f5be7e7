"""Houses and barns with gabled roofs: walls, roof, window panes, and trim, each a component."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.solids import Frame, box, gabled_walls, roof_slab
from authoring.shapes.component import Mesh
from authoring.site.ways import merged

F64 = NDArray[np.float64]
STOREY = 2.8


@dataclass(frozen=True)
class House:
    """A building with a gabled roof, its ridge along its length.

    Attributes:
        station: Station of its middle [m].
        left: Distance of its middle to the left of the axis [m].
        heading: Direction of its ridge from the axis [rad].
        floor: World height of its floor [m].
        foot: World height of its walls' foot [m].
        length: Along the ridge [m].
        width: Across [m].
        storeys: Full storeys below the eaves.
        pitch: Slope of the roof [1].
        wall: Material recipe of its walls.
        barn: It has large doors and few windows.
    """

    station: float
    left: float
    heading: float
    floor: float
    foot: float
    length: float
    width: float
    storeys: int
    pitch: float
    wall: str
    barn: bool

    @property
    def eaves(self) -> float:
        """Height of the eaves above the floor [m]."""
        return self.storeys * STOREY + (1.6 if self.barn else 0.3)


def draw_house(barn: bool, rng: np.random.Generator) -> House:
    """Draw a building; it stands on the origin until it gets a place.

    Args:
        barn: It is a barn.
        rng: Random stream.

    Returns:
        The building.
    """
    length, width = (
        (rng.uniform(14.0, 20.0), rng.uniform(9.0, 11.5)) if barn else (rng.uniform(9.0, 14.0), rng.uniform(7.0, 9.0))
    )
    storeys = 1 if barn else int(rng.integers(1, 3))
    wall = (
        ("painted_metal", "brick")[rng.integers(0, 2)] if barn else ("plaster", "plaster", "brick")[rng.integers(0, 3)]
    )
    pitch = float(rng.uniform(0.4, 0.55) if barn else rng.uniform(0.65, 1.0))
    return House(0.0, 0.0, 0.0, 0.0, 0.0, float(length), float(width), storeys, pitch, wall, barn)


def house_pieces(house: House, rng: np.random.Generator) -> list[tuple[str, str, str, Mesh]]:
    """Build a building in bridge coordinates.

    Args:
        house: The building.
        rng: Random stream.

    Returns:
        Name, component kind, material recipe and mesh of each piece.
    """
    frame = Frame(house.station, house.left, house.floor, house.heading)
    half, side = house.length / 2, house.width / 2
    ridge = house.eaves + side * house.pitch
    walls = gabled_walls(frame, (half, side), (house.foot - house.floor, house.eaves, ridge))
    overhang = (0.35, 0.55)
    roof = roof_slab(
        frame, (half + overhang[0], side + overhang[1]), house.eaves - overhang[1] * house.pitch, ridge, 0.22
    )
    panes, trim = _openings(house, frame, rng)
    pieces = [("Walls", "building", house.wall, walls), ("Roof", "roof", "roof_tile", roof)]
    pieces.append(("Windows", "window", "window", merged(panes)))
    pieces.append(("Trim", "building", "painted_metal" if house.barn else "concrete", merged(trim)))
    if not house.barn:
        at = rng.uniform(-0.6, 0.6) * half
        low, high = ridge - 1.1, ridge + 0.9
        chimney = box(frame, (at, rng.choice((-0.5, 0.5)), (low + high) / 2), (0.36, 0.28, (high - low) / 2))
        pieces.append(("Chimney", "building", "brick", chimney))
    return pieces


def _openings(house: House, frame: Frame, rng: np.random.Generator) -> tuple[list[Mesh], list[Mesh]]:
    """Set windows into all four walls, and a door into the front."""
    panes: list[Mesh] = []
    trim: list[Mesh] = []

    def window(wall: _Wall, along: float, height: float, size: tuple[float, float]) -> None:
        glass, surround = _window(wall, along, height, size)
        panes.extend(glass)
        trim.extend(surround)

    half, side = house.length / 2, house.width / 2
    pitch = rng.uniform(2.3, 3.0) * (2.2 if house.barn else 1.0)
    count, ends = max(int((house.length - 1.6) / pitch), 1), max(int((house.width - 1.6) / pitch), 1)
    door = int(rng.integers(0, count))
    for storey in range(house.storeys):
        sill = storey * STOREY + (1.9 if house.barn else 0.95)
        for face, number, reach in ((0, count, side), (2, count, side), (1, ends, half), (3, ends, half)):
            at = (np.arange(number) - (number - 1) / 2) * pitch
            wall = _Wall(frame, face, reach)
            for column, along in enumerate(at):
                if face == 0 and storey == 0 and column == door:
                    tall, wide = (3.4, 1.8) if house.barn else (2.1, 0.52)
                    trim.append(wall.on(along, tall / 2 - 0.05, (wide, tall / 2 + 0.05), 0.05))
                    continue
                size = (0.9, 0.35) if house.barn else (0.5, 0.68)
                window(wall, along, sill + size[1], size)
    if not house.barn:
        for face in (1, 3):
            window(_Wall(frame, face, half), 0.0, house.eaves + 0.9, (0.4, 0.5))
    return panes, trim


@dataclass(frozen=True)
class _Wall:
    """One wall of a building, `reach` from its middle [m]; faces: 0 front, 1 right gable, 2 back, 3 left gable."""

    frame: Frame
    face: int
    reach: float

    def on(self, along: float, height: float, size: tuple[float, float], proud: float) -> Mesh:
        """Put a box half into the wall."""
        thick = proud + 0.05
        out = self.reach + proud - thick / 2
        wide, tall = size
        if self.face in (0, 2):
            sign = -1.0 if self.face == 0 else 1.0
            return box(self.frame, (along, sign * out, height), (wide, thick / 2, tall))
        sign = 1.0 if self.face == 1 else -1.0
        return box(self.frame, (sign * out, along, height), (thick / 2, wide, tall))


def _window(wall: _Wall, along: float, height: float, size: tuple[float, float]) -> tuple[list[Mesh], list[Mesh]]:
    """Build a window of two panes, and its surround and sill, on a wall."""
    wide, tall = size
    surround = wall.on(along, height, (wide + 0.09, tall + 0.09), 0.03)
    sill = wall.on(along, height - tall - 0.12, (wide + 0.16, 0.05), 0.14)
    pane = (wide / 2 - 0.03, tall - 0.03)
    return [wall.on(along + side * wide, height, pane, 0.05) for side in (-0.5, 0.5)], [surround, sill]
