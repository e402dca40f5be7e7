"""An output folder is claimed, made inside itself, and put into place; what others have in it stays."""

import errno
import fcntl
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from groundwork.canonical import folder_digest
from groundwork.errors import InputError, RejectedSceneError
from groundwork.files import MANIFEST
from groundwork.marks import MARK, NEXT, Listing, content_files, read_listing
from groundwork.output import lock as output_lock
from groundwork.output import swap
from groundwork.output.folder import claim_run, fresh_output
from groundwork.output.reading import reading


def writes(*texts: str) -> Callable[[Path], None]:
    """Write files named and filled with the texts; what ends in a slash is a folder."""

    def write(folder: Path) -> None:
        for text in texts:
            path = folder / text
            (path if text.endswith("/") else path.parent).mkdir(parents=True, exist_ok=True)
            if not text.endswith("/"):
                path.write_text(text)

    return write


def tree(folder: Path) -> list[str]:
    """List the files and links below a folder, marks left out."""
    return sorted(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.name != MARK and (path.is_symlink() or not path.is_dir())
    )


def refuse(folder: Path, *, words: str, kind: str = "cloud", inputs: tuple[Path, ...] = ()) -> None:
    """See that nothing is written where nothing may be, in one line."""
    called: list[Path] = []
    with pytest.raises(InputError, match=words) as caught:
        fresh_output(folder, kind, called.append, inputs=inputs)
    assert not called
    assert "\n" not in str(caught.value)


def test_only_its_own_kind_is_replaced(tmp_path: Path) -> None:
    """Absent, empty and former outputs are filled; another kind is refused; nothing else is left, inside or beside."""
    out, empty = tmp_path / "deep" / "out", tmp_path / "empty"
    fresh_output(out, "capture", writes("a", "old/b", "hollow/"))
    fresh_output(out, "capture", writes("a", "new/c"))
    assert tree(out) == ["a", "new/c"]
    assert not (out / "old").exists()
    assert not (out / "hollow").exists()
    refuse(out, words="the output folder holds capture")
    empty.mkdir()
    (empty / "lost+found").mkdir()  # at the top of a disk
    fresh_output(empty, "cloud", writes("d"))
    assert tree(tmp_path) == ["deep/out/a", "deep/out/new/c", "empty/d"]
    assert sorted(path.name for path in out.iterdir()) == [MARK, "a", "new"]


