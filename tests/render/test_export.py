"""A capture as other programs read it: COLMAP's own reader, nerfstudio's convention, a film that plays."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.progress import SILENT
from render.capture import Truth, read_capture, read_truth
from render.writing.capture_writer import write_truth
from render.writing.export import _surface_points, export_capture
from tests.render.scenes import CAMERA
from tests.render.test_capture import write_example
from usd_schemas.distortion import NO_DISTORTION, Distortion

BENT = Distortion(-0.1, 0.02, 1e-3, -5e-4)
SPOTS = np.array([[80.0, 60.0], [12.5, 30.25], [150.0, 110.0]])


@pytest.fixture(params=[NO_DISTORTION, BENT], ids=["straight", "bent"])
def truth(tmp_path: Path, request: pytest.FixtureRequest) -> Truth:
    """Write a capture of three noise images below `capture`, whose lens is straight or bent."""
    folder = tmp_path / "capture"
    folder.mkdir()
    _, scene = write_example(folder)
    write_truth(folder, CAMERA, replace(scene.cameras[0], distortion=request.param), scene)
    found = read_truth(read_capture(folder))
    assert found is not None
    return found


def written(tmp_path: Path, to: str) -> Path:
    """Export the capture."""
    out = tmp_path / to
    out.mkdir()
    export_capture(tmp_path / "capture", to, out, SILENT)
    return out


def test_colmap_reads_the_true_cameras(tmp_path: Path, truth: Truth) -> None:
    """Pycolmap projects points of the surface onto the pixels that showed them, and finds every photograph."""
    out = written(tmp_path, "colmap")
    model = pycolmap.Reconstruction(out / "sparse/0")
    assert model.num_reg_images() == 3
    assert model.num_points3D() > 30
    camera = model.cameras[1]
    assert camera.model.name == ("PINHOLE" if truth.distortion.is_identity else "OPENCV")
    for row in range(3):
        image = next(image for image in model.images.values() if image.name == f"{truth.names[row]}.jpg")
        assert (out / "images" / image.name).is_file()
        world = truth.surface_points(row, SPOTS, np.array([4.0, 11.0, 250.0]))
        for point, expected in zip(world, SPOTS, strict=True):
            found = camera.img_from_cam(image.cam_from_world() * point)
            np.testing.assert_allclose(np.asarray(found).ravel(), expected, atol=1e-6)
    capture = read_capture(tmp_path / "capture")
    depth = truth.depth(0)[12, 36]
    assert np.isinf(depth) or any(
        np.allclose(point.xyz, truth.surface_points(0, np.array([[36.5, 12.5]]), np.array([depth]))[0], atol=1e-6)
        for point in model.points3D.values()
    )
    assert capture.size == (camera.width, camera.height)


def test_nerfstudio_axes_and_intrinsics(tmp_path: Path, truth: Truth) -> None:
    """A point ahead of the camera lies along the frame's -z, its y points up, and OpenCV's projection agrees."""
    out = written(tmp_path, "nerfstudio")
    told = json.loads((out / "transforms.json").read_text())
    assert told["camera_model"] == "OPENCV"
    assert (told["w"], told["h"]) == (CAMERA.width, CAMERA.height)
    head, _, body = (out / told["ply_file_path"]).read_bytes().partition(b"end_header\n")
    assert [f"property double {axis}".encode() in head for axis in "xyz"] == [True] * 3  # map coordinates survive
    coord = np.frombuffer(body, [("xyz", "<3f8"), ("rgb", "3u1")])["xyz"]
    np.testing.assert_array_equal(coord, _surface_points(read_capture(tmp_path / "capture"), truth, SILENT)[0])
    assert len(coord) > 30
    matrix = np.array([[told["fl_x"], 0, told["cx"] - 0.5], [0, told["fl_y"], told["cy"] - 0.5], [0, 0, 1]])
    bend = np.array([told[name] for name in ("k1", "k2", "p1", "p2")])
    for row, frame in enumerate(told["frames"]):
        assert (out / frame["file_path"]).is_file()
        local = np.linalg.inv(np.array(frame["transform_matrix"]))
        world = truth.surface_points(row, SPOTS, np.array([4.0, 11.0, 250.0]))
        seen = world @ local[:3, :3].T + local[:3, 3]
        assert np.all(seen[:, 2] < 0)
        pixels, _ = cv2.projectPoints(seen * [1.0, -1.0, -1.0], np.zeros(3), np.zeros(3), matrix, bend)
        np.testing.assert_allclose(pixels.reshape(-1, 2) + 0.5, SPOTS, atol=1e-6)


def test_the_film_shows_every_image(tmp_path: Path, truth: Truth) -> None:
    """Three frames, photographs and classes side by side, near the pixels that went in."""
    out = written(tmp_path, "video")
    film = cv2.VideoCapture(str(out / "flight.mp4"))
    frames = []
    while True:
        more, frame = film.read()
        if not more:
            break
        frames.append(frame)
    assert len(frames) == 3
    assert frames[0].shape == (CAMERA.height, 2 * CAMERA.width, 3)
    first = cv2.imread(str(tmp_path / "capture/images/000000.jpg"))
    assert first is not None
    assert abs(frames[0][:, : CAMERA.width].mean() - first.mean()) < 4
    assert truth.names[0] == "000000"


@pytest.mark.parametrize("kept", [0, 1, 2])
def test_a_film_that_was_not_written_is_noticed(
    kept: int, tmp_path: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch
) -> None:
    """OpenCV's writer says nothing where a frame or the whole file does not reach the disk."""
    real = cv2.VideoWriter

    class Losing:
        fourcc = staticmethod(real.fourcc)

        def __init__(self, *given: Any) -> None:
            self.film, self.left = real(*given) if kept else None, kept

        def isOpened(self) -> bool:
            return True

        def write(self, frame: NDArray[np.uint8]) -> None:
            if self.film is not None and self.left:
                self.film.write(frame)
                self.left -= 1

        def release(self) -> None:
            if self.film is not None:
                self.film.release()

    monkeypatch.setattr(cv2, "VideoWriter", Losing)
    assert len(truth.names) == 3
    with pytest.raises(InputError, match=rf"flight\.mp4: the film is not complete \(found '{kept} of 3 images'\)"):
        written(tmp_path, "video")


def test_photographs_alone_make_a_film_and_nothing_else(tmp_path: Path, truth: Truth) -> None:
    """Without truth there are no true cameras to write; the error says what to do."""
    truth.folder.rename(tmp_path / "hidden")
    for to in ("colmap", "nerfstudio"):
        (tmp_path / to).mkdir()
        with pytest.raises(InputError, match="has no truth"):
            export_capture(tmp_path / "capture", to, tmp_path / to, SILENT)
    assert (written(tmp_path, "video") / "flight.mp4").stat().st_size > 1000
