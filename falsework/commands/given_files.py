"""What a user names and is not there, or is a file where a folder is wanted, is said before any room is loaded."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tyro

from groundwork.errors import InputError, MissingError

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


def need_folder(place: Path, wanted: str, field: str | None = None) -> None:
    """Refuse a file where a verb reads a folder, and what is not there.

    Args:
        place: What the user named.
        wanted: What it should be, such as `a capture, or a folder of photographs`.
        field: The option that named it; None for an argument without one.

    Raises:
        MissingError: Nothing is there.
        InputError: It is a file.
    """
    if place.is_dir():
        return
    if not place.exists():
        raise MissingError("no such folder", where=place, field=field, hint=f"Name {wanted}")
    raise InputError("is a file, and a folder is wanted here", where=place, field=field, hint=f"Name {wanted}")
