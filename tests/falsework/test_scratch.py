"""The folder of Dask's workers does not outlive its run for long, even if that was killed."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from falsework.execution.scratch import LOCK, PREFIX, scratch_folder
from falsework.store.leftovers import is_held

KILLED = """
from falsework.execution.scratch import scratch_folder
with scratch_folder() as folder:
    print(folder, flush=True)
    input()
"""


def test_what_a_killed_run_left_is_removed_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not that of a living run, one that was made this minute, or a folder that is not ours."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    command = [sys.executable, "-c", KILLED]
    process = subprocess.Popen(
        command, env={**os.environ, "TMPDIR": str(tmp_path)}, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    left = Path(process.stdout.readline().strip())
    (left / "dask").mkdir()
    os.utime(left, (1.0, 1.0))
    with scratch_folder() as own:
        assert left.is_dir()  # its run lives
    assert not Path(own).exists()
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    others = [tmp_path / f"{PREFIX}young", tmp_path / f"{PREFIX}unlocked", tmp_path / "mine"]
    for folder in others:
        folder.mkdir()
        if folder.name != f"{PREFIX}unlocked":
            (folder / LOCK).touch()
        if folder.name != f"{PREFIX}young":
            os.utime(folder, (1.0, 1.0))
    assert left.is_dir()
    with scratch_folder() as own:
        assert is_held(Path(own) / LOCK)
        assert not left.exists()
    assert sorted(tmp_path.iterdir()) == sorted(others)


def test_a_sweep_may_lock_the_folder_while_its_run_removes_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lock's file is there again when the folder should be empty: no error of a finished run."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    remove = os.rmdir

    def lock_first(path: str, **more: int) -> None:
        (Path(own) / LOCK).touch()
        remove(path, **more)

    with scratch_folder() as own:
        monkeypatch.setattr(os, "rmdir", lock_first)
    assert (Path(own) / LOCK).is_file()  # the next sweep's
