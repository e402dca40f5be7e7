"""Which faults `benchmarks.checks.mutants` puts into a line, by the rules that its docstring states."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from benchmarks.checks.mutants import SUBJECTS, _places, draw, mutants_of, named_mutants
from tests.house.house import ROOT


def faults_of(source: str) -> list[str]:
    """Give a line with each fault that can be put into it."""
    count = len(list(_places(ast.parse(source))))
    found = []
    for number in range(count):
        tree = ast.parse(source)
        _, change = list(_places(tree))[number]
        change()
        found.append(ast.unparse(tree))
    return sorted(found)


@pytest.mark.parametrize(
    ("source", "faults"),
    [
        ("a < 1", ["a <= 1"]),
        ("len(a) >= b", ["len(a) > b"]),
        ("a < 1.0", ["a >= 1.0"]),
        ("a <= b", ["a > b"]),
        ("a == b", ["a != b"]),
        ("a + b", ["a - b"]),
        ("a and b", ["a or b"]),
        ("not a", ["not not a"]),
        ("-a", ["+a"]),
        ("x: Path | None = a", []),
        ("f(a, axis=-1)", ["None", "f(a, axis=0)"]),
        ("if a:\n    pass", ["if not a:\n    pass"]),
        ("a = f(b)", []),
    ],
)
def test_each_fault_changes_one_place(source: str, faults: list[str]) -> None:
    """Edges between whole numbers move by one, comparisons of measured values turn round, calls alone go."""
    assert faults_of(source) == faults


def test_every_text_is_the_module_with_one_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Faults are put in one after the other and taken out: each text is as if the module were read anew for it."""
    source = '"""A text."""\nimport os\nA = -1\n"""Another."""\n\n@f\ndef g(a: int) -> bool:\n    """B."""\n'
    source += "    if not a < 1:\n        os.f(-a + A, axis=0)\n    return a and A\n\n"
    source += "class B:\n    c = 1 - 2\n\nassert B.c == A\n"
    (tmp_path / "a.py").write_text(source)
    monkeypatch.setattr("benchmarks.checks.mutants.ROOT", tmp_path)
    texts = [mutant.text for mutant in mutants_of("vote", "a.py")]
    assert sorted(texts) == faults_of(source)
    assert len(texts) == 11


def test_a_seed_draws_the_same_faults() -> None:
    """Whatever else is drawn: each subject has a stream of its own; its files and tests are there."""
    first, again, other = (draw("uncertainty", 5, seed) for seed in (0, 0, 1))  # the smallest modules
    assert first == again
    assert first != other
    for modules, tests in SUBJECTS.values():
        assert all((ROOT / name).is_file() for name in (*modules, *tests))


def test_named_faults_stand_where_they_say() -> None:
    """Each names a text that stands once in its file, and changes it."""
    for mutant in named_mutants():
        assert mutant.text != (ROOT / mutant.module).read_text(encoding="utf-8")
        assert all((ROOT / name).is_file() for name in mutant.tests)
