"""Scripts for the completion of verbs, options and their values in a shell."""

import contextlib
import functools
import io
import operator
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import tyro

from falsework.commands.parsing import CONFIG

PROGRAM = "falsework"


def completion_script(verbs: Mapping[str, Callable[..., int]], shell: str) -> str:
    """Return the script for one shell.

    Args:
        verbs: Every verb, those of groups under two words, and its function.
        shell: bash, zsh or fish.
    """
    heads = dict.fromkeys(name.split()[0] for name in verbs)
    chosen = {head: verbs[head] if head in verbs else _group(head, verbs) for head in heads}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
        tyro.extras.subcommand_cli_from_dict(
            chosen,
            prog=PROGRAM,
            args=["--tyro-print-completion", shell],
            config=(*CONFIG, tyro.conf.OmitSubcommandPrefixes),
        )
    return printed.getvalue()


def _group(head: str, verbs: Mapping[str, Callable[..., int]]) -> Callable[..., int]:
    """Make a verb whose only argument is the name of a verb in its group."""
    inner = {name.partition(" ")[2]: verb for name, verb in verbs.items() if name.startswith(f"{head} ")}
    choices = [Annotated[Any, tyro.conf.subcommand(name, constructor=verb)] for name, verb in inner.items()]

    def group(verb: Any) -> int:
        return int(bool(verb))

    group.__annotations__ = {"verb": functools.reduce(operator.or_, choices), "return": int}
    return group
