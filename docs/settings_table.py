"""Write settings models as Markdown: one table a model, one row a key."""

import types
import typing

from pydantic_core import PydanticUndefined

from authoring.surveys.settings import LegSettings
from groundwork.settings import Settings, models_in


def table(model: type[Settings]) -> list[str]:
    """Write the keys of a model that hold a value, not further settings.

    Args:
        model: The settings model.

    Returns:
        Lines of a Markdown table; none where every key holds further settings.
    """
    rows = []
    for key, field in model.model_fields.items():
        if _is_list_of_kinds(field.annotation):
            rows.append(f"| `{key}` | sections `[[survey.{key}]]` of the kinds above | – | {field.description} |")
        elif not models_in(field.annotation) and not (key == "kind" and kind_of(model)):
            default = field.get_default(call_default_factory=True, validated_data={})
            nothing = "–" if "left out" in (field.description or "") else "drawn"
            shown = (
                "required" if default is PydanticUndefined else nothing if default is None else f"`{_toml(default)}`"
            )
            meaning = (field.description or "").replace("\n", " ").replace("|", "\\|")
            rows.append(f"| `{key}` | {_type_name(field.annotation)} | {shown} | {meaning} |")
    return ["| key | type | default | meaning |", "|---|---|---|---|", *rows] if rows else []


def sections(model: type[Settings], name: str = "") -> list[tuple[str, type[Settings]]]:
    """List a model and all models within it.

    Args:
        model: The settings model.
        name: Its section's name; empty for the top level.

    Returns:
        Name of the section and its model, outermost first; a section of several kinds comes once for each.
    """
    found = [(name, model)]
    for key, field in model.model_fields.items():
        for inner in [] if _is_list_of_kinds(field.annotation) else models_in(field.annotation):
            found += sections(inner, f"{name}.{key}" if name else key)
    return found


def kind_of(model: type[Settings]) -> str:
    """Give the one value that the key `kind` of a model may have; empty where there is no such key."""
    field = model.model_fields.get("kind")
    choices: tuple[typing.Any, ...] = typing.get_args(field.annotation) if field else ()
    if field is None or typing.get_origin(field.annotation) is not typing.Literal or len(choices) != 1:
        return ""
    (only,) = choices
    return str(only)


def _toml(value: object) -> str:
    """Write a default as it would appear in a scenario."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_toml(inner)}' for key, inner in value.items())}}}"
    return str(value).lower() if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) else str(value)


def _is_list_of_kinds(annotation: object) -> bool:
    """Check whether a field lists sections of several kinds that the page shows anyway, such as the legs of a mix."""
    return {model.__name__ for model in models_in(annotation)} == {model.__name__ for model in models_in(LegSettings)}


def _type_name(annotation: object) -> str:
    """Describe a type for a reader of a TOML file: choices one after the other, lists of something, tables."""
    origin = typing.get_origin(annotation)
    inside: tuple[typing.Any, ...] = typing.get_args(annotation)
    if annotation is type(None):
        return ""
    if origin is typing.Literal:
        return ", ".join(f"`{choice}`" for choice in inside)
    if origin is typing.Annotated:
        return _type_name(inside[0])
    if origin in (typing.Union, types.UnionType):
        return " or ".join(name for part in inside if (name := _type_name(part)))
    if origin is tuple and Ellipsis in inside:
        return f"list of {_type_name(inside[0])}"
    if origin is tuple:
        return f"[{', '.join(map(_type_name, inside))}]"
    if origin is dict:
        return f"table: {_type_name(inside[0])} = {_type_name(inside[1])}"
    return annotation.__name__ if isinstance(annotation, type) else str(annotation)
