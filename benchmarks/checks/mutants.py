"""Mutation tests: small faults in core modules, one at a time, that tests must detect.

Usage: python -m benchmarks.checks.mutants [--mutants N] [--seed S] [--only NAME] [--kept FILE] [--page]

Each fault changes one place: a comparison, a sign, an operation, an `and`, a `not`, an axis, or a call that stands
alone is left out. Where a whole number is written in a comparison, `<` becomes `<=`; between measured values both sides
are equal in a case that never comes, so that no test could tell the two: there `<` becomes `>=`. The tree is copied, so
the checkout is never touched. `docs/benchmarks/mutants.md` lists what survived. Half an hour for 150 faults on a core;
with `--kept FILE` it goes on where it stopped: faults of the same module and the same tests are not tried again.
"""

import argparse
import ast
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.checks.named_faults import NAMED, file_of
from benchmarks.page import write_page
from groundwork.canonical import digest
from groundwork.files import read_json, write_json
from tests.provenance import HASHED

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "mutants.md"
TIME_LIMIT = 600.0  # [s] for the tests of one fault; an endless loop is detected
FOLDERS = (*HASHED, "scenarios", "docs", "typings")

# What is tried: the modules of each subject, and the tests that must detect them. The hash of the page covers them,
# as names of modules in strings count (tests/provenance.py).
_SUBJECTS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "vote": (("recon.truth.annotate", "recon.truth.label_margin"), ("tests.recon.test_annotate",)),
    "uncertainty": (
        ("recon.truth.uncertainty", "recon.truth.triangle_points"),
        ("tests.recon.test_annotate", "tests.recon.test_triangle_points", "tests.recon.test_precision"),
    ),
    "alignment": (
        ("recon.placing.similarity", "recon.placing.align", "recon.placing.gps_fit"),
        ("tests.recon.test_align", "tests.recon.test_gps_fit", "tests.recon.test_align_gps"),
    ),
    "cameras": (
        ("usd_schemas.pinhole", "usd_schemas.distortion"),
        ("tests.usd_schemas.test_pinhole", "tests.usd_schemas.test_distortion", "tests.usd_schemas.test_cameras"),
    ),
    "cables": (
        (
            "authoring.parts.suspension_cables",
            "authoring.parts.stays",
            "authoring.parts.hangers",
            "authoring.parts.fittings",
        ),
        (
            "tests.authoring.bridges.test_cables",
            "tests.authoring.bridges.test_side_cables",
            "tests.authoring.bridges.test_fittings",
            "tests.authoring.bridges.test_families",
        ),
    ),
    "bearings": (
        ("authoring.parts.bearings",),
        ("tests.authoring.bridges.test_bearings", "tests.authoring.bridges.test_substructure"),
    ),
    "surveys": (
        ("authoring.surveys.coverage", "authoring.surveys.gps", "authoring.surveys.way"),
        ("tests.authoring.test_coverage", "tests.authoring.test_ways", "tests.authoring.test_surveys"),
    ),
    "light": (
        ("render.light.daylight", "render.light.local_lights"),
        ("tests.render.test_light", "tests.render.test_local_lights", "tests.render.test_light_choices"),
    ),
    "store": (
        ("falsework.store.store", "falsework.store.artefact", "falsework.store.verification"),
        ("tests.falsework.test_store", "tests.falsework.test_verification", "tests.falsework.test_run_samples"),
    ),
    "files": (
        ("groundwork.files", "groundwork.output.swap"),
        (
            "tests.groundwork.test_files",
            "tests.groundwork.test_output_folder",
            "tests.groundwork.test_output_file",
            "tests.faults.test_output_faults",
        ),
    ),
    "scores": (
        ("learn.metrics", "learn.scoring.panoptic", "learn.losses"),
        ("tests.learn.test_metrics", "tests.learn.test_losses"),
    ),
}
SUBJECTS = {
    subject: (tuple(map(file_of, modules)), tuple(map(file_of, tests)))
    for subject, (modules, tests) in _SUBJECTS.items()
}

