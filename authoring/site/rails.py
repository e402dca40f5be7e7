"""The railway on the approaches: ballast, sleepers and rails beyond the bridge's track.

All of it is of the kind `rail_bed`, background: the classes of track and sleeper belong to the bridge.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from authoring.axis.track_section import APPROACH_TRACK, GAUGE, TrackSection
from authoring.shapes.component import Mesh
from authoring.site.covers import to_world
from authoring.site.shape import RAIL_UNDERLAY, Land
from authoring.site.ways import Line, boxes, merged, ribbon, tube

F64 = NDArray[np.float64]
Piece = tuple[str, str, str, Mesh]
_BALLAST, _DEEPER = 0.30, 0.30  # [m] ballast under the sleepers, and its flanks below the ground
_CLEAR = 0.05  # [m] ballast above the ground of a far background
_SLOPE = 1.5  # horizontal meters for each meter of height of the ballast's flanks
_STOP, _STOP_TOP = (0.9, 2.7, 2.2), 1.15  # [m] along, across and down of a buffer stop; its top above the rails'
_SHOULDER = 0.40  # [m] ballast beyond the sleepers' ends
MAIN_LINE = TrackSection(
    lines=(-2.0, 2.0),
    gauge=GAUGE,
    rail_height=0.172,
    rail_foot=0.150,
    rail_head=0.072,
    bed="ballast",
    sleeper="concrete",
    sleeper_length=2.6,
    sleeper_width=0.26,
    sleeper_height=0.20,
    pitch=0.60,
    bed_depth=0.30,
    shoulder=0.40,
    embedded=0.0,
)


def railway_pieces(
    land: Land, number: int, line: Line, crown: F64, suffix: str, lift: Callable[[F64, F64], F64] | None = None
) -> list[Piece]:
    """Build a stretch of railway along an approach, beginning where the bridge's track ends.

    Args:
        land: The land.
        number: 0 before the first abutment, 1 behind the last.
        line: Its axis, leading away from the bridge; from the abutment's back face, or farther out.
        crown: World height of the rails' top on the axis [m], shape (N,), float64.
        suffix: Ending of the prim names.
        lift: Height of ground that the ballast must stay above [m], shape (N,), from station and left, or None.

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece; none if the line ends before.
    """
    track = land.layout.track
    assert track is not None
    approach = land.approaches[number]
    line, crown = _beyond(line, crown, approach.along(line.station), APPROACH_TRACK)
    if len(crown) < 2:
        return []
    if lift is not None:
        for left, above in bed_profile(track, land.layout.underlay)[1:3]:
            crown = np.maximum(crown, lift(*line.offset(left).T) - above + _CLEAR)
    names = (f"RailBed_{number}{suffix}", f"ApproachRails_{number}{suffix}", f"ApproachSleepers_{number}{suffix}")
    return _railway(land, track, line, crown, land.layout.underlay, names)


def crossing_railway(land: Land, line: Line, crown: F64, suffix: str) -> list[Piece]:
    """Build a stretch of the double track under a bridge.

    Args:
        land: The land.
        line: Its axis.
        crown: World height of the rails' top on the axis [m], shape (N,), float64.
        suffix: Ending of the prim names.

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece.
    """
    names = (f"RailBed{suffix}", f"Rails{suffix}", f"Sleepers{suffix}")
    return _railway(land, MAIN_LINE, line, crown, RAIL_UNDERLAY, names)


def buffer_stops(land: Land, line: Line, crown: F64) -> Mesh:
    """Build a block of concrete across each track of the line under a bridge, where it ends.

    Args:
        land: The land.
        line: Two points of its axis: where the blocks stand, and one farther back.
        crown: World height of the rails' top at these [m], shape (2,), float64.
    """
    axis = land.layout.alignment
    rows = np.stack([to_world(axis, _row(land, line, crown, left, _STOP_TOP)) for left in MAIN_LINE.lines])
    ahead = rows[:, 0] - rows[:, 1]
    ahead[:, 2] = 0.0
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    up = np.tile([0.0, 0.0, 1.0], (len(ahead), 1))
    return boxes(rows[:, 0], ahead, np.cross(up, ahead), up, _STOP)


def _railway(
    land: Land, track: TrackSection, line: Line, crown: F64, underlay: float, names: tuple[str, str, str]
) -> list[Piece]:
    axis, along = land.layout.alignment, line.length()
    profile = bed_profile(track, underlay)
    steps = np.linalg.norm(np.diff(profile, axis=0), axis=1)
    girth = np.concatenate([[0.0], np.cumsum(steps)])  # of the surface [m]: stones keep their size
    bed = ribbon(axis, [_row(land, line, crown, *corner) for corner in profile], along, tuple(girth.tolist()))
    rails = []
    for left in track.rails:
        ring = track.rail_outline(left)
        sides = np.diff(ring, axis=0, append=ring[:1])
        girth = np.concatenate([[0.0], np.cumsum(np.linalg.norm(sides, axis=1))])
        rows = [_row(land, line, crown, float(x), float(z)) for x, z in ring]
        rails.append(tube(axis, rows, along, tuple(girth.tolist())))
    timber = "timber" if track.sleeper == "timber" else "deck_concrete"
    return [
        (names[0], "rail_bed", "ballast", bed),
        (names[1], "rail_bed", "rail_steel", merged(rails)),
        (names[2], "rail_bed", timber, _sleepers(land, track, line, crown)),
    ]


def bed_profile(track: TrackSection, underlay: float) -> list[tuple[float, float]]:
    """Draw the ballast's surface across the line, from left to right: flank, level top, flank.

    Args:
        track: Cross-section of the railway.
        underlay: From the rails' top down to the ground [m].

    Returns:
        Distance to the left of the axis and height above the rails' top [m] of each edge.
    """
    top = track.sleeper_top - 0.045
    crown = track.lines[-1] + 0.5 * track.sleeper_length + _SHOULDER
    bottom = min(-underlay, track.sleeper_top - track.sleeper_height - _BALLAST) - _DEEPER
    foot = crown + _SLOPE * (top - bottom)
    return [(foot, bottom), (crown, top), (-crown, top), (-foot, bottom)]


def _beyond(line: Line, crown: F64, along: F64, begin: float) -> tuple[Line, F64]:
    """Remove the part nearer to the abutment than the end of the bridge's track."""
    keep = along > begin + 1e-6
    if keep.all():
        return line, crown
    if not keep.any():
        return Line(line.station[:0], line.left[:0], line.across[:0]), crown[:0]

    def cut(values: F64) -> F64:
        return np.concatenate([[np.interp(begin, along, values)], values[keep]])

    across = np.column_stack([cut(line.across[:, 0]), cut(line.across[:, 1])])
    return Line(cut(line.station), cut(line.left), across), cut(crown)


