"""Everything public says what it is; arrays say their shape, physical quantities their unit."""

from __future__ import annotations

import ast
from functools import cache
from typing import NamedTuple

import pytest

from tests.house.docstrings import (
    UNIT,
    aliases_of,
    describes,
    holds_array,
    holds_float,
    parts_of,
    returned,
    shapes_in,
    states_unit,
    written_out,
)
from tests.house.house import (
    FUNCTIONS,
    Function,
    parameters,
    public_definitions,
)
from tests.house.trees import parsed

# What has no unit yet: users read these texts in the command line's help and in the pages of settings.
OPEN = frozenset(
    {"BridgeSettings.family", "ExperimentSettings.shares", "import_background(scale)", "mesh(density)"}
    | {"predict(scale)", "predict(min_confidence)", "set_(re_origin)"}
)


def undocumented(source: str) -> list[str]:
    """Find public modules, classes, functions and methods without a docstring; an empty module needs none."""
    tree = parsed(source)
    found = ["1: the module has no docstring"] if tree.body and not ast.get_docstring(tree) else []
    return found + [
        f"{node.lineno}: {node.name} has no docstring"
        for node in public_definitions(tree)
        if not ast.get_docstring(node) and not _is_overload(node)
    ]


def shapeless(source: str) -> list[str]:
    """Find public array arguments, return values and fields whose docstring does not state the shape of each array."""
    return [
        f"{each.line}: {each.name} is an array without a shape (…)" for each in quantities(source) if each.shapeless
    ]


def unitless(source: str) -> list[str]:
    """Find public arguments, return values and fields of floats whose docstring states no unit; [1] is one."""
    return [f"{each.line}: {each.name} has no unit such as [m]" for each in quantities(source) if each.unitless]


def unclear_quantities(source: str) -> list[str]:
    """Find public arguments, return values and fields whose docstring leaves out the shape or the unit."""
    return shapeless(source) + unitless(source)


class Quantity(NamedTuple):
    """An argument, a return value or a field, and what its docstring says of it.

    Attributes:
        line: Where its function or class stands.
        name: What it is called, such as `move(points)` or `move returns`.
        arrays: How many arrays it is made of.
        floats: Whether it is made of floats, so that it has a unit, or is dimensionless [1].
        text: What describes it.
    """

    line: int
    name: str
    arrays: int
    floats: bool
    text: str

    @property
    def shapeless(self) -> bool:
        """Tell whether the text leaves out the shape of an array."""
        return shapes_in(self.text) < self.arrays

    @property
    def unitless(self) -> bool:
        """Tell whether the text leaves out the unit of a float."""
        return self.floats and not states_unit(self.text)


@cache
def quantities(source: str) -> tuple[Quantity, ...]:
    """List the arrays and physical quantities among the public arguments, return values and fields."""
    tree = parsed(source)
    aliases = aliases_of(tree)
    found: list[Quantity] = []
    for node in public_definitions(tree):
        found += _in_class(node, aliases) if isinstance(node, ast.ClassDef) else _in_function(node, aliases)
    return tuple(each for each in found if each.arrays or each.floats)


def _in_function(function: Function, aliases: dict[str, str]) -> list[Quantity]:
    """List the arguments and the return value of a function."""
    doc = ast.get_docstring(function) or ""
    found = []
    for parameter in parameters(function):
        if parameter.annotation is not None:
            text = describes(doc, "Args", parameter.arg)
            name = f"{function.name}({parameter.arg})"
            found.append(_quantity(function.lineno, name, parameter.annotation, aliases, text))
    if function.returns is not None and not _is_overload(function):
        found.append(_quantity(function.lineno, f"{function.name} returns", function.returns, aliases, returned(doc)))
    return found


def _in_class(node: ast.ClassDef, aliases: dict[str, str]) -> list[Quantity]:
    """List the annotated fields of a class; Attributes, the string below, or Field(description) describe them."""
    doc = ast.get_docstring(node) or ""
    found = []
    for field, below in zip(node.body, [*node.body[1:], None], strict=True):
        if not isinstance(field, ast.AnnAssign) or not isinstance(field.target, ast.Name) or field.target.id[0] == "_":
            continue
        text = describes(doc, "Attributes", field.target.id)
        for part in (field.value, below.value if isinstance(below, ast.Expr) else None):
            strings = [leaf for leaf in ast.walk(part) if isinstance(leaf, ast.Constant)] if part else []
            text += " ".join(leaf.value for leaf in strings if isinstance(leaf.value, str))
        found.append(_quantity(field.lineno, f"{node.name}.{field.target.id}", field.annotation, aliases, text))
    return found


def _quantity(line: int, what: str, annotation: ast.expr, aliases: dict[str, str], text: str) -> Quantity:
    """Judge an argument, a field or a return value by its type, the parts of a tuple one by one."""
    parts = parts_of(written_out(annotation, aliases))
    return Quantity(line, what, sum(map(holds_array, parts)), any(holds_float(part, text) for part in parts), text)


def _is_overload(node: ast.AST) -> bool:
    """Tell whether a function is a typing overload, whose docstring stands at the implementation."""
    return isinstance(node, FUNCTIONS) and any("overload" in ast.unparse(d) for d in node.decorator_list)


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
    return f'F64 = NDArray[np.float64]\nI64 = NDArray[np.int64]\ndef f{signature}:\n    """{lines}\n    """'


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
        (function("(a: tuple[F64, F64]) -> None", "Args:", "    a: Positions and normals [m], shape (N, 3)."), 1),
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


