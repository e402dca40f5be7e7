"""The capture format: what is written is read back, and what is damaged is refused by name."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from groundwork.errors import InputError, MissingError
from groundwork.files import write_bytes
from render.capture import CalibrationPrior, Capture, CaptureImage, Readout, load_image, read_capture, read_truth
from render.images import image_files
from render.images.depth_tiff import encode_depth_tiff
from render.images.gray_png import decode_gray_png, encode_gray_png
from render.writing.capture_writer import FrameTruth, make_folders, write_cameras, write_truth
from tests.frame_truth import write_frame_truth
from tests.render.scenes import CAMERA, random_scene
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import FlatScene, world_triangles

SHAPE = (CAMERA.height, CAMERA.width)


def frame_truth(seed: int, highest: int) -> FrameTruth:
    """Draw one frame with sky in its first rows."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1, 3000, SHAPE).astype(np.float32)
    depth[:20] = np.inf
    ids = rng.integers(0, highest + 1, SHAPE, np.uint32)
    ids[0, 0] = highest
    return FrameTruth(depth, rng.integers(0, 16, SHAPE, np.uint8), ids)


def write_example(folder: Path, *, highest: int = 65535) -> tuple[Capture, FlatScene]:
    """Write a capture of three noise images."""
    scene = random_scene(1, np.zeros(3), count=8)
    make_folders(folder)
    images = []
    for row, name in enumerate(scene.cameras[0].image_names):
        rng = np.random.default_rng(row)
        pixels = cv2.GaussianBlur(rng.integers(0, 255, (*SHAPE, 3), np.uint8), (0, 0), 2.0)
        write_bytes(folder / "images" / f"{name}.jpg", image_files.encode_jpeg(pixels.astype(np.uint8), 95))
        write_frame_truth(folder, name, frame_truth(row, highest), wide_ids=highest > 65535)
        images.append(CaptureImage(name=name, file=f"images/{name}.jpg", gps=(1.5, -2.25, row / 3), time=row * 2.0))
    capture = Capture(
        folder,
        "local",
        (CAMERA.width, CAMERA.height),
        CalibrationPrior(focal_px=141.0, cx=80.0, cy=60.0),
        (0.5, 0.5, 1.0),
        {"kind": "local", "spacing": 2.0},
        tuple(images),
    )
    write_cameras(capture)
    write_truth(folder, CAMERA, scene.cameras[0], scene)
    return capture, scene


def test_round_trip(tmp_path: Path) -> None:
    """Every record, image, pose, table and triangle comes back as it was written."""
    written, scene = write_example(tmp_path)
    capture = read_capture(tmp_path)
    assert capture == written
    truth = read_truth(capture)
    assert truth is not None
    assert truth.camera == CAMERA
    assert truth.instances == scene.instances
    assert truth.classes == scene.classes
    np.testing.assert_array_equal(truth.poses, scene.cameras[0].poses)
    for row in range(3):
        expected = frame_truth(row, 65535)
        np.testing.assert_array_equal(truth.depth(row), expected.depth)
        np.testing.assert_array_equal(truth.semantic(row), expected.semantic)
        np.testing.assert_array_equal(truth.instance(row), expected.instance)
        assert truth.depth(row).dtype == np.float32
        assert truth.instance(row).dtype == np.uint32
        assert load_image(capture, row).shape == (*SHAPE, 3)
    assert (tmp_path / "truth/instance/000000.png").exists()
    corners, ids, labels = truth.surface()
    expected_corners, expected_ids, rows = world_triangles(scene)
    np.testing.assert_allclose(corners, expected_corners, atol=1e-12)
    np.testing.assert_array_equal(ids, expected_ids)
    np.testing.assert_array_equal(labels, scene.draws.label[rows])


@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (33, 120), (480, 641)])
def test_depth_comes_back_bit_for_bit(tmp_path: Path, shape: tuple[int, int]) -> None:
    """Smooth, wild, tiny and infinite values, through OpenCV's reader; a damaged file is refused."""
    rng = np.random.default_rng(3)
    for number, depth in enumerate(
        (
            np.linspace(0.1, 5000, shape[0] * shape[1]).reshape(shape),
            np.where(rng.random(shape) < 0.3, np.inf, 10.0 ** rng.uniform(-40, 38, shape)),
            rng.integers(0, 2**31 - 2**23, shape).astype(np.uint32).view(np.float32),
        )
    ):
        path = tmp_path / f"{number}.tiff"
        wanted = np.asarray(depth, np.float32)
        data = encode_depth_tiff(wanted)
        path.write_bytes(data)
        read = image_files.decode(path)
        assert read.dtype == np.float32
        np.testing.assert_array_equal(read.view(np.uint32), wanted.view(np.uint32))
        path.write_bytes(data[: len(data) - 60])
        with pytest.raises(InputError):
            image_files.decode(path)


