"""The dense step on the three planes, whose depths are known: accuracy, truth kept apart, sameness, and resuming."""

import resource
import shutil
import tracemalloc
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray

from benchmarks.recon.completeness import count_cameras, measure_completeness, visible_surface
from groundwork.canonical import folder_digest
from groundwork.errors import OutOfSpaceError, RejectedSceneError
from groundwork.progress import SILENT, Silent
from recon.cloud import Cloud, read_cloud
from recon.dense import dense_child
from recon.dense.dense import run_dense
from recon.dense.depth_sgm import PosedImage
from recon.dense.pixel_fates import PIXEL_FATES, PixelFates
from recon.dense.points import DensePoints, read_points
from recon.dense.undistort import working_camera
from recon.reconstruct import reconstruct
from recon.settings import DenseSettings, ReconSettings
from recon.sfm.colmap_model import read_model
from recon.sfm.sparse import Sparse
from recon.truth.pixel_classes import describe_pixels
from render.capture import Truth, read_capture, read_truth
from tests.conftest import Count
from tests.recon.conftest import in_larger_pixels, in_this_process, poses_on_arc, write_capture
from usd_schemas.pinhole import Pinhole

LARGER = Pinhole(480, 360, 420.0, 420.0, 240.0, 180.0)
SETTINGS = ReconSettings(mode="dense", quality="high", dense=DenseSettings(sources=3))


@pytest.fixture(scope="module")
def sparse(plane_cloud: Path, tmp_path_factory: pytest.TempPathFactory) -> Sparse:
    """Give structure from motion's model of the planes, which the sparse tests made anyway, in larger pixels."""
    folder = in_larger_pixels(plane_cloud / "sparse", tmp_path_factory.mktemp("larger"), LARGER)
    return Sparse(read_model(folder), folder, "planes", {}, {"made": "before"})


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the capture of the planes in larger photographs."""
    return write_capture(tmp_path_factory.mktemp("shot") / "capture", poses_on_arc(10), camera=LARGER)


@pytest.fixture(scope="module")
def bare(shot: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the capture without its truth."""
    folder = tmp_path_factory.mktemp("bare") / "capture"
    shutil.copytree(shot, folder, ignore=shutil.ignore_patterns("truth"))
    return folder


@pytest.fixture(scope="module")
def truth(shot: Path) -> Truth:
    """Open the truth of the planes."""
    found = read_truth(read_capture(shot))
    assert found is not None
    return found


@pytest.fixture(scope="module")
def dense_cloud(shot: Path, sparse: Sparse, tmp_path_factory: pytest.TempPathFactory) -> Cloud:
    """Reconstruct the planes densely, from the model that is there."""
    folder = tmp_path_factory.mktemp("dense")
    with pytest.MonkeyPatch.context() as patch, in_this_process():
        patch.setattr("recon.reconstruct.run_sparse", lambda *_: sparse)
        reconstruct(shot, folder, SETTINGS, SILENT)
    return read_cloud(folder)


def test_the_planes_are_covered(dense_cloud: Cloud, truth: Truth) -> None:
    """Points on nearly all that three cameras see, millimeters off, with the right labels and hardly any in the sky."""
    samples, _ = visible_surface(truth, 15.0, 3)
    columns, figures = dense_cloud.columns, dense_cloud.statistics
    seen, poses = dense_cloud.observations, truth.poses  # near enough to measure depths with
    point = np.repeat(np.arange(len(dense_cloud)), np.diff(seen["start"]))
    away = columns["coord"][point] - poses[seen["image"], :3, 3]
    depth = np.einsum("mi,mi->m", away, poses[seen["image"], :3, 2])
    nearest = np.minimum.reduceat(depth, seen["start"][:-1])
    found = measure_completeness(columns["coord"], columns["surface_distance"], nearest, samples, 0.05, 15.0)
    assert len(samples) > 3000
    assert found.share > 0.75
    assert found.median < 0.01
    assert figures["right_class_share"] > 0.975
    assert figures["right_class_share_margin_3px"] > 0.985
    assert figures["within_0.1m_share"] > 0.95
    assert np.isinf(columns["uncertainty"]).mean() < 0.01
    assert figures["noise"]["by_distance"][1]["points"] > 1000
    assert figures["dense"]["points"] == len(dense_cloud)
    wall = columns["surface_class"] == 1
    facing = columns["normal"][wall & (columns["surface_distance"] < 0.02)] @ [0.0, -1.0, 0.0]
    assert np.median(facing) > 0.99


