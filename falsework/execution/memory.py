"""A limit on the memory of a run: of this process and all processes below it, together."""

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from groundwork.errors import InputError
from groundwork.memory import machine_memory, read_kernel_file

SHARE = 0.9  # of the machine's memory that a run may use where nothing else is said [1]
_EVERY = 0.5  # [s] between two looks
_AFTER = 3.0  # [s] for the processes above to end after one was stopped
_OURS = frozenset({"authoring", "render", "recon", "learn", "falsework"})  # rooms whose modules run as child processes


@dataclass(frozen=True)
class Resident:
    """One process and its memory.

    Attributes:
        pid: Its number.
        parent: That of its parent.
        module: Module that it runs; empty if it runs none.
        memory: Its own resident memory, without what it shares with files [GB].
    """

    pid: int
    parent: int
    module: str
    memory: float


@contextmanager
def memory_guard(limit: float | None, note: Callable[[str], None]) -> Iterator[None]:
    """Stop the largest child process whenever this process and all below it use more memory than the limit.

    Workers are not stopped, and neither is this process: the scene of the child fails as if the child was killed from
    outside, and the other scenes continue.

    Args:
        limit: Limit of the sum [GB]; None: `SHARE` of the memory of the machine, container or job.
        note: Called with a line for people.

    Raises:
        InputError: The limit is not positive.
    """
    if limit is not None and not limit > 0.0:
        raise InputError("limit out of range", field="memory", value=limit, allowed="more than 0 GB")
    most = SHARE * machine_memory() if limit is None else limit
    done = threading.Event()
    watcher = threading.Thread(target=_watch, args=(most, note, done), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


def processes_below(root: int) -> list[Resident]:
    """List a process and all processes below it.

    Args:
        root: Number of the process.
    """
    children: dict[int, list[Resident]] = {}
    found: list[Resident] = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit() and (one := _resident(folder)):
            children.setdefault(one.parent, []).append(one)
            if one.pid == root:
                found.append(one)
    for one in found:  # it grows
        found += children.get(one.pid, [])
    return found


def largest_child(alive: Sequence[Resident]) -> Resident | None:
    """Find the largest child process that runs a module of ours; others, such as those of a notebook, are not stopped.

    Args:
        alive: A process, then all processes below it.
    """
    ours = [one for one in alive[1:] if one.module.partition(".")[0] in _OURS]
    return max(ours, key=lambda one: one.memory, default=None)


def _watch(limit: float, note: Callable[[str], None], done: threading.Event) -> None:
    pause = _EVERY
    while not done.wait(pause):
        pause = _EVERY
        alive = processes_below(os.getpid())
        used = sum(one.memory for one in alive)
        largest = largest_child(alive)
        if used <= limit or largest is None:
            continue
        with suppress(ProcessLookupError):
            os.kill(largest.pid, signal.SIGKILL)
            note(
                f"the run used {used:.1f} GB of memory, more than {limit:.1f} GB: {largest.module} "
                f"({largest.memory:.1f} GB) was stopped. Use fewer workers or smaller images, or raise --memory"
            )
        pause = _AFTER


def _resident(folder: Path) -> Resident | None:
    """Read one process; None if it has just ended."""
    try:
        parent = int(read_kernel_file(folder / "stat").rpartition(")")[2].split()[1])
        resident, shared = (int(word) for word in read_kernel_file(folder / "statm").split()[1:3])
        words = read_kernel_file(folder / "cmdline").split("\0")
    except (IndexError, ValueError):
        return None
    module = words[words.index("-m") + 1] if "-m" in words[:-1] else ""
    return Resident(int(folder.name), parent, module, (resident - shared) * os.sysconf("SC_PAGE_SIZE") / 1e9)
