"""Children answer, report progress, and are stopped, whatever they do; and they die with their parent."""

import contextlib
import errno
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from groundwork import child
from groundwork.canonical import canonical_json
from groundwork.child import run_child
from groundwork.errors import ChildError, InputError, OutOfSpaceError, RejectedSceneError, passing_code

ROOT = Path(__file__).resolve().parents[2]
MODULE = "tests.groundwork.child_work"
ENVIRONMENT = {"PYTHONPATH": str(ROOT)}


def run(do: str, value: object = None, time_limit: float = 60.0, memory_limit: float = 4.0) -> Any:
    """Let the test child do one thing."""
    request = {"do": do, "value": value}
    return run_child(MODULE, request, time_limit=time_limit, memory_limit=memory_limit, environment=ENVIRONMENT)


class Listener:
    """Writes down what it hears."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.heard: list[tuple[object, ...]] = []

    def stage(self, name: str, total: int) -> None:
        """Hear a stage begin."""
        self.heard.append(("stage", name, total))

    def advance(self, done: int) -> None:
        """Hear a step."""
        self.heard.append(("advance", done))

    def note(self, message: str) -> None:
        """Hear a line."""
        self.heard.append(("note", message))


def test_answer_and_progress_come_through_noise() -> None:
    """The answer is exact and progress is heard in order, although the child prints on the same pipe."""
    listener = Listener()
    value = {"numbers": [1, 0.1, 1e300], "text": "Brücke – ok", "nothing": None}
    request = {"do": "echo", "value": value}
    found = run_child(MODULE, request, time_limit=60, memory_limit=4, progress=listener, environment=ENVIRONMENT)
    assert found == value
    assert listener.heard == [("stage", "echo", 2), ("advance", 1), ("note", "half way – über"), ("advance", 2)]


def test_what_a_listener_raises_ends_the_child() -> None:
    """A progress bar whose terminal is gone: its own error comes out at once, not one of the child, which is ended."""

    class Broken(Listener):
        def stage(self, name: str, total: int) -> None:
            raise BrokenPipeError("the terminal is gone")

    for value in ("short", list(range(200_000))):  # with an answer that no pipe holds
        request = {"do": "echo", "value": value}
        with pytest.raises(BrokenPipeError, match="the terminal is gone"):
            run_child(MODULE, request, time_limit=60, memory_limit=4, progress=Broken(), environment=ENVIRONMENT)


def test_environment_is_added() -> None:
    """Given variables reach the child, and the parent's own stay."""
    assert run("environment", "PYTHONPATH") == str(ROOT)
    assert run("environment", "PATH") == os.environ["PATH"]


def test_a_large_request_and_answer() -> None:
    """Neither side waits for the other when both pipes are full."""
    value = list(range(200_000))
    assert run("echo", value) == value


@pytest.mark.faults
def test_time_limit() -> None:
    """A child that hangs is killed near its limit and the error says so."""
    begin = time.monotonic()
    with pytest.raises(ChildError, match="ran longer than 1 s"):
        run("sleep", 120, time_limit=1.0)
    assert time.monotonic() - begin < 90.0


def test_waiting_for_a_core_is_no_fault_of_the_child(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the kernel says that a child waited is not counted; where it says nothing, all is."""
    monkeypatch.setattr(child, "_waited", lambda pid: 1e6)
    assert run("sleep", 2, time_limit=0.5) is None
    monkeypatch.undo()
    assert child._waited(os.getpid()) >= 0.0
    assert child._waited(2**22 + 1) == 0.0  # no such process


@pytest.mark.faults
def test_memory_limit() -> None:
    """A child that eats the memory is killed and the error says so."""
    with pytest.raises(ChildError, match=r"used more than 0\.2 GB"):
        run("eat", 400_000_000, memory_limit=0.2)


@pytest.mark.faults
def test_death_by_signal() -> None:
    """An abort in native code is named by its signal."""
    with pytest.raises(ChildError, match="died of SIGABRT"):
        run("abort")


def test_errors_keep_their_kind_and_text() -> None:
    """Bad input, rejected scenes and crashes arrive as what they are, in one line."""
    with pytest.raises(InputError, match=r"^scene\.usda: spans: wrong \(found -1\)\. Be positive$"):
        run("input")
    with pytest.raises(RejectedSceneError, match="3 of 40 cameras") as caught:
        run("reject")
    assert caught.value.reason == "too_few_cameras"
    with pytest.raises(ChildError, match="failed with exit code 1: ZeroDivisionError: the deck is infinitely thin"):
        run("fail")
    with pytest.raises(OutOfSpaceError, match="disk: full"):
        run("space")
    for code, passing in ((errno.EIO, errno.EIO), (errno.EACCES, 0)):
        with pytest.raises(InputError, match=r"scene\.usda: cannot be opened") as told:
            run("device", code)
        assert passing_code(told.value) == passing


def test_files_of_the_current_folder_are_not_taken_for_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A user's `tests.py`, and a package of the name of one of our rooms, are none of the child's business."""
    for name in ("tests.py", "json.py", "groundwork/__init__.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("raise RuntimeError('not ours')\n")
    monkeypatch.chdir(tmp_path)
    assert run("echo", [1]) == [1]


def test_a_module_that_is_not_there() -> None:
    """A child that cannot even start ends in its own last line."""
    with pytest.raises(ChildError, match="No module named"):
        run_child("tests.groundwork.nothing_here", {}, time_limit=60, memory_limit=4, environment=ENVIRONMENT)


@pytest.mark.faults
def test_children_die_with_their_parent(tmp_path: Path) -> None:
    """When the parent is killed without a chance to clean up, its child is gone too."""
    mark = tmp_path / "pid"
    request = canonical_json({"do": "parent", "value": str(mark)}).encode() + b"\n"
    with started(request) as parent:
        pid = int(awaited(mark))
        parent.kill()
        parent.wait()
        deadline = time.monotonic() + 60.0
        while alive(pid) and time.monotonic() < deadline:
            time.sleep(0.02)
        assert not alive(pid)


@contextlib.contextmanager
def started(request: bytes) -> Iterator[subprocess.Popen[bytes]]:
    """Start the test child as a parent of its own."""
    process = subprocess.Popen(
        [sys.executable, "-m", MODULE],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        env={**os.environ, **ENVIRONMENT},
    )
    assert process.stdin is not None
    process.stdin.write(request)
    process.stdin.close()
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def awaited(path: Path) -> str:
    """Wait for a file with content."""
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        if path.exists() and path.read_text():
            return path.read_text()
        time.sleep(0.02)
    raise TimeoutError(path)


def alive(pid: int) -> bool:
    """Tell whether a process runs, zombies not counted."""
    try:
        os.kill(pid, 0)
        state = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()[0]
    except (ProcessLookupError, FileNotFoundError):
        return False
    return state != "Z"
