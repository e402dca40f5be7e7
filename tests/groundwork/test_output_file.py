"""A single file for the user appears as a whole, and takes the place of nothing but a former one of ours."""

import os
from pathlib import Path

import pytest

from groundwork.errors import InputError
from groundwork.output.file import SIGNATURE, check_output_file, fresh_file, write_fresh_file

FORMER = "<html><title>Scene 0000 · Falsework</title></html>".encode()  # of the version before signatures
PAGE = f"<html>{SIGNATURE}</html>".encode()


def test_the_same_file_is_written_twice_and_a_strangers_never(tmp_path: Path) -> None:
    """Ours, signed at either end, and empty files are replaced; what somebody else wrote is not, whenever it came."""
    page, script = tmp_path / "deep" / "page.html", tmp_path / "my_script.py"
    for data in (PAGE, bytes(200_000) + SIGNATURE.encode(), PAGE + bytes(200_000), b"", FORMER):
        write_fresh_file(page, data)
        assert page.read_bytes() == data
    write_fresh_file(page, PAGE)
    script.write_text("mine")
    with pytest.raises(InputError, match="is a file that Falsework did not write"):
        write_fresh_file(script, PAGE)
    assert script.read_text() == "mine"
    late = tmp_path / "late.html"

    def overtaken() -> None:
        with fresh_file(late) as temporary:
            temporary.write_bytes(PAGE)
            late.write_text("mine")

    with pytest.raises(InputError, match="did not write"):
        overtaken()
    assert late.read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["deep", "late.html", "my_script.py"]


def test_a_link_stays_and_its_target_is_written(tmp_path: Path) -> None:
    """A link as the output leads to the file; names as long as can be work."""
    link, target = tmp_path / "link.html", tmp_path / ("x" * 250 + ".html")
    link.symlink_to(target.name)
    for _ in range(2):
        write_fresh_file(link, PAGE)
    assert link.is_symlink()
    assert target.read_bytes() == PAGE


def test_an_error_names_the_file_and_not_its_temporary_name(tmp_path: Path) -> None:
    """Nor does anything remain of the temporary file."""

    def fail() -> None:
        with fresh_file(tmp_path / "page.html") as temporary:
            raise InputError("bad", where=temporary)

    with pytest.raises(InputError, match=f"^{tmp_path}/page.html: bad$"):
        fail()
    assert not list(tmp_path.iterdir())


def test_what_no_file_can_be_is_one_line(tmp_path: Path) -> None:
    """Folders, devices, pipes, stores, inputs and names that cannot be are refused before any work."""
    source, pipe, result = tmp_path / "scene.usda", tmp_path / "pipe", tmp_path / "store" / "key"
    source.write_bytes(PAGE)
    os.mkfifo(pipe)
    result.mkdir(parents=True)
    (result / "artefact.json").write_text("{}")
    for path, words in (
        (tmp_path, "contains an input of this command"),
        (Path(), "is a folder, not a file"),
        (pipe, "is not a regular file"),
        (Path("/dev/null"), "is not a regular file"),
        (source, "is an input of this command"),
        (source / "page.html", "lies inside an input of this command"),
        (result / "page.html", "in a stored result"),
        (tmp_path / ("x" * 256), "a name that is too long"),
        (tmp_path / "a\0.html", "a null character"),
        (Path("/proc/page.html"), "proc: not writable"),
    ):
        with pytest.raises(InputError, match=words) as caught:
            write_fresh_file(path, PAGE, [source])
        assert "\n" not in str(caught.value)
    assert check_output_file(tmp_path / "new.html", [source]) == tmp_path / "new.html"
    assert not (tmp_path / "new.html").exists()
