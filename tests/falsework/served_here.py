"""Does in this process what verbs leave to a child because stages come from anywhere: the same answers in seconds less.

What the child is for has tests of its own: limits and crashes in `tests/faults/test_bombs.py` and
`tests/groundwork/test_child.py`, and each verb runs with its child in another test of the file that uses this one.
"""

import importlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from groundwork.canonical import canonical_json
from groundwork.progress import SILENT, Progress

CALLERS = (
    "falsework.children.products",
    "falsework.commands.scene_verbs",
    "falsework.commands.background_verbs",
    "falsework.stages",
)


@contextmanager
def served_here() -> Iterator[None]:
    """Serve `falsework scene`, `background`, `survey`, `sample`, `render` and a run's samples without a child."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("usd_schemas.guard.guard.limit_memory", lambda gigabytes: None)  # it would hold for all tests
        for caller in CALLERS:
            patch.setattr(f"{caller}.run_child", _serve)
        yield


def _serve(module: str, request: dict[str, Any], *, progress: Progress = SILENT, **limits: float) -> Any:
    """Answer as the child would: words go to it and come from it as JSON."""
    assert module.startswith("falsework.children.")
    serves = "sample" if module == "falsework.children.sample_work" else "_answer"
    answer = getattr(importlib.import_module(module), serves)(json.loads(canonical_json(request)), progress)
    return json.loads(canonical_json(answer))
