"""Reading Google-style docstrings: which entry describes which argument, attribute or return value."""

from __future__ import annotations

import ast
import re

from tests.house.house import ROOMS, ROOT

SECTION = re.compile(r"^\s*(Args|Attributes|Returns|Yields|Raises|Source|Example|Examples|Note):")
ENTRY = re.compile(r"^(\s+)\*{0,2}([A-Za-z_][\w, *]*?)(?: \([^)]*\))?:(?:\s|$)")
ARRAY = re.compile(r"\b(ndarray|NDArray|ArrayLike|\w*Array|Tensor)\b")
# [m], [px], [m/s], [m²], [1/m], [0.1 stage units], [1]: a bracket that begins with a unit, after a number or not.
_WORDS = "electrons?|codes?|cells?|tiles?|texels?|time codes"
UNIT = re.compile(
    r"\[(?:[\d.]+ )?(?:(?:1/)?"
    rf"(?:mm|cm|km|m|px|points?/|rad|deg|°|sr|ms|min|s|h|kg|k?N|k?lx|lm|k?cd|W|EV|K|B|bytes|[kMG]i?B|{_WORDS})"
    r"(?![A-Za-z])[^\]]*|(?:1/|1 / )?(?:stage|model|scan|any) units?[²³]?|1|%|of 255)\]"
)
# (N, 3), (N,), (..., 3), (2 * (N - 1), 3), (...), (): sizes with commas between them, as numpy writes a shape.
_SIZE = r"(?:[^(),]|\([^()]*\))+"
SIZES = rf"\((?:\.\.\.|…|{_SIZE},(?:{_SIZE},)*(?:{_SIZE})?)?\)"
SHAPE = re.compile(rf"\b[Ss]hapes? {SIZES}(?:(?:,| and|, and| or) {SIZES})*")
# "each of shape (3,)", "shape (3,) each", "shapes (3,)": said of every array there.
OF_ALL = re.compile(
    rf"\beach (?:of |with )?shape {SIZES}|\bshape {SIZES}(?:,? u?(?:float|int)\d+)?,? each\b"
    rf"|\bshapes {SIZES}(?!(?:,| and|, and) \()"
)
MEASURED = re.compile(r"\b(float|np\.float\d*|np\.floating)\b")  # an int is a count, an index or pixels


# An array that does not say of what: of floats, unless its text says so.
BARE = re.compile(r"\bndarray\b(?!\[)")
COUNTS = re.compile(r"\b(u?int\d+|bool)\b")


def sections(doc: str) -> dict[str, str]:
    """Split a docstring at its section headings; the text before the first one is under the empty name."""
    found: dict[str, list[str]] = {"": []}
    current = ""
    for line in doc.splitlines():
        if heading := SECTION.match(line):
            current = heading.group(1)
        found.setdefault(current, []).append(line)
    return {name: "\n".join(lines) for name, lines in found.items()}


def entries(section: str) -> dict[str, str]:
    """Split a section into its entries; "a, b: text" describes both names."""
    found: dict[str, str] = {}
    names: list[str] = []
    indent = 0
    for line in section.splitlines()[1:]:
        entry = ENTRY.match(line)
        if entry and (not names or len(entry.group(1)) <= indent):
            indent = len(entry.group(1))
            names = [name.strip(" *") for name in entry.group(2).split(",")]
        for name in names:
            found[name] = f"{found.get(name, '')}\n{line}"
    return found


def describes(doc: str, section: str, name: str) -> str:
    """Give the text of a name's own entry; no text above the sections serves in its place."""
    return entries(sections(doc).get(section, "")).get(name, "")


def returned(doc: str) -> str:
    """Give the text that describes a return value: its section, or the text above all sections where it has none."""
    parts = sections(doc)
    return parts.get("Returns", parts.get("Yields", parts[""]))


