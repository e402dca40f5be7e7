"""Errors are one line that a user can act on."""

from pathlib import Path

import pytest

from groundwork.errors import (
    ChildError,
    FalseworkError,
    InputError,
    MissingError,
    OutOfSpaceError,
    RejectedSceneError,
    show_place,
)


def test_parts_of_an_input_error_stand_in_order() -> None:
    """File, field, what, value, allowed, mend."""
    error = InputError("too deep", where="a.toml", field="beam.depth", value=9.0, allowed="0.4 to 3.0", hint="Lower it")
    assert str(error) == "a.toml: beam.depth: too deep (found 9.0); allowed: 0.4 to 3.0. Lower it"
    assert str(InputError("wrong")) == "wrong"


def test_the_place_is_said_once() -> None:
    """A value found wrong later than its file was read still names the file; who names a place keeps it."""
    error = InputError("too long", field="bridge.slab.spans")
    error.found_in("a.toml")
    error.found_in("b.toml")
    assert str(error) == "a.toml: bridge.slab.spans: too long"
    known = MissingError("no such file", where="c.toml")
    known.found_in("a.toml")
    assert str(known) == "c.toml: no such file"


@pytest.mark.parametrize("kind", [str, Path])
def test_a_temporary_place_becomes_the_final_one(kind: type[str] | type[Path]) -> None:
    """In the text and in the attribute."""
    error = InputError("is damaged", where=kind("/out/.next/a.npy"))
    show_place(error, Path("/out/.next"), Path("/out"))
    assert (str(error), error.where) == ("/out/a.npy: is damaged", kind("/out/a.npy"))


def test_line_breaks_are_taken_out() -> None:
    """A message from elsewhere with several lines still comes as one."""
    assert str(InputError("first\n  second", hint="third\n")) == "first second. third"


@pytest.mark.parametrize(
    ("error", "code", "kind"),
    [
        (InputError("x"), 2, ValueError),
        (MissingError("x"), 2, FileNotFoundError),
        (OutOfSpaceError("x"), 4, OSError),
        (ChildError("x"), 1, RuntimeError),
        (RejectedSceneError("few", "x"), 3, FalseworkError),
    ],
)
def test_exit_codes_and_kinds(error: FalseworkError, code: int, kind: type[Exception]) -> None:
    """Each error has the exit code of the design and the built-in kind that callers expect."""
    assert error.exit_code == code
    assert isinstance(error, kind)
    assert str(error) == "x"
