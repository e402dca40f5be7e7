"""One lock for all: it excludes, falls with its holder, says where there is none, and stands over nothing of others."""

import errno
import fcntl
import subprocess
import sys
import time
from pathlib import Path

import pytest

from groundwork import locks
from groundwork.errors import InputError
from groundwork.locks import BusyError, hold_lock

ROOT = Path(__file__).resolve().parents[2]
COUNTERS, TURNS = 3, 25
COUNTER = """
import sys, time
from pathlib import Path
from groundwork.locks import hold_lock
lock, total = (Path(name) for name in sys.argv[1:3])
print("ready", flush=True)
sys.stdin.readline()
for _ in range(int(sys.argv[3])):
    with hold_lock(lock):
        seen = int(total.read_text())
        time.sleep(0.001)
        total.write_text(str(seen + 1))
"""
HOLDER = """
import sys, time
from pathlib import Path
from groundwork.locks import hold_lock
with hold_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def python(code: str, *arguments: object) -> subprocess.Popen[str]:
    """Start a Python program from the repository's root."""
    command = [sys.executable, "-c", code, *(str(argument) for argument in arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe, text=True)


@pytest.mark.faults
def test_no_count_is_lost(tmp_path: Path) -> None:
    """Processes that read, wait and write under the lock lose none of each other's steps."""
    total = tmp_path / "total"
    total.write_text("0")
    processes = [python(COUNTER, tmp_path / "lock", total, TURNS) for _ in range(COUNTERS)]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in processes:
        _, said = process.communicate(timeout=60)
        assert process.returncode == 0, said
    assert int(total.read_text()) == COUNTERS * TURNS


@pytest.mark.faults
def test_a_lock_falls_with_its_holder(tmp_path: Path) -> None:
    """A second process waits for the lock, and gets it the moment the first is killed."""
    path = tmp_path / "lock"
    first = python(HOLDER, path)
    assert first.stdout is not None
    assert first.stdout.readline() == "held\n"
    with pytest.raises(BusyError, match="another process"), hold_lock(path, wait=False):
        pass
    second = python(HOLDER, path)
    time.sleep(0.3)
    first.kill()
    first.communicate()
    assert second.stdout is not None
    assert second.stdout.readline() == "held\n"
    second.kill()
    second.communicate()
    with hold_lock(path, wait=False) as held:
        assert held


def test_a_lock_removed_while_it_was_taken_is_taken_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its former holder removes the file between our opening and our locking: what we hold then is the new file."""
    path, flock, removed = tmp_path / "lock", fcntl.flock, []

    def slow(handle: int, operation: int) -> None:
        if not removed:
            removed.append(path.unlink())
        flock(handle, operation)

    monkeypatch.setattr(fcntl, "flock", slow)
    with hold_lock(path), pytest.raises(BusyError), hold_lock(path, wait=False):
        pass
    assert removed


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_without_locks_is_said_once(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Work goes on there without the lock, knows so, and one line in all says it."""

    def refuse(handle: int, operation: int) -> None:
        raise OSError(number, "no locks")

    locks._say_no_locks.cache_clear()
    monkeypatch.setattr(fcntl, "flock", refuse)
    for name in ("a", "b", "a"):
        with hold_lock(tmp_path / name) as held:
            assert not held
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "this file system has no file locks" in said
    locks._say_no_locks.cache_clear()


@pytest.mark.parametrize("kind", ["folder", "link", "gone"])
def test_what_is_no_lock_stays(kind: str, tmp_path: Path) -> None:
    """A folder or a link under the lock's name is in the way; neither it nor what it leads to is changed."""
    path = tmp_path / "lock"
    if kind == "folder":
        path.mkdir()
    elif kind == "link":
        path.symlink_to(tmp_path / "elsewhere")
    else:
        path = tmp_path / "gone" / "lock"
    with pytest.raises(InputError, match="not a lock file of Falsework"), hold_lock(path):
        pass
    assert not (tmp_path / "elsewhere").exists()


def test_other_errors_are_not_taken_for_missing_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that fails is an error, not a reason to go on without a lock."""

    def fail(handle: int, operation: int) -> None:
        raise OSError(errno.EIO, "a bad disk")

    monkeypatch.setattr(fcntl, "flock", fail)
    with pytest.raises(OSError, match="a bad disk"), hold_lock(tmp_path / "lock"):
        pass
