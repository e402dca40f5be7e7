"""Modules and functions stay small, and everything is annotated."""

from __future__ import annotations

import pytest

from tests.house.house import parameters
from tests.house.trees import functions_of

MODULE_LINES = 400
FUNCTION_LINES = 60
MOST_ARGUMENTS = 6  # that are told apart by their place; options are given by keyword
LONG_FUNCTION_LINES = 80  # with "# long: <why>" above it or beside it


def long_modules(source: str) -> list[str]:
    """Find a module with more than 400 lines."""
    lines = len(source.splitlines())
    return [f"1: {lines} lines, at most {MODULE_LINES}"] if lines > MODULE_LINES else []


def long_functions(source: str) -> list[str]:
    """Find functions over 60 lines, or over 80 where the reason stands beside them."""
    found = []
    lines = source.splitlines()
    for function in functions_of(source):
        first = min([function.lineno, *(decorator.lineno for decorator in function.decorator_list)])
        beside = [lines[function.lineno - 1], *lines[max(first - 2, 0) : first - 1]]
        reasoned = any(line.partition("# long:")[2].strip() for line in beside)
        limit = LONG_FUNCTION_LINES if reasoned else FUNCTION_LINES
        length = (function.end_lineno or function.lineno) - function.lineno + 1
        if length > limit:
            found.append(f"{function.lineno}: {function.name} has {length} lines, at most {limit}")
    return found


def unannotated(source: str) -> list[str]:
    """Find functions with a parameter or a return value that has no annotation."""
    found = []
    for function in functions_of(source):
        bare = [parameter.arg for parameter in parameters(function) if parameter.annotation is None]
        bare += ["return"] if function.returns is None else []
        if bare:
            found.append(f"{function.lineno}: {function.name} leaves {', '.join(bare)} without annotation")
    return found


def crowded_functions(source: str) -> list[str]:
    """Find functions with too many positional arguments and without "# many: <why>" beside them."""
    found = []
    lines = source.splitlines()
    for function in functions_of(source):
        own = [argument.arg for argument in (*function.args.posonlyargs, *function.args.args)]
        count = len(own) - (own[:1] in (["self"], ["cls"]))
        if count > MOST_ARGUMENTS and not lines[function.lineno - 2].partition("# many:")[2].strip():
            found.append(f"{function.lineno}: {function.name} has {count} arguments, at most {MOST_ARGUMENTS}")
    return found


@pytest.mark.parametrize(
    ("signature", "count"),
    [
        ("(a, b, c, d, e, f)", 0),
        ("(self, a, b, c, d, e, f)", 0),
        ("(a, b, c, d, e, f, *, g=1, h=2)", 0),
        ("(a, b, c, d, e, f, g)", 1),
        ("(a, b, c, d, e, f, /, g=1)", 1),
    ],
)
def test_a_long_list_of_arguments_is_found(signature: str, count: int) -> None:
    """Six are allowed, options by keyword do not count, a reason above the function excuses."""
    assert len(crowded_functions(f"\ndef f{signature}: ...")) == count
    assert crowded_functions(f"# many: torch calls it\ndef f{signature}: ...") == []


def body(lines: int) -> str:
    """Write a function of that many lines."""
    return "def f() -> None:\n" + "    x = 1\n" * (lines - 1)


@pytest.mark.parametrize(
    ("source", "count"),
    [
        (body(60), 0),
        (body(61), 1),
        ("# long: one table of cases\n" + body(80), 0),
        ("# long: one table of cases\n@cache\n" + body(80), 0),
        ("# long: one table of cases\n" + body(81), 1),
        ("# long:\n" + body(61), 1),
        ("class C:\n" + "".join(f"    {line}\n" for line in body(61).splitlines()), 1),
    ],
)
def test_a_long_function_is_found(source: str, count: int) -> None:
    """61 lines are too many, 80 need a reason, 81 have none."""
    assert len(long_functions(source)) == count


def test_a_long_module_is_found() -> None:
    """401 lines are too many."""
    assert long_modules("x = 1\n" * 400) == []
    assert len(long_modules("x = 1\n" * 401)) == 1


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("def f(a: int, *b: int, c: str = '', **d: int) -> None: ...", 0),
        ("class C:\n    def f(self) -> None: ...\n    @classmethod\n    def g(cls) -> None: ...", 0),
        ("def f(a) -> None: ...", 1),
        ("def f(a: int): ...", 1),
        ("def f(*, a=1) -> None: ...", 1),
        ("def f(*a) -> None: ...", 1),
        ("def f() -> None:\n    def g(): ...", 1),
    ],
)
def test_a_missing_annotation_is_found(source: str, count: int) -> None:
    """Parameters of every kind, returns, and nested functions count."""
    assert len(unannotated(source)) == count
