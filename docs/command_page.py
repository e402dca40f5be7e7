"""Generator of the command-line reference, from the functions of the verbs."""

import inspect
import types
import typing
from collections.abc import Callable
from pathlib import Path

import docstring_parser
import tyro

from falsework.cli import all_verbs
from falsework.commands.examples import EXAMPLES

_POSITIONAL: object = tyro.conf.Positional  # its marker in an annotation
_TOPICS = {
    "First steps": ("doctor", "demo", "completion"),
    "Whole runs": ("plan", "run", "verify", "clean", "report", "view"),
    "Stages": ("author", "preview", "scene", "background", "survey", "gallery"),
    "Photographs and clouds": ("render", "reconstruct", "sample", "export"),
    "Learning": ("dataset", "train", "evaluate", "compare", "predict"),
}


def commands_page() -> str:
    """Format every verb as Markdown: description, example, options."""
    lines = [
        "# The command line",
        "",
        "Generated from the functions behind the verbs by `python -m docs.generate`.",
        "",
    ]
    lines += [
        "`falsework VERB --help` says the same. Results go to stdout, progress and errors to stderr.",
        "`falsework completion bash` prints a script that completes verbs and options in a shell.",
        "",
        "| exit code | meaning |",
        "|---|---|",
        "| 0 | done; in `run`, rejected scenes are results and are counted |",
        "| 1 | an internal error; `doctor` found a failure; `verify` found damage, or scenes without results |",
        "| 2 | bad input: one line names file, field, value, what is allowed, and what to do |",
        "| 3 | some scenes failed, or the result of a single verb was rejected |",
        "| 4 | the disk is full; repeat the command when there is room: it continues |",
        "| 130, 143 | interrupted; repeat the command: it continues |",
        "",
    ]
    verbs = all_verbs()
    for topic, heads in _listed(verbs).items():
        lines += [f"## {topic}", ""]
        for name in heads:
            lines += _verb(name, verbs[name])
    return "\n".join(lines)


def _listed(verbs: dict[str, Callable[..., int]]) -> dict[str, list[str]]:
    """Sort the verbs by topic; verbs without a topic come last, so that no new verb is missing."""
    order = {head: topic for topic, heads in _TOPICS.items() for head in heads}
    found: dict[str, list[str]] = {topic: [] for topic in [*_TOPICS, "Others"]}
    for name in sorted(verbs, key=lambda name: list(order).index(name.split()[0]) if name.split()[0] in order else 99):
        found[order.get(name.split()[0], "Others")].append(name)
    return {topic: names for topic, names in found.items() if names}


def _verb(name: str, verb: Callable[..., int]) -> list[str]:
    said = docstring_parser.parse(inspect.getdoc(verb) or "")
    about = "\n\n".join(part for part in (said.short_description, said.long_description) if part)
    meaning = {one.arg_name: " ".join((one.description or "").split()) for one in said.params}
    lines = [f"### `falsework {name}`", "", about, "", "```sh", *EXAMPLES.get(name, (f"falsework {name}",)), "```", ""]
    rows = [_row(parameter, hint, meaning) for parameter, hint in _parameters(verb)]
    return lines + (["| option | default | meaning |", "|---|---|---|", *rows, ""] if rows else [])


def _parameters(verb: Callable[..., int]) -> list[tuple[inspect.Parameter, object]]:
    hints = typing.get_type_hints(verb, include_extras=True)
    return [(parameter, hints[name]) for name, parameter in inspect.signature(verb).parameters.items()]


def _row(parameter: inspect.Parameter, hint: object, meaning: dict[str, str]) -> str:
    """Format one row of the table: the option as typed, its default, its meaning."""
    notes = typing.get_args(hint)[1:] if typing.get_origin(hint) is typing.Annotated else ()
    plain = typing.get_args(hint)[0] if notes else hint
    given = next((note.name for note in notes if getattr(note, "name", None)), None)
    word = str(given or parameter.name).replace("_", "-")
    required = parameter.default is inspect.Parameter.empty
    positional = any(note is _POSITIONAL for note in notes)
    long = word.upper() if positional else f"--no-{word}" if parameter.default is True else f"--{word}"
    short = "-o, " if any("-o" in (getattr(note, "aliases", None) or ()) for note in notes) else ""
    value = "" if positional or plain is bool else f" {_value(plain)}"
    default = "required" if required else _default(parameter.default)
    text = meaning.get(parameter.name, "").replace("|", "\\|")
    return f"| `{short}{long}{value}` | {default} | {text} |"


def _value(plain: object) -> str:
    """Format the value of an option: its choices, or its type."""
    inside = [part for part in typing.get_args(plain) if part is not type(None)]
    origin = typing.get_origin(plain)
    if origin is typing.Literal:
        return "\\|".join(map(str, inside))
    if origin is typing.Annotated:
        return _value(inside[0])
    if origin in (typing.Union, types.UnionType):
        return _value(inside[0])
    if origin is tuple:
        return f"{_value(inside[0])} …"
    return {int: "N", float: "X", str: "TEXT", Path: "PATH"}.get(typing.cast(type, plain), "VALUE")


def _default(value: object) -> str:
    return "–" if value in (None, "", ()) or isinstance(value, bool) else f"`{value}`"
