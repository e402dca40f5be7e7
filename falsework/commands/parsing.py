"""Parsing of the command line into the call of a verb; errors are reported in one line."""

import contextlib
import difflib
import functools
import inspect
import io
import re
import sys
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import tyro

from falsework.commands.given_files import files_first
from falsework.commands.given_settings import check_seed
from groundwork.errors import InputError

# Options have no negation and no value None; positional arguments are shown by their names.
CONFIG: tuple[Any, ...] = (
    tyro.conf.FlagCreatePairsOff,
    tyro.conf.DisallowNone,
    tyro.conf.PositionalMetavarFromFieldName,
)
_NUMBERS = {"int()": "not a whole number", "to float": "not a number"}  # names of Python's types → words for users

Verb = Callable[..., int]


def parse(verb: Verb, program: str, words: list[str]) -> Callable[[], int]:
    """Parse the arguments of a verb.

    Args:
        verb: Function of the command line.
        program: Command as typed, such as `falsework scene info`.
        words: The words after it.

    Returns:
        The call: it checks the input files, and then runs the verb.

    Raises:
        InputError: An argument is missing, unknown or invalid.
    """
    printed = io.StringIO()  # the parser prints errors in a frame; scripts and logs need one line
    try:
        with contextlib.redirect_stderr(printed):
            call = tyro.cli(_later(verb), prog=program, args=words, config=CONFIG)
    except SystemExit as left:
        if left.code and printed.getvalue():
            raise _unknown_option(verb, program, words) or _as_input_error(printed.getvalue(), program) from None
        raise
    sys.stderr.write(printed.getvalue())  # warnings
    return call


def parse_verb(verbs: Mapping[str, Verb], program: str, words: list[str], about: str) -> Callable[[], int]:
    """Parse the name of a verb and its arguments.

    Args:
        verbs: Name to function.
        program: Command as typed, such as `falsework scene`.
        words: The words after it.
        about: Text above the list of verbs in the help.

    Returns:
        The call.

    Raises:
        InputError: No verb, an unknown verb, or wrong arguments.
    """
    if words and words[0] in verbs:
        return parse(verbs[words[0]], f"{program} {words[0]}", words[1:])
    if {"-h", "--help"} & set(words):
        return _help(verbs, program, about)
    named = [word for word in words if not word.startswith("-")][:1]
    near = difflib.get_close_matches(named[0], verbs, n=1, cutoff=0.5) if named else []
    raise InputError(
        "no such verb" if named else "no such option" if words else "no verb",
        where=program.partition(" ")[2] or None,
        value=(named or words or [None])[0],
        allowed=", ".join(verbs),
        hint=f"Did you mean {near[0]!r}?" if near else f"See {program} --help",
    )


def _help(verbs: Mapping[str, Verb], program: str, about: str) -> Callable[[], int]:
    """List the verbs, each with the first sentence of its description."""

    def line(verb: Verb) -> Callable[[], int]:
        def shown() -> int:
            return 0

        shown.__doc__ = (inspect.getdoc(verb) or "").partition("\n\n")[0]
        return shown

    lines = {name: line(verb) for name, verb in verbs.items()}
    shown = tyro.extras.subcommand_cli_from_dict(lines, prog=program, description=about, args=["--help"], config=CONFIG)
    return lambda: shown


def _later(verb: Verb) -> Callable[..., Callable[[], int]]:
    """Wrap a verb so that parsing binds its arguments, and checks a seed, without calling it."""

    @functools.wraps(verb)
    def bound(*values: Any, **named: Any) -> Callable[[], int]:
        check_seed(named.get("seed"), "--seed")
        return functools.partial(files_first(verb), *values, **named)

    signature = inspect.signature(verb)
    del bound.__wrapped__  # else the parser reads the words and defaults of the verb itself
    bound.__signature__ = signature  # pyright: ignore[reportAttributeAccessIssue]
    bound.__annotations__ = {name: _quiet(parameter.annotation) for name, parameter in signature.parameters.items()}
    bound.__doc__ = _joined(inspect.getdoc(verb) or "")
    return bound


def _quiet(said: Any) -> Any:
    """Leave out of the help a default that only means that the option is not given."""
    known = getattr(said, "__metadata__", ())
    base = said.__origin__ if known else said
    if tyro.conf.UseAppendAction in known:  # their help says that they may be repeated
        return said
    return Annotated[(base, tyro.conf.arg(help_behavior_hint=_default), *known)]


