"""What was killed, filled up, damaged and flipped, how often: `python -m benchmarks.checks.faults`.

Writes `docs/benchmarks/faults.md` from the tests marked `faults` and from the rows that `make test-faults` wrote into
docs/proof.json. pytest counts the cases of each test; none is run here.
"""

import ast
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.page import write_page
from groundwork.files import read_json

ROOT = Path(__file__).resolve().parents[2]
PROOF = ROOT / "docs" / "proof.json"
PAGE = ROOT / "docs" / "benchmarks" / "faults.md"
MARK = "pytest.mark.faults"


@dataclass(frozen=True)
class FaultTest:
    """A test that does something bad.

    Attributes:
        place: `file::name`, as pytest spells it.
        fact: What it proves, the first line of its docstring.
        counts: For each count that grows: how many in `make test`, and how many in `make test-faults`.
    """

    place: str
    fact: str
    counts: tuple[tuple[int, int], ...]


def main() -> None:
    """Write the page."""
    tests = [test for path in sorted((ROOT / "tests").rglob("test_*.py")) for test in fault_tests(path)]
    write_page(PAGE, page(tests, count_cases(), read_json(PROOF)["rows"]), __file__)


def count_cases() -> Counter[str]:
    """Ask pytest how many cases each marked test has: `file::name`, and how often it is run with other arguments."""
    words = ("-m", "pytest", "-m", "faults", "--collect-only", "-q", "-n", "0")
    said = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return Counter(line.partition("[")[0] for line in said.splitlines() if "::" in line)


def fault_tests(path: Path) -> Iterator[FaultTest]:
    """Find the tests of a module that are marked.

    Args:
        path: The module.
    """
    module = ast.parse(path.read_text(encoding="utf-8"))
    marks = [ast.unparse(node.value) for node in module.body if isinstance(node, ast.Assign) and _is_mark(node)]
    whole = any(MARK in mark for mark in marks)
    for node in module.body:
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            own = [ast.unparse(decorator) for decorator in node.decorator_list]
            if whole or any(MARK in one for one in own):
                fact = (ast.get_docstring(node) or "").partition("\n")[0]
                counts = tuple(_counts(node))[:1]  # further ones are other quantities, such as seconds
                yield FaultTest(f"{path.relative_to(ROOT).as_posix()}::{node.name}", fact, counts)


def page(tests: list[FaultTest], cases: Mapping[str, int], rows: list[dict[str, Any]]) -> str:
    """Write the page.

    Args:
        tests: The marked tests.
        cases: How many cases each of them has.
        rows: Rows of docs/proof.json.
    """
    measured: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        measured.setdefault(str(row.get("test", "")).partition("[")[0], []).append(row)
    lines = [
        "# Faults, and how often each was tried",
        "",
        "Written by `python -m benchmarks.checks.faults` from the tests marked `faults`. *Cases*: how often "
        "a test runs with other arguments. *Quick* is the count within a case in `make test`, *full* the one in `make "
        "test-faults`, or as many as there are, if those are fewer; a test without counts is the same in both, and has "
        "no row of its own. *Measured*: what the last "
        "full run wrote into [proof.json](../proof.json), with its commit.",
        "",
        "| fact | test | cases | quick | full | measured |",
        "|---|---|---|---|---|---|",
    ]
    for test in tests:
        quick, full = (", ".join(f"{pair[one]:,}" for pair in test.counts) for one in (0, 1))
        done = "; ".join(f"{row['count']:,} ({row['commit'][:7]})" for row in measured.get(test.place, []))
        name = test.place.removeprefix("tests/")
        lines.append(
            f"| {test.fact.replace('|', chr(92) + '|')} | `{name}` | {cases[test.place]} | {quick} | {full} | {done} |"
        )
    return "\n".join(lines) + "\n"


def _is_mark(node: ast.Assign) -> bool:
    return any(isinstance(target, ast.Name) and target.id == "pytestmark" for target in node.targets)


def _counts(function: ast.FunctionDef) -> Iterator[tuple[int, int]]:
    """Find the counts that are written out; one that a test computes is not told."""
    for node in ast.walk(function):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "proof_count":
            quick, full = (one.value if isinstance(one, ast.Constant) else None for one in node.args)
            if isinstance(quick, int) and isinstance(full, int):
                yield quick, full


if __name__ == "__main__":
    main()
