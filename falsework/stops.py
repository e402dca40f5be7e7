"""Stops by a signal: they wait for the end of an import, and are found where they arrive as another error."""

import atexit
import os
import signal
import sys
import time
from types import FrameType

TERMINATED = 143
"""Exit code after SIGTERM."""
INTERRUPTED = 130
"""Exit code after Ctrl-C."""
INTERRUPTED_LINE = "falsework: interrupted; repeat the command: it continues\n"

_LONGEST = 8.0  # [s] that a stop waits for an import
_STEP = 0.05  # [s] after which it looks again


def catch_stops() -> None:
    """Let Ctrl-C and SIGTERM end the command: the first as `KeyboardInterrupt`, the second as `SystemExit`.

    While a module is being imported they wait for its end: libraries import others on trial and pass over every error,
    this one too. After 8 s, or at a second signal, the process ends within the import, which loses nothing. Ctrl-C that
    the parent ignores, as a shell does for a command in the background, stays ignored. A second call changes nothing.
    """
    if isinstance(signal.getsignal(signal.SIGTERM), _Stop):
        return  # a stop may be waiting in it
    stop = _Stop()
    signal.signal(signal.SIGALRM, stop)
    atexit.register(signal.setitimer, signal.ITIMER_REAL, 0)  # an alarm after Python's end would be its cause
    signal.signal(signal.SIGTERM, stop)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, stop)


class _Stop:
    """Handler of the signals, and of the alarm by which a stop that waits looks again."""

    def __init__(self) -> None:
        self._waiting = 0  # number of the signal that waits
        self._end = 0.0  # of the wait, on the monotonic clock [s]

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if number == signal.SIGALRM:
            if not self._waiting:
                return
        elif self._waiting:
            os._exit(128 + number)
        else:
            self._waiting, self._end = number, time.monotonic() + _LONGEST
        if _imports(frame):
            if time.monotonic() > self._end:
                os.write(2, INTERRUPTED_LINE.encode())
                os._exit(128 + self._waiting)
            signal.setitimer(signal.ITIMER_REAL, _STEP)
            return
        stopped, self._waiting = self._waiting, 0
        if stopped == signal.SIGTERM:
            sys.exit(TERMINATED)
        raise KeyboardInterrupt


def _imports(frame: FrameType | None) -> bool:
    """Tell whether a frame runs within an import."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib."):
            return True
        frame = frame.f_back
    return False


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
