"""The mapper: images that few matches tie to the others, and growth that bends the model or hangs loose."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray

from groundwork.canonical import folder_digest
from groundwork.progress import SILENT, Progress, Silent
from recon.settings import SparseSettings
from recon.sfm import growth, mapping
from recon.sfm.colmap_model import read_model
from recon.sfm.database import DATABASE
from recon.sfm.growth import MOST_MOVED, grow, shift
from recon.sfm.runaways import leave_out, runaways
from render.capture import CalibrationPrior, Capture, CaptureImage
from usd_schemas.pinhole import look_at

F64 = NDArray[np.float64]
FOCAL, SIZE = 1280.0, (1024, 768)  # [px], as pycolmap's synthetic camera has it
ROW, AWAY = 7, 4  # images along a wall, and images far from it that see all of it
ALONE = 20  # points that the last two of these alone see


class Heard(Silent):
    """A listener that keeps what it hears."""

    def __init__(self) -> None:
        """Hear nothing yet."""
        self.stages: list[str] = []
        self.notes: list[str] = []

    def stage(self, name: str, total: int) -> None:
        """Keep the name of a stage."""
        self.stages.append(name)

    def note(self, message: str) -> None:
        """Keep a line."""
        self.notes.append(message)


def wall(folder: Path, shared: int, bow: float, *, gps: bool = True) -> Capture:
    """Write a database of images along a wall and of images far from it.

    Args:
        folder: Receives the database.
        shared: Points that each far image sees; COLMAP registers none with fewer than 30.
        bow: How far off their keypoints are at both ends of the wall [px].
        gps: Whether each image has a fix, 0.5 m off along each axis.
    """
    rng = np.random.default_rng(0)
    along = [look_at(np.array([x, 0.0, rng.normal()]), np.array([3.6 + 0.4 * x, 10.0, 0.0])) for x in range(0, 13, 2)]
    far = [look_at(np.array([x, -18.0, rng.normal()]), np.array([6.0, 10.0, 0.0])) for x in (3, 5, 7, 9)]
    poses, points = np.stack([*along, *far]), rng.uniform((-4, 7, -3), (16, 13, 3), (600, 3))
    local = np.einsum("iba,inb->ina", poses[:, :3, :3], points - poses[:, None, :3, 3])
    pixels = FOCAL * local[..., :2] / local[..., 2:] + np.array(SIZE) / 2 + rng.normal(0, 0.4, (ROW + AWAY, 600, 2))
    seen = ((pixels > 0) & (pixels < SIZE)).all(axis=2)
    held = rng.random(600) < 0.3
    seen[2:ROW, ~held] = False  # a hundred matches for the first pair, fewer than that afterwards
    among = np.flatnonzero(held & (points[:, 0] > 0) & (points[:, 0] < 12) & seen[ROW:].all(axis=0))
    seen[ROW:] &= np.isin(np.arange(600), rng.choice(among, shared, replace=False))
    alone = np.flatnonzero(~seen.any(axis=0) & (abs(points[:, 0] - 6) < 7))[:ALONE]
    seen[-2:, alone] = True
    pixels[ROW:, :, 1] += bow * ((points[:, 0] - 6) / 6) ** 2
    return write_matches(folder, pixels, seen, poses[:, :3, 3] + rng.normal(0, 0.5, (ROW + AWAY, 3)) if gps else None)


def write_matches(folder: Path, pixels: F64, seen: NDArray[np.bool_], places: F64 | None = None) -> Capture:
    """Write keypoints [px], shape (I, N, 2), where they are seen, shape (I, N), matches of all pairs, and GPS [m]."""
    pycolmap.set_random_seed(1)
    folder.mkdir(exist_ok=True)
    frames = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=len(pixels), num_points3D=20
    )
    with pycolmap.Database.open(folder / DATABASE) as database:
        pycolmap.synthesize_dataset(frames, database)
        database.clear_keypoints()
        database.clear_matches()
        database.clear_two_view_geometries()
        images = sorted(database.read_all_images(), key=lambda image: image.image_id)
        number = np.cumsum(seen, axis=1) - 1
        for i, image in enumerate(images):
            database.write_keypoints(image.image_id, pixels[i][seen[i]].astype(np.float32))
            for j, other in enumerate(images[:i]):
                both = np.flatnonzero(seen[i] & seen[j])
                geometry = pycolmap.TwoViewGeometry()
                geometry.config = int(pycolmap.TwoViewGeometryConfiguration.CALIBRATED)
                geometry.inlier_matches = np.column_stack([number[j][both], number[i][both]]).astype(np.uint32)
                if len(both):
                    database.write_matches(other.image_id, image.image_id, geometry.inlier_matches)
                    database.write_two_view_geometry(other.image_id, image.image_id, geometry)
    prior = CalibrationPrior(focal_px=FOCAL, cx=SIZE[0] / 2, cy=SIZE[1] / 2)
    fixes = [None] * len(images) if places is None else [(float(x), float(y), float(z)) for x, y, z in places]
    rows = tuple(CaptureImage(name=row.name, file=row.name, gps=fix) for row, fix in zip(images, fixes, strict=True))
    return Capture(folder, "s", SIZE, prior, (1.0, 1.0, 1.0), {"kind": "local"}, rows)


def map_into(capture: Capture, folder: Path, heard: Progress = SILENT) -> dict[str, Any]:
    """Map a capture from the database in its folder."""
    folder.mkdir()
    return mapping.map_images(capture, capture.folder, folder, SparseSettings(), 0, heard)


def test_the_model_grows_over_few_matches(tmp_path: Path) -> None:
    """Images that 28 points tie to a model of seven are in it, twice the same, and points of two views come back."""
    capture, heard = wall(tmp_path / "few", 28, 0.0), Heard()
    found = map_into(capture, tmp_path / "once", heard)
    model = read_model(tmp_path / "once" / mapping.MODEL)
    assert found["models"] == [{"images": ROW + AWAY, "points": len(model.points)}]
    assert found["elsewhere"] == []
    facts = found["growth"]
    assert (facts["added"], facts["loose"]) == (AWAY, 0)
    assert 0.0 < facts["moved"] < 0.1 * MOST_MOVED
    assert heard.notes == [f"images added with fewer matches: {ROW} of {ROW + AWAY} images became {ROW + AWAY}"]
    others = np.bincount(model.obs_point[model.obs_image < ROW + AWAY - 2], minlength=len(model.points))
    assert (others == 0).sum() == ALONE
    assert map_into(capture, tmp_path / "twice") == found
    assert folder_digest(tmp_path / "twice" / mapping.MODEL) == folder_digest(tmp_path / "once" / mapping.MODEL)


def test_a_model_of_all_images_is_left_alone(tmp_path: Path) -> None:
    """Where COLMAP's own limit registers every image, its model is only adjusted, byte for byte; nothing is told."""
    capture, heard = wall(tmp_path / "many", 40, 0.0), Heard()
    found = map_into(capture, tmp_path / "model", heard)
    assert found["models"][0]["images"] == ROW + AWAY
    assert "growth" not in found
    assert heard.stages == ["tie points", "mapping", "last adjustment"]
    options = pycolmap.IncrementalPipelineOptions(random_seed=0, min_model_size=3, num_threads=1)
    options.mapper.num_threads = 1
    options.mapper.random_seed = options.triangulation.random_seed = 0
    options.mapper.filter_min_tri_angle = options.triangulation.min_angle = SparseSettings().min_triangulation_angle
    options.triangulation.ignore_two_view_tracks = False
    for folder in ("first", "alone"):
        (tmp_path / folder).mkdir()
    alone = pycolmap.incremental_mapping(capture.folder / DATABASE, capture.folder, tmp_path / "first", options)[0]
    mapping.adjust_robustly(alone, 1)
    alone.write_binary(tmp_path / "alone")
    assert folder_digest(tmp_path / "alone") == folder_digest(tmp_path / "model" / mapping.MODEL)