# Between measured values: the other side of the edge.
_TURNED = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt}
# Between whole numbers and names: the edge itself.
_COMPARED = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
_COUNTED = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Attributes:
        subject: Row of `SUBJECTS`, or `named`.
        module: File, from the root of the repository.
        line: Line of the fault.
        what: The expression before and after.
        text: The module with the fault in it.
        tests: Files of the tests that must detect them.
    """

    subject: str
    module: str
    line: int
    what: str
    text: str
    tests: tuple[str, ...]


def mutants_of(subject: str, module: str) -> Iterator[Mutant]:
    """Give every fault that can be put into a module.

    Args:
        subject: Row of `SUBJECTS`.
        module: File, from the root of the repository.
    """
    tree = ast.parse((ROOT / module).read_text(encoding="utf-8"))
    parts = [_part(tree, row) for row in range(len(tree.body))]
    owner = {id(node): row for row, statement in enumerate(tree.body) for node in ast.walk(statement)}
    for node, change in list(_places(tree)):
        before, kept, row = _shown(node), vars(node).copy(), owner[id(node)]
        change()
        what, text = f"`{before}` → `{_shown(node)}`", "".join([*parts[:row], _part(tree, row), *parts[row + 1 :]])
        vars(node).update(kept)
        yield Mutant(subject, module, getattr(node, "lineno", 0), what, text, SUBJECTS[subject][1])


def _part(tree: ast.Module, row: int) -> str:
    """Write one statement of a module as `ast.unparse` writes it within the whole; joined, the parts are the whole."""
    part = tree.body[row]
    if row == 0:
        return ast.unparse(ast.Module([part], []))  # a docstring, if it is a text
    apart = "\n\n" if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) else "\n"
    return apart + ast.unparse(part)


def named_mutants() -> list[Mutant]:
    """Give the faults that a reviewer chose; each stands in one place."""
    found = []
    for fault in NAMED:
        before, after = (ROOT / file_of(fault.module)).read_text(encoding="utf-8").split(fault.before)
        text = before + fault.after + after
        file, tests = file_of(fault.module), tuple(map(file_of, fault.tests))
        found.append(Mutant("named", file, before.count("\n") + 1, fault.what, text, tests))
    return found


class TestRunner:
    """Runs some tests in a copy of the repository."""

    def __init__(self, tests: tuple[str, ...], tree: Path) -> None:
        """Start the process whose forks run the tests.

        Args:
            tests: Their files.
            tree: The copy.
        """
        self.tree = tree
        command = [sys.executable, "-m", "benchmarks.checks.mutant_tests", str(TIME_LIMIT), *tests]
        pipe, env = subprocess.PIPE, {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(tree)}
        self._process = subprocess.Popen(command, cwd=tree, env=env, stdin=pipe, stdout=pipe, text=True)

    def passes(self) -> bool:
        """Check whether all tests pass; an endless loop counts as a failure."""
        assert self._process.stdin is not None and self._process.stdout is not None  # noqa: PT018
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return self._process.stdout.readline() == "0\n"

    def notices(self, mutant: Mutant) -> bool:
        """Put a fault into the copy, check whether its tests fail, and restore the copy.

        Args:
            mutant: The fault.
        """
        target = self.tree / mutant.module
        kept = target.read_text(encoding="utf-8")
        target.write_text(mutant.text, encoding="utf-8")  # not atomic: a copy that goes when we end
        try:
            return not self.passes()
        finally:
            target.write_text(kept, encoding="utf-8")  # not atomic: as above

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def main() -> None:
    """Try the faults, print each, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=SUBJECTS, default=None)
    parser.add_argument("--kept", type=Path, default=None)
    parser.add_argument("--page", action="store_true")
    chosen = parser.parse_args()
    share = -(-chosen.mutants // len(SUBJECTS))
    known: dict[str, bool] = read_json(chosen.kept) if chosen.kept and chosen.kept.is_file() else {}
    found: list[tuple[Mutant, bool]] = []
    with tempfile.TemporaryDirectory() as scratch:
        tree = _copied(Path(scratch) / "tree")
        for subject in [chosen.only] if chosen.only else list(SUBJECTS):
            found += _judge(draw(subject, share, chosen.seed), tree, known, chosen.kept)
        for mutant in [] if chosen.only else named_mutants():
            found += _judge([mutant], tree, known, chosen.kept)
    if chosen.page:
        write_page(PAGE, _page(found, chosen.seed), __file__)


def draw(subject: str, count: int, seed: int) -> list[Mutant]:
    """Draw faults of a subject, in the order of its modules.

    Args:
        subject: Row of `SUBJECTS`.
        count: How many.
        seed: Each subject has a stream of its own.
    """
    every = [mutant for module in SUBJECTS[subject][0] for mutant in mutants_of(subject, module)]
    rng = np.random.default_rng([seed, list(SUBJECTS).index(subject)])
    return [every[row] for row in sorted(rng.permutation(len(every))[:count].tolist())]


def _judge(drawn: list[Mutant], tree: Path, known: dict[str, bool], kept: Path | None) -> list[tuple[Mutant, bool]]:
    """Try the faults that are held against the same tests and are not known yet, and print all."""
    found = []
    runner = TestRunner(drawn[0].tests, tree)
    if any(_identity(mutant) not in known for mutant in drawn) and not runner.passes():
        sys.exit(f"the tests of {drawn[0].subject} fail without any fault")  # else every fault would count as detected
    for mutant in drawn:
        identity = _identity(mutant)
        if identity not in known:
            known[identity] = runner.notices(mutant)
            if kept:
                write_json(kept, known)
        found.append((mutant, known[identity]))
        sys.stdout.write(f"{'detected' if known[identity] else 'SURVIVED'} {_told(mutant)}\n")
        sys.stdout.flush()
    runner.close()
    return found


def _identity(mutant: Mutant) -> str:
    """Hash a fault and the tests that it is held against."""
    tests = [(ROOT / test).read_text(encoding="utf-8") for test in mutant.tests]
    return digest([mutant.module, mutant.text, *tests])


def _copied(tree: Path) -> Path:
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, tree / folder, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tree)
    return tree


