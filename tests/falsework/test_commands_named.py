"""Every command that a message, a docstring or the reference names is one, with options that it has."""

from __future__ import annotations

import ast
import contextlib
import io
import re
from collections.abc import Iterator
from functools import cache

import pytest

from docs.command_page import commands_page
from falsework.cli import GROUPS, all_verbs
from falsework.commands.parsing import parse
from tests.house.house import ROOMS, assert_clean, python_files

NAMED = re.compile(r"(?<![\w./'\"-])falsework ((?:[a-z][a-z-]*)(?: [a-z][a-z-]*)?)([^.;:\n]*)")
OPTION = re.compile(r"(?<![\w-])--([a-z][a-z-]*)")
PROSE = {"is", "has", "and", "or", "for"}  # what follows the name of the project in a sentence


@cache
def options(name: str) -> frozenset[str]:
    """Name the options that the parser of a verb takes."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
        parse(all_verbs()[name], f"falsework {name}", ["--help"])
    lines = re.findall(r"^[│ ] {1,3}(-.*)", printed.getvalue(), re.M)
    spelled = " ".join(line.partition("  ")[0] for line in lines)
    return frozenset(re.findall(r"(?<![\w-])--[a-z][a-z-]*", spelled))


def wrong_commands(text: str) -> Iterator[str]:
    """Name the commands in a text that the command line does not have."""
    verbs = all_verbs()
    for words, rest in NAMED.findall(text):
        head, _, second = words.partition(" ")
        name = f"{head} {second}" if head in GROUPS and second else head
        if head in GROUPS and (not second or second in PROSE):
            continue
        if name not in verbs:
            if head not in PROSE:
                yield f"falsework {name}"
            continue
        known = options(name) | {"--help", "--version"}
        yield from (f"falsework {name} --{option}" for option in OPTION.findall(rest) if f"--{option}" not in known)


def wrong_strings(source: str) -> list[str]:
    """Name the wrong commands in the string constants of a module."""
    found = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant)]
    texts = [(node.lineno, node.value) for node in found if isinstance(node.value, str)]
    return [f"{line}: no command {wrong!r}" for line, text in texts for wrong in wrong_commands(text)]


@pytest.mark.parametrize("room", ROOMS)
def test_the_commands_in_messages_exist(room: str) -> None:
    """A hint that names a verb or an option that was renamed would send its reader astray."""
    assert_clean(wrong_strings, python_files(room))


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("ids: falsework scene info --tree", ["falsework scene info --tree"]),
        ("Run falsework scene inspect first", ["falsework scene inspect"]),
        ("falsework rum OUT", ["falsework rum"]),
        ("falsework scene info SCENE --members lists them", []),
        ("See falsework scene --help; falsework run --retry-failed", []),
    ],
)
def test_a_wrong_command_is_found(text: str, wrong: list[str]) -> None:
    """What is looked for is found, and nothing else."""
    assert list(wrong_commands(text)) == wrong


def test_the_reference_lists_the_options_of_the_parser() -> None:
    """Each verb has its options on the page, positional arguments in capitals without dashes."""
    page = commands_page()
    for name in all_verbs():
        section = page.partition(f"### `falsework {name}`\n")[2].partition("\n### ")[0]
        rows = re.findall(r"^\| `([^`]+)` \|", section, re.M)
        shown = {word for row in rows for word in re.findall(r"--[a-z-]+", row)}
        assert shown == options(name) - {"--help"}, name
