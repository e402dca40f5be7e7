"""Child processes with limits of time and memory, for work that may crash or hang; they end with their parent."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from groundwork.canonical import canonical_json
from groundwork.errors import ChildError, FalseworkError, InputError, OutOfSpaceError, RejectedSceneError, passing_code
from groundwork.progress import SILENT, Progress

_POLL = 0.1  # [s] interval between checks of the limits
_STACK = ("@ ", "***", "PC: @")  # prefix of glog's stack lines, which follow its error message
_LAST_LINES = 20  # lines of a child's output kept with its error
AT_A_LIMIT = "stopped because it"  # what the error of a child says, after its name, if it reached a limit
CRASHED = ("died of", "failed with")  # the same if it crashed
_PREFIX = "\x1efalsework "  # prefix of a child's messages, to separate them from the output of native libraries


def run_child(
    module: str,
    request: dict[str, Any],
    *,
    time_limit: float,
    memory_limit: float,
    progress: Progress = SILENT,
    environment: dict[str, str] | None = None,
) -> Any:
    """Run `python -m module` with a JSON request and wait for its JSON answer.

    Args:
        module: Module that calls `answer_parent` under `__main__`.
        request: JSON for the child.
        time_limit: Wall time after which it is killed, excluding the time its main thread waited for a core [s].
        memory_limit: Resident memory above which it is killed [GB].
        progress: Listener for the child's progress.
        environment: Variables to add to the child's environment.

    Returns:
        The child's answer.

    Raises:
        ChildError: Killed at a limit, died of a signal, or failed; the text ends in its last error line.
        InputError: The child found bad input.
        OutOfSpaceError: The child found the disk full.
        RejectedSceneError: The child rejected the scene.
    """
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            [sys.executable, *_safe_path(), "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            env={**os.environ, **(environment or {})},
            preexec_fn=_die_with_parent(os.getpid()),
        )
        replies: list[dict[str, Any]] = []
        raised: list[BaseException] = []
        reader = threading.Thread(target=_listen, args=(process, replies, progress, raised), daemon=True)
        reader.start()
        try:
            _send(process, request)
            verdict = _watch(process, time_limit, memory_limit)
        finally:
            if process.poll() is None:
                process.kill()
            process.wait()
            reader.join()
        if raised:
            raise raised[0]
        errors.seek(0)
        return _conclude(module, process.returncode, verdict, replies, errors.read().decode(errors="replace"))


def _safe_path() -> list[str]:
    """Prevent a child from importing a file of the current folder instead of ours, such as a user's `render.py`."""
    home = Path(__file__).resolve().parents[1]
    with suppress(OSError):  # the current folder was deleted
        if Path.cwd() == home:  # an uninstalled checkout is found only through this path
            return []
    return ["-P"]


def answer_parent(work: Callable[[dict[str, Any], Progress], Any]) -> None:
    """Serve one request: the body of a child's `__main__`.

    Args:
        work: Called with the request and a listener that reaches the parent; returns JSON.
    """
    request = json.loads(sys.stdin.buffer.readline())
    try:
        result = work(request, _ToParent())
    except RejectedSceneError as error:
        _say("rejected", [error.reason, str(error)])
        sys.exit(error.exit_code)
    except FalseworkError as error:
        _say("error", [error.exit_code, str(error), passing_code(error)])
        sys.exit(error.exit_code)
    _say("result", result)


class _ToParent:
    def stage(self, name: str, total: int) -> None:
        _say("stage", [name, total])

    def advance(self, done: int) -> None:
        _say("advance", done)

    def note(self, message: str) -> None:
        _say("note", message)


def _say(kind: str, value: object) -> None:
    sys.stdout.write(f"{_PREFIX}{canonical_json({'kind': kind, 'value': value})}\n")
    sys.stdout.flush()


def _send(process: subprocess.Popen[bytes], request: dict[str, Any]) -> None:
    assert process.stdin is not None
    try:
        process.stdin.write(canonical_json(request).encode() + b"\n")
        process.stdin.close()
    except BrokenPipeError:
        pass  # it died before reading; its exit code tells why


def _listen(
    process: subprocess.Popen[bytes], replies: list[dict[str, Any]], progress: Progress, raised: list[BaseException]
) -> None:
    """Read a child's messages; an exception of the listener ends the child and is raised in the waiting thread."""
    try:
        _hear(process, replies, progress)
    except BaseException as error:
        raised.append(error)
        process.kill()


def _hear(process: subprocess.Popen[bytes], replies: list[dict[str, Any]], progress: Progress) -> None:
    assert process.stdout is not None
    for raw in process.stdout:
        _, found, text = raw.decode(errors="replace").partition(_PREFIX)
        if not found:
            continue
        message = json.loads(text)
        match message["kind"]:
            case "stage":
                progress.stage(*message["value"])
            case "advance":
                progress.advance(message["value"])
            case "note":
                progress.note(message["value"])
            case _:
                replies.append(message)


def _watch(process: subprocess.Popen[bytes], time_limit: float, memory_limit: float) -> str | None:
    begin = time.monotonic()
    while True:
        try:
            process.wait(_POLL)
            return None
        except subprocess.TimeoutExpired:
            if time.monotonic() - begin - _waited(process.pid) > time_limit:
                return f"ran longer than {time_limit:.0f} s"
            if _resident(process.pid) > memory_limit:
                return f"used more than {memory_limit:.1f} GB of memory"


def _waited(pid: int) -> float:
    """Return how long a process' main thread waited for a core [s]; 0 if the kernel does not say."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[1]) / 1e9
    except (OSError, IndexError, ValueError):
        return 0.0


def _resident(pid: int) -> float:
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e9


def reason_of(error: ChildError) -> str:
    """Say why a child failed, without the name of its module and the advice to who called it.

    Args:
        error: An error of `run_child`.
    """
    reason = str(error).partition(": ")[2]
    explained = not reason.startswith((AT_A_LIMIT, *CRASHED))  # by the child itself, which does not name its module
    return str(error) if explained else reason.partition(". Use fewer")[0]


def _conclude(module: str, code: int, verdict: str | None, replies: list[dict[str, Any]], errors: str) -> object:
    final = replies[-1] if replies else {"kind": "none", "value": None}
    spoken = [line for line in errors.splitlines() if line.strip() and not line.lstrip().startswith(_STACK)]
    if verdict is not None:
        raise ChildError(
            f"{module}: {AT_A_LIMIT} {verdict}. Use fewer or smaller images, or raise the limit",
            last_lines=tuple(spoken[-_LAST_LINES:]),
        )
    if final["kind"] == "result" and code == 0:
        return final["value"]
    if final["kind"] == "rejected":
        raise RejectedSceneError(*final["value"])
    if final["kind"] == "error":
        exit_code, text, passing = final["value"]
        kinds = {InputError.exit_code: InputError, OutOfSpaceError.exit_code: OutOfSpaceError}
        raise kinds.get(exit_code, ChildError)(text) from (OSError(passing, os.strerror(passing)) if passing else None)
    last = spoken[-1] if spoken else "it printed nothing"
    name = signal.Signals(-code).name if code < 0 else ""
    died, failed = CRASHED
    how = f"{died} {name}" if name else f"{failed} exit code {code}"
    raise ChildError(f"{module}: {how}: {last}", signal=name, last_lines=tuple(spoken[-_LAST_LINES:]))


def _die_with_parent(parent: int) -> Callable[[], None]:
    libc = ctypes.CDLL(None)

    def ask_the_kernel() -> None:
        libc.prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:  # it died between fork and prctl
            os._exit(1)

    return ask_the_kernel
