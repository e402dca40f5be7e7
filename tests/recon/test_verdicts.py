"""Degenerate flights get the right verdict, and every camera a reason code."""

import re
from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray

from groundwork.canonical import folder_digest
from groundwork.errors import RejectedSceneError
from groundwork.files import write_json
from groundwork.progress import SILENT
from recon.placing.align import CENTER_OUTLIER, OK, ROTATION_OUTLIER, UNREGISTERED
from recon.placing.place import Registered, alignment_facts, place
from recon.settings import AlignmentSettings, ReconSettings, SparseSettings
from recon.sfm.colmap_model import read_model
from recon.sfm.database import DATABASE
from recon.sfm.mapping import MODEL, adjust_robustly, choose_mapper, map_images
from recon.sfm.sparse import NO_OVERLAP, NO_TEXTURE, NOT_IN_LARGEST, absent_reasons, run_sparse
from render.capture import CalibrationPrior, Capture, CaptureImage, Truth, read_capture
from tests.recon.conftest import write_capture
from usd_schemas.pinhole import Pinhole, look_at

F64 = NDArray[np.float64]
MADE = ("incremental", "global")


def capture_of(names: list[str], folder: Path = Path(), gps: F64 | None = None) -> Capture:
    """Describe photographs that need not be there."""
    places = [None] * len(names) if gps is None else [(float(x), float(y), float(z)) for x, y, z in gps]
    images = tuple(CaptureImage(name=n, file=n, gps=place) for n, place in zip(names, places, strict=True))
    prior = CalibrationPrior(focal_px=1280.0, cx=512.0, cy=384.0)
    return Capture(folder, "s", (1024, 768), prior, (1.0, 1.0, 1.0), {"kind": "local"}, images)


def truth_of(poses: F64) -> Truth:
    """Describe a truth of which only the poses are looked at."""
    camera = Pinhole(1024, 768, 1280.0, 1280.0, 512.0, 384.0)
    return Truth(Path(), camera, tuple(f"{row}.jpg" for row in range(len(poses))), poses, (), ())


class Heard:
    """A listener that keeps the stages and how far each came."""

    def __init__(self) -> None:
        self.stages: dict[str, tuple[int, list[int]]] = {}

    def stage(self, name: str, total: int) -> None:
        """Open a stage."""
        self.stages[name] = (total, [])

    def advance(self, done: int) -> None:
        """Keep a step of the last stage."""
        list(self.stages.values())[-1][1].append(done)

    def note(self, message: str) -> None:
        """Ignore a line."""


def two_worlds(folder: Path) -> tuple[Capture, dict[str, F64]]:
    """Write a database of two synthetic scenes of seven and four images that share nothing; tell the true poses."""
    parts, true = [], {}
    for name, frames, seed in (("one", 7, 1), ("two", 4, 2)):
        pycolmap.set_random_seed(seed)
        options = pycolmap.SyntheticDatasetOptions(num_rigs=1, num_frames_per_rig=frames, num_points3D=150)
        part = pycolmap.Database.open(folder / f"{name}.db")
        known = folder / f"{name}_known"
        known.mkdir()
        pycolmap.synthesize_dataset(options, part).write_binary(known)
        model = read_model(known)
        true |= {f"{name}_{file}": pose for file, pose in zip(model.names, model.poses, strict=True)}
        for image in part.read_all_images():
            image.name = f"{name}_{image.name}"
            part.update_image(image)
        parts.append(part)
    with pycolmap.Database.open(folder / DATABASE) as whole:
        pycolmap.Database.merge(parts[0], parts[1], whole)
        names = sorted(image.name for image in whole.read_all_images())
    for part in parts:
        part.close()
    return capture_of(names, folder), true


