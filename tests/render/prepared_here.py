"""Renders in this process what the product leaves to children for the sake of memory and drivers that crash.

The same bytes in seconds less. Children and parent are compared elsewhere: in `tests/render/test_memory.py` for what is
prepared, in `test_frames.py` and `test_resume.py` there for whole captures; and the chain that all tests of
`tests/end_to_end` share is made by children from end to end.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import pytest

from groundwork.canonical import canonical_json
from groundwork.progress import Progress
from render import frames
from render.detail.surveyed_scene import SurveyedScene, survey_scene
from render.light.light_volume import cast_light_volume
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.scene_cache import load_scene


@contextmanager
def prepared_here() -> Iterator[None]:
    """Read stages and cast light volumes in this process, too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("render.frames.survey_scene_apart", _survey)
        patch.setattr("render.frames.cast_volume_apart", cast_light_volume)
        yield


@contextmanager
def rendered_here() -> Iterator[None]:
    """Render whole surveys in this process, what `falsework render` and the stage `capture` do in a child."""
    with prepared_here(), pytest.MonkeyPatch.context() as patch:
        patch.setattr("render.workers.run_child", _serve)
        yield


def _serve(module: str, request: dict[str, Any], *, progress: Progress, **limits: object) -> Any:
    """Answer as the child would, from the same words."""
    assert module == "render.frames"
    threads = cv2.getNumThreads()
    try:
        return frames._serve(json.loads(canonical_json(request)), progress)
    finally:
        cv2.setNumThreads(threads)


def _survey(
    path: Path, survey: str | None, triangle_budget: int, choices: StageChoices, progress: Progress
) -> SurveyedScene:
    return survey_scene(load_scene(path, survey=survey, choices=choices), triangle_budget)
