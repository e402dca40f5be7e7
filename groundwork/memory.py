"""Memory of the machine, of a container, or of a queue's job."""

import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

_GROUPS = ("sys/fs/cgroup", "memory.max")  # control groups of version 2: their folder, and the file of a limit
_OLD_GROUPS = ("sys/fs/cgroup/memory", "memory.limit_in_bytes")  # of version 1


def machine_memory(root: Path = Path("/")) -> float:
    """Read the memory of the machine, or of the container or the job of a queue if that is less [GB].

    Args:
        root: Folder that holds `proc` and `sys`.
    """
    limits = [read_kernel_file(file).strip() for file in _limit_files(root)]
    return min([_stated(root, "MemTotal:"), *(int(limit) / 1e9 for limit in limits if limit.isdigit())])


def available_memory(root: Path = Path("/")) -> float:
    """Read how much more memory this process can use: what is free, below the limit of its container or job [GB].

    Args:
        root: Folder that holds `proc` and `sys`.
    """
    pages = int(read_kernel_file(root / "proc/self/statm").split()[1])
    own = pages * os.sysconf("SC_PAGE_SIZE") / 1e9
    return max(min(_stated(root, "MemAvailable:"), machine_memory(root) - own), 0.0)


def read_kernel_file(path: Path) -> str:
    """Read a file of `/proc` or `/sys`; empty if it is gone.

    Args:
        path: The file.
    """
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _stated(root: Path, name: str) -> float:
    """Read one row of the machine's memory [GB]."""
    line = next(line for line in read_kernel_file(root / "proc/meminfo").splitlines() if line.startswith(name))
    return int(line.split()[1]) * 1024 / 1e9


def _limit_files(root: Path) -> Iterator[Path]:
    """List where this process's control groups and those above them state a limit: a job is below a group of others."""
    for line in read_kernel_file(root / "proc/self/cgroup").splitlines():
        _, controllers, group = line.split(":", 2)
        if not controllers or "memory" in controllers.split(","):
            folder, name = _OLD_GROUPS if controllers else _GROUPS
            place = PurePosixPath(group.lstrip("/"))
            yield from (root / folder / above / name for above in (place, *place.parents))
