"""`falsework …` with the tiny stages in a copy of this process: as a command of its own, without its start."""

import io
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path

from falsework.cli import main
from tests.falsework.tiny_chain import use_tiny_stages
from tests.patience import left


def fork(work: Callable[[], object]) -> int:
    """Do something in a copy of this process, in a group of its own; nothing of the tests runs there afterwards.

    Args:
        work: What to do; the copy ends with 99 where it raises, else with 0, or as `sys.exit` says.

    Returns:
        Id of the process, and of its group.
    """
    pid = os.fork()
    if pid:
        return pid
    code = 99
    try:
        os.setpgid(0, 0)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        work()
        code = 0
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else 0 if left.code is None else 1
    finally:
        os._exit(code)


def begin(*words: str | Path, said: Path, **environment: str) -> int:
    """Begin a command.

    Args:
        words: What follows `falsework`.
        said: File for what it prints.
        environment: Variables of the copy.

    Returns:
        Id of the process, and of its group.
    """

    def work() -> None:
        spoken = io.StringIO()  # in memory: a full disk shall not silence it
        sys.stdout = sys.stderr = spoken
        os.environ.update(environment)
        use_tiny_stages()
        try:
            main([str(word) for word in words])
        except SystemExit:
            raise
        except BaseException:
            traceback.print_exc()
            raise
        finally:
            most = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
            said.write_text(spoken.getvalue())

    said.touch()  # a stop that waits too long for an import ends the process at once, without a word
    return fork(work)


def end_of(pid: int) -> int:
    """Wait for a command.

    Args:
        pid: Its process.

    Returns:
        Its exit code; the negative number of the signal that it died of.
    """
    deadline = time.monotonic() + left()
    while True:
        found, status = os.waitpid(pid, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() > deadline:
            os.kill(pid, signal.SIGKILL)
            raise AssertionError("it hangs")
        time.sleep(0.002)


def run(*words: str | Path, said: Path, **environment: str) -> int:
    """Run a command to its end.

    Args:
        words: As for `begin`.
        said: As for `begin`.
        environment: As for `begin`.

    Returns:
        As `end_of`.
    """
    return end_of(begin(*words, said=said, **environment))
