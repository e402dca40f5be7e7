"""The rows of docs/proof.json: who writes them, when, and what is skipped without ``--proof``."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.house.house import ROOT, python_files
from tests.proof_rows import read_rows, state_of, write_proof
from tests.provenance import digest_of
from tests.renamed import renew

CODE = '"""Counts."""\n\n\ndef one():\n    """Give 1."""\n    return 1\n'

SAMPLE = """
import pytest

def test_counts(proof_count, record_proof):
    assert "learn.counting"
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
    for name in ("conftest.py", "proof_rows.py", "provenance.py"):
        shutil.copy(ROOT / "tests" / name, tmp_path / "tests")
    (tmp_path / "learn").mkdir()
    (tmp_path / "learn" / "counting.py").write_text(CODE)
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
    code = written[1].pop("code")
    assert len(code) == 16
    assert written[0]["code"] == code
    assert written[1] == {
        "name": "b: sample",
        "count": 50,
        "seed": 7,
        "test": "tests/test_sample.py::test_counts",
        "commit": "none",
        "dirty": False,
        "figures": {"error_m": 0.5},
    }
    assert list((project / "docs").iterdir()) == [project / "docs" / "proof.json"]


def test_the_rows_of_a_failed_test_are_not_written(project: Path) -> None:
    """What a test recorded before it failed is dropped; those of the tests that passed arrive, from processes too."""
    with (project / "tests" / "test_sample.py").open("a") as file:
        file.write('\ndef test_wrong(record_proof):\n    record_proof("c: wrong", 1, 7, {})\n    assert False\n')
    assert "1 failed" in run(project, "--proof", "-n", "1")
    assert [row["name"] for row in rows(project)] == ["a: sample", "b: sample"]


def test_stale_runs_only_what_speaks_of_other_code(project: Path) -> None:
    """Fresh rows are left alone; another result of a function that a test names, or a new test, runs again."""
    assert run(project, "--proof", "--stale").startswith("1 passed, 2 deselected")
    code = project / "learn" / "counting.py"
    code.write_text(CODE.replace("Give 1", "Give one").replace("Counts", "Counting"))
    assert run(project, "--proof", "--stale").startswith("3 deselected")
    code.write_text(CODE.replace("return 1", "return 2"))
    assert run(project, "--proof", "--stale").startswith("1 passed, 2 deselected")


def test_only_fixtures_that_are_asked_for_count(project: Path) -> None:
    """What a conftest imports is spoken of where a test asks for its fixtures, through another conftest too."""
    inner = project / "tests" / "room" / "inner"
    inner.mkdir(parents=True)
    test = inner / "test_room.py"
    (inner.parent / "conftest.py").write_text(
        "import pytest\n\nfrom learn import counting\n\n\n@pytest.fixture\ndef counted():\n    return counting\n"
    )
    test.write_text("def test_nothing(tmp_path):\n    assert tmp_path\n")
    code = project / "learn" / "counting.py"

    def speaks_of_it() -> bool:
        code.write_text(CODE)
        before = digest_of(test, project)
        code.write_text(CODE.replace("return 1", "return 22"))
        return digest_of(test, project) != before

    assert not speaks_of_it()
    test.write_text("def test_it(counted):\n    assert counted\n")
    assert speaks_of_it()
    (inner / "conftest.py").write_text("import pytest\n\n\n@pytest.fixture\ndef twice(counted):\n    return counted\n")
    test.write_text("def test_it(twice):\n    assert twice\n")
    assert speaks_of_it()


def test_states_of_rows(project: Path) -> None:
    """A row whose test is gone, and one that never said its code, are told apart from fresh and stale ones."""
    codes: dict[str, str] = {}
    code = digest_of(project / "tests" / "test_sample.py", project)
    first = {"name": "a: sample", "test": "tests/test_sample.py::test_counts", "code": code}
    assert state_of(first, project, codes) == "fresh"
    assert state_of({**first, "code": "0" * 16}, project, codes) == "stale"
    assert state_of({**first, "test": "tests/test_sample.py::test_no_more[1]"}, project, codes) == "gone"
    assert state_of({**first, "test": "tests/test_other.py::test_counts"}, project, codes) == "gone"
    assert state_of({"name": "old"}, project, codes) == "unknown"


def test_other_names_stale_nothing(project: Path) -> None:
    """A row is renewed where undoing the names gives the code that it speaks of, and nowhere else."""
    test, code, proof = project / "tests" / "test_sample.py", project / "learn" / "counting.py", project / "proof.json"
    row = {"name": "a", "test": "tests/test_sample.py::test_counts", "code": digest_of(test, project)}
    write_proof(proof, [row])
    code.rename(code.with_stem("sums"))
    test.write_text(test.read_text().replace("learn.counting", "learn.sums"))
    subprocess.run("git init -q && git add -A", cwd=project, shell=True, check=True)
    renamed = CODE.replace("one", "unity")
    (project / "learn" / "sums.py").write_text(renamed.replace("return 1", "return 2"))
    assert renew(proof, {"unity": "one", "sums": "counting"}, project) == (0, 1)
    (project / "learn" / "sums.py").write_text(renamed)
    assert renew(proof, {"unity": "one", "sums": "counting"}, project) == (1, 1)
    assert read_rows(proof) == [{**row, "code": digest_of(test, project)}]
    assert state_of(read_rows(proof)[0], project, {}) == "fresh"


def test_figures_are_measured() -> None:
    """No test records a number that stands in its text, nor a limit: a figure is what was found."""
    found = [
        f"{path.relative_to(ROOT)}:{value.lineno}"
        for path in python_files("tests")
        if "record_proof(" in (text := path.read_text(encoding="utf-8"))
        for call in ast.walk(ast.parse(text))
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "record_proof"
        for table in ast.walk(call)
        if isinstance(table, ast.Dict)
        for value in table.values
        if isinstance(value, ast.Constant) or (isinstance(value, ast.Name) and value.id.isupper())
    ]
    assert found == []
