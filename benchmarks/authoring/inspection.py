"""What a flight shows of a drawn bridge, counted ray by ray, and what any free place could show."""

import time
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import FAMILIES, build_bridge
from authoring.shapes.component import Component
from authoring.site.site import SiteSettings, draw_site
from authoring.streams import stream
from authoring.surveys.free_places import free_places
from authoring.surveys.path import CameraPath
from authoring.surveys.registry import plan_survey
from authoring.surveys.settings import InspectionSettings
from authoring.surveys.subject import Subject, make_subject, piece_corners
from groundwork.settings import parse_settings
from usd_schemas.components import class_of
from usd_schemas.pinhole import unproject

F64 = NDArray[np.float64]

STRIDE = 4  # [px] between the rays of an image; a ray represents STRIDE x STRIDE pixels
PIXELS, VIEWS = 50, 3
FIRST_SEED = 100  # of the first bridge
POINTS = 400  # on a member's surface, at random, that are looked for from free places
EDGE = 0.6  # [m] of the cells of free space that are looked from: another cut than the flight's own
REACH = 10.0  # [m]


@dataclass(frozen=True, eq=False)
class Drawn:
    """A bridge on its site.

    Attributes:
        subject: As surveys see it.
        corners: Every triangle of bridge and site [m], shape (T, 3, 3), float64.
        classes: Class of every instance of the bridge.
    """

    subject: Subject
    corners: F64
    classes: dict[int, str]


def draw_bridge(family: str, seed: int) -> Drawn:
    """Draw a bridge of a family and its site.

    Args:
        family: Family of bridges.
        seed: Seed of both.
    """
    layout, record = draw_layout(parse_settings(BridgeSettings, {"family": family}, "test"), stream(seed, "bridge"))
    site = draw_site(SiteSettings(), layout, stream(seed, "site"))
    bridge = build_bridge(layout, record, site.ground)
    subject = make_subject(bridge, site.pieces)
    classes: dict[int, str] = {}
    for piece in bridge:
        ids = (piece.instance_id,) if isinstance(piece, Component) else piece.instance_ids
        classes.update(dict.fromkeys(ids, class_of(piece.kind)))
    known = {int(number): classes[int(number)] for number in np.unique(subject.bridge_ids)}
    return Drawn(subject, np.concatenate([subject.bridge, piece_corners(site.pieces)[0]]), known)


def can_be_seen(drawn: Drawn, member: int, places: F64, focal: float) -> bool:
    """Check whether a camera at any of some places, looking at a member, would show enough pixels of it.

    Args:
        drawn: Bridge and site.
        member: Instance id of the member.
        places: Camera centers [m], shape (P, 3), float64.
        focal: Focal length [px].
    """
    subject = drawn.subject
    corners = subject.bridge[subject.bridge_ids == member]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    rng = np.random.default_rng(member)
    rows = rng.choice(len(corners), POINTS, p=areas / areas.sum())
    share = rng.dirichlet((1.0, 1.0, 1.0), POINTS)
    points = np.einsum("nk,nkj->nj", share, corners[rows])
    units = normals[rows] / (2.0 * areas[rows])[:, None]
    low, high = points.min(axis=0) - REACH, points.max(axis=0) + REACH
    for place in places[((places > low) & (places < high)).all(axis=1)]:
        toward = place - points
        away = np.linalg.norm(toward, axis=1)
        facing = np.flatnonzero((np.sum(toward * units, axis=1) > 0.0) & (away <= REACH))
        filled = np.sum(toward * units, axis=1)[facing] / away[facing] ** 3 * areas.sum() / POINTS * focal**2
        if filled.sum() < PIXELS:
            continue
        reach, _, _ = subject.obstacles.cast(np.broadcast_to(place, (len(facing), 3)), -toward[facing])
        if filled[reach >= 1.0 - 0.01 / away[facing]].sum() >= PIXELS:
            return True
    return False


def count_views(drawn: Drawn, path: CameraPath) -> dict[int, int]:
    """Count the images in which each instance fills enough pixels.

    Args:
        drawn: Bridge and site.
        path: The flight.

    Returns:
        Instance id to number of images.
    """
    camera, subject = path.calibration, drawn.subject
    grid = np.mgrid[STRIDE // 2 : camera.height : STRIDE, STRIDE // 2 : camera.width : STRIDE][::-1]
    pixels = grid.reshape(2, -1).T.astype(np.float64)
    views = np.zeros(int(subject.obstacle_ids.max()) + 1, np.int64)
    for pose in path.poses:
        directions = unproject(pixels, np.ones(len(pixels)), camera, pose) - pose[:3, 3]
        hit = subject.obstacles.cast(np.broadcast_to(pose[:3, 3], directions.shape), directions)[2]
        views += np.bincount(hit.astype(np.int64), minlength=len(views)) * STRIDE**2 >= PIXELS
    return {number: int(views[number]) for number in drawn.classes}


@dataclass(frozen=True)
class Shown:
    """What a flight shows.

    Attributes:
        by_class: Share of the instances of each class, of those that can be seen, that enough images show [1].
        missed: Instances that can be seen and that too few images show.
        hidden: Instances that no free place shows.
    """

    by_class: dict[str, float]
    missed: tuple[str, ...]
    hidden: tuple[str, ...]


def shown_by(drawn: Drawn, path: CameraPath) -> Shown:
    """Count the images that show each instance by casting a ray every few pixels.

    Args:
        drawn: Bridge and site.
        path: The flight.
    """
    views = count_views(drawn, path)
    few = [number for number in drawn.classes if views[number] < VIEWS]
    places = free_places(drawn.subject, EDGE, REACH, 1.0, 1.0, np.array([0.3, 0.6, 0.1])) if few else np.zeros((0, 3))
    missed = [number for number in few if can_be_seen(drawn, number, places, path.calibration.fx)]
    hidden = sorted(set(few) - set(missed))
    rows: dict[str, list[bool]] = defaultdict(list)
    for number, name in drawn.classes.items():
        if number not in hidden:
            rows[name].append(number not in missed)
    return Shown(
        {name: float(np.mean(found)) for name, found in sorted(rows.items())},
        tuple(f"{drawn.classes[number]} {number}" for number in missed),
        tuple(f"{drawn.classes[number]} {number}" for number in hidden),
    )


def inspection_rows(bridges: int) -> list[str]:
    """Plan inspections of random bridges, the families in turn, and measure what each shows.

    Args:
        bridges: Number of bridges.

    Returns:
        Lines of a Markdown table.
    """
    lines = [
        "| bridge | members | images | seconds | least share of a class with 3 views "
        "| missed | hidden | clearance [m] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    families = sorted(FAMILIES)
    for number in range(bridges):
        family = families[number % len(families)]
        drawn = draw_bridge(family, FIRST_SEED + number)
        begin = time.process_time()
        path = plan_survey(InspectionSettings(kind="inspection"), drawn.subject, number)
        spent = time.process_time() - begin
        shown = shown_by(drawn, path)
        clearance = float(drawn.subject.clearance(path.poses[:, :3, 3]).min())
        lines.append(
            f"| {family} {FIRST_SEED + number} | {len(drawn.classes)} | {len(path.poses)} | {spent:.1f} "
            f"| {min(shown.by_class.values()):.0%} | {', '.join(shown.missed) or 'none'} "
            f"| {', '.join(shown.hidden) or 'none'} | {clearance:.2f} |"
        )
    return lines
