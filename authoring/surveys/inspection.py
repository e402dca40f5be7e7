"""Inspection survey: views that show every member of a bridge, and its surface, often enough, in legs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import KDTree

from authoring.surveys.box import oriented_box
from authoring.surveys.camera_models import calibration, camera_models
from authoring.surveys.candidate_views import Candidates, directions, look_round
from authoring.surveys.coverage import Wanted, choose_views
from authoring.surveys.framing import Eye, eye_of
from authoring.surveys.free_places import free_places
from authoring.surveys.legs import fly_legs, order_views
from authoring.surveys.settings import InspectionSettings
from authoring.surveys.sight import Sight, sight_of, visible_samples
from authoring.surveys.subject import Subject
from authoring.surveys.targets import Targets, cut_targets
from groundwork.errors import InputError

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

LATTICE = 2.0  # [m] spacing of the candidate places
STAND_OFF = 1.5  # largest distance of these to the inspected surface, as a multiple of the flight's distance [1]
MARGIN = 1.5  # factor on the required pixels, because samples only estimate them [1]
WELL = 0.5  # share of the best view of a stretch that another one must show [1]
MEMBER = 1000  # value of a missing view of a member, relative to that of a stretch [1]
LOOKED_AT = 3000  # free places checked for a member that the lattice hardly sees
APART = 0.7  # [m] least distance of the places chosen from them


def fly_inspection(
    settings: InspectionSettings, subject: Subject, rng: np.random.Generator, before: F64 | None = None
) -> F64:
    """Choose the views, put them in order, and place images along the legs between them.

    Args:
        settings: Settings of the scenario.
        subject: Bridge and site.
        rng: Stream `survey/<id>`: it shifts the lattice of places and turns the headings.
        before: camera_to_world of images of other flights [m], shape (N, 4, 4), float64.

    Returns:
        camera_to_world of each image [m], shape (N, 4, 4), float64; none if everything has been seen.

    Raises:
        InputError: No such member, no free space, or nothing can be seen from it.
    """
    shift, heading = rng.random(3), float(rng.uniform(0.0, 0.25 * np.pi))
    targets = _targets(settings, subject)
    places = _free_places(settings, subject, shift)
    model = camera_models()[settings.camera]
    eye = eye_of(calibration(model, settings.width, settings.height), model.distortion)
    highest = np.radians(settings.pitch_limit)
    turns = directions(heading, highest)

    def look(at: F64) -> Candidates:
        return look_round(at, turns, eye, targets, settings.reach, subject.obstacles)

    lattice = _lattice(settings, targets, places)
    found = look(lattice)
    more = _places_for(_hardly_seen(settings, found, targets), places, targets, eye, settings, subject)
    if len(more):
        found = look(np.unique(np.concatenate([lattice, more]), axis=0))
    wanted = _wanted(settings, targets, found.sight, _taken(before, eye, targets, settings, subject))
    least = MEMBER if settings.cover == "members" else settings.worth
    chosen = choose_views(wanted, found.poses, found.place, least, settings.images)
    if not len(chosen):
        if before is None:
            raise InputError(
                "no camera in the free space can see any of these members",
                field="survey.members",
                value=list(settings.members) or None,
                hint="Lower survey.safety or survey.pixels, or raise survey.reach",
            )
        return np.zeros((0, 4, 4))
    views = found.poses[chosen]
    axis = oriented_box(subject.bridge.reshape(-1, 3)).axes[0]
    return fly_legs(views, order_views(views, subject, settings.safety, axis), settings.spacing, highest)


def _free_places(settings: InspectionSettings, subject: Subject, shift: F64) -> F64:
    """Find where a camera can be near the bridge [m], shape (P, 3); refuse a bridge without such a place."""
    reach = max(settings.reach, STAND_OFF * settings.near)
    places = free_places(subject, settings.cell, reach, settings.safety, settings.over_ground, shift)
    if not len(places):
        raise InputError(
            "no free space around the bridge",
            field="survey.safety",
            value=settings.safety,
            hint="Lower it or survey.over_ground, or raise survey.reach",
        )
    return places


def _targets(settings: InspectionSettings, subject: Subject) -> Targets:
    known = np.unique(subject.bridge_ids)
    lost = sorted(set(settings.members) - set(known.tolist()))
    if lost:
        raise InputError(
            "no component of the bridge has this id",
            field="survey.members",
            value=lost[0],
            allowed=f"{len(known)} ids from {known[0]} to {known[-1]}",
            hint="falsework scene info SCENE --members lists them",
        )
    return cut_targets(subject, settings.stretch, np.array(settings.members or known, np.int64))


def _lattice(settings: InspectionSettings, targets: Targets, places: F64) -> F64:
    """Keep one free place of each cube of the lattice, near the inspected surface [m], shape (P, 3)."""
    away = np.asarray(KDTree(targets.samples.points).query(places)[0])
    near = places[np.round(away, 2) <= STAND_OFF * settings.near]
    if not len(near):
        return near
    _, first = np.unique(np.floor(np.round(near / LATTICE, 6)), axis=0, return_index=True)
    return near[np.sort(first)]


def _hardly_seen(settings: InspectionSettings, found: Candidates, targets: Targets) -> I64:
    """List the members that fewer places than needed show."""
    count = len(targets.samples.ids)
    shown = _at_least(found.sight.pixels, np.full(count, MARGIN * settings.pixels)).tocoo()
    pairs = np.unique(np.column_stack([found.place[shown.row], shown.col]), axis=0)
    return np.flatnonzero(np.bincount(pairs[:, 1], minlength=count) < settings.views)


def _places_for(
    members: I64, places: F64, targets: Targets, eye: Eye, settings: InspectionSettings, subject: Subject
) -> F64:
    """Find the free places that show members best which the lattice hardly shows [m], shape (P, 3)."""
    tree, best = KDTree(places), [np.zeros((0, 3))]
    for member in members:
        own = np.flatnonzero(targets.samples.component == member)
        sample = targets.samples.points[own]
        around = np.unique(np.concatenate(tree.query_ball_point(sample[:: max(1, len(own) // 12)], settings.reach)))
        rows = around[:: max(1, len(around) // LOOKED_AT)].astype(np.int64)
        pixels = pixels_from(places[rows], member, targets, eye, settings.reach, subject)
        order = rows[np.argsort(-np.round(pixels, 3), kind="stable")][: int((pixels >= settings.pixels).sum())]
        taken: list[F64] = []
        for place in places[order]:
            if all(np.linalg.norm(place - other) >= APART for other in taken):
                taken.append(place)
            if len(taken) >= 2 * settings.views:
                break
        best.append(np.array(taken).reshape(-1, 3))
    return np.concatenate(best)


def pixels_from(places: F64, member: int, targets: Targets, eye: Eye, reach: float, subject: Subject) -> F64:
    """Find how many pixels a member fills in a camera that looks at it from each of some places.

    Args:
        places: Camera centers [m], shape (P, 3), float64.
        member: Row of the member in `targets.samples.ids`.
        targets: Members.
        eye: The camera.
        reach: Greatest distance [m].
        subject: Bridge and site.

    Returns:
        Areas [px], shape (P,), float64.
    """
    own = targets.samples.of(member)
    owners, rows = visible_samples(places, own, reach, subject.obstacles)
    toward = places[owners] - own.points[rows]
    away = np.linalg.norm(toward, axis=1)
    areas = own.areas[rows] * np.sum(toward * own.normals[rows], axis=1) / away**3
    return np.asarray(np.bincount(owners, areas, minlength=len(places)) * eye.camera.fx * eye.camera.fy, np.float64)


@dataclass(frozen=True, eq=False)
class _Taken:
    """Views in images of other flights: of members, and samples of stretches that each image sees."""

    members: I64
    squarely: sparse.csr_matrix


def _taken(
    before: F64 | None, eye: Eye, targets: Targets, settings: InspectionSettings, subject: Subject
) -> _Taken | None:
    if before is None or not len(before):
        return None
    sight = sight_of(before, eye, targets, settings.reach, subject.obstacles)
    return _Taken(_views(sight.pixels, np.full(len(targets.samples.ids), settings.pixels)), sight.squarely)


def _wanted(settings: InspectionSettings, targets: Targets, sight: Sight, taken: _Taken | None) -> Wanted:
    """Find the elements that every view shows: members large enough, and stretches nearly as well as any other view."""
    count = len(targets.samples.ids)
    members = _at_least(sight.pixels, np.full(count, MARGIN * settings.pixels))
    needs = np.full(count, settings.views, np.int64) - (0 if taken is None else taken.members)
    if settings.cover == "members":
        return Wanted(members, needs, np.full(len(needs), MEMBER, np.int64))
    enough = np.maximum(np.ceil(WELL * _most(sight.squarely, len(targets.stretch_member))), 1.0)
    stretches = _at_least(sight.squarely, enough)
    missing = np.full(len(enough), settings.views, np.int64)
    if taken is not None:
        missing -= _views(taken.squarely, enough)
    return Wanted(
        sparse.csr_matrix(sparse.hstack([members, stretches])),
        np.concatenate([needs, missing]),
        np.concatenate([np.full(len(needs), MEMBER, np.int64), np.ones(len(enough), np.int64)]),
    )


def _at_least(counts: sparse.csr_matrix, enough: F64) -> sparse.csr_matrix:
    """Mark the entries of a table that reach the threshold of their column."""
    flat = counts.tocoo()
    kept = flat.data >= enough[flat.col]
    ones = np.ones(int(kept.sum()), np.int64)
    return sparse.csr_matrix((ones, (flat.row[kept], flat.col[kept])), shape=counts.shape)


def _views(counts: sparse.csr_matrix, enough: F64) -> I64:
    return np.bincount(_at_least(counts, enough).tocoo().col, minlength=len(enough))


def _most(counts: sparse.csr_matrix, columns: int) -> F64:
    flat, most = counts.tocoo(), np.zeros(columns)
    np.maximum.at(most, flat.col, flat.data)
    return most