def test_images_that_hang_loose_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where wrong matches register images and leave them too few points, the model stays byte for byte what it was."""
    capture = wall(tmp_path / "wrong", 28, 40.0)
    found = map_into(capture, tmp_path / "model")
    assert found["growth"] == {"added": 0, "misplaced": 0, "loose": AWAY, "moved": 0.0}
    assert found["models"][0]["images"] == ROW
    monkeypatch.setattr(growth, "FEW_INLIERS", 30)  # COLMAP's own
    assert map_into(capture, tmp_path / "as_colmap")["growth"] == {"added": 0, "misplaced": 0, "loose": 0, "moved": 0.0}
    assert folder_digest(tmp_path / "as_colmap" / mapping.MODEL) == folder_digest(tmp_path / "model" / mapping.MODEL)


@pytest.mark.parametrize("bend", [0.0, 0.006])
def test_growth_that_moves_the_model_is_refused(bend: float, tmp_path: Path) -> None:
    """Growth whose matches unbend a model of the row is not taken: the very model comes back."""
    capture = wall(tmp_path / "few", 28, 0.0)
    options = pycolmap.IncrementalPipelineOptions(random_seed=0, num_threads=1)
    (tmp_path / "first").mkdir()
    model = pycolmap.incremental_mapping(capture.folder / DATABASE, capture.folder, tmp_path / "first", options)[0]
    assert model.num_reg_images() == ROW
    straight = pycolmap.Reconstruction(model)
    _bend(model, bend)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    fixes = {image.file: image.gps for image in capture.images if image.gps is not None}
    grown, facts = grow(model, capture.folder / DATABASE, capture.folder, scratch, options, fixes)
    if bend:
        assert grown is model
        assert facts["added"] == 0
        assert facts["moved"] == pytest.approx(shift(straight, model), rel=0.3)
        assert facts["moved"] > MOST_MOVED
    else:
        assert grown.num_reg_images() == ROW + AWAY
        assert facts["added"] == AWAY


def test_images_of_a_look_alike_are_left_out(tmp_path: Path) -> None:
    """Sound matches, but fixes 30 m away: the images show another wall that looks the same, and leave again."""
    capture, heard = wall(tmp_path / "few", 28, 0.0), Heard()
    away = {image.name for image in capture.images[ROW:]}
    rows = tuple(
        image.model_copy(update={"gps": (image.gps[0] + 30.0, *image.gps[1:])}) if image.name in away else image
        for image in capture.images
        if image.gps is not None
    )
    found = map_into(replace(capture, images=rows), tmp_path / "model", heard)
    assert found["models"][0]["images"] == ROW
    assert (found["growth"]["added"], found["growth"]["misplaced"]) == (0, AWAY)
    assert heard.notes == [f"images added with fewer matches: {AWAY} removed again, because GPS does not confirm them"]


def test_without_gps_few_matches_register_nothing(tmp_path: Path) -> None:
    """Few points do not distinguish look-alikes, and here nothing else does."""
    found = map_into(wall(tmp_path / "few", 28, 0.0, gps=False), tmp_path / "model")
    assert found["models"][0]["images"] == ROW
    assert "growth" not in found


def test_what_hung_loose_may_come_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An image that left after one round of growth is registered again by those that stayed."""
    capture, rounds, find = wall(tmp_path / "few", 28, 0.0), list[int](), growth.loose_images

    def last_at_first(grown: pycolmap.Reconstruction, known: set[int]) -> list[int]:
        rounds.append(len(known))
        return find(grown, known) if len(rounds) > 1 else [max(grown.reg_image_ids())]

    monkeypatch.setattr(growth, "loose_images", last_at_first)
    found = map_into(capture, tmp_path / "model")
    assert rounds == [ROW, ROW + AWAY - 1]
    assert (found["growth"]["added"], found["growth"]["loose"]) == (AWAY, 0)


