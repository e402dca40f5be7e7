"""Railway on a deck: rails, sleepers, ballast or track slabs, and the upstands and walkways beside them.

Source: standard practice (gauge 1.435 m, rail 60E1 of EN 13674-1, sleepers of 2.4 to 2.6 m every 0.60 to 0.65 m); the
profile `paper` takes the values of the Random Bridge Generator of Shi, Kim and Narazaki.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.axis.track_section import APPROACH_TRACK, CLEARANCE, GAUGE, TrackSection
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.idle_settings import Use
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Spans
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, on_side, rectangle
from authoring.solids.copies import LOCAL, copied, frames_along
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, joined, sweep
from groundwork.errors import InputError
from groundwork.settings import Settings

EMBEDDED = 0.005  # [m] embedment of ballast, slab and upstands in the deck
_INTO_SIDE = 0.010  # [m] embedment of ballast in the upstands
_SHORTER = 0.003  # [m] walkways are shorter than upstands, so that no two faces are coplanar
_LOWER = 0.012  # [m] depth of the walkway below the upstand
_TOE = 0.15  # [m] from the edge of the ballast's level top to the upstand
_TOE_SLOPE = 1.5  # horizontal meters for each meter of height of the ballast's shoulder
_SLAB_GAP = 0.06  # [m] by which the gap between track slabs is wider than the deck's
_PAPER_WIDTH = 10.0  # [m] of every deck of the paper's generator


class TrackSettings(Settings):
    """Tracks and the strips beside them; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("bed", ("ballast",), ("ballast", "shoulder")),
        Use("bed", ("ballast",), ("sleeper",), plain="concrete"),
        Use("bed", ("slab",), ("slab", "slab_shoulder", "embedded")),
        Use("sleeper", ("concrete",), ("sleeper_height",)),
    )
    bed: Literal["ballast", "slab"] | None = chosen(
        {"ballast": 65, "slab": 35}, "Track bed: ballast, or a ballastless track slab", paper={"slab": 1}
    )
    sleeper: Literal["concrete", "timber"] | None = chosen(
        {"concrete": 80, "timber": 20}, "Material of the sleepers; always concrete on a track slab"
    )
    spacing: float | None = drawn(4.0, 4.5, "Distance between the axes of two tracks [m]", ge=3.5, le=6.0)
    pitch: float | None = drawn(0.60, 0.65, "Sleeper spacing, axis to axis [m]", paper=(2.0, 10.0))
    sleeper_length: float | None = drawn(
        2.4, 2.6, "Length of a sleeper, across the track [m]", ge=1.9, le=2.8, paper=(2.0, 2.0)
    )
    sleeper_width: float | None = drawn(
        0.25, 0.30, "Width of a sleeper, along the track [m]", ge=0.20, le=0.32, paper=(0.2, 0.2)
    )
    sleeper_height: float | None = drawn(
        0.19, 0.22, "Height of a concrete sleeper [m]", ge=0.14, le=0.26, paper=(0.2, 0.2)
    )
    ballast: float | None = drawn(0.25, 0.35, "Depth of the ballast under the sleepers [m]", ge=0.15, le=0.60)
    slab: float | None = drawn(0.20, 0.30, "Thickness of a track slab [m]", ge=0.15, le=0.50, paper=(0.2, 0.2))
    embedded: float | None = drawn(
        0.06, 0.12, "Depth to which sleepers are embedded in a track slab [m]", ge=0.003, le=0.13, paper=(0.005, 0.005)
    )
    shoulder: float | None = drawn(0.30, 0.40, "Width of the ballast beyond the sleepers' ends [m]", ge=0.20, le=0.60)
    slab_shoulder: float | None = drawn(
        0.15, 0.30, "Width of the track slab beyond the sleepers' ends [m]", ge=0.05, le=0.50, paper=(0.25, 0.25)
    )
    upstand: float | None = drawn(0.18, 0.25, "Width of the upstands beside the track bed [m]", ge=0.12, le=0.40)
    upstand_top: float | None = drawn(
        0.06, 0.14, "Depth of the tops of upstands and walkways below top of rail [m]", ge=0.03, le=0.30
    )
    walkway: float | None = drawn(
        0.40,
        0.60,
        "Width of the walkway, with cable trough, behind the upstand [m]; in profile paper the rest of a deck 10 m "
        "wide",
        ge=0.0,
        le=2.5,
    )


