"""What the tests of verbs share: one small scene of real parts, authored once, whichever process needs it first."""

from pathlib import Path

import pytest

from groundwork.locks import hold_lock
from tests.authoring.small_scene import write_small_scene


@pytest.fixture(scope="session")
def authored(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Author the small scene once, to be read only; give its root layer."""
    base = tmp_path_factory.getbasetemp()
    shared = (base if worker_id == "master" else base.parent) / "authored"
    shared.mkdir(exist_ok=True)
    with hold_lock(shared / "lock"):
        if not (shared / "made").exists():
            (shared / "scene").mkdir()
            write_small_scene(shared / "scene")
            (shared / "made").touch()
    return shared / "scene/scene.usda"
