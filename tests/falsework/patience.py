"""How long a test may still wait: all its waits end, and say for what, before pytest ends the process (300 s)."""

import os
import time
from functools import cache

MOST = 200.0  # [s] of one test, on a machine that many tests share


def left() -> float:
    """Give what is left of the time that the running test may wait [s]; it begins when this is first asked."""
    return max(_end(os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" (")[0]) - time.monotonic(), 0.01)


@cache
def _end(test: str) -> float:
    """Say when the patience with a test ends, on the clock that only goes forward [s]."""
    return time.monotonic() + MOST
