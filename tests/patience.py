"""How long a test may still wait: all its waits end, and say for what, before pytest ends the process.

That is after 300 s, and with --proof, whose counts are larger, after an hour (Makefile, which tells every process).
"""

import os
import sys
import time
from functools import cache

MOST, MOST_WITH_PROOF = 200.0, 3300.0  # [s] of one test, on a machine that many tests share


def left() -> float:
    """Give what is left of the time that the running test may wait [s]; it begins when this is first asked."""
    return max(_end(os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" (")[0]) - time.monotonic(), 0.01)


@cache
def _end(test: str) -> float:
    """Say when the patience with a test ends, on the clock that only goes forward [s]."""
    full = "--proof" in sys.argv or bool(os.environ.get("FALSEWORK_TESTS_PROOF"))
    return time.monotonic() + (MOST_WITH_PROOF if full else MOST)