def test_a_few_cameras_may_be_put_right() -> None:
    """Of forty cameras two may move as far as they like; with a third one the model has moved."""
    pycolmap.set_random_seed(3)
    model = pycolmap.synthesize_dataset(
        pycolmap.SyntheticDatasetOptions(num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=40, num_points3D=20)
    )
    moved = pycolmap.Reconstruction(model)
    for number, wrong in ((1, False), (2, False), (3, True)):
        _move(moved, number, moved.image(number).projection_center() + np.array([0.0, 5.0 + number, 0.0]))
        assert (shift(model, moved) > MOST_MOVED) == wrong


def _bend(model: pycolmap.Reconstruction, share: float) -> None:
    """Push what lies at both ends of a row of cameras aside, by a share of the row's length there."""
    numbers = sorted(model.reg_image_ids())
    centers = {number: model.image(number).projection_center() for number in numbers}
    row = centers[numbers[-1]] - centers[numbers[0]]
    middle, length = (centers[numbers[-1]] + centers[numbers[0]]) / 2, float(np.linalg.norm(row))
    aside = np.cross(row, [0.0, 0.0, 1.0]) / length

    def push(place: F64) -> F64:
        return place + share * length * (2 * float((place - middle) @ row) / length**2) ** 2 * aside

    for number in numbers:
        frame = model.frame(model.image(number).frame_id)
        pose = frame.rig_from_world
        assert pose is not None
        frame.rig_from_world = pycolmap.Rigid3d(pose.rotation, -pose.rotation.matrix() @ push(centers[number]))
    for point in model.points3D.values():
        point.xyz = push(point.xyz)


