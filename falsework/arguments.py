"""Arguments of the Python API: a wrong one is an `InputError` that names it, before anything is made."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from functools import wraps
from numbers import Integral, Real
from os import PathLike, fspath
from pathlib import Path
from typing import ParamSpec, TypeVar

from groundwork.errors import InputError
from groundwork.progress import Progress

P = ParamSpec("P")
R = TypeVar("R")

_ARGUMENTS = {"-o": "out", "--output": "out", "--allow-root": "allow_roots"}  # option to argument, if they differ
_CHOICES = {
    "--camera": "camera",
    "--frame": "frames",
    "--purpose": "purposes",
    "--variant": "variants",
    "--width": "width",
    "--height": "height",
    "--subdivision": "subdivision",
}
_OPTION = re.compile(
    r"""(?<![\w/.-])falsework\ [a-z](?:[^.;]|\.(?!\s|$))*  # a whole command stays as it is
    | (?<![\w'])'(?:[^'\\]|\\.)*'(?!\w) | (?<![\w"])"(?:[^"\\]|\\.)*"(?!\w)  # so does what a user wrote
    | (?<![^\s(])(-[a-z]|--[a-z]+(?:-[a-z]+)*)(?=[.,;:)]*(?:\s|$))""",
    re.VERBOSE,
)


def of_python(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function of the API: its errors name its arguments instead of options of the command line.

    Args:
        function: The function.
    """
    parameters = inspect.signature(function).parameters
    names = {option: name for option, name in _ARGUMENTS.items() if name in parameters}
    names |= {f"--{name.replace('_', '-')}": name for name in parameters}
    if "choices" in parameters:
        names |= {option: f"choices.{name}" for option, name in _CHOICES.items()}

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except InputError as error:
            text, place = str(error), "" if error.where is None else f"{' '.join(str(error.where).split())}: "
            kept = len(place) if text.startswith(place) else 0  # a file's name may look like an option
            told = _OPTION.sub(lambda found: names.get(found[1], found[0]), text[kept:])
            error.args = (text[:kept] + told,)
            raise

    return call


def path_of(given: object, name: str) -> Path:
    """Convert a path that a user gave.

    Args:
        given: A str or a Path.
        name: Name of the argument, for the error.

    Raises:
        InputError: Anything else, bytes included.
    """
    spelled = fspath(given) if isinstance(given, str | PathLike) else None
    if not isinstance(spelled, str):
        raise InputError("not a path", field=name, value=type(given).__name__, allowed="a str or a pathlib.Path")
    return Path(spelled)


def whole(given: object, name: str) -> int:
    """Convert a whole number that a user gave, also one of numpy.

    Args:
        given: The number.
        name: Name of the argument, for the error.

    Raises:
        InputError: Anything else, True and False included.
    """
    check(given, name, Integral, "a whole number")
    return int(given)  # type: ignore[call-overload]


def whole_numbers(given: object, name: str) -> list[int]:
    """Convert several whole numbers that a user gave.

    Args:
        given: A list, a range or another iterable of numbers.
        name: Name of the argument, for the error.

    Raises:
        InputError: Anything else.
    """
    allowed = "whole numbers, such as [0, 2] or range(3)"
    if isinstance(given, str | bytes | Mapping):
        check(given, name, (), allowed)
    try:
        items = list(given)  # type: ignore[call-overload]
    except TypeError:  # also an array without an axis
        check(given, name, (), allowed)
        raise
    return [whole(one, name) for one in items]


def flag(given: object, name: str) -> bool:
    """Convert True or False that a user gave, also one of numpy.

    Args:
        given: The value.
        name: Name of the argument, for the error.

    Raises:
        InputError: Anything else, 0 and 1 included.
    """
    if type(given).__module__ == "numpy" and type(given).__name__ in ("bool", "bool_"):  # numpy is not loaded here
        return bool(given)
    check(given, name, bool, "True or False")
    return bool(given)


def gigabytes(given: object, name: str) -> float | None:
    """Convert an amount of memory that may be left out.

    Args:
        given: A number, or None.
        name: Name of the argument, for the error.

    Returns:
        The number [GB], or None.

    Raises:
        InputError: Anything else, True and False included.
    """
    check(given, name, (Real, type(None)), "a number of GB, or None")
    return None if given is None else float(given)  # type: ignore[arg-type]


def check(given: object, name: str, kind: type | tuple[type, ...], allowed: str) -> None:
    """Refuse a value of a wrong type.

    Args:
        given: The value.
        name: Name of the argument.
        kind: Type or types that it may have; True and False are no numbers.
        allowed: The same in words.

    Raises:
        InputError: It has another type.
    """
    if not isinstance(given, kind) or (isinstance(given, bool) and kind is not bool):
        raise InputError("of a wrong type", field=name, value=type(given).__name__, allowed=allowed)


def check_text(given: object, name: str) -> None:
    """Refuse what is neither text nor left out.

    Args:
        given: The value.
        name: Name of the argument.

    Raises:
        InputError: It is of another type.
    """
    check(given, name, (str, type(None)), "a str, or None")


def check_progress(given: object) -> None:
    """Refuse what cannot listen to progress.

    Args:
        given: The argument `progress`.

    Raises:
        InputError: A method is missing.
    """
    methods = [name for name in vars(Progress) if not name.startswith("_")]
    if isinstance(given, type) or not all(callable(getattr(given, name, None)) for name in methods):
        allowed = f"an object with the methods {', '.join(methods)}, such as ConsoleProgress()"
        raise InputError("cannot listen", field="progress", value=type(given).__name__, allowed=allowed)