def _default(label: str) -> str:
    return "" if label in ("", "''", "None", "False") else f"(default: {label})"


def _joined(doc: str) -> str:
    """Undo the line breaks of the source: the help breaks lines where the terminal ends."""
    return re.sub(r"(?<=\S)\n(?: {8,}(?=\S)|(?=\S))", " ", doc)


def _unknown_option(verb: Verb, program: str, words: list[str]) -> InputError | None:
    """Name the first option that a verb does not have: in front of an argument the parser says that this is missing."""
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.suppress(SystemExit):
        tyro.cli(_later(verb), prog=program, args=["--help"], config=CONFIG)
    known = set(re.findall(r"(?<![\w-])--[a-z0-9-]+", shown.getvalue()))
    given = (word.partition("=")[0].replace("_", "-") for word in words if word.startswith("--") and len(word) > 2)
    wrong = next((option for option in given if option not in known), None)
    if wrong is None:
        return None
    near, hint = difflib.get_close_matches(wrong, sorted(known), n=1), f"See {program} --help"
    hint = f"Did you mean {near[0]}? {hint}" if near else hint
    return InputError("no such option", where=program.partition(" ")[2] or None, value=wrong, hint=hint)


def _as_input_error(printed: str, program: str) -> InputError:
    """Convert the parser's framed error to one line."""
    verb = program.partition(" ")[2] or None  # the program is already named
    title, parts = _parts(printed)
    said, hint = " ".join(" ".join(parts[0]).split()), f"See {program} --help"
    if title == "Required options":
        missing = [_option(line) for line in parts[0] if re.match(r" {4}\S", line)]
        return InputError(f"missing: {', '.join(missing)}", where=verb, hint=hint)
    if found := re.fullmatch(r"Unrecognized options: (\S+?)(?:, .*)?", said):
        like = [_option(line) for part in parts[1:] for line in part if re.match(r" {4}--", line)]
        what = "no such option" if found[1].startswith("-") else "too many arguments"
        return InputError(what, where=verb, value=found[1], hint=f"Did you mean {like[0]}? {hint}" if like else hint)
    if found := re.fullmatch(r"invalid choice '(.*)' for argument '(.*)'\. Expected one of \((.*?),?\)\.", said):
        choices = re.findall(r"'([^']*)'", found[3])
        if "None" in choices:  # the parser does not sort the choices of an optional one
            choices = sorted({*choices} - {"None"})
        near = difflib.get_close_matches(found[1], choices, n=1)
        return InputError(
            "not one of the choices",
            where=verb,
            field=found[2],
            value=found[1],
            allowed=", ".join(choices),
            hint=f"Did you mean {near[0]!r}?" if near else None,
        )
    if found := re.match(r"Missing value for argument '([^']*)'", said):
        return InputError("its value is missing", where=verb, field=_argument(found[1]), hint=hint)
    if found := re.fullmatch(
        r"Error parsing (\S+): .*input length (\d+) did not match expected argument count (\d+).*", said
    ):
        return InputError(f"needs {found[3]} values", where=verb, field=found[1], value=int(found[2]), hint=hint)
    if found := re.fullmatch(r"Error parsing (\S+): (.*?)(?:: '(.*)')?", said):
        what = next((ours for theirs, ours in _NUMBERS.items() if theirs in found[2]), found[2])
        return InputError(what, where=verb, field=found[1], value=found[3], hint=hint)
    return InputError(said, where=verb, hint=hint)


def _argument(name: str) -> str:
    return name if name.startswith("-") else name.upper()


def _parts(printed: str) -> tuple[str, list[list[str]]]:
    """Split a frame into its title and the lines between its rules, with their indentation."""
    first, *lines = re.sub(r"\x1b\[[0-9;]*m", "", printed).splitlines()
    parts: list[list[str]] = [[]]
    for line in lines:
        inner = line[2:].rstrip(" │")  # without line-drawing characters the frame consists of blanks
        if inner.strip() and not inner.strip("─-╭╮╰╯ "):
            parts.append([])
        else:
            parts[-1].append(inner)
    return first.strip("─╭╮ "), [part for part in parts if part]


def _option(line: str) -> str:
    """Format an argument as typed: its name, or all names of an option without its value."""
    names = [word.strip(",") for word in line.split() if word.startswith("-")]
    return "/".join(names) or line.strip()
