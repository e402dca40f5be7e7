"""Every system call of an output in the making fails or is the last one: the old output or the new, never half."""

import errno
import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from groundwork import files
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.marks import MARK, NEXT
from groundwork.output import swap as output_swap
from groundwork.output.file import SIGNATURE, write_fresh_file
from groundwork.output.folder import fresh_output
from groundwork.output.reading import reading
from groundwork.output.swap import FILES, READY
from tests.falsework.forked import end_of

CALLS = ("mkdir", "open", "write", "fsync", "replace", "rename", "unlink", "rmdir")
OLD = {"a": "old a", "gone/b": "old b", "turns": "was a file", "into/c": "was in a folder"}
NEW = {"a": "new a", "deep/er/d": "new d", "turns/e": "is in a folder", "into": "is a file"}
MINE = {"notes.txt": "mine", "gone/mine": "mine"}

pytestmark = pytest.mark.faults
Hook = Callable[[int, str, tuple[Any, ...], bool], None]


@pytest.fixture(autouse=True)
def disk_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the waiting out of fsync: which calls are made is traced, and no power is cut here."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


@contextmanager
def traced(hook: Hook) -> Iterator[None]:
    """Call `hook(number, name, arguments, is_after)` before and after each system call that changes the disk."""
    count = 0
    originals = {name: getattr(os, name) for name in CALLS}

    def watched(name: str, *arguments: Any, **more: Any) -> Any:
        nonlocal count
        number, count = count, count + 1
        hook(number, name, arguments, False)
        try:
            result = originals[name](*arguments, **more)
        except OSError:
            hook(number, "failed", arguments, True)
            raise
        hook(number, name, arguments, True)
        return result

    for name in CALLS:
        setattr(os, name, functools.partial(watched, name))
    try:
        yield
    finally:
        for name, original in originals.items():
            setattr(os, name, original)


def fill(table: dict[str, str]) -> Callable[[Path], None]:
    """Write a table of files, as a resuming verb does: what is there already stays."""

    def write(folder: Path) -> None:
        for name, text in table.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            files.write_bytes(folder / name, text.encode())

    return write


def begin(parent: Path) -> Path:
    """Make an old output with files of the user's in it, and folders of the user's beside it."""
    out = parent / "out"
    fresh_output(out, "cloud", fill(OLD))
    for name, text in MINE.items():
        (out / name).write_text(text)
    for name in (".out.partial", ".out.former"):
        (parent / name).mkdir()
        (parent / name / "mine").write_text("mine")
    return out


def found(out: Path) -> dict[str, str]:
    """Read every file of an output but what is the protocol's."""
    return {
        path.relative_to(out).as_posix(): path.read_text()
        for path in sorted(out.rglob("*"))
        if path.is_file() and path.name != MARK and NEXT not in path.relative_to(out).parts
    }


def check(out: Path, *, fresh: bool) -> str:
    """See what a reader gets, and that the next command ends well with nothing of others gone; say which it was."""
    before = {} if fresh else {**OLD, **MINE}
    mine = {} if fresh else MINE
    if out.exists() and found(out):
        with reading(out):
            seen = found(out)
        assert seen in (before, {**NEW, **mine})
    else:
        assert fresh
        seen = {}
    fresh_output(out, "cloud", fill(NEW), resume=True)
    assert found(out) == {**NEW, **mine}
    assert sorted(path.name for path in out.iterdir()) == sorted(
        {MARK, *(name.partition("/")[0] for name in {**NEW, **mine})}
    )
    if not fresh:
        for name in (".out.partial", ".out.former"):
            assert (out.parent / name / "mine").read_text() == "mine"
    left = {path.name for path in out.parent.iterdir()} - {".out.partial", ".out.former"}
    assert left == {"out"}
    return "new" if seen == {**NEW, **mine} else "old"


def in_a_fork(work: Callable[[], None]) -> int:
    """Run something in a copy of this process; return its exit code."""
    pid = os.fork()
    if not pid:
        try:
            work()
            os._exit(0)
        except BaseException:
            os._exit(1)
    return end_of(pid)


