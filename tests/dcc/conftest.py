"""What the tests of Blender share: one small scene, authored once a process."""

from pathlib import Path

import pytest

from tests.dcc.round_trip import SMALL, small_scene


@pytest.fixture(scope="session")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Author one small scene to copy from."""
    return small_scene(tmp_path_factory.mktemp("original") / "scene", SMALL, 7)