@dataclass(frozen=True)
class Tracks:
    """Cross-section of a rail deck; heights count from the rails' top.

    Attributes:
        section: Rails, sleepers and their bed.
        upstand: Width of the upstands [m]; 0 for none.
        upstand_top: Top of upstands and walkways [m], negative.
        walkway: Behind the upstands [m].
    """

    section: TrackSection
    upstand: float
    upstand_top: float
    walkway: float

    @property
    def kerb_face(self) -> float:
        """From the axis to the inner face of the upstands [m]."""
        return self.section.crown + _TOE

    @property
    def half_width(self) -> float:
        """From the axis to the foot of the parapet [m]; never inside the tracks' clearance."""
        return max(self.kerb_face + self.upstand + self.walkway, self.section.lines[-1] + CLEARANCE)

    @property
    def walk_level(self) -> float:
        """Top of the walkways, or of the bare deck where there are none [m]."""
        return self.upstand_top - _LOWER if self.upstand else self.section.formation

    @property
    def surfacing(self) -> float:
        """From the rails' top down to the structural deck [m]."""
        return -self.section.formation


def draw_tracks(settings: TrackSettings, tracks: int, edge: float, draws: Draws) -> Tracks:
    """Draw the cross-section of a rail deck.

    Args:
        settings: Values set by the user.
        tracks: Number of tracks, 1 or 2.
        edge: Width of parapet and ledge on each side [m].
        draws: Random stream and profile of the bridge.

    Raises:
        InputError: The slabs of two tracks overlap.
    """
    paper = draws.profile == "paper"
    bed, material = draw_option(settings, "bed", draws), draw_option(settings, "sleeper", draws)
    material = "concrete" if bed == "slab" else material
    value = {key: draw(settings, key, draws) for key in TrackSettings.model_fields if key not in ("bed", "sleeper")}
    half = 0.5 * value["spacing"]
    section = TrackSection(
        lines=(0.0,) if tracks == 1 else (-half, half),
        gauge=1.4 if paper else GAUGE,  # the generator's rails, 0.1 m wide, are 1.5 m apart
        rail_height=0.200 if paper else 0.172,
        rail_foot=0.100 if paper else 0.150,
        rail_head=0.100 if paper else 0.072,
        bed=bed,
        sleeper=material,
        sleeper_length=value["sleeper_length"],
        sleeper_width=value["sleeper_width"],
        sleeper_height=value["sleeper_height"] if material == "concrete" else 0.16,
        pitch=value["pitch"],
        bed_depth=value["ballast" if bed == "ballast" else "slab"],
        shoulder=value["shoulder" if bed == "ballast" else "slab_shoulder"],
        embedded=value["embedded"],
        plain=paper,
    )
    wide = section.sleeper_length + 2.0 * section.shoulder
    if tracks == 2 and bed == "slab" and value["spacing"] < wide + 0.02:
        raise InputError(
            "the slabs of the two tracks overlap",
            field="bridge.track.spacing",
            value=value["spacing"],
            allowed=f"at least {wide + 0.02:.2f} m",
            hint="Choose a larger spacing, shorter sleepers or a smaller slab_shoulder",
        )
    upstand = 0.0 if paper and settings.upstand is None else value["upstand"]
    if settings.upstand_top is not None and not upstand:
        raise InputError(
            'has no effect with bridge.profile = "paper"',
            field="bridge.track.upstand_top",
            value=settings.upstand_top,
            allowed="with bridge.track.upstand",
            hint="Set bridge.track.upstand, or leave upstand_top out",
        )
    free = Tracks(section, upstand, -value["upstand_top"], value["walkway"])
    if not paper or settings.walkway is not None:
        return free
    walkway = max(round(0.5 * _PAPER_WIDTH - edge - free.kerb_face - upstand, 3), 0.0)
    return Tracks(section, upstand, free.upstand_top, walkway)


