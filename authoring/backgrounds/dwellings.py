"""Designs of villas, town houses and blocks about their own origin, detailed and simplified, for many repetitions."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.plots import DEEP, Plots
from authoring.backgrounds.solids import Frame, box, gabled_walls, roof_slab, solid
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world
from authoring.site.ways import merged

F64 = NDArray[np.float64]
Parts = tuple[tuple[str, Mesh], ...]

STOREY = 3.0  # [m]
MOST = 32  # buildings in detail
HOME = Frame(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Style:
    """A family of buildings.

    Attributes:
        length: Range of the front's length [m].
        depth: Range of the depth [m].
        storeys: Fewest and most storeys.
        roofs: Roofs to draw from: `hip`, `gable`, `flat`.
        walls: Material recipes of the walls to draw from.
        balconies: Share of the designs with balconies [1].
        shutters: Share of the designs with shutters [1].
        tiles: Material recipe of pitched roofs.
    """

    length: tuple[float, float]
    depth: tuple[float, float]
    storeys: tuple[int, int]
    roofs: tuple[str, ...]
    walls: tuple[str, ...]
    balconies: float
    shutters: float
    tiles: str = "roof_tile"


@dataclass(frozen=True, eq=False)
class Design:
    """One building in two levels of detail, the front towards -y, its floor at height 0.

    Attributes:
        half: Half its length and depth [m].
        height: Of the eaves or the flat roof [m].
        walls: Walls with their trim, in detail and plain.
        roof: Roof, likewise.
        windows: Windows, likewise.
    """

    half: tuple[float, float]
    height: float
    walls: tuple[Parts, Parts]
    roof: tuple[Parts, Parts]
    windows: tuple[Parts, Parts]


def draw_designs(style: Style, count: int, rng: np.random.Generator) -> tuple[Design, ...]:
    """Draw buildings of a style.

    Args:
        style: The style.
        count: How many.
        rng: Random stream.

    Returns:
        The designs.
    """
    return tuple(_design(style, rng) for _ in range(count))


def halves(designs: tuple[Design, ...]) -> F64:
    """List half the length and depth of designs [m], shape (D, 2), float64."""
    return np.array([design.half for design in designs])


def dwelling_runs(
    terrain: Terrain, prefix: str, designs: tuple[Design, ...], plots: Plots, close: float, first_id: int
) -> list[Scatter]:
    """Repeat designs on plots.

    Args:
        terrain: The terrain.
        prefix: Put before the names of the runs.
        designs: The designs that the plots refer to.
        plots: Plots of the buildings.
        close: Distance from the site within which they are detailed [m].
        first_id: Instance id of the first wall; every wall, roof and set of windows has a separate id.

    Returns:
        Runs of walls, roofs and windows, near and far.
    """
    axis = terrain.land.layout.alignment
    positions = to_world(axis, plots.places)
    yaw = plots.heading + axis.heading_at(plots.places[:, 0])
    away = terrain.beyond(plots.places[:, 0], plots.places[:, 1])
    near = (away < close) & (np.argsort(np.argsort(away, kind="stable"), kind="stable") < MOST)
    runs: list[Scatter] = []
    number = first_id
    for grade, (name, chosen) in enumerate((("Near", near), ("Far", ~near))):
        total = int(chosen.sum())
        if not total:
            continue
        used, which = np.unique(plots.which[chosen], return_inverse=True)
        for part, kind in (("walls", "building"), ("roof", "roof"), ("windows", "window")):
            prototypes = tuple(getattr(designs[row], part)[grade] for row in used)
            ids = tuple(range(number, number + total))
            place = (positions[chosen], yaw[chosen], np.ones((total, 3)))
            label = f"{prefix}_{name}{part.capitalize()}"
            runs.append(Scatter(label, kind, "Buildings", prototypes, which.reshape(-1).astype(np.int32), *place, ids))
            number += total
    return runs


def repeated(mesh: Mesh, places: F64, turns: F64) -> Mesh:
    """Repeat a mesh within one mesh.

    Args:
        mesh: Mesh to repeat, about its origin.
        places: Positions [m], shape (N, 3), float64.
        turns: Turn of each about the vertical [rad], shape (N,), float64.

    Returns:
        One mesh.
    """
    cosine, sine = np.cos(turns)[:, None], np.sin(turns)[:, None]

    def turned(rows: F64) -> F64:
        x, y, z = rows.T
        return np.stack([x * cosine - y * sine, x * sine + y * cosine, np.broadcast_to(z, (len(turns), len(z)))], 2)

    starts = np.arange(len(places))[:, None] * len(mesh.points)
    return Mesh(
        points=(turned(mesh.points) + places[:, None]).reshape(-1, 3),
        face_counts=np.tile(mesh.face_counts, len(places)),
        corners=(mesh.corners + starts).reshape(-1).astype(np.int32),
        normals=turned(mesh.normals.astype(np.float64)).reshape(-1, 3).astype(np.float32),
        st=(mesh.st[None] + 0.37 * np.arange(len(places))[:, None, None]).reshape(-1, 2).astype(np.float32),
    )


def _design(style: Style, rng: np.random.Generator) -> Design:
    length, depth = rng.uniform(*style.length), rng.uniform(*style.depth)
    half = (round(float(length) / 2, 3), round(float(depth) / 2, 3))
    storeys = int(rng.integers(style.storeys[0], style.storeys[1] + 1))
    roof = str(rng.choice(style.roofs))
    wall = str(rng.choice(style.walls))
    eaves = round(storeys * STOREY + 0.35, 3)
    pitch = float(rng.uniform(0.36, 0.55))
    body, cap = _shell(half, eaves, (roof, style.tiles), pitch, rng)
    spots, turns, front = _openings(half, storeys, rng)
    pane, trim = _window(bool(rng.random() < style.shutters), rng)
    balconies = rng.random() < style.balconies
    walls = [(wall, body), ("concrete", merged([repeated(trim[0], spots, turns), *_base(half, wall)]))]
    if trim[1] is not None:
        walls.append(("painted_steel", repeated(trim[1], spots, turns)))
    if balconies:
        slab, rail = _balcony(half, rng)
        upper = front & (spots[:, 2] > STOREY)
        levels = np.unique(np.round(spots[upper, 2], 3))
        at = np.column_stack([np.zeros((len(levels), 1)), np.full(len(levels), -half[1]), levels - 1.55])
        if len(levels):
            walls.append(("concrete", repeated(slab, at, np.zeros(len(levels)))))
            walls.append(("galvanised_steel", repeated(rail, at, np.zeros(len(levels)))))
    plain = (("window", repeated(_sheet(), spots, turns)),)
    whole = (("window", repeated(pane, spots, turns)),)
    return Design(half, eaves, (tuple(walls), ((wall, body),)), (cap, cap), (whole, plain))


def _shell(
    half: tuple[float, float], eaves: float, top: tuple[str, str], pitch: float, rng: np.random.Generator
) -> tuple[Mesh, Parts]:
    """Build walls down into the ground, and the roof on them."""
    (x, y), (roof, tiles) = half, top
    foot = -DEEP - 0.5
    body = box(HOME, (0.0, 0.0, (foot + eaves) / 2), (x, y, (eaves - foot) / 2))
    chimney = box(HOME, (0.4 * x, 0.3 * y, eaves + 0.5 * pitch * y + 0.7), (0.4, 0.3, 0.5 * pitch * y + 0.7))
    if roof == "gable":
        ridge = eaves + y * pitch
        slab = roof_slab(HOME, (x + 0.4, y + 0.6), eaves - 0.6 * pitch, ridge, 0.22)
        return gabled_walls(HOME, half, (foot, eaves, ridge)), ((tiles, slab), ("brick", chimney))
    if roof == "hip":
        return body, ((tiles, _hipped((x + 0.7, y + 0.7), eaves, pitch)), ("brick", chimney))
    parapet = [box(HOME, (sx * (x + 0.05), 0.0, eaves + 0.35), (0.15, y + 0.2, 0.55)) for sx in (-1.0, 1.0)] + [
        box(HOME, (0.0, sy * (y + 0.05), eaves + 0.35), (x - 0.1, 0.15, 0.55)) for sy in (-1.0, 1.0)
    ]
    at = rng.uniform(-0.5, 0.5, 2) * np.array([x, 0.6 * y])
    house = box(HOME, (float(at[0]), float(at[1]), eaves + 1.45), (min(0.3 * x, 3.0), min(0.4 * y, 2.2), 1.45))
    tank = box(HOME, (float(-0.6 * at[0] - 0.4 * x), 0.5 * y, eaves + 0.75), (0.9, 0.9, 0.75))
    deck = box(HOME, (0.0, 0.0, eaves + 0.05), (x - 0.05, y - 0.05, 0.09))
    return body, (("gravel", deck), ("concrete", merged([*parapet, house])), ("painted_metal", tank))


def _hipped(half: tuple[float, float], eaves: float, pitch: float) -> Mesh:
    """Build a hipped roof with a fascia, its ridge along the longer side."""
    long = half[0] >= half[1]
    x, y = half if long else half[::-1]
    low, high, ridge = eaves - 0.7 * pitch, eaves - 0.7 * pitch + 0.22, eaves + y * pitch
    inner = max(x - y, 0.3)
    ring = [(-x, -y), (x, -y), (x, y), (-x, y)]
    points = np.array([*((*p, low) for p in ring), *((*p, high) for p in ring), (-inner, 0, ridge), (inner, 0, ridge)])
    if not long:
        points = points[:, [1, 0, 2]] * np.array([-1.0, 1.0, 1.0])
    faces = [[3, 2, 1, 0], *([k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4))]
    faces += [[4, 5, 9, 8], [6, 7, 8, 9], [5, 6, 9], [7, 4, 8]]
    return solid(HOME, points, faces)


def _openings(half: tuple[float, float], storeys: int, rng: np.random.Generator) -> tuple[F64, F64, NDArray[np.bool_]]:
    """Place windows on four walls: middles [m], shape (N, 3), turns [rad] and whether they face the front."""
    pitch = float(rng.uniform(2.5, 3.4))
    rows, turns, front = [], [], []
    for face in range(4):
        reach, width = (half[1], half[0]) if face % 2 == 0 else (half[0], half[1])
        count = max(int((2 * width - 1.2) / pitch), 1)
        if face % 2 and width < 4.2:
            count = 1
        along = (np.arange(count) - (count - 1) / 2) * pitch
        turn = face * np.pi / 2
        for storey in range(storeys):
            x, y = along, np.full(count, -reach)
            rows.append(
                np.column_stack(
                    [
                        x * np.cos(turn) - y * np.sin(turn),
                        x * np.sin(turn) + y * np.cos(turn),
                        np.full(count, storey * STOREY + 1.62),
                    ]
                )
            )
            turns.append(np.full(count, turn))
            front.append(np.full(count, face == 0))
    return np.concatenate(rows), np.concatenate(turns), np.concatenate(front)


def _window(shutters: bool, rng: np.random.Generator) -> tuple[Mesh, tuple[Mesh, Mesh | None]]:
    """Model a window, x to its right and y into the wall: panes, and their surround and shutters."""
    wide, tall = float(rng.uniform(0.48, 0.7)), float(rng.uniform(0.62, 0.8))
    panes = [box(HOME, (s * 0.5 * wide, 0.02, 0.0), (0.5 * wide - 0.02, 0.05, tall), "y") for s in (-1.0, 1.0)]
    surround = [
        *(box(HOME, (s * (wide + 0.05), -0.02, 0.0), (0.06, 0.08, tall + 0.02), "yxX") for s in (-1.0, 1.0)),
        box(HOME, (0.0, -0.02, tall + 0.06), (wide + 0.11, 0.08, 0.06), "yzZxX"),
        box(HOME, (0.0, -0.05, -tall - 0.05), (wide + 0.18, 0.13, 0.05), "yzZxX"),
    ]  # faces inside the wall are not visible
    leaves = [
        box(HOME, (s * (1.5 * wide + 0.12), -0.03, 0.0), (0.48 * wide, 0.035, tall), "yzZxX") for s in (-1.0, 1.0)
    ]
    return merged(panes), (merged(surround), merged(leaves) if shutters else None)


def _sheet() -> Mesh:
    """Make a plain pane of one face in front of the wall."""
    pane = solid(
        HOME,
        np.array([(-0.6, -0.06, -0.75), (0.6, -0.06, -0.75), (0.6, -0.06, 0.75), (-0.6, -0.06, 0.75)]),
        [[0, 1, 2, 3]],
    )
    return replace(pane)


def _balcony(half: tuple[float, float], rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """Model the balcony of a storey along the front: its slab and its railing."""
    deep, wide = float(rng.uniform(1.1, 1.6)), half[0] * float(rng.uniform(0.55, 0.98))
    slab = box(HOME, (0.0, 0.1 - deep / 2, 0.0), (wide, deep / 2 + 0.1, 0.09))
    rails = [box(HOME, (0.0, 0.06 - deep, h), (wide, 0.03, 0.03)) for h in (0.55, 1.02)]
    posts = np.linspace(-wide + 0.04, wide - 0.04, max(int(2 * wide / 1.1), 2))
    rails += [box(HOME, (float(p), 0.06 - deep, 0.55), (0.025, 0.025, 0.5)) for p in posts]
    return slab, merged(rails)


def _base(half: tuple[float, float], wall: str) -> list[Mesh]:
    """Model a plinth that projects from the wall."""
    low = -DEEP - 0.5
    plinth = box(HOME, (0.0, 0.0, (low + 0.3) / 2), (half[0] + 0.06, half[1] + 0.06, (0.3 - low) / 2))
    return [plinth] if wall != "brick" else [box(HOME, (0.0, 0.0, low / 2), (half[0] + 0.04, half[1] + 0.04, -low / 2))]
