"""What the tests of verbs share: one small scene of real parts, authored once, whichever process needs it first."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.authoring.small_scene import write_small_scene
from tests.falsework.fresh_interpreter import FreshInterpreter, fresh_interpreter
from tests.made_once import made_once


@pytest.fixture(scope="session")
def authored(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Author the small scene once, to be read only; give its root layer."""

    def make(out: Path) -> None:
        out.mkdir()
        write_small_scene(out)

    return made_once(tmp_path_factory, worker_id, "authored", make) / "scene.usda"


@pytest.fixture(scope="session")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FreshInterpreter]:
    """Start an interpreter for the tests that ask what a command loads."""
    with fresh_interpreter(tmp_path_factory.mktemp("fresh")) as fresh:
        yield fresh
