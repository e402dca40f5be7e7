"""The rooms of the house, their files, and how the rules walk a syntax tree."""

from __future__ import annotations

import ast
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("groundwork", "usd_schemas", "authoring", "render", "recon", "learn", "falsework")
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)

Function = ast.FunctionDef | ast.AsyncFunctionDef
Rule = Callable[[str], list[str]]


def tracked_files() -> list[Path]:
    """List the repository's files, those that git would add among them; links and deleted files left out."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    paths = (ROOT / name for name in sorted(set(names)) if name)
    return [path for path in paths if path.is_file() and not path.is_symlink()]


def python_files(*folders: str) -> list[Path]:
    """List the Python files of some top-level folders, sorted."""
    return [path for path in tracked_files() if path.suffix == ".py" and path.relative_to(ROOT).parts[0] in folders]


def findings(rule: Rule, files: list[Path]) -> list[str]:
    """Run a rule over files.

    Args:
        rule: Takes source text, gives lines such as "12: what is wrong".
        files: The files to read.

    Returns:
        One line per finding: "render/views/passes.py:12: what is wrong".
    """
    return [f"{path.relative_to(ROOT)}:{line}" for path in files for line in rule(path.read_text(encoding="utf-8"))]


def assert_clean(rule: Rule, files: list[Path]) -> None:
    """Fail with every finding on a line of its own.

    Args:
        rule: Takes source text, gives lines such as "12: what is wrong".
        files: The files to read.
    """
    found = findings(rule, files)
    if found:
        pytest.fail(f"{len(found)} findings\n" + "\n".join(found), pytrace=False)


def public_definitions(tree: ast.Module) -> Iterator[Function | ast.ClassDef]:
    """Walk public classes, functions and methods; what stands inside a function is private."""
    stack: list[ast.stmt] = list(tree.body)
    while stack:
        node = stack.pop(0)
        if isinstance(node, ast.If | ast.Try):
            stack = [*node.body, *node.orelse, *stack]
        if not isinstance(node, (*FUNCTIONS, ast.ClassDef)) or node.name.startswith("_"):
            continue
        yield node
        if isinstance(node, ast.ClassDef):
            stack = [*node.body, *stack]


def functions(tree: ast.Module) -> Iterator[Function]:
    """Walk every function and method, private and nested ones too."""
    for node in ast.walk(tree):
        if isinstance(node, FUNCTIONS):
            yield node


def parameters(function: Function) -> list[ast.arg]:
    """List a function's parameters in order, `*args` and `**kwargs` among them, without self and cls."""
    every = function.args
    named = [*every.posonlyargs, *every.args, every.vararg, *every.kwonlyargs, every.kwarg]
    return [parameter for parameter in named if parameter is not None and parameter.arg not in ("self", "cls")]
