"""Moving prims of a stage, at the time of each image."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from usd_schemas.flat_scene import CameraTrack, Draws, InstanceRow
from usd_schemas.reading.cameras import image_codes
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.flat_geometry import Flattened, flatten
from usd_schemas.reading.labels import Warn
from usd_schemas.reading.placements import Placement, find_placements
from usd_schemas.reading.traversal import EARLIEST
from usd_schemas.taxonomies import Taxonomy

F64 = NDArray[np.float64]

MOST_PLACED = 2_000_000  # placements over all moments; each takes about 0.1 ms to read
MOST_POINTS = 40_000_000  # vertices of deforming meshes, over all moments; 44 bytes each


@dataclass(frozen=True)
class Moving:
    """A stage at every time at which an image is taken.

    Attributes:
        flat: Everything that is drawn at the first moment.
        moments: Moving prims at each moment; empty for a static stage.
        cameras: The cameras, with the moment of each of their images.
    """

    flat: Flattened
    moments: tuple[Draws, ...]
    cameras: tuple[CameraTrack, ...]


def flatten_moments(
    stage: Usd.Stage,
    cameras: tuple[CameraTrack, ...],
    choices: StageChoices,
    table: Taxonomy,
    stage_to_world: F64,
    warn: Warn,
) -> Moving | None:
    """Read everything that is drawn: static prims once, moving prims at the time of each image.

    Args:
        stage: Composed stage.
        cameras: Its cameras.
        choices: What the user chose.
        table: Class table in force.
        stage_to_world: Stage units to meters with z up [m per stage unit], shape (4, 4), float64.
        warn: Called with one line for each thing that could not be read as authored.

    Returns:
        None where nothing is drawn at the first moment.
    """
    first = Usd.TimeCode(choices.frames[0]) if choices.frames else EARLIEST
    placed = find_placements(stage, warn, first, choices.purposes)
    if not placed.moving:
        flat = flatten([placed.found], stage_to_world, table, choices.subdivision, warn) if placed.found else None
        return Moving(flat, (), cameras) if flat is not None and len(flat.draws.part) else None
    taken = [image_codes(stage, camera, choices.frames) for camera in cameras]
    codes = {code.GetValue(): code for one in taken for code in one} or {first.GetValue(): first}
    times = sorted(codes)
    still = [placement for placement in placed.found if not placement.moves]
    if _is_too_much(placed.found, len(times)):
        warn(f"too many moving parts for {len(times)} images: all show the time of the first")
        times = times[:1]
    moved = [_moved(stage, codes[time], choices, warn) for time in times]
    flat = flatten([still, *moved], stage_to_world, table, choices.subdivision, warn)
    moments = tuple(_rows(flat.draws, begin, end) for begin, end in zip(flat.ends[:-1], flat.ends[1:], strict=True))
    whole = _rows(flat.draws, 0, flat.ends[1])
    if not len(whole.part):
        return None
    _tell(taken, len({placement.prim.GetPath() for run in moved for placement in run}), warn)
    rows = {time: number for number, time in enumerate(times)}
    numbered = tuple(
        replace(camera, moments=tuple(rows.get(code.GetValue(), 0) for code in one))
        for camera, one in zip(cameras, taken, strict=True)
    )
    instances = _marked(flat.instances, moments)
    return Moving(replace(flat, draws=whole, instances=instances), moments, numbered)


def _moved(stage: Usd.Stage, time: Usd.TimeCode, choices: StageChoices, warn: Warn) -> list[Placement]:
    return [one for one in find_placements(stage, warn, time, choices.purposes).found if one.moves]


def _is_too_much(placements: Iterable[Placement], times: int) -> bool:
    moving = [placement for placement in placements if placement.moves]
    deforming = {one.prim.GetPath(): one for one in moving if one.deforms and one.prim.IsA(UsdGeom.PointBased)}
    points = sum(len(UsdGeom.PointBased(one.prim).GetPointsAttr().Get(one.time) or ()) for one in deforming.values())
    return len(moving) * times > MOST_PLACED or points * times > MOST_POINTS


def _rows(draws: Draws, begin: int, end: int) -> Draws:
    return Draws(**{name: values[begin:end] for name, values in vars(draws).items()})


def _tell(taken: list[list[Usd.TimeCode]], parts: int, warn: Warn) -> None:
    if max((len(codes) for codes in taken), default=1) > 1:
        warn(f"{parts} parts move: each image shows its own time; the indirect light is that of the first")
    else:
        warn(f"{parts} parts move: drawn at the time of the one image; --frame FIRST:LAST renders more")


def _marked(rows: tuple[InstanceRow, ...], moments: tuple[Draws, ...]) -> tuple[InstanceRow, ...]:
    """Mark the ids of prims that differ from the first moment at any other."""
    forms: dict[int, set[bytes]] = {}
    for draws in moments:
        for number in np.unique(draws.instance).tolist():
            mine = draws.instance == number
            form = draws.part[mine].tobytes() + draws.transform[mine].tobytes()
            forms.setdefault(number, set()).add(form)
    everywhere = {number for number in forms if all((draws.instance == number).any() for draws in moments)}
    moving = {number for number, known in forms.items() if len(known) > 1 or number not in everywhere}
    return tuple(replace(row, moves=True) if row.id in moving else row for row in rows)