@pytest.mark.parametrize("mapper", MADE)
def test_of_two_models_the_largest_is_kept(mapper: str, tmp_path: Path) -> None:
    """The larger of two worlds becomes the model, twice the same and as it was; the cameras of the other say so."""
    capture, true = two_worlds(tmp_path)
    settings = SparseSettings.model_validate({"mapper": mapper})
    found = map_images(capture, tmp_path, tmp_path, settings, 0, SILENT)
    assert found["mapper"] == mapper
    assert found["models"] == [{"images": 7, "points": 150}, {"images": 4, "points": 150}]
    again = tmp_path / "again"
    again.mkdir()
    heard = Heard()
    assert map_images(capture, tmp_path, again, settings, 0, heard) == found
    total, steps = next(heard.stages[name] for name in heard.stages if name.startswith("mapping"))
    assert (total, steps[-1]) == (11, 11) if mapper == "incremental" else steps
    assert folder_digest(again / MODEL) == folder_digest(tmp_path / MODEL)
    model = read_model(tmp_path / MODEL)
    assert len(model.names) == 7
    assert all(name.startswith("one") for name in model.names)
    assert model.camera_params == pytest.approx((1280.0, 512.0, 384.0, 0.05), rel=1e-3)
    reasons = absent_reasons(capture, [100] * 11, [True] * 11, found["elsewhere"])
    assert reasons == {image.file: NOT_IN_LARGEST for image in capture.images if image.file.startswith("two")}
    rows = np.arange(7)
    truth = truth_of(np.stack([true[image.file] for image in capture.images]))
    alignment, _ = place(
        Registered(model.poses, rows, reasons), capture, truth, AlignmentSettings(), np.random.default_rng(0)
    )
    assert alignment.status == (OK,) * 7 + (NOT_IN_LARGEST,) * 4  # 36 % are invalid: the scene passes
    assert np.nanmax(alignment.center_errors) < 1e-5
    assert np.nanmax(alignment.rotation_errors) < 1e-4


def test_wrong_matches_hardly_pull_at_the_cameras() -> None:
    """With every thirtieth keypoint off by pixels, the last adjustment brings the cameras back, bit for bit twice."""
    pycolmap.set_random_seed(4)
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=8, num_points3D=300
    )
    true = pycolmap.synthesize_dataset(options)
    places = {number: image.projection_center() for number, image in true.images.items()}
    extent = np.linalg.norm(np.ptp(list(places.values()), axis=0))
    rng = np.random.default_rng(2)
    for image in true.images.values():
        for row, keypoint in enumerate(image.points2D):
            keypoint.xy += rng.normal(0, 0.1, 2) + (rng.normal(3.0, 1.0, 2) if row % 30 == 0 else 0.0)

    def off(model: pycolmap.Reconstruction) -> float:
        centers = np.array([model.images[number].projection_center() for number in sorted(places)])
        wanted = np.array([places[number] for number in sorted(places)])
        found = pycolmap.estimate_sim3d(centers, wanted)
        assert found is not None
        moved = centers @ found.rotation.matrix().T * found.scale + found.translation
        return float(np.median(np.linalg.norm(moved - wanted, axis=1)) / extent)

    squares, robust, again = (pycolmap.Reconstruction(true) for _ in range(3))
    pycolmap.bundle_adjustment(squares, pycolmap.BundleAdjustmentOptions(print_summary=False))
    for model in (robust, again):
        adjust_robustly(model, 1)
    assert off(robust) < 0.35 * off(squares)
    assert all((robust.points3D[n].xyz == again.points3D[n].xyz).all() for n in robust.points3D)


def test_the_mapper_is_chosen() -> None:
    """By the number of images, unless it is named, or the focal length is a guess that the global one cannot bear."""
    named = SparseSettings(mapper="global")
    edge = SparseSettings(global_from=100)
    assert [choose_mapper(capture_of(["a"] * n), edge) for n in (99, 100)] == ["incremental", "global"]
    assert choose_mapper(capture_of(["a"]), named) == "global"
    capture = capture_of(["a"] * 100)
    guessed = Capture(**{**vars(capture), "facts": {"focal": "guessed"}})
    assert choose_mapper(guessed, edge) == "incremental"
    assert choose_mapper(capture, edge.model_copy(update={"use_gps_in_mapping": True})) == "incremental"


def test_the_page_explains_every_reason() -> None:
    """Each reason code that the code can give, for a camera or for all of them, stands on the page."""
    root = Path(__file__).resolve().parents[2]
    code = "".join(path.read_text(encoding="utf-8") for path in sorted((root / "recon").rglob("*.py")))
    given = set(re.findall(r'RejectedSceneError\(\s*"(\w+)"', code))
    assert {"too_few_images", "no_model", "no_depth", "straight_path"} <= given
    page = (root / "docs" / "reconstruction.md").read_text(encoding="utf-8")
    cameras = {OK, UNREGISTERED, CENTER_OUTLIER, ROTATION_OUTLIER, NO_TEXTURE, NO_OVERLAP, NOT_IN_LARGEST}
    assert [reason for reason in sorted(given | cameras) if f"`{reason}`" not in page] == []


