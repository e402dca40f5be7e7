"""Reading Google-style docstrings: which entry describes which argument, attribute or return value."""

from __future__ import annotations

import ast
import re

SECTION = re.compile(r"^\s*(Args|Attributes|Returns|Yields|Raises|Source|Example|Examples|Note):")
ENTRY = re.compile(r"^(\s+)\*{0,2}([A-Za-z_][\w, *]*?)(?: \([^)]*\))?:(?:\s|$)")
ARRAY = re.compile(r"\b(ndarray|NDArray|ArrayLike|\w*Array|[FIU](8|16|32|64))\b")
# [m], [px], [m/s], [m²], [1/m], [0.1 stage units], [1]: a bracket that begins with a unit, after a number or not.
UNIT = re.compile(
    r"\[(?:[\d.]+ )?(?:(?:1/)?"
    r"(?:mm|cm|km|m|px|rad|deg|ms|min|s|h|kg|N|lx|lm|W|EV|K|B|bytes|[kMG]i?B)(?![A-Za-z])[^\]]*"
    r"|1|%|(?:stage|model|scan|any) units?)\]"
)
# The last word of a name that is a length, an angle or a time wherever it stands.
PHYSICAL = frozenset(
    {"length", "width", "height", "depth", "thickness", "radius", "diameter", "distance", "spacing", "gap", "clearance"}
    | {"elevation", "altitude", "offset", "overhang", "span", "spans", "chainage", "station"}
    | {"angle", "heading", "yaw", "roll", "skew", "azimuth", "fov", "time", "duration", "seconds", "speed"}
)
# Arrays of these names hold lengths, whatever the word before them: a unit belongs to each.
PLACES = frozenset(
    {"points", "point", "positions", "position", "poses", "pose", "centers", "center", "centres", "vertices"}
    | {"coord", "coords", "origin", "origins", "translation", "translations", "bounds", "box", "boxes", "extent"}
    | {"depths", "distances", "heights", "widths", "lengths", "radii", "elevations", "angles", "offsets", "stations"}
    | {"intrinsics", "uncertainty", "displacement", "residuals"}
)
COUNTED = re.compile(r"\b(I64|I32|U8|U16|U32|U64|Bool|np\.u?int\d*|np\.bool_?)\b|moderngl")
MEASURED = re.compile(r"\bfloat\b")  # an int is a count, an index or pixels


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
    """Give the text that describes one name: its entry, or the text above all sections where that section is absent."""
    parts = sections(doc)
    if section not in parts:
        return parts[""]
    return entries(parts[section]).get(name, "")


def array_aliases(tree: ast.Module) -> set[str]:
    """Name the module's own aliases of array types, such as F64 = NDArray[np.float64]."""
    found: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.Assign) and ARRAY.search(ast.unparse(node.value).split("(")[0]):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return found


def is_array(annotation: ast.expr | None, aliases: set[str]) -> bool:
    """Tell whether an annotation speaks of arrays, lists and mappings of arrays included, callables left out."""
    if annotation is None:
        return False
    text = ast.unparse(annotation).strip("'\"")
    if "Callable" in text:
        return False
    return bool(ARRAY.search(text)) or any(re.search(rf"\b{alias}\b", text) for alias in aliases)


def is_physical(name: str, annotation: ast.expr | None, aliases: set[str]) -> bool:
    """Tell whether a name and its annotation speak of a number with a unit."""
    if annotation is None:
        return False
    last = name.split("_")[-1]
    if last in PLACES and is_array(annotation, aliases):
        return not COUNTED.search(ast.unparse(annotation))  # rows and flags have names such as `obs_point`, too
    if last not in PHYSICAL:
        return False
    text = ast.unparse(annotation)
    return (bool(MEASURED.search(text)) and "Callable" not in text) or is_array(annotation, aliases)
