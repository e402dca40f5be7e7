"""Designs of villas, town houses and blocks about their own origin, detailed and simplified, for many repetitions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.facade_parts import (
    HOME,
    STOREY,
    balcony,
    door,
    openings,
    plain_balcony,
    plinth,
    sheets,
    window,
)
from authoring.backgrounds.plots import DEEP, Plots
from authoring.backgrounds.solids import Frame, box, gabled_walls, roof_slab, solid
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world
from authoring.site.ways import merged

F64 = NDArray[np.float64]
Parts = tuple[tuple[str, Mesh], ...]

MOST = 32  # buildings in detail
HIGH = 6  # storeys of a block above which its roof is flat where the style has flat ones
MAIN = (0.56, 0.68)  # share of the front of a house with a wing that its main part takes [1]


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
        wings: Share of the designs with a lower wing beside the main part [1].
        towers: Share of the designs with a stair tower [1].
    """

    length: tuple[float, float]
    depth: tuple[float, float]
    storeys: tuple[int, int]
    roofs: tuple[str, ...]
    walls: tuple[str, ...]
    balconies: float
    shutters: float
    tiles: str = "roof_tile"
    wings: float = 0.0
    towers: float = 0.0


@dataclass(frozen=True)
class _Part:
    """A box of a building with a roof of its own: the middle of its floor [m], half its size [m], storeys and roof."""

    at: tuple[float, float]
    half: tuple[float, float]
    storeys: int
    roof: str

    @property
    def eaves(self) -> float:
        """Height of its eaves [m]."""
        return round(self.storeys * STOREY + 0.35, 3)


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
        close: Distance from the site within which the nearest `MOST` of them are detailed [m].
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
    half = tuple(round(float(rng.uniform(*side)) / 2, 3) for side in (style.length, style.depth))
    wall, pitch = str(rng.choice(style.walls)), float(rng.uniform(0.36, 0.55))
    parts = _parts(style, (half[0], half[1]), rng)
    shells = [_shell(part, style.tiles, pitch, rng) for part in parts]
    body, main = merged([shell for shell, _ in shells]), parts[0]
    cap = tuple(piece for _, roof in shells for piece in roof)
    spots, faces = _windows(parts, pitch, rng)
    tower = _tower(main, rng) if rng.random() < style.towers else None
    if tower is not None:
        beside = tower.clear(spots, faces)
        spots, faces = spots[beside], faces[beside]
    entry = int(np.argmin(np.hypot(spots[:, 0] - main.at[0], 9.0 * (faces != 0) + spots[:, 2])))
    entrance = door((float(spots[entry, 0]), main.at[1] - main.half[1]), 0.55 if main.storeys < 4 else 1.1)
    spots, faces = np.delete(spots, entry, axis=0), np.delete(faces, entry)
    turns = (0.5 * np.pi * faces).astype(np.float64)
    shutters = bool(rng.random() < style.shutters)
    pane, trim = window(shutters, rng)
    plain_pane, plain_trim = sheets(shutters)
    frames = "painted_steel" if shutters else "white_paint" if wall != "plaster_white" else "limestone"
    bases = [plinth(part.half, wall, part.at) for part in parts]
    walls = [(wall, body), ("concrete", merged([repeated(trim[0], spots, turns), *bases]))]
    plain = [(wall, body), (frames, repeated(plain_trim, spots, turns))]
    if trim[1] is not None:
        walls.append(("painted_steel", repeated(trim[1], spots, turns)))
    if tower is not None:
        walls.append(("concrete", tower.mesh))
        plain.append(("concrete", tower.mesh))
    for built in (walls, plain):
        built.append(("metal_panel", entrance))
    if rng.random() < style.balconies and main.storeys > 1:
        near, far = _balconies(main, rng)
        walls += near
        plain += far
    panes = tuple((("window", repeated(mesh, spots, turns)),) for mesh in (pane, plain_pane))
    return Design((half[0], half[1]), main.eaves, (tuple(walls), tuple(plain)), (cap, cap), (panes[0], panes[1]))