def test_packed_bytes_are_the_same_on_every_machine() -> None:
    """A plane and its labels, packed: neither the processor nor the process has a say in the bytes."""
    row, column = np.mgrid[0:240, 0:320]
    depth = (3 + row / 64 + column / 256 + (row * column % 7) / 8).astype(np.float32)  # exact: sums of powers of two
    depth[:40] = np.inf
    labels = ((row // 32 + column // 48) % 17).astype(np.uint8)
    found = [hashlib.sha256(data).hexdigest()[:16] for data in (encode_depth_tiff(depth), encode_gray_png(labels))]
    assert found == ["bdd1135cc9331901", "999294e75029c853"]


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (480, 641)])
def test_labels_come_back_bit_for_bit(tmp_path: Path, shape: tuple[int, int], kind: type) -> None:
    """Areas, noise, and the greatest number there is, through our reader and OpenCV's; a damaged file is refused."""
    rng = np.random.default_rng(5)
    greatest = np.iinfo(kind).max
    areas = np.add.outer(np.arange(shape[0]) // 40, np.arange(shape[1]) // 90)
    for number, values in enumerate((areas, rng.integers(0, greatest, shape, endpoint=True), np.full(shape, greatest))):
        path = tmp_path / f"{number}.png"
        data = image_files.encode_png(values.astype(kind))
        path.write_bytes(data)
        read = image_files.decode(path)
        assert read.dtype == kind
        np.testing.assert_array_equal(read, values)
        np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED), values)
        ours = decode_gray_png(data)
        assert ours is not None
        np.testing.assert_array_equal(ours, values)
        for place in rng.integers(0, len(data), 20):
            assert decode_gray_png(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]) is None
        assert decode_gray_png(data[:20]) is None
        assert image_files.size(path) == shape[::-1]
        path.write_bytes(data[: len(data) - 16])
        with pytest.raises(InputError):
            image_files.decode(path)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_labels_of_others_are_read_too(tmp_path: Path, kind: type) -> None:
    """A PNG of OpenCV's, with filters and several chunks, is not for our own reader and comes in all the same."""
    values = np.random.default_rng(6).integers(0, np.iinfo(kind).max, (90, 110), endpoint=True).astype(kind)
    path = tmp_path / "of_others.png"
    assert cv2.imwrite(str(path), values)
    assert decode_gray_png(path.read_bytes()) is None
    np.testing.assert_array_equal(image_files.decode(path), values)


def test_a_gray_photograph_keeps_one_channel(tmp_path: Path) -> None:
    """A gray JPEG is decoded as a gray PNG is; color JPEGs of each subsampling keep OpenCV's values to the last bit."""
    rng = np.random.default_rng(7)
    gray = rng.integers(0, 256, (33, 47)).astype(np.uint8)
    for suffix in (".jpg", ".png"):
        path = tmp_path / f"gray{suffix}"
        assert cv2.imwrite(str(path), gray)
        np.testing.assert_array_equal(image_files.decode(path), cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    color = rng.integers(0, 256, (33, 47, 3)).astype(np.uint8)
    for sampling in (cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444):
        for progressive in (0, 1):
            options = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling, cv2.IMWRITE_JPEG_PROGRESSIVE, progressive]
            path = tmp_path / "color.jpg"
            assert cv2.imwrite(str(path), color, options)
            expected = np.asarray(cv2.imread(str(path), cv2.IMREAD_COLOR))[..., ::-1]
            np.testing.assert_array_equal(image_files.decode(path), expected)


def test_a_gray_photograph_of_a_capture_gets_three_channels(tmp_path: Path) -> None:
    """Whoever loads photographs gets red, green and blue, equal for a gray one of either format."""
    capture, _ = write_example(tmp_path)
    gray = np.random.default_rng(8).integers(0, 256, SHAPE).astype(np.uint8)
    for data in (cv2.imencode(".jpg", gray)[1].tobytes(), image_files.encode_png(gray)):
        (tmp_path / capture.images[0].file).write_bytes(data)
        expected = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE))
        np.testing.assert_array_equal(load_image(capture, 0), np.dstack([expected] * 3))


def test_ids_above_16_bit_are_kept_as_tiff(tmp_path: Path) -> None:
    """An id of 4,000,000,000 survives, in a 32-bit TIFF."""
    write_example(tmp_path, highest=4_000_000_000)
    truth = read_truth(read_capture(tmp_path))
    assert truth is not None
    np.testing.assert_array_equal(truth.instance(1), frame_truth(1, 4_000_000_000).instance)
    assert not (tmp_path / "truth/instance/000001.png").exists()


