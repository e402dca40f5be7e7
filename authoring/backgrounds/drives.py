"""Drives from roads to buildings that stand beside them, with a paved place at each building."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.byways import (
    HIGHEST,
    UNDER,
    Byway,
    ground,
    laid,
    located,
    nearest_edge,
    paved,
    resampled,
    road_distance,
)
from authoring.backgrounds.plots import Plots, overlap, rectangles
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh
from authoring.site.ways import merged

F64 = NDArray[np.float64]
B = NDArray[np.bool_]
GroundPiece = tuple[str, str, str, str, Mesh]

HALF = 1.4  # half the width of a drive [m]
LONGEST, SHORTEST = 75.0, 2.5  # of drives [m]
NEAR = 330.0  # distance from the site up to which buildings have one [m]
TRIED = 3  # roads that are tried for each building
SPOT = 1.5  # radius of a circle over a paved place [m]
BESIDE = 0.6  # between a drive and a wall [m]
STEEPEST = 0.30  # largest grade [1]


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive.

    Attributes:
        path: Ends of its middle line, from the road's edge on, in plan [m], shape (2, 2), float64.
        height: Height of that edge [m].
        place: World position [m] and direction [rad] of a frame, and the lowest and highest x and y [m] of the paved
            place at the building in it.
    """

    path: F64
    height: float
    place: tuple[tuple[float, float, float], tuple[float, float, float, float]]

    def row(self) -> F64:
        """Return middle [m], turn [rad] and half sizes [m] of the drive, without its first meter, shape (5,)."""
        along = self.path[1] - self.path[0]
        length = float(np.hypot(*along))
        middle = self.path[0] + (0.5 + 0.5 / length) * along
        return np.array([*middle, np.arctan2(along[1], along[0]), 0.5 * (length - 1.0), HALF])


def draw_drives(
    terrain: Terrain, byways: list[Byway], plots: Plots, wanted: B, barred: list[Byway]
) -> tuple[tuple[Drive, ...], B]:
    """Lead a drive from one of the nearest roads to the side of each building near the site.

    Args:
        terrain: The terrain.
        byways: Roads, lanes and streets; drives leave their level edges.
        plots: The buildings.
        wanted: Which of them get a drive, shape (N,), bool.
        barred: Terraces, which no drive crosses.

    Returns:
        Drives that cross no building, road or other drive and are not too steep; which buildings may stand, shape (N,),
        bool: all but those near the site that should have a drive but get none.
    """
    away = terrain.beyond(plots.places[:, 0], plots.places[:, 1])
    order = [number for number in np.argsort(away, kind="stable") if wanted[number] and away[number] < NEAR]
    if not order or not byways:
        return (), np.ones(len(wanted), bool)
    standing = np.ones(len(wanted), bool)
    rows = np.array(rectangles(terrain, plots))
    nearest = [nearest_edge([byway], rows[:, :2]) for byway in byways]
    drives: list[Drive] = []
    for number in order:
        taken = np.concatenate([np.delete(rows, number, axis=0), *(drive.row()[None] for drive in drives)])
        near = sorted(range(len(byways)), key=lambda which: nearest[which][1][number])[:TRIED]
        for which, side in ((which, side) for which in near for side in (1.0, -1.0)):
            drive = _beside([byways[which]], rows[number], nearest[which][0][number], side)
            if drive is not None and _fits(terrain, [*byways, *barred], drive, taken):
                drives.append(drive)
                break
        else:
            standing[number] = False
    return tuple(drives), standing


def drive_pieces(terrain: Terrain, drives: tuple[Drive, ...], rng: np.random.Generator) -> list[GroundPiece]:
    """Lay drives and the paved places at their ends.

    Args:
        terrain: The terrain.
        drives: The drives.
        rng: Random stream.

    Returns:
        Name, component kind, material recipe, group and mesh of each.
    """
    pieces: list[GroundPiece] = []
    for number, drive in enumerate(drives):
        start, stop = drive.path
        ahead = (stop - start) / np.hypot(*(stop - start))
        path = resampled(np.stack([start - UNDER * ahead, stop]))
        mesh, _ = laid(terrain, path, HALF, drive.height - 0.03, 0.8)
        role = str(rng.choice(("gravel", "asphalt", "pavement")))
        pieces.append((f"Drive_{number:03d}", "ground", role, "Yards", merged([mesh, paved(terrain, *drive.place)])))
    return pieces


