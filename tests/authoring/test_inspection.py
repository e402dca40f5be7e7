"""Inspection flights show every member that can be seen, keep clear of everything, and mix with other kinds."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from authoring.families.registry import FAMILIES
from authoring.streams import stream
from authoring.surveys.camera_models import calibration, camera_models
from authoring.surveys.framing import eye_of
from authoring.surveys.free_places import free_places
from authoring.surveys.inspection import fly_inspection
from authoring.surveys.path import CameraPath
from authoring.surveys.registry import plan_survey
from authoring.surveys.settings import AnySurvey, GlobalSettings, GridSettings, InspectionSettings, MixSettings
from authoring.surveys.sight import sight_of
from authoring.surveys.targets import cut_targets
from authoring.surveys.turning import angle_between, pitch_of
from benchmarks.authoring.inspection import VIEWS, Drawn, count_views, draw_bridge, shown_by
from groundwork.errors import InputError
from groundwork.settings import Settings, parse_settings
from tests.authoring.flight_views import visible_pixels
from tests.authoring.test_random_surveys import true_clearance
from tests.conftest import Count, RecordProof


@pytest.fixture(scope="module")
def slab() -> Drawn:
    """Draw the smallest family."""
    return draw_bridge("slab", 104)


MEMBERS = InspectionSettings(kind="inspection", cover="members")


@pytest.fixture(scope="module")
def flown(slab: Drawn) -> CameraPath:
    """Fly to all its members."""
    return plan_survey(MEMBERS, slab.subject, 1)


def bearings_of(drawn: Drawn) -> tuple[int, ...]:
    """The ids of four bearings."""
    return tuple(number for number, name in drawn.classes.items() if name == "bearing")[:4]


SHORT = "slab"  # the one family of which `make test` flies a bridge
EACH = [pytest.param(name, marks=() if name == SHORT else pytest.mark.proof_only) for name in sorted(FAMILIES)]


@pytest.mark.parametrize("family", EACH)
def test_everything_that_can_be_seen_is_seen(
    family: str, slab: Drawn, flown: CameraPath, proof_count: Count, record_proof: RecordProof
) -> None:
    """Every class has three views of 50 pixels of at least 80 % of its instances that any free place can see."""
    bridges = proof_count(1, 5)
    rows, images, hidden, missed, clearances = [], [], [], [], []
    for number in range(sorted(FAMILIES).index(family), 6 * bridges, 6):
        settings, drawn, path = MEMBERS, slab, flown
        if bridges > 1:
            settings = InspectionSettings(kind="inspection", cover="surface")
            drawn = draw_bridge(family, 100 + number)
            path = plan_survey(settings, drawn.subject, number)
        shown = shown_by(drawn, path)
        rows.append(min(shown.by_class.values()))
        images.append(len(path.poses))
        hidden += [f"{number}: {name}" for name in shown.hidden]
        missed += [f"{number}: {name}" for name in shown.missed]
        clearances.append(true_clearance(path.poses[:, :3, 3], drawn.corners, settings.safety + 0.5))
        assert rows[-1] >= 0.8, (number, shown)
        assert clearances[-1] >= settings.safety - 1e-4
    assert len(rows) == bridges
    figures = {
        "least_class_share": min(rows),
        "images": images,
        "hidden": hidden,
        "missed": missed,
        "least_clearance_m": min(clearances),
    }
    record_proof(f"surveys/inspection flights show every class, {family}", bridges, 100, figures)


def test_an_inspection_is_steady_and_obeys_its_gimbal(slab: Drawn) -> None:
    """Within a leg neighbors are 2 m and 20 degrees apart at most; no camera looks up further than asked."""
    settings = MEMBERS.model_copy(update={"pitch_limit": 24.0})
    poses = fly_inspection(settings, slab.subject, stream(3, "survey/inspection"))
    few = settings.model_copy(update={"members": bearings_of(slab)})
    one, again, other = (fly_inspection(few, slab.subject, stream(seed, "survey/inspection")) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one[:5], other[:5])
    assert np.degrees(pitch_of(poses[:, :3, :3])).max() <= 24.0 + 1e-6
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    turns = np.degrees([angle_between(a[:3, :3], b[:3, :3]) for a, b in pairwise(poses)])
    along = steps <= settings.spacing + 1e-3
    assert along.mean() > 0.8  # the rest are jumps between legs
    assert turns[along].max() < 25.0  # 20, and what the gimbal's limit bends


def test_named_members_alone_are_flown(slab: Drawn, flown: CameraPath) -> None:
    """With `members` only these are seen to; every one gets its views, in far fewer images."""
    bearings = bearings_of(slab)
    assert bearings
    some = MEMBERS.model_copy(update={"members": bearings})
    path = plan_survey(some, slab.subject, 1)
    views = count_views(slab, path)
    assert all(views[number] >= VIEWS for number in bearings)
    assert len(path.poses) < 0.6 * len(flown.poses)
    with pytest.raises(InputError, match=r"survey\.members.*60000"):
        plan_survey(MEMBERS.model_copy(update={"members": (60_000,)}), slab.subject, 1)


def test_a_mix_flies_its_legs_in_order(slab: Drawn) -> None:
    """The first legs are those of the same streams; an inspection adds only what is left; one camera holds for all."""
    legs = [{"kind": "global"}, {"kind": "grid", "sampling": 0.02}, {"kind": "inspection", "cover": "members"}]
    mix = parse_settings(MixSettings, {"kind": "mix", "legs": legs, "width": 640}, "test")
    path = plan_survey(mix, slab.subject, 5)
    own = stream(5, "survey/mix").spawn(3)
    grid = plan_survey(GridSettings(kind="grid", sampling=0.02, width=640), slab.subject, 5).poses
    shorter = plan_survey(mix.model_copy(update={"legs": mix.legs[:2]}), slab.subject, 5).poses
    np.testing.assert_array_equal(path.poses[: len(shorter)], shorter)
    np.testing.assert_array_equal(shorter[-len(grid) :], grid)  # a grid draws nothing
    assert len(shorter) - len(grid) >= GlobalSettings().images
    alone = fly_inspection(MEMBERS.model_copy(update={"width": 640}), slab.subject, own[2])
    assert 0 < len(path.poses) - len(shorter) < len(alone)
    assert (path.calibration.width, path.calibration.height) == (640, 480)
    shown = shown_by(slab, path)
    assert min(shown.by_class.values()) >= 0.8, shown


def test_a_leg_names_no_camera_of_its_own() -> None:
    """What is written down applies to the whole flight; the error names the leg and the key."""
    with pytest.raises(InputError, match=r"legs\[0\]\.width applies to the whole flight"):
        parse_settings(MixSettings, {"kind": "mix", "legs": [{"kind": "grid", "width": 640}]}, "test")


def test_a_mix_that_was_written_out_in_full_is_read_again() -> None:
    """As a run hands it to the process that authors the stage: with every default of every leg."""
    legs: list[dict[str, Any]] = [{"kind": kind} for kind in ("global", "local", "grid", "inspection")]
    mix = parse_settings(MixSettings, {"kind": "mix", "legs": legs, "width": 640}, "test")
    assert parse_settings(MixSettings, mix.model_dump(mode="json"), "test") == mix


def test_free_places_equal_a_slow_twin(slab: Drawn) -> None:
    """Block by block as cell by cell: the same free cells, none nearer than is safe, none further than the reach."""
    edge, reach, safety = 1.0, 6.0, 1.0
    places = free_places(slab.subject, edge, reach, safety, 1.0)
    low, high = places.min(axis=0) - 3.0, places.max(axis=0) + 3.0
    axes = _axes(places)
    local = places @ axes.T
    steps = [np.arange(*bounds, edge) for bounds in _spans(local, edge)]
    cells = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3) @ axes
    cells = cells[((cells > low) & (cells < high)).all(axis=1)]
    near = np.round(slab.subject.surface.distance(cells)[0], 2) <= reach
    clear = np.round(slab.subject.clearance(cells), 2) > safety + 0.5 * np.sqrt(3.0) * edge
    ground = slab.subject.ground_height(cells[:, :2])
    free = cells[near & clear & np.isfinite(ground) & (cells[:, 2] > ground + 1.0)]
    found, wanted = ({tuple(row) for row in np.round(part, 3).tolist()} for part in (places, free))
    assert found <= wanted
    assert len(found) > 0.95 * len(wanted)  # the rest is cut off


def _axes(places: np.ndarray) -> np.ndarray:
    """Find the axes of a lattice from its first cells: neighbors along z and across."""
    steps = places[1:400] - places[0]
    length = np.linalg.norm(steps, axis=1)
    flat = steps[(np.abs(steps[:, 2]) < 1e-9) & (np.abs(length - length[np.abs(steps[:, 2]) < 1e-9].min()) < 1e-6)][0]
    across = flat / np.linalg.norm(flat)
    return np.stack([np.cross(across, [0.0, 0.0, 1.0]), across, [0.0, 0.0, 1.0]])


def _spans(local: np.ndarray, edge: float) -> list[tuple[float, float]]:
    """Bounds of a lattice along its axes, a few cells wider than what was found."""
    low, high = local.min(axis=0), local.max(axis=0)
    return [(a - 3.0 * edge, b + 3.5 * edge) for a, b in zip(low, high, strict=True)]


def test_estimated_pixels_are_those_of_the_image(slab: Drawn) -> None:
    """Members' pixels from samples agree with a ray for every fourth pixel; members far from the border within 15 %."""
    path = plan_survey(GlobalSettings(images=24, spacing=20.0), slab.subject, 2)
    targets = cut_targets(slab.subject, 6.0, np.unique(slab.subject.bridge_ids))
    found = sight_of(path.poses, eye_of(path.calibration), targets, 100.0, slab.subject.obstacles).pixels.toarray()
    ids, counts = visible_pixels(path, slab.subject)
    np.testing.assert_array_equal(ids, targets.samples.ids)
    large = counts > 4000
    assert large.sum() > 50
    assert np.median(np.abs(found[large] / counts[large] - 1.0)) < 0.1
    assert abs(float(found.sum() / counts.sum()) - 1.0) < 0.05
    assert found[counts == 0].max() < 500.0


def test_an_eye_frames_local_points_as_world_points() -> None:
    """One rule in both forms."""
    eye = eye_of(calibration(camera_models()["mini_like"], 640), camera_models()["mini_like"].distortion)
    points = np.random.default_rng(0).normal(size=(500, 3)) * 5.0
    pose = np.eye(4)
    pose[:3, 3] = [1.0, -2.0, 0.5]
    np.testing.assert_array_equal(eye.framed(points, pose), eye.framed_local(points - pose[:3, 3]))


class Surveys(Settings):
    """The section of a scenario that holds flights."""

    survey: tuple[AnySurvey, ...]


def test_a_leg_of_no_known_kind_is_told_the_kinds_of_legs() -> None:
    """The error lists what a leg may be, not what a survey may be."""
    survey = [{"kind": "mix", "legs": [{"kind": "stage"}]}]
    with pytest.raises(InputError) as caught:
        parse_settings(Surveys, {"survey": survey}, "test")
    assert "legs" in str(caught.value)
    assert "allowed: global, local, grid, inspection" in str(caught.value)
    assert "inspection, mix" not in str(caught.value)
