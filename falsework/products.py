"""Which surveys a stage offers; a stage from elsewhere is opened in a child, with limits."""

from pathlib import Path
from typing import Any

from groundwork.child import answer_parent, run_child
from groundwork.progress import Progress

TIME_LIMIT = 120.0  # [s] composing a hostile stage may never end
MEMORY_LIMIT = 4.0  # [GB]


def surveys_of(stage: Path) -> list[str]:
    """Name the products of a stage, or its cameras where it has none.

    Args:
        stage: USD file.

    Returns:
        Names, in the order of the stage.

    Raises:
        InputError: Not a stage, or nothing in it to render.
        ChildError: Reading it went over a limit.
    """
    return run_child("falsework.products", {"stage": str(stage)}, time_limit=TIME_LIMIT, memory_limit=MEMORY_LIMIT)


def _answer(request: dict[str, Any], progress: Progress) -> list[str]:
    from usd_schemas.stage_reader import read_stage

    scene = read_stage(Path(request["stage"]))
    for line in scene.warnings:
        progress.note(line)
    return [product.name for product in scene.products]


if __name__ == "__main__":
    answer_parent(_answer)