def test_two_writes_are_the_same_bytes(tmp_path: Path) -> None:
    """No clock, path or hash order reaches a file."""
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_example(tmp_path / name)
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file())
    assert len(files) == 16
    assert [
        path for path in files if (tmp_path / "a" / path).read_bytes() != (tmp_path / "b" / path).read_bytes()
    ] == []


def test_truth_is_optional_and_never_needed(tmp_path: Path) -> None:
    """Photographs alone are a capture."""
    write_example(tmp_path)
    (tmp_path / "truth").rename(tmp_path.parent / f"{tmp_path.name}-truth")
    capture = read_capture(tmp_path)
    assert read_truth(capture) is None
    assert load_image(capture, 2).dtype == np.uint8


@pytest.mark.parametrize("keep", [0, 1, 10, 600, 5000, -2, -1])
def test_truncated_jpeg_is_refused_by_name(tmp_path: Path, keep: int) -> None:
    """However much is missing, the error names the file."""
    write_example(tmp_path)
    path = tmp_path / "images/000001.jpg"
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(InputError, match=r"000001\.jpg.*cut off or damaged"):
        load_image(read_capture(tmp_path), 1)


def test_truncated_label_image_is_refused(tmp_path: Path) -> None:
    """A cut PNG or TIFF is not read as far as it goes."""
    write_example(tmp_path)
    truth = read_truth(read_capture(tmp_path))
    assert truth is not None
    for path in (tmp_path / "truth/semantic/000000.png", tmp_path / "truth/depth/000000.tiff"):
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    for read in (truth.semantic, truth.depth):
        with pytest.raises(InputError, match="cut off or damaged"):
            read(0)


def test_damaged_tables_are_named(tmp_path: Path) -> None:
    """A wrong key, a missing image, a path that climbs and a foreign truth each give one line."""
    write_example(tmp_path)
    path = tmp_path / "cameras.json"
    good = path.read_text()
    for old, new, message in (
        ('"survey"', '"surve"', "surve"),
        ("images/000001.jpg", "images/000009.jpg", r"000009\.jpg"),
        ("images/000001.jpg", "../000001.jpg", "leads out of the capture"),
        ('"name": "000001"', '"name": "000000"', "same name"),
        ('"format_version": 1', '"format_version": 2', "format_version"),
        ("{", "[", "JSON"),
    ):
        path.write_text(good.replace(old, new, 1))
        with pytest.raises(InputError, match=message):
            read_capture(tmp_path)
    path.write_text(good)
    poses = tmp_path / "truth/poses.json"
    value = json.loads(poses.read_text())
    poses.write_text(json.dumps({**value, "poses": value["poses"][1:]}))
    with pytest.raises(InputError, match="different images"):
        read_truth(read_capture(tmp_path))
    with pytest.raises(MissingError, match="not a capture"):
        read_capture(tmp_path / "images")


def test_a_bent_lens_and_a_rolling_shutter_come_back(tmp_path: Path) -> None:
    """What they do to a pixel is undone from the files: each row from the pose of its band, along the bent ray."""
    _, scene = write_example(tmp_path)
    track, bend = scene.cameras[0], Distortion(-0.1, 0.02, 1e-3, -5e-4)
    bands = ((0, 50), (50, 51), (51, CAMERA.height))
    moved = np.repeat(track.poses[:, None], 3, axis=1)
    moved[:, :, 0, 3] += [-0.2, 0.0, 0.2]
    write_truth(tmp_path, CAMERA, replace(track, distortion=bend), scene, Readout(bands, moved, 0.02))
    truth = read_truth(read_capture(tmp_path))
    assert truth is not None
    assert truth.readout is not None
    assert (truth.distortion, truth.readout.bands, truth.readout.readout_time) == (bend, bands, 0.02)
    pixels = np.array([[10.5, 0.0], [80.0, 49.999], [81.0, 50.0], [3.0, 50.99], [159.9, 51.0], [70.0, 120.0]])
    depth = np.array([3.0, 5.0, 8.0, 13.0, 21.0, 34.0])
    world = truth.surface_points(1, pixels, depth)
    for point, pixel, far, band in zip(world, pixels, depth, (0, 0, 1, 1, 2, 2), strict=True):
        local = np.linalg.inv(moved[1, band]) @ [*point, 1.0]
        assert local[2] == pytest.approx(far)
        seen = bend.distort(local[:2] / local[2]) * [CAMERA.fx, CAMERA.fy] + [CAMERA.cx, CAMERA.cy]
        np.testing.assert_allclose(seen, pixel, atol=1e-8)
