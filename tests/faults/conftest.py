"""What the faults of a reconstruction are tried on: five photographs of the planes, enough for a model in seconds."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from falsework.commands.verbs import reconstruct_folder
from groundwork.canonical import file_digest
from groundwork.files import MANIFEST
from groundwork.marks import MARK
from groundwork.progress import SILENT
from recon.settings import ReconSettings, SparseSettings
from tests.made_once import made_once
from tests.patience import left
from tests.recon.conftest import in_this_process, poses_on_arc, write_capture

ROOT = Path(__file__).resolve().parents[2]
MAX_FEATURES = 700
FEW = f"[recon.sparse]\nmax_features = {MAX_FEATURES}\n"
SMALL = ReconSettings(mode="sparse", sparse=SparseSettings(max_features=MAX_FEATURES))
SETTINGS = f"[recon]\nmode = 'sparse'\n{FEW}"

MARKS = (MARK, MANIFEST)

Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture(scope="session")
def few_planes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a capture of the planes from five cameras; read only."""
    return write_capture(tmp_path_factory.mktemp("few") / "capture", poses_on_arc(14)[4:9])


@pytest.fixture(scope="session")
def start_reconstruct(few_planes: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Start]:
    """Give `start(out, capture=few_planes, settings=SETTINGS, before=())`: begin `falsework reconstruct`.

    It runs in a session of its own; `before` are words to put before the command.
    """
    files = tmp_path_factory.mktemp("settings")
    started: list[subprocess.Popen[str]] = []

    def start(
        out: Path, capture: Path = few_planes, settings: str = SETTINGS, before: tuple[str, ...] = ()
    ) -> subprocess.Popen[str]:
        file = files / f"{len(list(files.iterdir()))}.toml"
        file.write_text(settings)
        command = [sys.executable, "-m", "falsework", "reconstruct", str(capture), "-o", str(out)]
        process = subprocess.Popen(
            [*before, *command, "--settings", str(file)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            preexec_fn=_hear_interrupts,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:  # its test has failed
            os.killpg(process.pid, signal.SIGKILL)


@pytest.fixture(scope="session")
def calm(few_planes: Path, tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Give the cloud of a run that nobody disturbed; read only, and made by the first process that needs it.

    Nothing is killed here, so it runs in this process: those that go on in children must end with its bytes, too.
    """

    def make(out: Path) -> None:
        with in_this_process():
            reconstruct_folder(few_planes, out, SMALL, SILENT)

    return made_once(tmp_path_factory, worker_id, "calm", make)


def contents(folder: Path) -> dict[str, str]:
    """Hash every file of a cloud but the marks of the folder that it lies in."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): file_digest(path) for path in files if path.name not in MARKS}


def finish(process: subprocess.Popen[str]) -> str:
    """Wait for a run to end well, and return what it said."""
    _, said = process.communicate(timeout=left())
    assert process.returncode == 0, said
    return said


def _hear_interrupts() -> None:
    """Undo what a shell that started the tests in the background handed down: an ignored Ctrl-C stays ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
