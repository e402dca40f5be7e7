"""Names and texts are American, but for the words that keys of settings and files have had from the beginning."""

from __future__ import annotations

import ast
import re
import tokenize
from io import StringIO
from pathlib import Path

import pytest

from tests.house.house import ROOT

BRITISH = re.compile(
    r"colour|centre|metre|grey|neighbour|labelled|modelled|licence|kerb|storey|harbour|artefact|honour|favour|catalogue"
    r"|behaviour|defence|(?:organ|normal|initial|optim|minim|maxim|recogn|synchron|vector)is(?:e|ing|ation)",
    re.IGNORECASE,
)
WHOLE_KEYS = re.compile("unlabelled|relabelled|recoloured")
KEYS = {"neighbour", "licence", "kerb", "storey", "harbour", "artefact"}
IN_TEXTS = re.compile(
    BRITISH.pattern + r"|vapour|vigour|labour\b|mould|fibre|analyse|judgement|aluminium"
    r"|(?:label|model|travel|cancel|signal|level|channel)l(?:ed|ing|er)\b"
    r"|(?:parametr|character|general|special|summar|quant|random|regular|categor|visual|real|util|stabil|standard"
    r"|serial|capital)is(?:e[drs]?|ing|ation)\b",
    re.IGNORECASE,
)
# What a text quotes: code, names with an underscore, and words of files and of other programs' formats.
QUOTED = re.compile(r"`[^`]*`|\w*_\w*|centres\+rotations|UNIT\[\"metre\"|" + WHOLE_KEYS.pattern)
# Whole literals: values of settings and keys of files, names on stages and of photographs' files, and of shaders.
LITERALS = {"labelled", "modelled", "centres", "neighbours", "grey", "colour"}
PAGES = sorted(
    path
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))
    if path.name.lower() != "changelog.md" and not {"benchmarks", "_build"} & set(path.relative_to(ROOT).parts)
)


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


def british_texts(source: str) -> list[str]:
    """Find the British words in a module's docstrings, comments and other texts."""
    texts = [(node.lineno, node.value) for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant)]
    texts += [
        (token.start[0], token.string)
        for token in tokenize.generate_tokens(StringIO(source).readline)
        if token.type == tokenize.COMMENT
    ]
    words = [(line, word) for line, text in texts if text not in LITERALS for word in british_words(text)]
    return [f"{line}: {word} is British" for line, word in sorted(words)]


def british_words(text: object) -> list[str]:
    """Find the British words of a text, outside of what it quotes."""
    if not isinstance(text, str):
        return []
    found = IN_TEXTS.findall(QUOTED.sub("", text))
    return sorted({word.lower() for word in found} - (KEYS - {"neighbour"}))


def test_the_check_finds_british_texts() -> None:
    """In docstrings, comments, messages and their formatted parts; not in what they quote, nor in keys."""
    source = '''"""The grey kerb."""  # no colour
x = f"the centre {y['modelled']} of {z['unlabelled']}, unlabelled"
raise ValueError("not labelled " "as `colour` of paint_colours, centres+rotations")
x = ("labelled", "centres", "travelled", "neighbours", "kerb")  # of many neighbours
'''
    assert british_texts(source) == [
        f"{line} is British"
        for line in ("1: colour", "1: grey", "2: centre", "3: labelled", "4: neighbour", "4: travelled")
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_are_american(page: Path) -> None:
    """Those that people write and those that are made from texts of the code; not code, and not what runs measured."""
    text = re.sub(r"^(```.*?^```|    [^\n]*)$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert british_words(text) == []


def test_the_check_finds_british_names() -> None:
    """Of everything that can be named; keys of files, and names made of them, are allowed."""
    source = (
        "def grey(colour, kerb): centre = 1\nclass Scope:\n    a_metre: float = 1\n    licence = 2\nx.labelled = 1\n"
    )
    lines = ["1: centre", "1: colour", "1: grey", "3: a_metre", "5: labelled"]
    assert british(source) == [f"{line} is British" for line in lines]
    assert british("unlabelled = recoloured = 1\nneighbours = kerb_height = 2\nnp.grey_opening(colour=1)\n") == []
