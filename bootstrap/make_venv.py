"""Make a virtual environment, or say in one line why not. Runs on any Python 3, before anything is installed.

Usage: python3 bootstrap/make_venv.py DIRECTORY [EXACT_VERSION]
"""

import subprocess
import sys
from importlib.util import find_spec

OLDEST = (3, 11)
NEWEST = (3, 14)


def main(directory: str, exact: str = "") -> int:
    """Make the environment.

    Args:
        directory: Where to put it; an existing environment is kept.
        exact: A version such as "3.11" that this Python must have; empty for any that Falsework supports.

    Returns:
        0, or 2 after one line on stderr.
    """
    mine = "{}.{}".format(*sys.version_info[:2])
    if exact and mine != exact:
        return _refuse(f"{directory} needs Python {exact}, this is {mine}: name one with PYTHON_DCC=/path/to/it")
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        return _refuse(
            f"Python {OLDEST[0]}.{OLDEST[1]} to {NEWEST[0]}.{NEWEST[1]} is needed, this is {mine}: "
            "name another with PYTHON=/path/to/python3"
        )
    if find_spec("ensurepip") is None or find_spec("venv") is None:
        return _refuse(f"Python {mine} cannot make virtual environments: apt-get install python3-venv")
    return subprocess.run([sys.executable, "-m", "venv", directory], check=False).returncode


def _refuse(reason: str) -> int:
    """Print the reason in one line and give the exit code for bad input."""
    sys.stderr.write(f"falsework set-up: {reason}\n")
    return 2


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