def test_every_absent_camera_has_a_reason() -> None:
    """In another model, without keypoints, without a partner, or refused by the mapper: each says which."""
    capture = capture_of(["0.jpg", "1.jpg", "2.jpg", "3.jpg", "4.jpg", "5.jpg", "6.jpg", "7.jpg"])
    reasons = absent_reasons(
        capture, [900, 900, 900, 900, 3, 900, 900, 0], [True] * 4 + [True, False, True, False], ["3.jpg"]
    )
    assert reasons == {"3.jpg": NOT_IN_LARGEST, "4.jpg": NO_TEXTURE, "5.jpg": NO_OVERLAP, "7.jpg": NO_TEXTURE}
    poses = np.stack([look_at(np.array(eye), np.array([0.0, 9.0, 1.0])) for eye in np.eye(3) * 4])
    alignment, target = place(
        Registered(poses, np.arange(3), reasons), capture, None, AlignmentSettings(), np.random.default_rng(0)
    )
    assert target.kind == "none"
    assert alignment.status == (OK, OK, OK, NOT_IN_LARGEST, NO_TEXTURE, NO_OVERLAP, UNREGISTERED, NO_TEXTURE)


def flown(rng: np.random.Generator, centers: F64) -> tuple[F64, F64]:
    """Make true poses at given centers, and the same poses in model units with a millimeter of error."""
    true = np.stack([look_at(eye, eye + rng.normal([0.0, 4.0, 0.0], [1.0, 0.0, 1.0])) for eye in centers])
    turn = look_at(np.array([3.0, 1.0, -2.0]), np.zeros(3))[:3, :3]
    model = true.copy()
    model[:, :3, :3] = turn @ true[:, :3, :3]
    model[:, :3, 3] = (true[:, :3, 3] + rng.normal(0, 1e-3, (len(true), 3))) @ turn.T / 2.5
    return true, model


@pytest.mark.parametrize(("wrong", "verdict"), [(0, ""), (4, ""), (5, "too_few_cameras"), (10, "alignment_failed")])
def test_the_paper_rule_over_all_images(wrong: int, verdict: str) -> None:
    """Of ten images 40 % may be wrong, half may not, and with all of them astray there is nothing to align."""
    rng = np.random.default_rng(wrong)
    true, model = flown(rng, rng.normal(0, 6, (10, 3)))
    model[:wrong, :3, 3] += rng.normal(0, 3, (wrong, 3))
    capture = capture_of([f"{row}.jpg" for row in range(10)])

    def judge() -> tuple[str, ...]:
        draw = np.random.default_rng(0)
        return place(Registered(model, np.arange(10)), capture, truth_of(true), AlignmentSettings(), draw)[0].status

    if not verdict:
        assert judge() == (CENTER_OUTLIER,) * wrong + (OK,) * (10 - wrong)
        return
    with pytest.raises(RejectedSceneError) as rejected:
        judge()
    assert rejected.value.reason == verdict


def test_a_straight_flight_is_placed_by_its_rotations() -> None:
    """On a line, points beside it come out right to centimeters by rotations; the paper's way is refused."""
    rng = np.random.default_rng(4)
    true, model = flown(rng, np.linspace([0.0, 0.0, 3.0], [30.0, 0.0, 3.0], 40))
    capture = capture_of([f"{row}.jpg" for row in range(40)])
    draw = np.random.default_rng(0)
    alignment, target = place(Registered(model, np.arange(40)), capture, truth_of(true), AlignmentSettings(), draw)
    back = alignment.similarity
    aside = np.array([[15.0, 8.0, 0.0]])
    local = (aside @ (model[0, :3, :3] @ true[0, :3, :3].T).T) / 2.5
    assert np.linalg.norm(back.move(local) - aside) < 0.02
    values = alignment_facts(alignment, target, capture)["singular_values"]
    assert values[0] == pytest.approx(np.linalg.norm(np.linspace(-15, 15, 40)))
    assert values[1] < 1e-9
    with pytest.raises(RejectedSceneError) as rejected:
        place(Registered(model, np.arange(40)), capture, truth_of(true), AlignmentSettings(method="paper"), draw)
    assert rejected.value.reason == "straight_path"


def test_positions_that_do_not_fit_leave_photographs_in_their_own_units() -> None:
    """GPS from another flight, or all in one place: no rejection of photographs, but no meters either."""
    rng = np.random.default_rng(6)
    _, model = flown(rng, rng.normal(0, 6, (10, 3)))
    for gps in (rng.normal(0, 900, (10, 3)), np.zeros((10, 3))):
        capture = capture_of([f"{row}.jpg" for row in range(10)], gps=gps)
        found, target = place(
            Registered(model, np.arange(10)), capture, None, AlignmentSettings(), np.random.default_rng(0)
        )
        assert target.kind == "none"
        assert alignment_facts(found, target, capture)["unit"] == "unknown"


