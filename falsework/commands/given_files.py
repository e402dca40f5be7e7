"""A file that a user names and that is not there is said at once, before a room is loaded that would read it."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tyro

from groundwork.errors import MissingError

GIVEN = tyro.conf.Positional[Path]  # how the verbs annotate what they read


def files_first(verb: Callable[..., int]) -> Callable[..., int]:
    """Let a verb look for the files that it is given before it does anything else.

    Args:
        verb: Function of the command line; its arguments of the type `GIVEN` are files or folders that it reads.

    Returns:
        The same verb, which raises `MissingError` for the first of them that is not there.
    """
    signature = inspect.signature(verb)
    given = [name for name, parameter in signature.parameters.items() if parameter.annotation == GIVEN]

    @functools.wraps(verb)
    def checked(*values: Any, **named: Any) -> int:
        arguments = signature.bind(*values, **named).arguments
        for name in given:
            if not arguments[name].exists():
                raise MissingError("no such file or folder", where=arguments[name], hint="Check the path")
        return verb(*values, **named)

    return checked
