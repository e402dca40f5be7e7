"""Base class of all settings, and validation errors that name the key and the nearest known one."""

import difflib
import types
import typing
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from groundwork.errors import InputError
from groundwork.foreign_file import MOST_TOML, parse_toml, read_regular


@dataclass(frozen=True)
class _OfAnotherType:
    """A value that no field accepts.

    Attributes:
        value: As it was written.
        wanted: What it should be.
    """

    value: Any
    wanted: str

    def __repr__(self) -> str:
        return repr(self.value)


class Settings(BaseModel):
    """Base of all settings: immutable, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _of_their_types(cls, values: Any) -> Any:
        """Mark what pydantic would convert, true for 1, "7" for 7, 1 for true, so that its field refuses it."""
        if not isinstance(values, dict):
            return values
        fields = cls.model_fields
        wanted = {name: _wanted(value, fields[name].annotation) for name, value in values.items() if name in fields}
        return {
            name: _OfAnotherType(value, what) if (what := wanted.get(name)) else value for name, value in values.items()
        }


S = TypeVar("S", bound=Settings)
_NEAR = 0.6  # [1] least likeness of a key that a wrong one may have meant: of letters in common
MANY = 8  # errors of one file that are listed before the rest is counted


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file as nested dicts.

    Args:
        path: File to read.

    Raises:
        MissingError: There is no such file.
        InputError: Not a regular file, or it is not TOML, or not UTF-8.
    """
    return parse_toml(read_regular(path, MOST_TOML), path)