def test_a_camera_that_ran_away_leaves_the_model(tmp_path: Path) -> None:
    """4,000 km away: it goes, with what it alone saw, and no other does; a camera ten times as far as most stays."""
    capture = wall(tmp_path / "many", 40, 0.0)
    map_into(capture, tmp_path / "model")
    model = pycolmap.Reconstruction(tmp_path / "model" / mapping.MODEL)
    last = max(model.reg_image_ids())
    centers = np.array([model.image(number).projection_center() for number in sorted(model.reg_image_ids())])
    spread = np.ptp(centers, axis=0).max()
    for reach, found in ((10.0, []), (1e6, [last])):
        _move(model, last, np.median(centers, axis=0) + reach * spread * np.eye(3)[0])
        assert runaways(model) == found
    points = model.num_points3D()
    for number in range(2, last):  # a tripod, and one camera a step beside it
        _move(model, number, centers[0] + 1e-9 * number)
    _move(model, last, centers[0] + 0.1 * spread)
    assert runaways(model) == []
    leave_out(model, [last])
    assert sorted(model.reg_image_ids()) == list(range(1, ROW + AWAY))
    assert model.num_points3D() < points
    assert min(point.track.length() for point in model.points3D.values()) >= 2
    assert runaways(model) == []
    assert runaways(pycolmap.Reconstruction()) == []


def test_the_model_that_is_kept_has_no_runaways(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that an adjustment sends away is named, adjusted without, and not told as one of another model."""
    capture, heard, calls = wall(tmp_path / "many", 40, 0.0), Heard(), [0]
    adjust = mapping.adjust_robustly

    def send_away(model: pycolmap.Reconstruction, threads: int) -> None:
        calls[0] += 1
        if calls[0] == 1:
            _move(model, max(model.reg_image_ids()), np.array([4e6, 0.0, 0.0]))
        else:
            adjust(model, threads)

    monkeypatch.setattr(mapping, "adjust_robustly", send_away)
    found = map_into(capture, tmp_path / "model", heard)
    assert found["models"][0]["images"] == ROW + AWAY - 1
    assert found["elsewhere"] == []
    assert calls == [2]
    assert heard.notes == [f"left out, because their cameras are far away from all others: {capture.images[-1].name}"]


def test_runaways_do_not_hide_what_growth_bends(tmp_path: Path) -> None:
    """A camera that had run away makes no other distance small; two cameras cannot be bent; one of four is found."""
    map_into(wall(tmp_path / "many", 40, 0.0), tmp_path / "model")
    before, after = (pycolmap.Reconstruction(tmp_path / "model" / mapping.MODEL) for _ in range(2))
    numbers = sorted(before.reg_image_ids())
    _move(after, numbers[1], after.image(numbers[1]).projection_center() + np.eye(3)[0])
    bent = shift(before, after)
    for model in (before, after):
        _move(model, numbers[-1], np.array([4e6, 0.0, 0.0]))
    assert shift(before, after) > 0.5 * bent > MOST_MOVED
    leave_out(before, numbers[4:])
    _move(before, numbers[3], np.array([4e6, 0.0, 0.0]))
    assert runaways(before) == [numbers[3]]
    leave_out(before, numbers[2:4])
    assert shift(before, after) == 0.0


def _move(model: pycolmap.Reconstruction, number: int, center: F64) -> None:
    """Put the camera of an image elsewhere; it looks where it looked."""
    pose = model.image(number).cam_from_world()
    moved = pycolmap.Rigid3d(pose.rotation, -(pose.rotation.matrix() @ center))
    model.frame(model.image(number).frame_id).set_cam_from_world(model.image(number).camera_id, moved)
