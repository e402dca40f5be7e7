"""Files and folders are whole or absent: under kills, full disks and foreign content."""

import errno
import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from groundwork import files
from groundwork.canonical import folder_digest
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.files import (
    MANIFEST,
    check_manifest,
    claim_output,
    commit_folder,
    fresh_output,
    read_json,
    sole_writer,
    space_errors,
    write_bytes,
    write_json,
    write_manifest,
)

ROOT = Path(__file__).resolve().parents[2]


def python(code: str, *arguments: object) -> subprocess.Popen[str]:
    """Start a Python program from the repository's root."""
    command = [sys.executable, "-c", code, *(str(argument) for argument in arguments)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


WRITER = """
import sys
from pathlib import Path
from groundwork.files import write_bytes
path = Path(sys.argv[1])
write_bytes(path, b"a" * 2_000_000)
print("ready", flush=True)
while True:
    write_bytes(path, b"b" * 3_000_000)
    write_bytes(path, b"a" * 2_000_000)
"""


@pytest.mark.faults
def test_a_killed_writer_leaves_a_whole_file(tmp_path: Path) -> None:
    """Whenever the writer is killed, the file is one of the two contents."""
    rng = random.Random(0)
    path = tmp_path / "file"
    for _ in range(5):
        process = python(WRITER, path)
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(rng.uniform(0.0, 0.05))
        process.kill()
        process.communicate()
        assert path.read_bytes() in (b"a" * 2_000_000, b"b" * 3_000_000)


def test_readers_see_old_or_new(tmp_path: Path) -> None:
    """A handle opened before a write keeps the old content, one opened after has the new."""
    path = tmp_path / "file"
    write_bytes(path, b"old")
    with path.open("rb") as before:
        write_bytes(path, b"new")
        assert before.read() == b"old"
    assert path.read_bytes() == b"new"
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


LIMITED = """
import resource, sys
from pathlib import Path
from groundwork.errors import OutOfSpaceError
from groundwork.files import write_bytes
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    write_bytes(Path(sys.argv[1]), b"x" * 5000)
except OutOfSpaceError as error:
    sys.exit(error.exit_code)
"""


@pytest.mark.faults
def test_no_space_left_keeps_the_old_file(tmp_path: Path) -> None:
    """A write that hits a limit of the system is out of space, exit code 4, and the old file stays."""
    path = tmp_path / "file"
    write_bytes(path, b"old")
    process = python(LIMITED, path)
    process.communicate()
    assert process.returncode == 4
    assert path.read_bytes() == b"old"


@pytest.mark.parametrize(
    ("number", "kind"),
    [
        (errno.ENOSPC, OutOfSpaceError), (errno.EDQUOT, OutOfSpaceError), (errno.EFBIG, OutOfSpaceError),
        (errno.EACCES, InputError), (errno.EROFS, InputError), (errno.EIO, OSError),
    ],
)  # fmt: skip
def test_space_errors(number: int, kind: type[Exception]) -> None:
    """System errors become what a user can act on; others pass."""
    with pytest.raises(kind) as caught, space_errors(Path("here")):
        raise OSError(number, os.strerror(number))
    assert (type(caught.value) is OSError) == (kind is OSError)


def test_json_files(tmp_path: Path) -> None:
    """Sorted keys, a final line end, and a round trip; bad JSON is bad input."""
    path = tmp_path / "a.json"
    write_json(path, {"b": (1, 2), "a": Path("x/y")})
    assert path.read_text() == '{\n  "a": "x/y",\n  "b": [\n    1,\n    2\n  ]\n}\n'
    assert read_json(path) == {"a": "x/y", "b": [1, 2]}
    path.write_text("{")
    with pytest.raises(InputError, match="not readable as JSON"):
        read_json(path)
    with pytest.raises(InputError, match="no such file"):
        read_json(tmp_path / "gone")


def test_manifest_finds_every_kind_of_damage(tmp_path: Path) -> None:
    """Missing, changed and extra files are named; an intact folder is silent."""
    (tmp_path / "in").mkdir()
    for name in ("a", "b", "in/c"):
        (tmp_path / name).write_text(name)
    write_manifest(tmp_path, {"stage": "render"})
    assert check_manifest(tmp_path) == []
    assert read_json(tmp_path / MANIFEST)["files"]["in/c"]["bytes"] == 4
    (tmp_path / "a").unlink()
    (tmp_path / "in" / "c").write_text("in/x")
    (tmp_path / "extra").write_text("")
    assert check_manifest(tmp_path) == ["a: missing", "extra: not in the manifest", "in/c: changed"]


def test_commit_folder(tmp_path: Path) -> None:
    """A finished folder moves as a whole, parents are made, and an existing target is not overwritten."""
    partial = tmp_path / "work"
    (partial / "deep").mkdir(parents=True)
    (partial / "deep" / "file").write_text("x")
    final = tmp_path / "store" / "key"
    commit_folder(partial, final)
    assert (final / "deep" / "file").read_text() == "x"
    assert not partial.exists()
    (tmp_path / "again" / "file").mkdir(parents=True)
    with pytest.raises(OSError, match="not empty"):
        commit_folder(tmp_path / "again", final)


def writes(text: str) -> Callable[[Path], None]:
    """A writer of one file."""

    def write(folder: Path) -> None:
        (folder / "file").write_text(text)

    return write


def test_fresh_output_replaces_only_its_own_kind(tmp_path: Path) -> None:
    """Absent, empty and former outputs are filled; another kind is refused; nothing else is left behind."""
    out = tmp_path / "out"
    fresh_output(out, "capture", writes("1"))
    fresh_output(out, "capture", writes("2"))
    assert (out / "file").read_text() == "2"
    with pytest.raises(InputError, match="the output folder holds capture"):
        fresh_output(out, "cloud", writes("3"))
    assert (out / "file").read_text() == "2"
    (tmp_path / "empty").mkdir()
    fresh_output(tmp_path / "empty", "cloud", writes("4"))
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["empty", "out"]


@pytest.mark.parametrize("resume", [False, True])
def test_fresh_output_is_written_by_one_command_at_a_time(resume: bool, tmp_path: Path) -> None:
    """A second command for the same folder is refused while the first one writes, and takes nothing from it."""
    out = tmp_path / "out"

    def write(folder: Path) -> None:
        writes("first")(folder)
        with pytest.raises(InputError, match="another command is writing this folder"):
            fresh_output(out, "cloud", writes("second"), resume=resume)

    fresh_output(out, "cloud", write, resume=resume)
    fresh_output(tmp_path / "other", "cloud", writes("first"))
    assert folder_digest(out) == folder_digest(tmp_path / "other")
    fresh_output(out, "cloud", writes("second"), resume=resume)


def test_a_folder_filled_meanwhile_is_kept(tmp_path: Path) -> None:
    """What somebody put into the output folder while it was written stays; the finished work stays beside it."""
    out = tmp_path / "out"

    def write(folder: Path) -> None:
        writes("long work")(folder)
        out.mkdir()
        (out / "notes.txt").write_text("mine")

    with pytest.raises(InputError, match="files that Falsework did not write"):
        fresh_output(out, "cloud", write, resume=True)
    assert (out / "notes.txt").read_text() == "mine"
    (out / "notes.txt").unlink()
    seen: list[str] = []
    fresh_output(out, "cloud", lambda folder: seen.append((folder / "file").read_text()), resume=True)
    assert seen == ["long work"]


def test_fresh_output_through_links(tmp_path: Path) -> None:
    """A link to a folder stays one, and has the folder's lock; a link in the place of the work is not followed."""
    out, link, other = tmp_path / "out", tmp_path / "link", tmp_path / "other"
    link.symlink_to("out")
    other.mkdir()
    writes("mine")(other)
    (tmp_path / ".out.partial").symlink_to("other")

    def write(folder: Path) -> None:
        writes("first")(folder)
        with pytest.raises(InputError, match="another command is writing this folder"):
            fresh_output(out, "cloud", writes("second"))

    for _ in range(2):
        fresh_output(link, "cloud", write)
    assert link.is_symlink()
    assert (out / "file").read_text() == "first"
    assert (other / "file").read_text() == "mine"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["link", "other", "out"]


def test_a_lock_removed_while_we_took_it_is_not_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A former holder removes its lock file between our opening and our locking: the lock is taken anew."""
    out, removed = tmp_path / "out", []
    lock = files.fcntl.flock

    def slow(handle: int, operation: int) -> None:
        if not removed:
            removed.append((tmp_path / ".out.lock").unlink())
        lock(handle, operation)

    monkeypatch.setattr(files.fcntl, "flock", slow)
    with sole_writer(out):
        assert removed
        with pytest.raises(InputError, match="another command is writing this folder"), sole_writer(out):
            pass
    assert not list(tmp_path.iterdir())


def test_fresh_output_refuses_foreign_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with somebody's files, or a file, is never touched, and nothing is written."""
    (tmp_path / "holiday.jpg").write_text("mine")
    called: list[Path] = []
    with pytest.raises(InputError, match="files that Falsework did not write") as caught:
        fresh_output(tmp_path, "capture", called.append)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="is a file"):
        fresh_output(tmp_path / "holiday.jpg", "capture", called.append)
    (tmp_path / "new" / "deep").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "new" / "deep")
    for here in (Path(), tmp_path / "new"):
        with pytest.raises(InputError, match="is the folder that you are in"):
            fresh_output(here, "capture", called.append)
    assert not called
    assert (tmp_path / "holiday.jpg").read_text() == "mine"