def _row(land: Land, line: Line, crown: F64, left: float, above: float) -> F64:
    """Shift the line aside and up, with the cant of the bridge's end: station, left, height [m], shape (N, 3)."""
    place = line.offset(left)
    cant = land.layout.alignment.crossfall(line.station) * (place[:, 1] - line.left)
    return np.column_stack([place, crown + cant + above])


def _sleepers(land: Land, track: TrackSection, line: Line, crown: F64) -> Mesh:
    """Build right-angled boxes without undersides, evenly spaced, the first half a pitch behind the beginning."""
    total = line.length()
    middles = track.sleepers(0.0, float(total[-1]))
    frames = []
    for center in track.lines:
        row = _row(land, line, crown, center, track.sleeper_top)
        world = to_world(land.layout.alignment, row)
        edges = (
            to_world(land.layout.alignment, _row(land, line, crown, center + x, track.sleeper_top)) for x in (1, -1)
        )
        lean = np.subtract(*edges)
        frames.append([_at(values, middles, total) for values in (world, np.gradient(world, total, axis=0), lean)])
    place, ahead, lean = (np.concatenate(values) for values in zip(*frames, strict=True))
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    up = np.cross(ahead, lean)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    size = track.sleeper_width, track.sleeper_length, track.sleeper_height
    return boxes(place, ahead, np.cross(up, ahead), up, size)


def _at(values: F64, places: F64, along: F64) -> F64:
    return np.column_stack([np.interp(places, along, values[:, k]) for k in range(3)])