def track_parts(tracks: Tracks, spans: Spans, place: Alignment) -> list[Part]:
    """Build the continuous track over the whole bridge: its bed, sleepers and rails.

    Rails are welded: one piece each, between the ends of the site's track.

    Args:
        tracks: Cross-section.
        spans: Stations.
        place: Axis of the bridge.
    """
    low, high = track_range(spans)
    stretches = [(low, high)] if tracks.section.bed == "ballast" else _stretches(spans)
    parts, template = _bed_parts(tracks, spans, place), sleeper_solid(tracks.section)
    for stretch, (begin, end) in enumerate(stretches):
        parts += _sleeper_parts(tracks.section, template, stretch, tracks.section.sleepers(begin, end), place)
    for number, left in enumerate(tracks.section.rails):
        surface = Prism(tracks.section.rail_outline(left), low, high, "station", place)
        size: dict[str, object] = {"length": high - low, "height": tracks.section.rail_height, "track": number // 2}
        parts.append(
            Part(f"Rail_{number // 2:02d}_{number % 2}", "rail", "Role_RailSteel", SUPERSTRUCTURE, surface, size)
        )
    return parts


def track_range(spans: Spans) -> tuple[float, float]:
    """Find where the bridge's track begins and ends, on the approaches [m].

    Args:
        spans: Stations.
    """
    reach = ABUTMENT_BACK + APPROACH_TRACK
    return spans.supports[0] - reach, spans.supports[-1] + reach


def _stretches(spans: Spans) -> list[tuple[float, float]]:
    low, high = track_range(spans)
    stations = [low, *(station for _, station in spans.joints), high]
    return list(pairwise(stations))


def _bed_parts(tracks: Tracks, spans: Spans, place: Alignment) -> list[Part]:
    section, bottom = tracks.section, tracks.section.formation - EMBEDDED
    low, high = track_range(spans)
    if section.bed == "ballast":
        surface = Prism(ballast_outline(tracks), low, high, "station", place)
        size: dict[str, object] = {"length": high - low, "width": 2.0 * tracks.kerb_face, "depth": section.bed_depth}
        return [Part("Ballast_000", "ballast", "Role_Ballast", SUPERSTRUCTURE, surface, size)]
    parts = []
    half, half_gap = 0.5 * section.sleeper_length + section.shoulder, 0.5 * (spans.gap + _SLAB_GAP)
    for number, (begin, end) in enumerate(_stretches(spans)):
        begin, end = begin + (half_gap if number else 0.0), end - (half_gap if end < high else 0.0)
        for track, line in enumerate(section.lines):
            outline = rectangle((line - half, bottom), (line + half, section.bed_top))
            outline = outline if section.plain else cut_corners(outline, np.array([0.0, 0.0, 0.02, 0.02]))
            surface = Prism(outline, begin, end, "station", place)
            size = {"length": end - begin, "width": 2.0 * half, "thickness": section.bed_depth, "track": track}
            name = f"TrackSlab_{number:03d}_{track:02d}"
            parts.append(Part(name, "track_slab", "Role_DeckConcrete", SUPERSTRUCTURE, surface, size))
    return parts if section.plain else parts + _joint_parts(tracks, spans, place)


def _joint_parts(tracks: Tracks, spans: Spans, place: Alignment) -> list[Part]:
    """Build the rubber strips over the deck's gaps between track slabs; under ballast they are hidden."""
    parts = []
    width, formation = spans.gap + 0.04, tracks.section.formation
    for support, station in spans.joints:
        half = tracks.kerb_face + EMBEDDED - 0.001
        outline = rectangle((-half, formation - EMBEDDED - _SHORTER), (half, formation + 0.012))
        surface = Prism(outline, station - 0.5 * width, station + 0.5 * width, "station", place)
        size: dict[str, object] = {"width": width, "length": 2.0 * half}
        name = f"Joint_{support:03d}"
        parts.append(Part(name, "expansion_joint", "Role_BearingRubber", SUPERSTRUCTURE, surface, size))
    return parts


def ballast_outline(tracks: Tracks) -> F64:
    """Draw the ballast between the upstands: level on top, its shoulders falling to the upstands' faces.

    Args:
        tracks: Cross-section.

    Returns:
        Outline (left, above) [m], shape (6, 2), float64.
    """
    section = tracks.section
    crown, side, bottom = section.crown, tracks.kerb_face + _INTO_SIDE, section.formation - EMBEDDED + 0.0015
    edge = section.bed_top - (side - crown) / _TOE_SLOPE
    return np.array(
        [
            (-side, bottom),
            (side, bottom),
            (side, edge),
            (crown, section.bed_top),
            (-crown, section.bed_top),
            (-side, edge),
        ]
    )


def _sleeper_parts(
    section: TrackSection, template: Surface, stretch: int, stations: F64, place: Alignment
) -> list[Part]:
    role = "Role_SleeperTimber" if section.sleeper == "timber" else "Role_KerbConcrete"
    size: dict[str, object] = {
        "length": section.sleeper_length,
        "width": section.sleeper_width,
        "height": section.sleeper_height,
        "embedded_in": "ballast" if section.bed == "ballast" else "track_slab",
    }
    parts = []
    for track, line in enumerate(section.lines):
        frames = frames_along(place, stations, line, section.sleeper_top, upright=False)
        for number, frame in enumerate(frames):
            name = f"Sleeper_{track:02d}_{stretch:03d}_{number:03d}"
            parts.append(Part(name, "sleeper", role, SUPERSTRUCTURE, copied(template, frame), {**size, "track": track}))
    return parts


def sleeper_solid(section: TrackSection) -> Surface:
    """Make one sleeper round the middle of its top between the rails: along, left, up.

    A concrete sleeper is waisted between the rails and bevelled at its ends; a timber sleeper is a rectangular block.
    Both have the fastenings that hold the rails' feet.

    Args:
        section: Cross-section of the track.
    """
    half, width, height = 0.5 * section.sleeper_length, section.sleeper_width, section.sleeper_height
    if section.plain:
        return Prism(rectangle((-0.5 * width, -height), (0.5 * width, 0.0)), -half, half, "left", LOCAL).surface
    if section.sleeper == "timber":
        body = Prism(
            cut_corners(rectangle((-0.5 * width, -height), (0.5 * width, 0.0)), 0.008),
            -half,
            half,
            "left",
            LOCAL,
            0.008,
        ).surface
    else:
        seat = 0.5 * (section.gauge + section.rail_head)
        along = np.array([0.0, 0.06, seat - 0.32, seat - 0.18, seat + 0.18])
        left = np.concatenate([-half + along[:2], [-seat - 0.18, -seat + 0.18, -seat + 0.34]])
        drop = np.array([0.028, 0.010, 0.0, 0.0, 0.018])
        left, drop = np.concatenate([left, -left[::-1]]), np.concatenate([drop, drop[::-1]])
        body = sweep(np.stack([_sleeper_outline(width, height, fall) for fall in drop]), left, "left", LOCAL)
    return joined([body, *_fastenings(section)])


def _sleeper_outline(width: float, height: float, drop: float) -> F64:
    top = 0.5 * width - 0.035 * (height - drop) / height
    return np.array([(-0.5 * width, -height), (0.5 * width, -height), (top, -drop), (-top, -drop)])


def _fastenings(section: TrackSection) -> list[Surface]:
    """Make the clips on both sides of both rails' feet, standing on the sleeper."""
    clips = []
    for rail in (-0.5, 0.5):
        middle = rail * (section.gauge + section.rail_head)
        for side in (-1.0, 1.0):
            near = 0.5 * section.rail_foot + 0.002
            left = sorted((middle + side * near, middle + side * (near + 0.07)))
            clips.append(
                Prism(rectangle((-0.055, -0.004), (0.055, 0.030)), left[0], left[1], "left", LOCAL, 0.006).surface
            )
    return clips


def side_parts(tracks: Tracks, edge: float, name: str, low: float, high: float, place: Alignment) -> list[Part]:
    """Build upstand, walkway and cable trough of both sides over one run; parapets stand on the walkway.

    Args:
        tracks: Cross-section.
        edge: From the axis to the walkway's outer face [m].
        name: Ending of the names, e.g. `000`.
        low: Station where they begin [m].
        high: Station where they end [m].
        place: Axis of the bridge.
    """
    parts = []
    face, back, top = tracks.kerb_face, tracks.kerb_face + tracks.upstand, tracks.upstand_top
    bottom, room = tracks.section.formation - EMBEDDED, tracks.half_width - back
    covers = tuple(float(s) for s in np.arange(low + 1.0, high - 0.5, 1.0))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        if tracks.upstand:
            outline = cut_corners(rectangle((face, bottom), (back, top)), np.array([0.0, 0.0, 0.0, 0.02]))
            surface = Prism(on_side(outline, sign), low, high, "station", place)
            size: dict[str, object] = {"width": back - face, "height": top - bottom - EMBEDDED, "length": high - low}
            parts.append(Part(f"Upstand_{name}_{side}", "kerb", "Role_KerbConcrete", SUPERSTRUCTURE, surface, size))
        if not tracks.upstand:
            continue
        outline = cut_corners(
            rectangle((back - EMBEDDED, bottom - _SHORTER), (edge, tracks.walk_level)), np.array([0.0, 0.02, 0.02, 0.0])
        )
        surface = Prism(on_side(outline, sign), low + _SHORTER, high - _SHORTER, "station", place)
        size = {"width": edge - back, "length": high - low}
        parts.append(Part(f"Walkway_{name}_{side}", "footway", "Role_KerbConcrete", SUPERSTRUCTURE, surface, size))
        if room > 0.34:  # a trough for cables, closed by covers of one meter
            outline = rectangle(
                (back + 0.05, tracks.walk_level - EMBEDDED), (back + 0.05 + 0.28, tracks.walk_level + 0.04)
            )
            surface = Prism(on_side(outline, sign), low + 0.02, high - 0.02, "station", place, 0.006, covers)
            size = {"width": 0.28, "length": high - low}
            parts.append(Part(f"Trough_{name}_{side}", "footway", "Role_KerbConcrete", SUPERSTRUCTURE, surface, size))
    return parts