@pytest.fixture(scope="module")
def without_truth(
    bare: Path, sparse: Sparse, tmp_path_factory: pytest.TempPathFactory
) -> tuple[DensePoints, PixelFates, dict[str, Any]]:
    """Make the dense points of the capture without its truth, by three threads."""
    settings = SETTINGS.model_copy(update={"dense": DenseSettings(sources=3, threads=3)})
    return run_dense(read_capture(bare), sparse, tmp_path_factory.mktemp("step"), settings, SILENT)


def test_without_truth_the_points_are_the_same(
    without_truth: tuple[DensePoints, PixelFates, dict[str, Any]], dense_cloud: Cloud
) -> None:
    """Deleting truth/ leaves every dense point as it was, byte for byte, with another number of threads, too."""
    points, _, facts = without_truth
    assert facts == dense_cloud.statistics["dense"]
    assert len(points.points) == len(dense_cloud)


def test_every_pixel_is_counted_once(
    without_truth: tuple[DensePoints, PixelFates, dict[str, Any]], truth: Truth, dense_cloud: Cloud
) -> None:
    """One image's fates by class are those of a loop over its pixels; all images' sums are the pixels they have."""
    _, fates, _ = without_truth
    rows = np.arange(len(fates.model.names))
    found = describe_pixels(fates, rows, rows == 4, truth, truth.classes)
    fate, label, photograph = fates.of(4), truth.semantic(4), fates.camera.photograph
    names = {row.id: row.name for row in truth.classes}
    expected: dict[str, dict[str, int]] = {}
    inside = 0
    for i, j in np.ndindex(fate.shape):
        x, y = np.floor(fates.camera.to_photograph(np.array([j + 0.5, i + 0.5]))).astype(int).tolist()
        if 0 <= x < photograph.width and 0 <= y < photograph.height:
            counts = expected.setdefault(names[int(label[y, x])], dict.fromkeys(PIXEL_FATES, 0))
            counts[PIXEL_FATES[fate[i, j]]] += 1
            inside += 1
    assert found == expected
    assert len(found) >= 3
    every = dense_cloud.statistics["pixels"]
    assert every == describe_pixels(fates, rows, rows >= 0, truth, truth.classes)
    assert sum(sum(row.values()) for row in every.values()) == inside * len(rows)
    unknown = describe_pixels(fates, rows, rows >= 0, None, truth.classes)
    sums = {fate: sum(row[fate] for row in every.values()) for fate in PIXEL_FATES}
    assert unknown == {"unlabelled": sums}


def test_an_image_outside_the_model_leaves_the_others_their_pixels(
    shot: Path, sparse: Sparse, truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_children: None
) -> None:
    """One photograph between the others has no pose: pixels are counted by what the registered photographs show."""
    model, folder, outside = pycolmap.Reconstruction(sparse.folder), tmp_path / "given", "images/000003.jpg"
    model.deregister_frame(*(image.frame_id for image in model.images.values() if image.name == outside))
    for place in (folder, tmp_path / "cloud"):
        place.mkdir()
    model.write_binary(folder)
    made = Sparse(read_model(folder), folder, "without one", {outside: "no_texture"}, {"made": "before"})
    monkeypatch.setattr("recon.reconstruct.run_sparse", lambda *_: made)
    reconstruct(shot, tmp_path / "cloud", SETTINGS.model_copy(update={"quality": "low"}), SILENT)
    cloud = read_cloud(tmp_path / "cloud")
    assert [camera["status"] for camera in cloud.cameras] == ["ok"] * 3 + ["no_texture"] + ["ok"] * 6
    labels = np.concatenate([truth.semantic(row).ravel() for row in range(10) if row != 3])
    shown = {row.name: float((labels == row.id).mean()) for row in truth.classes if (labels == row.id).any()}
    pixels = {name: sum(row.values()) for name, row in cloud.statistics["pixels"].items()}
    found = {name: count / sum(pixels.values()) for name, count in pixels.items()}
    assert found == pytest.approx(shown, abs=0.01)


