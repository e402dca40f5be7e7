"""A text is parsed once, and its statements are listed once, for all rules that read it one after the other."""

from __future__ import annotations

import ast
from functools import lru_cache

from tests.house.house import FUNCTIONS, Function


@lru_cache(maxsize=4)
def parsed(source: str) -> ast.Module:
    """Parse a text; no rule changes the tree."""
    return ast.parse(source)


@lru_cache(maxsize=4)
def statements(source: str) -> tuple[ast.AST, ...]:
    """List every statement of a text at any depth; functions, classes and imports stand nowhere else."""
    found: list[ast.AST] = []
    stack: list[ast.AST] = [parsed(source)]
    while stack:
        node = stack.pop()
        found.append(node)
        for field in ("cases", "handlers", "finalbody", "orelse", "body"):
            stack += reversed(getattr(node, field, ()))
    return tuple(found)


def functions_of(source: str) -> list[Function]:
    """List every function and method of a text, private and nested ones too."""
    return [node for node in statements(source) if isinstance(node, FUNCTIONS)]