class Killed(BaseException):
    """The process is dead: nothing that it would still do reaches the disk."""


def killed_at(call: int) -> Hook:
    """Die at one call, and let none after it through, whatever a dying program would tidy up."""

    def die(at: int, name: str, arguments: tuple[Any, ...], is_after: bool) -> None:
        if at >= call:
            raise Killed

    return die


def failing_at(call: int, number: int) -> Hook:
    """Let one call fail with an error of the system."""

    def fail(at: int, name: str, arguments: tuple[Any, ...], is_after: bool) -> None:
        if at == call and not is_after:
            raise OSError(number, os.strerror(number))

    return fail


def calls_of(work: Callable[[], object]) -> int:
    """Count the system calls of a run that nobody disturbs."""
    numbers: list[int] = []
    with traced(lambda number, name, arguments, is_after: numbers.append(number)):
        work()
    return max(numbers) + 1


@pytest.mark.parametrize("fresh", [False, True], ids=["over a former one", "where none was"])
def test_killed_at_every_call(fresh: bool, tmp_path: Path) -> None:
    """Killed before or after any call: a reader gets the old output or the new, and the same command mends the rest."""

    def place(name: str) -> Path:
        (tmp_path / name).mkdir()
        return tmp_path / name / "out" if fresh else begin(tmp_path / name)

    def work(out: Path) -> None:
        fresh_output(out, "cloud", fill(NEW), resume=True)

    calm = place("calm")
    total = calls_of(lambda: work(calm))
    assert total > 60
    seen: list[str] = []
    for number in range(total):
        out = place(str(number))
        with pytest.raises(Killed), traced(killed_at(number)):
            work(out)
        seen.append(check(out, fresh=fresh))
    assert {"old", "new"} == set(seen)
    assert seen == sorted(seen, reverse=True)  # once new, it is never old again


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_failing_at_every_call(number: int, tmp_path: Path) -> None:
    """A full or broken disk at any call ends in an error, with the old output or the new, and later in the new."""
    total = calls_of(lambda: fresh_output(begin(tmp_path), "cloud", fill(NEW), resume=True))
    begun = calls_of(lambda: begin_in(tmp_path / "counted"))
    raised: list[OSError] = []
    for call in range(total - begun):
        out = begin_in(tmp_path / str(call))
        try:
            with traced(failing_at(call, number)):
                fresh_output(out, "cloud", fill(NEW), resume=True)
        except OSError as error:
            raised.append(error)
        check(out, fresh=False)
    assert [error for error in raised if isinstance(error, OutOfSpaceError) != (number == errno.ENOSPC)] == []
    assert len(raised) > (total - begun) // 2  # to tidy up may fail in silence


def begin_in(parent: Path) -> Path:
    """Begin in a folder of its own."""
    parent.mkdir()
    return begin(parent)


class Disk:
    """What a power cut would leave: names and contents that were not synced may be lost."""

    def __init__(self) -> None:
        """Nothing is open yet."""
        self.names: dict[int, str] = {}
        self.dirty: set[str] = set()
        self.at_ready: set[str] = set()
        self.at_mark: set[str] | None = None
        self.marked = ""
        self.is_mark_synced = False

    def __call__(self, number: int, name: str, arguments: tuple[Any, ...], is_after: bool) -> None:
        """Follow one call."""
        if name == "replace" and not is_after:
            source, target = map(str, arguments)
            if target.endswith(READY):
                self.at_ready = {path for path in self.dirty if "/files" in path}
            elif source.endswith(READY):
                self.at_mark = set(self.dirty)
                self.marked = os.path.dirname(target)  # noqa: PTH120 - called for every system call
        if not is_after:
            return
        if name in ("write", "fsync"):
            path = str(Path(f"/proc/self/fd/{arguments[0]}").readlink())
            self.is_mark_synced |= name == "fsync" and path == self.marked
            (self.dirty.add if name == "write" else self.dirty.discard)(path)
        elif name in ("mkdir", "unlink", "rmdir"):
            self.dirty.discard(str(arguments[0]))
            self.dirty.add(os.path.dirname(str(arguments[0])))  # noqa: PTH120 - called for every system call
        elif name in ("replace", "rename"):
            source, target = map(str, arguments)
            if source in self.dirty:
                self.dirty.discard(source)
                self.dirty.add(target)
            self.dirty |= {os.path.dirname(source), os.path.dirname(target)}  # noqa: PTH120


