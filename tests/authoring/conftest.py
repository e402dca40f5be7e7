"""What the authoring tests share: one small scene of real parts, authored once."""

import shutil
from pathlib import Path

import pytest

from tests.authoring.small_scene import write_small_scene


@pytest.fixture(scope="session")
def stored_scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Author the small scene once, to be read only; give its root layer."""
    return write_small_scene(tmp_path_factory.mktemp("small"))


@pytest.fixture
def own_scene(stored_scene: Path, tmp_path: Path) -> Path:
    """Copy the small scene, free to be changed; give its root layer."""
    shutil.copytree(stored_scene.parent, tmp_path / "scene")
    return tmp_path / "scene/scene.usda"