def parse_settings(model: type[S], values: dict[str, Any], where: object, options: Collection[str] = ()) -> S:
    """Validate nested dicts as settings.

    Args:
        model: The settings class.
        values: Values from the user.
        where: File name for the error message.
        options: Keys that the user gave as options of the command line; an error names them as such, without `where`.

    Raises:
        InputError: All errors: unknown keys (each with the nearest known one), wrong types, values out of range.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        details = error.errors()
        if len(details) == 1:
            raise _as_input_error(model, details[0], where, options) from None
        found = [
            f"({number}) {_as_input_error(model, detail, None, options)}" for number, detail in enumerate(details, 1)
        ]
        shown = "; ".join(found[:MANY]) + (f"; and {len(found) - MANY} more" if len(found) > MANY else "")
        raise InputError(f"{len(found)} errors: {shown}", where=where) from None


def _types_in(annotation: Any) -> set[Any]:
    """Collect the types that an annotation joins, of items of its collections too, and the values of its literals."""
    inner = typing.get_args(annotation)
    if typing.get_origin(annotation) is typing.Literal:
        return {type(value) for value in inner}
    inner = tuple(part for part in inner if part is not Ellipsis and not isinstance(part, FieldInfo))
    return set().union(*map(_types_in, inner)) if inner else {annotation}


def _wanted(value: Any, annotation: Any) -> str | None:
    """Say what a value should be, if its type is another one; None if it is right, or is judged elsewhere."""
    types = _types_in(annotation) - {type(None)}
    if isinstance(value, list | tuple):
        wrong = next((wanted for item in value if (wanted := _single(item, types))), None)
        return f"a list, each of it {wrong}" if wrong else None
    return _single(value, types)


def _single(value: Any, types: set[Any]) -> str | None:
    if types == {bool} and type(value) in (int, float, str):
        return "true or false"
    if types and types <= {int, float} and type(value) in (bool, str):
        return "a number"
    return None


def _as_input_error(model: type[Settings], detail: ErrorDetails, where: object, options: Collection[str]) -> InputError:
    field = _field(model, detail)
    if field in options:
        field, where = f"--{field.replace('_', '-')}", None
    if detail["type"] == "extra_forbidden":
        known = _known_keys(model, detail["loc"][:-1])
        near = difflib.get_close_matches(str(detail["loc"][-1]), known, n=1, cutoff=_NEAR)
        hint = f"Did you mean {near[0]!r}?" if near else "Remove it"
        return InputError("unknown key", where=where, field=field, allowed=", ".join(known) or "none", hint=hint)
    context = detail.get("ctx", {})
    if detail["type"] in ("union_tag_not_found", "union_tag_invalid"):
        key = str(context["discriminator"]).replace("'", "")
        tags = [
            tag
            for member in _models_at(model, detail["loc"])
            for tag in typing.get_args(member.model_fields[key].annotation)
        ]
        found = detail["input"].get(key) if isinstance(detail["input"], dict) else None
        return InputError(
            "missing or unknown kind", where=where, field=f"{field}.{key}", value=found, allowed=", ".join(tags)
        )
    what, value = _plain(detail, field), detail["input"]
    if detail["type"] == "missing":
        return InputError(what, where=where, field=field, hint="Add it")
    if not field or (detail["type"] == "value_error" and isinstance(value, dict)):
        # Of incompatible keys the value would be the whole section or file.
        return InputError(what, where=where, field=field or None, hint="Correct this value")
    value = value.value if isinstance(value, _OfAnotherType) else value
    return InputError(what, where=where, field=field, value=value, hint="Correct this value")


def _field(model: type[Settings], detail: ErrorDetails) -> str:
    """Name a key as in its file, without the tags of unions, such as `global`, that pydantic adds to the path."""
    location = detail["loc"]
    tags = [
        number
        for number, part in enumerate(location)
        if isinstance(part, str)
        and not (detail["type"] == "extra_forbidden" and number == len(location) - 1)
        and not any(part in inner.model_fields for inner in _models_at(model, location[:number]))
        and any(_is_tagged(inner, part) for inner in _models_at(model, location[:number]))
    ]
    return ".".join(str(part) for number, part in enumerate(location) if number not in tags)


def _plain(detail: ErrorDetails, field: str) -> str:
    """Say what is wrong with a value in the words of a TOML file."""
    if isinstance(detail["input"], _OfAnotherType):
        return f"should be {detail['input'].wanted}"
    key, value, context = field.rpartition(".")[2], detail["input"], detail.get("ctx", {})
    match detail["type"]:
        case "model_type" | "model_attributes_type" | "dict_type":
            return f"should be a section, [{field}]" if isinstance(value, str | int | float) else "should be a section"
        case "tuple_type" | "list_type":
            several = isinstance(value, dict)
            return f"should be a list: write [[{key}]], with two brackets" if several else "should be a list: [ … ]"
        case "missing":
            return "is missing"
        case "too_long":
            return f"should have at most {context['max_length']} values"
        case "too_short":
            return f"should have at least {context['min_length']} values"
        case "string_pattern_mismatch":
            return f"should match {context['pattern']}"
        case kind if kind.startswith("datetime_") or kind.startswith("timezone_"):
            return "should be a date and hour, such as 2024-06-21T14:00"
        case _:
            return detail["msg"].removeprefix("Value error, ")


def _known_keys(model: type[Settings], location: tuple[int | str, ...]) -> list[str]:
    return sorted({key for inner in _models_at(model, location) for key in inner.model_fields})


def _models_at(model: type[Settings], location: tuple[int | str, ...]) -> list[type[Settings]]:
    """Find the models that are possible at a location of the input."""
    current: list[type[Settings]] = [model]
    for part in location:
        if isinstance(part, int):
            continue
        fields = [m.model_fields[part] for m in current if part in m.model_fields]
        below = [inner for field in fields for inner in models_in(field.annotation)]
        tagged = [m for m in current if m.__name__ == part or _is_tagged(m, part)]
        current = below or tagged or current
    return current


def _is_tagged(model: type[Settings], tag: str) -> bool:
    """Tell whether a member of a union has a tag, such as `kind = "local"`."""
    return any(tag in typing.get_args(field.annotation) for field in model.model_fields.values())


def models_in(annotation: object) -> list[type[Settings]]:
    """List the sections that a field may hold.

    Args:
        annotation: Type of the field: a section, or a union or container of sections.
    """
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, Settings) else []
    return [inner for argument in typing.get_args(annotation) for inner in models_in(argument)]
