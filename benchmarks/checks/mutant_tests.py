"""Runs the same tests again and again, each time in a fork of a process that has the large libraries loaded.

Usage: python -m benchmarks.checks.mutant_tests SECONDS TEST_FILE…, in a copy of the repository. For each line on its
input it runs the tests, and answers with one line: the exit code of pytest, or -1 where they took longer than that.
Nothing of the repository is imported before the fork, so that each run sees the files as they are.
"""

import contextlib
import importlib
import os
import signal
import sys
import time

# None of them starts a thread when it is imported, which a fork would lose.
LIBRARIES = (
    "cv2",
    "hypothesis",
    "laspy",
    "numba",
    "numpy",
    "pxr.Sdf",
    "pxr.Usd",
    "pxr.UsdGeom",
    "pxr.UsdShade",
    "pycolmap",
    "pydantic",
    "pytest",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.signal",
    "scipy.spatial",
    "scipy.stats",
    "sklearn.metrics",
    "torch",
    "trimesh",
)
_STEP = 0.05  # [s] between two looks at a run


def main(limit: float, tests: list[str], libraries: tuple[str, ...] = LIBRARIES) -> None:
    """Load the libraries, then run the tests for each line of the input.

    Args:
        limit: Longest time of a run [s].
        tests: Files of tests.
        libraries: What to load first; what is not installed is left out.
    """
    for name in libraries:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    for _ in sys.stdin:
        sys.stdout.write(f"{_run(limit, tests)}\n")
        sys.stdout.flush()


def _run(limit: float, tests: list[str]) -> int:
    """Run the tests in a fork."""
    child = os.fork()
    if child == 0:
        os.setsid()  # tests start processes of their own, which must end with it
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        import pytest

        os._exit(int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *tests])))
    end = time.monotonic() + limit
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(_STEP)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -1


if __name__ == "__main__":
    main(float(sys.argv[1]), sys.argv[2:])
