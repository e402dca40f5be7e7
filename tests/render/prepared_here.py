"""Renders in this process what the renderer leaves to a child for the sake of memory: seconds less, the same bytes.

That child and parent give the same has its own test in `tests/render/test_memory.py`.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from groundwork.progress import Progress
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


def _survey(
    path: Path, survey: str | None, triangle_budget: int, choices: StageChoices, progress: Progress
) -> SurveyedScene:
    return survey_scene(load_scene(path, survey=survey, choices=choices), triangle_budget)
