"""What several processes of one test run share: the first one that needs it makes it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from groundwork.locks import hold_lock


def made_once(factory: pytest.TempPathFactory, worker_id: str, name: str, make: Callable[[Path], str | None]) -> Path:
    """Let the first process make a folder, and the others wait for it.

    Args:
        factory: Of the session.
        worker_id: The process: `master`, or one of pytest-xdist's.
        name: Of the shared folder.
        make: Makes the folder, which a failed attempt may have left; what it returns stands in the file `made` beside
            it.

    Returns:
        The folder; read only.
    """
    base = factory.getbasetemp()
    shared = (base if worker_id == "master" else base.parent) / name
    shared.mkdir(exist_ok=True)
    out, made = shared / "out", shared / "made"
    with hold_lock(shared / "lock"):
        if not made.exists():
            made.write_text(make(out) or "")
    return out
