"""What every test may use: counts that grow with ``--proof``, and the rows that make up ``docs/proof.json``.

A plain run keeps every count small. ``make proof`` runs the same tests with ``--proof``: counts grow, tests marked
``proof_only`` take part, and what a test measured is written down as one row with the seed and the commit it came from.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]
PROOF_FILE = ROOT / "docs" / "proof.json"

Count = Callable[[int, int], int]
Figures = Mapping[str, float | int | str | bool | list[Any]]
RecordProof = Callable[[str, int, int, Figures], None]

settings.register_profile("quick", max_examples=40, deadline=None, derandomize=True, database=None)
settings.register_profile("proof", max_examples=1000, deadline=None, derandomize=True, database=None)

_SENT = "falsework_proof_rows"
_ROWS = pytest.StashKey[dict[str, dict[str, Any]]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--proof``."""
    parser.addoption("--proof", action="store_true", help="full counts; writes the measured rows to docs/proof.json")


def pytest_configure(config: pytest.Config) -> None:
    """Choose how many examples Hypothesis draws, and start with no proof rows."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as a shell sets it for `make test &`; children inherit it
        signal.signal(signal.SIGINT, signal.default_int_handler)
    settings.load_profile("proof" if config.getoption("--proof") else "quick")
    config.stash[_ROWS] = {}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip what this run cannot do: ``proof_only`` without ``--proof``, ``dcc`` without a Python that has bpy."""
    proof = config.getoption("--proof")
    bpy = os.environ.get("FALSEWORK_BPY_PYTHON")
    for item in items:
        if not proof and item.get_closest_marker("proof_only"):
            item.add_marker(pytest.mark.skip(reason="runs with --proof only (make proof)"))
        if not bpy and item.get_closest_marker("dcc"):
            item.add_marker(pytest.mark.skip(reason="FALSEWORK_BPY_PYTHON names no Python with bpy (make test-dcc)"))


@pytest.fixture(scope="session")
def proof_count(request: pytest.FixtureRequest) -> Count:
    """Give ``count(quick, full)``: ``full`` with ``--proof``, else ``quick``."""
    proof = bool(request.config.getoption("--proof"))

    def count(quick: int, full: int) -> int:
        return full if proof else quick

    return count


@pytest.fixture(scope="session")
def record_proof(request: pytest.FixtureRequest) -> RecordProof:
    """Give ``record(name, count, seed, figures)``: one row of ``docs/proof.json``, kept when the run has ``--proof``.

    ``name`` says what was proven ("render: depth equals ray-cast depth"), ``count`` how many cases took part,
    ``figures`` what was measured, units in the keys ("median_error_m"). A name is recorded once a run.
    """
    rows = request.config.stash[_ROWS]

    def record(name: str, count: int, seed: int, figures: Figures) -> None:
        if name in rows:
            raise ValueError(f"proof row {name!r} is recorded twice")
        rows[name] = {"name": name, "count": count, "seed": seed, "figures": dict(figures)}

    return record


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Merge the rows of a successful ``--proof`` run into ``docs/proof.json``; a failed run writes nothing."""
    rows = session.config.stash[_ROWS]
    if (output := getattr(session.config, "workeroutput", None)) is not None:
        output[_SENT] = json.dumps(rows)  # one of several processes: the first one writes
    elif session.config.getoption("--proof") and rows and exitstatus == pytest.ExitCode.OK:
        commit = _git("rev-parse", "HEAD") or "none"
        dirty = bool(_git("status", "--porcelain", "--", ".", ":!docs"))
        write_proof(PROOF_FILE, [{**row, "commit": commit, "dirty": dirty} for row in rows.values()])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Take over the rows that another process of the same run has recorded."""
    sent = getattr(node, "workeroutput", {}).get(_SENT, "{}")
    node.config.stash[_ROWS].update(json.loads(sent))


def write_proof(path: Path, rows: list[dict[str, Any]]) -> None:
    """Merge rows into a proof file by name, sorted, with one rename.

    Args:
        path: The JSON file; it need not exist.
        rows: New rows; each replaces the row of the same name.
    """
    known = {row["name"]: row for row in json.loads(path.read_text())["rows"]} if path.exists() else {}
    known.update({row["name"]: row for row in rows})
    merged = {"format_version": 1, "rows": [known[name] for name in sorted(known)]}
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, partial = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".partial")
    with os.fdopen(handle, "w") as stream:
        json.dump(merged, stream, indent=1, sort_keys=True)
        stream.write("\n")
    Path(partial).chmod(0o644)
    Path(partial).replace(path)


def _git(*arguments: str) -> str:
    """Run git in the repository; an empty string where there is no git or no commit yet."""
    try:
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
