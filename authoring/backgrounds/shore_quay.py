"""A quay along a straight shore: wall and promenade, a street behind it, railing, lamps, jetties."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.solids import Frame, box
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.waters import Basin
from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world
from authoring.site.roads import DASHES, spread
from authoring.site.ways import Line, carriageway, dashes, merged, ribbon

F64 = NDArray[np.float64]
GroundPiece = tuple[str, str, str, str, Mesh]
Rows = tuple[F64, F64]

DEPTH = 12.0  # of the promenade [m]
STREET = 6.0  # width of the street's asphalt [m]
SETBACK = 21.0  # from the quay's edge to the middle of the street [m]
STEP = 4.0  # distance between cross-sections [m]
PANEL = 3.0  # length of a panel of railing [m]
LAMP_STEP, JETTY_STEP = 24.0, 55.0  # [m]
HOME = Frame(0.0, 0.0, 0.0, 0.0)


def quay_reaches(terrain: Terrain, reach: float) -> list[F64]:
    """Divide the quay at the crossing.

    Args:
        terrain: The terrain.
        reach: Length before and behind the site's middle [m].

    Returns:
        Stations of the cross-sections of each stretch [m], each of shape (N,), float64.
    """
    crossing, middle = terrain.land.crossing, (terrain.inner[0] + terrain.inner[1]) / 2
    room = crossing.half_width + (14.0 if crossing.kind == "river" else 9.0)
    side = 240.0
    at = [float(crossing.center(np.array(sign * side))) for sign in (-1.0, 1.0)]
    low, high = min(*at, crossing.station) - room, max(*at, crossing.station) + room
    stretches = [(middle - reach, low), (high, middle + reach)]
    return [spread(start, stop, STEP) for start, stop in stretches if stop - start > 60.0]


def quay_pieces(terrain: Terrain, basin: Basin, reaches: list[F64]) -> list[GroundPiece]:
    """Build quay walls, promenade and street.

    Args:
        terrain: The terrain.
        basin: The water.
        reaches: Stations of the cross-sections of each stretch [m], each of shape (N,), float64.

    Returns:
        Name, component kind, material recipe, group and mesh of each piece.
    """
    axis = terrain.land.layout.alignment
    pieces: list[GroundPiece] = []
    for number, stations in enumerate(reaches):
        edge, top = _edge(terrain, basin, stations)
        rows = [(0.5, basin.level - 2.5), (0.5, top), (-0.1, top)]
        wall = _strip(terrain, basin, (stations, edge), rows)
        ends = [_end(terrain, basin, (stations[k], edge[k]), top) for k in (0, -1)]
        pieces.append((f"QuayWall_{number}", "wall_retaining", "masonry", "Shore", merged([wall, *ends])))
        deck = _strip(terrain, basin, (stations, edge), [(-0.1, top), (-DEPTH, top), (-DEPTH, top - 2.0)])
        pieces.append((f"Promenade_{number}", "ground", "concrete", "Shore", deck))
        line, crown = _street(terrain, basin, stations)
        fall = np.full(len(stations), 0.06)
        road = carriageway(axis, line, crown, fall, np.zeros(len(stations)), STREET / 2)
        pieces.append((f"ShoreRoad_{number}", "road", "asphalt", "Ways", road))
        paint = dashes(axis, line, crown, 0.0, DASHES)
        if paint is not None:
            pieces.append((f"ShoreMarking_{number}", "road", "road_marking", "Ways", paint))
    return pieces


def street_places(terrain: Terrain, basin: Basin, reaches: list[F64], aside: float, step: float) -> F64:
    """List places along the street.

    Args:
        terrain: The terrain.
        basin: The water.
        reaches: Stations of the cross-sections of each stretch [m], each of shape (N,), float64.
        aside: Shift from the street's middle towards the water [m].
        step: Distance between places [m].

    Returns:
        Station, left and height of the street [m], shape (N, 3), float64.
    """
    rows = []
    for stations in reaches:
        line, crown = _street(terrain, basin, stations)
        at = np.arange(stations.min() + 6.0, stations.max() - 6.0, step)
        order = np.argsort(line.station)
        left = np.interp(at, line.station[order], line.left[order]) + basin.side * aside
        rows.append(np.column_stack([at, left, np.interp(at, line.station[order], crown[order])]))
    return np.concatenate([np.zeros((0, 3)), *rows])


def quay_places(terrain: Terrain, basin: Basin, reaches: list[F64], back: float, step: float) -> F64:
    """List places on the promenade.

    Args:
        terrain: The terrain.
        basin: The water.
        reaches: Stations of the cross-sections of each stretch [m], each of shape (N,), float64.
        back: Distance behind the quay's edge; negative over the water [m].
        step: Distance between places [m].

    Returns:
        Station, left and height of the promenade [m], shape (N, 3), float64.
    """
    rows = []
    for stations in reaches:
        _, top = _edge(terrain, basin, stations)
        at = np.arange(stations.min() + 2.0, stations.max() - 2.0, step)
        rows.append(np.column_stack([at, basin.side * (basin.near(at) - back), np.full(len(at), top)]))
    return np.concatenate([np.zeros((0, 3)), *rows])


def quay_runs(terrain: Terrain, basin: Basin, reaches: list[F64], prefix: str, first_id: int) -> list[Scatter]:
    """Place railing and lamps on the promenade, and jetties before it.

    Args:
        terrain: The terrain.
        basin: The water.
        reaches: Stations of the cross-sections of each stretch [m], each of shape (N,), float64.
        prefix: Put before the names of the runs.
        first_id: Instance id of the first run.

    Returns:
        One run of each.
    """
    runs: list[Scatter] = []
    kinds = (
        ("Railing", "fence", _panel(), 0.25, PANEL, 0.0),
        ("Lamps", "lamp_post", _lamp(), 3.0, LAMP_STEP, 0.0),
        ("Jetties", "ground", _jetty(), -8.0, JETTY_STEP, basin.level + 0.55),
    )
    axis = terrain.land.layout.alignment
    for name, kind, prototype, back, step, level in kinds:
        places = quay_places(terrain, basin, reaches, back, step)
        if not len(places):
            continue
        if level:
            places[:, 2] = level
        count = len(places)
        yaw = axis.heading_at(places[:, 0]) + (0.0 if basin.side > 0 else np.pi)
        which, scale = np.zeros(count, np.int32), np.ones((count, 3))
        runs.append(
            Scatter(
                f"{prefix}_{name}",
                kind,
                "Shore",
                (prototype,),
                which,
                to_world(axis, places),
                yaw,
                scale,
                (first_id + len(runs),),
            )
        )
    return runs


def _edge(terrain: Terrain, basin: Basin, stations: F64) -> tuple[F64, float]:
    """Find the quay's edge by its left, and its height over the ground behind it [m]."""
    edge = basin.side * basin.near(stations)
    behind = terrain.height(stations, edge - basin.side * DEPTH)
    return edge, round(max(float(np.quantile(behind, 0.9)) + 0.12, basin.level + 1.3), 3)


