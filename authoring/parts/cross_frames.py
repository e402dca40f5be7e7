"""Connections of steel girders: cross-frames of angles, solid and pierced plates, floor beams, and plan bracing."""

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.frame_shapes import (
    angle_frame,
    beam_frame,
    box_diaphragm,
    floor_beam,
    floor_fillet,
    lateral_bar,
    pierced_plate,
)
from authoring.parts.idle_settings import Use
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.plate_girders import PlateGirders
from authoring.parts.spans import Levels, Spans
from authoring.parts.splices import HALF_LENGTH
from authoring.parts.stiffeners import stiffener_width
from authoring.solids.setting_out import in_one_chart, shifted, to_world
from authoring.solids.sweep import Surface
from groundwork.settings import Settings

_FLOOR_BEAM_PITCH = (3.5, 4.5)  # [m]
_FROM_SPLICE = 0.60  # [m] from a splice's end to the nearest cross-frame
_THICKER = 0.003  # [m] extra thickness of a floor beam's web over the stiffeners at its ends
_BOX_PANELS = 2  # boxes are connected at every second frame


class CrossFrameSettings(Settings):
    """What joins the girders; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("kind", ("plate",), ("plate",)),
        Use("stiffeners", (True,), ("stiffener_pitch",)),
    )
    kind: Literal["x", "k", "solid", "plate"] | None = chosen(
        {"x": 42, "k": 36, "solid": 22},
        "Cross-frames between plate girders. x: crossed angles; k: angles in a K; solid: rolled beams; plate: plates "
        "with four triangular holes. Ladder decks have floor beams instead, and two boxes have plates between them",
        paper={"plate": 1},
    )
    pitch: float | None = drawn(
        5.0, 7.5, "Largest distance between cross-frames [m]", ge=2.5, le=10.0, paper=(5.0, 5.0)
    )
    floor_beam_pitch: float | None = drawn(
        *_FLOOR_BEAM_PITCH, "Largest distance between the floor beams of a ladder deck [m]", ge=2.5, le=6.0
    )
    plate: float | None = drawn(0.4, 0.5, "Thickness of the plates with holes [m]", ge=0.01, le=0.6, paper=(0.5, 0.5))
    laterals: bool | None = chosen(
        {True: 25, False: 75}, "Lateral (plan) bracing in the outer bays of multi-girder decks", paper={False: 1}
    )
    stiffeners: bool | None = chosen({True: 1}, "Stiffeners on the webs", paper={False: 1})
    stiffener_pitch: float | None = drawn(
        1.0, 1.5, "Largest distance between stiffeners over the girder depth [1]", ge=0.4, le=3.0
    )
    stiffener: float | None = drawn(0.012, 0.020, "Thickness of the stiffeners [m]", ge=0.008, le=0.04)


@dataclass(frozen=True)
class CrossFrames:
    """The connections between the girders of a bridge.

    Attributes:
        kind: `x`, `k`, `solid` or `plate`.
        pitch: Largest distance between cross-frames or floor beams [m].
        plate: Thickness of pierced plates [m].
        laterals: Whether the outer bays are braced in plan.
        stiffeners: Whether webs are stiffened.
        stiffener_pitch: Largest distance between stiffeners over the depth [1].
        stiffener: Thickness of stiffeners [m].
    """

    kind: str
    pitch: float
    plate: float
    laterals: bool
    stiffeners: bool
    stiffener_pitch: float
    stiffener: float


def draw_cross_frames(settings: CrossFrameSettings, girders: PlateGirders, draws: Draws) -> CrossFrames:
    """Draw the connections between the girders.

    Args:
        settings: Values set by the user.
        girders: The girders.
        draws: Random stream and profile of the bridge.
    """
    paper = draws.profile == "paper"
    kind, braced = draw_option(settings, "kind", draws), draw_option(settings, "laterals", draws)
    pitch, floor_pitch = draw(settings, "pitch", draws), draw(settings, "floor_beam_pitch", draws)
    return CrossFrames(
        kind=kind,
        pitch=floor_pitch if girders.arrangement == "ladder" else pitch,
        plate=draw(settings, "plate", draws),
        laterals=braced and girders.arrangement == "multi",
        stiffeners=not paper if settings.stiffeners is None else settings.stiffeners,
        stiffener_pitch=draw(settings, "stiffener_pitch", draws),
        stiffener=draw(settings, "stiffener", draws),
    )


def frame_stations(frames: CrossFrames, spans: Spans, cuts: tuple[float, ...]) -> tuple[float, ...]:
    """List the stations of the cross-frames: at every row of bearings and evenly between, away from splices [m].

    Args:
        frames: Their pitch.
        spans: Stations.
        cuts: Field splices, rising [m].
    """
    found: set[float] = set()
    for span in range(spans.count):
        low, high = spans.bearing_lines(span)
        found.update(np.round(np.linspace(low, high, int(np.ceil((high - low) / frames.pitch - 1e-9)) + 1), 3).tolist())
    clear, moved = HALF_LENGTH + _FROM_SPLICE, []
    for station in sorted(found):
        near = [cut for cut in cuts if abs(station - cut) < clear]
        moved.append(round(near[0] + np.copysign(clear, station - near[0]), 3) if near else station)
    return tuple(moved)


def cross_frame_parts(
    frames: CrossFrames,
    girders: PlateGirders,
    spans: Spans,
    stations: tuple[float, ...],
    levels: Levels,
    place: Alignment,
) -> list[Part]:
    """Build the cross-frames, one part for each bay and station, and the bracing in plan, one for each panel.

    Args:
        frames: The drawn record.
        girders: The girders.
        spans: Stations.
        stations: Stations of the cross-frames, rising [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    if girders.box:
        rows = {round(station, 3) for _, _, station in spans.rows}
        stations = tuple(s for k, s in enumerate(stations) if s in rows or k % _BOX_PANELS == 0)
    depths = np.round(girders.depths(spans, np.array(stations)), 3)
    made: dict[tuple[float, float], Surface] = {}
    surfaces, facts = [], []
    kind = {"ladder": "floor_beam", "box": "box_plate"}.get(girders.arrangement, frames.kind)
    for number, (station, depth) in enumerate(zip(stations, depths, strict=True)):
        for bay, (left, right) in enumerate(pairwise(girders.lines)):
            key = (float(depth), round(right - left, 4))
            if key not in made:
                made[key] = in_one_chart(_frame(kind, frames, girders, *key))
            surfaces.append(shifted(made[key], np.array([station, left, girders.steel_top(levels)])))
            facts.append(
                (
                    f"{number:03d}_{bay:02d}",
                    {"type": kind, "length": float(np.ptp(made[key].points[:, 1])), "station": station},
                )
            )
    component, title = ("floor_beam", "FloorBeam") if kind == "floor_beam" else ("cross_frame", "CrossFrame")
    return [
        Part(f"{title}_{where}", component, "Role_GirderSteel", SUPERSTRUCTURE, surface, fact)
        for (where, fact), surface in zip(facts, to_world(surfaces, place), strict=True)
    ] + _lateral_parts(frames, girders, spans, stations, levels, place)


def floor_fillet_parts(
    girders: PlateGirders, spans: Spans, stations: tuple[float, ...], levels: Levels, place: Alignment
) -> list[Part]:
    """Build the concrete between floor beams and slab, one part for each piece of deck.

    Args:
        girders: The main girders.
        spans: Stations.
        stations: Of the floor beams, rising [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    if girders.arrangement != "ladder":
        return []
    surfaces = []
    for low, high in spans.pieces:
        inside = np.array([station for station in stations if low < station < high])
        surfaces.append(shifted(floor_fillet(girders, inside), np.array([0.0, 0.0, levels.soffit])))
    return [
        Part(f"FloorFillet_{k:03d}", "deck_slab", "Role_DeckConcrete", SUPERSTRUCTURE, surface, {"piece": k})
        for k, surface in enumerate(to_world([in_one_chart(surface) for surface in surfaces], place))
    ]


def _frame(kind: str, frames: CrossFrames, girders: PlateGirders, depth: float, width: float) -> Surface:
    """Build one frame from the line on its right, heights counted from the top of the steel."""
    if kind == "box_plate":
        return box_diaphragm(girders, depth, width)
    if kind == "floor_beam":
        arm = stiffener_width(girders) if frames.stiffeners else 0.0
        return floor_beam(girders, width, arm, frames.stiffener + _THICKER)
    if kind == "plate":
        return pierced_plate(girders, depth, width, frames.plate)
    arm, face = stiffener_width(girders), 0.5 * frames.stiffener
    if kind == "solid":
        return beam_frame(girders, depth, width, arm, face)
    return angle_frame(kind, girders, depth, width, arm, face)


def _lateral_parts(
    frames: CrossFrames,
    girders: PlateGirders,
    spans: Spans,
    stations: tuple[float, ...],
    levels: Levels,
    place: Alignment,
) -> list[Part]:
    if not frames.laterals:
        return []
    surfaces, names = [], []
    bays = sorted({0, len(girders.lines) - 2})
    above = girders.steel_top(levels)
    made: dict[tuple[object, ...], Surface] = {}
    for span in range(spans.count):
        low, high = spans.bearing_lines(span)
        points = [s for s in stations if low - 0.01 < s < high + 0.01]
        for panel, ends in enumerate(pairwise(points)):
            depth = girders.depths(spans, np.array(ends))
            for bay in bays:
                lefts = np.array(girders.lines[bay : bay + 2])
                falling = (panel % 2 == 1) != (lefts.sum() > 0.0)  # outer bays are symmetric about the axis
                size = (ends[1] - ends[0], lefts[1] - lefts[0])
                key = (*np.round([*size, *depth], 9).tolist(), falling)
                if key not in made:
                    made[key] = in_one_chart(lateral_bar(girders, size, depth, falling=falling))
                surfaces.append(shifted(made[key], np.array([ends[0], lefts[0], above])))
                names.append(f"Lateral_{span:03d}_{panel:02d}_{bay:02d}")
    return [
        Part(name, "cross_frame", "Role_GirderSteel", SUPERSTRUCTURE, surface, {"type": "lateral"})
        for name, surface in zip(names, to_world(surfaces, place), strict=True)
    ]