def test_pixels_in_points_are_those_that_points_show(
    without_truth: tuple[DensePoints, PixelFates, dict[str, Any]], truth: Truth, dense_cloud: Cloud
) -> None:
    """Points are seen where pixels are part of one, and nowhere else, within the pixel that averaging moves them."""
    points, fates, _ = without_truth
    camera = fates.camera
    photograph = camera.photograph
    rays = (points.uv.astype(np.float64) - [photograph.cx, photograph.cy]) / [photograph.fx, photograph.fy]
    shown = camera.distortion.undistort(rays)
    pixel = np.floor(shown * [camera.pinhole.fx, camera.pinhole.fy] + [camera.pinhole.cx, camera.pinhole.cy])
    column, row = np.clip(pixel.astype(int), 0, [camera.pinhole.width - 1, camera.pinhole.height - 1]).T
    around = np.ones((3, 3), np.uint8)
    places = fates.in_photograph().clip(0, [photograph.width - 1, photograph.height - 1])
    counts = np.zeros(256, int)
    for image in range(len(fates.model.names)):
        mine = points.image == image
        used = fates.of(image) == PIXEL_FATES.index("in_points")
        seen = np.zeros_like(used)
        seen[row[mine], column[mine]] = True
        assert cv2.dilate(used.astype(np.uint8), around)[seen].all()
        assert cv2.dilate(seen.astype(np.uint8), around)[used].all()
        counts += np.bincount(truth.semantic(image)[places[seen, 1], places[seen, 0]], minlength=256)
    told = dense_cloud.statistics["pixels"]
    shown_of = {one.name: counts[one.id] for one in truth.classes if counts[one.id]}
    assert {name: row["in_points"] for name, row in told.items()} == pytest.approx(shown_of, rel=0.03)


