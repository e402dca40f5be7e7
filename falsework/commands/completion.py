"""The verb `falsework completion`: what a shell needs to complete verbs and options on Tab."""

import contextlib
import functools
import io
import operator
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Annotated, Any, Literal

import tyro

PROGRAM = "falsework"


def completion(shell: tyro.conf.Positional[Literal["bash", "zsh", "fish"]]) -> int:
    """Print the script with which a shell completes verbs, options and their choices on Tab.

    Write it to `~/.local/share/bash-completion/completions/falsework` for bash, to a file `_falsework` in a folder of
    `fpath` for zsh, to `~/.config/fish/completions/falsework.fish` for fish; then start a new shell.

    Args:
        shell: The shell that will read it.
    """
    sys.stdout.write(completion_script(shell))
    return 0


def completion_script(shell: str) -> str:
    """Spell the script of one shell.

    Args:
        shell: bash, zsh or fish.
    """
    verbs = all_verbs()
    heads = dict.fromkeys(name.split()[0] for name in verbs)
    chosen = {head: verbs[head] if head in verbs else _group(head, verbs) for head in heads}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
        tyro.extras.subcommand_cli_from_dict(
            chosen,
            prog=PROGRAM,
            args=["--tyro-print-completion", shell],
            config=(tyro.conf.FlagCreatePairsOff, tyro.conf.OmitSubcommandPrefixes),
        )
    return printed.getvalue()


def _group(head: str, verbs: dict[str, Callable[..., int]]) -> Callable[..., int]:
    """A verb whose one argument is which of its verbs is meant: what the parser makes a second word of."""
    inner = {name.partition(" ")[2]: verb for name, verb in verbs.items() if name.startswith(f"{head} ")}
    choices = [Annotated[Any, tyro.conf.subcommand(name, constructor=verb)] for name, verb in inner.items()]

    def group(verb: Any) -> int:
        return int(bool(verb))

    group.__annotations__ = {"verb": functools.reduce(operator.or_, choices), "return": int}
    return group


def all_verbs() -> dict[str, Callable[..., int]]:
    """Collect every verb, those of groups under two words.

    Returns:
        Name of each verb as one types it, and its function.
    """
    from falsework.cli import GROUPS, SINGLE, VERBS

    found = {name: verb for name, verb in VERBS.items() if name not in GROUPS and name not in SINGLE}
    for name, (module, _) in SINGLE.items():
        found[name] = getattr(import_module(f"falsework.commands.{module}"), name)
    for group in GROUPS:
        module = import_module(f"falsework.commands.{group}_verbs")
        found |= {f"{group} {name}": verb for name, verb in getattr(module, f"{group.upper()}_VERBS").items()}
    return found