FOCAL = 220.0  # [px]


def noise(rng: np.random.Generator, height: int, width: int) -> NDArray[np.float32]:
    """Mix gray noise with plenty of keypoints, shape (height, width), float32."""
    fine = cv2.GaussianBlur(rng.normal(size=(height, width)).astype(np.float32), (0, 0), 1.5)
    return np.clip(128 + 40 * fine / fine.std(), 0, 255).astype(np.float32)


def shots(kind: str, rng: np.random.Generator) -> list[NDArray[np.float32]]:
    """Take four small photographs of one kind of hopeless flight."""
    specks = rng.normal(0, 1.5, (4, 180, 240)).astype(np.float32)
    if kind == "turning":
        lens, scene = np.array([[FOCAL, 0, 120], [0, FOCAL, 90], [0, 0, 1]]), noise(rng, 400, 700)
        views = []
        for angle in (-0.3, -0.1, 0.1, 0.3):
            turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
            shift = np.array([[1.0, 0, 230], [0, 1, 110], [0, 0, 1]])
            onto = shift @ lens @ turn @ np.linalg.inv(lens)
            view = cv2.warpPerspective(scene, onto, (240, 180), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
            views.append(view.astype(np.float32))
        return views
    if kind == "sky":
        return [np.linspace(200, 235, 180, dtype=np.float32)[:, None] + sensor for sensor in specks]
    if kind == "bare walls":
        return [np.full((180, 240), 128, np.float32)] * 4
    if kind == "different worlds":
        return [noise(rng, 180, 240) for _ in range(4)]
    return [noise(rng, 180, 240)] * 2


@pytest.mark.usefixtures("no_children")
@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("turning", "no_model"),
        ("sky", "no_texture"),
        ("bare walls", "no_texture"),
        ("different worlds", "no_overlap"),
        ("two photographs", "too_few_images"),
    ],
)
def test_hopeless_flights_have_reasons(kind: str, reason: str, tmp_path: Path) -> None:
    """A camera that only turns, noise in the sky, bare walls, nothing in common, too few: a reason, and no crash."""
    folder, work = tmp_path / "photographs", tmp_path / "work"
    folder.mkdir()
    work.mkdir()
    for row, gray in enumerate(shots(kind, np.random.default_rng(1))):
        cv2.imwrite(str(folder / f"{row}.png"), cv2.merge([np.clip(gray, 0, 255).astype(np.uint8)] * 3))
    images = [{"name": path.stem, "file": path.name} for path in sorted(folder.iterdir())]
    prior = {"focal_px": FOCAL, "cx": 120.0, "cy": 90.0}
    head = {"format": "falsework.capture", "format_version": 1, "survey": "s", "size": [240, 180]}
    write_json(folder / "cameras.json", {**head, "prior": prior, "images": images})
    settings = ReconSettings(sparse=SparseSettings(max_features=600))
    with pytest.raises(RejectedSceneError) as rejected:
        run_sparse(read_capture(folder), work, settings, SILENT)
    assert rejected.value.reason == reason


@pytest.mark.usefixtures("no_children")
def test_a_walk_straight_ahead_has_a_model(tmp_path: Path) -> None:
    """Six views, each half a meter nearer to the wall: COLMAP alone finds no two of them to begin with."""
    heard = Heard()
    poses = np.stack(
        [look_at(np.array([0.02 * row, -9.0 + 0.52 * row, 1.8]), np.array([0.0, 50.0, 1.8])) for row in range(6)]
    )
    capture = read_capture(write_capture(tmp_path / "capture", poses))
    model = run_sparse(capture, tmp_path, ReconSettings(sparse=SparseSettings(max_features=1000)), heard).model
    assert "mapping, from forward-looking views" in heard.stages
    assert len(model.names) == 6
    steps = np.diff(model.poses[np.argsort(model.names), :3, 3], axis=0)
    np.testing.assert_allclose(
        steps / np.linalg.norm(steps, axis=1, keepdims=True) @ steps[0] / np.linalg.norm(steps[0]), 1.0, atol=1e-3
    )
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), np.linalg.norm(steps, axis=1).mean(), rtol=0.03)