def aliases_of(tree: ast.Module) -> dict[str, str]:
    """Name the array types that a module calls by names of its own or by another's, such as F64, written out."""
    found: dict[str, str] = {}
    for node in _top(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in ROOMS:
            theirs = _aliases_in(node.module)
            found |= {each.asname or each.name: theirs[each.name] for each in node.names if each.name in theirs}
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            text = written_out(node.value, found)
            if isinstance(node.value, ast.Subscript | ast.BinOp | ast.Name | ast.Attribute) and ARRAY.search(text):
                found |= {target.id: text for target in targets if isinstance(target, ast.Name)}
    return found


def _top(tree: ast.Module) -> list[ast.stmt]:
    """List a module's statements, those below `if TYPE_CHECKING` among them."""
    return [each for node in tree.body for each in ([*node.body, *node.orelse] if isinstance(node, ast.If) else [node])]


_READ: dict[str, dict[str, str]] = {}


def _aliases_in(module: str) -> dict[str, str]:
    """Give the aliases of a module of the house; a package's are those of its `__init__.py`."""
    path = ROOT.joinpath(*module.split("."))
    if module not in _READ:
        _READ[module] = {}  # what imports itself in a circle ends here
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file():
                _READ[module] = aliases_of(ast.parse(file.read_text(encoding="utf-8")))
    return _READ[module]


def written_out(annotation: ast.expr, aliases: dict[str, str]) -> str:
    """Write an annotation with every alias replaced by what it stands for."""
    text = ast.unparse(annotation).replace("'", "")
    return re.sub(r"(?<![.\w])[A-Za-z_]\w*", lambda name: aliases.get(name.group(), name.group()), text)


def parts_of(text: str) -> list[str]:
    """List what a written-out return type gives one by one: the parts of a tuple, else the type itself."""
    try:
        node: ast.expr = ast.parse(text, mode="eval").body
    except SyntaxError:
        return [text]
    return [ast.unparse(part) for part in _parts(node)]


def _parts(node: ast.expr) -> list[ast.expr]:
    """Take a type apart: `A | None` is A, an iterator of tuples is its tuple."""
    if isinstance(node, ast.BinOp):
        return max(_parts(node.left), _parts(node.right), key=_weight)
    if isinstance(node, ast.Subscript):
        name = ast.unparse(node.value)
        if name == "tuple" and isinstance(node.slice, ast.Tuple):
            inner = [part for part in node.slice.elts if not isinstance(part, ast.Constant)]
            return [leaf for part in inner for leaf in _parts(part)]
        if name in ("Iterator", "Iterable", "Generator", "list", "Sequence"):
            first = node.slice.elts[0] if isinstance(node.slice, ast.Tuple) else node.slice
            return _parts(first)
    return [node]


def _weight(parts: list[ast.expr]) -> tuple[int, int, int]:
    """Count the arrays, the floats and all parts of a type: of alternatives, the one that asks for more counts."""
    texts = [ast.unparse(part) for part in parts]
    return sum(map(holds_array, texts)), sum(map(holds_float, texts)), len(texts)


def holds_array(text: str) -> bool:
    """Tell whether a written-out type speaks of arrays, lists and mappings of arrays included, callables left out."""
    return "Callable" not in text and bool(ARRAY.search(text))


def holds_float(text: str, doc: str = "") -> bool:
    """Tell whether a written-out type speaks of floats: one, an array of them, or a list or mapping of them."""
    bare = bool(BARE.search(text)) and not COUNTS.search(doc)
    return "Callable" not in text and (bare or bool(MEASURED.search(text)))


def states_unit(text: str) -> bool:
    """Tell whether a text states a unit, such as [m] or [1]."""
    return bool(UNIT.search(" ".join(text.split())))


def shapes_in(text: str) -> int:
    """Count the shapes that a text states, such as `shape (N, 3)`; one that is said of each counts as many."""
    text = " ".join(text.split())
    if OF_ALL.search(text):
        return 99
    return sum(len(re.findall(SIZES, found.group())) for found in SHAPE.finditer(text))
