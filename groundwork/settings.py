"""Base class of all settings, and validation errors that name the key and the nearest known one."""

import difflib
import types
import typing
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from groundwork.errors import InputError
from groundwork.foreign_file import MOST_TOML, parse_toml, read_regular


class Settings(BaseModel):
    """Base of all settings: immutable, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)


S = TypeVar("S", bound=Settings)
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


def parse_settings(model: type[S], values: dict[str, Any], where: object) -> S:
    """Validate nested dicts as settings.

    Args:
        model: The settings class.
        values: Values from the user.
        where: File name for the error message.

    Raises:
        InputError: All errors: unknown keys (each with the nearest known one), wrong types, values out of range.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        details = error.errors()
        if len(details) == 1:
            raise _as_input_error(model, details[0], where) from None
        found = [f"({number}) {_as_input_error(model, detail, None)}" for number, detail in enumerate(details, 1)]
        shown = "; ".join(found[:MANY]) + (f"; and {len(found) - MANY} more" if len(found) > MANY else "")
        raise InputError(f"{len(found)} errors: {shown}", where=where) from None


def _as_input_error(model: type[Settings], detail: ErrorDetails, where: object) -> InputError:
    field = _field(model, detail)
    if detail["type"] == "extra_forbidden":
        known = _known_keys(model, detail["loc"][:-1])
        near = difflib.get_close_matches(str(detail["loc"][-1]), known, n=1, cutoff=0.0)
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
    if not field:  # incompatible keys: the message names them; the value would be the whole file
        return InputError(_plain(detail["msg"]), where=where, hint="Correct this value")
    return InputError(_plain(detail["msg"]), where=where, field=field, value=detail["input"], hint="Correct this value")


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


def _plain(message: str) -> str:
    return message.removeprefix("Value error, ").replace("Input should be a valid tuple", "should be a list: [ … ]")


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
