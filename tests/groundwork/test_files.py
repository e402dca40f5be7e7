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

import groundwork.files
from groundwork.canonical import digest, file_digest, folder_digest
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.files import (
    MANIFEST,
    TEMPORARY,
    commit_folder,
    put_in_place,
    read_json,
    space_errors,
    sweep,
    sweep_folders,
    temporary_name,
    whole_file,
    whole_folder,
    write_bytes,
    write_json,
    write_manifest,
)
from tests.manifest_faults import manifest_faults

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
def test_bytes_are_on_the_disk_before_they_have_their_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole file is synced under its temporary name; what need not last is not waited for."""
    synced: list[tuple[bool, int]] = []

    def sync(handle: int) -> None:
        name = Path(f"/proc/self/fd/{handle}").readlink().name
        synced.append((name.startswith(TEMPORARY), os.fstat(handle).st_size))

    monkeypatch.setattr(os, "fsync", sync)
    write_bytes(tmp_path / "lasting", b"12345")
    assert synced == [(True, 5)]
    write_bytes(tmp_path / "passing", b"12345", durable=False)
    assert len(synced) == 1


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
        (errno.ENOSPC, OutOfSpaceError),
        (errno.EDQUOT, OutOfSpaceError),
        (errno.EFBIG, OutOfSpaceError),
        (errno.EACCES, InputError),
        (errno.EROFS, InputError),
        (errno.EIO, OSError),
    ],
)
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
    assert manifest_faults(tmp_path) == []
    assert read_json(tmp_path / MANIFEST)["files"]["in/c"]["bytes"] == 4
    (tmp_path / "a").unlink()
    (tmp_path / "in" / "c").write_text("in/x")
    (tmp_path / "extra").write_text("")
    assert manifest_faults(tmp_path) == ["a: missing", "extra: not in the manifest", "in/c: changed"]


def test_commit_folder(tmp_path: Path) -> None:
    """A finished folder moves as a whole, parents are made, and an existing target is not overwritten."""
    partial = tmp_path / "work"
    (partial / "deep").mkdir(parents=True)
    (partial / "deep" / "file").write_text("x")
    temporary_name(partial / "deep" / "file").write_text("half")
    (partial / "link").symlink_to("deep")
    (partial / "nowhere").symlink_to("gone")
    final = tmp_path / "store" / "key"
    commit_folder(partial, final)
    assert sorted(path.relative_to(final).as_posix() for path in final.rglob("*")) == [
        "deep",
        "deep/file",
        "link",
        "nowhere",
    ]
    assert (final / "deep" / "file").read_text() == "x"
    assert not partial.exists()
    (tmp_path / "again" / "file").mkdir(parents=True)
    with pytest.raises(OSError, match="not empty"):
        commit_folder(tmp_path / "again", final)


def test_leftovers_of_killed_writers_are_swept(tmp_path: Path) -> None:
    """A temporary file is nobody's content: the manifest does not name it, and it goes when the folder is finished."""
    write_bytes(tmp_path / "file", b"x")
    left = temporary_name(tmp_path / "file")
    left.write_bytes(b"half")
    assert folder_digest(tmp_path) == digest({"file": file_digest(tmp_path / "file")})
    write_manifest(tmp_path, {})
    assert not left.exists()
    left.write_bytes(b"half")
    assert manifest_faults(tmp_path) == []
    sweep(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [MANIFEST, "file"]


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second process writes the same file while the first one does: both succeed, and the later one's stays."""
    path, replace, writers = tmp_path / "file", Path.replace, [b"second"]

    def slow(self: Path, target: Path) -> Path:
        if writers:
            write_bytes(path, writers.pop())
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", slow)
    write_bytes(path, b"first")
    assert path.read_bytes() == b"first"
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_a_folder_takes_the_place_of_a_former_one_whole(tmp_path: Path) -> None:
    """An error leaves the former one; a second filler that ends meanwhile is replaced; nothing else stays."""
    place = tmp_path / "look"
    with whole_folder(place) as fresh:
        (fresh / "a").write_text("first")
    with pytest.raises(IsADirectoryError), whole_folder(place) as fresh:
        fresh.write_text("no file")
    assert (place / "a").read_text() == "first"
    with whole_folder(place) as fresh:
        (fresh / "a").write_text("slow")
        with whole_folder(place) as other:
            (other / "b").write_text("quick")
        assert [path.name for path in place.iterdir()] == ["b"]
    assert (place / "a").read_text() == "slow"
    assert [path.name for path in tmp_path.iterdir()] == ["look"]


def test_a_folder_that_comes_between_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another filler puts its folder there after the former one went away and before ours comes: ours stays."""
    place, rename, came = tmp_path / "look", Path.rename, []
    place.mkdir()

    def slow(self: Path, target: Path) -> Path:
        if target == place and not came:
            came.append((place / "theirs").mkdir(parents=True))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", slow)
    monkeypatch.setattr(groundwork.files, "exchange", lambda one, other: False)
    with whole_folder(place) as fresh:
        (fresh / "ours").write_text("x")
    assert came
    assert [path.name for path in place.iterdir()] == ["ours"]
    assert [path.name for path in tmp_path.iterdir()] == ["look"]


def test_a_former_folder_is_there_until_the_new_one_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whenever the process dies, a whole folder has the name: before and after every removal and rename."""
    place, seen = tmp_path / "look", []
    (place / "deep").mkdir(parents=True)
    (place / "deep/old").write_text("old")
    (tmp_path / "fresh").mkdir()
    (tmp_path / "fresh/new").write_text("new")

    def watched(name: str) -> Callable[..., object]:
        original = getattr(os, name)

        def call(*arguments: object, **more: object) -> object:
            seen.append(sorted(path.name for path in place.rglob("*")))
            result = original(*arguments, **more)
            seen.append(sorted(path.name for path in place.rglob("*")))
            return result

        return call

    for name in ("rename", "unlink", "rmdir", "fsync"):
        monkeypatch.setattr(os, name, watched(name))
    put_in_place(tmp_path / "fresh", place)
    assert {tuple(names) for names in seen} == {("deep", "old"), ("new",)}
    assert [path.name for path in tmp_path.iterdir()] == ["look"]


def test_killed_fillers_of_one_folder_are_swept(tmp_path: Path) -> None:
    """What they left of this folder goes; the folders of others, in the making or not, stay."""
    for name in ("look", "other"):
        temporary_name(tmp_path / name, f"-{name}").mkdir()
    (tmp_path / "look").mkdir()
    sweep_folders(tmp_path, "look")
    assert sorted(path.name.rpartition("-")[2] for path in tmp_path.iterdir()) == ["look", "other"]
    sweep_folders(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["look"]


@pytest.mark.parametrize("count", [1, 2])
def test_a_whole_file_is_on_the_disk_before_it_has_its_name(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its bytes are synced, then it is renamed, then its folder is synced; what the check refuses gets no name."""
    calls, path = [], tmp_path / "x.bin"
    replace = Path.replace
    monkeypatch.setattr("groundwork.files.sync", lambda one: calls.append(f"sync {one.suffix}"))
    monkeypatch.setattr(Path, "replace", lambda self, target: (calls.append("rename"), replace(self, target))[1])

    def check() -> None:
        calls.append("check")
        if count == 2:
            raise InputError("changed meanwhile")

    try:
        with whole_file(path, check) as partial:
            partial.write_bytes(b"x")
    except InputError:
        assert calls == ["sync .bin", "check"]
        assert list(tmp_path.iterdir()) == []
    else:
        assert calls == ["sync .bin", "check", "rename", "sync "]
        assert list(tmp_path.iterdir()) == [path]
