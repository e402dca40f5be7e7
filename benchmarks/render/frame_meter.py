"""What the images of a survey cost while they are drawn, without what their survey costs once."""

import os
import resource
import time
from contextlib import suppress
from pathlib import Path

WARM = 16  # images after which every worker has begun, and shadows and textures are there


class FrameMeter:
    """A listener that looks at the processor time of all workers whenever an image is finished."""

    def __init__(self) -> None:
        """Begin with no image."""
        self._rendering = False
        self._seen: list[tuple[float, float]] = []  # after each image

    def stage(self, name: str, total: int) -> None:
        """Listen to images only.

        Args:
            name: What is being done.
            total: How many units it has.
        """
        self._rendering = name == "render"

    def advance(self, done: int) -> None:
        """Look at the clocks: one more image is finished.

        Args:
            done: Images finished so far, as far as known: a worker that has finished none yet counts as done.
        """
        if self._rendering:
            self._seen.append((processor_time(), time.perf_counter()))

    def note(self, message: str) -> None:
        """Ignore a line."""

    def per_frame(self) -> tuple[float, float]:
        """Measure an image after the first `WARM`: processor time of all threads, waiting time [s].

        Raises:
            RuntimeError: Too few images were reported.
        """
        more = len(self._seen) - WARM
        if more < 1:
            raise RuntimeError(f"{len(self._seen)} images reported, more than {WARM} are needed")
        (before, begin), (after, end) = self._seen[WARM - 1], self._seen[-1]
        return (after - before) / more, (end - begin) / more


def processor_time() -> float:
    """Return the processor time of all children of this process, finished and running [s]."""
    while True:
        gone = _gone()
        total = gone + sum(_spent(child) for child in _children())
        if _gone() == gone:  # else one went between the two looks, and is in neither
            return total


def _gone() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _children() -> list[int]:
    found = []
    for file in Path("/proc/self/task").glob("*/children"):
        with suppress(OSError):  # a thread that ends meanwhile has no children to wait for
            found += [int(child) for child in file.read_text(encoding="ascii").split()]
    return found


def _spent(process: int) -> float:
    """Read the time of a process and of its own children that are gone."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="ascii")
    except OSError:  # gone meanwhile
        return 0.0
    ticks = text.rpartition(")")[2].split()[11:15]  # fields 14 to 17: user, system, and the same of its children
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
