"""Damaged files of every format: refused in one line, harmless, or read as what they now say; no crash, no hang."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Count, RecordProof
from tests.faults.mutated_reading import CRASHED, DIED, OTHER, REFUSED, SAME, WRONG
from tests.faults.readers import FORMATS
from tests.house.house import ROOT

SEED = 24
# [s] of processor time for one small file. The slowest of 2,000 took 1.2 s on a busy machine (a USD world, read in a
# child process); the rest is for slower machines. What this shall catch, an endless or quadratic reader, takes more.
LONGEST = 10.0


def read_mutated(folder: Path, count: int, seed: int, wall: float) -> list[dict[str, Any]]:
    """Damage and read so many files in a process of their own, which nothing may end before that time [s]."""
    command = [sys.executable, "-m", "tests.faults.mutated_reading", str(folder), str(count), str(seed)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=wall, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return [json.loads(line.partition("\x1e")[2]) for line in done.stdout.split("\n") if "\x1e" in line]


@pytest.mark.faults
def test_damaged_files_are_refused_or_read(tmp_path: Path, proof_count: Count, record_proof: RecordProof) -> None:
    """Truncated, flipped, spliced, grown and nested files of all formats: no crash, no hang, no silent wrong data."""
    count = proof_count(120, 2000)  # three of each format at least
    rows = read_mutated(tmp_path, count, SEED, proof_count(200, 1500))
    assert len(rows) == count
    assert {row["format"] for row in rows} == set(FORMATS) - ({"e57"} if not find_spec("pye57") else set())
    bad = [row for row in rows if row["outcome"] not in (REFUSED, SAME, OTHER, DIED)]
    assert not bad, "\n".join(f"{row['format']} {row['number']}: {row['outcome'][-1500:]}" for row in bad[:5])
    assert max(row["seconds"] for row in rows) < LONGEST
    found = Counter(row["outcome"] for row in rows)
    assert found[REFUSED] > count // 2  # the damage is real
    figures = {
        "formats": len(FORMATS),
        "refused": found[REFUSED],
        "unchanged": found[SAME],
        "other": found[OTHER],
        "died_in_a_child": found[DIED],
        "crashed_or_wrong": len(bad),
    }
    record_proof("untrusted input: damaged files of every format", count, SEED, figures)


def test_the_suite_sees_what_it_looks_for(tmp_path: Path) -> None:
    """A reader that raises anything else crashes, and one that gives other data from a sealed file is wrong."""
    from tests.faults.mutated_reading import outcome, spelled
    from tests.faults.samples import Sample

    def fail() -> None:
        raise KeyError("files")

    file = tmp_path / "x"
    assert outcome(Sample(file, fail), None).startswith(CRASHED)
    assert outcome(Sample(file, lambda: 2, sealed=True), spelled(1)) == WRONG
    assert outcome(Sample(file, lambda: 2), spelled(1)) == OTHER
    assert outcome(Sample(file, lambda: 1, sealed=True), spelled(1)) == SAME