def test_a_failing_writer_leaves_the_former_output(tmp_path: Path) -> None:
    """An error halfway keeps what was there; the next call succeeds."""
    out = tmp_path / "out"
    fresh_output(out, "capture", writes("old"))

    def fail(folder: Path) -> None:
        (folder / "file").write_text("half")
        raise RuntimeError("broke")

    with pytest.raises(RuntimeError, match="broke"):
        fresh_output(out, "capture", fail)
    assert (out / "file").read_text() == "old"
    fresh_output(out, "capture", writes("new"))
    assert (out / "file").read_text() == "new"
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


KILLED = """
import os, signal, sys
from pathlib import Path
from groundwork.files import fresh_output

def write(folder):
    (folder / "file").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)

fresh_output(Path(sys.argv[1]), "capture", write)
"""


@pytest.mark.faults
def test_a_killed_output_leaves_the_former_one(tmp_path: Path) -> None:
    """A kill halfway keeps what was there, and the next call cleans up and succeeds."""
    out = tmp_path / "out"
    fresh_output(out, "capture", writes("old"))
    process = python(KILLED, out)
    process.communicate()
    assert process.returncode == -9
    assert (out / "file").read_text() == "old"
    fresh_output(out, "capture", writes("new"))
    assert (out / "file").read_text() == "new"
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


