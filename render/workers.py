"""Rendering of one survey by one or more processes: each draws a share of the frames, and a last step finishes it."""

import threading
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from groundwork.child import run_child
from groundwork.errors import ChildError
from groundwork.progress import Progress

_MODULE = "render.frames"
# One heap for all threads, so that memory freed by the driver is reused by the threads that encode, and vice versa.
_ONE_HEAP = {"MALLOC_ARENA_MAX": "1"}


def render_survey(
    request: dict[str, Any], *, time_limit: float, memory_limit: float, progress: Progress
) -> dict[str, Any]:
    """Render one survey in child processes; the bytes do not depend on how many there are.

    If a worker dies, only its unfinished frames are lost: the process that finishes the capture draws the missing ones.

    Args:
        request: Request of `render.frames`; its `settings` state the number of `workers`.
        time_limit: Wall time after which a process is stopped [s].
        memory_limit: Resident memory above which a process is stopped [GB].
        progress: Listener.

    Returns:
        Answer of `render.frames`.

    Raises:
        InputError: The request or the stage is wrong.
        ChildError: The process that finishes the capture failed.
    """
    count = int(request["settings"].get("workers", 1))
    if count > 1:
        together = _Together(progress, count)
        with ThreadPoolExecutor(count) as pool:
            running: list[Future[Any]] = [
                pool.submit(
                    run_child,
                    _MODULE,
                    {**request, "share": [number, count]},
                    time_limit=time_limit,
                    memory_limit=memory_limit,
                    progress=together.listener(number),
                    # Otherwise a driver on the CPU uses every core for each of them.
                    environment={**_ONE_HEAP, "LP_NUM_THREADS": "0"},
                )
                for number in range(count)
            ]
        for worker in running:
            error = worker.exception()
            if isinstance(error, ChildError):
                progress.note(f"{error}; its frames are rendered again")
            elif error is not None:
                raise error
    return run_child(
        _MODULE, request, time_limit=time_limit, memory_limit=memory_limit, progress=progress, environment=_ONE_HEAP
    )


class _Together:
    """Progress of several workers as one."""

    def __init__(self, progress: Progress, count: int) -> None:
        self._progress, self._lock = progress, threading.Lock()
        self._total, self._missing = 0, [-1] * count
        self._said: set[str] = set()

    def listener(self, number: int) -> "_Listener":
        return _Listener(self, number)

    def begin(self, name: str, total: int) -> None:
        with self._lock:
            if name not in self._said:
                self._said.add(name)
                self._progress.stage(name, total)
            self._total = total

    def report(self, number: int, done: int) -> None:
        with self._lock:
            self._missing[number] = self._total - done
            known = [missing for missing in self._missing if missing >= 0]
            self._progress.advance(max(self._total - sum(known), 0))

    def note(self, message: str) -> None:
        with self._lock:
            if message not in self._said:
                self._said.add(message)
                self._progress.note(message)


class _Listener:
    """Listener of one worker."""

    def __init__(self, together: _Together, number: int) -> None:
        self._together, self._number = together, number

    def stage(self, name: str, total: int) -> None:
        self._together.begin(name, total)

    def advance(self, done: int) -> None:
        self._together.report(self._number, done)

    def note(self, message: str) -> None:
        self._together.note(message)
