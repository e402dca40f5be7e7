"""The rows of docs/proof.json: who writes them, when, and what is skipped without ``--proof``."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.house.house import ROOT

SAMPLE = """
import pytest

def test_counts(proof_count, record_proof):
    record_proof("b: sample", proof_count(2, 50), 7, {"error_m": 0.5})
    record_proof("a: sample", 1, 7, {"error_m": 0.25})

@pytest.mark.proof_only
def test_long():
    pass

@pytest.mark.dcc
def test_blender():
    pass
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Lay out a project of one test with our conftest and settings."""
    (tmp_path / "tests").mkdir()
    shutil.copy(ROOT / "tests" / "conftest.py", tmp_path / "tests")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "tests" / "test_sample.py").write_text(SAMPLE)
    return tmp_path


def run(project: Path, *arguments: str) -> str:
    """Run pytest there and give its closing line."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("FALSEWORK_", "PYTEST_"))}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    done = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)
    return done.stdout.strip().splitlines()[-1]


def rows(project: Path) -> list[dict[str, Any]]:
    """Read the rows that were written."""
    return json.loads((project / "docs" / "proof.json").read_text())["rows"]


def test_a_plain_run_is_quick_and_writes_nothing(project: Path) -> None:
    """Without --proof the long test and the Blender test are skipped, and no file appears."""
    assert run(project).startswith("1 passed, 2 skipped")
    assert not (project / "docs").exists()


def test_a_proof_run_writes_sorted_rows(project: Path) -> None:
    """With --proof counts are full, the long test runs, rows are sorted, and another run's rows are kept."""
    (project / "docs").mkdir()
    old = [{"name": name, "count": 1} for name in ("a: sample", "z: other")]
    (project / "docs" / "proof.json").write_text(json.dumps({"format_version": 1, "rows": old}))
    assert run(project, "--proof").startswith("2 passed, 1 skipped")
    written = rows(project)
    assert [row["name"] for row in written] == ["a: sample", "b: sample", "z: other"]
    assert written[1] == {
        "name": "b: sample",
        "count": 50,
        "seed": 7,
        "commit": "none",
        "dirty": False,
        "figures": {"error_m": 0.5},
    }
    assert list((project / "docs").iterdir()) == [project / "docs" / "proof.json"]


def test_a_failed_proof_run_writes_nothing(project: Path) -> None:
    """One failure, and no figure of that run is kept."""
    with (project / "tests" / "test_sample.py").open("a") as file:
        file.write("\ndef test_wrong():\n    assert False\n")
    assert "1 failed" in run(project, "--proof")
    assert not (project / "docs").exists()