def test_unwritable_places_are_refused_beforehand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The nearest existing parent must be a folder that may be written."""
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file: is a file, not a folder"):
        claim_output(tmp_path / "file" / "below", "capture")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for name in ("loop", "loop/below"):
        with pytest.raises(InputError, match=r"loop: is a link that leads to itself"):
            fresh_output(tmp_path / name, "capture", writes("nothing"))
    with pytest.raises(InputError, match="proc: not writable"):  # its rights say otherwise
        fresh_output(Path("/proc/capture"), "capture", writes("nothing"))
    monkeypatch.setattr(files.os, "access", lambda *_: False)
    with pytest.raises(InputError, match="not writable"):
        claim_output(tmp_path / "new" / "deep", "capture")


HOLDER = """
import sys, time
from pathlib import Path
from groundwork.files import folder_lock
with folder_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.mark.faults
def test_a_lock_falls_with_its_holder(tmp_path: Path) -> None:
    """A second process waits for the lock, and gets it the moment the first is killed."""
    path = tmp_path / "lock"
    first = python(HOLDER, path)
    assert first.stdout is not None
    assert first.stdout.readline() == "held\n"
    second = python(HOLDER, path)
    time.sleep(0.3)
    first.kill()
    first.communicate()
    killed = time.monotonic()
    assert second.stdout is not None
    assert second.stdout.readline() == "held\n"
    assert time.monotonic() - killed < 10.0
    second.kill()
    second.communicate()
