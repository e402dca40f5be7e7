"""Log of a run with times: one file for each process in `OUT/run`, the only folder of a run that holds times."""

import json
import os
import platform
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from groundwork.files import space_errors
from groundwork.foreign_file import is_regular


def write_event(root: Path, event: dict[str, Any]) -> None:
    """Add one line to this process's file.

    Args:
        root: Output folder of the run.
        event: JSON of the event.

    Raises:
        OutOfSpaceError: The disk is full.
        InputError: The folder is not writable.
    """
    folder = root / "run"
    line = json.dumps({**event, "end": time.time()}) + "\n"
    path = folder / f"{platform.node()}-{os.getpid()}.jsonl"
    with space_errors(path):
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:  # not atomic: a log grows line by line
            file.write(line)


def read_events(root: Path) -> Iterator[dict[str, Any]]:
    """Read the events of all processes; incomplete lines are skipped.

    Args:
        root: Output folder of a run.
    """
    for path in sorted((root / "run").glob("*.jsonl")):
        if not is_regular(path):  # a pipe would be waited for without end
            continue
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            event = parse_event(line)
            if event is not None:
                yield event


def parse_event(line: str | bytes) -> dict[str, Any] | None:
    """Parse one line.

    Args:
        line: The line, without its end.

    Returns:
        The event, or None if the line is incomplete or not an event.
    """
    try:
        event = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return event if isinstance(event, dict) else None
