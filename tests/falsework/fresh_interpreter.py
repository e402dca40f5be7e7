"""A fresh interpreter with nothing but the command line: each command runs in a copy, and tells what it loaded."""

from __future__ import annotations

import json
import select
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.patience import left

SCRIPT = """
import json, os, sys, traceback
import falsework.cli
for line in sys.stdin:
    words, folder, out, error = json.loads(line)
    child = os.fork()
    if child == 0:
        code = 0
        os.chdir(folder)
        for path, number in ((out, 1), (error, 2)):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        try:
            falsework.cli.main(words)
        except SystemExit as left:
            code = left.code if isinstance(left.code, int) else 0 if left.code is None else 1
        except BaseException:
            traceback.print_exc()
            code = 1
        print("\\n" + json.dumps(sorted({*sys.modules, *(name.partition(".")[0] for name in sys.modules)})))
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@dataclass(frozen=True)
class Done:
    """What came of a command.

    Attributes:
        code: Its exit code.
        error: What it said on standard error.
        loaded: Names of every module that it had loaded in the end, and of every package that they belong to.
    """

    code: int
    error: str
    loaded: frozenset[str]


class FreshInterpreter:
    """Starts once, and runs each command as if it had just started."""

    def __init__(self, process: subprocess.Popen[str], said: Path) -> None:
        """Talk to a process.

        Args:
            process: It runs `SCRIPT`.
            said: Folder for what commands say.
        """
        self.process, self.said = process, said

    def run(self, words: list[str], folder: Path) -> Done:
        """Run a command.

        Args:
            words: What follows `falsework`.
            folder: Where to run it.
        """
        process, out, error = self.process, self.said / "out", self.said / "error"
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps([words, str(folder), str(out), str(error)]) + "\n")
        process.stdin.flush()
        assert select.select([process.stdout], [], [], left())[0], f"{words} hangs"
        code = int(process.stdout.readline())
        return Done(code, error.read_text(), frozenset(json.loads(out.read_text().splitlines()[-1])))


@contextmanager
def fresh_interpreter(said: Path) -> Iterator[FreshInterpreter]:
    """Start the interpreter, and end it with whatever hangs in it.

    Args:
        said: Empty folder.
    """
    command = [sys.executable, "-c", SCRIPT]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield FreshInterpreter(process, said)
        finally:
            process.kill()
