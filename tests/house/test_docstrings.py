"""Everything public says what it is; arrays say their shape, physical quantities their unit."""

from __future__ import annotations

import ast

import pytest

from tests.house.docstrings import UNIT, array_aliases, describes, is_array, is_physical, sections
from tests.house.house import (
    FUNCTIONS,
    ROOMS,
    Function,
    Rule,
    assert_clean,
    parameters,
    public_definitions,
    python_files,
)


def undocumented(source: str) -> list[str]:
    """Find public modules, classes, functions and methods without a docstring; an empty module needs none."""
    tree = ast.parse(source)
    found = ["1: the module has no docstring"] if tree.body and not ast.get_docstring(tree) else []
    return found + [
        f"{node.lineno}: {node.name} has no docstring"
        for node in public_definitions(tree)
        if not ast.get_docstring(node) and not _is_overload(node)
    ]


def unclear_quantities(source: str) -> list[str]:
    """Find public arguments, return values and fields whose docstring leaves out the shape or the unit."""
    tree = ast.parse(source)
    aliases = array_aliases(tree)
    found: list[str] = []
    for node in public_definitions(tree):
        found += _in_class(node, aliases) if isinstance(node, ast.ClassDef) else _in_function(node, aliases)
    return found


def _in_function(function: Function, aliases: set[str]) -> list[str]:
    """Check the arguments and the return value of a function."""
    doc = ast.get_docstring(function) or ""
    found = []
    for parameter in parameters(function):
        name = f"{function.name}({parameter.arg})"
        text = describes(doc, "Args", parameter.arg)
        found += _unclear(function.lineno, name, text, parameter.arg, parameter.annotation, aliases)
    parts = sections(doc)
    if is_array(function.returns, aliases) and "shape" not in parts.get("Returns", parts.get("Yields", parts[""])):
        found.append(f"{function.lineno}: {function.name} returns an array without a shape")
    return found


def _in_class(node: ast.ClassDef, aliases: set[str]) -> list[str]:
    """Check the annotated fields of a class: by Attributes, the string below, or Field(description)."""
    doc = ast.get_docstring(node) or ""
    found = []
    for field, below in zip(node.body, [*node.body[1:], None], strict=True):
        if not isinstance(field, ast.AnnAssign) or not isinstance(field.target, ast.Name) or field.target.id[0] == "_":
            continue
        name = field.target.id
        text = describes(doc, "Attributes", name) if "Attributes" in sections(doc) else ""
        for part in (field.value, below.value if isinstance(below, ast.Expr) else None):
            strings = [leaf for leaf in ast.walk(part) if isinstance(leaf, ast.Constant)] if part else []
            text += " ".join(leaf.value for leaf in strings if isinstance(leaf.value, str))
        found += _unclear(field.lineno, f"{node.name}.{name}", text, name, field.annotation, aliases)
    return found


def _unclear(line: int, what: str, text: str, name: str, annotation: ast.expr | None, aliases: set[str]) -> list[str]:
    """Say what a description leaves out."""
    found = []
    if is_array(annotation, aliases) and "shape" not in text:
        found.append(f"{line}: {what} is an array without a shape")
    if is_physical(name, annotation, aliases) and not UNIT.search(text):
        found.append(f"{line}: {what} is a physical quantity without a unit such as [m]")
    return found


def _is_overload(node: ast.AST) -> bool:
    """Tell whether a function is a typing overload, whose docstring stands at the implementation."""
    return isinstance(node, FUNCTIONS) and any("overload" in ast.unparse(d) for d in node.decorator_list)


@pytest.mark.parametrize("rule", [undocumented, unclear_quantities])
def test_the_house_is_documented(rule: Rule) -> None:
    """No room breaks the rule."""
    assert_clean(rule, python_files(*ROOMS))


def test_tests_are_documented() -> None:
    """Tests, benchmarks and set-up scripts say what they do."""
    assert_clean(undocumented, python_files("tests", "benchmarks", "docs", "bootstrap"))


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("", 0),
        ("x = 1", 1),
        ('"""M."""\ndef f() -> None: ...', 1),
        ('"""M."""\nclass C:\n    """C."""\n    def f(self) -> None: ...', 1),
        ('"""M."""\nif True:\n    def f() -> None: ...', 1),
        (
            '"""M."""\nclass C:\n    """C."""\n    def __eq__(self, o: C) -> bool: ...\n    def _f(self): ...',
            0,
        ),
    ],
)
def test_a_missing_docstring_is_found(source: str, count: int) -> None:
    """Modules, functions and methods count; private and magic ones do not."""
    assert len(undocumented(source)) == count


