"""List the surveys of a stage; an untrusted stage is checked and opened in a child process with limits."""

from pathlib import Path
from typing import Any

from groundwork.child import AT_A_LIMIT, CRASHED, answer_parent, reason_of, run_child
from groundwork.errors import ChildError, InputError
from groundwork.output.reading import reading
from groundwork.progress import SILENT, Progress

TIME_LIMIT = 120.0  # [s] composing a malicious stage may never end
MEMORY_LIMIT = 4.0  # [GB]
ADDRESS_LIMIT = 32.0  # [GB] address space: a larger array fails at once; threads of many cores reserve some


def surveys_of(
    stage: Path,
    allow_roots: tuple[Path, ...] = (),
    progress: Progress = SILENT,
    choices: dict[str, Any] | None = None,
) -> list[str]:
    """List the products of a stage or, if it has none, its cameras.

    Args:
        stage: USD file.
        allow_roots: Further folders from which the stage may load files.
        progress: Listener, for warnings about the stage.
        choices: JSON of `StageChoices`, or None for no changes.

    Returns:
        Names, in the order of the stage.

    Raises:
        InputError: Not a stage, nothing in it to render, files outside the allowed folders, or too large to be read
            safely.
    """
    roots = [str(root) for root in allow_roots]
    request = {"stage": str(stage), "allow_roots": roots, "choices": choices}
    return read_safely("falsework.children.products", request, stage, progress)


def read_safely(
    module: str,
    request: dict[str, Any],
    stage: Path,
    progress: Progress,
    time_limit: float | None = None,
    memory_limit: float | None = None,
) -> Any:
    """Run a child that reads an untrusted stage; a crash is reported as an error of that stage.

    A limit is named only if the child was stopped at it.

    Args:
        module: Module that serves the request.
        request: JSON for it.
        stage: The stage, for the error.
        progress: Listener.
        time_limit: Wall time after which it is killed [s]; `TIME_LIMIT` when None.
        memory_limit: Resident memory above which it is killed [GB]; `MEMORY_LIMIT` when None.

    Returns:
        The child's answer.

    Raises:
        InputError: The child found bad input, crashed, or exceeded a limit.
    """
    time_limit = TIME_LIMIT if time_limit is None else time_limit
    memory_limit = MEMORY_LIMIT if memory_limit is None else memory_limit
    try:
        with reading(stage):
            return run_child(module, request, time_limit=time_limit, memory_limit=memory_limit, progress=progress)
    except ChildError as error:
        reason = reason_of(error)
        if reason.startswith(AT_A_LIMIT):
            what = f"cannot be read within {time_limit:.0f} s and {memory_limit:.0f} GB: {reason}"
            hint = "Make it smaller, or flatten it in the program that made it"
        elif reason.startswith(CRASHED):
            what, hint = f"cannot be read: the process that reads it {reason}", _after_crash(error.signal)
        else:  # an error that the child itself explained
            what, hint = f"cannot be read: {reason}", None
        raise InputError(what, where=stage, hint=hint) from error


def _after_crash(signal: str) -> str:
    if signal == "SIGKILL":  # of another process: ours names its limit
        return "Something else ended it, often the system when memory runs short: run the command again"
    return "Save it again in the program that made it, flattened if it still fails"


def _answer(request: dict[str, Any], progress: Progress) -> list[str]:
    from usd_schemas.guard.guard import check_stage, limit_memory
    from usd_schemas.reading.choices import choices_from
    from usd_schemas.reading.scene_cache import load_scene

    limit_memory(ADDRESS_LIMIT)
    stage = Path(request["stage"])
    said: dict[str, None] = {}
    check_stage(stage, tuple(Path(root) for root in request["allow_roots"]), said.setdefault)
    for line in said:
        progress.note(line)
    scene = load_scene(stage, choices=choices_from(request.get("choices")))
    return [product.name for product in scene.products]  # the renderer reports what the reader leaves out


if __name__ == "__main__":
    answer_parent(_answer)
