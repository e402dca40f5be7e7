"""Killed at any moment, a run goes on, and ends with the same bytes as one that nobody disturbed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from groundwork.canonical import file_digest
from tests.conftest import Count
from tests.end_to_end.conftest import Chain


@pytest.mark.faults
def test_killed_run_goes_on(chain: Chain, tmp_path: Path, proof_count: Count) -> None:
    """Kill the whole run at random moments, run it again to its end, and compare every stored byte."""
    scenario, out = tmp_path / "scenario.toml", tmp_path / "out"
    scenario.write_text(chain.scenario.as_toml())
    command = [sys.executable, "-m", "falsework", "run", str(scenario), "-o", str(out)]
    draw = np.random.default_rng(5)
    for _ in range(proof_count(1, 12)):
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        time.sleep(draw.uniform(2.0, 20.0))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    subprocess.run(command, check=True, capture_output=True)
    wanted = {path.name for path in chain.out.glob("store/*/*")}
    for stage in ("stage", "capture", "model", "cloud"):
        (done,) = out.glob(f"store/{stage}/*")
        assert done.name in wanted
        assert _digests(done) == _digests(chain.out / "store" / stage / done.name)
    assert not list((out / "work").iterdir())


def _digests(folder: Path) -> dict[str, str]:
    """Hash each file, so that a difference names it."""
    return {path.relative_to(folder).as_posix(): file_digest(path) for path in folder.rglob("*") if path.is_file()}