def test_the_step_needs_no_more_room_than_it_asks_for(
    without_truth: tuple[DensePoints, PixelFates, dict[str, Any]],
    bare: Path,
    sparse: Sparse,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What it has on the disk at most, and would have if every pixel were in a point, stays below what it asks for."""
    _, fates, _ = without_truth
    asked = list[int]()
    monkeypatch.setattr("recon.dense.dense.check_space", lambda _folder, needed, _what: asked.append(needed))
    monkeypatch.setattr("recon.dense.dense.run_child", lambda *_request, **_limits: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run_dense(read_capture(bare), sparse, tmp_path, SETTINGS, SILENT)
    every = np.stack([fates.of(row) for row in range(len(fates.model.names))])
    points, left = (
        sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        for folder in (fates.folder / "points", fates.folder)
    )
    cleared = (3 + 4 + 2) * every.size  # images, depths and marks
    used = float((every == PIXEL_FATES.index("in_points")).mean())
    most = left - points + points / used + cleared
    assert left + cleared < asked[0]
    assert 0.5 * asked[0] < most < asked[0]


def test_filters_and_qualities_are_steps(bare: Path, sparse: Sparse, tmp_path: Path, proof_count: Count) -> None:
    """Each stronger filter leaves fewer points, and each better quality finds more."""
    qualities = ("low", "medium", "high", "ultra")[: proof_count(2, 4)]
    ways = [("low", name) for name in ("none", "mild", "moderate", "aggressive")] + [(q, "moderate") for q in qualities]
    found = dict[tuple[str, str], int]()
    for quality, name in dict.fromkeys(ways):
        folder = tmp_path / f"{quality}-{name}"
        folder.mkdir()
        settings = SETTINGS.model_dump() | {"quality": quality, "filter": name}
        dense_child.serve(
            {"capture": str(bare), "model": str(sparse.folder), "out": str(folder), "settings": settings}, SILENT
        )
        found[quality, name] = len(read_points(folder).points)
    counts = [found[way] for way in ways]
    assert counts[:4] == sorted(set(counts[:4]), reverse=True)
    assert all(finer > 2 * coarse for coarse, finer in pairwise(counts[4:]))


@dataclass
class Stop(Silent):
    """A listener that breaks off while depths are measured."""

    name: str = ""

    def stage(self, name: str, total: int) -> None:
        """Remember the stage."""
        self.name = name

    def advance(self, done: int) -> None:
        """Break off."""
        if self.name == "depth" and done == 4:
            raise KeyboardInterrupt


def test_an_interrupted_step_goes_on(
    bare: Path, sparse: Sparse, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Depth maps that are there are not measured again, and points and fates are those of a run in one go."""
    settings = SETTINGS.model_copy(update={"quality": "low"})
    calls = done = 0
    measure = dense_child.measure_depth

    def count(*arguments: object) -> object:
        nonlocal calls
        calls += 1
        return measure(*arguments)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(dense_child, "measure_depth", count)
    results = []
    for name in ("undisturbed", "interrupted"):
        calls = 0
        folder = tmp_path / name
        folder.mkdir()
        request = {
            "capture": str(bare),
            "model": str(sparse.folder),
            "out": str(folder),
            "settings": settings.model_dump(),
        }
        if name == "interrupted":
            with pytest.raises(KeyboardInterrupt):
                dense_child.serve(request, Stop())
            done, calls = calls, 0
            assert 4 <= done < 10
        dense_child.serve(request, SILENT)
        assert calls == (10 if name == "undisturbed" else 10 - done)
        results.append((folder_digest(folder / "points"), folder_digest(folder / "fates")))
    assert results[0] == results[1]
    assert len(read_points(tmp_path / "interrupted").points) > 100


def test_patchmatch_compares_views_ahead_too(
    bare: Path, sparse: Sparse, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It needs no rectified pair: where semi-global matching has no source at all, it has its three."""
    counts = []

    def count(reference: PosedImage, others: Sequence[PosedImage], *_rest: object) -> NDArray[np.float32]:
        counts.append(len(others))
        return np.zeros(reference.gray.shape, np.float32)

    monkeypatch.setattr("recon.dense.neighbors.rectify", lambda *_pair: None)
    monkeypatch.setattr(dense_child, "measure_slanted", count)
    monkeypatch.setattr(dense_child, "measure_depth", count)
    for method, expected in (("patchmatch", 3), ("sgm", 0)):
        settings = SETTINGS.model_dump() | {"quality": "low", "dense": {"method": method, "sources": 3}}
        folder = tmp_path / method
        folder.mkdir()
        counts.clear()
        with pytest.raises(RejectedSceneError):
            dense_child.serve(
                {"capture": str(bare), "model": str(sparse.folder), "out": str(folder), "settings": settings}, SILENT
            )
        assert max(counts) == expected


def test_marks_of_many_images_take_no_memory(tmp_path: Path, sparse: Sparse, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand maps take the memory of one, and a mark is kept while another image's map is in memory."""
    model = replace(sparse.model, names=("a",) * 1000, poses=np.tile(np.eye(4), (1000, 1, 1)))
    monkeypatch.setattr(dense_child, "_CACHE", 0.0)
    tracemalloc.start()
    maps = dense_child.DepthMaps(tmp_path, model, working_camera(sparse.model, (100, 80), 1))
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < 1e6  # all marks are 16 MB
    for row in (0, 999):
        maps.put_image(row, np.zeros((80, 100, 3), np.uint8))
        maps.put_depth(row, np.zeros((80, 100), np.float32))
    first = maps.depth_view(999)
    first.used[3, 4], first.fate[5, 6] = True, 4
    other, again = maps.depth_view(0), maps.depth_view(999)
    assert not other.used.any()
    assert (np.argwhere(again.used).tolist(), np.argwhere(again.fate).tolist()) == ([[3, 4]], [[5, 6]])
    first.used[7, 8] = True  # fusion may hold a view that is no longer in memory
    assert again.used[7, 8]


def test_limits_grow_with_the_depth_maps(
    bare: Path, sparse: Sparse, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A larger photograph may take more memory, and so may more threads; the recipe does not change by it."""
    given: dict[str, float] = {}

    def stop(*_request: object, **limits: float) -> None:
        given.update(limits)
        raise KeyboardInterrupt

    monkeypatch.setattr("recon.dense.dense.run_child", stop)
    capture = read_capture(bare)
    for memory, threads in ((0.0, 1), (100.0, 3)):
        dense = SETTINGS.dense.model_copy(update={"memory_per_megapixel": memory, "threads": threads})
        with pytest.raises(KeyboardInterrupt):
            run_dense(capture, sparse, tmp_path, SETTINGS.model_copy(update={"dense": dense}), SILENT)
        width, height = (side // 2 for side in capture.size)
        assert given["memory_limit"] == pytest.approx(2.0 + memory * threads * width * height / 1e6)
    assert len(list(tmp_path.iterdir())) == 1


def test_a_disk_that_fills_up_is_out_of_space(bare: Path, sparse: Sparse, tmp_path: Path) -> None:
    """Depth maps that may not grow are one line with the mend, and the step is not taken for finished."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))  # for the child; a depth map has 173 kB
    try:
        with pytest.raises(OutOfSpaceError, match="Free some space, then run the same command again"):
            run_dense(read_capture(bare), sparse, tmp_path, SETTINGS, SILENT)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [path.suffix for path in tmp_path.iterdir()] == [".partial"]


def test_bare_walls_have_a_reason(bare: Path, sparse: Sparse, tmp_path: Path, no_children: None) -> None:
    """A model whose photographs show nothing gives no cloud, and says why."""
    capture = Path(shutil.copytree(bare, tmp_path / "capture"))
    for path in sorted((capture / "images").iterdir()):
        cv2.imwrite(str(path), np.full((LARGER.height, LARGER.width, 3), 128, np.uint8))
    work = tmp_path / "work"
    work.mkdir()
    settings = SETTINGS.model_copy(update={"quality": "low"})
    with pytest.raises(RejectedSceneError, match="known for 0") as rejected:
        run_dense(read_capture(capture), sparse, work, settings, SILENT)
    assert rejected.value.reason == "no_depth"


def test_samples_of_the_visible_surface(truth: Truth) -> None:
    """Samples lie on the planes, one a cell; what fewer cameras see, or only from afar, does not count."""
    samples, classes = visible_surface(truth, 15.0, 3)
    on_wall = classes == 1
    np.testing.assert_allclose(samples[on_wall, 1], 5.0, atol=1e-4)
    cells = np.floor(samples / 0.1).astype(int)
    assert len(np.unique(cells, axis=0)) == len(cells)
    assert (count_cameras(samples, truth, 15.0) >= 3).all()
    assert len(visible_surface(truth, 15.0, 9)[0]) < len(samples)
    assert len(visible_surface(truth, 6.0, 3)[0]) < len(samples)
    half = samples[samples[:, 0] < 0.0]
    found = measure_completeness(half, np.zeros(len(half), np.float32), np.ones(len(half)), samples, 0.05, 15.0)
    assert found.share == pytest.approx(len(half) / len(samples), abs=0.01)
