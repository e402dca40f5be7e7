"""What every test may use: counts that grow with ``--proof``, and the rows that make up ``docs/proof.json``.

A plain run keeps every count small. With ``--proof`` counts grow, tests marked ``proof_only`` take part, and what a
test measured is written down as one row with the seed, the commit and a hash of the code that it speaks of
(tests/provenance.py). With ``--stale`` only tests run whose rows are missing or speak of other code.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from tests.proof_rows import fresh_tests, read_rows, write_proof
from tests.provenance import digest_of

# One process runs on each core already, and threads that wait for one another on a busy machine take minutes.
os.environ.setdefault("OMP_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[1]
PROOF_FILE = ROOT / "docs" / "proof.json"

Count = Callable[[int, int], int]
Figures = Mapping[str, float | int | str | bool | list[Any]]
RecordProof = Callable[[str, int, int, Figures], None]

settings.register_profile("quick", max_examples=40, deadline=None, derandomize=True, database=None)
settings.register_profile("proof", max_examples=1000, deadline=None, derandomize=True, database=None)

_SENT = "falsework_proof_row"
_RUNNING = pytest.StashKey[pytest.Item]()
_NAMES = pytest.StashKey[set[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--proof`` and ``--stale``."""
    parser.addoption("--proof", action="store_true", help="full counts; writes the measured rows to docs/proof.json")
    parser.addoption("--stale", action="store_true", help="only tests whose rows are missing or speak of other code")


def pytest_configure(config: pytest.Config) -> None:
    """Choose how many examples Hypothesis draws, and start with no proof rows."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as a shell sets it for `make test &`; children inherit it
        signal.signal(signal.SIGINT, signal.default_int_handler)
    settings.load_profile("proof" if config.getoption("--proof") else "quick")
    config.stash[_NAMES] = set()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip what this run cannot do: ``proof_only`` without ``--proof``, ``dcc`` without a Python that has bpy."""
    proof = config.getoption("--proof")
    bpy = os.environ.get("FALSEWORK_BPY_PYTHON")
    for item in items:
        if not proof and item.get_closest_marker("proof_only"):
            item.add_marker(pytest.mark.skip(reason="runs with --proof only (make proof)"))
        if not bpy and item.get_closest_marker("dcc"):
            item.add_marker(pytest.mark.skip(reason="FALSEWORK_BPY_PYTHON names no Python with bpy (make test-dcc)"))
    if config.getoption("--stale"):
        fresh = fresh_tests(read_rows(PROOF_FILE), config.rootpath)
        recording = [item for item in items if "record_proof" in getattr(item, "fixturenames", ())]
        kept = [item for item in recording if item.nodeid not in fresh]
        config.hook.pytest_deselected(items=[item for item in items if item not in kept])
        items[:] = kept


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Remember which test runs: the rows that it records are its own."""
    item.config.stash[_RUNNING] = item


@pytest.fixture(scope="session")
def proof_count(request: pytest.FixtureRequest) -> Count:
    """Give ``count(quick, full)``: ``full`` with ``--proof``, else ``quick``."""
    proof = bool(request.config.getoption("--proof"))

    def count(quick: int, full: int) -> int:
        return full if proof else quick

    return count


@pytest.fixture(scope="session")
def record_proof(request: pytest.FixtureRequest) -> RecordProof:
    """Give ``record(name, count, seed, figures)``: one row of ``docs/proof.json``, kept when its test passes.

    ``name`` says what was proven ("render: depth equals ray-cast depth"), ``count`` how many cases took part,
    ``figures`` what was measured, units in the keys ("median_error_m"): never a limit. A name is recorded once a run.
    """
    config = request.config

    def record(name: str, count: int, seed: int, figures: Figures) -> None:
        if name in config.stash[_NAMES]:
            raise ValueError(f"proof row {name!r} is recorded twice")
        config.stash[_NAMES].add(name)
        if config.getoption("--proof"):
            item = config.stash[_RUNNING]
            row = {"name": name, "count": count, "seed": seed, "figures": dict(figures)}
            row |= {"test": item.nodeid, "code": digest_of(item.path, config.rootpath)}
            item.user_properties.append((_SENT, json.dumps(row)))  # travels to the first process with the report

    return record


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Write the rows of a test that passed; one that failed writes nothing."""
    sent = [json.loads(str(value)) for key, value in report.user_properties if key == _SENT]
    if sent and report.when == "call" and report.passed and "PYTEST_XDIST_WORKER" not in os.environ:
        dirty = bool(_git("status", "--porcelain", "--", ".", ":!docs"))
        commit = _git("rev-parse", "HEAD") or "none"
        write_proof(PROOF_FILE, [{**row, "commit": commit, "dirty": dirty} for row in sent])


def _git(*arguments: str) -> str:
    """Run git in the repository; an empty string where there is no git or no commit yet."""
    try:
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
