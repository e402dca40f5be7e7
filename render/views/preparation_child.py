"""Work that needs much memory for a short time, in a separate process, so that the memory is freed at once.

`python -m render.views.preparation_child` serves one request {task, work, answer} of a parent process; USD and the ray
caster are only loaded there.
"""

import pickle
import tempfile
from pathlib import Path
from typing import Any

from groundwork.child import answer_parent, run_child
from groundwork.files import writing
from groundwork.progress import Progress
from render.detail.surveyed_scene import SurveyedScene, survey_scene
from render.light.light_volume import LightVolume, cast_light_volume
from usd_schemas.reading.choices import StageChoices

_CHILD = "render.views.preparation_child"
_TIME_LIMIT = 8 * 3600.0  # [s]; the parent has a tighter limit, and this process ends with it
_MEMORY_LIMIT = 16.0  # [GB] the process that watches the parent does not measure its children


def survey_scene_apart(
    path: Path, survey: str | None, triangle_budget: int, choices: StageChoices, progress: Progress
) -> SurveyedScene:
    """Load a stage like `load_scene` and `survey_scene`, without USD in this process.

    Args:
        path: A USD file.
        survey: Name of the one product to keep; the first when None.
        triangle_budget: Largest number of triangles in view; 0: no limit.
        choices: Choices for reading the stage.
        progress: Listener.
    """
    return _apart("survey", (path, survey, triangle_budget, choices), progress)


def cast_volume_apart(*work: Any) -> LightVolume:
    """Cast a light volume like `cast_light_volume`, without the ray caster in this process.

    Args:
        *work: Arguments of `cast_light_volume`; the last one is a progress listener.

    Returns:
        The light volume.
    """
    *arguments, progress = work
    return _apart("light", tuple(arguments), progress)


def _apart(task: str, arguments: tuple[Any, ...], progress: Progress) -> Any:
    with tempfile.TemporaryDirectory() as scratch:
        work, answer = Path(scratch) / "work", Path(scratch) / "answer"
        _write(work, arguments)
        request = {"task": task, "work": str(work), "answer": str(answer)}
        run_child(_CHILD, request, time_limit=_TIME_LIMIT, memory_limit=_MEMORY_LIMIT, progress=progress)
        with answer.open("rb") as file:
            return pickle.load(file)


def _serve(request: dict[str, Any], progress: Progress) -> None:
    with Path(request["work"]).open("rb") as file:
        arguments = pickle.load(file)
    if request["task"] == "light":
        scene, daylight, albedo, box, sampling = arguments
        result: object = cast_light_volume(scene, daylight, albedo, box, sampling, progress)
    else:
        from usd_schemas.reading.scene_cache import load_scene

        path, survey, triangle_budget, choices = arguments
        result = survey_scene(load_scene(path, survey=survey, choices=choices), triangle_budget)
    _write(Path(request["answer"]), result)


def _write(path: Path, content: object) -> None:
    with writing(path) as file:
        pickle.dump(content, file, pickle.HIGHEST_PROTOCOL)


if __name__ == "__main__":
    answer_parent(_serve)