def test_everything_is_on_the_disk_before_it_is_said_to_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No file is unsynced when `ready` is written, no name when the mark is; without fsync this test would fail."""
    out = tmp_path / "out"
    fresh_output(out, "cloud", fill(OLD))
    disk = Disk()
    with traced(disk):
        fresh_output(out, "cloud", fill(NEW))
    inside = {path for path in disk.at_mark or () if NEXT not in path}
    assert (disk.at_ready, inside) == (set(), set())
    assert disk.at_mark is not None
    assert disk.is_mark_synced
    monkeypatch.setattr(files, "sync", lambda path: None)
    monkeypatch.setattr(output_swap, "sync", lambda path: None)
    disk = Disk()
    with traced(disk):
        fresh_output(out, "cloud", fill(OLD))
    assert disk.at_ready
    assert {path for path in disk.at_mark or () if NEXT not in path}


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO, 0])
def test_single_files_at_every_call(number: int, tmp_path: Path) -> None:
    """A single file is the old one or the new one at every moment; where it failed, nothing is left beside it."""
    old, new = (f"{SIGNATURE} {text}".encode() for text in ("old", "new"))
    (tmp_path / "calm").write_bytes(old)
    for call in range(calls_of(lambda: write_fresh_file(tmp_path / "calm", new))):
        path = tmp_path / str(call) / "page.html"
        path.parent.mkdir()
        path.write_bytes(old)
        # that a folder is there already is no error, even where asking for it was one
        with suppress(Killed, OSError), traced(failing_at(call, number) if number else killed_at(call)):
            write_fresh_file(path, new)
        assert path.read_bytes() in (old, new)
        assert number == 0 or len(list(path.parent.iterdir())) == 1
        write_fresh_file(path, new)
        assert path.read_bytes() == new


def test_a_reader_waits_for_nobody(tmp_path: Path) -> None:
    """While another process puts an output into place, reading it is refused and not served by halves."""
    out = begin(tmp_path)
    refused: list[str] = []

    def look(number: int, name: str, arguments: tuple[Any, ...], is_after: bool) -> None:
        if is_after and name == "replace" and str(arguments[1]).startswith(str(out)) and NEXT not in str(arguments[1]):
            code = in_a_fork(lambda: refused_reading(out))
            refused.append(f"{Path(arguments[1]).name} {code}")

    with traced(look):
        fresh_output(out, "cloud", fill(NEW))
    assert refused == ["a 0", "d 0", "into 0", "e 0", f"{MARK} 1"]


def refused_reading(out: Path) -> None:
    """Read, and hope to be refused."""
    with pytest.raises(InputError, match="is being replaced by another command"), reading(out):
        pass


@pytest.mark.parametrize("last", [MARK, READY])
@pytest.mark.parametrize("read", [True, False])
def test_a_kill_at_the_end_of_a_copy(last: str, read: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed before the last files of the work are removed: the copy is read, and the same command ends in one line."""
    out, unlink = tmp_path / "out", Path.unlink

    def write(folder: Path) -> None:
        (folder / "deep").mkdir()
        (folder / "deep/a").write_text("mine")

    def killed(path: Path, missing_ok: bool = False) -> None:
        if path == out / NEXT / last:
            raise SystemExit
        unlink(path, missing_ok)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", killed)
        with pytest.raises(SystemExit):
            fresh_output(out, "copy", write, is_marked=False)
    assert not (out / NEXT / FILES).exists()
    with reading(out) if read else suppress(InputError):  # it is the user's now
        if not read:
            fresh_output(out, "copy", write, is_marked=False)
    assert (out / "deep/a").read_text() == "mine"
    assert (out / NEXT).exists() == (read and last == READY)  # no reader takes it for an output
