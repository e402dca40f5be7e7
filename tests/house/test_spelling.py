"""Names have American spelling, but for the words that keys of settings and files have had from the beginning."""

from __future__ import annotations

import ast
import re

BRITISH = re.compile(
    r"colour|centre|metre|grey|neighbour|labelled|modelled|licence|kerb|storey|harbour|artefact|honour|favour|catalogue"
    r"|behaviour|defence|(?:organ|normal|initial|optim|minim|maxim|recogn|synchron|vector)is(?:e|ing|ation)",
    re.IGNORECASE,
)
WHOLE_KEYS = re.compile("unlabelled|relabelled|recoloured")
KEYS = {"neighbour", "licence", "kerb", "storey", "harbour", "artefact"}


def british(source: str) -> list[str]:
    """Find the British names that a module defines: functions, classes, arguments, variables and fields."""
    found: list[tuple[int, str]] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            name = node.name
        elif isinstance(node, ast.arg):
            name = node.arg
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            name = node.id if isinstance(node, ast.Name) else node.attr
        else:
            continue
        words = {match.lower() for match in BRITISH.findall(WHOLE_KEYS.sub("", name))}
        if words - KEYS:
            found.append((node.lineno, name))
    return [f"{line}: {name} is British" for line, name in sorted(found)]


def test_the_check_finds_british_names() -> None:
    """Of everything that can be named; keys of files, and names made of them, are allowed."""
    source = (
        "def grey(colour, kerb): centre = 1\nclass Scope:\n    a_metre: float = 1\n    licence = 2\nx.labelled = 1\n"
    )
    lines = ["1: centre", "1: colour", "1: grey", "3: a_metre", "5: labelled"]
    assert british(source) == [f"{line} is British" for line in lines]
    assert british("unlabelled = recoloured = 1\nneighbours = kerb_height = 2\nnp.grey_opening(colour=1)\n") == []
