"""Levels of detail of background objects that a survey sees only from a distance, chosen once for all of its images.

Photographs, truth, shadows, light and the true surface use the same triangles, in every view and worker. Ground,
buildings and all parts of the bridge are never simplified.
"""

import os
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from render.detail.mesh_decimation import coarser_levels, deviation
from render.detail.soup import Soup
from render.detail.texel_need import Sight, least_distances
from render.gpu.camera import visible_boxes
from render.gpu.gpu_scene import draw_boxes
from usd_schemas.components import BACKGROUND, class_rows
from usd_schemas.flat_scene import ALIKE, CameraTrack, Draws, FlatScene, Geometry
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

KINDS = frozenset(
    ("tree", "shrub", "vegetation", "rock", "vehicle", "vessel", "fence", "pole", "lamp_post", "traffic_sign")
)
# Largest movement of a surface in the nearest image [px], tried in turn while too many triangles are in view.
_ERRORS = (0.0, *(0.5 * 2 ** (step / 2) for step in range(7)))
_WORTH = 1 / 300  # share of the budget: meshes with fewer triangles in all draws are kept
_SMALLEST = 8  # triangles; smaller meshes are drawn unchanged, or not at all


@dataclass(frozen=True)
class _Level:
    """One level of detail of a part.

    Attributes:
        part: Row in the parts, of all levels; -1 for nothing.
        triangles: Their number.
        error: Its largest distance from the authored part [stage units].
    """

    part: int
    triangles: int
    error: float


def level_of_detail(scene: FlatScene, track: CameraTrack, camera: Pinhole, sight: Sight, budget: int) -> FlatScene:
    """Simplify repeated background objects if an image of a survey would contain too many triangles.

    Objects in such images are simplified so that no surface moves by more than half a pixel of the nearest image of the
    survey; if that is not enough, in steps up to 4 pixels.

    Args:
        scene: A scene.
        track: Camera and poses of the survey.
        camera: Intrinsics of its images.
        sight: Positions and resolution of its cameras.
        budget: Largest number of triangles in view; 0: no simplification.

    Returns:
        The scene with further parts, and with draws that use them; objects smaller than the error are left out.
    """
    if not budget:
        return scene
    lower, upper = draw_boxes(scene)
    crowd = _Crowd.find(scene, [visible_boxes(lower, upper, camera, pose) for pose in track.poses], budget)
    if not crowd.views_over(crowd.as_authored, budget):
        return scene
    rows = crowd.rows
    pixels = _pixels(scene, rows, least_distances(lower[rows], upper[rows], sight) * sight.pixel)
    pile = _Pile(scene.geometry)
    counts, parts = np.tile(crowd.as_authored, (len(_ERRORS), 1)), np.tile(scene.draws.part[rows], (len(_ERRORS), 1))
    for part in np.unique(scene.draws.part[rows]):
        members = np.flatnonzero(scene.draws.part[rows] == part)
        if crowd.as_authored[members].sum() < _WORTH * budget:
            continue
        levels = pile.levels(int(part), max(_ERRORS) / pixels[members].min())
        allowed = np.array(_ERRORS)[:, None] / pixels[members]
        choice = np.searchsorted([level.error for level in levels], allowed, side="right") - 1
        counts[:, members] = np.array([level.triangles for level in levels])[choice]
        parts[:, members] = np.array([level.part for level in levels])[choice]
    steps, most = crowd.steps(counts, budget)
    chosen = scene.draws.part.copy()
    chosen[rows] = parts[steps, np.arange(len(rows))]
    line = f"{most:,} triangles in one view, more than triangle_budget: the background is already as simple as possible"
    return replace(
        scene,
        geometry=pile.geometry(),
        draws=_taken(replace(scene.draws, part=chosen), chosen >= 0),
        warnings=scene.warnings if most <= budget else (*scene.warnings, line),
    )


def repeated(scene: FlatScene) -> I64:
    """Find the draws that may be simplified.

    They are of one of `KINDS`, of the class background, of a mesh that is drawn more than once, and not below the prim
    that contains the draws of all other classes: the bridge.

    Args:
        scene: A scene.

    Returns:
        Rows of its draws, shape (N,), int64.
    """
    background = class_rows()[BACKGROUND].name
    others = [row.path for row in scene.instances if row.base_class not in ("", background)]
    bridge = os.path.commonpath(others) if others else ""
    allowed = [
        row.id
        for row in scene.instances
        if row.component in KINDS
        and row.base_class == background
        and not (bridge and f"{row.path}/".startswith(f"{bridge.rstrip('/')}/"))
    ]
    often = np.bincount(scene.draws.part, minlength=1)[scene.draws.part] > 1
    return np.flatnonzero(often & np.isin(scene.draws.instance, allowed))


