"""The gallery: cameras that look where they should, sheets of the right size, and one real bridge."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from falsework.cli import main
from falsework.gallery import Views, look_at, sheet


def test_a_camera_looks_at_its_target_and_stands_upright() -> None:
    """The target lies straight ahead, z up is y down in the image, the frame is a rotation."""
    eye, target = np.array([3.0, -20.0, 7.0]), np.array([1.0, 2.0, 0.5])
    pose = look_at(eye, target)
    ahead = np.array([0.0, 0.0, float(np.linalg.norm(target - eye))])
    np.testing.assert_allclose(pose[:3, :3].T @ (target - eye), ahead, atol=1e-9)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    assert pose[2, 1] < 0.0
    assert pose[2, 0] == 0.0


def test_a_sheet_has_a_row_for_each_bridge() -> None:
    """Three pictures side by side, bridges one below the other, colours kept."""
    colors = [(200, 30, 30), (30, 200, 30), (30, 30, 200)]
    pictures = tuple(np.full((60, 100, 3), color, np.uint8) for color in colors)
    data = sheet([Views("one", pictures), Views("two", pictures)])  # pyright: ignore[reportArgumentType]
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape == (120, 300, 3)
    for number, color in enumerate(colors):
        np.testing.assert_allclose(image[50, 50 + 100 * number, ::-1], color, atol=12)


@pytest.mark.slow
@pytest.mark.proof_only
def test_the_verb_writes_a_sheet_for_each_family(tmp_path: Path) -> None:
    """One real bridge: three pictures that are neither empty nor alike."""
    with pytest.raises(SystemExit) as done:
        main(["gallery", "families", "-o", str(tmp_path / "out"), "--count", "1", "--family", "slab"])
    assert done.value.code == 0
    image = cv2.imread(str(tmp_path / "out/slab.jpg"))
    assert image is not None
    third = image.shape[1] // 3
    assert all(image[:, k * third : (k + 1) * third].std() > 15.0 for k in range(3))
    assert "slab.jpg" in (tmp_path / "out/index.md").read_text()
