"""Stops by a signal that arrive as another error."""

TERMINATED = 143
"""Exit code after SIGTERM."""


def stop_behind(error: BaseException) -> KeyboardInterrupt | SystemExit | None:
    """Find the stop by a signal behind an error: a native library that is being imported makes it an `ImportError`.

    Args:
        error: The exception, raised from or while handling another error.

    Returns:
        The stop; None if there was none.
    """
    seen: set[int] = set()
    behind: BaseException | None = error
    while behind is not None and id(behind) not in seen:
        if isinstance(behind, KeyboardInterrupt) or (isinstance(behind, SystemExit) and behind.code == TERMINATED):
            return behind
        seen.add(id(behind))
        behind = behind.__cause__ or behind.__context__
    return None