def drive_circles(terrain: Terrain, drives: tuple[Drive, ...]) -> F64:
    """Cover drives and the paved places at their ends with circles, for what is placed after them.

    Args:
        terrain: The terrain.
        drives: The drives.

    Returns:
        Station, left and radius of each circle [m], shape (K, 3), float64.
    """
    if not drives:
        return np.zeros((0, 3))
    rows = [np.zeros((0, 3))]
    for drive in drives:
        path = resampled(drive.path, 2.0)
        (x, y, turn), (first, last, low, high) = drive.place
        across = np.linspace(first, last, int((last - first) / SPOT) + 2)
        grid = np.stack(np.meshgrid(across, np.linspace(low, high, int((high - low) / SPOT) + 2)), axis=-1)
        cosine, sine = np.cos(turn), np.sin(turn)
        spots = np.array([x, y]) + grid.reshape(-1, 2) @ np.array([[cosine, sine], [-sine, cosine]])
        rows.append(np.column_stack([path, np.full(len(path), HALF + 0.7)]))
        rows.append(np.column_stack([spots, np.full(len(spots), SPOT)]))
    circles = np.concatenate(rows)
    return np.column_stack([*located(terrain, circles[:, :2]), circles[:, 2]])


def drive_gates(terrain: Terrain, drives: tuple[Drive, ...]) -> F64:
    """List where drives leave their roads: station and left [m], shape (N, 2), float64."""
    joints = np.array([drive.path[0] for drive in drives]).reshape(-1, 2)
    return np.column_stack(located(terrain, joints))


def _beside(byways: list[Byway], row: F64, edge: F64, side: float) -> Drive | None:
    """Draw a drive along one side of a building: from the road's edge to beside its middle."""
    out = edge[3:]
    across = np.array([out[1], -out[0]])
    offset = row[:2] - edge[:2]
    turn = row[2] - np.arctan2(across[1], across[0])
    wide = row[3] * abs(np.cos(turn)) + row[4] * abs(np.sin(turn))
    deep = row[3] * abs(np.sin(turn)) + row[4] * abs(np.cos(turn))
    aside, depth = float(offset @ across), float(offset @ out)
    lane = aside + side * (wide + BESIDE + HALF)
    joint, _ = nearest_edge(byways, (edge[:2] + lane * across)[None])
    stop = edge[:2] + lane * across + depth * out
    along = stop - joint[0, :2]
    length = float(np.hypot(*along))
    if not SHORTEST < length < LONGEST or along @ joint[0, 3:] < 0.75 * length:
        return None
    first, last = sorted((aside + side * (wide - 0.2), lane + side * HALF))
    box = (first, last, depth - min(0.7 * deep, depth - 1.5), depth + 0.6 * deep)
    frame = (float(edge[0]), float(edge[1]), float(np.arctan2(across[1], across[0])))
    return Drive(np.stack([joint[0, :2], stop]), float(joint[0, 2]), (frame, box))


def _fits(terrain: Terrain, byways: list[Byway], drive: Drive, taken: F64) -> bool:
    """Check that a drive crosses nothing and is nowhere steep."""
    if overlap(drive.row(), taken).any():
        return False
    path = resampled(drive.path, 2.0)
    station, left = located(terrain, path)
    if min(terrain.beyond(station, left).min(), terrain.clear(station, left).min()) < 4.0:
        return False
    if len(path) > 2 and (road_distance(byways, path[1:]) <= 0.0).any():
        return False
    height = ground(terrain, path)
    steps = np.hypot(*np.diff(path, axis=0).T)
    if len(steps) > 1 and (np.abs(np.diff(height))[1:] / steps[1:]).max() > STEEPEST:
        return False
    reach = min(len(path) - 1, 5)
    level = abs(height[min(len(path) - 1, 1)] - drive.height) < HIGHEST
    return bool(level and abs(height[reach] - drive.height) < STEEPEST * steps[:reach].sum())
