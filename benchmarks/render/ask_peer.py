"""Asks one of `benchmarks/peers` in the Python that has what it compares us with."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import benchmarks.peers

SCRIPTS = Path(benchmarks.peers.__file__).resolve().parent


def ask_peer(python: str, script: str, work: Path, request: dict[str, Any]) -> Any:
    """Run a script, and read its answer.

    Args:
        python: The Python that runs it.
        script: Its name in `benchmarks/peers`.
        work: Folder for its answer.
        request: What it is asked, without the file of the answer.

    Raises:
        RuntimeError: It ended without an answer.
    """
    answer = work / "answer.json"
    answer.unlink(missing_ok=True)
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PXR_"))}
    environment["PYOPENGL_PLATFORM"] = "egl"
    command = [python, str(SCRIPTS / script), json.dumps({**request, "answer": str(answer)})]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if not answer.is_file():  # who has answered may well crash while it closes its context
        raise RuntimeError(f"{script} ended with {done.returncode}: {done.stderr.strip().splitlines()[-1:]}")
    return json.loads(answer.read_text(encoding="utf-8"))