def _parts(style: Style, half: tuple[float, float], rng: np.random.Generator) -> list[_Part]:
    """Divide a footprint into a main part and perhaps a lower wing on one side of it."""
    storeys = int(rng.integers(style.storeys[0], style.storeys[1] + 1))
    roof = str(rng.choice(style.roofs))
    roof = "flat" if storeys > HIGH and "flat" in style.roofs else roof
    if storeys < 2 or rng.random() > style.wings:
        return [_Part((0.0, 0.0), half, storeys, roof)]
    share, side, (x, y) = float(rng.uniform(*MAIN)), float(rng.choice((-1.0, 1.0))), half
    deep = y * float(rng.uniform(0.6, 0.85))
    lower = storeys - 1 - int(rng.integers(0, max(storeys // 3, 1)))
    back = float(rng.choice((-1.0, 1.0, 1.0))) * (y - deep)
    wing = _Part((side * share * x, back), ((1.0 - share) * x, deep), lower, str(rng.choice((roof, roof, "deck"))))
    return [_Part((-side * (1.0 - share) * x, 0.0), (share * x, y), storeys, roof), wing]


def _windows(parts: list[_Part], pitch: float, rng: np.random.Generator) -> tuple[F64, NDArray[np.int64]]:
    """Place windows on the walls of all parts where no other part covers them: middles [m], (N, 3), and faces."""
    rows, faces = [], []
    for number, part in enumerate(parts):
        spots, face = openings(part.half, part.storeys, rng)
        spots = spots + np.array([*part.at, 0.0])
        seen = np.full(len(face), True)
        if len(parts) > 1:
            other = parts[1 - number]
            seen = face != (1 if other.at[0] > part.at[0] else 3)
            if number == 0:
                top = other.eaves + pitch * max(other.half) + 1.0
                seen |= (np.abs(spots[:, 1] - other.at[1]) > other.half[1] + 0.9) | (spots[:, 2] > top)
        rows.append(spots[seen])
        faces.append(face[seen])
    return np.concatenate(rows), np.concatenate(faces)


@dataclass(frozen=True, eq=False)
class _Tower:
    """A stair tower on the face of a house: its mesh, the face, and the x between which no window shows [m]."""

    mesh: Mesh
    face: int
    range: tuple[float, float]

    def clear(self, spots: F64, faces: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Find the windows beside it, shape (N,), bool."""
        return (faces != self.face) | (spots[:, 0] < self.range[0]) | (spots[:, 0] > self.range[1])


def _tower(part: _Part, rng: np.random.Generator) -> _Tower:
    face, wide = int(rng.choice((0, 2))), float(rng.uniform(1.3, 1.8))
    x = part.at[0] + float(rng.uniform(-0.4, 0.4)) * (part.half[0] - wide)
    y = part.at[1] + (part.half[1] if face else -part.half[1])
    top, foot = part.eaves + 2.4, -DEEP - 0.5
    mesh = box(HOME, (x, y, (top + foot) / 2), (wide, 0.5, (top - foot) / 2), "xXyYZ")
    return _Tower(mesh, face, (x - wide - 0.8, x + wide + 0.8))


def _balconies(part: _Part, rng: np.random.Generator) -> tuple[list[tuple[str, Mesh]], list[tuple[str, Mesh]]]:
    """Put balconies along the front of a part, one on each upper storey: in detail and plain."""
    wide, deep = part.half[0] * float(rng.uniform(0.55, 0.95)), float(rng.uniform(1.1, 1.6))
    slab, rail = balcony(wide, deep)
    levels = np.arange(1, part.storeys) * STOREY + 0.07
    at = np.column_stack([np.full((len(levels), 2), (part.at[0], part.at[1] - part.half[1])), levels])
    turns = np.zeros(len(levels))
    near = [("concrete", repeated(slab, at, turns)), ("galvanised_steel", repeated(rail, at, turns))]
    return near, [("concrete", repeated(plain_balcony(wide, deep), at, turns))]


def _shell(part: _Part, tiles: str, pitch: float, rng: np.random.Generator) -> tuple[Mesh, Parts]:
    """Build walls down into the ground, and the roof on them, its ridge along the longer side of a gabled part."""
    turned = part.roof == "gable" and part.half[1] > part.half[0]
    frame = Frame(*part.at, 0.0, 0.5 * np.pi if turned else 0.0)
    x, y = part.half[::-1] if turned else part.half
    foot, eaves = -DEEP - 0.5, part.eaves
    body = box(frame, (0.0, 0.0, (foot + eaves) / 2), (x, y, (eaves - foot) / 2))
    high = 0.5 * pitch * y + 0.7
    chimney = ("brick", box(frame, (0.4 * x, 0.3 * y, eaves + high), (0.4, 0.3, high)))
    if part.roof == "gable":
        ridge = eaves + y * pitch
        slab = roof_slab(frame, (x + 0.4, y + 0.6), eaves - 0.6 * pitch, ridge, 0.22)
        return gabled_walls(frame, (x, y), (foot, eaves, ridge)), ((tiles, slab), chimney)
    if part.roof == "hip":
        return body, ((tiles, _hipped(frame, (x + 0.7, y + 0.7), eaves, pitch)), chimney)
    parapet = [box(frame, (sx * (x + 0.05), 0.0, eaves + 0.35), (0.15, y + 0.2, 0.55)) for sx in (-1.0, 1.0)] + [
        box(frame, (0.0, sy * (y + 0.05), eaves + 0.35), (x - 0.1, 0.15, 0.55)) for sy in (-1.0, 1.0)
    ]
    deck = ("gravel", box(frame, (0.0, 0.0, eaves + 0.05), (x - 0.05, y - 0.05, 0.09)))
    if part.roof == "deck":
        return body, (deck, ("concrete", merged(parapet)))
    at = rng.uniform(-0.5, 0.5, 2) * np.array([x, 0.6 * y])
    house = box(frame, (float(at[0]), float(at[1]), eaves + 1.45), (min(0.3 * x, 3.0), min(0.4 * y, 2.2), 1.45))
    tank = box(frame, (float(-0.6 * at[0] - 0.4 * x), 0.5 * y, eaves + 0.75), (0.9, 0.9, 0.75))
    return body, (deck, ("concrete", merged([*parapet, house])), ("painted_metal", tank))


def _hipped(frame: Frame, half: tuple[float, float], eaves: float, pitch: float) -> Mesh:
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
    return solid(frame, points, faces)