def _places(tree: ast.Module) -> Iterator[tuple[ast.AST, "Change"]]:
    """Give each place that can be changed, and what changes it; the order is that of the tree."""
    axes = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.keyword) and node.arg == "axis"}
    for node in ast.walk(tree):
        if id(node) in axes:
            continue  # an axis is exchanged for another: -1 and +1 are often the same
        if isinstance(node, ast.Compare) and type(node.ops[0]) in _COMPARED:
            table = _COMPARED if _is_counted(node) else {**_COMPARED, **_TURNED}
            yield node, Change(node, "ops", [table[type(node.ops[0])](), *node.ops[1:]])
        elif isinstance(node, ast.BinOp) and type(node.op) in _COUNTED and not _is_annotation(node):
            yield node, Change(node, "op", _COUNTED[type(node.op)]())
        elif isinstance(node, ast.BoolOp):
            yield node, Change(node, "op", ast.Or() if isinstance(node.op, ast.And) else ast.And())
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            yield node, Change(node, "op", ast.UAdd() if isinstance(node.op, ast.USub) else _Nothing())
        elif isinstance(node, ast.keyword) and node.arg == "axis" and ast.unparse(node.value) in ("0", "1", "-1"):
            yield node, Change(node, "value", ast.Constant(0 if ast.unparse(node.value) != "0" else 1))
        elif isinstance(node, ast.If):
            yield node, Change(node, "test", ast.UnaryOp(ast.Not(), node.test))
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield node, Change(node, "value", ast.Constant(None))


class _Nothing(ast.Not):
    """Marker of `not not`: the unchanged operand."""


@dataclass(frozen=True)
class Change:
    """One change of a syntax tree.

    Attributes:
        node: What is changed.
        field: Its field.
        value: What the field becomes.
    """

    node: ast.AST
    field: str
    value: object

    def __call__(self) -> None:
        """Make the change."""
        if isinstance(self.value, _Nothing) and isinstance(self.node, ast.UnaryOp):
            self.node.operand = ast.UnaryOp(ast.Not(), self.node.operand)
        else:
            setattr(self.node, self.field, self.value)


def _is_counted(node: ast.Compare) -> bool:
    """Check whether one side of a comparison is an integer or a length."""
    sides = (node.left, *node.comparators)
    return any(
        (isinstance(side, ast.Constant) and type(side.value) is int)
        or (isinstance(side, ast.Call) and ast.unparse(side.func) == "len")
        for side in sides
    )


def _is_annotation(node: ast.BinOp) -> bool:
    """Check whether `|` joins types, such as `Path | None`."""
    leaves = list(ast.walk(node))
    has_none = any(isinstance(leaf, ast.Constant) and leaf.value is None for leaf in leaves)
    has_type = any(isinstance(leaf, ast.Name) and leaf.id[:1].isupper() for leaf in leaves)
    return isinstance(node.op, ast.BitOr) and (has_none or has_type)


def _shown(node: ast.AST) -> str:
    """Describe the change: of a branch, its condition."""
    return ast.unparse(node.test if isinstance(node, ast.If) else node)


def _told(mutant: Mutant) -> str:
    return f"{mutant.subject}: {mutant.module}:{mutant.line}: {mutant.what[:160]}"


def _page(found: list[tuple[Mutant, bool]], seed: int) -> str:
    lines = [
        "# Mutation tests",
        "",
        "Written by `python -m benchmarks.checks.mutants --page`.",
        f"{len(found)} small faults, one at a time; their tests must fail. They are drawn with seed {seed}; those",
        "called *named* were chosen by a reviewer, and tests once did not detect them.",
        "",
        "| subject | faults | detected |",
        "|---|---|---|",
    ]
    for subject in dict.fromkeys(mutant.subject for mutant, _ in found):
        judged = [noticed for mutant, noticed in found if mutant.subject == subject]
        lines.append(f"| {subject} | {len(judged)} | {sum(judged)} |")
    judged = [noticed for _, noticed in found]
    lines += [
        f"| **all** | {len(judged)} | {sum(judged)} ({100 * sum(judged) / max(len(judged), 1):.1f} %) |",
        "",
        "## Not detected",
        "",
    ]
    lines += [f"- {_told(mutant)}" for mutant, noticed in found if not noticed] or ["None."]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
