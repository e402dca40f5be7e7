"""A child that does what its request says: the other end of the tests in `test_child.py`."""

import os
import sys
import time
from typing import Any

from groundwork.child import answer_parent, run_child
from groundwork.errors import InputError, OutOfSpaceError, RejectedSceneError
from groundwork.progress import Progress


def work(request: dict[str, Any], progress: Progress) -> Any:
    """Do one thing.

    Args:
        request: `do` names it; `value` is its argument.
        progress: Listener of the parent.
    """
    value = request.get("value")
    match request["do"]:
        case "echo":
            sys.stdout.write("noise that a native library prints, without a line end ")
            progress.stage("echo", 2)
            progress.advance(1)
            progress.note("half way – über")
            progress.advance(2)
            return value
        case "environment":
            return os.environ.get(str(value))
        case "sleep":
            time.sleep(float(str(value)))
        case "eat":
            held = bytearray(os.urandom(1)) * int(str(value))
            time.sleep(60)
            return len(held)
        case "abort":
            os.abort()
        case "fail":
            raise ZeroDivisionError("the deck is infinitely thin")
        case "input":
            raise InputError("wrong", where="scene.usda", field="spans", value=-1, hint="Be positive")
        case "device":
            try:
                raise OSError(int(str(value)), os.strerror(int(str(value))))
            except OSError as error:
                raise InputError(f"cannot be opened: {error.strerror}", where="scene.usda") from None
        case "space":
            raise OutOfSpaceError("disk: full")
        case "reject":
            raise RejectedSceneError("too_few_cameras", "3 of 40 cameras")
        case "parent":
            return run_child("tests.groundwork.child_work", {"do": "report", "value": value}, **LIMITS)
        case "report":
            with open(str(value), "w") as file:  # noqa: PTH123  as a plain program would
                file.write(str(os.getpid()))
            time.sleep(60)
    return None


LIMITS: dict[str, Any] = {"time_limit": 60.0, "memory_limit": 4.0}

if __name__ == "__main__":
    answer_parent(work)
