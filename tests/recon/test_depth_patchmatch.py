"""PatchMatch on planes in closed form: truer than semi-global matching, and the same whatever the order of work."""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.dense.dense_child import choose_method
from recon.dense.depth_colmap import has_cuda, measure_with_colmap, read_depth_map, reproject_depth
from recon.dense.depth_patchmatch import measure_slanted
from recon.dense.depth_sgm import PosedImage, measure_depth
from recon.settings import DenseSettings
from tests.recon.wavy_plane import WavyPlane
from usd_schemas.pinhole import Pinhole, look_at

CAMERA = Pinhole(100, 76, 95.0, 95.0, 50.0, 38.0)
SLANTED = WavyPlane(np.array([0.6, -0.8, 0.0]), -4.0, wavelength=0.2)
EYES = ((0.0, 0.0, 0.0), (0.5, 0.0, 0.05), (-0.5, 0.0, -0.05), (0.05, 0.0, 0.5))
EVERYWHERE = np.ones((76, 100), bool)
REACH = (2.5, 15.0)


@pytest.fixture(scope="module")
def views() -> list[PosedImage]:
    """Photograph the slanted plane from four places."""
    poses = [look_at(np.array(eye), np.array([0.2 * eye[0], 5.0, 0.0])) for eye in EYES]
    return [PosedImage(SLANTED.gray(CAMERA, pose), pose) for pose in poses]


@pytest.fixture(scope="module")
def depth(views: list[PosedImage]) -> NDArray[np.float32]:
    """Measure the first view's depth by PatchMatch."""
    return measure_slanted(views[0], views[1:], CAMERA, EVERYWHERE, REACH, 0.01)


def test_a_slanted_plane_is_truer(views: list[PosedImage], depth: NDArray[np.float32]) -> None:
    """Half the error of semi-global matching at most, without its bias; half a pixel of shift would show."""
    true = SLANTED.depth(CAMERA, views[0].pose)
    coarse = measure_depth(views[0], views[1:], CAMERA, EVERYWHERE, REACH, 0.01)
    known = depth > 0
    assert known[6:-6, 6:-6].mean() > 0.85
    error = depth[known] / true[known] - 1.0
    assert np.median(np.abs(error)) < 0.5 * np.median(np.abs(coarse[coarse > 0] / true[coarse > 0] - 1.0))
    assert abs(np.median(error)) < 5e-4
    for half in (-0.5, 0.5):
        moved = SLANTED.depth(Pinhole(100, 76, 95.0, 95.0, 50.0 + half, 38.0), views[0].pose)
        assert abs(np.median(depth[known] / moved[known] - 1.0)) > 2e-3


def test_threads_change_nothing(views: list[PosedImage], depth: NDArray[np.float32]) -> None:
    """Measured alone or beside other work, every bit is the same."""
    with ThreadPoolExecutor(3) as pool:
        runs = [pool.submit(measure_slanted, views[0], views[1:], CAMERA, EVERYWHERE, REACH, 0.01) for _ in range(3)]
        for run in runs:
            np.testing.assert_array_equal(run.result(), depth)


def test_without_sources_nothing_is_known(views: list[PosedImage]) -> None:
    """A view by itself has no depth."""
    assert not measure_slanted(views[0], [], CAMERA, EVERYWHERE, REACH, 0.01).any()


def test_depth_maps_of_colmap_are_read(tmp_path: Path) -> None:
    """Sizes, then rows of float32; a cut file is refused."""
    depth = np.arange(12, dtype="<f4").reshape(3, 4)
    path = tmp_path / "a.jpg.geometric.bin"
    path.write_bytes(b"4&3&1&" + depth.tobytes())
    np.testing.assert_array_equal(read_depth_map(path), depth)
    path.write_bytes(path.read_bytes()[:-4])
    with pytest.raises(InputError, match="not a depth map"):
        read_depth_map(path)


def test_a_depth_map_moves_onto_another_camera() -> None:
    """A camera with twice the pixels, and its middle elsewhere, sees the same plane at the same depths."""
    pose = look_at(np.zeros(3), np.array([0.0, 5.0, 0.0]))
    fine = Pinhole(220, 160, 190.0, 190.0, 106.0, 78.0)
    moved = reproject_depth(SLANTED.depth(fine, pose).astype(np.float32), fine, CAMERA)
    true = SLANTED.depth(CAMERA, pose)
    assert (moved > 0).mean() > 0.95
    known = moved > 0
    assert np.abs(moved[known] / true[known] - 1.0).max() < 0.006  # half a fine pixel on a steep plane


@pytest.mark.skipif(has_cuda(), reason="this COLMAP has CUDA")
def test_colmap_without_cuda_says_so(tmp_path: Path) -> None:
    """Asked for by name it is refused in one line; `auto` means semi-global matching then."""
    assert choose_method(DenseSettings()) == "sgm"
    assert choose_method(DenseSettings(method="patchmatch")) == "patchmatch"
    with pytest.raises(InputError, match="needs CUDA"):
        next(measure_with_colmap(tmp_path, tmp_path, tmp_path / "w", (), None))  # pyright: ignore[reportArgumentType]
    assert "pycolmap" in sys.modules
