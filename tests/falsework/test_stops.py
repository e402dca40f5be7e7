"""A stop by a signal is not lost in an import, and a second one does not wait."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from falsework.stops import INTERRUPTED_LINE

COMMAND = """
import time
from falsework import stops
stops._LONGEST = 1.0
stops.catch_stops()
stops.catch_stops()
import on_trial
time.sleep(20)
"""
TRIAL = """
import os, time
try:
    os.kill(os.getpid(), {number})
    time.sleep({seconds})
except BaseException:
    print("passed over", flush=True)
print("imported", flush=True)
"""
REAL = """
import sys
del sys.path[0], sys.modules["tyro"]
import tyro
"""


def run(folder: Path, trial: str) -> tuple[int, str, str]:
    """Import a module in a process that catches stops; its exit code, stdout, and the last line of stderr."""
    (folder / "on_trial.py").write_text(trial)
    script = f"import sys\nsys.path.insert(0, {str(folder)!r})\n{COMMAND}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout, (done.stderr.splitlines() or [""])[-1]


@pytest.mark.parametrize(
    ("number", "code", "error"), [(signal.SIGINT, -signal.SIGINT, "KeyboardInterrupt"), (signal.SIGTERM, 143, "")]
)
def test_a_stop_waits_for_the_end_of_an_import(number: signal.Signals, code: int, error: str, tmp_path: Path) -> None:
    """A module that passes over every error does not see it; the program does, after the import."""
    assert run(tmp_path, TRIAL.format(number=int(number), seconds=0.2)) == (code, "imported\n", error)


def test_a_stop_does_not_wait_for_ever(tmp_path: Path) -> None:
    """After 8 s, here one, the process ends within the import, with the usual line."""
    trial = TRIAL.format(number=int(signal.SIGINT), seconds=20)
    assert run(tmp_path, trial) == (130, "", INTERRUPTED_LINE.strip())


def test_a_second_stop_ends_the_process_at_once(tmp_path: Path) -> None:
    """Even while the first one waits for an import."""
    trial = TRIAL.format(number=int(signal.SIGINT), seconds=0.2)
    assert run(tmp_path, trial.replace("    time", "    os.kill(os.getpid(), 2)\n    time")) == (130, "", "")


def test_a_command_that_is_stopped_while_it_starts_says_so(tmp_path: Path) -> None:
    """Ctrl-C during the imports of the command line itself: one line and exit code 130."""
    (tmp_path / "tyro.py").write_text(TRIAL.format(number=int(signal.SIGINT), seconds=0.2) + REAL)
    script = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); "
        "sys.argv[1:] = ['doctor']; from falsework.__main__ import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (130, INTERRUPTED_LINE)