def function(signature: str, *doc: str) -> str:
    """Write a documented function."""
    lines = "".join(f"\n    {line}" for line in ("Do it.", *doc))
    return f'F64 = NDArray[np.float64]\ndef f{signature}:\n    """{lines}\n    """'


@pytest.mark.parametrize(
    ("source", "count"),
    [
        (function("(points: F64) -> None", "Args:", "    points: Positions [m], shape (N, 3)."), 0),
        (function("(points: F64) -> None", "Args:", "    points: Positions [m],", "        shape (N, 3)."), 0),
        (function("(points: F64) -> None", "Args:", "    points: Positions [m]."), 1),
        (function("(points: F64) -> None"), 2),
        (function("(depth_points: F64) -> None", "Args:", "    depth_points: Positions, shape (N, 3)."), 1),
        (function("(poses: list[F64]) -> None", "Args:", "    poses: camera_to_world, shape (4, 4) each."), 1),
        (function("(points: NDArray[np.int64]) -> None", "Args:", "    points: Rows, shape (N,)."), 0),
        (function("(a: F64, b: F64) -> None", "Args:", "    a, b: Ends [m], shape (3,)."), 0),
        (function("(a: F64, b: F64) -> None", "Args:", "    a: An end [m], shape (3,).", "    b: Another [m]."), 1),
        (function("(points: np.ndarray | None) -> None", "Args:", "    points: Positions [m]."), 1),
        (function("() -> F64", "Returns:", "    Positions [m]."), 1),
        (function("() -> F64", "Returns:", "    Positions [m], shape (N, 3)."), 0),
        (function("(pier_height: float) -> None", "Args:", "    pier_height: From the ground up."), 1),
        (function("(pier_height: float) -> None", "Args:", "    pier_height: From the ground up [m]."), 0),
        (function("(pier_height: float) -> None", "Args:", "    pier_height: From 0 to 1, one of [a, b]."), 1),
        (function("(span: int) -> None", "Args:", "    span: Number of the span."), 0),
        (function("(height: str) -> None", "Args:", "    height: Its name."), 0),
        (function("(length: Callable[[float], float]) -> None", "Args:", "    length: A function."), 0),
    ],
)
def test_an_unclear_argument_is_found(source: str, count: int) -> None:
    """An array without a shape and a length without a unit are findings; aliases of arrays are arrays."""
    assert len(unclear_quantities(source)) == count


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ('class C:\n    """C.\n\n    Attributes:\n        x: A point [m].\n    """\n    x: np.ndarray', 1),
        ('class C:\n    """C.\n\n    Attributes:\n        x: A point [m], shape (3,).\n    """\n    x: np.ndarray', 0),
        ('class C:\n    """C."""\n    x: np.ndarray\n    """A point [m], shape (3,)."""', 0),
        ('class C:\n    """C."""\n    width: float = Field(2.0, ge=0, description="Between parapets.")', 1),
        ('class C:\n    """C."""\n    width: float = Field(2.0, ge=0, description="Between parapets [m].")', 0),
        ('class C:\n    """C."""\n    width: float = 2.0', 1),
    ],
)
def test_an_unclear_field_is_found(source: str, count: int) -> None:
    """Fields of records and settings are held to the same rule."""
    assert len(unclear_quantities(source)) == count


@pytest.mark.parametrize(
    "unit", ["[m]", "[m/s]", "[1/m]", "[1]", "[0.1 stage units]", "[px]", "[m²]", "[m³/s]", "[deg]", "[%]"]
)
def test_units_are_recognized(unit: str) -> None:
    """The units in use count as units."""
    assert UNIT.search(f"A value {unit}.")


@pytest.mark.parametrize("text", ["[0, 1]", "[i]", "[path]", "m", "[]", "[mode]"])
def test_other_brackets_are_no_units(text: str) -> None:
    """Ranges, indices and words in brackets are no units."""
    assert not UNIT.search(text)