@pytest.mark.parametrize("name", ["pitch", "rise", "sag", "area", "force", "level", "sigma", "near", "far", "anything"])
@pytest.mark.parametrize(("text", "count"), [("As far as it goes.", 1), ("As far as it goes [1].", 0)])
def test_every_float_needs_a_unit_whatever_its_name(name: str, text: str, count: int) -> None:
    """No list of names decides which numbers are physical; one without a dimension says [1]."""
    assert len(unclear_quantities(function(f"({name}: float) -> None", "Args:", f"    {name}: {text}"))) == count


@pytest.mark.parametrize(
    ("signature", "text", "count"),
    [
        ("-> float", "The result.", 1),
        ("-> float | None", "The result.", 1),
        ("-> tuple[float, ...]", "The results.", 1),
        ("-> str | dict[str, float]", "The results.", 1),
        ("-> I64 | F64", "The results, shape (N,).", 1),
        ("-> dict[str, F64]", "The results, shape (N,).", 1),
        ("-> int", "The result.", 0),
        ("-> NDArray[np.bool_]", "Which, shape (N,).", 0),
        ("-> tuple[F64, F64]", "Positions [m], shape (N, 3), and normals.", 1),
        ("-> tuple[F64, F64]", "Positions [m] and normals, shape (N, 3), for each point.", 1),
        ("-> tuple[F64, F64]", "Positions [m], shape (N, 3), and distances, shape (N,).", 0),
        ("-> tuple[F64, F64]", "Positions [m] and normals, shape (N, 3) each.", 0),
        ("-> tuple[F64, F64]", "Positions [m] and normals, each of shape (N, 3).", 0),
        ("-> tuple[F64, F64]", "Positions [m] and distances, shapes (N, 3) and (N,).", 0),
        ("-> tuple[F64, F64, F64]", "Positions [m] and distances, shapes (N, 3) and (N,).", 1),
        ("-> tuple[F64, F64] | None", "Positions [m], shape (N, 3), and normals.", 1),
        ("-> Iterator[tuple[F64, F64]]", "Positions [m], shape (N, 3), and normals.", 1),
        ("-> tuple[Callable[[], int], F64]", "A function, and positions, shape (N, 3).", 1),
        ("-> np.ndarray", "Positions, shape (N, 3), float32.", 1),
        ("-> np.ndarray", "Rows, shape (N,), int64.", 0),
        ("-> dict[str, Tensor]", "Arrays by name.", 1),
        ("-> tuple[F64, int]", "Positions [m], shape (N, 3), and a count.", 0),
    ],
)
def test_an_unclear_return_value_is_found(signature: str, text: str, count: int) -> None:
    """Each array of a tuple has its shape; floats have a unit."""
    assert len(unclear_quantities(function(f"() {signature}", "Returns:", f"    {text}"))) == count


@pytest.mark.parametrize(
    "text",
    ["no particular shape [1]", "any shape", "the same shape", "shape (any)", "shape of an egg", "shapes", "(N, 3)"],
)
def test_words_are_no_shape(text: str) -> None:
    """A shape has sizes in parentheses, with commas between them."""
    assert not shapes_in(text)


@pytest.mark.parametrize(
    "text", ["(N, 3)", "(N,)", "(..., 3)", "(...)", "(…, C, C)", "()", "(2 * (N - 1), 3)", "(4 * len(sides), 4, 3)"]
)
def test_shapes_are_recognized(text: str) -> None:
    """The ways to write sizes that are in use count, over a line break, too."""
    assert shapes_in(f"Values, shape\n    {text}, float64.") == 1


def test_a_summary_does_not_serve_for_arguments() -> None:
    """A function without `Args:` leaves the shape and the unit of each argument out, whatever its first line says."""
    doc = '"""Add two things [m], shape (N,), float64."""'
    lines = unclear_quantities(f"F64 = NDArray[np.float64]\ndef f(a: F64, b: F64) -> F64:\n    {doc}")
    assert len(lines) == 4
    assert not any("returns" in line for line in lines)


@pytest.mark.parametrize(
    ("above", "name", "count"),
    [
        ("from authoring.looks.noise import Floats", "Floats", 2),
        ("from authoring.looks.noise import Floats as Field", "Field", 2),
        ("from learn.neighborhoods.pyramids import Indices", "Indices", 1),
        ("if TYPE_CHECKING:\n    from authoring.looks.noise import Floats", "Floats", 2),
        ("F = NDArray[np.float64]\nPair = tuple[F, F]", "Pair", 2),
        ("F: TypeAlias = NDArray[np.float64]", "F", 2),
        ("from authoring.looks.noise import Floats", "'Floats | None'", 2),
        ("from authoring.looks.noise import Tile", "Tile", 0),
    ],
)
def test_aliases_are_arrays(above: str, name: str, count: int) -> None:
    """Names of array types are followed through the house's modules: such an argument needs a shape and a unit."""
    doc = '"""Do it.\n\n    Args:\n        a: Something.\n    """'
    assert len(unclear_quantities(f"{above}\ndef f(a: {name}) -> None:\n    {doc}")) == count


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