@dataclass(frozen=True)
class _Crowd:
    """Triangles in the views of a survey.

    Attributes:
        rows: Draws that may be simplified and are in a view that holds too many triangles, shape (N,), int64.
        as_authored: Their triangles, shape (N,), int64.
        inside: Which of `rows` each view shows, shape (M,), int64.
        rest: Triangles of everything else that each view shows.
    """

    rows: I64
    as_authored: I64
    inside: tuple[I64, ...]
    rest: tuple[int, ...]

    @classmethod
    def find(cls, scene: FlatScene, seen: list[I64], budget: int) -> "_Crowd":
        triangles = scene.geometry.part_count[scene.draws.part].astype(np.int64)
        shown = np.zeros(len(triangles), bool)
        for view in seen:
            if triangles[view].sum() > budget:
                shown[view] = True
        may = repeated(scene) if shown.any() else np.zeros(0, np.int64)
        rows = may[shown[may]]
        number = np.full(len(triangles), -1)
        number[rows] = np.arange(len(rows))
        inside = tuple(number[view][number[view] >= 0] for view in seen)
        rest = tuple(int(triangles[view][number[view] < 0].sum()) for view in seen)
        return cls(rows, triangles[rows], inside, rest)

    def views_over(self, counts: I64, budget: int) -> list[I64]:
        """List what may be simplified in each view with too many triangles, given the triangles of `rows`."""
        views = zip(self.rest, self.inside, strict=True)
        return [view for rest, view in views if len(view) and rest + int(counts[view].sum()) > budget]

    def steps(self, counts: I64, budget: int) -> tuple[I64, int]:
        """Choose a step of the errors for each of `rows`; also return the number of triangles in the fullest view."""
        steps, every = np.zeros(len(self.rows), np.int64), np.arange(len(self.rows))
        for step in range(1, len(counts)):
            for view in self.views_over(counts[steps, every], budget):
                steps[view] = step
        chosen = counts[steps, every]
        return steps, max(rest + int(chosen[view].sum()) for rest, view in zip(self.rest, self.inside, strict=True))


def _pixels(scene: FlatScene, rows: I64, pixel: F64) -> F64:
    """Compute the most pixels per unit of each draw's mesh, given the width of a pixel there [m], shape (N,)."""
    return np.linalg.norm(scene.draws.transform[rows, :3, :3], axis=(1, 2), ord=2) / pixel


def _taken(draws: Draws, rows: NDArray[np.bool_]) -> Draws:
    return Draws(draws.part[rows], draws.transform[rows], draws.material[rows], draws.instance[rows], draws.label[rows])


class _Pile:
    """A geometry to which coarser parts are added."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry, self._added = geometry, list[tuple[Soup, int]]()

    def levels(self, part: int, most: float) -> list[_Level]:
        """List a part, its coarser levels up to an error [stage units], and an empty level; errors ascend."""
        source = _soup(self._geometry, part)
        found = [_Level(part, len(source), 0.0)]
        for soup in coarser_levels(source) if len(source) > _SMALLEST else ():
            error = max(deviation(source, soup), found[-1].error)
            if error > most:
                break
            self._added.append((soup, part))
            row = len(self._geometry.part_first) + len(self._added) - 1
            found.append(_Level(row, len(soup), error))
        corners = source.corners.reshape(-1, 3)
        reach = float(np.linalg.norm(np.ptp(corners, axis=0)) / 2) if len(corners) else 0.0
        return [*(level for level in found if level.error < reach), _Level(-1, 0, reach)]

    def geometry(self) -> Geometry:
        """Write all parts into one geometry."""
        old = self._geometry
        vertices, triangles, start = [], [], len(old.positions)
        for soup, _ in self._added:
            records = np.concatenate([soup.corners, soup.normals, soup.carried], axis=2).astype(np.float32)
            single, rows = np.unique(records.reshape(-1, records.shape[2]), axis=0, return_inverse=True)
            vertices.append(single)
            triangles.append(rows.reshape(-1, 3).astype(np.uint32) + np.uint32(start))
            start += len(single)
        if not vertices:
            return old
        new, sizes = np.concatenate(vertices), np.array([len(soup) for soup, _ in self._added], np.int32)
        sides = [ALIKE if soup.alike else old.part_double_sided[part] for soup, part in self._added]
        return Geometry(
            np.concatenate([old.positions, new[:, :3]]),
            np.concatenate([old.normals, new[:, 3:6]]),
            np.concatenate([old.st, new[:, 6:8]]),
            np.concatenate([old.st1, new[:, 8:10]]),
            np.concatenate([old.colors, new[:, 10:13]]),
            np.concatenate([old.triangles, *triangles]),
            np.concatenate([old.part_first, len(old.triangles) + np.cumsum(sizes, dtype=np.int32) - sizes]),
            np.concatenate([old.part_count, sizes]),
            np.concatenate([old.part_double_sided, np.array(sides, np.uint8)]),
        )


def _soup(geometry: Geometry, part: int) -> Soup:
    first, count = int(geometry.part_first[part]), int(geometry.part_count[part])
    corners = geometry.triangles[first : first + count].astype(np.int64)
    carried = np.concatenate([geometry.st[corners], geometry.st1[corners], geometry.colors[corners]], axis=2)
    return Soup(
        geometry.positions[corners].astype(np.float64),
        geometry.normals[corners].astype(np.float64),
        carried.astype(np.float64),
        bool(geometry.part_double_sided[part] == ALIKE),
    )
