"""The examples below the help of each verb."""

from __future__ import annotations

import functools
import shlex

import pytest
import tyro

from falsework.cli import all_verbs, main
from falsework.commands.examples import EXAMPLES, examples_for
from falsework.commands.parsing import CONFIG


def test_every_verb_has_an_example() -> None:
    """No verb lacks one, and no example is of a verb that is not there."""
    assert sorted(EXAMPLES) == sorted(all_verbs())


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_the_parser_takes_each_example(name: str) -> None:
    """Each begins with its verb, and its further words are such as the verb takes."""
    verb = all_verbs()[name]

    @functools.wraps(verb)
    def taken(*_: object, **__: object) -> int:
        return 0

    for line in EXAMPLES[name]:
        program, *words = shlex.split(line)
        assert program == "falsework"
        assert " ".join(words[: len(name.split())]) == name
        rest = words[len(name.split()) :]
        assert tyro.cli(taken, args=rest, config=CONFIG) == 0
        with pytest.raises(SystemExit):
            tyro.cli(taken, args=[*rest, "--nobodys"], config=CONFIG)


@pytest.mark.parametrize(
    ("words", "shown"), [(["predict", "--help"], 1), (["scene", "set", "-h"], 2), (["scene", "-h"], 0)]
)
def test_help_ends_with_the_examples(words: list[str], shown: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Below the help of a verb, not of a group; the exit code stays 0."""
    with pytest.raises(SystemExit) as left:
        main(words)
    assert not left.value.code
    lines = capsys.readouterr().out.rstrip().splitlines()
    assert len(examples_for(words)) == shown
    if shown:
        assert [line.strip() for line in lines[-shown:]] == list(examples_for(words))
        assert lines[-shown - 1] == f"Example{'s'[: shown - 1]}:"
    else:
        assert not any(line.startswith("Example") for line in lines)