def _strip(terrain: Terrain, basin: Basin, line: Rows, profile: list[tuple[float, float]]) -> Mesh:
    """Mesh a strip along the quay; the profile counts from its edge towards the water, and from height 0 [m]."""
    order = slice(None) if basin.side > 0 else slice(None, None, -1)
    stations, edge = line[0][order], line[1][order]
    rows = [
        np.column_stack([stations, edge + basin.side * out, np.full(len(stations), level)]) for out, level in profile
    ]
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(profile, axis=0).T))])
    along = np.abs(stations - stations[0])
    return ribbon(terrain.land.layout.alignment, rows, along, tuple((-run).tolist()))


def _end(terrain: Terrain, basin: Basin, place: tuple[float, float], top: float) -> Mesh:
    """Close an end of the quay by a wall into the water."""
    low = basin.level - 2.5
    middle = place[1] + basin.side * (0.5 - (DEPTH + 0.5) / 2)
    frame = Frame(place[0], middle, (low + top) / 2 + 0.1, 0.0)
    wall = box(frame, (0.0, 0.0, 0.0), (0.3, (DEPTH + 0.9) / 2, (top - low) / 2 + 0.1))
    axis = terrain.land.layout.alignment
    return Mesh(
        to_world(axis.frame_at(place[0], middle), wall.points), wall.face_counts, wall.corners, wall.normals, wall.st
    )


def _street(terrain: Terrain, basin: Basin, stations: F64) -> tuple[Line, F64]:
    """Compute the street's center line and the height of its crown [m]."""
    order = slice(None) if basin.side > 0 else slice(None, None, -1)
    at = stations[order]
    left = basin.side * (basin.near(at) - SETBACK)
    across = np.column_stack([np.zeros(len(at)), np.full(len(at), basin.side)])
    line = Line(at, left, across)
    ground = np.max([terrain.height(*line.offset(side).T) for side in (-3.4, -1.7, 0.0, 1.7, 3.4)], axis=0)
    wide = np.pad(ground, 4, mode="edge")
    crown = np.max([wide[k : k + len(at)] for k in range(9)], axis=0)
    calm = np.convolve(np.pad(crown, 4, mode="edge"), np.ones(9) / 9.0, mode="valid")
    return line, np.round(np.maximum(calm, ground) + 0.12, 4)


def _panel() -> tuple[tuple[str, Mesh], ...]:
    """Model a panel of railing along x."""
    half = PANEL / 2
    bars = [box(HOME, (0.0, 0.0, height), (half, 0.02, 0.02)) for height in (0.3, 0.62, 1.0)]
    posts = [box(HOME, (-half + 0.03, 0.0, 0.5), (0.03, 0.03, 0.5))]
    return (("galvanised_steel", merged([*bars, *posts])),)


def _lamp() -> tuple[tuple[str, Mesh], ...]:
    """Model a lamp post with a lantern."""
    post = [
        box(HOME, (0.0, 0.0, 0.25), (0.14, 0.14, 0.25)),
        box(HOME, (0.0, 0.0, 2.4), (0.05, 0.05, 2.2)),
        box(HOME, (0.0, 0.0, 5.15), (0.2, 0.2, 0.06)),
    ]
    return ("painted_steel", merged(post)), ("white_paint", box(HOME, (0.0, 0.0, 4.85), (0.13, 0.13, 0.25)))


def _jetty() -> tuple[tuple[str, Mesh], ...]:
    """Model a jetty of planks on piles, out along y."""
    deck = box(HOME, (0.0, 0.0, -0.08), (0.9, 9.0, 0.08))
    piles = [box(HOME, (x, y, -1.6), (0.11, 0.11, 2.2)) for x in (-0.85, 0.85) for y in (-8.5, -4.2, 0.0, 4.2, 8.5)]
    return (("timber", merged([deck, *piles])),)
