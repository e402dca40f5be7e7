"""What results of each stage have cost so far, in time and on disk; and a look at the disk before more are made."""

import shutil
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from falsework.execution.events import parse_event
from falsework.store.workroom import plain_files
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.files import MANIFEST, read_json

# Seconds and bytes of a result of which nothing is known yet: the demo's, whose cloud is dense; guesses of samples.
DEFAULT_SECONDS = {"stage": 13.7, "capture": 19.7, "model": 160.0, "cloud": 56.1, "sample": 60.0, "report": 2.0}
DEFAULT_BYTES = {"stage": 103e6, "capture": 65e6, "model": 21e6, "cloud": 144e6, "sample": 200e6, "report": 8.5e6}


@dataclass
class RunningStatistics:
    """A quantity of which some values have been seen.

    Attributes:
        count: How many.
        total: Their sum [any unit].
        greatest: The greatest of them [any unit].
    """

    count: int = 0
    total: float = 0.0
    greatest: float = 0.0

    def add(self, value: object) -> None:
        """Take one more; what is no number is left out.

        Args:
            value: The value.
        """
        if isinstance(value, int | float) and 0 <= value < float("inf"):
            self.count, self.total, self.greatest = self.count + 1, self.total + value, max(self.greatest, value)

    @property
    def mean(self) -> float:
        """Their mean [any unit]; there has to be one."""
        return self.total / self.count


@dataclass
class Costs:
    """What the events in `OUT/run` tell, and, where those say nothing of sizes, the stored results.

    Attributes:
        root: Output folder of the run.
    """

    root: Path
    _seconds: dict[str, RunningStatistics] = field(default_factory=dict)
    _bytes: dict[str, RunningStatistics] = field(default_factory=dict)
    _stored: dict[str, RunningStatistics] = field(default_factory=dict)
    _read: dict[Path, int] = field(default_factory=dict)  # bytes of each file that have been taken in

    def seconds(self, stage: str) -> float:
        """Tell how long a result takes in the mean [s].

        Args:
            stage: Its stage.
        """
        self._look()
        seen = self._seconds.get(stage, RunningStatistics())
        return seen.mean if seen.count else DEFAULT_SECONDS[stage]

    def bytes_each(self, stage: str) -> float:
        """Tell how much disk space a result adds in the mean [bytes].

        Args:
            stage: Its stage.
        """
        seen = self._sizes(stage)
        return seen.mean if seen.count else DEFAULT_BYTES[stage]

    def most_bytes(self, stage: str) -> float:
        """Tell how much disk space a result has added at most [bytes].

        Args:
            stage: Its stage.
        """
        seen = self._sizes(stage)
        return seen.greatest if seen.count else DEFAULT_BYTES[stage]

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
        """Take in the lines that have come since the last time; other processes write, too."""
        sizes = {path: path.stat().st_size for path in sorted((self.root / "run").glob("*.jsonl")) if path.is_file()}
        if any(sizes.get(path, 0) < read for path, read in self._read.items()):  # another run has taken its place
            for table in (self._seconds, self._bytes, self._stored, self._read):
                table.clear()
        for path, size in sizes.items():
            begin = self._read.get(path, 0)
            if size > begin:
                with path.open("rb") as file:
                    file.seek(begin)
                    data = file.read()
                whole = data.rfind(b"\n") + 1  # somebody may be writing the last line
                self._read[path] = begin + whole
                for line in data[:whole].splitlines():
                    self._take(line)

    def _take(self, line: bytes) -> None:
        event = parse_event(line)
        if event is not None and event.get("made") is True and isinstance(event.get("stage"), str):
            self._seconds.setdefault(event["stage"], RunningStatistics()).add(event.get("seconds"))
            self._bytes.setdefault(event["stage"], RunningStatistics()).add(event.get("bytes"))


@lru_cache(maxsize=8)
def costs_of(root: Path) -> Costs:
    """Give the costs of a run, of which a process reads each line once.

    Args:
        root: Output folder of the run.
    """
    return Costs(root)


def bytes_added(folder: Path) -> int:
    """Measure what a result added to the disk [bytes]: textures that other scenes had before count nothing.

    Args:
        folder: Folder of the result; one that is gone already added nothing.
    """
    return sum(
        one.st_size for one in plain_files(folder) if one.st_nlink <= 2
    )  # its own link, and that of the run's textures


def free_space(path: Path) -> int:
    """Tell how much a file system has left for us [bytes].

    Args:
        path: A file or folder on it; where it is not there yet, the folder that it would be in counts.
    """
    while not path.exists() and path != path.parent:
        path = path.parent
    return shutil.disk_usage(path).free


def check_space(root: Path, stage: str, key: str) -> None:
    """Stop before work that the disk has no room for.

    Args:
        root: Output folder of the run.
        stage: Stage of the result that is about to be made.
        key: Key of it; what an interrupted run made of it is there already.

    Raises:
        OutOfSpaceError: Less is free than a result of that stage has needed at most.
    """
    there = sum(one.st_size for one in plain_files(root / "work" / key))
    needed, free = costs_of(root).most_bytes(stage) - there, free_space(root)
    if free < needed:
        raise OutOfSpaceError(
            f"{root}: the next result ({stage}) may need {needed / 1e6:.1f} MB of disk space, {free / 1e6:.1f} MB are "
            "free. Free some, then run the same command again"
        )


def _stored_sizes(root: Path, stage: str) -> RunningStatistics:
    """Measure the results that are there, from their manifests."""
    seen = RunningStatistics()
    for path in sorted((root / "store" / stage).glob(f"*/{MANIFEST}")):
        try:
            files = read_json(path)["files"]
            seen.add(sum(row["bytes"] for row in files.values()))
        except (InputError, OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            continue  # `verify` tells what is wrong with it
    return seen