def test_files_of_others_stay(tmp_path: Path) -> None:
    """What somebody put into a finished output, at its top or deep in it, outlives the next one."""
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    fresh_output(out, "cloud", writes("a", "deep/b"))
    for name in ("notes.txt", "deep/mine"):
        (out / name).write_text("mine")
    (tmp_path / ".out.partial").mkdir()
    (tmp_path / ".out.former").mkdir()
    elsewhere.mkdir()
    (elsewhere / "b").write_text("mine")

    def write(folder: Path) -> None:
        writes("a", "c")(folder)
        (out / "late.txt").write_text("mine")

    fresh_output(out, "cloud", write)
    assert tree(out) == ["a", "c", "deep/mine", "late.txt", "notes.txt"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [".out.former", ".out.partial", "elsewhere", "out"]
    fresh_output(out, "cloud", writes("linked/b"))
    (out / "linked" / "b").unlink()
    (out / "linked").rmdir()
    (out / "linked").symlink_to(elsewhere)
    fresh_output(out, "cloud", writes("d"))
    assert (elsewhere / "b").read_text() == "mine"


@pytest.mark.parametrize("stranger", ["file", "folder", "link", "parent", "deep"])
def test_a_file_of_others_in_the_way_is_kept_and_the_work_waits(stranger: str, tmp_path: Path) -> None:
    """What came meanwhile where a new file goes is not replaced; moved away, the finished work is put into place."""
    out = tmp_path / "out"
    fresh_output(out, "cloud", writes("old/a"))
    path = out / {"parent": "new", "deep": "old"}.get(stranger, "new/b")

    def write(folder: Path) -> None:
        writes("old" if stranger == "deep" else "new/b")(folder)
        path.parent.mkdir(exist_ok=True)
        if stranger == "folder":
            path.mkdir()
        elif stranger == "link":
            path.symlink_to("nowhere")
        elif stranger == "deep":
            (path / "mine").write_text("mine")
        else:
            path.write_text("mine")

    with pytest.raises(InputError, match="is at the place of the output, and Falsework did not write it"):
        fresh_output(out, "cloud", write)
    assert (out / "old" / "a").read_text() == "old/a"
    assert (out / MARK).is_file()
    path.rename(tmp_path / "moved")
    with reading(out):
        assert tree(out) == ["old"] if stranger == "deep" else ["new/b"]
    assert not (out / NEXT).exists()


def test_folders_of_the_former_version(tmp_path: Path) -> None:
    """A folder whose mark names no files is read, and replaced as a whole."""
    out = tmp_path / "out"
    writes("a", "deep/b")(out)
    (out / MARK).write_text("cloud\n")
    with reading(out):
        pass
    refuse(out, kind="capture", words="the output folder holds cloud")
    fresh_output(out, "cloud", writes("c"))
    assert tree(out) == ["c"]


@pytest.mark.parametrize("resume", [False, True])
def test_one_command_at_a_time(resume: bool, tmp_path: Path) -> None:
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
    assert tree(out) == ["second"]


def test_the_lock_is_what_keeps_others_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a working lock the second command comes in, and where the file system has none that is said."""
    out, came = tmp_path / "out", []

    def write(folder: Path) -> None:
        fresh_output(out, "cloud", lambda folder: came.append(folder))
        folder.mkdir(parents=True, exist_ok=True)
        (out / NEXT / MARK).write_text("cloud\n")

    with pytest.raises(InputError, match="another command"):
        fresh_output(out, "cloud", write)
    assert not came
    monkeypatch.setattr(fcntl, "flock", lambda *_: None)
    fresh_output(out, "cloud", write)
    assert came
    assert capsys.readouterr().err == ""

    def refuse_locks(*_: object) -> None:
        raise OSError(errno.ENOLCK, "no locks")

    monkeypatch.setattr(fcntl, "flock", refuse_locks)
    fresh_output(out, "cloud", writes("a"))
    assert "this file system has no file locks" in capsys.readouterr().err
    assert tree(out) == ["a"]


def test_a_lock_removed_while_we_took_it_is_not_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A former holder removes its lock between our opening and our locking: the lock is taken anew."""
    out, removed, lock = tmp_path / "out", [], fcntl.flock

    def slow(handle: int, operation: int) -> None:
        if not removed:
            removed.append((out / NEXT / output_lock.LOCK).unlink())
            (out / NEXT).rmdir()
        lock(handle, operation)

    def write(folder: Path) -> None:
        writes("a")(folder)
        with pytest.raises(InputError, match="another command is writing this folder"):
            fresh_output(out, "cloud", writes("b"))

    monkeypatch.setattr(fcntl, "flock", slow)
    fresh_output(out, "cloud", write)
    assert removed
    assert tree(out) == ["a"]


def test_only_the_same_work_goes_on(tmp_path: Path) -> None:
    """What an interrupted run left is gone on with when the same is asked for, and else thrown away or kept."""
    out = tmp_path / "out"

    def interrupted(folder: Path) -> None:
        writes("half")(folder)
        raise KeyboardInterrupt

    def seen(asked: str, *, kind: str = "cloud", resume: bool = True) -> list[str]:
        found: list[str] = []
        with pytest.raises(KeyboardInterrupt):
            fresh_output(out, "cloud", interrupted, asked="this", resume=True)
        assert tree(out / NEXT / "files") == ["half"]
        fresh_output(out, kind, lambda folder: found.extend(tree(folder)), asked=asked, resume=resume)
        return found

    assert seen("this") == ["half"]
    assert seen("that") == []
    assert seen("this", resume=False) == []
    (out / MARK).unlink()
    with pytest.raises(InputError, match="the output folder holds an unfinished cloud"):
        seen("this", kind="capture")
    with pytest.raises(InputError, match="an unfinished cloud"), reading(out):
        pass


@pytest.mark.parametrize("resume", [False, True])
def test_what_cannot_go_on_leaves_nothing(resume: bool, tmp_path: Path) -> None:
    """A rejection, bad input, and what cannot be gone on with take their work away, and the folder if they made it."""
    out = tmp_path / "deep" / "out"

    def reject(folder: Path) -> None:
        writes("half")(folder)
        raise RejectedSceneError("too_few", "too few images")

    def fail(folder: Path) -> None:
        raise InputError("bad", where=folder / "new")

    for write in (reject, fail):
        with pytest.raises((RejectedSceneError, InputError), match=f"^{out}/new: bad$|^too few images$"):  # not .next
            fresh_output(out, "cloud", write, resume=resume)
        assert not list(tmp_path.iterdir())
        fresh_output(out, "cloud", writes("old"), resume=resume)
        with pytest.raises((RejectedSceneError, InputError)):
            fresh_output(out, "cloud", write, resume=resume)
        assert tree(out) == ["old"]
        assert not (out / NEXT).exists()
        for path in (out / "old", out / MARK):
            path.unlink()
        out.rmdir()
        out.parent.rmdir()


def test_outputs_never_touch_what_they_are_made_from(tmp_path: Path) -> None:
    """The input itself, what it lies in and what lies in it are refused, through links too."""
    source, link = tmp_path / "deep" / "source", tmp_path / "link"
    source.mkdir(parents=True)
    link.symlink_to(source)
    for out, words in (
        (source, "is an input of this command"),
        (link, "is an input of this command"),
        (source / "inner" / "out", "lies inside an input of this command"),
        (link / "out", "lies inside an input"),
        (tmp_path / "deep", "contains an input of this command"),
        (source / ".." / ".." / "deep", "contains an input"),
    ):
        refuse(out, words=words, inputs=(source,))
    assert not list(source.iterdir())


def test_outputs_never_lie_in_a_store(tmp_path: Path) -> None:
    """A stored result, what lies in it, and what a run writes are refused; beside them there is room."""
    run, result = tmp_path / "run", tmp_path / "run" / "store" / "stage" / "key"
    claim_run(run)
    claim_run(run)
    result.mkdir(parents=True)
    refuse(result, words="store/ of a run")
    for name in ("scenes", "evicted", "foreign"):
        refuse(run / name / "0000" / "new", words=f"{name}/ of a run")
    (result / MANIFEST).write_text("{}")
    (tmp_path / "stage").symlink_to(result)
    for out in (result, result / "deep" / "new", tmp_path / "stage" / "new"):
        refuse(out, words="lies in a stored result")
    refuse(run, words="the output folder holds run")
    fresh_output(run / "mine", "cloud", writes("a"))
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("mine")
    with pytest.raises(InputError, match="files that Falsework did not write"):
        claim_run(tmp_path / "full")


def test_what_is_in_the_way_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files, foreign folders, names that cannot be, links in circles and the user's own `.next` are refused."""
    mine, busy = tmp_path / "mine", tmp_path / "busy"
    writes("holiday.jpg")(mine)
    refuse(mine, words="files that Falsework did not write")
    refuse(mine / "holiday.jpg", words="is a file, not a folder")
    refuse(mine / "holiday.jpg" / "below", words="is a file, not a folder")
    refuse(tmp_path / ("x" * 256), words="a name that is too long")
    refuse(Path("/".join([str(tmp_path), *["y" * 200] * 30])), words="a path that is too long")
    refuse(tmp_path / "a\0b", words="a name with a null character")
    refuse(tmp_path / "a\ud800b", words="not a valid file name")
    (tmp_path / "loop").symlink_to("loop")
    refuse(tmp_path / "loop", words="is a link that leads to itself")
    refuse(tmp_path / "loop" / "below", words="is a link that leads to itself")
    refuse(Path("/proc/cloud"), words="proc: not writable")
    for name in (f"{NEXT}/page.js", f"{NEXT}/{output_lock.LOCK}/x"):
        fresh_output(busy, "cloud", writes("a"))
        writes(name)(busy)
        refuse(busy, words="is at the place of our work folder")
        assert (busy / name).read_text() == name
        (busy / name).unlink()
        (busy / NEXT / output_lock.LOCK).mkdir(exist_ok=True)
        (busy / NEXT / output_lock.LOCK).rmdir()
        (busy / NEXT).rmdir()
    (busy / NEXT).symlink_to(mine)
    refuse(busy, words="is at the place of our work folder")
    assert tree(mine) == ["holiday.jpg"]
    monkeypatch.setattr(os, "access", lambda *_: False)
    refuse(tmp_path / "new" / "deep", words="not writable")


def test_names_as_long_as_can_be_and_the_folder_that_one_is_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """255 bytes work; so does the current folder, which stays the same folder; a link stays one."""
    out, link = tmp_path / ("x" * 255), tmp_path / "link"
    link.symlink_to(out.name)
    for _ in range(2):
        fresh_output(link, "cloud", writes("a"))
    assert link.is_symlink()
    monkeypatch.chdir(out)
    here = out.stat().st_ino
    fresh_output(Path(), "cloud", writes("b"))
    assert (tree(out), out.stat().st_ino) == (["b"], here)
    assert Path("b").read_text() == "b"


def test_marks_enter_no_digest(tmp_path: Path) -> None:
    """A mark, a lock and work in progress are not content; a folder of the user's named `.next` is."""
    out, seen = tmp_path / "out", []
    fresh_output(out, "cloud", writes("a"))
    before = folder_digest(tmp_path)
    fresh_output(out, "cloud", lambda folder: (writes("b")(folder), seen.append(folder_digest(tmp_path)))[0])
    assert seen == [before]
    assert [path.name for path in content_files(out)] == ["b"]
    writes(f"{NEXT}/page.js")(out)
    assert [path.name for path in content_files(out)] == ["page.js", "b"]


def test_a_mark_cannot_name_files_elsewhere(tmp_path: Path) -> None:
    """A forged mark makes nothing be deleted outside its folder."""
    out = tmp_path / "out"
    writes("mine")(tmp_path)
    writes("a")(out)
    (out / MARK).write_text(f'cloud\n{{"files": ["../mine", "{tmp_path}/mine", "a", 3], "folders": [".."]}}\n')
    assert read_listing(out / MARK).files == ("a",)
    fresh_output(out, "cloud", writes("b"))
    assert tree(tmp_path) == ["mine", "out/b"]


def test_what_is_handed_over_is_the_users(tmp_path: Path) -> None:
    """A copy for the user has no mark and is never replaced."""
    out = tmp_path / "out"
    fresh_output(out, "copy", writes("a", "deep/b"), is_marked=False)
    assert sorted(path.name for path in out.iterdir()) == ["a", "deep"]
    with pytest.raises(InputError, match="is not empty"):
        fresh_output(out, "copy", writes("c"), is_marked=False)
    fresh_output(tmp_path / "ours", "copy", writes("a"))
    with pytest.raises(InputError, match="is not empty"):
        fresh_output(tmp_path / "ours", "copy", writes("c"), is_marked=False)


def test_a_reader_is_told_when_its_input_was_replaced(tmp_path: Path) -> None:
    """What was read before and after a swap is not mixed: the reading ends in an error, its own errors included."""
    out = tmp_path / "out"
    fresh_output(out, "cloud", writes("deep/a"))

    def read(fails: bool) -> None:
        with reading(out / "deep" / "a"):
            fresh_output(out, "cloud", writes("deep/a"))
            if fails:
                raise ValueError("half of this and half of that")

    for fails in (False, True):
        with pytest.raises(InputError, match="was replaced while it was read"):
            read(fails)
    with reading(out):
        fresh_output(tmp_path / "other", "cloud", writes("a"))


def test_folders_are_synced_after_files_left_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a power cut must not bring back: each folder that lost a file, and stays, is synced once."""
    former = Listing("cloud", ("a/1", "a/2", "b/3", "4"), ("a", "b"))
    new = Listing("cloud", ("a/2", "4"), ("a",))
    writes(*former.files)(tmp_path)
    synced: list[Path] = []
    monkeypatch.setattr(swap, "sync", synced.append)
    swap._clear_away(tmp_path, former, new)
    assert tree(tmp_path) == ["4", "a/2"]
    assert synced == [tmp_path / "a"]
