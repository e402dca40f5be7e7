"""Time and disk space of results so far, by stage, and the check of free space before further results."""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from falsework.execution.events import parse_event
from falsework.store.workroom import plain_files
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.files import MANIFEST, read_json

# Default seconds and bytes of a result, before any was measured: those of the demo, with a dense cloud; samples
# guessed.
DEFAULT_SECONDS = {"stage": 13.7, "capture": 19.7, "model": 160.0, "cloud": 56.1, "sample": 60.0, "report": 2.0}
DEFAULT_BYTES = {"stage": 103e6, "capture": 65e6, "model": 21e6, "cloud": 144e6, "sample": 200e6, "report": 8.5e6}


@dataclass
class RunningStatistics:
    """Running mean and maximum of a quantity.

    Attributes:
        count: Number of values.
        total: Their sum [any unit].
        greatest: The greatest of them [any unit].
    """

    count: int = 0
    total: float = 0.0
    greatest: float = 0.0

    def add(self, value: object) -> None:
        """Add a value; NaN and infinity are ignored.

        Args:
            value: The value.
        """
        if isinstance(value, int | float) and 0 <= value < float("inf"):
            self.count, self.total, self.greatest = self.count + 1, self.total + value, max(self.greatest, value)

    @property
    def mean(self) -> float:
        """Mean of the values [any unit]; there must be at least one."""
        return self.total / self.count


@dataclass
class Costs:
    """Costs from the events in `OUT/run` and, if those have no sizes, from the stored results.

    Attributes:
        root: Output folder of the run.
        amounts: Time of a result of each stage as a multiple of the demo's, used until one has been measured; 1 for
            a stage that is absent [1].
        sizes: The same of its size [1].
    """

    root: Path
    amounts: Mapping[str, float] = field(default_factory=dict[str, float])
    sizes: Mapping[str, float] = field(default_factory=dict[str, float])
    _seconds: dict[str, RunningStatistics] = field(default_factory=dict)
    _bytes: dict[str, RunningStatistics] = field(default_factory=dict)
    _stored: dict[str, RunningStatistics] = field(default_factory=dict)
    _read: dict[Path, int] = field(default_factory=dict)  # bytes of each file that have been read

    def seconds(self, stage: str) -> float:
        """Return the mean time of a result [s].

        Args:
            stage: Its stage.
        """
        self._look()
        seen = self._seconds.get(stage, RunningStatistics())
        return seen.mean if seen.count else self.amounts.get(stage, 1.0) * DEFAULT_SECONDS[stage]

    def bytes_each(self, stage: str) -> float:
        """Return the mean disk space that a result adds [bytes].

        Args:
            stage: Its stage.
        """
        seen = self._sizes(stage)
        return seen.mean if seen.count else self.sizes.get(stage, 1.0) * DEFAULT_BYTES[stage]

    def most_bytes(self, stage: str) -> float:
        """Return the largest disk space that a result has added [bytes].

        Args:
            stage: Its stage.
        """
        seen = self._sizes(stage)
        return seen.greatest if seen.count else self.sizes.get(stage, 1.0) * DEFAULT_BYTES[stage]

    def is_learned(self, stage: str) -> bool:
        """Tell whether the time of a stage has been measured here.

        Args:
            stage: The stage.
        """
        self._look()
        return self._seconds.get(stage, RunningStatistics()).count > 0

    def _sizes(self, stage: str) -> RunningStatistics:
        self._look()
        seen = self._bytes.get(stage, RunningStatistics())
        if seen.count:
            return seen
        if not self._stored.get(stage, RunningStatistics()).count:
            self._stored[stage] = _stored_sizes(self.root, stage)
        return self._stored[stage]

    def _look(self) -> None:
        """Read the lines added since the last call; other processes write too."""
        sizes = {path: path.stat().st_size for path in sorted((self.root / "run").glob("*.jsonl")) if path.is_file()}
        if any(sizes.get(path, 0) < read for path, read in self._read.items()):  # another run has replaced it
            for table in (self._seconds, self._bytes, self._stored, self._read):
                table.clear()
        for path, size in sizes.items():
            begin = self._read.get(path, 0)
            if size > begin:
                with path.open("rb") as file:
                    file.seek(begin)
                    data = file.read()
                whole = data.rfind(b"\n") + 1  # the last line may be unfinished
                self._read[path] = begin + whole
                for line in data[:whole].splitlines():
                    self._take(line)

    def _take(self, line: bytes) -> None:
        event = parse_event(line)
        if event is not None and event.get("made") is True and isinstance(event.get("stage"), str):
            self._seconds.setdefault(event["stage"], RunningStatistics()).add(event.get("seconds"))
            self._bytes.setdefault(event["stage"], RunningStatistics()).add(event.get("bytes"))


@lru_cache(maxsize=8)
def costs_of(root: Path, sizes: tuple[tuple[str, float], ...] = ()) -> Costs:
    """Return the costs of a run; a process reads each line only once.

    Args:
        root: Output folder of the run.
        sizes: Stage and multiple of the demo's size [1], as in `Costs`.
    """
    return Costs(root, sizes=dict(sizes))


def bytes_added(folder: Path) -> int:
    """Measure the disk space that a result added [bytes]; textures shared with earlier scenes do not count.

    Args:
        folder: Folder of the result; a missing one counts as 0.
    """
    return sum(
        one.st_size for one in plain_files(folder) if one.st_nlink <= 2
    )  # two links: its own, and that of the run's textures


def free_space(path: Path) -> int:
    """Return the free space of a file system for this user [bytes].

    Args:
        path: A file or folder on it; if it does not exist, its nearest existing parent is used.
    """
    while not path.exists() and path != path.parent:
        path = path.parent
    return shutil.disk_usage(path).free


def check_space(root: Path, stage: str, key: str, sizes: Mapping[str, float]) -> None:
    """Refuse to begin work that needs more disk space than is free.

    Args:
        root: Output folder of the run.
        stage: Stage of the result that is about to be made.
        key: Key of the result; files of an interrupted run are subtracted.
        sizes: Size of each stage's results as multiples of the demo's, as in `Costs` [1].

    Raises:
        OutOfSpaceError: Less is free than the largest result of that stage has needed, or, if none was made, than this
            one is expected to need.
    """
    there = sum(one.st_size for one in plain_files(root / "work" / key))
    needed, free = costs_of(root, tuple(sorted(sizes.items()))).most_bytes(stage) - there, free_space(root)
    if free < needed:
        raise OutOfSpaceError(
            f"{root}: the next result ({stage}) may need {needed / 1e6:.1f} MB of disk space, {free / 1e6:.1f} MB are "
            "free. Free some space, then run the same command again"
        )


def _stored_sizes(root: Path, stage: str) -> RunningStatistics:
    """Measure the stored results, from their manifests."""
    seen = RunningStatistics()
    for path in sorted((root / "store" / stage).glob(f"*/{MANIFEST}")):
        try:
            files = read_json(path)["files"]
            seen.add(sum(row["bytes"] for row in files.values()))
        except (InputError, OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            continue  # `verify` reports it
    return seen
